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

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tendonfmu.arrays import Array, Data, Flags, Numbers
from tendonfmu.diagnosis.series import Series, exact_model, make_series
from tendonfmu.estimate import CoreRuns, SlowDrift, slowest_drift
from tendonfmu.model import extension_rows, moment_arms
from tendonfmu.recordings import FitRecording, Grid
from tendonfmu.statistics import Splines

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
        runs = CoreRuns(data, recordings, rate=RATE, threads=threads)
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
        return self.runs.of(data).residual(values)

    def residual(self, data: Data) -> Numbers:
        """Return the same without its drift [B, n], N·m; 0 at blocks that are not used."""
        left = self.left(data)
        free = np.zeros_like(left)
        free[self.used] = self.drift.without(left)
        return free

    def series(self, data: Data) -> Series:
        """Return the block means of a description's signals and of what it leaves."""
        return replace(make_series(data, self.recordings, self.grid, self.left(data)), used=self.used)

    def of_recordings(self, data: Data, recordings: Sequence[FitRecording]) -> Samples:
        """Return the samples with the forces of other recordings of the same times; the measured torque stays."""
        runs = CoreRuns(data, recordings, self.grid, rate=RATE, threads=self.threads)
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
        groups = dict(recording.recording.groups)
        force = groups["tendon_force"]
        most = MOST_SHIFT * np.abs(force).max(initial=0.0)  # a model that explains nothing predicts no forces either
        shift = np.clip(_unexplained(data, recording) @ spread, -most, most)
        predicted = np.where(pulls & (force > 0), np.maximum(force - shift, 0.0), force - shift)
        groups["tendon_force"] = predicted
        if "tendon_position" in groups:
            # a description with a delay pairs the present position with the force `delay` s later
            change = _shifted(recording, (predicted - force) / stiffness, _delay(data))
            groups["tendon_position"] = groups["tendon_position"] + change
        moved.append(replace(recording, recording=replace(recording.recording, groups=groups)))
    return moved


def _delay(data: Mapping[str, Any]) -> float:
    """Return by how many seconds forces come later than positions, according to the description."""
    rows = data.get("extensions") or []
    return float(sum(row["delay"] for row in rows if row["effect"] == "time_delay"))


def _shifted(recording: FitRecording, values: Numbers, delay: float) -> Numbers:
    """Return the values [N, m] of `delay` s later, within each part."""
    if not delay:
        return values
    shifted: Numbers = values.copy()
    for part in recording.parts:
        time = recording.time[part]
        for i in range(values.shape[1]):
            shifted[part, i] = np.interp(time + delay, time, values[part, i])
    return shifted


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
    late = []
    for recording in recordings:
        groups = dict(recording.recording.groups)
        force = groups["tendon_force"].copy()
        for part in recording.parts:
            time = recording.time[part]
            for i in range(force.shape[1]):
                force[part, i] = np.interp(time - delay, time, groups["tendon_force"][part, i])
        groups["tendon_force"] = force
        late.append(replace(recording, recording=replace(recording.recording, groups=groups)))
    return late
