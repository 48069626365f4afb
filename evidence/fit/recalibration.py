"""The da Vinci jaw recalibrated on one recording of 20 s, judged on all others.

    python -m evidence.fit.recalibration [--change X ...]

Needs the recordings in ../shared/data or $TENDONFMU_DATA. Prints the tables of docs/evidence/recalibration.md.
"""

from __future__ import annotations

import json
import sys
import tempfile
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from evidence import tables
from evidence.runner import EXAMPLES, parser
from evidence.tables import Row
from tendonfmu.estimate import FitWarning, FrictionFit
from tendonfmu.files import report_text, write_table
from tendonfmu.model.native import run_recording
from tendonfmu.options import FitOptions
from tendonfmu.recordings import Recording, convert_file, read_recording

sys.path.insert(0, str(EXAMPLES / "davinci"))
from jaw_recordings import FAST, FAULT, SLOW, data_folder, rms, torque_error

STRUCTURE = EXAMPLES / "davinci" / "jaw_extended.json"
EVEN = ("00", "02", "04", "06", "08")
PLANTED = (1.0, 1.3, 0.7)  # times the joint's Coulomb friction
COULOMB = "joints[1].friction.coulomb"
PRETENSION = 13.0  # N; as in docs/evidence/davinci.md
LIMIT = 1.05  # of the error before
GROUPS: Mapping[str, Callable[[str], bool]] = {
    "even": lambda run: run in EVEN,
    "odd": lambda run: run[0] == "0" and run not in EVEN,
    "0.5 Hz": lambda run: run[0] == "4",
}


@dataclass(frozen=True)
class Way:
    """A way to fit again."""

    name: str
    options: Mapping[str, Any]  # of `FrictionFit`
    base: Mapping[str, Any]  # of the fit on the even loads, which it begins from
    source: str | None = None  # what it is given of that: its description as the start; "report" or "description"


def ways(changes: Sequence[float]) -> list[Way]:
    """From a guess, and from a previous fit with each of these allowances for change."""
    plain = {"effective_samples": False}
    without = [
        Way("guessed, each sample counts", plain, plain),
        Way("guessed", {"start_values": "guessed"}, {}),
        Way("guessed, prior 0.1", {"start_values": "guessed", "prior": 0.1}, {}),
    ]
    previous = [
        Way(f"from the {source}, change {change:g}", {"change": change}, {}, source)
        for source in ("report", "description")
        for change in changes
    ]
    return [*without, *previous]


def read_runs(folder: Path) -> dict[str, Recording]:
    """By name, as `tendonfmu convert davinci --pretension 13` writes them, up to the fault of run 07."""
    runs = {}
    for name in (*SLOW, *FAST):
        file = folder / f"{name}.parquet"
        write_table(file, convert_file("davinci", data_folder() / f"{name}.TXT", {"pretension": PRETENSION}))
        whole = read_recording(file)
        end = int(np.searchsorted(whole.time, FAULT.get(name, np.inf), side="right"))
        groups = {group: np.ascontiguousarray(values[:end]) for group, values in whole.groups.items()}
        runs[name] = Recording(file, np.ascontiguousarray(whole.time[:end]), groups)
    return runs


def judged(finger: Mapping[str, Any], runs: Mapping[str, Recording], left_out: str) -> float:
    """Rms in N·m of compensated minus external torque over all samples of all runs but one."""
    others = [recording for name, recording in runs.items() if name != left_out]
    errors = [torque_error(recording, run_recording(finger, recording.arrays())) for recording in others]
    return float(rms(np.concatenate(errors)))


def fitted(finger: Any, recordings: Sequence[Recording], options: Mapping[str, Any]) -> FrictionFit:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FitWarning)
        return FrictionFit(finger, uncertainty=False, **options).fit(recordings)


