"""x0 = zero + R q + f/k: what is off in it, what it leaves, and how much of that correcting something removes."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations

import numpy as np

from tendonfmu.arrays import Data, Flags, Indices, Numbers
from tendonfmu.diagnosis.effects import Where
from tendonfmu.diagnosis.effects.table import ENCODER, ZERO
from tendonfmu.diagnosis.inputs import Input
from tendonfmu.diagnosis.result import ChangedSize
from tendonfmu.model import moment_arms
from tendonfmu.recordings import (
    Learned,
    Recording,
    TendonRouting,
    curves,
    held_on_the_way,
    smooth_speeds,
    with_linear_springs,
)
from tendonfmu.statistics import Interval, blocks_of, gain_interval, variance_between

ARM, SPRING, COUPLING = "moment_arm", "tendon_nonlinearity", "joint_coupling"
UNITS = {ARM: "m", COUPLING: "m", ZERO: "m", SPRING: "N/m", ENCODER: "rad"}
TAUT = 0.02  # of a tendon's largest force


@dataclass(frozen=True)
class Off:
    """A number that is off."""

    where: Where
    number: Learned  # of an encoder: by how much it reads too much
    least: float  # a smaller one does not matter
    centre: float = 0.0  # of a spring: the force about which it is off, N

    @property
    def unit(self) -> str:
        return UNITS[self.where.effect]

    @property
    def size(self) -> ChangedSize:
        """How large it was, or is described, and is now."""
        then, number = self.number.described, self.number
        name = "offset" if self.where.effect == ENCODER else number.path.rsplit(".", 1)[-1].split("[")[0]
        now = Interval(number.value, number.value - number.half, number.value + number.half)
        change = Interval(number.off, now.low - then, now.high - then)
        return ChangedSize(name, self.unit, Interval(then, then, then), now, change)


@dataclass(frozen=True)
class Geometry:
    """What leads from angles and forces to positions."""

    arms: Numbers  # [m, n]
    compliance: Numbers  # [m] m/N
    zero: Numbers  # [m] m
    encoder: Numbers  # [n] rad; what the encoders read too much

    @classmethod
    def of(cls, data: Data) -> Geometry:
        arms = moment_arms(data)
        stiffness, zero = (
            np.array([float(tendon.get(key) or 0.0) for tendon in data["tendons"]]) for key in ("stiffness", "zero")
        )
        return cls(arms, 1.0 / stiffness, zero, np.zeros(arms.shape[1]))

    def as_reference(self, known: Sequence[Off]) -> Geometry:
        """Return it with the numbers of the reference; without one, they are those that are described."""
        return self._set([each for each in known if each.number.is_known], lambda number: number.described)

    def moved(self, off: Sequence[Off]) -> Geometry:
        """Return it with what is off."""
        base = self._set(off, lambda number: number.described)
        now = base._set(off, lambda number: number.value)
        # the differences count: of a change, the description may be off in both
        return Geometry(*(mine + (new - old) for mine, new, old in zip(self._all, now._all, base._all, strict=True)))

    @property
    def _all(self) -> tuple[Numbers, Numbers, Numbers, Numbers]:
        return self.arms, self.compliance, self.zero, self.encoder

    def _set(self, off: Sequence[Off], of: Callable[[Learned], float]) -> Geometry:
        new = Geometry(*(values.copy() for values in self._all))
        for each in off:
            joint, tendon, value = (each.where.joint or 0) - 1, (each.where.tendon or 0) - 1, of(each.number)
            if each.where.effect in (ARM, COUPLING):
                new.arms[tendon, joint] = value
            elif each.where.effect == SPRING:
                new.zero[tendon] -= (1.0 / value - new.compliance[tendon]) * each.centre
                new.compliance[tendon] = 1.0 / value
            elif each.where.effect == ZERO:
                new.zero[tendon] += value - self.zero[tendon]
            else:
                new.encoder[joint] = value
        return new

    def left(self, recording: Recording) -> Numbers:
        """Return what the equation leaves, m [N, m]; 0 where a tendon is slack."""
        groups, force = recording.groups, recording.groups["tendon_force"]
        side = groups["tendon_position"] - self.zero - force * self.compliance
        left = side - self._angle(recording) @ self.arms.T
        return np.asarray(np.where(np.abs(force) > TAUT * np.abs(force).max(axis=0), left, 0.0))

    def _angle(self, recording: Recording) -> Numbers:
        groups = recording.groups
        if "joint_position" in groups:
            return np.asarray(groups["joint_position"] - self.encoder)
        side = groups["tendon_position"] - self.zero - groups["tendon_force"] * self.compliance
        return np.asarray(side @ np.linalg.pinv(self.arms).T)

    def seen(self, recording: Recording, now: Geometry) -> Recording:
        """Return a recording of `now` as this geometry would have recorded it."""
        groups, force, angle = dict(recording.groups), recording.groups["tendon_force"], now._angle(recording)
        moved = now.zero - self.zero + force * (now.compliance - self.compliance)
        groups["tendon_position"] = groups["tendon_position"] - moved - angle @ (now.arms - self.arms).T
        if "joint_position" in groups:
            groups["joint_position"] = angle
        if (now.arms != self.arms).any():  # the same forces turn the joints otherwise
            groups["external_torque"] = groups.get("external_torque", 0.0) - force @ (now.arms - self.arms)
        return replace(recording, groups=groups)


class Unseen:
    """The samples that nothing was learned from, without what the equation lacks in the reference as well.

    That is what delays of sensors, springs that are not linear and arms that vary leave.
    """

    def __init__(self, given: Input, learned: Sequence[TendonRouting], seed: int) -> None:
        self._seed = seed
        linear = partial(with_linear_springs, given.finger)
        unseen = [(each, each.tracked) for each in given.tests] or [(each, each.held_out) for each in given.training]
        self._judged = [(linear(each.recording), blocks_of(each.time, mask)) for each, mask in unseen if mask.any()]
        self._trained = [(linear(each.recording), each.train) for each in given.training]
        self._reference = [(linear(each.recording), each.train) for each in given.reference]
        self._shapes = {
            id(recording): _shapes(recording, learned, moment_arms(given.finger.data))
            for recording, _ in (*self._judged, *self._trained, *self._reference)
        }
        self._tendons = [each.tendon for each in learned]

    def gain(self, base: Geometry, off: Sequence[Off], own: Sequence[Off]) -> Interval:
        """Return the gain of some of all that is off, the others kept."""
        now, without = base.moved(off), base.moved([each for each in off if each not in own])
        learned = [*((now, *each) for each in self._trained), *((base, *each) for each in self._reference)]
        left = np.concatenate([one.left(each)[mask][:, self._tendons] for one, each, mask in learned])
        shapes = np.concatenate([self._shapes[id(each)][mask] for _, each, mask in learned])
        shapes = np.where(left[..., None] != 0.0, shapes, 0.0)
        parts = np.array([np.linalg.lstsq(shapes[:, i], left[:, i])[0] for i in range(left.shape[1])])
        pairs = []
        for recording, index in self._judged:
            shared = np.einsum("kic,ic->ki", self._shapes[id(recording)], parts)
            both = [one.left(recording)[:, self._tendons] for one in (without, now)]
            squares = [np.where(one != 0.0, one - shared, 0.0) ** 2 for one in both]
            pairs.append(np.column_stack([index.sums(each.sum(axis=1)) for each in squares]))
        before, after = np.concatenate(pairs).T
        if not before.sum() > 0.0:
            return Interval(0.0, 0.0, 0.0)
        gain = gain_interval(before, after, self._seed, variance_between(pairs) / len(pairs))
        return gain if math.isfinite(gain.low) else Interval(gain.value, 0.0, 1.0)


def _shapes(recording: Recording, learned: Sequence[TendonRouting], arms: Numbers) -> Numbers:
    """Return speeds of tendons' positions and forces, curves of force and angles, and what friction holds [N, t, c]."""
    groups, own = recording.groups, [each.tendon for each in learned]
    names = ("tendon_position", "tendon_force")
    speeds = np.stack([smooth_speeds(recording.time, groups[name][:, own]) for name in names], axis=2)
    angle = groups.get("joint_position", np.zeros((len(recording), 0)))
    bent = [
        curves(np.column_stack([angle, groups["tendon_force"][:, i]]), each.span[:, -1 - angle.shape[1] :])
        for i, each in zip(own, learned, strict=True)
    ]
    held = held_on_the_way(recording, arms[:, : angle.shape[1]])
    return np.concatenate([speeds, np.stack(bent, axis=1), held[:, own]], axis=2)


