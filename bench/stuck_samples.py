"""What stuck samples do to a diagnosis: python bench/stuck_samples.py [--seeds 10] [--mujoco] [-o TABLE.md]

A simulated finger that sticks and slips (python_tests/support/sticking_finger.py) is diagnosed with nothing hidden and
with a hidden weight, by a search that may leave out stuck samples and by one that may not. With --mujoco the fingers
are those of python_tests/foreign (cases 1, 2 and 20 of one and two joints), with nothing hidden.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from unittest import mock

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "python_tests" / "support"))
sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "python_tests" / "foreign"))

import sticking_finger
from tendonfmu.diagnosis import search
from tendonfmu.diagnosis.diagnosis import diagnose

SECONDS, WEIGHT, PULL = 30.0, 0.05, 20.0  # s, N·m, N
PHYSICS = {"presliding", "inertia"}  # of the simulated finger


@dataclass(frozen=True)
class Row:
    """One diagnosis: what it names, errors of the friction as shares, and the gain of all causes on all samples."""

    names: frozenset[str]
    nominal: float
    extended: float
    gain: float


def diagnosed(seed: int, weight: float, leaves_out: bool) -> Row:
    """Simulate a recording and diagnose it."""
    true = sticking_finger.friction_at(PULL)
    kept = search.sliding_alone
    with (
        tempfile.TemporaryDirectory() as folder,
        mock.patch.object(search, "sliding_alone", kept if leaves_out else lambda *given: None),
    ):
        finger, recording = sticking_finger.write(Path(folder), SECONDS, seed, weight)
        found = diagnose(finger, [recording], kinematics=2)
    nominal, extended = (
        sticking_finger.described_friction_at(data, PULL) / true - 1.0
        for data in (found.nominal_data, found.extended_data)
    )
    names = frozenset(cause.where.effect for cause in found.causes) - PHYSICS
    return Row(names, nominal, extended, found.gain.value)


def falsely_named(number: int, seed: int, joints: int, leaves_out: bool) -> bool:
    """Return whether a MuJoCo finger with nothing hidden gets a cause that it does not have."""
    import seeded_cases

    kept = search.sliding_alone
    with (
        tempfile.TemporaryDirectory() as folder,
        mock.patch.object(search, "sliding_alone", kept if leaves_out else lambda *given: None),
    ):
        seeded_cases.mujoco_finger(Path(folder), number, seed, joints, 45.0, 500.0)
        finger, recording = (Path(folder) / name for name in ("finger.json", "recording.parquet"))
        found = diagnose(finger, [recording], kinematics=2, seed=seed)
    return bool({cause.where.effect for cause in found.causes} - PHYSICS)


def mujoco_line(leaves_out: bool, seeds: int) -> str:
    """Return how many MuJoCo fingers get a false name; `seeds` for each of three cases, of 1 and 2 joints in turn."""
    names = [
        falsely_named(number, 970000 + 100 * number + k, 1 + k % 2, leaves_out)
        for number in (1, 2, 20)
        for k in range(seeds)
    ]
    return f"| {'may be left out' if leaves_out else 'always count'} | {sum(names)} of {len(names)} |"


def columns(rows: Sequence[Row], hidden: set[str]) -> list[str]:
    """Return the cells of a table for diagnoses of the same kind."""

    def spread(values: Sequence[float]) -> str:
        return f"{100 * median(values):+.0f} ({100 * min(values):+.0f} to {100 * max(values):+.0f}) %"

    return [
        f"{sum(hidden <= row.names for row in rows)} of {len(rows)}" if hidden else "",
        f"{sum(bool(row.names - hidden) for row in rows)} of {len(rows)}",
        spread([row.nominal for row in rows]),
        spread([row.extended for row in rows]),
        f"{100 * median(row.gain for row in rows):.0f} %",
    ]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--mujoco", action="store_true")
    parser.add_argument("-o", "--output", type=Path)
    given = parser.parse_args()
    lines = mujoco_lines(given.seeds) if given.mujoco else made_lines(given.seeds)
    text = "\n".join(lines)
    print(text)
    if given.output is not None:
        given.output.write_text(text + "\n", encoding="utf-8")


def mujoco_lines(seeds: int) -> list[str]:
    """Return the table of MuJoCo fingers."""
    return [
        "| stuck samples | a false name |",
        "| --- | ---: |",
        *(mujoco_line(leaves_out, seeds) for leaves_out in (False, True)),
    ]


def made_lines(seeds: int) -> list[str]:
    """Return the table of the simulated joint."""
    lines = [
        "| hidden | stuck samples | named | a false name | friction, nominal | friction, extended | gain |",
        "| --- | --- | ---: | ---: | ---: | ---: | ---: |",
    ]
    for what, weight in (("nothing", 0.0), ("gravity", WEIGHT)):
        for leaves_out in (False, True):
            rows = [diagnosed(100 + seed, weight, leaves_out) for seed in range(seeds)]
            cells = columns(rows, set() if weight == 0.0 else {"gravity"})
            lines.append(f"| {what} | {'may be left out' if leaves_out else 'always count'} | {' | '.join(cells)} |")
            print(lines[-1], file=sys.stderr)
    return lines


if __name__ == "__main__":
    main()
