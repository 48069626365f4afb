"""Moment arms, stiffness and zeros of the tendons, learned from recordings with joint encoders.

Every sample of a taut tendon satisfies x0 = zero + R q + f0/k, whatever friction, contact and weight are. A regression
of x0 on q and f0 therefore gives the tendon's row of R, 1/k and its zero. Both sides are noisy: the noise of q and f0,
measured around a smooth curve, is taken out of their moments, else large noise would make the numbers too small
(W. A. Fuller, Measurement Error Models, 1987, sec. 2.2). The speeds of x0 and f0 are further columns, so that sensors
that are read some milliseconds apart do no harm. Behind edges and pulleys a cord bears less than f0 and stretches less,
by a share of f0 that follows which way it moved last: a stop operator of the travel at each level, times f0, is a
further column. Cords creep: a part of the stretch follows the force within seconds. Where that shows, by how much slow
stretches are behind the force are further columns: k is that of a load at rest, and a mean stretch is no zero. The
intervals are those of sums over blocks of 2 s, so that they hold for correlated residuals, too. Recordings of a
reference are regressed together with those of now: arms, 1/k and zero are free in both, and what the equation lacks
(curves) is shared, so that another load or range is no change.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from itertools import pairwise

import numpy as np
from scipy.signal import lfilter

from tendonfmu.arrays import Flags, Indices, Numbers
from tendonfmu.errors import InputError
from tendonfmu.model import Finger
from tendonfmu.recordings.faults import gaps, still_runs
from tendonfmu.recordings.recording import Recording
from tendonfmu.recordings.residuals import with_linear_springs
from tendonfmu.recordings.signal_noise import FEWEST, stopped, white_noise, zero_phase
from tendonfmu.statistics import Estimate, noisy_regression

BLOCK = 2.0  # s; longer than residuals of sensors are correlated
MOST = 60_000  # samples of a recording that are looked at: what is not noise is the same in its neighbours
FEWEST_BLOCKS = 8
SPEED_CUTOFF = 10.0  # Hz, of the speeds
SLACK = 0.02  # of a tendon's largest force: below, it does not follow its joints
CERTAIN = 1.5  # halves of an interval; many numbers are compared
SEEN_APART, APART = 0.05, 0.03  # of a stiffness that only other tendons show: its interval, and what differs
NORMAL = 1.96  # standard deviations of half an interval
KNOWN = 0.3  # of a number; one with a wider interval is not determined
OTHER = 0.002, 0.01, 1e-3  # by which an arm, a stiffness (of the number) and an angle (rad) differ from the described
LARGEST = 4.0, 30.0  # times the described arm or stiffness, or that part of it: beyond, columns are wrong
TURN = 0.001  # of the range of a travel, over which friction turns round; above the noise of angles
CREEP = 1.0, 3.0, 10.0  # s, of slow stretches: longer than strokes, shorter than recordings; any time is a mixture
CANCEL = 2.0  # times the sum of parts of a creep: all are above 0 but for their errors
SLOW = 0.02  # s, between samples of what turns round
RIGID = 1e-6  # of the motion of a position: a smaller stretch is none
LEAST_DRIFT = 5e-6  # s/s of a clock against another
DEGREE, FAR = 5, 1.2  # of polynomials, and times half of the range, beyond which they are constant
BLOCKS_PER_COLUMN = 1.5  # at least; fewer columns else
VARIES = 0.03  # of an arm, by which it changes over the motion


@dataclass(frozen=True)
class Learned:
    """A number that recordings show: its estimate, and what is described or was in the reference."""

    path: str
    value: float
    half: float  # of the 95 % interval of the value, or of its difference from that of the reference
    described: float
    is_known: bool  # whether the recordings determine it
    material: float  # a smaller difference is none
    p_value: float = 1.0  # of there being no difference

    @property
    def differs(self) -> bool:
        """Whether the described number is another one."""
        return self.is_known and abs(self.off) > self.known_to

    @property
    def known_to(self) -> float:
        """The smallest difference that counts."""
        return max(CERTAIN * self.half, self.material)

    @property
    def off(self) -> float:
        """By how much it is larger than described."""
        return self.value - self.described

    @property
    def is_absurd(self) -> bool:
        """Whether columns must be wrong, so that nothing is known of it."""
        if not self.is_known or not self.described or self.path.endswith("zero"):
            return False
        most = LARGEST["stiffness" in self.path]
        return not 1.0 / most < self.value / self.described < most

    @property
    def rounded(self) -> float:
        """The value with a digit more than its interval shows."""
        digits = int(np.ceil(np.log10(max(abs(self.value) / max(self.half, 1e-15), 1.0)))) + 2
        return float(f"{self.value:.{digits}g}")


@dataclass(frozen=True)
class TendonRouting:
    """What recordings show of a tendon's way to the joints."""

    tendon: int  # from 0
    arms: Mapping[int, Learned]  # by joint, from 0; of the joints that it passes
    stiffness: Learned
    zero: Learned
    varying: Mapping[int, float]  # joints at which the arm changes with the angle, by so much of it over the motion
    drift: Learned  # s/s, by which the clock of the angles runs faster than that of the tendon
    span: Numbers  # of the angles and the force: middle and half of the range [2, joints + 1]
    seen_from: Sequence[int] = ()  # without encoders: the tendons whose positions give the angles

    @property
    def numbers(self) -> list[Learned]:
        """All its numbers."""
        return [*self.arms.values(), self.stiffness, self.zero]

    @property
    def differs(self) -> bool:
        """Whether any of its numbers is another one than described."""
        return any(number.differs for number in self.numbers)

    @property
    def as_described(self) -> TendonRouting:
        """Without numbers that differ; what varies stays."""
        arms = {j: replace(arm, is_known=False) for j, arm in self.arms.items()}
        stiffness, zero = (replace(number, is_known=False) for number in (self.stiffness, self.zero))
        return replace(self, arms=arms, stiffness=stiffness, zero=zero)

    @property
    def unknown(self) -> list[str]:
        """Paths of the numbers that the motion cannot tell."""
        return [number.path for number in self.numbers if not number.is_known]


