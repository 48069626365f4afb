"""The command `run`: a finger over a recording."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tendonfmu import drawing, files, fmu, model
from tendonfmu import recordings as recorded
from tendonfmu import report as reporting
from tendonfmu.commands.command import Model, Progress, command, output_option
from tendonfmu.commands.console import check_table, name_of, print_json, progress_bar, say, write_table
from tendonfmu.errors import InputError
from tendonfmu.options import RunOptions, keywords

if TYPE_CHECKING:
    import pandas as pd
    from numpy.typing import NDArray

    from tendonfmu.model import FingerSource
    from tendonfmu.recordings import Recording, RecordingSource


@dataclass(frozen=True, eq=False, repr=False)
class RunResult:
    """What a finger makes of a recording.

    Attributes
    ----------
    recording
        The recording.
    outputs
        `time` [N] (s), then the FMU's outputs by name: numbers of joints [N, n], of tendons [N, m], or [N].
    """

    recording: Recording
    outputs: Mapping[str, NDArray[Any]]

    def __repr__(self) -> str:
        return f"<RunResult {self.recording.path}: {self.summary}>"

    @property
    def summary(self) -> str:
        """Number of samples, duration, range of the joint angles and samples in contact, in a line."""
        return fmu.summary(self.outputs)

    @property
    def frame(self) -> pd.DataFrame:
        """All outputs as a pandas DataFrame, with the columns that `tendonfmu run` writes."""
        return files.frame_of(self.columns())

    def columns(self) -> dict[str, NDArray[Any]]:
        """Return all outputs by column [N], such as `joint_torque[2]`, `time` first."""
        return fmu.columns_of(self.outputs)

    def write(self, path: str | os.PathLike[str]) -> None:
        """Write all outputs as .csv or .parquet, whole or not at all.

        Parameters
        ----------
        path
            The file.

        Raises
        ------
        InputError
            The format is unknown, or the file cannot be written.
        """
        files.write_table(path, self.columns())

    def plot(self) -> Any:
        """Draw what the tendons pull, the friction and what is left, by joint over time.

        Returns
        -------
        plotly.graph_objects.Figure
            A row per joint. Contacts that the finger reports are shaded.
        """
        outputs, names = self.outputs, {"pulled": "joint", "friction": "friction", "compensated": "compensated"}
        rows = {
            f"joint {j + 1} (N·m)": {short: outputs[f"{name}_torque"][:, j] for short, name in names.items()}
            for j in range(outputs["joint_torque"].shape[1])
        }
        contact = {("contact", drawing.ORANGE): recorded.flagged_stretches(outputs["time"], outputs["contact"])}
        return drawing.series_figure(str(self.recording.path), "time (s)", outputs["time"], rows, contact)

    def _repr_html_(self) -> str:
        headings = ("output", "mean", "least", "largest")
        rows = [
            (name, *(f"{value:.4g}" for value in (column.mean(), column.min(), column.max())))
            for name, column in self.columns().items()
            if name.startswith(("compensated_torque[", "joint_angle["))
        ]
        return reporting.html_of(f"{self.recording.path}", [("in N·m and rad", headings, rows)], [self.summary])


@keywords(RunOptions)
def run(finger: FingerSource, recording: RecordingSource, options: RunOptions) -> RunResult:
    """Run a finger over a recording, for all outputs, one row per sample at the time of that sample.

    It runs in the C library in one call, which gives the same bits as the FMU.
    An FMU runs sample by sample.

    Parameters
    ----------
    finger
        A finger, its description, the file of it, or an FMU.
    recording
        A recording, DataFrame or file.

    Returns
    -------
    RunResult
        All outputs, one row per sample at the time of that sample.

    Raises
    ------
    InputError
        The finger or the recording is refused, or they do not fit.
    """
    samples = recorded.read_recording(recording)
    source = model.finger_file(finger) if isinstance(finger, str) else finger
    outputs = fmu.run_model(source, samples, kinematics_source=options.kinematics, progress=options.progress)
    return RunResult(samples, outputs)


@command("run", RunOptions, of=run, reads=("model", "recording"))
def run_files(
    model: Model,
    recording: Annotated[Path, typer.Argument(metavar="RECORDING", help="recording, .csv or .parquet")],
    output: Annotated[Path, output_option("OUT.csv", "table: .csv, .parquet or .mcap; -: as CSV")],
    options: RunOptions,
    report: Annotated[
        Path | None, typer.Option(metavar="PAGE.html|DIR", help="page of the run; in a folder run.html")
    ] = None,
    progress: Progress = None,
) -> None:
    """Of a hand, all fingers run, into one table with columns as index.joint_torque[1]."""
    fmu.check_model(model)
    check_table(output, model, recording)
    if report is not None:
        reporting.check_page(report, model, recording)
        if report.resolve() == output.resolve():
            raise InputError(f"{report}: the same file for outputs and page; expected two names")
    samples = recorded.read_recording(recording)
    with progress_bar("samples", progress, total=len(samples)) as show:
        result = run(model, samples, **vars(options) | {"progress": show})
    table = result.columns()
    write_table(output, table)
    numbers = reporting.run_report(
        model, recording, table, fmu.finger_of(model), kinematics=options.kinematics, output=name_of(output)
    )
    say(f"{name_of(output)}: {result.summary}")
    if report is not None:
        say(f"{reporting.write_run_page(report, numbers, table, samples.contact)}: the run, to be read in a browser")
    print_json(lambda: numbers)
