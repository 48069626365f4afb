"""The rule for failing sensors, learned from free motion (docs/reference/semantics/sensors.md).

The resolutions are those of the sensors. The margin of a sensor that stands is twice the largest difference between a
force and its spring within a tenth of a second of free motion, due to springs and cords that differ from their
description. The margin of a jump is that or less: five times the largest difference within a sample, due to noise and
sampling. A force may stand for twice as long as it ever did. The finger as it runs must find no fault.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from tendonfmu.arrays import Data, Flags, Numbers
from tendonfmu.detect.free_motion import FreePart, runs_of
from tendonfmu.model import DEFAULTS, finger_of
from tendonfmu.options import KinematicsSource

# s, and a number of samples for slow rates. Shorter than the default of sensor_fault.hold_time: the check on free
# motion shows that channels that are read at different times raise no fault.
HOLD_TIME, HOLD_SAMPLES = 0.02, 5
RECOVERY_TIME = DEFAULTS["sensor_fault.recovery_time"]  # s
WINDOW = 0.1  # s in which a spring is compared with its force: a sound force changes within it in motion
PUSHED = 5.0  # times the largest jump in free motion: a push moves tendons faster
AMPLE = 2.0  # times the largest observed difference and the longest stand: later ones may be larger
LONGEST_STAND = 1.0  # s; a force that stands for half as long has no noise, and stands at rest
TAUT = 1.0  # N; below, a tendon may be slack, and the others do not give its length
WIDEST = 0.25  # of the mean tendon force; a wider margin would hide faults
LEAST_FREEDOM = 0.1  # as in the runtime: least 1 − leverage of a tendon whose length the others give
WHITE = 1.5  # least third over second difference of noise; white noise has 1.83, motion much less
NOISE_SHARE = 0.5  # of the noise of a sample: a smaller change counts as none
ROUNDING = 1e-9  # of the largest value: smaller steps are rounding errors
RAISE = 1.5  # factor on the margin until no fault is found


@dataclass(frozen=True)
class SensorRule:
    """The rule for failing sensors."""

    keys: Mapping[str, float] | None
    largest: float
    why: str


def learn_sensors(data: Data, parts: Sequence[FreePart]) -> SensorRule:
    """Learn the rule for which the finger as it runs finds no fault in any part."""
    if not all("tendon_position" in part.arrays for part in parts):
        return SensorRule(None, np.nan, "there are no tendon positions")
    gaps = [gap for part in parts for gap in _gaps(data, part)]
    if not any(each.known.any() for each in gaps):
        return SensorRule(None, np.nan, "no tendon's length follows from the others")
    jump = max(each.jump() for each in gaps)
    largest = max(jump, *(each.span() for each in gaps))
    step = max(float(np.median(np.diff(part.time))) for part in parts)
    keys = {
        "hold_time": round(max(HOLD_TIME, HOLD_SAMPLES * step), 6),
        "force_resolution": _resolution([part.arrays["tendon_force"] for part in parts]),
        "position_resolution": _resolution([part.arrays["tendon_position"] for part in parts]),
        "jump_margin": float(f"{max(min(PUSHED * jump, AMPLE * largest), 1e-6):.3g}"),
        "spring_margin": float(f"{max(AMPLE * largest, 1e-6):.3g}"),
        "recovery_time": RECOVERY_TIME,
    }
    stand = max(_longest_stand(part, keys["force_resolution"]) for part in parts)
    if AMPLE * stand < LONGEST_STAND and all(_is_noisy(part.arrays["tendon_force"]) for part in parts):
        keys["longest_stand"] = float(f"{max(AMPLE * stand, keys['hold_time']):.3g}")
    widest = WIDEST * float(np.mean(np.concatenate([part.mean_force for part in parts])))
    while keys["spring_margin"] <= widest:
        if not finds_a_fault(data, parts, keys):
            return SensorRule(keys, largest, "")
        for name in ("jump_margin", "spring_margin"):
            keys[name] = float(f"{RAISE * keys[name]:.3g}")
    why = f"a sensor seems to fail in free motion, by more than {widest:.2g} N"
    if AMPLE * largest > widest:
        why = (
            f"forces differ from those of their springs by up to {largest:.2g} N in free motion; expected at most "
            f"{widest / AMPLE:.2g} N if springs and moment arms are as described"
        )
    return SensorRule(None, largest, why)


def finds_a_fault(data: Data, parts: Sequence[FreePart], keys: Mapping[str, float]) -> bool:
    """Tell whether the finger with these keys finds a fault in counted time."""
    runs = runs_of(finger_of({**data, "sensor_fault": dict(keys)}), parts)
    return any(outputs["sensor_fault"][part.counted].any() for part, outputs in runs)


@dataclass(frozen=True)
class Gap:
    """Difference between force and spring of one tendon in one part."""

    force: Numbers
    gap: Numbers
    stretched: Numbers
    known: Flags
    window: int

    def jump(self) -> float:
        """Return the largest change of the force within a sample beyond that of its spring (N)."""
        both = self.known[1:] & self.known[:-1]
        beyond = np.abs(np.diff(self.force)) - self.stretched
        return float(beyond[both].max(initial=0.0))

    def span(self) -> float:
        """Return the largest difference between force and spring within a window (N)."""
        whole = len(self.gap) // self.window * self.window
        inside = self.gap[:whole].reshape(-1, self.window)
        known = self.known[:whole].reshape(-1, self.window)
        low = np.where(known, inside, np.inf).min(axis=1)
        high = np.where(known, inside, -np.inf).max(axis=1)
        return float((high - low)[known.any(axis=1)].max(initial=0.0))


def _gaps(data: Data, part: FreePart) -> Iterator[Gap]:
    R = np.array([tendon["moment_arms"] for tendon in data["tendons"]], dtype=np.float64)
    k = np.array([tendon["stiffness"] for tendon in data["tendons"]], dtype=np.float64)
    loops = np.array([bool(tendon.get("bidirectional")) for tendon in data["tendons"]])
    force, position = part.arrays["tendon_force"], part.arrays["tendon_position"]
    taut = (force > TAUT) | loops
    is_measured = part.kinematics != KinematicsSource.TENDON_POSITIONS
    angle = part.arrays.get("joint_position") if is_measured else None
    w, is_known = _joint_side(R, position - force / k, angle)
    window = max(1, min(len(force), int(np.searchsorted(part.time, part.time[0] + WINDOW))))
    for i in np.flatnonzero(is_known):
        others = np.arange(len(k)) != i
        known = np.ones(len(force), dtype=bool) if is_measured else taut[:, others].all(axis=1)
        stretched = k[i] * (np.abs(np.diff(position[:, i])) + np.abs(np.diff(w[:, i])))
        gap = k[i] * (position[:, i] - w[:, i]) - force[:, i]
        yield Gap(force[:, i], gap, stretched, known & taut[:, i] & part.counted, window)


def _joint_side(R: Numbers, spring_end: Numbers, angle: Numbers | None) -> tuple[Numbers, Flags]:
    """Return [N, m] R q of each tendon (m), from the others or the measured angles, and [m] whether it is known."""
    if angle is not None:
        return angle @ R.T, np.ones(len(R), dtype=bool)
    inverse = np.linalg.pinv(R)
    leverage = np.einsum("ij,ji->i", R, inverse)
    is_known = 1.0 - leverage >= LEAST_FREEDOM
    all_together = spring_end @ inverse.T @ R.T
    ratio = np.where(is_known, leverage / np.where(is_known, 1.0 - leverage, 1.0), 0.0)
    return np.asarray(all_together - ratio * (spring_end - all_together)), np.asarray(is_known)


def _longest_stand(part: FreePart, resolution: float) -> float:
    """Return the longest time for which a force keeps within the resolution (s)."""
    longest = 0.0
    for force in part.arrays["tendon_force"].T.tolist():
        held, since = force[0], 0
        for k, value in enumerate(force):
            if abs(value - held) > resolution:
                held, since = value, k
            elif part.time[k] - part.time[since] > longest:
                longest = float(part.time[k] - part.time[since])
    return longest


def _is_noisy(values: Numbers) -> bool:
    """Tell whether every tendon's force moves at rest, too: by white noise larger than the steps it is read in."""
    if len(values) < 4:
        return False
    step = np.abs(np.diff(values, axis=0))
    bend, turn = (np.median(np.abs(np.diff(values, order, axis=0)), axis=0) for order in (2, 3))
    smallest = float(step[step > ROUNDING * np.abs(values).max()].min(initial=np.inf))
    noise = bend / (0.6745 * np.sqrt(6.0))
    return bool((turn >= WHITE * bend).all() and (NOISE_SHARE * noise >= smallest).all())


def _resolution(arrays: Sequence[Numbers]) -> float:
    """Return the smallest step of a sensor, or a share of its noise if that is larger, in its unit."""
    smallest, noise = np.inf, np.inf
    for values in arrays:
        step = np.abs(np.diff(values, axis=0))
        smallest = min(smallest, float(step[step > ROUNDING * np.abs(values).max()].min(initial=np.inf)))
        if len(values) > 2:
            bend = np.abs(values[2:] - 2.0 * values[1:-1] + values[:-2])
            # 0.6745 σ is the median of |x|; three independent samples with weights 1, −2, 1
            noise = min(noise, float(np.median(bend, axis=0).min() / (0.6745 * np.sqrt(6.0))))
    resolution = max(smallest if np.isfinite(smallest) else 0.0, NOISE_SHARE * noise if np.isfinite(noise) else 0.0)
    return float(f"{resolution:.3g}")
