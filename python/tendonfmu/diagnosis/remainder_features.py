"""What a flexible learner uses to describe a motion: many simple functions of the states, in groups with plain names.

The learner is linear in its weights. So whatever is done to the residual (removing bias splines, whitening) can be done
to every column as well, and the null distribution of the learner's skill takes only one small matrix (remainder.py).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import combinations, pairwise, permutations, product
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline
from scipy.signal import lfilter

from tendonfmu.arrays import Indices, Numbers
from tendonfmu.recordings import stopped

if TYPE_CHECKING:
    from tendonfmu.diagnosis.samples import Series

# --- states that nobody records ---------------------------------------------------------------------------------------
# A stop operator is s = clip(s′ + Δx, ±w), where x is a travel or a force and w its width; a leaky one forgets with a
# time T first, s′·exp(−Δt/T). Friction that remembers is nearly a sum of such states (Prandtl and Ishlinskii), so a
# learner that is linear in them finds it. How much it finds of states planted for a test says what its silence is
# worth.


WIDTHS = (0.01, 0.04, 0.15)  # of the range of the travel or force
TIMES = (np.inf, 1.0, 0.1)  # s, in which a state leaks away
PLANTED = 3  # states planted at each joint


def states_of(series: Series, starts: Indices) -> Iterator[tuple[str, Numbers]]:
    """Yield (part of the finger, its states of every width and time [B, k]), for each joint and tendon."""
    widths, times = np.array(list(product(WIDTHS, TIMES))).T
    drivers, count = list(_drivers(series)), len(widths)
    moved = np.repeat(np.stack([driver for _, driver, _ in drivers], axis=1), count, axis=1)
    states = stopped(moved, np.tile(widths, len(drivers)), np.tile(times, len(drivers)), series.step, starts)
    for k, (who, _, load) in enumerate(drivers):
        yield who, states[:, k * count : (k + 1) * count] * load[:, None]


def planted(series: Series, starts: Indices, random: np.random.Generator) -> Numbers:
    """Return states of other widths and times than those of `states_of`, at random parts [B, PLANTED]."""
    drivers = list(_drivers(series))
    chosen = random.integers(len(drivers), size=PLANTED)
    widths = np.exp(random.uniform(np.log(WIDTHS[0]), np.log(WIDTHS[-1]), PLANTED))
    times = np.where(random.random(PLANTED) < 0.5, np.inf, np.exp(random.uniform(np.log(0.05), np.log(3.0), PLANTED)))
    states = stopped(np.stack([drivers[k][1] for k in chosen], axis=1), widths, times, series.step, starts)
    return np.asarray(states * np.stack([drivers[k][2] for k in chosen], axis=1))


def _drivers(series: Series) -> Iterator[tuple[str, Numbers, Numbers]]:
    """Yield (name, travel or force [B] in ranges, tendon force that presses it, over its mean [B]; ones without)."""
    alone = np.ones(len(series.time))
    for joint, angle in enumerate(series.angle.T):
        yield f"joint {joint + 1}", _in_ranges(angle), alone
    level = np.maximum(np.abs(series.force).mean(axis=0), 1e-12)
    travel = np.cumsum(series.tendon_velocity[:, :, 0], axis=0) * series.step
    for tendon in range(series.force.shape[1]):
        yield f"tendon {tendon + 1}", _in_ranges(travel[:, tendon]), series.force[:, tendon] / level[tendon]
        yield f"force of tendon {tendon + 1}", _in_ranges(series.force[:, tendon]), alone


def _in_ranges(values: Numbers) -> Numbers:
    low, high = np.quantile(values, (0.02, 0.98))
    return np.asarray(values / max(float(high - low), 1e-12))


MEMORY = (0.1, 0.3, 1.0, 3.0, 10.0, 30.0)  # s: time constants of what friction may remember
TRAVELS = (0.03, 0.1, 0.3, 1.0)  # scales of presliding, of the median stroke
MOST_PAIRS = 30  # of tendons: those with neighbouring numbers first
RIPPLES = 24  # knots of a curve over the angle: teeth and poles ripple several times within a stroke
RANDOM = 100  # columns of random functions of two or three states
MOVING = 0.03  # of the 95 % quantile of a speed: slower motion counts as rest


@dataclass(frozen=True)
class Features:
    """Columns of the learner."""

    values: Numbers  # columns [B, D]
    group: NDArray[np.str_]  # of each column, a key of GROUPS
    subject: NDArray[np.str_]  # of each column, the part of the finger that it describes


# name of a group -> what the residual follows, in plain words
GROUPS = {
    "angle": "the joint angle",
    "friction over angle": "direction of motion and joint angle together (friction that changes with the angle)",
    "velocity": "the joint velocity",
    "force": "the tendon force",
    "friction over force": "direction of motion and tendon force together (friction that changes with the load)",
    "acceleration": "acceleration or products of velocities (inertial torques)",
    "travel": "the travel since the last reversal (hysteresis)",
    "elastic": "a state that is elastic until it slips, with or without leaking away (friction with another memory)",
    "memory of direction": "the directions of motion of the last seconds (a long hysteresis)",
    "memory of speed": "how fast the finger moved in the last seconds (friction with memory)",
    "memory of angle": "where the joint was in the last seconds (creep)",
    "rest": "the time at rest before the motion",
    "time": "the time since the start, with the direction of motion (slow change of friction)",
    "rubbing": "the motion of two tendons against each other (rubbing)",
    "tendon": "the velocity of a tendon",
    "position": "the position of a tendon (a motor, gear or drum that ripples)",
    "torque": "the torque of another joint",
    "interaction": "several of angle, velocity, force and history together",
}
# What a friction law depends on, and not on time: motion, load, and travel since a reversal. In these every real law
# differs a little from every description, also where nothing is missing.
LAW = ("velocity", "friction over force", "acceleration", "travel", "elastic", "rest", "tendon")
HISTORY = (0.1, 1.0, 10.0)  # s, for the trees


def features(
    series: Series, *, force: Numbers | None = None, torque: Numbers | None = None, seed: int = 0, elastic: bool = False
) -> Features:
    """Compute all columns for the blocks of a series, standardised; constant columns are left out."""
    # torque: of the model, N·m [B, n]; a measured torque or force would carry the residual
    series = replace(series, force=_without_torque(series) if force is None else force)
    states = _states(series)
    motion = (_of_angles, _of_velocities, _of_forces, _of_accelerations, _of_memory)
    makers = [*motion, *([_of_states] if elastic else []), _of_slides, _of_time, _of_tendons]
    made = [columns for maker in makers for columns in maker(series, states)]
    for joint, values in enumerate(() if torque is None else torque.T):
        own = np.stack([values, np.abs(values), values * states.side[:, joint]], axis=1)
        made.append(("torque", _joint(joint), own))
    made.append(("interaction", "", _interactions(series, states, np.random.default_rng(seed))))
    table = np.concatenate([values for _, _, values in made], axis=1)
    counts = [values.shape[1] for _, _, values in made]
    group, subject = (np.repeat([columns[k] for columns in made], counts) for k in (0, 1))
    table -= table.mean(axis=0)
    spread = table.std(axis=0)
    kept = spread > 1e-9 * max(1.0, float(spread.max(initial=0.0)))
    return Features(table[:, kept] / spread[kept], group[kept], subject[kept])


def tree_states(series: Series, force: Numbers, torque: Numbers | None = None) -> tuple[Numbers, Numbers]:
    """Return all recorded signals and their history [B, f], and those of them that a friction law depends on."""
    states = _states(series)
    ratio = series.velocity / states.speed
    law = [ratio, states.side, states.moving, states.rest, series.travel]
    law += [states.side[:, joint, None] * force for joint in range(ratio.shape[1])]
    others = [series.angle, force, series.time[:, None], *([] if torque is None else [torque])]
    for memory in HISTORY:
        others.append(_filtered(states.side, memory, series.step, states.starts))
        others.append(_filtered(np.abs(ratio), memory, series.step, states.starts))
        others.append(series.angle - _filtered(series.angle - series.angle[0], memory, series.step, states.starts))
    own = np.concatenate(law, axis=1)
    return np.concatenate([own, *others], axis=1), own


def _without_torque(series: Series) -> Numbers:
    """Return the part of the forces that makes no torque, N [B, m], for the moment arms that the motion shows."""
    arms = np.linalg.lstsq(series.velocity, series.tendon_velocity[:, :, 0], rcond=1e-9)[0].T
    pulling = arms @ np.linalg.pinv(arms, rcond=1e-9)
    inner = series.force - series.force @ pulling
    tiny = 1e-9 * max(float(np.abs(series.force).max(initial=0.0)), 1e-300)
    return np.asarray(inner * (np.abs(inner).max(axis=0) > tiny))


@dataclass(frozen=True)
class _States:
    """States of the motion."""

    side: Numbers  # sign of the last motion of the joints [B, n]; 0 before any
    moving: Numbers  # the side, fading to 0 at rest [B, n]
    rest: Numbers  # length of the last rest, s [B, n]
    speed: Numbers  # 95 % quantile of |velocity|, rad/s [n]
    tendon_speed: Numbers  # the same of the tendon's velocity at its first joint, m/s [m]
    starts: Indices  # first block of each stretch without a gap, and B


_Made = Iterator[tuple[str, str, Numbers]]


def _states(series: Series) -> _States:
    velocity, starts = series.velocity, run_starts(series.segment)
    speed = np.maximum(np.quantile(np.abs(velocity), 0.95, axis=0), 1e-12)
    tendon_speed = np.maximum(np.quantile(np.abs(series.tendon_velocity[:, :, 0]), 0.95, axis=0), 1e-15)
    slow = MOVING * speed
    side, rest = _last_side(velocity, slow, starts), _rest_before(velocity, slow, series.step, starts)
    return _States(side, np.tanh(velocity / slow), rest, speed, tendon_speed, starts)


def run_starts(label: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the index of the first block of each stretch of equal labels [B], and B at the end."""
    return np.concatenate([[0], np.flatnonzero(np.diff(label)) + 1, [len(label)]]).astype(np.int64)