def rows_of(recording: Recording, chosen: Flags) -> Recording:
    """Return a recording of some samples only."""
    groups = {name: values[chosen] for name, values in recording.groups.items()}
    return replace(recording, time=recording.time[chosen], groups=groups, contact=None, others={})


# --- zeros one by one, or an encoder ----------------------------------------------------------------------------------
# An encoder that reads δ too much makes the zero of every tendon over its joint seem off by −r δ. The fewest offsets
# and single zeros that explain all zeros are the answer.


AGREE = 0.05  # of what an offset does to a zero: arms are known and constant to this share
MOST = 3  # offsets that are looked for together
FEWEST = 2  # tendons that have to agree on an offset


@dataclass(frozen=True)
class Offsets:
    """What the encoders read too much."""

    joints: Indices  # from 0 [k]
    offset: Numbers  # rad [k]
    half: Numbers  # of the 95 % intervals [k]
    single: Flags  # zeros [t] that no offset explains


def encoder_offsets(off: Numbers, known_to: Numbers, arms: Numbers) -> Offsets:
    """Explain zeros by the fewest offsets and single zeros."""
    # off: [t] m, how far zeros are off; known_to: [t] m, less is none; arms: [t, n] m
    joints = [int(j) for j in np.flatnonzero((arms != 0.0).sum(axis=0) >= FEWEST)]
    sets = (chosen for count in range(min(MOST, len(joints)) + 1) for chosen in combinations(joints, count))
    # of equally many, the fewest offsets: two zeros are no coincidence, an offset and a zero in one direction are
    return min(_explained(off, known_to, arms, sets), key=lambda each: len(each.joints) + int(each.single.sum()))


