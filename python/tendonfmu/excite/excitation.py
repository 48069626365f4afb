"""Which strokes a training motion has: all joints move at once, with slow reversals and rests (paper, section VII).

The paper's motion takes 400 s. Each joint has its own strokes over ranges of angle and velocity. The strokes are
stratified: their speeds and lengths follow a low-discrepancy sequence, and most of them are fast. Every few strokes one
runs to an end of the range, so that each working point is passed in both directions. A stroke speeds up, keeps its
speed and slows down, in quintic pieces whose ends lie on rows.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from scipy.linalg import null_space
from scipy.optimize import nnls

from tendonfmu.arrays import Data, Flags, Numbers
from tendonfmu.errors import InputError
from tendonfmu.estimate import friction_probe
from tendonfmu.files import counted
from tendonfmu.model import Finger, moment_arms, tendon_positions

START = 2.0  # s; all joints are at rest at the beginning of a block, while the pretension changes
END = 1.0  # s; all joints are at rest at the end of a block
PRETENSION_CHANGE = 1.5  # s
ACCELERATION = 10.0  # rad/s², never exceeded unless the plan allows more
SPEED_UP = 0.15  # s, or longer if the greatest acceleration requires it
SLOWEST = 0.05  # share of the greatest speed
SLOW = 0.25  # share of the greatest speed; a reversal between two strokes up to it counts as slow
SHORTEST, LONGEST = 0.3, 2.0  # s; of a stroke as drawn
REST = 0.2, 1.5  # s; of a joint between two strokes
REST_SHARE = 0.1  # strokes followed by a rest
ONWARD_SHARE = 0.1  # strokes that continue in the direction of the one before
SWEEP_EVERY = 6  # one of this many strokes runs to an end of the range
SLOW_EVERY, SLOW_RUN = 10, 3  # of 10 strokes 3 in a row are slow, so that there are slow reversals
HOME_SPEED = 0.5  # share of the greatest speed
_GOLDEN = (0.7548776662466927, 0.5698402909980532)  # Roberts' R2 sequence: even in the plane
PATTERN_CHANGE = 1.5  # s; from one pattern of tensions to the next, while the joints move on
_STREAM = 0x7E17  # of random numbers; joints have 0 to 15


@dataclass(frozen=True)
class Stroke:
    """One stroke of a joint."""

    begin: float  # times (s)
    end: float
    start: float  # angles (rad)
    target: float
    speed: float  # speed in its middle (rad/s)


@dataclass(frozen=True)
class Excitation:
    """A training motion, one row every 1/rate s."""

    time: Numbers  # [N] (s)
    joint_position: Numbers  # [N, n] (rad, rad/s, rad/s²)
    joint_velocity: Numbers
    joint_acceleration: Numbers
    tension: Numbers  # tensions [N, m] (N) that balance each other
    pretension: Numbers  # their mean [N] (N)
    tendon_position: Numbers  # motor side x0 [N, m] (m) that holds the posture at that tension without friction
    # for each joint [k, 4]: time, position, velocity, acceleration
    knots: list[Numbers] = field(default_factory=list)
    strokes: list[list[Stroke]] = field(default_factory=list)  # strokes of each joint
    # begin (s), end (s) and pretension (N) of each block
    blocks: list[tuple[float, float, float]] = field(default_factory=list)
    load: Numbers = field(default_factory=lambda: np.zeros((0, 0)))  # known load at the joints [N, n] (N·m)

    def columns(self) -> dict[str, Numbers]:
        """Return the columns of the motion's file."""
        # returns name -> [N]
        table = {"time": self.time}
        for name in ("joint_position", "joint_velocity", "joint_acceleration", "tendon_position"):
            values: Numbers = getattr(self, name)
            table |= {f"{name}[{k}]": column for k, column in enumerate(values.T, start=1)}
        return table | {"pretension": self.pretension}


@dataclass(frozen=True)
class Variation:
    """How the tensions change."""

    lowest: float  # limits (N) of every tendon that only pulls
    highest: float
    every: float = 10.0  # duration of a pattern (s)


