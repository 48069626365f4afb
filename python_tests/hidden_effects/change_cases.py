"""Makes the cases of a change, as folders that any tool can be run on; change_table.py runs `tendonfmu diagnose`.

    python python_tests/hidden_effects/change_cases.py --bed hidden -o DIR [--half odd] [--at-most 30]

Beds: hidden (change_hidden.py), real (change_real.py), simulated (change_simulated.py, needs mujoco). Develop on odd
cases, report even ones. Cases that are in DIR already stay as they are. The measured recordings are those of
../shared/data or $TENDONFMU_DATA.
"""

from __future__ import annotations

import argparse
import importlib
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))

from change_case import HALVES, Case, write_case

BEDS = ("hidden", "real", "simulated")


def chosen(numbers: list[int], half: str, at_most: int | None) -> list[int]:
    """Of the half, evenly spread if there are more than so many."""
    found = [number for number in sorted(numbers) if half in ("all", HALVES[number % 2])]
    if at_most is None or at_most >= len(found):
        return found
    return [found[k] for k in np.linspace(0, len(found) - 1, at_most).round().astype(int)]


def write_cases(bed: str, makers: dict[int, Callable[[], Case]], folder: Path) -> None:
    for number, make in makers.items():
        if list(folder.glob(f"{bed}_{number:04d}_*")):
            continue
        try:
            print(write_case(make(), folder), flush=True)
        except ValueError as impossible:
            print(f"SKIPPED: case {number}: {impossible}", file=sys.stderr)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--bed", choices=BEDS, required=True)
    parser.add_argument("-o", "--output", type=Path, required=True, help="folder for the cases")
    parser.add_argument("--half", choices=(*HALVES.values(), "all"), default="all", help="cases of odd or even number")
    parser.add_argument("--at-most", type=int, help="so many, evenly spread over the bed")
    given = parser.parse_args()
    makers: dict[int, Callable[[], Case]] = importlib.import_module(f"change_{given.bed}").makers()
    wanted = chosen(list(makers), given.half, given.at_most)
    write_cases(given.bed, {number: makers[number] for number in wanted}, given.output)


if __name__ == "__main__":
    main()
