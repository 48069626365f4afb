"""Fingers that judge the product: they share nothing with it, and their forces hold their joints."""

from __future__ import annotations

import dataclasses
import re

import numpy as np
import pytest

from optional_parts import needs
from repository_paths import ROOT

FAMILIES = ROOT / "evidence" / "families"


def test_foreign_fingers_share_nothing_with_the_product() -> None:
    physics = [FAMILIES / f"{name}.py" for name in ("finger", "motion", "elastic", "imposed")]
    for path in physics:
        imported = re.findall(r"^\s*(?:from|import) (\S+)", path.read_text(encoding="utf-8"), re.MULTILINE)
        assert not [name for name in imported if name.startswith("tendonfmu") or "matched" in name], path.name


@needs("mujoco")
@pytest.mark.parametrize("family", ["elastic", "dahl", "maxwell"])
def test_forces_of_a_finger_by_seed_hold_its_joints(family: str) -> None:
    """Without friction, what the tendons pull is what cover and damping take; links of MuJoCo have inertia besides."""
    from evidence.families import cases
    from evidence.families.finger import Hidden
    from evidence.families.motion import random_motion

    made, _, rng = cases.machine(family, 3)
    smooth = dataclasses.replace(made, edge=0.0 * made.edge, friction=0.0 * made.friction)
    motion = random_motion(len(made.cover), made.pretension, rng)
    trace = cases.run(family, smooth, Hidden(), motion, 4.0, 3)
    velocity = np.gradient(trace.angle, trace.time, axis=0)
    held = made.cover * (trace.angle - made.rest) + made.damping * velocity
    left = (trace.force @ made.arms - held)[1:-1]
    assert np.sqrt((left**2).mean()) < (1e-3 if family == "elastic" else 1e-9)


@needs("mujoco")
def test_a_case_hides_what_its_seed_says_in_both_recordings_alike() -> None:
    from evidence.families import cases

    machines = [cases.machine("dahl", 5)[:2] for _ in range(2)]
    assert machines[0][1] == machines[1][1] and machines[0][1].effect == cases.ORDER[2]
    assert (machines[0][0].edge == machines[1][0].edge).all()
