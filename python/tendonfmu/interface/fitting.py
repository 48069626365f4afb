"""Estimates the numbers of a finger (`tendonfmu fit`)."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tendonfmu.arrays import Numbers
from tendonfmu.estimate import FrictionFit
from tendonfmu.fmu import SetParameter, write_parameter_set
from tendonfmu.model import Finger, FingerSource, native
from tendonfmu.options import FitOptions
from tendonfmu.recordings import RecordingSource
from tendonfmu.report import fit_text, html_of

if TYPE_CHECKING:
    import pandas as pd


class FitInterrupted(KeyboardInterrupt):
    """Ctrl-C ended a fit; `unfinished` holds its best estimate so far."""

    def __init__(self, unfinished: Any) -> None:
        super().__init__("fit interrupted")
        self.unfinished = unfinished


@dataclass(frozen=True, eq=False, repr=False)
class FitResult:
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
        import pandas as pd

        names = ("unit", "start", "value", "standard_error", "identified", "at_bound", "reason", "advice")
        rows = self.report["parameters"]
        index = pd.Index([row["path"] for row in rows], name="path", dtype=object)
        columns = {name: np.array([row[name] for row in rows], dtype=_TYPES.get(name, object)) for name in names}
        table: pd.DataFrame = pd.DataFrame(columns, index=index)
        return table

    @property
    def residual_rms(self) -> Numbers:
        """Rms [n] of the residual on the samples trained on, before the bias learns from it (N·m)."""
        return np.array(self.report["residual"]["train"]["rms"], dtype=float)

    @property
    def held_out_rms(self) -> Numbers | None:
        """The same on the samples held out; None without `holdout`."""
        residual = self.report["residual"]["held_out"]
        return None if residual is None else np.array(residual["rms"], dtype=float)

    @property
    def report(self) -> Mapping[str, Any]:
        """All results, as `tendonfmu fit --report` writes them."""
        return self.estimator.report_

    @property
    def warnings(self) -> list[str]:
        """Remarks on the recordings and the fit, one sentence each."""
        return list(self.estimator.warnings_)

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
            write_parameter_set(file, name, self._set_parameters(), self.finger, warnings=self.warnings)
        else:
            self.finger.write(path)

    def _set_parameters(self) -> list[SetParameter]:
        """Return the estimated numbers, and static friction that is equal to an estimated Coulomb friction."""
        finger = native.Instance(self.finger.image)
        known = {parameter.path for parameter in finger.parameters()}
        return [
            SetParameter(path, finger.get(path), fitted.standard_error, fitted.identified)
            for fitted in self.estimator.numbers_
            for path in (fitted.number.path, fitted.number.with_path)
            if path in known
        ]

    def plot(self) -> Any:
        """Draw the torque with the model's prediction, on what was trained on, held out and compared, and the laws.

        Returns
        -------
        plotly.graph_objects.Figure
            The figures of `tendonfmu fit --figures` of these kinds.
        """
        from tendonfmu.drawing import sheets_figure
        from tendonfmu.report import law_sheets, torque_sheets

        picture = self.estimator.picture()
        return sheets_figure(repr(self)[1:-1], [*torque_sheets(picture), *law_sheets(picture)])

    def _repr_html_(self) -> str:
        return html_of(repr(self)[1:-1], fit_text.tables(self.estimator), fit_text.lines(self.estimator), self.warnings)


_TYPES: Mapping[str, Any] = {"start": float, "value": float, "standard_error": float, "identified": bool}


def fit(
    finger: FingerSource,
    recordings: RecordingSource | Sequence[RecordingSource],
    *,
    method: str = "batch",
    compare: RecordingSource | Sequence[RecordingSource] = (),
    holdout: float = 0.0,
    holdout_block: float = 10.0,
    kinematics: int = 1,
    routing: bool = False,
    only: str | Sequence[str] = (),
    fix: str | Sequence[str] = (),
    share: str | Sequence[str] = (),
    asymmetric: bool | None = None,
    prior: float | None = None,
    scale: str | Sequence[str] = (),
    previous: str | os.PathLike[str] | None = None,
    effective_samples: bool = True,
    passes: int | None = None,
    tolerance: float = 0.3,
    drift: float = 0.0,
    resume: str | os.PathLike[str] | None = None,
    progress: Callable[[Any], bool | None] | None = None,
) -> FitResult:
    """Estimate the numbers of a finger from recordings of free motion, with their uncertainty.

    Effects that the description lacks stay absent.

    Parameters
    ----------
    finger
        A finger, its description, or the file of it.
    recordings, compare
        Recordings, DataFrames or files: to train on, and to judge only. One alone needs no list.
    method
        "batch", maximum likelihood; or "ekf", the extended Kalman filter of the paper.
    holdout, holdout_block
        Share of the time that is not used in the fit, and longest block left out (s).
    kinematics
        1 tendon positions, 2 measured joint positions, 3 joint positions and velocities.
    routing
        Whether moment arms, stiffness and zeros are learned first, by the measured joint positions.
    only, fix, share
        Patterns of the numbers to estimate, to keep, and of the laws that share one set of values; `share` also takes
        "tendons" and "pulleys". A pattern is a path in which * stands for anything.
    asymmetric
        Whether the sides of every law are fitted apart (True), as one (False), or as the description has them (None).
    prior, scale
        By how much the given numbers are off / expected magnitude (None: learned from the data), and "PATTERN=VALUE":
        expected magnitudes in place of those of the description.
    previous
        Report or description of an earlier fit, as the prior (`--from`).
    effective_samples
        Whether correlated residuals count as fewer samples.
    passes, tolerance
        Most passes over the data (None: 60, "ekf" 2), and for "batch" the last step in standard errors.
    drift
        For "ekf": relative variance of the numbers per s.
    resume
        File of an interrupted fit to continue.
    progress
        Called with each `FitProgress`; returns False to stop.

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
    options = FitOptions.of(locals())
    estimator = FrictionFit(finger, progress=progress, **vars(options))
    try:
        estimator.fit(recordings, compare=compare)
    except KeyboardInterrupt:
        if estimator.unfinished_ is None:
            raise
        raise FitInterrupted(estimator.unfinished_) from None
    if not estimator.finished_:  # `progress` has stopped it
        raise FitInterrupted(estimator.unfinished_)
    return FitResult(estimator)
