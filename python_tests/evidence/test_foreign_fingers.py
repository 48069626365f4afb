"""Fingers that judge the product: they share nothing with it, and two ways to build one of them agree."""

from __future__ import annotations

import dataclasses
import re

import numpy as np

from optional_parts import needs
from repository_paths import ROOT


def test_foreign_fingers_share_nothing_with_the_product() -> None:
    paths = list((ROOT / "evidence" / "fingers").glob("*.py"))
    assert len(paths) >= 8
    for path in paths:
        imported = re.findall(r"^\s*(?:from|import) (\S+)", path.read_text(encoding="utf-8"), re.MULTILINE)
        assert not [name for name in imported if name.startswith("tendonfmu") or "matched" in name], path.name


@needs("mujoco")
def test_spatial_and_fixed_tendons_make_the_same_finger() -> None:
    """Wrapped around cylinders on the joints' axes, tendons have constant arms: the two routings must agree."""
    from evidence.fingers import mujoco_cases, mujoco_run

    physics = mujoco_cases.finger(mujoco_cases.Plan("none", 3), np.random.default_rng(1))
    motion = mujoco_run.random_motion(3, np.random.default_rng(2))
    fixed, spatial = (
        mujoco_run.run(dataclasses.replace(physics, spatial=is_spatial), motion, 0.5, 250.0)
        for is_spatial in (False, True)
    )
    assert np.abs(fixed.angle - spatial.angle).max() < 1e-9
    assert np.abs(fixed.force - spatial.force).max() < 1e-6
