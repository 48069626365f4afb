"""From a recording made in MuJoCo to its frictionloss: import, fit, export, against the model that moved."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from optional_parts import require

require("mujoco")

from mujoco_friction import guess, machine, record, recover
from tendonfmu.mjcf import export_numbers, import_finger
from tendonfmu.options import ImportOptions

INTERVAL = 1.96  # standard errors; 95 %


@pytest.mark.slow
def test_fitted_friction_is_that_of_the_model_that_moved(tmp_path: Path) -> None:
    for found in recover(tmp_path, seed=1):
        assert abs(found.value - found.true) <= INTERVAL * found.error, found
        assert found.error < 0.3 * found.true, found  # the error that returns with each cycle counts once in two


@pytest.mark.long
def test_a_replay_keeps_what_makes_the_model_better_and_no_other(tmp_path: Path) -> None:
    """The friction that moved is better than the guess; four times as much at one joint is not, and stays out."""
    record(machine(), tmp_path / "free.parquet", 2)
    (tmp_path / "guess.xml").write_text(guess(), encoding="utf-8")
    (tmp_path / "true.xml").write_text(machine(), encoding="utf-8")
    true = import_finger(tmp_path / "true.xml", ImportOptions(joints=("mcp", "pip"))).data
    true["joints"][1]["friction"] |= {"static": 0.016, "coulomb": 0.016}
    (tmp_path / "finger.json").write_text(json.dumps(true), encoding="utf-8")
    files = (tmp_path / name for name in ("finger.json", "guess.xml", "out.xml"))
    done = export_numbers(*files, None, [tmp_path / "free.parquet"])
    assert {(change.name, change.attribute) for change in done.changes} == {("mcp", "frictionloss"), ("mcp", "damping")}
    assert "pip: frictionloss 0.01 → 0.016 N·m: the replay leaves" in done.left_out[0]
    mcp, pip = done.replay
    assert mcp.after < 0.6 * mcp.before and pip.after == pip.before
    assert "mN·m are left" in mcp.line() and done.report(*[tmp_path] * 3)["replay"][0]["joint"] == "mcp"
