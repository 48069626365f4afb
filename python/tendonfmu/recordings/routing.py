"""Moment arms, stiffness and zeros of the tendons, learned from recordings with joint encoders.

Every sample of a taut tendon satisfies x0 = zero + R q + f0/k, whatever friction, contact and weight are. A regression
of x0 on q and f0 therefore gives the tendon's row of R, 1/k and its zero. Both sides are noisy: the noise of q and f0,
measured around a smooth curve, is taken out of their moments, else large noise would make the numbers too small
(W. A. Fuller, Measurement Error Models, 1987, sec. 2.2). The speeds of x0 and f0 are further columns, so that sensors
that are read some milliseconds apart do no harm. The intervals are those of sums over blocks of 2 s, so that they hold
for correlated residuals, too.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from itertools import pairwise

import numpy as np
from scipy.special import stdtrit

from tendonfmu.arrays import Flags, Indices, Numbers
from tendonfmu.errors import InputError
from tendonfmu.model import Finger, finger_from_data
from tendonfmu.recordings.faults import gaps, still_runs
from tendonfmu.recordings.recording import Recording
from tendonfmu.recordings.signal_noise import FEWEST, white_noise
from tendonfmu.recordings.smoothing import zero_phase

BLOCK = 2.0  # s; longer than residuals of sensors are correlated
FEWEST_BLOCKS = 8
LEVEL = 0.975  # of Student's t: intervals of 95 %
SPEED_CUTOFF = 10.0  # Hz, of the speeds
SLACK = 0.02  # of a tendon's largest force: below, it does not follow its joints
CERTAIN = 1.5  # halves of an interval; many numbers are compared
SEEN_APART = 0.05  # of a stiffness that only other tendons show: its interval, and what differs
KNOWN = 0.3  # of a number; one with a wider interval is not determined
OTHER = 0.002, 0.01, 1e-3  # by which an arm, a stiffness (of the number) and an angle (rad) differ from the described
LARGEST = 4.0, 30.0  # times the described arm or stiffness, or that part of it: beyond, columns are wrong
OF_NOISE = 0.05  # of the variance in any direction of the columns: with more, they do not tell
NOISE_KNOWN = 0.2  # of its variance, to which the noise is known
RIGID = 1e-6  # of the motion of a position: a smaller stretch is none
LEAST_DRIFT = 5e-6  # s/s of a clock against another
VARIES = 0.03  # of an arm, by which it changes over the motion


@dataclass(frozen=True)
class Learned:
    """A number that recordings show: its estimate, half of its 95 % interval, and what is described."""

    path: str
    value: float
    half: float
    described: float
    is_known: bool  # whether the recordings determine it
    material: float  # a smaller difference is none

    @property
    def differs(self) -> bool:
        """Whether the described number is another one."""
        off = abs(self.value - self.described)
        return self.is_known and off > max(CERTAIN * self.half, self.material)


@dataclass(frozen=True)
class TendonRouting:
    """What recordings show of a tendon's way to the joints."""

    tendon: int  # from 0
    arms: Mapping[int, Learned]  # by joint, from 0; of the joints that it passes
    stiffness: Learned
    zero: Learned
    varying: Mapping[int, float]  # joints at which the arm changes with the angle, by so much of it over the motion
    drift: Learned  # s/s, by which the clock of the angles runs faster than that of the tendon
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
    def unknown(self) -> list[str]:
        """Paths of the numbers that the motion cannot tell."""
        return [number.path for number in self.numbers if not number.is_known]


def learn_routing(finger: Finger, recordings: Sequence[Recording]) -> list[TendonRouting]:
    """Learn the routing of every tendon from the recordings with joint positions.

    Parameters
    ----------
    finger
        Says which tendon passes which joint (a moment arm that is not 0), and the numbers to compare with.
    recordings
        Those without `joint_position` do not count, but where there are no others: then redundant tendons show
        every stiffness, and at a single joint the arms and zeros of one against the other.

    Returns
    -------
    list of TendonRouting
        In the order of the tendons, without those that are slack or whose recordings are too short.
    """
    for recording in recordings:
        recording.require(finger.joints, finger.tendons, ())
    measured = [each for each in recordings if "joint_position" in each.groups]
    if not measured:
        return _of_redundancy(finger, recordings)
    if (samples := _joined(measured)) is None:
        return []
    return [each for i in range(finger.tendons) if (each := _of_tendon(finger, i, samples)) is not None]


def _of_redundancy(finger: Finger, recordings: Sequence[Recording]) -> list[TendonRouting]:
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
        seen = [
            replace(
                each, groups={**each.groups, "joint_position": (each.groups["tendon_position"][:, base] - zeros) / arm}
            )
            for each in recordings
        ]
        samples = _joined(seen)
        learned = None if samples is None else _of_tendon(finger, i, samples, base)
        if learned is not None:
            is_alone = i in kept or finger.joints > 1
            arms_of = {j: replace(arm, is_known=arm.is_known and not is_alone) for j, arm in learned.arms.items()}
            zero = replace(learned.zero, is_known=learned.zero.is_known and not is_alone)
            stiffness = learned.stiffness
            is_known = stiffness.is_known and stiffness.half < SEEN_APART * stiffness.value
            stiffness = replace(stiffness, is_known=is_known, material=SEEN_APART * stiffness.described)
            found.append(replace(learned, arms=arms_of, stiffness=stiffness, zero=zero, varying={}, seen_from=base))
    return found


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
    if any(_is_absurd(number) for each in learned for number in each.numbers if number.is_known):
        raise InputError(
            f"{recordings[0].path}: the columns do not belong to the description, so no routing can be learned; "
            "tendonfmu check says what is wrong"
        )
    return learned