def _last_side(velocity: Numbers, threshold: Numbers, starts: NDArray[np.int64]) -> Numbers:
    """Return the sign of the last motion faster than the threshold [B, k]."""
    moving = np.abs(velocity) > threshold
    index = np.where(moving, np.arange(len(velocity))[:, None], -1)
    last = np.maximum.accumulate(index, axis=0)
    known = last >= np.repeat(starts[:-1], np.diff(starts))[:, None]
    return np.where(known, np.sign(np.take_along_axis(velocity, np.maximum(last, 0), axis=0)), 0.0)


def _rest_before(velocity: Numbers, threshold: Numbers, step: float, starts: NDArray[np.int64]) -> Numbers:
    """Return the length of the last rest, s [B, k]: the present one while at rest, else the one before this motion."""
    result = np.zeros_like(velocity)
    for joint in range(velocity.shape[1]):
        still = np.abs(velocity[:, joint]) <= threshold[joint]
        for first, end in pairwise(starts):
            part = still[first:end]
            count = np.arange(1, len(part) + 1)
            run = count - np.maximum.accumulate(np.where(part, 0, count))  # samples at rest so far, 0 in motion
            held = np.maximum.accumulate(np.where(part, count, 0))  # the last sample at rest, from 1
            result[first:end, joint] = np.where(held > 0, run[np.maximum(held - 1, 0)], 0) * step
    return result


