"""The data of a finished fit that its figures and its page show, and the friction laws with their confidence bands.

There is one `FitSeries` per recording: those trained on (role "training"; held-out blocks of time have `used` False),
and whole recordings that were held out or given to compare with (role "comparison", such as the motion at four times
the pretension).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from tendonfmu.arrays import Numbers
from tendonfmu.estimate.estimation import Unknown
from tendonfmu.model import Effect, Finger, Instance, Law

Role = Literal["training", "comparison"]
CONFIDENCE = 1.96  # standard errors: 95 %
_LAST = {"coulomb": "coulomb", "drop": "static", "rate": "stribeck_velocity", "viscous": "viscous", "static": "coulomb"}


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
    model_torque: Numbers  # [N, n] T of eq. (10) (N·m)
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
    start: Finger
    fitted: Finger
    unknowns: Sequence[Unknown]  # [p] unknowns of the estimation
    z: Numbers  # [p] their estimate
    covariance: Numbers  # [p, p] of z, prior included
    series: Sequence[FitSeries]  # recordings, training first, in the order given


# --- laws with their confidence bands ---------------------------------------------------------------------------------
#
# A curve runs over velocity, or over the angle where a law has working points. The band is 1.96 standard errors of the
# curve, by the delta method in the unknowns of the fit (coulomb, drop = static − coulomb, rate = 1/stribeck_velocity,
# viscous). The curve is exactly linear in all but the rate. The band is cut off at 0, since friction is not negative.


@dataclass(frozen=True)
class LawCurve:
    """Friction of one side of a law, with its confidence band."""

    fitted: Numbers  # [N] friction with the fitted numbers, in the unit of the law
    low: Numbers  # [N] ends of the band
    high: Numbers
    start: Numbers  # [N] friction with the numbers of the start


def side_of(law: Law, sign: int) -> Law:
    """Return the side of a law for a direction of sliding, +1 or −1."""
    if law.get("positive") is None:
        return law
    side: Law = law["positive" if sign > 0 else "negative"]
    return side


def side_path(path: str, law: Law, sign: int) -> str:
    """Return the path of that side: the law's own path if it is symmetric."""
    if law.get("positive") is None:
        return path
    return f"{path}.{'positive' if sign > 0 else 'negative'}"


def magnitude(side: Law, speed: Numbers) -> Numbers:
    """Compute |F| at the speeds |v| by eq. (1)."""
    drop = float(side["static"]) - float(side["coulomb"])
    viscous = float(side.get("viscous") or 0.0)
    return np.asarray(side["coulomb"] + drop * np.exp(-speed / side["stribeck_velocity"]) + viscous * speed)


def slopes(side: Law, speed: Numbers) -> Mapping[str, Numbers]:
    """Compute the derivatives [N] of |F| by the unknowns, by role."""
    drop, decay = float(side["static"]) - float(side["coulomb"]), np.exp(-speed / side["stribeck_velocity"])
    one = np.ones_like(speed)
    return {"coulomb": one, "static": one, "drop": decay, "rate": -drop * speed * decay, "viscous": speed}


class LawBands:
    """Curves of the laws of a fit, with their confidence bands."""

    def __init__(self, picture: FitPicture) -> None:
        parameters = Instance(picture.fitted.image).parameters()
        paths = [parameter.path for parameter in parameters]
        self._covariance = np.asarray(picture.covariance)
        self._column = {
            (paths[k], unknown.role): column
            for column, unknown in enumerate(picture.unknowns)
            for k in unknown.parameters
        }

    def over_speed(self, start: Effect, fitted: Effect, sign: int, speed: Numbers) -> LawCurve:
        """Compute the curve of an effect with a single law over speed."""
        # speed: [N]; returns [N] each
        weights = np.ones((len(speed), 1))
        return self._curve(start, fitted, sign, speed, weights)

    def over_angle(self, start: Effect, fitted: Effect, sign: int, speed: float, angle: Numbers) -> LawCurve:
        """Compute the curve of an effect with working points over the angle, at one speed."""
        # angle: [N] (rad); returns [N] each
        unit = np.eye(len(fitted.angles))
        weights = np.column_stack([np.interp(angle, fitted.angles, row) for row in unit])
        return self._curve(start, fitted, sign, np.full_like(angle, speed), weights)

    def _curve(self, start: Effect, fitted: Effect, sign: int, speed: Numbers, weights: Numbers) -> LawCurve:
        value = _mixed(fitted, sign, speed, weights)
        error = self._standard_error(fitted, sign, speed, weights)
        low, high = value - CONFIDENCE * error, value + CONFIDENCE * error
        return LawCurve(value, np.maximum(low, 0.0), high, _mixed(start, sign, speed, weights))

    def _standard_error(self, effect: Effect, sign: int, speed: Numbers, weights: Numbers) -> Numbers:
        gradients: dict[int, Numbers] = {}  # column of z -> [N]; the slopes of laws that share a value add up
        for share, law, path in zip(weights.T, effect.laws, effect.law_paths, strict=True):
            prefix = side_path(path, law, sign)
            for role, slope in slopes(side_of(law, sign), speed).items():
                column = self._column.get((f"{prefix}.{_LAST[role]}", role))
                if column is not None:
                    gradients[column] = gradients.get(column, np.zeros_like(speed)) + share * slope
        if not gradients:
            return np.zeros_like(speed)
        columns = np.array(list(gradients))
        slope = np.column_stack(list(gradients.values()))
        variance = np.einsum("ki,ij,kj->k", slope, self._covariance[np.ix_(columns, columns)], slope)
        return np.asarray(np.sqrt(np.maximum(variance, 0.0)))


def _mixed(effect: Effect, sign: int, speed: Numbers, weights: Numbers) -> Numbers:
    values = [magnitude(side_of(law, sign), speed) for law in effect.laws]
    return np.asarray(np.sum(weights * np.column_stack(values), axis=1))


def asymmetric(effect: Effect) -> bool:
    """Tell whether any law of an effect has two sides."""
    return any(law.get("positive") is not None for law in effect.laws)


def numbers_of(effect: Effect, report: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """Return the entries of the report for the estimated numbers of an effect."""
    return [entry for entry in report["parameters"] if entry["path"].startswith(f"{effect.path}.")]
