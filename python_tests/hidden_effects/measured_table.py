"""Detection and naming rates of effects hidden in the EMPS and da Vinci recordings (measured.py).

    python python_tests/hidden_effects/measured_table.py -o measured.csv [--cases 4] [--jobs 2] [--minutes 60]

Needs the recordings in ../shared/data or $TENDONFMU_DATA. Each case is written as it ends; cases that the file has
already are not run again. The table goes to standard output, every rate with its cases and 95 % interval (Wilson).
"""

from __future__ import annotations

import argparse
import csv
import json
import os
import sys
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import binomtest

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
sys.path.insert(0, str(HERE))

from measured import EFFECTS, Columns, Hidden, Machine, hide  # noqa: E402
from tendonfmu.diagnosis.diagnosis import diagnose  # noqa: E402
from tendonfmu.diagnosis.result import Cause, Diagnosis  # noqa: E402
from tendonfmu.files.tables import write_table  # noqa: E402
from tendonfmu.recordings.converters import convert_file  # noqa: E402

DATA = Path(os.environ.get("TENDONFMU_DATA") or ROOT.parent / "shared" / "data")
MACHINES = ("emps", "davinci")
STRENGTHS = (0.03, 0.1, 0.3, 1.0)
NOTHING = "nothing"  # the unaltered recording
SECONDS = 16.5  # da Vinci: before run 07 jams
RUNS, CHOSEN = ("00", "02", "04", "06", "08"), 3  # da Vinci: even loads, which the model was diagnosed with; of a case
WINDOWS = ((0.0, 24.9), (0.0, 18.7), (6.2, 24.9), (3.1, 21.8))  # s, EMPS: cycles of 6.24 s


@dataclass(frozen=True)
class Case:
    """case: which part of the recordings, and the sign of effects that have two."""

    machine: str
    effect: str
    strength: float
    case: int


@dataclass(frozen=True)
class Outcome:
    """magnitude, share: of the hidden effect, what survives. named: in the reported set; first: its first cause."""

    machine: str
    effect: str
    strength: float
    case: int
    magnitude: float
    share: float
    detected: bool
    named: bool
    first: bool
    invisible: bool
    set_size: int
    causes: str
    verdict: str
    seconds: float


def part_of(columns: Columns, begin: float, end: float) -> Columns:
    rows = (columns["time"] >= begin) & (columns["time"] <= end)
    return {name: values[rows] for name, values in columns.items()}


def machine_of(name: str, case: int) -> Machine:
    """The case's part of the recordings. The model is the diagnosed one, diagnosed again until nothing was found."""
    model = json.loads((HERE / f"measured_{name}.json").read_text(encoding="utf-8"))
    if name == "emps":
        columns = convert_file("emps", DATA / "emps" / "DATA_EMPS.mat", {"decimation": 1})
        return Machine(name, model, {"emps": part_of(columns, *WINDOWS[case % len(WINDOWS)])}, 3)
    drawn = np.random.default_rng([case, 26]).permutation(RUNS)[:CHOSEN]
    folder = DATA / "davinci_tool" / "Tool_4_Maryland_L_4"
    options = {"pretension": 13.0}
    runs = {run: convert_file("davinci", folder / f"{run}.TXT", options) for run in sorted(map(str, drawn))}
    return Machine(name, model, {run: part_of(columns, 0.0, SECONDS) for run, columns in runs.items()}, 1)


def hidden_in(case: Case) -> Hidden:
    machine = machine_of(case.machine, case.case)
    if case.effect == NOTHING:
        return Hidden(machine, 0.0, 0.0, 0.0)
    effect = EFFECTS[case.effect]
    free = effect.free(machine) if effect.free else machine
    return hide(free, effect, case.strength, -1.0 if effect.both and case.case % 2 else 1.0)


def diagnosed(machine: Machine, seed: int) -> Diagnosis:
    with tempfile.TemporaryDirectory() as scratch:
        finger = Path(scratch) / "nominal.json"
        finger.write_text(json.dumps(machine.model), encoding="utf-8")
        files = []
        for name, columns in machine.recordings.items():
            files.append(Path(scratch) / f"{name}.parquet")
            write_table(files[-1], columns)
        return diagnose(finger, files, [], kinematics=machine.kinematics, seed=seed, jobs=1)


def names_of(cause: Cause) -> set[str]:
    return {cause.where.effect, *(where.effect for where in cause.confusable_with)}