def routed(finger: Finger, learned: Sequence[TendonRouting]) -> tuple[Finger, list[Learned]]:
    """Return the finger with the numbers that differ, and these; the given one if its columns must be wrong."""
    known = [number for each in learned for number in each.numbers if number.is_known]
    if any(_is_absurd(number) for number in known):
        return finger, []
    moved = [number for number in known if number.differs]
    if not moved:
        return finger, []
    data = {**finger.data, "tendons": [dict(tendon) for tendon in finger.data["tendons"]]}
    for each in learned:
        tendon = data["tendons"][each.tendon]
        arms = list(tendon["moment_arms"])
        for j, number in each.arms.items():
            arms[j] = _rounded(number) if number.differs else arms[j]
        tendon["moment_arms"] = arms
        tendon |= {"stiffness": _rounded(each.stiffness)} if each.stiffness.differs else {}
        tendon |= {"zero": _rounded(each.zero)} if each.zero.differs else {}
    return finger_from_data(data, finger.path), moved


def _is_absurd(number: Learned) -> bool:
    if number.path.endswith("zero"):
        return False
    ratio, most = number.value / number.described, LARGEST["stiffness" in number.path]
    return not 1.0 / most < ratio < most


def _rounded(number: Learned) -> float:
    """Round to a digit more than its interval shows."""
    digits = int(np.ceil(np.log10(max(abs(number.value) / max(number.half, 1e-15), 1.0)))) + 2
    return float(f"{number.value:.{digits}g}")


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
    force_noise: Numbers
    angle_noise: Numbers
    block: Indices
    sound: Flags  # [N, m] no sensor of the tendon, and no encoder, is held


def _samples(recording: Recording) -> _Samples | None:
    groups, time = recording.groups, recording.time
    try:
        noise = {name: white_noise(time, groups[name]) ** 2 for name in ("tendon_force", "joint_position")}
    except InputError:  # gaps everywhere
        return None
    return _Samples(
        groups["tendon_position"],
        groups["tendon_force"],
        groups["joint_position"],
        _speeds(time, groups["tendon_position"]),
        _speeds(time, groups["tendon_force"]),
        noise["tendon_force"],
        noise["joint_position"],
        np.floor((time - time[0]) / BLOCK).astype(np.int64),
        _changing(time, groups["tendon_force"])
        & _changing(time, groups["tendon_position"])
        & np.asarray(_changing(time, groups["joint_position"]).all(axis=1))[:, None],
    )


def _joined(recordings: Sequence[Recording]) -> _Samples | None:
    """Put the samples of recordings with joint positions together; None if there are none."""
    parts = [found for each in recordings if len(each) >= FEWEST and (found := _samples(each)) is not None]
    if not parts:
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


def _changing(time: Numbers, values: Numbers) -> Flags:
    """Return the samples [N, c] in which a column does not repeat one value for long."""
    changing = np.ones(values.shape, dtype=bool)
    for k, column in enumerate(values.T):
        for begin, end in still_runs(time, column):
            changing[begin:end, k] = False
    return changing


def _speeds(time: Numbers, values: Numbers) -> Numbers:
    """Compute the smooth derivatives [N, c] between gaps; 0 in pieces too short to smooth."""
    speeds = np.zeros_like(values)
    for begin, end in pairwise([0, *gaps(time), len(time)]):
        if end - begin >= FEWEST:
            rate = 1.0 / float(np.median(np.diff(time[begin:end])))
            smooth = zero_phase(values[begin:end], SPEED_CUTOFF, rate)
            speeds[begin:end] = np.gradient(smooth, time[begin:end], axis=0)
    return speeds


# --- one tendon -------------------------------------------------------------------------------------------------------