def planted_in(fit: FrictionFit, factor: float) -> dict[str, dict[str, Any]]:
    """Description and report of a fit with the joint's Coulomb friction changed."""
    finger, report = json.loads(fit.description_text()), json.loads(report_text(fit.report_))
    law = finger["joints"][0]["friction"]
    law["static"], law["coulomb"] = factor * law["static"], factor * law["coulomb"]
    for entry in report["parameters"]:
        entry["value"] *= factor if entry["path"] == COULOMB else 1.0
    return {"description": finger, "report": report}


def recalibrated(way: Way, before: Mapping[str, Any], recording: Recording, folder: Path) -> dict[str, Any]:
    """The description fitted again on one recording."""
    options = dict(way.options)
    if way.source is not None:
        options["previous"] = folder / f"{way.source}.json"
        options["previous"].write_text(json.dumps(before[way.source]), encoding="utf-8")
    return dict(json.loads(fitted(before["description"], [recording], options).description_text()))


def campaign(
    chosen: Sequence[Way], planted: Sequence[float] = PLANTED, only: Sequence[str] = (*SLOW, *FAST)
) -> list[Row]:
    """All ways, all planted factors, fitted again on each of these runs: rms in N·m on all other runs."""
    rows = []
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        runs = read_runs(folder)
        bases = {}
        for way in chosen:
            key = json.dumps(way.base)
            if key not in bases:
                bases[key] = fitted(STRUCTURE, [runs[name] for name in EVEN], way.base)
            for factor in planted:
                known = planted_in(bases[key], factor)
                for run in only:
                    before = judged(known["description"], runs, run)
                    after = judged(recalibrated(way, known, runs[run], folder), runs, run)
                    row = {"way": way.name, "planted": factor, "run": run, "before": before, "after": after}
                    rows.append(row | {"ratio": after / before})
    return rows


def sample_counts() -> list[list[str]]:
    """Samples of the joint that a fit was trained on, and how many independent ones they are worth."""
    with tempfile.TemporaryDirectory() as scratch:
        runs = read_runs(Path(scratch))
        chosen = {"even loads together": EVEN} | {f"run {name} alone": (name,) for name in ("00", "05", "09")}
        lines = []
        for name, names in chosen.items():
            fit = fitted(STRUCTURE, [runs[run] for run in names], {})
            counts = json.loads(report_text(fit.report_))["innovations"]["effective"]
            lines.append([name, f"{sum(counts['samples']):.0f}", f"{sum(counts['worth']):.0f}"])
        return lines


def report(rows: Sequence[Row]) -> str:
    """A line for each way and planted factor; the ratio of each run without a planted change; samples."""

    def cells(group: Sequence[Row]) -> list[str]:
        before, after = (1e3 * tables.column(group, name) for name in ("before", "after"))
        worst = [max(row["ratio"] for row in group if belongs(row["run"])) for belongs in GROUPS.values()]
        above = sum(row["ratio"] > LIMIT for row in group)
        errors = [f"{value:.1f}" for value in (np.median(before), np.median(after), after.max())]
        return [*errors, *(f"{value:.2f}" for value in worst), f"{above} of {len(group)}"]

    unchanged = tables.where(rows, planted=1.0)
    runs = tables.values_of(rows, "run")
    by_run = tables.by(unchanged, ["way"], lambda group: [f"{row['ratio']:.2f}" for row in group])
    lines = [[way, f"× {factor}", *rest] for way, factor, *rest in tables.by(rows, ["way", "planted"], cells)]
    head = ["Fitted again", "Coulomb friction", "before, mN·m", "after, mN·m: median", "worst"]
    ratios = ["worst after/before: even", "odd", "0.5 Hz", f"above {LIMIT}"]
    sections = [
        tables.table([*head, *ratios], lines),
        tables.table(["Fitted again on", *runs], by_run),
        tables.table(["", "samples", "worth"], sample_counts()),
    ]
    return "\n\n".join(sections)


def main() -> None:
    options = parser(__doc__, output=None)
    options.add_argument("--change", type=float, nargs="*", default=[FitOptions().change])
    print(report(campaign(ways(options.parse_args().change))))


if __name__ == "__main__":
    main()
