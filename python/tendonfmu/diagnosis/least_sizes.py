"""What the smallest size of an effect is that the sensors can show; smaller effects are not reported as causes.

Play must be several times the noise of the positions. A delay must be more than half a sample.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tendonfmu.arrays import Data, Numbers
from tendonfmu.diagnosis.cause import Cause
from tendonfmu.diagnosis.effects import Candidate, Place, Term
from tendonfmu.diagnosis.hypotheses import LARGEST_SECANT
from tendonfmu.model import extended_row, moment_arms
from tendonfmu.recordings import FitRecording, zero_phase

OF_NOISE = 4.0  # standard deviations of the position noise
OF_SAMPLE = 0.75  # samples: velocities are late by half a sample
NEVER_NEGATIVE = ("preload_friction", "load_friction")  # all their places together
NOISE_CUTOFF = 15.0  # Hz: faster motion of the positions is noise
BEFORE_FIT = 0.5  # of the least size: only the fit shows how large an effect is


@dataclass(frozen=True)
class LeastSizes:
    """What limits the sensors."""

    joint_noise: Numbers  # standard deviation of the noise of the joint positions, rad [n]
    tendon_noise: Numbers  # standard deviation of the noise of the tendon positions, m [m]
    step: float  # time between samples, s

    def least(self, effect: str, joint: int | None, tendon: int | None) -> float:
        """Return the least size in the unit of the effect's number; 0 if none is known."""
        if effect == "time_delay":
            return OF_SAMPLE * self.step
        if effect == "backlash":
            if joint is not None:
                return OF_NOISE * float(self.joint_noise[joint - 1])
            if tendon is not None:
                return OF_NOISE * float(self.tendon_noise[tendon - 1])
        return 0.0

    def worth(self, candidate: Candidate, place: Place, shape: Mapping[str, float]) -> bool:
        """Return whether a step of this size can lead to a size that the sensors resolve."""
        least = self.least(candidate.name, place.joint, place.tendon)
        return least == 0.0 or LARGEST_SECANT * abs(float(next(iter(shape.values())))) >= least

    def shows(self, effect: str, place: Place, row: Mapping[str, Any] | None) -> bool:
        """Return whether a fitted play or delay, a row of `extensions`, is large enough."""
        number = {"backlash": "width", "time_delay": "delay"}.get(effect)
        if row is None or number is None:
            return True
        return bool(abs(row[number]) >= self.least(effect, place.joint, place.tendon))

    def resolved(self, cause: Cause, magnitudes: Sequence[float] | Numbers) -> bool:
        """Return whether a candidate with these magnitudes [d] is large enough."""
        least = self.least(*cause.key)
        return least == 0.0 or abs(float(magnitudes[0])) * cause.direction.step >= BEFORE_FIT * least

    def shows_all(self, effect: str, terms: Sequence[Term], data: Data) -> bool:
        """Return whether the sensors can show the sizes of a fitted effect; no friction is negative."""
        rows = [extended_row(data, effect, term.place) for term in terms]
        if effect in NEVER_NEGATIVE and sum(row["coulomb"] for row in rows if row) < 0.0:
            return False
        return all(self.shows(effect, term.place, extended_row(data, effect, term.place)) for term in terms)


def least_sizes(data: Mapping[str, Any], recordings: Sequence[FitRecording], step: float) -> LeastSizes:
    """Measure the sensor noise of recordings; `step` is the time between the samples that are estimated from, s."""
    joints: list[Numbers] = []
    tendons: list[Numbers] = []
    stiffness = np.array([tendon["stiffness"] for tendon in data["tendons"]])
    for recording in recordings:
        groups = recording.recording.groups
        angle, force = recording.model.joint_angle, groups["tendon_force"]
        reached = (
            groups["tendon_position"] - force / stiffness
            if "tendon_position" in groups
            else angle @ moment_arms(data).T
        )
        for part in recording.parts:
            rate = 1.0 / float(np.median(np.diff(recording.time[part])))
            for values, noise in ((angle[part], joints), (reached[part], tendons)):
                noise.append(noise_of(values, zero_phase(values, NOISE_CUTOFF, rate)))
    return LeastSizes(np.max(joints, axis=0), np.max(tendons, axis=0), step)


def noise_of(raw: Numbers, smooth: Numbers) -> Numbers:
    """Return the noise [d] of positions [N, d]: the spread of what smoothing removes, at least that of quantisation."""
    left = raw - smooth
    spread = 1.4826 * np.median(np.abs(left - np.median(left, axis=0)), axis=0)
    steps = np.abs(np.diff(raw, axis=0))
    quantum = np.array([float(column[column > 0].min(initial=np.inf)) for column in steps.T])
    return np.maximum(spread, np.where(np.isfinite(quantum) & (quantum > 1e-12), quantum / np.sqrt(12.0), 0.0))
