"""What torque of a recording a finger leaves unexplained, and how random it is.

All of it comes from runs of the C core without contact detection, whose bias learns from the samples that it may.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtrc, gammaincinv

from tendonfmu.arrays import Data, Flags, Numbers
from tendonfmu.model import Finger, extension_rows, moment_arms, native, without_detection
from tendonfmu.recordings.columns import Nis, Whiteness
from tendonfmu.recordings.recording import Recording

LAGS = 20  # of the Ljung-Box test
CONFIDENCE = 0.95


@dataclass(frozen=True)
class Model:
    """What a finger makes of a recording; NaN (False) outside the parts."""

    torque: Numbers  # T of eq. (10), less the torque of forces used beyond the measured ones [N, n] (N·m)
    joint_angle: Numbers  # angles (rad) and speeds (rad/s) as used [N, n]
    joint_speed: Numbers
    slack: Flags  # slack tendons [N, m]
    residual: Numbers  # r before the bias update [N, n] (N·m); NaN up to the sample that the bias begins with
    variance: Numbers  # S of the residual [N, n] ((N·m)²), NaN likewise

    @property
    def standardised(self) -> Numbers:
        """Standardised residuals r/√S [N, n]."""
        return np.asarray(self.residual / np.sqrt(self.variance))


def run_parts(
    finger: Finger, arrays: Mapping[str, Numbers], parts: Sequence[slice], learns: Flags, source: int
) -> Model:
    """Run a finger over the parts of a recording, less its known torque; the bias learns from some samples [N]."""
    running = finger.model.instance(source)
    start = running.save_state()
    torque, angle, speed, residual, variance = (np.full((len(learns), finger.joints), np.nan) for _ in range(5))
    slack = np.zeros((len(learns), finger.tendons), dtype=bool)
    for part in parts:
        given = {name: values[part] for name, values in arrays.items()}
        known = given.get("external_torque")
        running.restore_state(start)
        outputs = running.run_guided(given, learns[part], known)
        measured = outputs["joint_torque"] if known is None else outputs["joint_torque"] + known
        torque[part] = outputs["friction_torque"] - outputs["bias_torque"]
        torque[part] -= delayed_torque(finger.data, given, measured)
        angle[part], speed[part], slack[part] = outputs["joint_angle"], outputs["joint_speed"], outputs["slack"]
        variance[part] = outputs["residual_variance"]
        residual[part] = np.where(np.isnan(variance[part]), np.nan, outputs["residual"])
    return Model(torque, angle, speed, slack, residual, variance)


def delayed_torque(data: Data, arrays: Mapping[str, Numbers], torque: Numbers) -> Numbers | float:
    """Return τ of the forces in use less τ of the measured forces."""
    # torque: [N, n] (N·m); returns [N, n] (N·m). 0 unless a `time_delay` below 0 delays the forces
    rows = data.get("extensions") or []
    if not any(row["effect"] == "time_delay" and row["delay"] < 0 for row in rows):
        return 0.0
    return np.asarray(torque - arrays["tendon_force"] @ moment_arms(data))


# --- what is random in them -------------------------------------------------------------------------------------------


def rms(values: Numbers, chosen: Flags) -> list[float]:
    """Return the root mean square of the chosen rows, but for NaN. values: [N, n]; chosen: [N]; returns [n]."""
    columns = [column[~np.isnan(column)] for column in values[chosen].T]
    return [float(np.sqrt(np.mean(column**2))) if len(column) else math.nan for column in columns]


def consistency(standardised: Sequence[Numbers], share: float = 1.0) -> Nis:
    """Return the NIS, the mean of the squared standardised innovations, and its chi-square interval."""
    # standardised: [N, n]; returns [low, high]
    values = np.concatenate([part[~np.isnan(part)] for part in standardised])
    if not len(values):
        return {"mean": math.nan, "interval": [math.nan, math.nan], "consistent": False}
    mean = float(np.mean(values**2))
    half = max(share * len(values), 1.0) / 2  # of the degrees of freedom
    low, high = (float(gammaincinv(half, p)) / half for p in ((1 - CONFIDENCE) / 2, (1 + CONFIDENCE) / 2))
    return {"mean": mean, "interval": [low, high], "consistent": bool(low <= mean <= high)}


def whiteness(standardised: Sequence[Numbers]) -> Whiteness:
    """Return how far the standardised residuals of each joint are from white noise."""
    # standardised: [N, n]; returns [n] [n]
    joints = standardised[0].shape[1]
    found: Whiteness = {"lag_one": [], "ljung_box_p": []}
    for j in range(joints):
        series = [part[:, j] for part in standardised]
        power = sum(float(np.nansum(part**2)) for part in series)
        count = sum(int(np.sum(~np.isnan(part))) for part in series)
        if count <= LAGS + 1 or not power:
            found["lag_one"].append(math.nan)
            found["ljung_box_p"].append(math.nan)
            continue
        correlations = [_lagged(series, lag) / power for lag in range(1, LAGS + 1)]
        statistic = count * (count + 2) * sum(r * r / (count - lag) for lag, r in enumerate(correlations, start=1))
        found["lag_one"].append(correlations[0])
        found["ljung_box_p"].append(float(chdtrc(LAGS, statistic)))
    return found


def _lagged(series: Sequence[Numbers], lag: int) -> float:
    return sum(float(np.nansum(part[lag:] * part[:-lag])) for part in series if len(part) > lag)


# --- what springs and drives bend -------------------------------------------------------------------------------------

BENDING = ("backlash", "tendon_nonlinearity")


def with_linear_springs(finger: Finger, recording: Recording) -> Recording:
    """Return what tendons without play, on linear springs of the described stiffness, would have recorded.

    x0 = zero + R q + f0/k holds for it where the described `backlash` and `tendon_nonlinearity` are right.
    """
    rows = [row for row in extension_rows(finger.data) if row["effect"] in BENDING and row.get("tendon")]
    if not rows:
        return recording
    position, force = recording.groups["tendon_position"].copy(), recording.groups["tendon_force"]
    for i in sorted({row["tendon"] - 1 for row in rows}):
        own, stiffness = [i], finger.data["tendons"][i]["stiffness"]
        # by the core's own law: a joint that this tendon alone turns, with an arm of 1 m, is at x0 less the stretch
        alone = {
            "format": finger.data["format"],
            "name": "spring",
            "joints": [{}],
            "tendons": [{"stiffness": stiffness, "moment_arms": [1.0], "bidirectional": True}],
            "extensions": [{**row, "tendon": 1} for row in rows if row["tendon"] == i + 1],
        }
        given = {"time": recording.time, "tendon_force": force[:, own], "tendon_position": position[:, own]}
        outputs = native.run_recording(without_detection(alone), given)
        position[:, i] = outputs["joint_angle"][:, 0] + force[:, i] / stiffness
    return replace(recording, groups={**recording.groups, "tendon_position": np.asarray(position)})
