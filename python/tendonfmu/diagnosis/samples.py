"""What runs of the core are compared with: block means of the torque, at measured forces or at those a model predicts.

Nothing slow is taken out but one constant a joint and stretch, or the slowest drift that rests demand. A learning bias,
or splines, would follow a weight, a cover and any other torque that is slow, too.

Columns and fits use the forces that the model itself predicts. The joint torque to be explained is computed from the
measured forces, and so is every column that contains a force. So the part of the torque that no model explains is in
both, and a column that carries it would fit the noise and appear as a cause of every recording. Predicted are the
measured forces less the unexplained torque, which is spread over the tendons as the smallest forces that produce it
(errors in variables; instrument).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tendonfmu.arrays import Array, Data, Flags, Numbers
from tendonfmu.estimate import CoreRuns, SlowDrift, slowest_drift
from tendonfmu.model import extension_rows, finger_of, moment_arms, number_of
from tendonfmu.recordings import FitRecording, Grid, Segment, delayed_torque
from tendonfmu.statistics import BlockSeries, Splines

# --- signals of recordings --------------------------------------------------------------------------------------------
# G_k = T_k + Σ Δb up to k is a model's torque with all jumps of fig. 5. A diagnosis looks only at what it leaves, y −
# G.


@dataclass(frozen=True)
class Series(BlockSeries):
    """Block means of all recordings, one after another; n joints, m tendons."""

    angle: Numbers  # rad [B, n]
    velocity: Numbers  # rad/s [B, n]
    acceleration: Numbers  # rad/s² [B, n]
    force: Numbers  # N [B, m]
    tendon_velocity: Numbers  # ẋ_ij, m/s [B, m, n]
    travel: Numbers  # travel since the joint last reversed, rad [B, n]
    position: Numbers  # R q + f/k of the tendons, m [B, m]


def exact_model(data: Mapping[str, Any], recording: FitRecording, *, jumps: bool = True) -> Numbers:
    """Return G of a description from a run of the core, N·m [N, n]; NaN outside of the parts."""
    steady, residual = finger_of(data).steady, np.full(recording.target.shape, np.nan)
    for part in recording.parts:
        arrays = recording.arrays(part)
        outputs = steady.instance(recording.kinematics).run(arrays)
        residual[part] = outputs["friction_torque"] - delayed_torque(data, arrays, outputs["joint_torque"])
        if not jumps:
            residual[part] -= outputs["bias_torque"]
    return residual


# --- the series -------------------------------------------------------------------------------------------------------


def make_series(
    data: Mapping[str, Any], recordings: Sequence[FitRecording], grid: Grid, left: Numbers, used: Flags
) -> Series:
    """Average the signals over the blocks of a grid; `left` is what a description leaves of the torque [B, n], N·m."""
    threshold, segments = number_of(data, "velocity_threshold.joint"), grid.segments
    angles, speeds = ([getattr(each.model, name) for each in recordings] for name in ("joint_angle", "joint_speed"))
    velocity, angle, force = grid.means(speeds), grid.means(angles), grid.forces(recordings)
    arms, stiffness = moment_arms(data), np.array([tendon["stiffness"] for tendon in data["tendons"]])
    travels = [_travel(angles[one.recording], speeds[one.recording], threshold, one) for one in segments]
    return Series(
        time=grid.means([recording.time for recording in recordings]),
        recording=np.concatenate([np.full(segment.count, segment.recording) for segment in segments]),
        segment=np.concatenate([np.full(segment.count, k) for k, segment in enumerate(segments)]),
        target=left,
        used=used,
        step=grid.step,
        angle=angle,
        velocity=velocity,
        acceleration=np.concatenate([_slope(velocity[segment.blocks], grid.step) for segment in segments]),
        force=force,
        tendon_velocity=_tendon_velocity(arms, velocity),
        travel=np.concatenate(travels),
        position=angle @ arms.T + force / stiffness,
    )


def _slope(values: Numbers, step: float) -> Numbers:
    return np.gradient(values, step, axis=0) if len(values) > 1 else np.zeros_like(values)


def _tendon_velocity(arms: Numbers, velocity: Numbers) -> Numbers:
    """Return ẋ_ij = Σ_{j'≥j} r_ij' q̇_j' (eq. 5), m/s [B, m, n], for moment arms [m, n]."""
    products = velocity[:, None, :] * arms[None]
    return np.asarray(np.cumsum(products[:, :, ::-1], axis=2)[:, :, ::-1])


def _travel(angle: Numbers, speed: Numbers, threshold: float, segment: Segment) -> Numbers:
    """Return the travel since each joint last reversed, rad [count, n]; speeds below the threshold do not count."""
    angle, speed = angle[segment.part], speed[segment.part]
    travel = np.empty_like(angle)
    for j in range(angle.shape[1]):
        moving = np.abs(speed[:, j]) > threshold
        last = np.maximum.accumulate(np.where(moving, np.arange(len(angle)), 0))
        side = np.sign(speed[last, j])
        turned = np.flatnonzero(np.diff(side, prepend=side[0]))
        start = np.zeros(len(angle), dtype=np.int64)
        start[turned] = turned
        travel[:, j] = np.abs(angle[:, j] - angle[np.maximum.accumulate(start), j])
    return segment.mean(travel)


RATE = 160.0  # Hz, of the runs, at least: elements take any step, and friction changes in tens of milliseconds
MOST_SHIFT = 10.0  # times the largest measured force


@dataclass(frozen=True)
class Samples:
    """Recordings and what their torque is compared at."""

    recordings: Sequence[FitRecording]  # with the forces of the runs
    runs: CoreRuns
    drift: SlowDrift  # what is not compared
    threads: int

    @classmethod
    def of(cls, data: Data, recordings: Sequence[FitRecording], threads: int = 1) -> Samples:
        """Prepare recordings as they were measured."""
        runs = CoreRuns(finger_of(data), recordings, rate=RATE, threads=threads)
        return cls(recordings, runs, SlowDrift(runs.time, runs.stretch, runs.used), threads)

    @property
    def grid(self) -> Grid:
        return self.runs.grid

    @property
    def used(self) -> Flags:
        """Blocks that are learned from [B]."""
        return self.drift.used

    @property
    def splines(self) -> Splines:
        """Columns of what is not compared [B, s]."""
        return self.drift.basis

    def without(self, out: Flags) -> Samples:
        """Return the samples without some blocks [B]."""
        runs, drift = self.runs, self.drift
        return replace(self, drift=SlowDrift(runs.time, runs.stretch, drift.used & ~out, drift.knots))

    def as_rests_demand(self, data: Data) -> Samples:
        """Return the samples with the slowest drift that a description's residual demands."""
        runs = self.runs
        return replace(self, drift=slowest_drift(self.left(data), runs.time, runs.stretch, self.used, runs.still))

    def left(self, data: Data, values: Mapping[str, float] | None = None) -> Numbers:
        """Return the torque that a description leaves, with some other numbers by path, N·m [B, n]."""
        return self.runs.of(finger_of(data)).residual(values)

    def residual(self, data: Data) -> Numbers:
        """Return the same without its drift [B, n], N·m; 0 at blocks that are not used."""
        left = self.left(data)
        free = np.zeros_like(left)
        free[self.used] = self.drift.without(left)
        return free

    def series(self, data: Data) -> Series:
        """Return the block means of a description's signals and of what it leaves."""
        return make_series(data, self.recordings, self.grid, self.left(data), self.used)

    def of_recordings(self, data: Data, recordings: Sequence[FitRecording]) -> Samples:
        """Return the samples with the forces of other recordings of the same times; the measured torque stays."""
        runs = CoreRuns(finger_of(data), recordings, self.grid, rate=RATE, threads=self.threads)
        runs.added = self.runs.added
        return replace(self, recordings=recordings, runs=runs)

    def at_predicted_forces(self, data: Data) -> Samples:
        """Return the samples with the forces that a description predicts."""
        predicted, arms = predicted_forces(data, self.recordings), corrected_arms(data)
        both = zip(self.recordings, predicted, strict=True)
        forces = [one.recording.groups["tendon_force"] - other.recording.groups["tendon_force"] for one, other in both]
        samples = self.of_recordings(data, predicted)
        samples.runs.added = self.runs.added + self.grid.means([force @ arms for force in forces])
        return samples


# --- sensors that a description corrects ---------------------------------------------------------------------------


def corrected_arms(data: Data) -> Numbers:
    """Return the moment arms with the corrections of a description's forces and arms, [m, n] (m)."""
    arms = moment_arms(data)
    corrected: Numbers = arms.copy()
    for row in extension_rows(data):
        tendon = slice(None) if row.get("tendon") is None else row["tendon"] - 1
        if row["effect"] == "force_gain":
            corrected[tendon] += row["correction"] * arms[tendon]
        elif row["effect"] == "moment_arm":
            corrected[tendon, row["joint"] - 1] += row["correction"]
    return corrected


def as_described(torque: Array, data: Data) -> Array:
    """Return a torque that is left [B, n], or columns of it [B, n, c], at the moment arms without corrections.

    Corrections that shrink the torque shrink what any model leaves. The forces that are off by it stay the same.
    """
    arms, corrected = moment_arms(data), corrected_arms(data)
    if (corrected == arms).all():
        return torque
    turn = (np.linalg.pinv(corrected) @ arms).astype(torque.dtype)
    return np.asarray(torque @ turn if torque.ndim == 2 else turn.T @ torque)


# --- forces that a model predicts ------------------------------------------------------------------------------------


def predicted_forces(data: Mapping[str, Any], recordings: Sequence[FitRecording]) -> list[FitRecording]:
    """Return the recordings with predicted forces, and with tendon positions that keep the joint angles as measured."""
    spread = np.linalg.pinv(corrected_arms(data))
    stiffness = np.array([tendon["stiffness"] for tendon in data["tendons"]])
    pulls = np.array([not tendon.get("bidirectional") for tendon in data["tendons"]])
    moved = []
    for recording in recordings:
        groups = recording.recording.groups
        force = groups["tendon_force"]
        most = MOST_SHIFT * np.abs(force).max(initial=0.0)  # a model that explains nothing predicts no forces either
        shift = np.clip(_unexplained(data, recording) @ spread, -most, most)
        predicted = np.where(pulls & (force > 0), np.maximum(force - shift, 0.0), force - shift)
        changed = {"tendon_force": predicted}
        if "tendon_position" in groups:
            # a description with a delay pairs the present position with the force `delay` s later
            delay = float(sum(row["delay"] for row in extension_rows(data) if row["effect"] == "time_delay"))
            change = shifted(recording, (predicted - force) / stiffness, delay)
            changed["tendon_position"] = groups["tendon_position"] + change
        moved.append(recording.with_groups(**changed))
    return moved


def shifted(recording: FitRecording, values: Numbers, delay: float) -> Numbers:
    """Return the values [N, m] of `delay` s later, within each part."""
    if not delay:
        return values
    later: Numbers = values.copy()
    for part in recording.parts:
        time = recording.time[part]
        for i in range(values.shape[1]):
            later[part, i] = np.interp(time + delay, time, values[part, i])
    return later


def _unexplained(data: Mapping[str, Any], recording: FitRecording) -> Numbers:
    """Return the unexplained torque at every sample [N, n], N·m; 0 at samples that are not trained on."""
    left = recording.target - exact_model(data, recording)
    unexplained = np.zeros_like(left)
    for part in recording.parts:
        own = recording.train[part]
        if own.any():
            unexplained[part] = np.where(own[:, None], left[part] - left[part][own].mean(axis=0), 0.0)
    return unexplained


def with_late_forces(recordings: Sequence[FitRecording], delay: float) -> list[FitRecording]:
    """Return recordings whose forces come `delay` s later."""
    return [
        each.with_groups(tendon_force=shifted(each, each.recording.groups["tendon_force"], -delay))
        for each in recordings
    ]


# --- what range recordings cover --------------------------------------------------------------------------------------


_OUTER = 0.01  # share of samples outside of each end of a range, so that single outliers do not stretch it
_FAST = 0.95  # quantile that counts as fast
_LOOKED_AT = 50_000  # samples that are looked at, about


@dataclass(frozen=True)
class Span:
    """Ranges of the signals over all samples that are used."""

    angle: Numbers  # 1 % and 99 % quantiles, rad [n, 2]
    speed: Numbers  # 95 % quantile of |q̇|, rad/s [n]
    tendon_speed: Numbers  # 95 % quantile of |ẋ_ij|, m/s [m, n]
    position: Numbers  # 1 % and 99 % quantiles of the joint-side tendon position x1 = R q, m [m, 2]
    force: Numbers  # 1 % and 99 % quantiles, N [m, 2]
    torque: Numbers  # standard deviation of the torque to be explained, N·m [n]
    duration: float  # length of the longest part without a gap, s
    step: float  # median time between samples, s


def span_of(data: Mapping[str, Any], recordings: Sequence[FitRecording]) -> Span:
    """Measure the span of recordings that were prepared for a valid description."""
    arms = moment_arms(data)
    every = max(1, sum(len(recording.time) for recording in recordings) // _LOOKED_AT)
    rows = [np.flatnonzero(recording.train)[::every] for recording in recordings]

    def of(signals: Iterable[Numbers]) -> Numbers:
        return np.concatenate([values[own] for values, own in zip(signals, rows, strict=True)])

    angle, speed = (of(getattr(each.model, name) for each in recordings) for name in ("joint_angle", "joint_speed"))
    force, ends = of(each.recording.groups["tendon_force"] for each in recordings), [_OUTER, 1 - _OUTER]
    sliding = np.cumsum((speed[:, None, :] * arms)[:, :, ::-1], axis=2)[:, :, ::-1]
    steps = np.concatenate([np.diff(recording.time[part]) for recording in recordings for part in recording.parts])
    return Span(
        angle=np.quantile(angle, ends, axis=0).T,
        speed=np.quantile(np.abs(speed), _FAST, axis=0),
        tendon_speed=np.quantile(np.abs(sliding), _FAST, axis=0),
        position=np.quantile(angle @ arms.T, ends, axis=0).T,
        force=np.quantile(force, ends, axis=0).T,
        torque=np.std(of(recording.target for recording in recordings), axis=0),
        duration=max(float(one.time[part][-1] - one.time[part][0]) for one in recordings for part in one.parts),
        step=float(np.median(steps)),
    )