def learn_routing(
    finger: Finger, recordings: Sequence[Recording], reference: Sequence[Recording] = (), *, coupled: bool = False
) -> list[TendonRouting]:
    """Learn the routing of the tendons that the recordings show; arms at joints they do not pass, too, if `coupled`."""
    # Recordings without `joint_position` count only where there are no others: then redundant tendons show every
    # stiffness, and at a single joint the arms and zeros of one against the other. What a reference of the same finger
    # shows is compared with, in place of what is described.
    for recording in (*recordings, *reference):
        recording.require(finger.joints, finger.tendons, ())
    sides = [[with_linear_springs(finger, each) for each in side] for side in (recordings, reference) if side]
    measured = [[each for each in side if "joint_position" in each.groups] for side in sides]
    if not all(measured):
        return _of_redundancy(finger, sides)
    if (samples := _joined(measured, np.asarray(finger.moment_arms))) is None:
        return []
    return [each for i in range(finger.tendons) if (each := _of_tendon(finger, i, samples, coupled=coupled))]


def _of_redundancy(finger: Finger, sides: Sequence[Sequence[Recording]]) -> list[TendonRouting]:
    """Learn each tendon from angles that as many others as there are joints show.

    That determines every stiffness, and at a single joint the arms and zeros of the spare tendons against those of the
    first, which stay as described. At several joints arms that are off mix the angles: no arm is known by itself.
    """
    arms = np.asarray(finger.moment_arms)
    kept = _independent(arms, range(finger.tendons))
    found = []
    for i in range(finger.tendons):
        base = _independent(arms, [j for j in (kept if i not in kept else range(finger.tendons)) if j != i])
        if len(base) < finger.joints:
            continue
        arm = arms[base, 0] if finger.joints == 1 else 1.0  # of several joints, positions tell as much as angles
        zeros = np.array([float(finger.data["tendons"][j].get("zero") or 0.0) for j in base])
        seen = [[_seen(each, base, zeros, arm) for each in side] for side in sides]
        samples = _joined(seen, arms[:, :0])
        learned = None if samples is None else _of_tendon(finger, i, samples, base)
        if learned is not None:
            is_alone = i in kept or finger.joints > 1
            arms_of = {j: replace(arm, is_known=arm.is_known and not is_alone) for j, arm in learned.arms.items()}
            zero = replace(learned.zero, is_known=learned.zero.is_known and not is_alone)
            stiffness = learned.stiffness
            is_known = stiffness.is_known and stiffness.half < SEEN_APART * stiffness.value
            stiffness = replace(stiffness, is_known=is_known)
            found.append(replace(learned, arms=arms_of, stiffness=stiffness, zero=zero, varying={}, seen_from=base))
    # All tendons stand in one equation. If one is off, the others count, too, where they are off by less.
    apart = [replace(each.stiffness, material=APART * each.stiffness.described) for each in found]
    if any(stiffness.differs for stiffness in apart):
        return found
    return [replace(each, stiffness=stiffness) for each, stiffness in zip(found, apart, strict=True)]


