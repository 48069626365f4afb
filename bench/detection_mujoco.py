"""How well contact is detected on fingers of another physics engine that `tendonfmu calibrate` alone made ready.

Each finger of mujoco_pushes.py is calibrated by the command from a rough description and 26 min of free motion at two
pretensions, and scored on 100 labelled pushes that no step before has seen. A push's size is the largest torque that it
makes at a joint, over the rms of the free residual there, as calibration.json counts it.

    python bench/detection_mujoco.py -o FOLDER [--fingers 1 3 19 4 6]

Everything is kept in the folder; writes detection_mujoco.md.
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mujoco_pushes import FREE, PRETENSIONS, PUSHED, description_file, make, place
from tendonfmu.files.writing import whole_file

FINGERS = (1, 3, 19, 4, 6)
SIZES = (6.0, 3.0, 1.5)  # times the residual's rms: least sizes of classes


@dataclass(frozen=True)
class Found:
    """Of one finger or several. sizes: (found, all) of each class. delays: s of each finger. cpu: s of the command."""

    sizes: Sequence[tuple[int, int]]
    alarms: int
    minutes: float
    delays: Sequence[float]
    cpu: Sequence[float]


def calibrated(folder: Path, number: int) -> Path:
    """Folder of the calibration of a finger; `cpu.json` in it is the processor time of the first call, s."""
    into = folder / f"calibrated_{number:02d}"
    if not (into / "cpu.json").exists():
        free, pushed = (
            [str(place(folder, number, kind, each)) for kind in kinds for each in PRETENSIONS]
            for kinds in (FREE, PUSHED)
        )
        command = [
            sys.executable,
            "-m",
            "tendonfmu.cli",
            "calibrate",
            str(description_file(folder, number)),
            *free,
        ]
        before = _processor_seconds()
        subprocess.run([*command, "--pushes", *pushed, "-o", str(into), "--no-progress"], check=True)
        _write(into / "cpu.json", json.dumps(_processor_seconds() - before))
    return into


def _processor_seconds() -> float:
    """Of all processes that this one has started and that have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def found_of(into: Path) -> Found:
    """As the command reports it."""
    pushes = json.loads((into / "calibration.json").read_text(encoding="utf-8"))["pushes"]
    classes = {each["from"]: (each["found"], each["events"]) for each in pushes["sizes"]}
    return Found(
        sizes=[classes.get(low, (0, 0)) for low in SIZES],
        alarms=pushes["false_alarms"],
        minutes=pushes["free_minutes"],
        delays=[np.nan if pushes["median_delay_s"] is None else pushes["median_delay_s"]],
        cpu=[json.loads((into / "cpu.json").read_text(encoding="utf-8"))],
    )


def together(parts: Sequence[Found]) -> Found:
    return Found(
        sizes=[
            (sum(found for found, _ in each), sum(count for _, count in each))
            for each in zip(*(part.sizes for part in parts), strict=True)
        ],
        alarms=sum(each.alarms for each in parts),
        minutes=sum(each.minutes for each in parts),
        delays=[delay for each in parts for delay in each.delays],
        cpu=[seconds for each in parts for seconds in each.cpu],
    )


def row(name: str, each: Found) -> str:
    def listed(values: Sequence[float]) -> str:
        return ", ".join(f"{value:.0f}" for value in values)

    sizes = [f"{found}/{count}" for found, count in each.sizes]
    alarms = f"{each.alarms} in {each.minutes:.1f}"
    return f"| {' | '.join([name, *sizes, alarms, listed([1e3 * value for value in each.delays]), listed(each.cpu)])} |"


def report(results: dict[int, Found]) -> str:
    lines = [
        "| finger | ≥ 6 × rms | 3 to 6 | 1.5 to 3 | false alarms in min | median delay, ms | CPU time, s |",
        "| --- | ---: | ---: | ---: | ---: | ---: | ---: |",
    ]
    for parity, which in ((1, "odd"), (0, "even")):
        parts = {number: each for number, each in results.items() if number % 2 == parity}
        lines += [row(str(number), each) for number, each in parts.items()]
        lines += [row(f"**all {which}**", together(list(parts.values())))] if len(parts) > 1 else []
    return "\n".join(lines) + "\n"


def _write(file: Path, text: str) -> None:
    with whole_file(file) as temporary:
        temporary.write_text(text, encoding="utf-8")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, required=True, help="folder of everything")
    parser.add_argument("--fingers", type=int, nargs="+", default=FINGERS, help="numbers of python_tests/foreign")
    given = parser.parse_args()
    given.output.mkdir(parents=True, exist_ok=True)
    results: dict[int, Found] = {}
    for number in given.fingers:
        make(given.output, number)
        results[number] = found_of(calibrated(given.output, number))
        print(row(str(number), results[number]), file=sys.stderr, flush=True)
        _write(given.output / "detection_mujoco.md", report(results))
    print(report(results))


if __name__ == "__main__":
    main()
