"""The command `tune`: thresholds of contact detection from free motion."""

from __future__ import annotations

import os
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tendonfmu import detect, drawing, estimate
from tendonfmu import report as reporting
from tendonfmu.commands.command import Figures, FreeAtPretensions, Progress, Report, command, output_option
from tendonfmu.commands.console import NO, Result, deliver, fail, progress_bar, say_files
from tendonfmu.options import RecordingSources, TuneOptions, keywords

if TYPE_CHECKING:
    from tendonfmu.detect import ContactTuning, TuneReport
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