def _seen(recording: Recording, base: list[int], zeros: Numbers, arm: Numbers | float) -> Recording:
    """Return a recording with what the positions of other tendons show in place of the angles."""
    angle = (recording.groups["tendon_position"][:, base] - zeros) / arm
    return replace(recording, groups={**recording.groups, "joint_position": angle})


def _independent(arms: Numbers, tendons: Iterable[int]) -> list[int]:
    """Choose, of these tendons, as many whose arms are independent as there are joints, or fewer."""
    chosen: list[int] = []
    for i in sorted(tendons, key=lambda i: -float(np.abs(arms[i]).max())):
        if np.linalg.matrix_rank(arms[[*chosen, i]]) > len(chosen):
            chosen.append(i)
    return sorted(chosen)


def require_routing(finger: Finger, recordings: Sequence[Recording]) -> list[TendonRouting]:
    """Learn the routing, which was asked for. Raises InputError if the recordings do not show it."""
    learned = learn_routing(finger, recordings)
    if not learned:
        raise InputError(
            f"{recordings[0].path}: no routing can be learned; expected joint_position, or more tendons "
            f"than joints, and {FEWEST_BLOCKS * BLOCK:g} s of motion with taut tendons"
            if recordings
            else "no recording; expected at least one"
        )
    if any(number.is_absurd for each in learned for number in each.numbers):
        wrong = "the columns do not belong to the description; tendonfmu check says what is wrong"
        raise InputError(f"{recordings[0].path}: no routing can be learned: {wrong}")
    return learned


def routed(finger: Finger, learned: Sequence[TendonRouting]) -> tuple[Finger, list[Learned]]:
    """Return the finger with the numbers that differ, and these; the given one if its columns must be wrong."""
    numbers = [number for each in learned for number in each.numbers]
    moved = [number for number in numbers if number.differs]
    if not moved or any(number.is_absurd for number in numbers):
        return finger, []
    data = {**finger.data, "tendons": [dict(tendon) for tendon in finger.data["tendons"]]}
    for each in learned:
        tendon = data["tendons"][each.tendon]
        arms = list(tendon["moment_arms"])
        for j, number in each.arms.items():
            arms[j] = number.rounded if number.differs else arms[j]
        tendon["moment_arms"] = arms
        tendon |= {"stiffness": each.stiffness.rounded} if each.stiffness.differs else {}
        tendon |= {"zero": each.zero.rounded} if each.zero.differs else {}
    errors = {number.path: [number.rounded, float(f"{number.half / NORMAL:.4g}")] for number in moved}
    data["estimated"] = {**(data.get("estimated") or {}), **errors}
    return finger.with_data(data), moved


def clock_drift(learned: Sequence[TendonRouting]) -> Learned | None:
    """Return how much faster (s/s) the clock of the joint positions runs than that of the tendons; None: not known."""
    known = [each.drift for each in learned if each.drift.is_known]
    if not known:
        return None
    weights = np.array([each.half for each in known]) ** -2.0
    value = float(np.average([each.value for each in known], weights=weights))
    half = max(min(each.half for each in known), float(np.median([abs(each.value - value) for each in known])))
    return replace(known[0], value=value, half=half)


# --- samples ----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Samples:
    """What the regressions read: signals [N, m] and [N, n], variances of their noise, and numbers of blocks [N]."""

    position: Numbers
    force: Numbers
    angle: Numbers
    position_speed: Numbers
    force_speed: Numbers
    behind: Numbers  # [N, m, times] how far slow stretches of the cords are behind the forces, N
    force_noise: Numbers
    angle_noise: Numbers
    held: Numbers  # [N, m, levels] what friction on the way may hold of each force
    block: Indices
    side: Indices  # [N] 0 now, 1 of the reference
    sound: Flags  # [N, m] no sensor of the tendon, and no encoder, is held


