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


@pytest.mark.parametrize("name", NAMES)
def test_the_first_two_rows_carry_the_first_sample(name: str) -> None:
    names, rows = read_csv(REFERENCE / f"{name}_ref.csv")
    np.testing.assert_array_equal(rows[0, 1:], rows[1, 1:])
    torque = names.index("compensated_torque[1]")
    assert len(np.unique(rows[:, torque])) > 0.9 * len(rows)


@pytest.mark.parametrize("name", NAMES)
def test_a_changed_number_shows(name: str) -> None:
    """The traces are worth comparing with: 1 % more static friction of one law is seen."""
    description = traces.read_description(name)
    law = next(edge for edge in description["tendons"][-1]["edge_friction"] if edge)
    law = law["laws"][0] if "laws" in law else law
    law["static"] *= 1.01
    recording = grouped(*read_csv(REFERENCE / f"{name}_in.csv"))
    reference = grouped(*read_csv(REFERENCE / f"{name}_ref.csv"))
    outputs = RUNNERS[0](description, recording, 1)
    assert not agreement.compare(reference, traces.reported_by_fmpy(outputs)).agrees
