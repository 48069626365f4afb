"""A sample of evidence/recordings/check.py: one finger of plain numpy, all corruptions, and the judge itself."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from evidence.recordings import check


@pytest.fixture(scope="module")
def case() -> Any:
    """Numpy case 2: two joints, four tendons, stick-slip, joint angles measured."""
    from evidence.fingers import numpy_cases

    return numpy_cases.make(2)


@pytest.mark.slow
@pytest.mark.long
def test_every_corruption_of_a_finger_is_explained(case: Any) -> None:
    rows = check.checked("numpy", 2)["rows"]
    broken = [row for row in rows if row["family"] != "sound"]
    assert [row for row in broken if not row["explained"]] == []
    assert len(broken) > 60


@pytest.mark.slow
def test_a_sound_finger_has_no_errors(case: Any) -> None:
    rows = check.check_clean(case.name, case.nominal, case.test)
    assert len(rows) == 4 and not any(row["errors"] for row in rows)
    assert not rows[0]["warnings"]


def test_the_judge_takes_no_wrong_answer() -> None:
    """Another column, another factor, one column too many."""
    from tendonfmu.model.plausibility import Finding

    def said(entries: dict[str, dict[str, float]]) -> list[Any]:
        return [Finding("error", "sign", Path("x"), tuple(entries), "seen", "probably", "write", entries)]

    corruption = next(kind for kind in check.corruptions() if kind.name == "tendon_force, 1")
    right = {"tendon_force[2]": {"sign": -1.0}}
    chosen = ["tendon_force[2]"]
    assert check.is_explained(said(right), corruption, chosen, 4)
    assert not check.is_explained(said({"tendon_force[1]": {"sign": -1.0}}), corruption, chosen, 4)
    assert not check.is_explained(said(right | {"tendon_force[1]": {"sign": -1.0}}), corruption, chosen, 4)
    assert not check.is_explained(said({"tendon_force[2]": {"scale": 0.001}}), corruption, chosen, 4)
    assert not check.is_explained([], corruption, chosen, 4)
    held = dataclasses.replace(corruption, kinds=("held",), factor=None)
    assert not check.is_explained(said(right), held, chosen, 4)
    assert np.isfinite(corruption.factor)