def _samples(recording: Recording, side: int, arms: Numbers) -> _Samples | None:
    groups, time = recording.groups, recording.time
    try:
        noise = {name: white_noise(time, groups[name]) ** 2 for name in ("tendon_force", "joint_position")}
    except InputError:  # gaps everywhere
        return None
    sound = _changing(time, groups["tendon_force"]) & _changing(time, groups["tendon_position"])
    sound &= np.asarray(_changing(time, groups["joint_position"]).all(axis=1))[:, None]
    rows = slice(None, None, max(1, len(time) // MOST))
    return _Samples(
        groups["tendon_position"][rows],
        groups["tendon_force"][rows],
        groups["joint_position"][rows],
        smooth_speeds(time, groups["tendon_position"])[rows],
        smooth_speeds(time, groups["tendon_force"])[rows],
        _behind(time, groups["tendon_force"])[rows],
        noise["tendon_force"],
        noise["joint_position"],
        held_on_the_way(recording, arms)[rows],
        np.floor((time[rows] - time[0]) / BLOCK).astype(np.int64),
        np.full(len(time[rows]), side),
        sound[rows],
    )


def _joined(sides: Sequence[Sequence[Recording]], arms: Numbers) -> _Samples | None:
    """Put the samples of recordings with joint positions together; None if a side has none."""
    of = [(k, each) for k, side in enumerate(sides) for each in side if len(each) >= FEWEST]
    parts = [found for k, each in of if (found := _samples(each, k, arms)) is not None]
    if len({int(each.side[0]) for each in parts}) < max(len(sides), 1):
        return None
    first = np.cumsum([0, *(int(each.block[-1]) + 1 for each in parts)])
    size = [len(each.block) for each in parts]
    whole = {
        field.name: np.average([getattr(each, field.name) for each in parts], axis=0, weights=size)
        if field.name.endswith("noise")
        else np.concatenate([getattr(each, field.name) for each in parts])
        for field in fields(_Samples)
    }
    whole["block"] += np.repeat(first[:-1], size)
    return _Samples(**whole)


def held_on_the_way(recording: Recording, arms: Numbers) -> Numbers:
    """Return what friction at each level may hold of a tendon's force [N, m, levels], N; arms [m, n], or [m, 0]."""
    force, position = (recording.groups[name] for name in ("tendon_force", "tendon_position"))
    beyond = [recording.groups["joint_position"][:, j:] @ arms[:, j:].T for j in range(arms.shape[1])]
    travel = np.stack(beyond or [position], axis=2)
    step = float(np.median(np.diff(recording.time)))
    every = max(1, round(SLOW / step))
    slow = travel[::every].reshape(-1, travel.shape[1] * travel.shape[2])
    width = np.ptp(slow, axis=0) * TURN
    state = stopped(
        slow, np.where(width > 0.0, width, 1.0), np.full(len(width), np.inf), step, np.array([0, len(slow)])
    )
    return np.asarray(np.repeat(state, every, axis=0)[: len(force)].reshape(travel.shape) * force[:, :, None])


def _changing(time: Numbers, values: Numbers) -> Flags:
    """Return the samples [N, c] in which a column does not repeat one value for long."""
    changing = np.ones(values.shape, dtype=bool)
    for k, column in enumerate(values.T):
        for begin, end in still_runs(time, column):
            changing[begin:end, k] = False
    return changing


def smooth_speeds(time: Numbers, values: Numbers) -> Numbers:
    """Compute the smooth derivatives [N, c] between gaps; 0 in pieces too short to smooth."""
    speeds = np.zeros_like(values)
    for begin, end in pairwise([0, *gaps(time), len(time)]):
        if end - begin >= FEWEST:
            rate = 1.0 / float(np.median(np.diff(time[begin:end])))
            smooth = zero_phase(values[begin:end], SPEED_CUTOFF, rate)
            speeds[begin:end] = np.gradient(smooth, time[begin:end], axis=0)
    return speeds


def is_creep(parts: Numbers) -> bool:
    """Return whether slow stretches [times] can be those of a cord: above 0 but for their errors."""
    return bool(np.abs(parts).sum() < CANCEL * parts.sum())


def _behind(time: Numbers, force: Numbers) -> Numbers:
    """Return how far the slow stretches of the cords are behind the forces [N, m, times], N; none after a gap."""
    behind = np.zeros((*force.shape, len(CREEP)))
    for begin, end in pairwise([0, *gaps(time), len(time)]):
        if end - begin >= FEWEST:
            step = float(np.median(np.diff(time[begin:end])))
            smooth = zero_phase(force[begin:end], SPEED_CUTOFF, 1.0 / step)
            for k, kept in enumerate(np.exp(-step / np.array(CREEP))):
                slow, _ = lfilter([1.0 - kept], [1.0, -kept], smooth, axis=0, zi=kept * smooth[:1])
                behind[begin:end, :, k] = slow - smooth
    return behind


def _span(values: Numbers) -> Numbers:
    """Return the middle and half of the range of columns [2, c]."""
    low, high = np.quantile(values, [0.01, 0.99], axis=0)
    return np.asarray([(low + high) / 2.0, np.maximum((high - low) / 2.0, 1e-12)])


def curves(values: Numbers, span: Numbers, degree: int = DEGREE) -> Numbers:
    """Return what the equation lacks where springs or arms are not constant: powers of columns [N, c (d - 1)]."""
    scaled = np.clip((values - span[0]) / span[1], -FAR, FAR)
    return np.asarray(np.concatenate([scaled**k for k in range(2, degree + 1)] or [scaled[:, :0]], axis=1))


# --- one tendon -------------------------------------------------------------------------------------------------------


def _of_tendon(
    finger: Finger, i: int, samples: _Samples, seen_from: Sequence[int] = (), *, coupled: bool = False
) -> TendonRouting | None:
    """Learn the numbers of a tendon. The angles are those of encoders, or seen from other tendons."""
    tendon = finger.data["tendons"][i]
    arms = np.asarray(tendon["moment_arms"], dtype=float)
    joints = np.arange(finger.joints) if seen_from or coupled else np.flatnonzero(arms)
    force = np.abs(samples.force)
    taut = ((force > SLACK * force.max(axis=0)) & samples.sound)[:, [i, *seen_from]].all(axis=1)
    block, side = samples.block[taut], samples.side[taut]
    sides = int(samples.side.max()) + 1
    if any(len(np.unique(block[side == k])) < FEWEST_BLOCKS for k in range(sides)):
        return None
    own = np.column_stack([samples.angle[:, joints], samples.force[:, i]])[taut]
    held = samples.held[taut][:, [i, *seen_from]].reshape(len(block), -1)
    many = len(np.unique(block))
    held = held[:, held.any(axis=0) & (many > FEWEST_BLOCKS + BLOCKS_PER_COLUMN * held.shape[1])]
    shared = np.column_stack(
        [
            samples.position_speed[:, i],
            samples.force_speed[:, i],
            # an angle that is read later and later leaves a part that grows with speed and time
            samples.position_speed[:, i] * BLOCK * (samples.block - samples.block.mean()),
            samples.force[:, list(seen_from)],
        ]
    )
    shared = np.column_stack([shared[taut], held])
    noise = np.array([*samples.angle_noise[joints], samples.force_noise[i]])
    noise_shared = np.array([0.0, 0.0, 0.0, *samples.force_noise[list(seen_from)], *np.zeros(held.shape[1])])
    count, position = len(joints), samples.position[taut, i]
    span = _span(own)
    degree = DEGREE if sides > 1 else 1
    while degree > 1 and many < BLOCKS_PER_COLUMN * own.shape[1] * (sides + degree - 1):
        degree -= 1
    lacking = curves(own, span, degree)

    def regression(own: Numbers, lacking: Numbers, behind: Numbers) -> Estimate | None:
        columns = np.column_stack([*([own] * sides), shared, behind, lacking])
        variance = np.append(noise, np.zeros(own.shape[1] - len(noise)))
        free = np.zeros(behind.shape[1] + lacking.shape[1])
        all_noise = np.array([*np.tile(variance, sides), *noise_shared, *free])
        return noisy_regression(columns, all_noise, position, block, side, own.shape[1])

    found, behind = regression(own, lacking, np.zeros((len(block), 0))), samples.behind[taut, i]
    # Without encoders the cords of the other tendons creep, too: more than a motion can tell apart.
    creeps = not seen_from and many > FEWEST_BLOCKS + BLOCKS_PER_COLUMN * (held.shape[1] + len(CREEP))
    if creeps:  # of whatever time: it shows in a column of the middle one, and in parts that do not cancel
        at = own.shape[1] * sides + shared.shape[1]
        one, whole = (regression(own, lacking, each) for each in (behind[:, [len(CREEP) // 2]], behind))
        slow, half, _ = one.difference(at) if one is not None else (0.0, 0.0, 1.0)
        parts = whole.value[at : at + len(CREEP)] if whole is not None else np.zeros(1)
        creeps = slow > CERTAIN * half and is_creep(parts)
        found = whole if creeps else found
    behind = behind if creeps else behind[:, :0]
    if found is None:
        return None
    first = own.shape[1] * sides
    drift, drift_half, _ = found.difference(first + 2)
    finite = np.isfinite([found.difference(k, k + own.shape[1] if sides > 1 else None)[1] for k in range(count)])
    is_whole = bool(finite[arms[joints] != 0.0].all())  # else the zero has a part of a joint that stands still

    def learned(path: str, at: int, then: int, described: float, least: float, found: Estimate = found) -> Learned:
        value, half, p_value = found.difference(at, then if sides > 1 else None)
        before = value - found.change(at, then) if sides > 1 else described
        return Learned(f"tendons[{i + 1}].{path}", value, half, before, True, least, p_value)

    arm = float(np.abs(arms).max())
    arms_of = {
        int(j): learned(f"moment_arms[{j + 1}]", k, k + own.shape[1], float(arms[j]), OTHER[0] * abs(arms[j] or arm))
        for k, j in enumerate(joints)
        if arms[j] != 0.0 or (coupled and not seen_from)
    }
    least = RIGID * float(position.std()) / max(float(own[:, -1].std()), 1e-12)
    compliance = learned("stiffness", count, count + own.shape[1], 1.0 / float(tendon["stiffness"]), least)
    stiffness = _stiffness(compliance)
    at_zero, given = ("zero", -sides, -1, float(tendon.get("zero") or 0.0), OTHER[2] * arm), None
    zero = learned(*at_zero)
    if sides > 1 and stiffness.differs:  # what is not linear in it is another, too, and with it where its force is 0
        given = regression(np.column_stack([own, own[:, -1] ** 2]), curves(own[:, :-1], span[:, :-1], degree), behind)
    if given is not None:
        bent = learned(*at_zero, given)
        zero = replace(bent, described=zero.described, value=zero.described + bent.off)
    return TendonRouting(
        i,
        {j: replace(each, is_known=each.half < KNOWN * abs(each.value)) for j, each in arms_of.items()},
        stiffness,
        replace(zero, is_known=is_whole and zero.half < KNOWN * arm),
        dict(_varying(lambda squares: regression(own, squares, behind), own, joints)) if sides == 1 else {},
        Learned("time", -drift, drift_half, 0.0, bool(np.isfinite(drift_half)), LEAST_DRIFT),
        span,
    )


def _stiffness(compliance: Learned) -> Learned:
    """Return the stiffness of a compliance, whose `material` is the least that there can be."""
    least = compliance.material
    is_known = min(compliance.value, compliance.described) > least and compliance.half < KNOWN * compliance.value
    value, described = (1.0 / each if each > 0.0 else np.inf for each in (compliance.value, compliance.described))
    value = value if compliance.value > 0.0 else described
    half = compliance.half * value**2
    return replace(
        compliance, value=value, half=half, described=described, is_known=is_known, material=OTHER[1] * described
    )


def _varying(
    regression: Callable[[Numbers], Estimate | None], own: Numbers, joints: Indices
) -> Iterator[tuple[int, float]]:
    """Yield (joint, share) where the arm changes with the joint's angle: x0 then has a part with its square."""
    count = len(joints)
    found = regression((own[:, :count] - own[:, :count].mean(axis=0)) ** 2)
    if found is None:
        return
    for k, j in enumerate(joints):
        (bend, bend_half, _), (arm, half, _) = found.difference(-1 - count + k), found.difference(k)
        change = 2.0 * abs(bend) * float(np.ptp(own[:, k])) / max(abs(arm), 1e-12)
        if abs(bend) > 1.5 * bend_half and change > VARIES and half < KNOWN * abs(arm):
            yield int(j), change