@dataclass(frozen=True)
class Plan:
    """What a motion should be like."""

    ranges: Numbers  # lowest and highest angle of each joint [n, 2] (rad)
    max_speed: float = 1.0  # rad/s
    duration: float = 400.0  # duration (s) of the whole motion at each pretension, or with `alternate` of all together
    pretensions: Sequence[float] = (10.0,)  # N
    alternate: float | None = None  # duration at one pretension before the next (s)
    rate: float = 100.0  # rows per second
    seed: int = 0  # of the random numbers
    vary: Variation | None = None  # how the tensions change
    max_acceleration: float = ACCELERATION  # rad/s²


def plan_excitation(data: Data, plan: Plan) -> Excitation:
    """Plan the motion of a finger."""
    blocks = _blocks(plan)
    home = plan.ranges.mean(axis=1)
    knots, strokes = [], []
    for joint in range(len(plan.ranges)):
        drawn = [
            _JointBlock(plan, joint, part, float(home[joint])).draw(begin, end)
            for part, (begin, end) in _parts(plan, blocks)
        ]
        path = np.array([knot for points, _ in drawn for knot in points])
        # knots are compared by their row, which is exact; times are not
        path = path[np.concatenate([[True], np.diff(path[:, 0]) > 0])]
        path[:, 0] /= plan.rate
        knots.append(path)
        strokes.append([stroke for _, found in drawn for stroke in found])
    return _sample(data, plan, knots, strokes, blocks)


def _parts(plan: Plan, blocks: list[tuple[int, int, float]]) -> list[tuple[int, tuple[int, int]]]:
    """Return (number of the drawing, rows) of each block: the same motion at each pretension, unless they alternate."""
    return [(0 if plan.alternate is None else part, (begin, end)) for part, (begin, end, _) in enumerate(blocks)]


def _blocks(plan: Plan) -> list[tuple[int, int, float]]:
    """Return (first row, last row, pretension) of each block."""
    rows = round(plan.duration * plan.rate)
    levels = list(plan.pretensions)
    if plan.alternate is None:
        blocks = [(k * rows, (k + 1) * rows, level) for k, level in enumerate(levels)]
    else:
        count = max(len(levels), round(plan.duration / plan.alternate))
        ends = [round(k * rows / count) for k in range(count + 1)]
        blocks = [(ends[k], ends[k + 1], levels[k % len(levels)]) for k in range(count)]
    span = float(np.max(np.ptp(plan.ranges, axis=1)))
    least = START + END + 2 * SHORTEST + 2 * _speed_up(plan) + span / (HOME_SPEED * plan.max_speed)
    shortest = min(end - begin for begin, end, _ in blocks) / plan.rate
    if shortest < least:
        what = "duration" if plan.alternate is None else "alternate"
        raise InputError(
            f"--{what}: {shortest:g} s at a pretension; expected at least {np.ceil(least):g} s "
            f"for a range of {span:.3g} rad at {plan.max_speed:g} rad/s"
        )
    return blocks


def _speed_up(plan: Plan) -> float:
    """Return the time to speed up (s)."""
    return max(SPEED_UP, 1.5 * plan.max_speed / plan.max_acceleration, 1 / plan.rate)


