"""How the causes develop over many recordings of one finger: which ones grow, and how fast.

::

    history = diagnose_history("finger.json", ["2026-03-01.parquet", "2026-03-08.parquet", ...])

The recordings are in order of time and each is compared with the reference. Each recording is diagnosed by itself; then
the sizes of all causes that were named in any recording are estimated in all of them.
"""

from __future__ import annotations

import json
import math
import os
import re
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, astuple, dataclass, replace
from datetime import datetime, timezone
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from tendonfmu.arrays import Numbers
from tendonfmu.diagnosis.answer import Asked
from tendonfmu.diagnosis.base import find_base
from tendonfmu.diagnosis.change_diagnosis import Changes
from tendonfmu.diagnosis.diagnosis import LEAST_GAIN, diagnose
from tendonfmu.diagnosis.effects import Where
from tendonfmu.diagnosis.extension_fit import FitSettings
from tendonfmu.diagnosis.inputs import read_input
from tendonfmu.diagnosis.kinematic_causes import find_kinematic_causes
from tendonfmu.diagnosis.result import ChangedSize
from tendonfmu.errors import InputError
from tendonfmu.model import Finger, read_finger
from tendonfmu.statistics import Interval
from tendonfmu.tasks import Job, Phases, fault_words, refuse_if_all_failed, row_file, rows_of, run_jobs, version_here

File = str | os.PathLike[str]

WEEK = 7.0 * 86400.0  # s
FEWEST = 3  # recordings needed for a trend
_DATE = re.compile(r"(?<!\d)(\d{4})-?(\d{2})-?(\d{2})(?:[T_ -]?(\d{2})[-:h]?(\d{2})(?:[-:]?(\d{2}))?)?(?!\d)")


@dataclass(frozen=True)
class Size:
    """A cause in one recording."""

    recording: str
    size: ChangedSize  # size in the reference and in this recording
    named: bool  # whether the diagnosis of the recording names it
    gain: float  # gain there, 0 if it is not named


@dataclass(frozen=True)
class Line:
    """One cause over all recordings."""

    where: Where  # effect and place, and the effect in plain words
    title: str
    sizes: tuple[Size, ...]  # of each recording in which the cause could be estimated
    trend: Interval | None  # change of the size per unit of time of the history; None for fewer than FEWEST recordings
    since: str | None  # first recording from which on the interval of the change excludes 0; None if there is none


@dataclass(frozen=True)
class History:
    """All causes over all recordings."""

    finger: str
    references: tuple[str, ...]  # names of the files
    recordings: tuple[str, ...]
    times: tuple[float, ...]  # of the recordings [K]
    dated: bool  # whether `times` are weeks
    lines: tuple[Line, ...]  # one for each cause, the most frequently named first
    verdicts: tuple[str, ...]  # of each recording
    failed: tuple[tuple[str, str], ...]  # (recording, reason) for each recording that could not be diagnosed

    @property
    def unit(self) -> str:
        """Unit of `times`: "week" or "recording"."""
        return "week" if self.dated else "recording"

    @property
    def different(self) -> int:
        """Number of recordings in which something differs from the reference, if only a load without a line."""
        return sum(verdict != "adequate" for verdict in self.verdicts)


