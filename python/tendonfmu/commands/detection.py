"""The commands `tune` and `score`: thresholds of contact from free motion, and how well contact is detected."""

from __future__ import annotations

import os
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tendonfmu import detect, drawing, estimate, files, recordings
from tendonfmu import report as reporting
from tendonfmu.commands.command import Figures, FreeAtPretensions, Model, Progress, Report, command, output_option
from tendonfmu.commands.console import NO, Result, deliver, fail, progress_bar, say_files
from tendonfmu.options import RecordingSources, ScoreOptions, TuneOptions, keywords

if TYPE_CHECKING:
    from tendonfmu.detect import ContactTuning, Scored, TuneReport
    from tendonfmu.model import Finger, FingerSource


@dataclass(frozen=True, eq=False, repr=False)
class TuneResult(Result):
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
    def report(self) -> TuneReport:
        """All results, as `tendonfmu tune --report` writes them."""
        return detect.tune_report.build_report(self.tuning)

    def shown(self) -> Any:
        """Return what the command prints."""
        return reporting.detection.tune_tables(self.report), reporting.detection.tune_lines(self.report), "joint"

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
        return drawing.sheets_figure(repr(self)[1:-1], [reporting.tail_sheet(self.tuning)])


@keywords(TuneOptions)
def tune(finger: FingerSource, recordings: RecordingSources, options: TuneOptions) -> TuneResult:
    """Tune contact detection on free motion for a stated rate of false alarms.

    Sets noise and drift of the bias, the bounds of the detection and the
    standard deviation of the estimated torque. Reports the false alarms in
    motion that the bounds were not learned from: record at least three
    motions, at all pretensions that the finger will have.

    Parameters
    ----------
    finger
        A fitted finger, its description, or the file of it.
    recordings
        Free motion at several pretensions: recordings, DataFrames or files. One alone needs no list.

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
    return TuneResult(detect.ContactTuning(finger, **vars(options)).tune(recordings))


@command("tune", TuneOptions, of=tune, reads=("finger", "recordings"))
def tune_files(
    finger: Annotated[Path, typer.Argument(metavar="FINGER.json", help="fitted finger description")],
    recordings: FreeAtPretensions,
    output: Annotated[Path, output_option("TUNED.json", "description to write")],
    options: TuneOptions,
    report: Report = None,
    figures: Figures = None,
    progress: Progress = None,
) -> None:
    estimate.check_outputs(output, report, figures, [finger, *recordings])
    try:
        with progress_bar("bounds", progress) as show, warnings.catch_warnings():
            warnings.simplefilter("ignore", detect.TuneWarning)  # printed with the result, one line each
            result = tune(finger, recordings, **vars(options) | {"progress": show})
    except detect.NotEnough as refused:
        fail(str(refused))
        raise typer.Exit(NO) from None
    deliver(result, output, f"{options.method}, tuned on {60 * result.tuning.hours_:.1f} min of free motion", report)
    if figures is not None:
        say_files(reporting.write_tune_figures(result.tuning, figures))


# --- score ------------------------------------------------------------------------------------------------------------


class ScoreWarning(UserWarning):
    """A remark of a score on its recordings; also in `ScoreResult.warnings`."""


@dataclass(frozen=True, eq=False, repr=False)
class ScoreResult(Result):
    """Contact detection measured against labels.

    Attributes
    ----------
    scored
        The finished score, with everything that it found.
    """

    scored: Scored

    def __repr__(self) -> str:
        alarms = files.counted(self.false_alarms, "false alarm")
        return f"<ScoreResult: {self.found} of {files.counted(self.events, 'event')} found, {alarms}>"

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
        return self.scored.summary.delay_s.median.number

    @property
    def report(self) -> Mapping[str, Any]:
        """All results, as `tendonfmu score -o` writes them."""
        return detect.build_report(self.scored)

    @property
    def warnings(self) -> list[str]:
        """Remarks on the recordings, one sentence each."""
        return list(self.scored.warnings)

    def shown(self) -> Any:
        """Return what the command prints."""
        return reporting.detection.score_tables(self.scored), reporting.detection.score_lines(self.scored), ""

    def write(self, path: str | os.PathLike[str]) -> None:
        """Write the report, as `tendonfmu score -o`. Raises InputError if it cannot be written."""
        files.write_text(Path(path), files.report_text(self.report))

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
        track = self.scored.tracks[recording]
        time, torque = track.recording.time, track.outputs["compensated_torque"]
        rows = {f"joint {j + 1} (N·m)": {"compensated": torque[:, j]} for j in range(torque.shape[1])}
        if track.external is not None:
            for curves, external in zip(rows.values(), track.external.T, strict=True):
                curves["sensor"] = external
        shaded = {("label", drawing.GREY): track.label, ("alarm", drawing.ORANGE): track.alarm}
        stretches = {name: recordings.flagged_stretches(time, flags) for name, flags in shaded.items()}
        return drawing.series_figure(str(track.recording.path), "time (s)", time, rows, stretches)


@keywords(ScoreOptions)
def score(finger: FingerSource, recordings: RecordingSources, options: ScoreOptions) -> ScoreResult:
    """Measure contact detection against labels: events found and missed, false alarms, delay, torque, ROC.

    An event is a labelled contact; labels less than 100 ms apart are one event.
    It is found if an alarm begins in it and the 200 ms before it had no alarm.
    An alarm that begins neither in an event nor in the 100 ms after one is
    false. Every figure has its 95 % interval. Several recordings are pooled.

    Parameters
    ----------
    finger
        A finger, its description, the file of it, or an FMU.
    recordings
        Labelled recordings or free motion: recordings, DataFrames or files. One alone needs no list.

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
    result = ScoreResult(detect.score_recordings(finger, recordings, options, options.progress))
    result.warn(ScoreWarning)
    return result


@command("score", ScoreOptions, of=score, reads=("model", "recordings"))
def score_files(
    model: Model,
    recordings: Annotated[list[Path], typer.Argument(metavar="RECORDING", help="labelled or free, .csv or .parquet")],
    output: Annotated[Path, output_option("SCORE.json", "report to write")],
    options: ScoreOptions,
    figures: Figures = None,
    progress: Progress = None,
) -> None:
    estimate.check_outputs(output, None, figures, [model, *recordings])
    with progress_bar("runs", progress) as show, warnings.catch_warnings():
        warnings.simplefilter("ignore", ScoreWarning)  # printed with the result, one line each
        result = score(model, recordings, **vars(options) | {"progress": show})
    words = f"{files.counted(result.events, 'event')}, {files.counted(result.false_alarms, 'false alarm')}"
    deliver(result, output, words)
    if figures is not None:
        say_files(reporting.write_score_figures(result.scored, figures))