class _JointBlock:
    """Draws the strokes of one joint in one block. Time is counted in rows."""

    def __init__(self, plan: Plan, joint: int, part: int, home: float) -> None:
        self._random = np.random.default_rng([plan.seed, joint, part])
        self._phase = self._random.random(2)
        self._plan, self._home = plan, home
        self._low, self._high = (float(limit) for limit in plan.ranges[joint])
        self._ramp = int(np.ceil(_speed_up(plan) * plan.rate - 1e-9))
        self._knots: list[tuple[float, float, float, float]] = []
        self._strokes: list[Stroke] = []

    def draw(self, first: int, last: int) -> tuple[list[tuple[float, float, float, float]], list[Stroke]]:
        """Return knots (row, position, velocity, acceleration) and strokes from one row to another."""
        rate, position, direction = self._plan.rate, self._home, 1 if self._random.random() < 0.5 else -1
        row = first + round((START + self._random.random() * SHORTEST) * rate)
        self._knots += [(first, position, 0.0, 0.0), (row, position, 0.0, 0.0)]
        number = 0
        while self._high > self._low:
            direction *= 1 if self._random.random() < ONWARD_SHARE else -1
            target, speed, direction = self._next(number, position, direction)
            back = self._rows(self._home - target, HOME_SPEED * self._plan.max_speed)
            end = row + self._rows(target - position, speed)
            if end + back > last - round(END * rate):
                break
            row, position, number = self._stroke(row, position, target, speed), target, number + 1
            if self._random.random() < REST_SHARE:
                rest = round(self._random.uniform(*REST) * rate)
                if row + rest + back <= last - round(END * rate):
                    row += rest
                    self._knots.append((row, position, 0.0, 0.0))
        if position != self._home:
            row = self._stroke(row, position, self._home, HOME_SPEED * self._plan.max_speed)
        self._knots.append((last, self._home, 0.0, 0.0))
        return self._knots, self._strokes

    def _next(self, number: int, position: float, direction: int) -> tuple[float, float, int]:
        """Return target, speed and direction of a stroke. It reverses if there is no room."""
        first, second = (float((phase + number * step) % 1.0) for phase, step in zip(self._phase, _GOLDEN, strict=True))
        # slow speeds are even in their logarithm; for the others the exponent is squared, so that most are fast
        slow = number % SLOW_EVERY < SLOW_RUN
        speed = self._plan.max_speed * (SLOW * (SLOWEST / SLOW) ** first if slow else SLOWEST ** (first * first))
        time = SHORTEST * (LONGEST / SHORTEST) ** second
        room = self._high - position if direction > 0 else position - self._low
        if room < 0.02 * (self._high - self._low):
            direction, room = -direction, self._high - self._low - room
        if not slow and number % SWEEP_EVERY == SWEEP_EVERY - 1:
            speed, time = max(speed, HOME_SPEED * self._plan.max_speed), np.inf
        if time * speed >= room:
            return (self._high if direction > 0 else self._low), speed, direction
        return position + direction * time * speed, speed, direction

    def _rows(self, way: float, speed: float) -> int:
        return 2 * self._ramp + self._cruise(way, speed)

    def _cruise(self, way: float, speed: float) -> int:
        """Return the rows at full speed. Speeding up and slowing down cover the distance of one ramp at full speed."""
        return max(int(np.ceil(abs(way) / speed * self._plan.rate - self._ramp - 1e-9)), 0)

    def _stroke(self, row: int, start: float, target: float, speed: float) -> int:
        """Add a stroke at most as fast as `speed`, and return the row at its end."""
        way, cruise = target - start, self._cruise(target - start, speed)
        velocity = way / (self._ramp + cruise) * self._plan.rate
        part = velocity * self._ramp / self._plan.rate / 2
        self._knots.append((row + self._ramp, start + part, velocity, 0.0))
        if cruise:
            self._knots.append((row + self._ramp + cruise, target - part, velocity, 0.0))
        end = row + 2 * self._ramp + cruise
        self._knots.append((end, target, 0.0, 0.0))
        self._strokes.append(Stroke(row / self._plan.rate, end / self._plan.rate, start, target, abs(velocity)))
        return end


def _sample(
    data: Data, plan: Plan, knots: list[Numbers], strokes: list[list[Stroke]], blocks: list[tuple[int, int, float]]
) -> Excitation:
    time = np.arange(blocks[-1][1] + 1) / plan.rate
    curves = [evaluate_quintic(path, time) for path in knots]
    position, velocity, acceleration = (np.column_stack([curve[k] for curve in curves]) for k in range(3))
    if plan.vary is not None:
        tension = internal_tensions(data, plan.vary, time, plan.seed)
        pretension = tension.mean(axis=1)
        blocks = [(blocks[0][0], blocks[-1][1], float(pretension.mean()))]
    else:
        pretension = _pretension(plan, blocks, time)
        tension = np.outer(pretension, pretension_vector(data))
    return Excitation(
        time=time,
        joint_position=position,
        joint_velocity=velocity,
        joint_acceleration=acceleration,
        tension=tension,
        pretension=pretension,
        tendon_position=tendon_positions(data, position, tension),
        knots=knots,
        strokes=strokes,
        blocks=[(begin / plan.rate, end / plan.rate, level) for begin, end, level in blocks],
    )


def _pretension(plan: Plan, blocks: list[tuple[int, int, float]], time: Numbers) -> Numbers:
    """Return the pretension [N] (N), constant in each block except for the change at its beginning."""
    level = np.array([[blocks[0][0], blocks[0][2], 0.0, 0.0]])
    for (_, _, before), (begin, _, now) in pairwise(blocks):
        change = round(PRETENSION_CHANGE * plan.rate)
        level = np.vstack([level, [begin, before, 0.0, 0.0], [begin + change, now, 0.0, 0.0]])
    level[:, 0] /= plan.rate
    pretension, _, _ = evaluate_quintic(level, time)
    return pretension