def _filtered(signal: Numbers, time_constant: float, step: float, starts: NDArray[np.int64]) -> Numbers:
    """Return the signal, low-passed with a time constant in s, starting from 0 in each recording."""
    share = 1.0 - np.exp(-step / time_constant)
    parts = [lfilter([share], [1.0, share - 1.0], signal[first:end], axis=0) for first, end in pairwise(starts)]
    return np.concatenate(parts)


def _spline(signal: Numbers, knots: int) -> Numbers:
    """Return cubic splines over a signal [B]; [B, 0] if it is constant."""
    if np.ptp(signal) <= 1e-12 * max(1.0, float(np.abs(signal).max())):
        return np.empty((len(signal), 0))
    places = np.unique(np.quantile(signal, np.linspace(0.01, 0.99, knots)))
    if len(places) < 2:
        return signal[:, None]
    degree = min(3, len(places))
    before, after = np.diff(places)[[0, -1]]
    outer = np.arange(1, degree + 1)
    knot = np.concatenate([places[0] - before * outer[::-1], places, places[-1] + after * outer])
    curves = BSpline(knot, np.eye(len(places) + degree - 1), degree)
    inside = np.clip(signal, places[0], places[-1])
    values = curves(inside)
    out = np.flatnonzero(signal != inside)
    values[out] += (signal - inside)[out, None] * curves(inside[out], 1)
    return np.asarray(values)


