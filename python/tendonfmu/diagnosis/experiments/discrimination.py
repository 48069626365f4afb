"""Which motion a diagnosis asked for (`tendonfmu excite FINGER --discriminate DIR`)."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tendonfmu.arrays import Numbers
from tendonfmu.diagnosis.experiments.menu import Entry, entry_from_json
from tendonfmu.diagnosis.experiments.motion import perform
from tendonfmu.errors import InputError
from tendonfmu.excite import Excitation

REPORT = "diagnosis.json"
FORMAT = "tendonfmu-diagnosis-1"
MOTION_FORMAT = "tendonfmu-discriminating-motion-1"
RATE = 100.0  # rows per second


@dataclass(frozen=True)
class Discrimination:
    """What to record next."""

    sentence: str  # what the recording distinguishes
    entry: Entry  # of the menu
    performed: Excitation  # the motion of the entry

    def columns(self) -> dict[str, Numbers]:
        """Return name -> values [N], as `tendonfmu excite` writes a motion."""
        return self.performed.columns()

    def lines(self) -> Iterator[str]:
        """Yield what the recording distinguishes, how long it takes, and which known load applies at which time."""
        time, load = self.performed.time, self.performed.load
        yield self.sentence
        yield f"motion file: {time[-1]:.0f} s of {self.entry.words}"
        if load.any():
            edges = np.flatnonzero(np.any(np.diff(load, axis=0) != 0, axis=1)) + 1
            for begin, end in zip([0, *edges], [*edges, len(time)], strict=True):
                if end - begin > 1:  # constant load, not a transition
                    torques = ", ".join(f"{value:.3g}" for value in load[begin])
                    yield f"known load {torques} N·m from {time[begin]:.1f} to {time[end - 1]:.1f} s"

    def report(self, output: Path) -> dict[str, Any]:
        """Return what `tendonfmu excite --discriminate --json` prints. output: file of the motion."""
        time = self.performed.time
        return {
            "format": MOTION_FORMAT,
            "output": str(output),
            "rows": len(time),
            "duration": float(time[-1]),
            "sentence": self.sentence,
            "experiment": self.entry.words,
            "lines": list(self.lines()),
        }


def discriminating_motion(
    folder: Path,
    data: Mapping[str, Any],
    *,
    limits: Sequence[tuple[float, float]] | None = None,
    rate: float = RATE,
) -> Discrimination:
    """Read the experiment that a diagnosis asked for and compute its motion."""
    # limits: [n]
    report = _read_report(folder / REPORT)
    experiment = report.get("experiment") or {}
    motion = experiment.get("motion") or {}
    if not motion:
        said = report.get("next_experiment") or "nothing is left to find out"
        raise InputError(f"{folder / REPORT}: no further experiment to plan: {said}")
    try:
        performed = performed_of(data, motion, rate)
    except InputError as wrong:
        raise InputError(f"{folder / REPORT}: {wrong}") from None
    _refuse_beyond(folder / REPORT, performed[1], limits)
    return Discrimination(str(experiment.get("sentence") or report.get("next_experiment") or ""), *performed)


def performed_of(data: Mapping[str, Any], motion: Mapping[str, Any], rate: float = RATE) -> tuple[Entry, Excitation]:
    """Return the entry and its motion for `result.Experiment.motion`; raises InputError if it is not valid."""
    entry = entry_from_json(motion, len(data["joints"]))
    return entry, perform(data, entry, rate, int(motion.get("seed", 0)))


def _read_report(path: Path) -> dict[str, Any]:
    try:
        report = json.loads(path.read_text(encoding="utf-8"))
    except OSError as failed:
        raise InputError(f"{path}: {failed.strerror}; expected the folder of a `tendonfmu diagnose`") from None
    except ValueError as wrong:
        raise InputError(f"{path}: not JSON ({wrong}); expected a report of `tendonfmu diagnose`") from None
    format_ = report.get("format") if isinstance(report, dict) else None
    if format_ != FORMAT:
        raise InputError(f'{path}: format = {json.dumps(format_)}; expected "{FORMAT}"')
    return dict(report)


def _refuse_beyond(path: Path, performed: Excitation, limits: Sequence[tuple[float, float]] | None) -> None:
    for j, (low, high) in enumerate(limits or (), start=1):
        least, most = float(performed.joint_position[:, j - 1].min()), float(performed.joint_position[:, j - 1].max())
        if not low <= least <= most <= high:
            raise InputError(
                f"{path}: experiment.motion: joint {j} moves from {least:.3g} to {most:.3g} rad; expected within its "
                f"limits {low:.3g} to {high:.3g} rad"
            )