# --- internal tensions ------------------------------------------------------------------------------------------------
#
# Balanced patterns (Rᵀ f = 0), one after the other. Each tendon is tight in some patterns and loose in others. With one
# constant pattern a fit sees only the sum of a flexor and its extensor, or of two tendons that slide together. The
# tensions of a finger of m tendons and n joints can change in m − n ways without turning a joint, so changing patterns
# let a fit distinguish more.


def internal_tensions(data: Data, variation: Variation, time: Numbers, seed: int) -> Numbers:
    """Return tensions [N, m] (N) at `time` [N] (s). Raise InputError if the finger has none within the limits."""
    count = max(2, math.ceil(float(time[-1]) / variation.every))
    random = np.random.default_rng([seed, _STREAM])
    tight = np.arange(count) % 2 == 0
    drawn = np.column_stack([random.permutation(tight) for _ in data["tendons"]])
    patterns = _Patterns(data, variation)
    values = np.array([patterns.nearest(row) for row in drawn])
    return np.column_stack([_series(values[:, i], variation.every, time) for i in range(values.shape[1])])


def _series(values: Numbers, every: float, time: Numbers) -> Numbers:
    """Return one tendon's tension [N]: constant, but changing at the beginning of each later pattern."""
    begin = every * np.arange(1, len(values))
    knots = np.zeros((2 * len(begin) + 1, 4))
    knots[1::2, 0], knots[2::2, 0] = begin, begin + PATTERN_CHANGE
    knots[0, 1], knots[1::2, 1], knots[2::2, 1] = values[0], values[:-1], values[1:]
    tension, _, _ = evaluate_quintic(knots, time)
    return tension


class _Patterns:
    """The balanced tensions of a finger within limits."""

    def __init__(self, data: Data, variation: Variation) -> None:
        arms = moment_arms(data)
        if np.linalg.matrix_rank(arms) == len(arms):
            raise InputError(
                f"--vary-tension {variation.lowest:g}:{variation.highest:g}: {counted(len(arms), 'tendon')} at "
                f"{counted(arms.shape[1], 'joint')} hold no tension; expected more tendons than joints"
            )
        pulls = np.array([not tendon.get("bidirectional") for tendon in data["tendons"]])
        self._arms, self._high = arms, np.full(len(arms), variation.highest)
        self._low = np.where(pulls, variation.lowest, -variation.highest)
        self._even = self._even_pattern(pretension_vector(data), pulls, variation)

    def _even_pattern(self, shares: Numbers, pulls: Flags, variation: Variation) -> Numbers:
        """Return the pretension in the middle of those within the limits."""
        low, high = variation.lowest, variation.highest
        least = low / float(shares[pulls].min()) if pulls.any() else 0.0
        most = high / float(np.abs(shares).max()) if shares.any() else 0.0
        if least > most:
            raise InputError(
                f"--vary-tension {low:g}:{high:g}: no balanced pretension lies within; expected HIGH at least "
                f"{least * high / (most * low):.3g} times LOW for these moment arms"
            )
        return 0.5 * (least + most) * shares

    def nearest(self, tight: Flags) -> Numbers:
        """Return the balanced tensions [m] nearest to the highest where `tight` [m], and to the lowest elsewhere."""
        found = _nearest_balanced(self._arms, np.where(tight, self._high, self._low), self._low, self._high)
        return self._even if found is None else found


# --- quintic pieces between knots -------------------------------------------------------------------------------------
# Each piece is the polynomial of degree 5 with position, velocity and acceleration of both its knots (quintic Hermite).
# Outside the knots the position is constant.


