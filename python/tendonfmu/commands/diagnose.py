"""The command `diagnose`: what a model gets wrong, or what has changed."""

from __future__ import annotations

import os
import warnings
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tendonfmu import diagnosis, drawing, estimate, files, model, tasks
from tendonfmu import recordings as recorded
from tendonfmu import report as reporting
from tendonfmu.commands.command import ExtendedFinger, FreeRecordings, Progress, Scheduler, command, output_option
from tendonfmu.commands.console import (
    Bar,
    Result,
    print_json,
    print_result,
    print_results,
    progress_bar,
    say_files,
    warn,
)
from tendonfmu.errors import InputError
from tendonfmu.options import DiagnoseOptions, RecordingSources, keywords

if TYPE_CHECKING:
    from tendonfmu.diagnosis import Cause
    from tendonfmu.model import Finger, FingerSource
    from tendonfmu.report import DiagnosisReport
    from tendonfmu.statistics import Interval


class DiagnosisWarning(UserWarning):
    """A remark of a diagnosis on its recordings and its result; also in `Diagnosis.warnings`."""


@dataclass(frozen=True, eq=False, repr=False)
class Diagnosis(Result):
    """What a model gets wrong, or what has changed, and what correcting it gains.

    Attributes
    ----------
    found
        The finished diagnosis, with everything that it found.
    """

    found: diagnosis.Diagnosis

    def __repr__(self) -> str:
        causes = ", ".join(cause.effect for cause in self.causes) or "no cause"
        return f"<Diagnosis of {self.found.finger}: {self.verdict}; {causes}>"

    @property
    def verdict(self) -> str:
        """One of "adequate", "explained", "partly explained" and "unexplained"."""
        return self.found.verdict

    @property
    def causes(self) -> tuple[Cause, ...]:
        """The causes in order of their gain, as in diagnosis.json: `effect`, `joint`, `tendon`, `gain`, `size`, ..."""
        return tuple(diagnosis.reported_causes(self.found))

    @property
    def gain(self) -> Interval:
        """Share of the rms on unseen data that the causes remove, with its 95 % interval: `value`, `low`, `high`."""
        return self.found.gain

    @property
    def extended(self) -> Finger:
        """The finger with its causes, fitted."""
        return model.finger_from_data(self.found.extended_data, Path("extended"))

    @property
    def nominal(self) -> Finger:
        """The given structure, fitted."""
        return model.finger_from_data(self.found.nominal_data, Path("nominal"))

    @property
    def report(self) -> DiagnosisReport:
        """All results, as diagnosis.json has them."""
        return reporting.build_report(self.found, [])

    @property
    def warnings(self) -> list[str]:
        """Remarks on the recordings and the result, one sentence each."""
        return list(self.found.warnings)

    def shown(self) -> Any:
        """Return what the command prints."""
        return reporting.diagnosis_text.tables(self.found), reporting.diagnosis_text.lines(self.found), "may also be"

    def write(self, folder: str | os.PathLike[str]) -> dict[Path, str]:
        """Write page, report, both fingers and the FMU, as `tendonfmu diagnose -o`.

        Parameters
        ----------
        folder
            Output folder; it is made if missing.

        Returns
        -------
        dict of Path to str
            What each file contains.

        Raises
        ------
        InputError
            The files cannot be written. The folder is then as before.
        """
        return reporting.write_diagnosis(self.found, Path(folder))

    def plot(self, residuals: bool = True) -> Any:
        """Draw the evidence for each cause, then the residual at each joint, before and after.

        Parameters
        ----------
        residuals
            Whether the residuals are drawn, eight panels a joint.

        Returns
        -------
        plotly.graph_objects.Figure
            The figures of diagnosis.html.
        """
        sheets = [sheet for sheet in reporting.diagnosis_sheets(self.found) if residuals or sheet.section != "views"]
        return drawing.sheets_figure(repr(self)[1:-1], sheets)


