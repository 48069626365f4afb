"""The da Vinci jaw recalibrated on one recording of 20 s, judged on all others.

The jaw with its diagnosed structure (examples/davinci/jaw_extended.json) is fitted on the even loads. It is then fitted
again on each single run in turn, from the numbers as they were and with the joint's Coulomb friction changed by 30 %
beforehand, and judged by compensated minus external torque on all other runs. recalibration_table.py prints it.
"""

from __future__ import annotations

import json
import sys
import tempfile
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu.estimate.fitting import FitWarning, FrictionFit
from tendonfmu.files import report_text
from tendonfmu.files.tables import write_table
from tendonfmu.model.native import run_recording
from tendonfmu.recordings.converters import convert_file
from tendonfmu.recordings.recording import Recording, read_recording

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "examples" / "davinci"))
from jaw_recordings import FAST, FAULT, SLOW, data_folder, rms, torque_error

Numbers = NDArray[np.float64]

STRUCTURE = Path(__file__).resolve().parents[1] / "examples" / "davinci" / "jaw_extended.json"
EVEN = ("00", "02", "04", "06", "08")
PLANTED = (1.0, 1.3, 0.7)  # times the joint's Coulomb friction
COULOMB = "joints[1].friction.coulomb"
PRETENSION = 13.0  # N; as in docs/evidence/davinci.md


@dataclass(frozen=True)
class Way:
    """A way to fit again. options: of `FrictionFit`. base: of the fit on the even loads, which it begins from. source:
    what it is given of that: None its description as the start, "report" or "description" as `previous`.
    """

    name: str
    options: Mapping[str, Any]
    base: Mapping[str, Any]
    source: str | None = None


@dataclass(frozen=True)
class Outcome:
    """Of one way, one planted factor and one run. before, after: rms in N·m on all other runs."""

    way: str
    planted: float
    run: str
    before: float
    after: float

    @property
    def ratio(self) -> float:
        return self.after / self.before


def ways(changes: Sequence[float]) -> list[Way]:
    """Without effective samples (as it was), and from a previous fit with each of these allowances for change."""
    plain = {"effective_samples": False}
    found = [
        Way("each sample counts, prior 1", plain, plain),
        Way("each sample counts, prior 0.1", plain | {"prior": 0.1}, plain),
    ]
    for source in ("report", "description"):
        found += [
            Way(f"from the {source}, change {change:g}", {"change": change}, {"effective_samples": True}, source)
            for change in changes
        ]
    return found


def read_runs(folder: Path) -> dict[str, Recording]:
    """By name, as `tendonfmu convert davinci --pretension 13` writes them, up to the fault of run 07."""
    found = {}
    for name in (*SLOW, *FAST):
        file = folder / f"{name}.parquet"
        write_table(file, convert_file("davinci", data_folder() / f"{name}.TXT", {"pretension": PRETENSION}))
        whole = read_recording(file)
        end = int(np.searchsorted(whole.time, FAULT.get(name, np.inf), side="right"))
        groups = {group: np.ascontiguousarray(values[:end]) for group, values in whole.groups.items()}
        found[name] = Recording(file, np.ascontiguousarray(whole.time[:end]), groups)
    return found


def judged(finger: Mapping[str, Any], runs: Mapping[str, Recording], left_out: str | None = None) -> float:
    """rms in N·m of compensated minus external torque over all samples of all runs but one."""
    chosen = [recording for name, recording in runs.items() if name != left_out]
    return rms(np.concatenate([torque_error(each, run_recording(finger, each.arrays())) for each in chosen]))


def fitted(finger: Any, recordings: Sequence[Recording], options: Mapping[str, Any]) -> FrictionFit:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FitWarning)
        return FrictionFit(finger, uncertainty=False, **options).fit(recordings)


def planted_in(fit: FrictionFit, factor: float) -> tuple[dict[str, Any], dict[str, Any]]:
    """Description and report of a fit with the joint's Coulomb friction changed."""
    finger, report = json.loads(fit.description_text()), json.loads(report_text(fit.report_))
    law = finger["joints"][0]["friction"]
    law["static"], law["coulomb"] = factor * law["static"], factor * law["coulomb"]
    for entry in report["parameters"]:
        entry["value"] *= factor if entry["path"] == COULOMB else 1.0
    return finger, report


def recalibrated(
    way: Way, finger: Mapping[str, Any], report: Mapping[str, Any], recording: Recording, folder: Path
) -> dict[str, Any]:
    """The description fitted again on one recording."""
    options = dict(way.options)
    if way.source is not None:
        options["previous"] = folder / f"{way.source}.json"
        content = report if way.source == "report" else finger
        options["previous"].write_text(json.dumps(content), encoding="utf-8")
    found: dict[str, Any] = json.loads(fitted(finger, [recording], options).description_text())
    return found


def campaign(
    chosen: Sequence[Way], planted: Sequence[float] = PLANTED, only: Sequence[str] = (*SLOW, *FAST)
) -> list[Outcome]:
    """All ways, all planted factors, fitted again on each of these runs."""
    found = []
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        runs = read_runs(folder)
        bases = {}
        for way in chosen:
            key = json.dumps(way.base)
            if key not in bases:
                bases[key] = fitted(STRUCTURE, [runs[name] for name in EVEN], way.base)
            for factor in planted:
                finger, report = planted_in(bases[key], factor)
                for name in only:
                    after = recalibrated(way, finger, report, runs[name], folder)
                    pair = judged(finger, runs, name), judged(after, runs, name)
                    found.append(Outcome(way.name, factor, name, *pair))
    return found


@dataclass(frozen=True)
class SampleCount:
    """Samples of the joint that a fit was trained on, and how many independent ones they are worth."""

    runs: str
    samples: float
    worth: float


def sample_counts() -> list[SampleCount]:
    """Of the even loads together, and of the first, a middle and the last run at 0.1 Hz alone."""
    with tempfile.TemporaryDirectory() as scratch:
        runs = read_runs(Path(scratch))
        chosen = {"even loads together": EVEN} | {f"run {name} alone": (name,) for name in ("00", "05", "09")}
        found = []
        for name, own in chosen.items():
            fit = fitted(STRUCTURE, [runs[each] for each in own], {"effective_samples": True})
            counts = json.loads(report_text(fit.report_))["innovations"]["effective"]
            found.append(SampleCount(name, sum(counts["samples"]), sum(counts["worth"])))
        return found
