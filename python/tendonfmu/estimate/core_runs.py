"""Runs of the C core over recordings: the torque that a finger leaves, and its derivatives by numbers.

What is left is τ − T without a learning bias. T has the jumps of fig. 5 where a place has no presliding; with nothing
learned and nothing forgotten they hold the friction of a place while it sticks. The derivatives are differences
between runs, so they know every term of the core. Both are block means over the grid of the recordings.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from copy import copy
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy import sparse

from tendonfmu.arrays import Array, Flags, Indices, Numbers
from tendonfmu.model import INPUTS_OF_SOURCE, Finger, number_of
from tendonfmu.recordings import FitRecording, Grid, Segment, make_grid
from tendonfmu.statistics import Span, spline_basis

RATE = 400.0  # Hz; the samples of faster recordings are averaged, but not below this rate
SETTLED = 1.0, 0.05  # s, and share of a stretch: until then what friction remembers is still unknown,
TURNED, MOST = 0.1, 0.3  # and until every joint that turns has turned so far (rad), at most this share of the stretch


@dataclass(frozen=True)
class Stretch:
    """A stretch without a gap, thinned."""

    segment: Segment
    arrays: dict[str, Numbers]
    kinematics: int
    external: Numbers | float  # block means [count, n] (N·m)


class CoreRuns:
    """Runs of a finger over recordings, whose numbers are set by path."""

    def __init__(
        self,
        finger: Finger,
        recordings: Sequence[FitRecording],
        grid: Grid | None = None,
        *,
        rate: float = RATE,
        threads: int = 0,
    ) -> None:
        """Thin the recordings to about `rate` (Hz; inf: all samples). `threads` 0: all cores."""
        self._settle(finger)
        self.grid = make_grid(recordings) if grid is None else grid
        segments = self.grid.segments
        self.stretches = [_stretch(recordings[segment.recording], segment, rate) for segment in segments]
        used = [_used(recordings[each.recording], each, self.grid.step) for each in segments]
        self.used: Flags = np.concatenate(used)  # blocks that may be learned from [B]
        self.stretch: Indices = np.repeat(np.arange(len(segments)), [segment.count for segment in segments])
        # the stretch without a gap that each block belongs to, its centre (s), and joint speeds (rad/s)
        self.time: Numbers = self.grid.means([recording.time for recording in recordings])
        self.speed: Numbers = self.grid.means([recording.model.joint_speed for recording in recordings])
        fastest = self.grid.means([np.abs(recording.model.joint_speed) for recording in recordings])
        self.torque: Numbers = self.grid.means([recording.target for recording in recordings])
        counts = self.used | (self.grid.means([recording.at_rest for recording in recordings]) == 1.0)
        self.still: Flags = counts & np.all(fastest <= number_of(finger.data, "velocity_threshold.joint"), axis=1)
        silent = self.grid.means([recording.silent for recording in recordings]) > 0.0
        # joints that say something; what all leave while they rest shows a drift
        self.loud: Flags = ~silent | silent.all(axis=1, keepdims=True)
        self.added: Numbers | float = 0.0  # torque that is measured beyond that of the runs' forces, N·m [B, n]
        self._pool = ThreadPoolExecutor(threads or os.cpu_count() or 1)

    def _settle(self, finger: Finger) -> None:
        self.finger = finger
        self._idle = [finger.steady.instance()]  # each used by one thread at a time
        self._start = self._idle[0].save_state()

    @property
    def joints(self) -> int:
        """Number of joints n."""
        return self.finger.joints

    def of(self, finger: Finger) -> CoreRuns:
        """Return runs of another description of the same finger over the same samples."""
        other = copy(self)
        other._settle(finger)
        return other

    def residual(self, values: Mapping[str, float] | None = None) -> Numbers:
        """Return block means of τ − T, [B, n] (N·m). `values`: numbers that differ, by path, SI units."""
        parts = self._pool.map(lambda each: self._left(values or {}, each), self.stretches)
        return np.asarray(self.loud * (np.concatenate(list(parts)) + self.added))

    def columns(
        self, moves: Sequence[tuple[Mapping[str, float], float]], values: Mapping[str, float] | None = None
    ) -> Numbers:
        """Return the differences of `residual` from that at `values` by p moves, per length of each, [B, n, p] (N·m).

        A move is the numbers that it changes, by path, after it, and its length.
        """
        at, base = values or {}, self.residual(values)
        columns = np.empty((*base.shape, len(moves)))

        def fill(k: int) -> None:
            moved, length = moves[k]
            left = np.concatenate([self._left({**at, **moved}, each) for each in self.stretches])
            columns[:, :, k] = (self.loud * (left + self.added) - base) / length

        list(self._pool.map(fill, range(len(moves))))
        return columns

    def _left(self, values: Mapping[str, float], stretch: Stretch) -> Numbers:
        """Return [count, n] block means of τ − T (N·m) of one stretch."""
        try:
            finger = self._idle.pop()  # one step for the interpreter: no other thread gets the same
        except IndexError:
            finger = self.finger.steady.instance()
        finger.restore_state(self._start)
        finger.set_kinematics_source(stretch.kinematics)
        finger.set(values)
        left = finger.run(stretch.arrays)["compensated_torque"]
        self._idle.append(finger)
        return np.asarray(left.reshape(stretch.segment.count, -1, left.shape[1]).mean(axis=1) - stretch.external)


def _stretch(recording: FitRecording, segment: Segment, rate: float) -> Stretch:
    rows = slice(segment.part.start, segment.part.start + segment.count * segment.samples)
    signals = recording.arrays(rows)
    step = float(np.median(np.diff(signals["time"])))
    every = max(
        d for d in range(1, segment.samples + 1) if segment.samples % d == 0 and (d == 1 or d * step * rate <= 1)
    )
    wanted = {"time", "tendon_force", *INPUTS_OF_SOURCE[recording.kinematics]}
    thin = {
        name: np.ascontiguousarray(values.reshape(len(values) // every, every, *values.shape[1:]).mean(axis=1))
        for name, values in signals.items()
        if name in wanted
    }
    external = recording.external
    known = 0.0 if external is None else segment.mean(external[segment.part])
    return Stretch(segment, thin, recording.kinematics, known)


def _turned(recording: FitRecording, segment: Segment, step: float) -> float:
    """Return the number of blocks until every joint that turns in a stretch has turned."""
    angle = step * np.cumsum(segment.mean(recording.model.joint_speed[segment.part]), axis=0)
    reach = np.maximum.accumulate(angle) - np.minimum.accumulate(angle)
    waits = np.argmax(reach > TURNED, axis=0)[reach[-1] > TURNED] if len(reach) else np.zeros(0)
    return float(min(waits.max(initial=0), MOST * segment.count))


def _used(recording: FitRecording, segment: Segment, step: float) -> Flags:
    """Return [count] the blocks that may be learned from."""
    used = segment.mean(recording.train[segment.part]) == 1.0
    longest, share = SETTLED
    used[: int(max(min(longest / step, share * segment.count), _turned(recording, segment, step)))] = False
    return np.asarray(used)


# --- what is not judged of a torque -----------------------------------------------------------------------------------
# A learning bias would follow everything slow, such as a missing cover or weight. A drift, of a sensor's zero or a
# temperature, shows while all joints stand still: there neither friction nor position-dependent torque changes much.


DRIFT_KNOTS = (60.0, 30.0, 15.0)  # s, of a drift; the slowest that is enough is used
SHORTEST_REST = 0.3  # s, of a rest
FEWEST_RESTS = 12  # rests, for a drift to show
CLEARLY = 2.0  # standard errors of the mean fall of the rests' squared errors


class SlowDrift:
    """The constant, or the splines, of each joint and stretch."""

    def __init__(self, time: Numbers, stretch: Indices, used: Flags, knots: float = np.inf) -> None:
        """Make the basis. time: [B] (s); stretch: [B]; used: [B]; knots: s, inf for constants."""
        self.knots, self.used = knots, used
        self.basis = sparse.csr_array(sparse.block_diag(_bases(time, stretch, knots), format="csr"))  # [B, s]
        self._span = Span(self.basis[used])

    def without(self, values: Array) -> Numbers:
        """Return the used rows of values [B, n, ...] without their constant or drift, [R, n, ...]."""
        rows = values[self.used]
        return self._span.without(rows.reshape(len(rows), -1)).reshape(rows.shape) if rows.size else rows


def _bases(time: Numbers, stretch: Indices, knots: float) -> list[Numbers]:
    pieces = [time[stretch == number] for number in np.unique(stretch)]
    return [_basis(piece, piece, knots) for piece in pieces]


def _basis(time: Numbers, stretch: Numbers, knots: float) -> Numbers:
    """Return [K, s] a constant or splines at times [K] of a stretch with the times [B] (s)."""
    span = float(stretch[-1] - stretch[0])
    if span < knots:
        return np.ones((len(time), 1))
    inside = np.clip(time, stretch[0], stretch[-1])
    first = np.concatenate([stretch[:1], inside])
    return np.asarray(spline_basis(first, span, knots).todense())[1:]


def slowest_drift(residual: Numbers, time: Numbers, stretch: Indices, used: Flags, still: Flags) -> SlowDrift:
    """Return the slowest drift that the rests demand.

    residual: [B, n] (N·m); time: [B] (s); stretch, used: [B]; still: [B] whether all joints stand still.
    """
    rests = _rests(time, stretch, still)
    best = np.inf
    if len(rests) >= FEWEST_RESTS:
        scale = np.maximum(residual[used].std(axis=0), 1e-12)
        means = np.array([residual[rest].mean(axis=0) for rest in rests]) / scale
        centres = np.array([time[rest].mean() for rest in rests])
        number = np.array([stretch[rest.start] for rest in rests])
        error = _left_out(means, centres, number, time, stretch, np.inf)
        for knots in DRIFT_KNOTS:
            other = _left_out(means, centres, number, time, stretch, knots)
            fall = error - other
            if fall.mean() > CLEARLY * fall.std(ddof=1) / np.sqrt(len(fall)):
                best, error = knots, other
    return SlowDrift(time, stretch, used, best)


def _rests(time: Numbers, stretch: Indices, still: Flags) -> list[slice]:
    bounds = np.flatnonzero(
        np.diff(still, prepend=False, append=False) | np.append(np.diff(stretch, prepend=0) != 0, False)
    )
    runs = [slice(int(a), int(b)) for a, b in pairwise(bounds) if still[a]]
    return [run for run in runs if time[run.stop - 1] - time[run.start] >= SHORTEST_REST]


def _left_out(
    means: Numbers, centres: Numbers, number: Indices, time: Numbers, stretch: Indices, knots: float
) -> Numbers:
    """Return [r] the squared error of each rest's mean [r, n], predicted from the others of its stretch."""
    errors = np.zeros(len(means))
    for own in np.unique(number):
        rows = number == own
        basis = _basis(centres[rows], time[stretch == own], knots)
        hat = basis @ np.linalg.pinv(basis, rcond=1e-8)
        free = np.maximum(1.0 - np.diag(hat), 1e-3)
        errors[rows] = np.sum(((means[rows] - hat @ means[rows]) / free[:, None]) ** 2, axis=1)
    return errors