def _bends(one: Numbers, two: Numbers) -> Numbers:
    """Return smooth functions of two signals together [B, 9]."""

    def polynomials(signal: Numbers) -> Numbers:
        low, high = np.quantile(signal, (0.01, 0.99))
        inside = np.clip(2.0 * (signal - low) / max(high - low, 1e-12) - 1.0, -1.2, 1.2)
        return np.polynomial.legendre.legvander(inside, 3)[:, 1:]

    products = polynomials(one)[:, :, None] * polynomials(two)[:, None, :]
    return products.reshape(len(one), -1)


def _joint(index: int) -> str:
    return f"joint {index + 1}"


def _of_angles(series: Series, states: _States) -> _Made:
    joints = series.angle.shape[1]
    for joint in range(joints):
        curve = _spline(series.angle[:, joint], 8)
        yield "angle", _joint(joint), _spline(series.angle[:, joint], RIPPLES)
        both = (states.side[:, joint, None], states.moving[:, joint, None])
        yield "friction over angle", _joint(joint), np.concatenate([curve * side for side in both], axis=1)
    for one, two in permutations(range(joints), 2):
        who = f"joints {min(one, two) + 1} and {max(one, two) + 1}"
        curve = _bends(series.angle[:, one], series.angle[:, two])
        yield "angle", who, curve if one < two else curve[:, :0]
        other = _spline(series.angle[:, two], 4)
        for side in (states.side[:, one, None], states.moving[:, one, None]):
            yield "friction over angle", who, np.concatenate([curve * side, other * side], axis=1)


def _of_velocities(series: Series, states: _States) -> _Made:
    for joint in range(series.velocity.shape[1]):
        ratio = series.velocity[:, joint] / states.speed[joint]
        steps = [np.tanh(ratio / scale) for scale in (0.03, 0.1, 0.3, 1.0)]
        yield "velocity", _joint(joint), np.stack([*steps, ratio, np.abs(ratio), ratio * np.abs(ratio)], axis=1)


def _of_forces(series: Series, states: _States) -> _Made:
    sides = states.side
    for tendon in range(series.force.shape[1]):
        force = series.force[:, tendon]
        scale = max(float(np.abs(force).max()), 1e-12)
        yield "force", f"tendon {tendon + 1}", _spline(force, 4)
        for joint in range(sides.shape[1]):
            who = f"tendon {tendon + 1} at joint {joint + 1}"
            load, angle = force / scale, series.angle[:, joint]
            both = (sides[:, joint], states.moving[:, joint])
            yield "friction over force", who, np.stack([load**k * side for side in both for k in (1, 2)], axis=1)
            yield "force", who, np.stack([load * angle, load * np.sin(2 * angle), load * angle**2], axis=1)


def _of_accelerations(series: Series, states: _States) -> _Made:
    joints = series.velocity.shape[1]
    for joint in range(joints):
        own = series.acceleration[:, joint]
        yield "acceleration", _joint(joint), np.stack([own, np.cos(series.angle[:, joint]) * own], axis=1)
    for one, two in combinations(range(joints), 2):
        product = series.velocity[:, one] * series.velocity[:, two] / (states.speed[one] * states.speed[two])
        yield "acceleration", f"joints {one + 1} and {two + 1}", product[:, None]


def _of_memory(series: Series, states: _States) -> _Made:
    starts, step = states.starts, series.step
    for joint in range(series.velocity.shape[1]):
        travel, side, moving = np.abs(series.travel[:, joint]), states.side[:, joint], states.moving[:, joint]
        stroke = max(float(np.quantile(travel, 0.9)), 1e-12)
        decays = [side * np.exp(-travel / (scale * stroke)) for scale in TRAVELS]
        yield "travel", _joint(joint), np.stack(decays, axis=1)
        signals = np.stack([side, np.abs(series.velocity[:, joint]) / states.speed[joint]], axis=1)
        past = np.stack([_filtered(signals, memory, step, starts) for memory in MEMORY], axis=2)
        yield "memory of direction", _joint(joint), past[:, 0]
        quick = [past[:, 1] * side[:, None], past[:, 1] * moving[:, None]]
        yield "memory of speed", _joint(joint), np.concatenate(quick, axis=1)
        angle = series.angle[:, joint, None] - series.angle[:, joint].mean()
        kept = [angle - _filtered(angle, memory, step, starts) for memory in MEMORY[:5]]
        yield "memory of angle", _joint(joint), np.concatenate(kept, axis=1)
        rested = np.log1p(states.rest[:, joint] / 0.1)
        columns = [rested, rested * side, rested * moving, rested * side * np.exp(-travel / (0.3 * stroke))]
        yield "rest", _joint(joint), np.stack(columns, axis=1)