def offset_of(off: Numbers, known_to: Numbers, arms: Numbers) -> tuple[Numbers, Numbers]:
    """Return the offsets [k] that fit zeros best, and halves of their intervals; arms: [t, k]."""
    weighted = -arms / known_to[:, None]
    inverse = np.linalg.pinv(weighted.T @ weighted)
    return inverse @ weighted.T @ (off / known_to), np.sqrt(np.diag(inverse))


def _explained(off: Numbers, known_to: Numbers, arms: Numbers, sets: Iterator[Sequence[int]]) -> Iterator[Offsets]:
    for chosen in sets:
        own, kept = arms[:, list(chosen)], np.ones(len(off), dtype=bool)
        while ((own[kept] != 0.0).sum(axis=0) >= FEWEST).all():
            offset, half = offset_of(off[kept], known_to[kept], own[kept])
            beyond = np.where(kept, _beyond(off, known_to, own, offset), 0.0)
            if beyond.max(initial=0.0) <= 1.0:
                yield Offsets(np.array(chosen, dtype=np.intp), offset, half, ~kept)
                break
            # without which zero do the others agree best?
            options = np.flatnonzero(beyond > 1.0)
            left = []
            for others in (kept & (np.arange(len(off)) != i) for i in options):
                offset, _ = offset_of(off[others], known_to[others], own[others])
                left.append(float((_beyond(off, known_to, own, offset)[others] ** 2).sum()))
            kept[options[int(np.argmin(left))]] = False


def _beyond(off: Numbers, known_to: Numbers, arms: Numbers, offset: Numbers) -> Numbers:
    """Return how far each zero is from what offsets explain, in units of what is none [t]."""
    agree = AGREE * np.abs(arms * offset).max(axis=1, initial=0.0)
    return np.asarray(np.abs(off + arms @ offset) / np.maximum(known_to, agree))
