"""The data of a finished fit that its figures and its page show.

There is one `FitSeries` per recording: those trained on (role "training"; held-out blocks of time have `used` False),
and whole recordings that were held out or given to compare with (role "comparison", such as the motion at four times
the pretension).

Examples
--------
>>> picture = FitPicture(report, start=description.data, fitted=fitted_data, unknowns=estimator.unknowns, z=result.z,
...                      covariance=result.covariance, series=[...])
>>> write_fit_page(picture, Path("figures"))  # report/fit_page.py: PNG files and report.html
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from tendonfmu.arrays import Numbers

Role = Literal["training", "comparison"]


class FittedUnknown(Protocol):
    """The attributes of `estimation.Unknown` that are read here: one entry of z."""

    @property
    def path(self) -> str: ...
    @property
    def role(self) -> str: ...
    @property
    def parameters(self) -> tuple[int, ...]: ...


@dataclass(frozen=True)
class FitSeries:
    """One recording under the fitted model; all arrays have one row per sample, in SI units."""

    label: str  # name for people, such as "free motion" or the name of the file
    role: Role  # "training" or "comparison"
    mean_force: float  # mean of all tendon forces over all samples (N)
    time: Numbers  # [N] (s)
    torque: Numbers  # [N, n] torque that the model has to explain: τ, or τ − external_torque where that was used (N·m)
    # [N, n] τ − T_eff before the bias update (`Estimator.innovations(...)[0]`); NaN for the first sample (N·m)
    residual: Numbers
    model_torque: Numbers  # [N, n] T of eq
    joint_angle: Numbers  # [N, n] the kinematics in use (rad, rad/s)
    joint_speed: Numbers
    used: NDArray[np.bool_]  # [N] bool: trained on
    held_out: NDArray[np.bool_] | None = None  # [N] bool: held out of training and judged


@dataclass(frozen=True)
class FitPicture:
    """A finished fit: all that its figures and its page are made of."""

    # "tendonfmu-fit-1" as written by `--report`. If residual.train and residual.held_out have "start_rms" [n] beside
    # "rms" (the residual with the parameters of the start), it is shown
    report: Mapping[str, Any]
    start: Mapping[str, Any]  # descriptions as parsed JSON
    fitted: Mapping[str, Any]
    unknowns: Sequence[FittedUnknown]  # [p] unknowns of the estimation
    z: Numbers  # [p] their estimate
    covariance: Numbers  # [p, p] of z, prior included
    series: Sequence[FitSeries]  # recordings, training first, in the order given

    @property
    def joint_names(self) -> list[str]:
        """[n] names; `joint 2` where there is none."""
        return [joint.get("name") or f"joint {j}" for j, joint in enumerate(self.fitted["joints"], start=1)]

    @property
    def tendon_names(self) -> list[str]:
        """[m] names; `tendon 2` where there is none."""
        return [tendon.get("name") or f"tendon {i}" for i, tendon in enumerate(self.fitted["tendons"], start=1)]
