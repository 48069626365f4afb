"""The reference traces are those of the oracle, in the form of the FMI cross-check."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import agreement
from repository_paths import TESTS
from runners import RUNNERS, Runner

REFERENCE = TESTS / "reference"
sys.path.insert(0, str(REFERENCE))

import make_reference_traces as traces  # noqa: E402

Array = NDArray[Any]
NAMES = list(traces.TRACES)


def read_csv(path: Path) -> tuple[list[str], Array]:
    lines = path.read_text(encoding="utf-8").splitlines()
    names = [name.strip('"') for name in lines[0].split(",")]
    return names, np.array([[float(cell) for cell in line.split(",")] for line in lines[1:]])


def grouped(names: list[str], rows: Array) -> dict[str, Array]:
    """name[1], name[2], ... as one array [N, columns]; scalars as [N]."""
    groups: dict[str, list[int]] = {}
    for column, name in enumerate(names):
        groups.setdefault(name.split("[")[0], []).append(column)
    scalars = ("time", "contact")
    return {name: rows[:, found[0]] if name in scalars else rows[:, found] for name, found in groups.items()}


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("runner", RUNNERS, ids=lambda runner: runner.name)
def test_the_trace_is_that_of_the_committed_inputs(runner: Runner, name: str) -> None:
    recording = grouped(*read_csv(REFERENCE / f"{name}_in.csv"))
    reference = grouped(*read_csv(REFERENCE / f"{name}_ref.csv"))
    outputs = runner(traces.read_description(name), recording, 1)
    found = agreement.compare(reference, traces.reported_by_fmpy(outputs))
    assert found.agrees, str(found)