def run(case: Case) -> Outcome | None:
    """None where no sound magnitude has the strength."""
    begin = time.perf_counter()
    try:
        hidden = hidden_in(case)
    except ValueError:
        return None
    found = diagnosed(hidden.machine, case.case)
    true = set(EFFECTS[case.effect].names) if case.effect != NOTHING else set()
    causes = [cause for cause in found.causes if cause.where.effect != "unknown"]
    holding = [cause for cause in causes if names_of(cause) & true]
    return Outcome(
        **asdict(case),
        magnitude=hidden.magnitude,
        share=hidden.share,
        detected=bool(found.causes),
        named=bool(holding),
        first=any(cause.where.effect in true for cause in causes[:1]),
        invisible=any(each.where.effect in true for each in found.invisible),
        set_size=len(names_of(holding[0])) if holding else 0,
        causes=" ".join(
            "/".join([cause.where.effect, *sorted(names_of(cause) - {cause.where.effect})]) for cause in causes
        ),
        verdict=found.verdict,
        seconds=time.perf_counter() - begin,
    )


def cases_of(count: int) -> list[Case]:
    """The null first, then from the strongest on: what can be run in the time is the more telling part."""
    null = [Case(machine, NOTHING, 0.0, k) for machine in MACHINES for k in range(count)]
    return null + [
        Case(machine, effect, strength, k)
        for k in range(count)
        for strength in reversed(STRENGTHS)
        for effect in EFFECTS
        for machine in MACHINES
    ]


def read_rows(file: Path) -> list[dict[str, Any]]:
    if not file.is_file():
        return []
    with file.open(encoding="utf-8", newline="") as stream:
        return list(csv.DictReader(stream))


def run_all(cases: list[Case], file: Path, jobs: int, minutes: float) -> None:
    """Appends a row as each case ends; no new one is begun after so many minutes."""
    fields = list(Outcome.__dataclass_fields__)
    key = ("machine", "effect", "strength", "case")
    done = {tuple(row[name] for name in key) for row in read_rows(file)}
    todo = [case for case in cases if tuple(str(getattr(case, name)) for name in key) not in done]
    end = time.monotonic() + 60.0 * minutes
    with file.open("a", encoding="utf-8", newline="") as stream, ProcessPoolExecutor(jobs) as pool:
        writer = csv.DictWriter(stream, fields)
        if stream.tell() == 0:
            writer.writeheader()
        for group in (todo[k : k + jobs] for k in range(0, len(todo), jobs)):
            if time.monotonic() > end:
                break
            for future in as_completed([pool.submit(run, case) for case in group]):
                outcome = future.result()
                if outcome is not None:
                    writer.writerow(asdict(outcome))
                    stream.flush()
                    print(outcome, file=sys.stderr)


def rate(rows: list[dict[str, Any]], name: str) -> str:
    """hits/cases (95 % interval, %)"""
    hits = sum(row[name] == "True" for row in rows)
    low, high = binomtest(hits, len(rows)).proportion_ci(method="wilson")
    return f"{hits}/{len(rows)} ({100 * low:.0f}\u2013{100 * high:.0f} %)"


def table(rows: list[dict[str, Any]]) -> Iterator[str]:
    yield "| machine | hidden | strength | survives | detected | in the set | first | set | not visible |"
    yield "| --- | --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: |"
    for machine in MACHINES:
        for effect in (NOTHING, *EFFECTS):
            for strength in sorted({row["strength"] for row in rows if row["effect"] == effect}, key=float):
                of = [r for r in rows if (r["machine"], r["effect"], r["strength"]) == (machine, effect, strength)]
                if not of:
                    continue
                if effect == NOTHING:
                    yield f"| {machine} | nothing | | | {rate(of, 'detected')} | | | | |"
                    continue
                sizes = [int(row["set_size"]) for row in of if row["named"] == "True"]
                size = f"{np.mean(sizes):.1f}" if sizes else ""
                share = f"{100 * np.mean([float(row['share']) for row in of]):.0f} %"
                rates = " | ".join(rate(of, name) for name in ("detected", "named", "first"))
                yield f"| {machine} | {effect} | {strength} | {share} | {rates} | {size} | {rate(of, 'invisible')} |"


def pooled(rows: list[dict[str, Any]]) -> Iterator[str]:
    """All effects of a machine and strength together."""
    yield "| machine | strength | cases | detected | in the set | first |"
    yield "| --- | ---: | ---: | ---: | ---: | ---: |"
    for machine in MACHINES:
        for strength in (0.0, *STRENGTHS):
            of = [row for row in rows if row["machine"] == machine and float(row["strength"]) == strength]
            if of:
                rates = [
                    rate(of, name) if strength or name == "detected" else "" for name in ("detected", "named", "first")
                ]
                yield f"| {machine} | {strength or 'nothing hidden'} | {len(of)} | {' | '.join(rates)} |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-o", "--output", type=Path, required=True, help="rows, .csv; goes on where it ended")
    parser.add_argument("--cases", type=int, default=4, help="parts of the recordings, at each effect and strength")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--minutes", type=float, default=1e6, help="begin no case after these")
    options = parser.parse_args()
    run_all(cases_of(options.cases), options.output, options.jobs, options.minutes)
    rows = read_rows(options.output)
    for line in [*pooled(rows), "", *table(rows)]:
        print(line)


if __name__ == "__main__":
    main()
