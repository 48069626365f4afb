"""What a finished fit hands over to be drawn: report, both descriptions, covariance, and the series of recordings.

    picture = FitPicture(report, start=description.data, fitted=fitted_data, unknowns=estimator.unknowns, z=result.z,
                         covariance=result.covariance, series=[...])
    write_fit_page(picture, Path("figures"))        # report/fit_page.py: PNG files and report.html

One `FitSeries` per recording: those that were trained on (role "training"; held-out blocks of time have `used` False),
whole recordings that were held out or given to compare with (role "comparison", such as the motion at four times the
pretension).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

Numbers = NDArray[np.float64]
Role = Literal["training", "comparison"]


class FittedUnknown(Protocol):
    """What is read of `estimation.Unknown`: one entry of z.

    path: of its first parameter. role: "coulomb", "drop" (static − coulomb), "rate" (1/stribeck_velocity), "viscous",
    "static" (static and coulomb move together) or "value". parameters: indices of the parameters that it moves, in the
    order of `native.Finger.parameters()`.
    """

    @property
    def path(self) -> str: ...
    @property
    def role(self) -> str: ...
    @property
    def parameters(self) -> tuple[int, ...]: ...


@dataclass(frozen=True)
class FitSeries:
    """One recording under the fitted model; all arrays have one row per sample, SI units.

    label: for people, such as "free motion" or the file's name. mean_force: N, of all tendons over all samples.
    time: [N] s. torque: [N, n] N·m, what the model has to explain: τ, or τ − external_torque where that was used.
    residual: [N, n] N·m before the bias update, τ − T_eff (`Estimator.innovations(...)[0]`); NaN for the first sample.
    model_torque: [N, n] N·m, T of eq. (10) without the bias (`friction_torque` − `bias_torque` of `native.Finger.run`).
    joint_angle, joint_speed: [N, n] rad, rad/s, the kinematics in use.
    used: [N] bool: trained on. Contact left out, or held out: False. All False in a comparison.
    held_out: [N] bool: held out of training and judged, None where nothing was.
    """

    label: str
    role: Role
    mean_force: float
    time: Numbers
    torque: Numbers
    residual: Numbers
    model_torque: Numbers
    joint_angle: Numbers
    joint_speed: Numbers
    used: NDArray[np.bool_]
    held_out: NDArray[np.bool_] | None = None


@dataclass(frozen=True)
class FitPicture:
    """A finished fit, all that its figures and its page are made of.

    report: "tendonfmu-fit-1" as written by `--report`; a "start_rms" [n] beside "rms" in residual.train and
        residual.held_out (the residual with the start's parameters) is shown where it is there.
    start, fitted: descriptions as parsed JSON. unknowns, z: [p], covariance: [p, p] of z, prior included.
    series: training first, in the order given.
    """

    report: Mapping[str, Any]
    start: Mapping[str, Any]
    fitted: Mapping[str, Any]
    unknowns: Sequence[FittedUnknown]
    z: Numbers
    covariance: Numbers
    series: Sequence[FitSeries]

    @property
    def joint_names(self) -> list[str]:
        """[n] names, `joint 2` where there is none."""
        return [joint.get("name") or f"joint {j}" for j, joint in enumerate(self.fitted["joints"], start=1)]

    @property
    def tendon_names(self) -> list[str]:
        """[m] names, `tendon 2` where there is none."""
        return [tendon.get("name") or f"tendon {i}" for i, tendon in enumerate(self.fitted["tendons"], start=1)]
