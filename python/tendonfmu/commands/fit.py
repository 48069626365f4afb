"""The command `fit`: numbers of a finger, estimated from free motion."""

from __future__ import annotations

import os
import sys
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tendonfmu import drawing, estimate, files, fmu
from tendonfmu import report as reporting
from tendonfmu.commands.command import FingerFile, FreeRecordings, Progress, Report, command, output_option
from tendonfmu.commands.console import INTERRUPTED, Bar, Result, deliver, fail, say, say_files
from tendonfmu.options import FitArguments, RecordingSources, keywords

if TYPE_CHECKING:
    import pandas as pd

    from tendonfmu.arrays import Numbers
    from tendonfmu.estimate import FitReport, FrictionFit
    from tendonfmu.fmu import SetParameter
    from tendonfmu.model import Finger, FingerSource


class FitInterrupted(KeyboardInterrupt):
    """Ctrl-C ended a fit; `unfinished` is the finger with its best estimate so far."""

    def __init__(self, unfinished: Any) -> None:
        super().__init__("fit interrupted")
        self.unfinished = unfinished


@dataclass(frozen=True, eq=False, repr=False)
class FitResult(Result):
    """A fitted finger, and how well its numbers are known.

    Attributes
    ----------
    estimator
        The finished estimation, with everything that it found.
    """

    estimator: FrictionFit

    def __repr__(self) -> str:
        known = self.report["identified"]
        return f"<FitResult {self.finger.name}: {known['count']} of {known['of']} numbers identified>"

    @property
    def finger(self) -> Finger:
        """The fitted finger."""
        return self.estimator.description_

    @property
    def parameters(self) -> pd.DataFrame:
        """The estimated numbers by path.

        Columns `unit`, `start`, `value`, `standard_error`, `identified`, `at_bound`, `reason` and `advice`: value
        before and after the fit, whether the standard error is at most 30 % of the value, and if not, why.
        """
        import numpy
        import pandas as pd

        types: dict[str, Any] = {"start": float, "value": float, "standard_error": float, "identified": bool}
        names = ("unit", "start", "value", "standard_error", "identified", "at_bound", "reason", "advice")
        rows = [dict(row) for row in self.report["parameters"]]
        index = pd.Index([row["path"] for row in rows], name="path", dtype=object)
        columns = {name: numpy.array([row[name] for row in rows], dtype=types.get(name, object)) for name in names}
        table: pd.DataFrame = pd.DataFrame(columns, index=index)
        return table

    @property
    def residual_rms(self) -> Numbers:
        """Rms [n] of the residual on the samples trained on, before the bias learns from it (N·m)."""
        return _numbers(self.report["residual"]["train"]["rms"])

    @property
    def held_out_rms(self) -> Numbers | None:
        """The same on the samples held out; None without `holdout`."""
        residual = self.report["residual"]["held_out"]
        return None if residual is None else _numbers(residual["rms"])

    @property
    def report(self) -> FitReport:
        """All results, as `tendonfmu fit --report` writes them."""
        return self.estimator.report_

    def shown(self) -> Any:
        """Return what the command prints."""
        return reporting.fit_page.tables(self.estimator), reporting.fit_page.lines(self.estimator), "joint"

    def write(self, path: str | os.PathLike[str]) -> None:
        """Write the fitted description, or the estimated numbers as a parameter set of SSP.

        Parameters
        ----------
        path
            A .json file, as of `tendonfmu fit -o`; or a .ssv file, as of `--ssv`: the values that an FMU of the finger
            takes, with their standard errors and the warnings of the fit as annotations.

        Raises
        ------
        InputError
            The file cannot be written.
        """
        file = Path(path)
        if file.suffix.lower() == ".ssv":
            name = f"{self.finger.name}: fitted"
            fmu.write_parameter_set(file, name, self._set_parameters(), self.finger, warnings=self.warnings)
        else:
            self.finger.write(path)

    def _set_parameters(self) -> list[SetParameter]:
        """Return the estimated numbers, and static friction that is equal to an estimated Coulomb friction."""
        known = self.finger.numbers
        return [
            fmu.SetParameter(path, known[path].start, fitted.standard_error, fitted.identified)
            for fitted in self.estimator.numbers_
            for path in (fitted.number.path, fitted.number.with_path)
            if path is not None and path in known
        ]

    def plot(self) -> Any:
        """Draw the torque with the model's prediction, on what was trained on, held out and compared, and the laws.

        Returns
        -------
        plotly.graph_objects.Figure
            The figures of `tendonfmu fit --figures` of these kinds.
        """
        picture = self.estimator.picture()
        return drawing.sheets_figure(
            repr(self)[1:-1], [*reporting.torque_sheets(picture), *reporting.law_sheets(picture)]
        )


