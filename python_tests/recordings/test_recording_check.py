"""A sample of `bench/recording_check.py`: one finger of plain numpy, all corruptions, and the judge itself."""

from __future__ import annotations

import dataclasses
import sys
from collections import Counter, defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from repository_paths import ROOT

pytest.importorskip("tendonfmu._native", reason="SKIPPED: tendonfmu is not installed")


@pytest.fixture(scope="module")
def table() -> Iterator[Any]:
    """The module, with the folders it looks into."""
    before = list(sys.path)
    sys.path[:0] = [str(ROOT / "bench"), str(ROOT / "python_tests" / "foreign")]
    import recording_check

    yield recording_check
    sys.path[:] = before


@pytest.fixture(scope="module")
def case(table: Any) -> Any:
    """Numpy case 2: two joints, four tendons, stick-slip, joint angles measured."""
    import fingers_in_numpy

    return fingers_in_numpy.make(2)


@pytest.mark.slow
@pytest.mark.long
def test_every_corruption_of_a_finger_is_explained(table: Any, case: Any) -> None:
    counts: Any = defaultdict(Counter)
    finger = table.described(case.nominal)
    for corruption in table.corruptions():
        if table.applicable(case.test, corruption):
            table.check_corrupted(case.name, finger, case.test, corruption, counts, verbose=True)
    missed = {name for name, count in counts.items() if count["explained"] < count["all"]}
    assert missed == set()
    assert len(counts) > 60


@pytest.mark.slow
def test_a_sound_finger_has_no_errors(table: Any, case: Any) -> None:
    counts: Any = defaultdict(Counter)
    table.check_clean(case.name, case.nominal, case.test, counts, verbose=True)
    assert len(counts) == 4
    assert all(count["all"] == 1 and count["errors"] == 0 for count in counts.values())
    assert counts[("sound", "as recorded")]["warnings"] == 0


def test_the_judge_takes_no_wrong_answer(table: Any) -> None:
    """Another column, another factor, one column too many."""
    from tendonfmu.model.plausibility import Finding

    def said(entries: dict[str, dict[str, float]]) -> list[Any]:
        return [Finding("error", "sign", Path("x"), tuple(entries), "seen", "probably", "write", entries)]

    corruption = next(each for each in table.corruptions() if each.name == "tendon_force, 1")
    right = {"tendon_force[2]": {"sign": -1.0}}
    chosen = ["tendon_force[2]"]
    assert table.is_explained(said(right), corruption, chosen, 4)
    assert not table.is_explained(said({"tendon_force[1]": {"sign": -1.0}}), corruption, chosen, 4)
    assert not table.is_explained(said(right | {"tendon_force[1]": {"sign": -1.0}}), corruption, chosen, 4)
    assert not table.is_explained(said({"tendon_force[2]": {"scale": 0.001}}), corruption, chosen, 4)
    assert not table.is_explained([], corruption, chosen, 4)
    held = dataclasses.replace(corruption, kinds=("held",), factor=None)
    assert not table.is_explained(said(right), held, chosen, 4)
    assert np.isfinite(corruption.factor)
