"""Runs a finger over a recording (`tendonfmu run`)."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from numpy.typing import NDArray

from tendonfmu.files import frame_of, write_table
from tendonfmu.fmu import columns_of, run_model
from tendonfmu.fmu import summary as summary_of
from tendonfmu.model import FingerSource, finger_file
from tendonfmu.options import RunOptions
from tendonfmu.recordings import Recording, RecordingSource, flagged_stretches, read_recording
from tendonfmu.report import html_of

if TYPE_CHECKING:
    import pandas as pd


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
        return summary_of(self.outputs)

    @property
    def frame(self) -> pd.DataFrame:
        """All outputs as a pandas DataFrame, with the columns that `tendonfmu run` writes."""
        return frame_of(self.columns())

    def columns(self) -> dict[str, NDArray[Any]]:
        """Return all outputs by column [N], such as `joint_torque[2]`, `time` first."""
        return columns_of(self.outputs)

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
        write_table(path, self.columns())

    def plot(self) -> Any:
        """Draw what the tendons pull, the friction and what is left, by joint over time.

        Returns
        -------
        plotly.graph_objects.Figure
            A row per joint. Contacts that the finger reports are shaded.
        """
        from tendonfmu.drawing import ORANGE, series_figure

        outputs, names = self.outputs, {"pulled": "joint", "friction": "friction", "compensated": "compensated"}
        rows = {
            f"joint {j + 1} (N·m)": {short: outputs[f"{name}_torque"][:, j] for short, name in names.items()}
            for j in range(outputs["joint_torque"].shape[1])
        }
        contact = {("contact", ORANGE): flagged_stretches(outputs["time"], outputs["contact"])}
        return series_figure(str(self.recording.path), "time (s)", outputs["time"], rows, contact)

    def _repr_html_(self) -> str:
        headings = ("output", "mean", "least", "largest")
        rows = [
            (name, *(f"{value:.4g}" for value in (column.mean(), column.min(), column.max())))
            for name, column in self.columns().items()
            if name.startswith(("compensated_torque[", "joint_angle["))
        ]
        return html_of(f"{self.recording.path}", [("in N·m and rad", headings, rows)], [self.summary])


def run(
    finger: FingerSource,
    recording: RecordingSource,
    *,
    kinematics: int = 1,
    progress: Callable[[int], None] | None = None,
) -> RunResult:
    """Run a finger over a recording.

    It runs in the C library in one call, which gives the same bits as the FMU. An FMU runs sample by sample.

    Parameters
    ----------
    finger
        A finger, its description, the file of it, or an FMU.
    recording
        A recording, DataFrame or file.
    kinematics
        1 tendon positions, 2 measured joint positions, 3 joint positions and velocities.
    progress
        Called with the number of samples done.

    Returns
    -------
    RunResult
        All outputs, one row per sample at the time of that sample.

    Raises
    ------
    InputError
        The finger or the recording is refused, or they do not fit.
    """
    options = RunOptions.of(locals())
    samples = read_recording(recording)
    model = finger_file(finger) if isinstance(finger, str) else finger
    return RunResult(samples, run_model(model, samples, kinematics_source=options.kinematics, progress=progress))
