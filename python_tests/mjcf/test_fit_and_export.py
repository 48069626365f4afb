"""From a recording made in MuJoCo to its frictionloss: import, fit, export, against the model that moved."""

from __future__ import annotations

from pathlib import Path

import pytest

from optional_parts import require

require("mujoco")

from evidence.fit.mujoco_friction import recover

INTERVAL = 1.96  # standard errors; 95 %


@pytest.mark.slow
def test_fitted_friction_is_that_of_the_model_that_moved(tmp_path: Path) -> None:
    for found in recover(tmp_path, seed=1):
        assert abs(found.value - found.true) <= INTERVAL * found.error, found
        assert found.error < 0.12 * found.true, found
