"""The command `score`: how well contact is detected, measured against labels."""

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
from tendonfmu.commands.command import Figures, Model, Progress, command, output_option
from tendonfmu.commands.console import Result, deliver, progress_bar, say_files
from tendonfmu.options import RecordingSources, ScoreOptions, keywords

if TYPE_CHECKING:
    from tendonfmu.detect import Scored
    from tendonfmu.model import FingerSource


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