def _of_tendon(finger: Finger, i: int, samples: _Samples, seen_from: Sequence[int] = ()) -> TendonRouting | None:
    """Learn the numbers of a tendon. The angles are those of encoders, or seen from other tendons."""
    tendon = finger.data["tendons"][i]
    arms = np.asarray(tendon["moment_arms"], dtype=float)
    joints = np.arange(finger.joints) if seen_from else np.flatnonzero(arms)
    force = np.abs(samples.force)
    taut = ((force > SLACK * force.max(axis=0)) & samples.sound)[:, [i, *seen_from]].all(axis=1)
    block = samples.block[taut]
    if len(np.unique(block)) < FEWEST_BLOCKS:
        return None
    columns = np.column_stack(
        [
            samples.angle[:, joints],
            samples.force[:, i],
            samples.position_speed[:, i],
            samples.force_speed[:, i],
            # an angle that is read later and later leaves a part that grows with speed and time
            samples.position_speed[:, i] * BLOCK * (samples.block - samples.block.mean()),
            samples.force[:, list(seen_from)],
        ]
    )[taut]
    others = samples.force_noise[list(seen_from)]
    noise = np.array([*samples.angle_noise[joints], samples.force_noise[i], 0.0, 0.0, 0.0, *others])
    position = samples.position[taut, i]
    found = _regression(columns, noise, position, block)
    if found is None:
        return None
    value, half = found
    is_whole = all(np.isfinite(half[: len(joints)]))  # else the zero has a part of a joint that stands still
    learned = {
        int(j): _arm(f"tendons[{i + 1}].moment_arms[{j + 1}]", value[k], half[k], float(arms[j]))
        for k, j in enumerate(joints)
        if arms[j] != 0.0
    }
    at, least = len(joints), RIGID * float(position.std()) / max(float(columns[:, len(joints)].std()), 1e-12)
    arm = float(np.abs(arms).max())
    return TendonRouting(
        i,
        learned,
        _stiffness(f"tendons[{i + 1}].stiffness", value[at], half[at], float(tendon["stiffness"]), least),
        Learned(
            f"tendons[{i + 1}].zero",
            value[-1],
            half[-1],
            float(tendon.get("zero") or 0.0),
            is_whole and half[-1] < KNOWN * arm,
            OTHER[2] * arm,
        ),
        dict(_varying(columns, noise, position, block, joints)),
        Learned("time", -value[at + 3], half[at + 3], 0.0, bool(np.isfinite(half[at + 3])), LEAST_DRIFT),
    )


def _arm(path: str, value: float, half: float, described: float) -> Learned:
    return Learned(path, value, half, described, half < KNOWN * abs(value), OTHER[0] * abs(described))


def _stiffness(path: str, compliance: float, half: float, described: float, least: float) -> Learned:
    is_known = compliance > least and half < KNOWN * compliance
    value = 1.0 / compliance if compliance > 0.0 else described
    return Learned(path, value, half * value**2, described, is_known, OTHER[1] * described)


def _varying(
    columns: Numbers, noise: Numbers, position: Numbers, block: Indices, joints: Indices
) -> Iterator[tuple[int, float]]:
    """Yield (joint, share) where the arm changes with the joint's angle: x0 then has a part with its square."""
    count = len(joints)
    middle = columns[:, :count].mean(axis=0)
    squares = (columns[:, :count] - middle) ** 2
    found = _regression(np.column_stack([columns, squares]), np.append(noise, np.zeros(count)), position, block)
    if found is None:
        return
    value, half = found
    for k, j in enumerate(joints):
        bend, arm = value[columns.shape[1] + k], abs(value[k])
        change = 2.0 * abs(bend) * float(np.ptp(columns[:, k])) / max(arm, 1e-12)
        if abs(bend) > 1.5 * half[columns.shape[1] + k] and change > VARIES and half[k] < KNOWN * arm:
            yield int(j), change


def _regression(
    columns: Numbers, noise: Numbers, target: Numbers, block: Indices
) -> tuple[list[float], list[float]] | None:
    """Regress on noisy columns and a constant, which comes last: estimates [p + 1] and halves of their intervals."""
    # columns: [N, p]; noise: [p] variances of the columns; target: [N]; block: [N]
    used = columns.var(axis=0) > np.maximum(4.0 * noise, 1e-24)  # others stand still; what they do is not known
    middle, scale = columns[:, used].mean(axis=0), columns[:, used].std(axis=0)
    design = np.column_stack([(columns[:, used] - middle) / scale, np.ones(len(columns))])
    of_noise = np.diag(np.append(noise[used] / scale**2, 0.0))
    moments = design.T @ design - len(design) * of_noise
    _, number = np.unique(block, return_inverse=True)
    blocks, free = int(number.max()) + 1, int(number.max()) + 1 - design.shape[1]
    if free < 1 or np.linalg.eigvalsh(moments)[0] < 1e-9 * len(design):
        return None
    share = float(np.linalg.eigvals(np.linalg.solve(design.T @ design, len(design) * of_noise)).real.max())
    if share > OF_NOISE:
        return None
    inverse = np.linalg.inv(moments)
    beta = inverse @ (design.T @ target)
    scores = np.zeros((blocks, len(beta)))
    np.add.at(scores, number, design * (target - design @ beta)[:, None])
    scores += np.bincount(number)[:, None] * (of_noise @ beta)
    covariance = inverse @ (scores.T @ scores) @ inverse * blocks / free
    turn = np.diag(np.append(1.0 / scale, 1.0))
    turn[-1, :-1] = -middle / scale
    value, half = np.zeros(len(used) + 1), np.full(len(used) + 1, np.inf)
    at = np.append(used, True)
    value[at] = turn @ beta
    half[at] = stdtrit(free, LEVEL) * np.sqrt(np.maximum(np.diag(turn @ covariance @ turn.T), 0.0))
    half[:-1] += NOISE_KNOWN * share * np.abs(value[:-1])
    return value.tolist(), half.tolist()