def _of_states(series: Series, states: _States) -> _Made:
    for who, values in states_of(series, states.starts):
        yield "memory of angle" if who.startswith("joint") else "elastic", who, values


def _of_slides(series: Series, states: _States) -> _Made:
    """Yield columns for friction of a tendon that depends on how much and how fast it slid recently."""
    level = np.abs(series.force).mean(axis=0)
    for tendon in range(series.force.shape[1]):
        load = np.abs(series.force[:, tendon]) / level[tendon] if level[tendon] > 0.0 else np.ones(len(series.time))
        slip = series.tendon_velocity[:, tendon]
        ratio = np.abs(slip[:, 0]) / states.tendon_speed[tendon]
        signals = np.stack([np.minimum(ratio / 0.2, 1.0), ratio], axis=1)
        past = np.concatenate(
            [_filtered(signals, memory, series.step, states.starts) for memory in MEMORY[2:5]], axis=1
        )
        past -= past.mean(axis=0)
        side = _last_side(slip, np.full(slip.shape[1], MOVING * states.tendon_speed[tendon]), states.starts)
        columns = [past * (load * side[:, joint])[:, None] for joint in range(slip.shape[1])]
        yield "memory of speed", f"tendon {tendon + 1}", np.concatenate(columns, axis=1)


def _of_time(series: Series, states: _States) -> _Made:
    starts = run_starts(series.recording)
    since = series.time - np.repeat(series.time[starts[:-1]], np.diff(starts))
    curve = _spline(since, 4)
    for joint in range(series.velocity.shape[1]):
        ratio = series.velocity[:, joint] / states.speed[joint]
        moved = [curve * factor[:, None] for factor in (states.side[:, joint], states.moving[:, joint], ratio)]
        yield "time", _joint(joint), np.concatenate(moved, axis=1)


def _of_tendons(series: Series, states: _States) -> _Made:
    tendons, joints = series.tendon_velocity.shape[1:]
    mean_force = np.abs(series.force).mean(axis=0).clip(1e-12)
    load = series.force / mean_force
    for tendon in range(tendons):
        yield "position", f"tendon {tendon + 1}", _spline(series.position[:, tendon], RIPPLES)
        for joint in range(joints):
            ratio = series.tendon_velocity[:, tendon, joint] / states.tendon_speed[tendon]
            steps = [np.tanh(ratio / scale) for scale in (0.03, 0.1, 0.3)]
            values = np.stack([*steps, steps[1] * load[:, tendon]], axis=1)
            yield "tendon", f"tendon {tendon + 1}", values
    pairs = sorted(combinations(range(tendons), 2), key=lambda pair: pair[1] - pair[0])[:MOST_PAIRS]
    for one, two in pairs:
        pressed = np.sqrt(np.abs(load[:, one] * load[:, two]))
        for joint in range(joints):
            apart = series.tendon_velocity[:, one, joint] - series.tendon_velocity[:, two, joint]
            speed = max(float(np.quantile(np.abs(apart), 0.95)), 1e-15)
            step = np.tanh(apart / (0.05 * speed))
            values = np.stack([step, np.tanh(apart / (0.3 * speed)), step * pressed], axis=1)
            yield "rubbing", f"tendons {one + 1} and {two + 1}", values


def _interactions(series: Series, states: _States, rng: np.random.Generator) -> Numbers:
    """Return random waves of two or three states at a time, half of them with the sign of a motion."""
    ratio = series.velocity / states.speed
    recent = [_filtered(states.side, memory, series.step, states.starts) for memory in (0.3, 3.0)]
    table = np.concatenate(
        [series.angle, np.sign(ratio) * np.sqrt(np.abs(ratio)), series.force, np.abs(series.travel), *recent], axis=1
    )
    spread = table.std(axis=0)
    table = (table - table.mean(axis=0))[:, spread > 1e-12] / spread[spread > 1e-12]
    if not table.shape[1]:
        return np.empty((len(table), 0))
    columns = []
    for index in range(RANDOM):
        chosen = rng.choice(table.shape[1], size=min(table.shape[1], 2 + index % 2), replace=False)
        wave = np.cos(table[:, chosen] @ rng.normal(0.0, 1.2, len(chosen)) + rng.uniform(0.0, 2.0 * np.pi))
        side = states.side[:, rng.integers(states.side.shape[1])]
        columns.append(wave * side if index % 4 < 2 else wave)
    return np.stack(columns, axis=1)