@keywords(DiagnoseOptions)
def diagnose(finger: FingerSource, recordings: RecordingSources, options: DiagnoseOptions) -> Diagnosis:
    """Show what the model gets wrong, name the cause, add it to the model and measure the gain.

    The given structure is fitted first: a cause is what no fit of it can
    explain.

    With a reference a cause is what has changed since. The reference may have
    another motion, pretension or length, but the same motion shows most.
    Several recordings of now, in order of time, show how the change grows.

    Parameters
    ----------
    finger
        A finger, its description, or the file of it.
    recordings
        Free motion: recordings, DataFrames or files. One alone needs no list.

    Returns
    -------
    Diagnosis
        Verdict, causes, gain and the extended finger.

    Raises
    ------
    InputError
        A file or an option is at fault.

    Warns
    -----
    DiagnosisWarning
        Remarks on the recordings and the result; also in `Diagnosis.warnings`.
    """
    now, tests = recorded.listed_sources(recordings), recorded.listed_sources(options.test)
    before = [] if options.reference is None else recorded.listed_sources(options.reference)
    estimate.check_given_once(now, tests, "a test")
    estimate.check_given_once([*now, *tests], before, "the reference")
    settings = options.without("test", "reference")
    found = Diagnosis(diagnosis.diagnose(finger, now, tests, reference=before or None, **settings))
    found.warn(DiagnosisWarning)
    return found


@command("diagnose", DiagnoseOptions, of=diagnose)
def diagnose_files(
    finger: ExtendedFinger,
    recordings: FreeRecordings,
    output: Annotated[Path, output_option("DIR", "folder for page, report and model")],
    options: DiagnoseOptions,
    history: Annotated[
        bool,
        typer.Option(
            "--history",
            help="compare each recording, in order of time, with the reference [default: the first recording]",
        ),
    ] = False,
    scheduler: Scheduler = None,
    progress: Progress = None,
) -> None:
    """--test and --reference take several files at once after the recordings.

    Of a hand, every finger is diagnosed in DIR/FINGER, and DIR gets the page
    hand.html.

    DIR gets the page diagnosis.html, diagnosis.json, and the model with its
    causes, extended.json and extended.fmu. With --history it gets the page
    history.html and history.csv: a line per recording and cause, and how fast
    each cause grows.
    """
    tests, before = options.files("test"), options.files("reference")
    if history and tests:
        raise InputError("--test: given with --history; expected recordings in order of time only")
    if history:
        _history(finger, recordings, before, output, scheduler, options, progress)
        return
    if scheduler is not None:
        raise InputError("--scheduler: given without --history; expected both or neither")
    reporting.check_folder(output, [finger, *recordings, *tests, *before])
    with Bar(progress) as bar:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DiagnosisWarning)  # printed with the result, one line each
            diagnosed = diagnose(finger, recordings, **vars(options) | {"progress": bar.phase})
        bar("writing the files")
        written = diagnosed.write(output)
    print_result(diagnosed)
    say_files(written)
    print_json((output / reporting.REPORT).read_text)


def _history(
    finger: Path,
    recordings: list[Path],
    reference: list[Path],
    output: Path,
    scheduler: str | None,
    options: DiagnoseOptions,
    progress: bool | None,
) -> None:
    """Run `diagnose --history`."""
    estimate.check_given_once(recordings, reference, "the reference")
    files.check_output_folder(output)
    given = model.read_finger(finger)
    several = scheduler is not None or options.jobs > 1
    with (
        tasks.workers_of(scheduler, options.jobs) if several else nullcontext() as client,
        progress_bar("recordings", progress, total=2 * len(recordings)) as show,
    ):
        history = diagnosis.diagnose_history(
            given,
            recordings,
            reference,
            rows=output,
            client=client,
            kinematics=options.kinematics,
            least_gain=options.least_gain,
            seed=options.seed,
            progress=show,
        )
    names = diagnosis.names_in(given.data)
    written = reporting.write_history(history, names, output)
    headings = ("cause", "place", "reference", "last", "named in", "trend")
    rows = list(reporting.rows_of_lines(history, names))
    print_results([(history.finger, headings, rows)] if rows else (), [reporting.headline(history)], left="trend")
    for name, why in history.failed:
        warn(f"{name}: left out: {why}")
    say_files(written)
    print_json(lambda: reporting.history_report(history, written))