def diagnose_history(
    finger: Finger | File,
    recordings: Sequence[File],
    reference: Sequence[File] = (),
    *,
    rows: Path,
    client: Any = None,
    kinematics: int = 1,
    least_gain: float = LEAST_GAIN,
    seed: int = 0,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> History:
    """Diagnose each recording against the reference and follow every cause over all of them.

    A call with the same `rows` continues where an earlier one stopped, and tries again what failed.

    Parameters
    ----------
    finger
        Description, or its file.
    recordings
        Files in order of time.
    reference
        Recordings of the finger when it was well; without any, the first recording is the reference.
    rows
        Folder for the results of each recording.
    client
        Of `jobs.workers_of`; None to run here, one recording after another.
    kinematics
        Kinematics source, 1 to 3.
    least_gain
        Share of the remaining rms that a cause must remove.
    seed
        Seed of all random numbers.
    progress
        Called with the number of steps done and of all steps.

    Returns
    -------
    History
        Causes, sizes, trends and failed recordings.

    Raises
    ------
    InputError
        If a file or an option is at fault, if there is nothing to compare with the reference, or if no recording could
        be diagnosed.
    """
    given = read_finger(finger)
    files = [str(recording) for recording in recordings]
    before = [str(recording) for recording in reference] or files[:1]
    later = files if reference else files[1:]
    if not later:
        raise InputError("history: one recording; expected two at least, or a reference")
    options = (given, before, kinematics, least_gain, seed)
    names = _names(later, options)
    first = [Job(f"{name}.causes", (*options, file)) for name, file in zip(names, later, strict=True)]
    total = 2 * len(later)
    run_jobs(named_in, first, rows, client, progress=lambda done, _: progress(done, total))
    causes = rows_of(first, rows)
    keys = sorted({tuple(cause["where"]) for row in causes for cause in row.get("causes") or ()}, key=str)
    mark = _mark(keys)
    second = [
        Job(f"{name}.sizes.{mark}", (*options, file, keys))
        for name, file, row in zip(names, later, causes, strict=True)
        if keys and not row.get("error")
    ]
    run_jobs(sizes_in, second, rows, client, progress=lambda done, _: progress(total - len(second) + done, total))
    of = dict(zip((job.arguments[-2] for job in second), rows_of(second, rows), strict=True))
    sizes = [of.get(file, {}) for file in later]
    ends = [size if size.get("error") else cause for cause, size in zip(causes, sizes, strict=True)]
    refuse_if_all_failed(ends, f"{given.path}: no recording could be diagnosed")
    failed = {
        job.arguments[5]: fault_words(row, row_file(rows, job.name))
        for jobs in (first, second)
        for job, row in zip(jobs, rows_of(jobs, rows), strict=True)
        if row.get("error")
    }
    known = [each for each in zip(later, causes, sizes, strict=True) if each[0] not in failed]
    return _history(given.name, before, known, failed)


def named_in(
    finger: Finger, reference: Sequence[str], kinematics: int, least_gain: float, seed: int, recording: str
) -> dict[str, Any]:
    """Return a row: what has changed in one recording."""
    diagnosis = diagnose(
        finger, [recording], reference=reference, kinematics=kinematics, least_gain=least_gain, seed=seed
    )
    causes = [
        {"where": astuple(cause.where), "title": cause.title, "gain": cause.gain.value} for cause in diagnosis.causes
    ]
    return {"recording": recording, "verdict": diagnosis.verdict, "causes": causes}


def sizes_in(
    finger: Finger,
    reference: Sequence[str],
    kinematics: int,
    least_gain: float,
    seed: int,
    recording: str,
    keys: Sequence[tuple[Any, ...]],
) -> dict[str, Any]:
    """Return a row: the sizes of these effects at these places in one recording, all of them free."""
    given = read_input(finger, [recording], [], reference, kinematics, least_gain, True)
    kinematic = find_kinematic_causes(given, least_gain, seed)
    given, named = kinematic.corrected(given), [Where(*key) for key in keys]
    settings = FitSettings(threads=1, path=given.finger.path)
    asked = Asked(given, 0.0, seed, settings, Phases({}))
    base = find_base(given.finger, given.reference, settings, least_gain)
    sizes = Changes(asked, base).sizes([key for key in named if key not in kinematic.known])
    sizes += [(key, kinematic.known[key].size) for key in named if key in kinematic.known]
    listed = [{"where": astuple(where), **asdict(replace(size, by=()))} for where, size in sizes]
    return {"recording": recording, "sizes": json.dumps(listed)}  # intervals may be infinite


Known = tuple[str, dict[str, Any], dict[str, Any]]  # a recording with its rows of causes and of sizes


# --- put together -----------------------------------------------------------------------------------------------------


def _history(finger: str, references: Sequence[str], known: Sequence[Known], failed: Mapping[str, str]) -> History:
    recordings = [recording for recording, _, _ in known]
    times, dated = times_of([*references, *recordings])
    times = times[len(references) :]
    if not dated:
        times, dated = times_of(recordings)
    titles = {tuple(cause["where"]): cause["title"] for _, row, _ in known for cause in row["causes"]}
    lines = [_line(Where(*key), title, known, times) for key, title in titles.items()]

    def importance(line: Line) -> tuple[int, float]:
        return sum(size.named for size in line.sizes), max(size.gain for size in line.sizes)

    return History(
        finger=finger,
        references=tuple(references),
        recordings=tuple(recordings),
        times=times,
        dated=dated,
        lines=tuple(sorted((line for line in lines if line.sizes), key=importance, reverse=True)),
        verdicts=tuple(str(row["verdict"]) for _, row, _ in known),
        failed=tuple(failed.items()),
    )


def _line(where: Where, title: str, known: Sequence[Known], times: Sequence[float]) -> Line:
    key, listed, when = list(astuple(where)), [], []
    for (recording, causes, sizes), time in zip(known, times, strict=True):
        for entry in json.loads(sizes.get("sizes") or "[]"):
            if list(entry["where"]) == key:
                gain = sum(cause["gain"] for cause in causes["causes"] if list(cause["where"]) == key)
                then, now, change = (Interval(**entry[name]) for name in ("reference", "now", "change"))
                size = ChangedSize(entry["number"], entry["unit"], then, now, change)
                listed.append(Size(recording, size, gain > 0.0, gain))
                when.append(time)
    trend = slope(np.array(when), [size.size.now for size in listed]) if len(listed) >= FEWEST else None
    return Line(where, title, tuple(listed), trend, _since(listed))


def _since(sizes: Sequence[Size]) -> str | None:
    since = None
    for size in reversed(sizes):
        change = size.size.change
        if change.low <= 0.0 <= change.high:
            break
        since = size.recording
    return since


def times_of(recordings: Sequence[str]) -> tuple[tuple[float, ...], bool]:
    """Return weeks since the first recording, if all names have dates in the given order; else 1, 2, ..."""
    dates = [_date(Path(recording).stem) for recording in recordings]
    known = [date for date in dates if date is not None]
    if len(known) == len(dates) > 0 and all(a <= b for a, b in pairwise(known)):
        return tuple((date - known[0]) / WEEK for date in known), True
    return tuple(float(k) for k in range(1, len(dates) + 1)), False


def _date(name: str) -> float | None:
    """Return the date in a name, such as 2026-03-01 or 20260301T1230, in s."""
    matched = _DATE.search(name)
    if matched is None:
        return None
    year, month, day, hour, minute, second = (int(group or 0) for group in matched.groups())
    try:
        return datetime(year, month, day, hour, minute, second, tzinfo=timezone.utc).timestamp()
    except ValueError:
        return None


def _names(recordings: Sequence[str], options: Sequence[Any]) -> list[str]:
    """Return names of rows: number, stem, and a mark of all that the row depends on."""
    # If any of this differs, the row is computed again.
    finger, references, *others = options
    shared = [version_here(), finger.data, references, *others, *(_stamp(file) for file in references)]
    return [
        f"{k:04d}_{Path(recording).stem}_{_mark([*shared, recording, _stamp(recording)])}"
        for k, recording in enumerate(recordings, start=1)
    ]


def _mark(what: Any) -> str:
    """Return a short hash that is the same in every process."""
    return f"{zlib.crc32(json.dumps(what).encode()):08x}"


def _stamp(file: str) -> list[int]:
    try:
        status = os.stat(file)
    except OSError as failed:
        raise InputError(f"{file}: {failed.strerror}") from None
    return [status.st_size, status.st_mtime_ns]


def slope(times: Numbers, sizes: Sequence[Interval]) -> Interval:
    """Return the change per unit of time, by weighted least squares."""
    value = np.array([size.value for size in sizes])
    error = np.maximum(np.array([(size.high - size.low) / 3.92 for size in sizes]), 1e-300)
    weight = 1.0 / error**2
    centre = float(weight @ times / weight.sum())
    power = float(weight @ (times - centre) ** 2)
    if power <= 0.0:
        return Interval(0.0, -np.inf, np.inf)
    rise = float(weight @ ((times - centre) * value) / power)
    level = float(weight @ value / weight.sum())
    left = value - level - rise * (times - centre)
    scatter = float(weight @ left**2) / max(len(times) - 2, 1)
    half = 1.96 * float(np.sqrt(max(scatter, 1.0) / power))
    return Interval(rise, rise - half, rise + half)


def share_of(line: Line) -> Interval | None:
    """Return the trend as a share of the size in the reference."""
    base = line.sizes[0].size.reference.value
    if line.trend is None or not base or not math.isfinite(line.trend.low):
        return None
    ends = sorted((line.trend.low / base, line.trend.high / base))
    return Interval(line.trend.value / base, *ends)
