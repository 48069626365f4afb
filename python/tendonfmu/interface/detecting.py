"""Tunes and scores contact detection (`tendonfmu tune`, `score`)."""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tendonfmu.detect import ContactTuning, Scored, score_recordings, score_report, tune_report
from tendonfmu.files import counted, report_text, write_text
from tendonfmu.model import Finger, FingerSource
from tendonfmu.options import ScoreOptions, TuneOptions
from tendonfmu.recordings import RecordingSource, flagged_stretches
from tendonfmu.report import detect_text, html_of, tail_sheet


@dataclass(frozen=True, eq=False, repr=False)
class TuneResult:
    """A finger with tuned contact detection.

    Attributes
    ----------
    tuning
        The finished tuning, with everything that it found.
    """

    tuning: ContactTuning

    def __repr__(self) -> str:
        return f"<TuneResult {self.finger.name}: {self.attained_rate:.3g} false alarms per hour in motion kept out>"

    @property
    def finger(self) -> Finger:
        """The tuned finger."""
        return self.tuning.description_

    @property
    def attained_rate(self) -> float:
        """Rate of false alarms in motion that was kept out of the learning (1/h)."""
        return self.tuning.kept_out_.alarms / self.tuning.kept_out_.hours

    @property
    def report(self) -> Mapping[str, Any]:
        """All results, as `tendonfmu tune --report` writes them."""
        return tune_report.build_report(self.tuning)

    @property
    def warnings(self) -> list[str]:
        """Remarks on the recordings and the result, one sentence each."""
        return list(self.tuning.warnings_)

    def write(self, path: str | os.PathLike[str]) -> None:
        """Write the tuned description, as `tendonfmu tune -o`. Raises InputError if it cannot be written."""
        self.finger.write(path)

    def plot(self) -> Any:
        """Draw the false alarms over a factor on all bounds, in motion that was kept out.

        Returns
        -------
        plotly.graph_objects.Figure
            The chosen bounds have the factor 1.
        """
        from tendonfmu.drawing import sheets_figure

        return sheets_figure(repr(self)[1:-1], [tail_sheet(self.tuning)])

    def _repr_html_(self) -> str:
        tables, lines = detect_text.tune_tables(self.tuning), detect_text.tune_lines(self.tuning)
        return html_of(repr(self)[1:-1], tables, lines, self.warnings)


def tune(
    finger: FingerSource,
    recordings: RecordingSource | Sequence[RecordingSource],
    *,
    false_alarms_per_hour: float = 6.0,
    method: str = "bands",
    bias_time: float | None = None,
    kinematics: int = 1,
    progress: Callable[[int, int], None] | None = None,
) -> TuneResult:
    """Tune contact detection on free motion for a stated rate of false alarms.

    Parameters
    ----------
    finger
        A fitted finger, its description, or the file of it.
    recordings
        Free motion at several pretensions: recordings, DataFrames or files. One alone needs no list.
    false_alarms_per_hour
        Rate of false alarms in other free motion of the same finger (1/h).
    method
        "bands", or "paper" for the threshold of the paper.
    bias_time
        Time constant of the bias (s); None: unchanged.
    kinematics
        1 tendon positions, 2 measured joint positions, 3 joint positions and velocities.
    progress
        Called with steps done and steps.

    Returns
    -------
    TuneResult
        The tuned finger.

    Raises
    ------
    InputError
        A recording is not sound, there is too little free motion, or an option is out of range.

    Warns
    -----
    TuneWarning
        Remarks on the recordings and the result; also in `TuneResult.warnings`.
    """
    options = TuneOptions.of(locals())
    return TuneResult(ContactTuning(finger, progress=progress, **vars(options)).tune(recordings))


class ScoreWarning(UserWarning):
    """A remark of a score on its recordings; also in `ScoreResult.warnings`."""