def _numbers(values: Any) -> Numbers:
    import numpy

    return numpy.array(values, dtype=float)


@keywords(FitArguments)
def fit(finger: FingerSource, recordings: RecordingSources, options: FitArguments) -> FitResult:
    """Estimate the numbers of a finger from recordings of free motion, with their uncertainty.

    Effects that the description lacks stay absent. PATTERN is a path of the
    description, such as tendons[*].edge_friction[2]*.viscous; * stands for
    anything.

    Parameters
    ----------
    finger
        A finger, its description, or the file of it.
    recordings
        Recordings, DataFrames or files to train on. One alone needs no list.

    Returns
    -------
    FitResult
        The fitted finger and its numbers.

    Raises
    ------
    InputError
        An option, a file or a recording does not allow a sound fit.
    FitInterrupted
        After Ctrl-C, with the best estimate so far.

    Warns
    -----
    FitWarning
        Remarks on the recordings and the fit; also in `FitResult.warnings`.
    """
    estimator = estimate.FrictionFit(finger, **options.without("compare"))
    try:
        estimator.fit(recordings, compare=options.compare)
    except KeyboardInterrupt:
        if estimator.unfinished_ is None:
            raise
        raise FitInterrupted(estimator.unfinished_) from None
    if not estimator.finished_:  # `progress` has stopped it
        raise FitInterrupted(estimator.unfinished_)
    return FitResult(estimator)


@command("fit", FitArguments, of=fit, reads=("finger", "recordings"))
def fit_files(
    finger: FingerFile,
    recordings: FreeRecordings,
    output: Annotated[Path, output_option("FITTED.json", "description to write")],
    options: FitArguments,
    report: Report = None,
    ssv: Annotated[
        Path | None, typer.Option(metavar="FITTED.ssv", help="parameter set of SSP to write, for FMUs of the finger")
    ] = None,
    figures: Annotated[Path | None, typer.Option(metavar="DIR", help="folder for the page report.html")] = None,
    progress: Progress = None,
) -> None:
    """Ctrl-C saves the best estimate so far in FITTED.unfinished.json."""
    inputs = [finger, *recordings, *options.files("compare", "previous", "start")]
    estimate.check_outputs(output, report, figures, inputs)
    if ssv is not None:
        fmu.check_parameter_set_path(ssv, *inputs)
    try:
        with Bar(progress) as bar, warnings.catch_warnings():
            warnings.simplefilter("ignore", estimate.FitWarning)  # printed with the result, one line each
            result = fit(finger, recordings, **vars(options) | {"progress": bar.fit})
    except FitInterrupted as stopped:
        left = output.with_name(f"{output.stem}.unfinished.json")
        stopped.unfinished.write(left)
        fail(f"interrupted; the best estimate so far is in {left}, a description that fit can --start from")
        sys.exit(INTERRUPTED)
    if ssv is not None:
        result.write(ssv)
    deliver(result, output, f"{files.counted(len(result.parameters), 'number')} estimated", report)
    if report is not None:
        say(f"{report}: all results, as JSON")
    if ssv is not None:
        say(f"{ssv}: parameter set for an FMU of the finger")
    if figures is not None:
        say_files(reporting.write_fit_page(result.estimator.picture(), figures))