def evaluate_quintic(knots: Numbers, time: Numbers) -> tuple[Numbers, Numbers, Numbers]:
    """Evaluate a piecewise quintic curve and its derivatives. knots: [k, 4] (rad); time: [N] (s); returns [N]."""
    if len(knots) == 1:
        return np.full(len(time), knots[0, 1]), np.zeros(len(time)), np.zeros(len(time))
    piece = np.clip(np.searchsorted(knots[:, 0], time, side="right") - 1, 0, len(knots) - 2)
    begin, end = knots[:-1][piece].T, knots[1:][piece].T
    h = end[0] - begin[0]
    u = np.clip((time - begin[0]) / h, 0.0, 1.0)
    v0, v1 = begin[2] * h, end[2] * h
    a0, a1 = begin[3] * h * h / 2, end[3] * h * h / 2
    rise = end[1] - begin[1] - v0 - a0  # the cubic and higher terms add up to this at u = 1
    slope, bend = v1 - v0 - 2 * a0, a1 - a0
    c3, c4, c5 = 10 * rise - 4 * slope + bend, -15 * rise + 7 * slope - 2 * bend, 6 * rise - 3 * slope + bend
    position = begin[1] + u * (v0 + u * (a0 + u * (c3 + u * (c4 + u * c5))))
    velocity = (v0 + u * (2 * a0 + u * (3 * c3 + u * (4 * c4 + u * 5 * c5)))) / h
    acceleration = (2 * a0 + u * (6 * c3 + u * (12 * c4 + u * 20 * c5))) / (h * h)
    # exactly the last knot, without rounding errors
    position, velocity, acceleration = (
        np.where(u < 1, inside, last) for inside, last in zip((position, velocity, acceleration), end[1:], strict=True)
    )
    outside = (time < knots[0, 0]) | (time > knots[-1, 0])
    return position, np.where(outside, 0.0, velocity), np.where(outside, 0.0, acceleration)


# --- forces that carry the friction of a motion -----------------------------------------------------------------------
# In quasi-static balance Rᵀ f0 = T (eq. 12): the forces are a pretension that balances itself, and what carries
# friction.


LEAST_SHARE = 0.05  # of the mean; keeps every pulling tendon taut
_ITERATIONS = 8  # each reduces the error to the share of the force that friction takes, some percent
_NONE = 1e-9  # of a residual of unit size: no forces are within the limits


def pretension_vector(data: Data) -> Numbers:
    """Return the tendon forces [m] per newton of pretension."""
    arms = moment_arms(data)
    pulls = np.array([not tendon.get("bidirectional") for tendon in data["tendons"]])
    even = np.ones(len(arms))
    shares = _nearest_balanced(arms, even, np.where(pulls, LEAST_SHARE, -np.inf), np.inf * even)
    if shares is None:
        raise InputError(
            "tendons: no balanced pretension; expected moment arms with a solution of "
            "Rᵀ f = 0 in which every tendon pulls"
        )
    mean = float(np.mean(shares))
    return shares / mean if mean > 1e-9 else np.zeros(len(arms))


def _nearest_balanced(arms: Numbers, aim: Numbers, low: Numbers, high: Numbers) -> Numbers | None:
    """Return the forces with Rᵀ f = 0 within limits that are nearest to `aim` [m], None if there are none."""
    # least distance programming by non-negative least squares (C. L. Lawson, R. J. Hanson, 1974, chapter 23)
    free = null_space(arms.T)  # [m, d]
    scale, start = float(np.abs(aim).max()), free.T @ aim
    bounds = (np.concatenate([low, -high]) - np.concatenate([free, -free]) @ start) / scale
    limits = np.column_stack([np.concatenate([free, -free]), bounds])[np.isfinite(bounds)]
    if not len(limits):
        return np.asarray(free @ start)
    unit = np.eye(limits.shape[1])[-1]
    weights, error = nnls(limits.T, unit)
    left = limits.T @ weights - unit
    return None if error < _NONE else np.asarray(free @ (start - scale * left[:-1] / left[-1]))


def balanced_forces(described: Finger, motion: Mapping[str, Numbers], pretension: Numbers) -> Numbers:
    """Return the tendon forces that carry the friction of a motion: f0 = pretension·ν + (Rᵀ)⁺ T(f0)."""
    # T is eq. (10) of everything that slides, cover included. Sticking places add nothing, since their share is
    # unknown.
    # motion: [N] (s); pretension: [N] (N); returns tendon forces [N, m] (N)
    data, finger = described.data, friction_probe(described)
    start = finger.save_state()
    spread = np.linalg.pinv(moment_arms(data))
    internal = np.outer(pretension, pretension_vector(data)) if pretension.ndim == 1 else pretension
    forces = internal
    for _ in range(_ITERATIONS):
        finger.restore_state(start)
        outputs = finger.run({**motion, "tendon_force": forces})
        forces = internal + (outputs["friction_torque"] - outputs["bias_torque"]) @ spread
    return np.asarray(forces)