@dataclass(frozen=True, eq=False, repr=False)
class ScoreResult:
    """Contact detection measured against labels.

    Attributes
    ----------
    scored
        The finished score, with everything that it found.
    """

    scored: Scored

    def __repr__(self) -> str:
        alarms = counted(self.false_alarms, "false alarm")
        return f"<ScoreResult: {self.found} of {counted(self.events, 'event')} found, {alarms}>"

    @property
    def events(self) -> int:
        """Number of labelled contacts."""
        return self.scored.summary.events

    @property
    def found(self) -> int:
        """How many of them were found."""
        return self.scored.summary.found

    @property
    def false_alarms(self) -> int:
        """Number of alarms that begin neither in an event nor just after one."""
        return self.scored.summary.false_alarms

    @property
    def median_delay(self) -> float:
        """Median time from the onset of an event to its alarm (s); NaN if none was found."""
        return self.scored.summary.delay["median"].value

    @property
    def report(self) -> Mapping[str, Any]:
        """All results, as `tendonfmu score -o` writes them."""
        return score_report.build_report(self.scored)

    @property
    def warnings(self) -> list[str]:
        """Remarks on the recordings, one sentence each."""
        return list(self.scored.warnings)

    def write(self, path: str | os.PathLike[str]) -> None:
        """Write the report, as `tendonfmu score -o`. Raises InputError if it cannot be written."""
        write_text(Path(path), report_text(self.report))

    def plot(self, recording: int = 0) -> Any:
        """Draw the compensated torque over time, with the labels and the alarms.

        Parameters
        ----------
        recording
            Which one of the recordings, from 0.

        Returns
        -------
        plotly.graph_objects.Figure
            A row per joint. Labels are shaded grey, alarms orange.
        """
        from tendonfmu.drawing import GREY, ORANGE, series_figure

        track = self.scored.tracks[recording]
        time, torque = track.recording.time, track.outputs["compensated_torque"]
        rows = {f"joint {j + 1} (N·m)": {"compensated": torque[:, j]} for j in range(torque.shape[1])}
        if track.external is not None:
            for curves, external in zip(rows.values(), track.external.T, strict=True):
                curves["sensor"] = external
        shaded = {("label", GREY): track.label, ("alarm", ORANGE): track.alarm}
        stretches = {name: flagged_stretches(time, flags) for name, flags in shaded.items()}
        return series_figure(str(track.recording.path), "time (s)", time, rows, stretches)

    def _repr_html_(self) -> str:
        tables, lines = detect_text.score_tables(self.scored), detect_text.score_lines(self.scored)
        return html_of(repr(self)[1:-1], tables, lines, self.warnings)


def score(
    finger: FingerSource,
    recordings: RecordingSource | Sequence[RecordingSource],
    *,
    labels: str | None = None,
    force: str | None = None,
    kinematics: int = 1,
    seed: int = 0,
    progress: Callable[[int, int], None] | None = None,
) -> ScoreResult:
    """Measure contact detection against labels: events found and missed, false alarms, delay, torque, ROC.

    Parameters
    ----------
    finger
        A finger, its description, the file of it, or an FMU.
    recordings
        Labelled recordings or free motion: recordings, DataFrames or files. One alone needs no list.
    labels
        Column that is 1 in contact, else 0; None: `contact`, where there is one.
    force
        Column of the sensed force (N), or None.
    kinematics
        1 tendon positions, 2 measured joint positions, 3 joint positions and velocities.
    seed
        Seed of the resampling for the intervals.
    progress
        Called with runs done and runs.

    Returns
    -------
    ScoreResult
        The score of all recordings together, and of each.

    Raises
    ------
    InputError
        A file, a column or an option does not allow a score.

    Warns
    -----
    ScoreWarning
        Remarks on the recordings; also in `ScoreResult.warnings`.
    """
    scored = score_recordings(finger, recordings, ScoreOptions.of(locals()), progress)
    for sentence in scored.warnings:
        warnings.warn(sentence, ScoreWarning, stacklevel=2)  # at the call of tendonfmu.score
    return ScoreResult(scored)
