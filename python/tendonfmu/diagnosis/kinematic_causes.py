"""Moment arms, zeros, springs, couplings and encoders that are off, or have changed: causes like any other.

x0 = zero + R q + f/k holds at every sample of a taut tendon, whatever friction, weight and contact are. The numbers are
learned from the samples that train (`recordings/routing.py`). The gain of a cause is the share of the rms of what the
equation leaves, in metres over all tendons, that it removes on unseen samples.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np
from scipy.special import ndtr

from tendonfmu.arrays import Data, Numbers
from tendonfmu.diagnosis.effects import Where, title_of
from tendonfmu.diagnosis.effects.mechanism import add_to_number, data_number
from tendonfmu.diagnosis.effects.table import ENCODER, ZERO
from tendonfmu.diagnosis.effects.words import NBSP, quantity
from tendonfmu.diagnosis.inputs import Input
from tendonfmu.diagnosis.result import NO_GAIN, Cause, CausePlace, ChangedSize, Diagnosis, by_gain
from tendonfmu.diagnosis.selection import SIGNIFICANCE
from tendonfmu.diagnosis.tendon_equation import (
    ARM,
    COUPLING,
    SPRING,
    Geometry,
    Off,
    Unseen,
    encoder_offsets,
    offset_of,
    rows_of,
)
from tendonfmu.model import moment_arms
from tendonfmu.recordings import Learned, TendonRouting, learn_routing, varying_sentences
from tendonfmu.statistics import Interval

# --- in words ---------------------------------------------------------------------------------------------------------


EXPLANATIONS = {
    ENCODER: "All tendons of this joint agree on another angle than its encoder reads: the encoder's disc or its "
    "coupling has slipped, or it was set to zero in another pose. A description has no number for this: set the "
    'encoder to zero again, or write its offset into the map of columns ("offset" at joint_position).',
    ZERO: "This tendon's motor reads another position than the joints and the other tendons show: the tendon has "
    "slipped on its drum, was attached again, or its motor lost its count. The extended model has its zero.",
    ARM: "The tendon moves more or less per angle of this joint than described. Measure the pulley's radius "
    "and add half the tendon's thickness; look whether the tendon runs on its pulley. The extended model has the arm.",
    SPRING: "The tendon stretches more or less under its force than described: another tendon, one "
    "that is worn, or the gain of its force sensor. The extended model has the stiffness.",
    COUPLING: "The tendon moves with a joint that it does not pass in the description: it passes beside the "
    "joint's axis. The extended model has the moment arm.",
}
# The tables of effects describe a spring that is not linear, and a spring between joints.
TITLES = {SPRING: "a tendon's stiffness is off", COUPLING: "a tendon moves with a joint that it does not pass"}


def _size(effect: str, size: ChangedSize, is_change: bool) -> str:
    then, now = ("then", "now") if is_change else ("described", "recorded")
    if effect == ENCODER:
        degrees = math.degrees(size.change.value)
        base = "before" if is_change else "the tendons show"
        return f"it reads {abs(degrees):.3g}° {'more' if degrees > 0 else 'less'} than {base}"
    ends = f"{quantity(size.reference.value, size.unit)} {then}, {quantity(size.now.value, size.unit)} {now}"
    if effect == ZERO:
        return f"{quantity(size.change.value, size.unit, sign=True)}: {ends}"
    if not size.reference.value:
        return ends
    return f"{100.0 * size.change.value / size.reference.value:+.2g}{NBSP}%: {ends}".replace("-", "−")


LEAST_SHARE = {ARM: 0.02, SPRING: 0.03, COUPLING: 0.02}  # of the number; of a coupling, of the tendon's largest arm
LEAST_ANGLE = 0.004  # rad, a quarter of a degree: of an encoder; a zero turns the joint by as much
LONGER = "record a minute or more of motion of all joints"


@dataclass(frozen=True)
class KinematicCauses:
    """What is off, and what it is worth."""

    is_change: bool
    known: dict[Where, Off] = field(default_factory=dict)  # every number that the recordings show
    off: tuple[Off, ...] = ()  # those that are causes
    minor: tuple[Off, ...] = ()  # certain, but too small for a cause: corrected, too, as `calibrate` does
    causes: tuple[Cause, ...] = ()
    too_small: tuple[Cause, ...] = ()
    uncertain: tuple[Cause, ...] = ()
    warnings: tuple[str, ...] = ()

    # --- what the rest of the diagnosis works on ---

    def corrected(self, given: Input) -> Input:
        """Return the input without what is off: what has changed is taken from the recordings, else the finger gets it.

        An encoder's offset is taken from the recordings in both cases.
        """
        if not (self.off or self.minor):
            return given
        finger, moved = given.finger, self.off
        if not self.is_change:
            finger = finger.with_data(self.edited(finger.data))
            moved = tuple(off for off in moved if off.where.effect == ENCODER)
        before = Geometry.of(finger.data)
        now = before.moved(moved)
        return given.of_finger(finger, lambda recording: before.seen(recording, now))

    def edited(self, data: Data) -> dict[str, Any]:
        """Return a description with the numbers that are off; none is an encoder's."""
        edited: dict[str, Any] = copy.deepcopy(dict(data))
        every = (*self.off, *self.minor)
        for off in every:
            if off.where.effect != ENCODER:
                path, number = off.number.path, off.number
                now = data_number(data, path) + number.off if self.is_change else number.rounded
                add_to_number(edited, path, now - data_number(data, path))
        before, after = Geometry.of(data), Geometry.of(edited)
        for off in every:
            if off.where.effect == SPRING and off.where.tendon is not None:
                row = off.where.tendon - 1
                moved = (after.compliance[row] - before.compliance[row]) * off.centre
                add_to_number(edited, f"tendons[{off.where.tendon}].zero", -float(moved))
        return edited

    def in_diagnosis(self, diagnosis: Diagnosis) -> Diagnosis:
        """Return the diagnosis of the corrected input with these causes."""
        experiment = diagnosis.experiment
        if self.causes:
            sentences = [*self._experiments(), experiment.sentence]
            experiment = replace(experiment, sentence=" ".join(filter(None, sentences)))
        extended = self.edited(diagnosis.extended_data) if self.is_change else diagnosis.extended_data
        verdicts = {"adequate": "explained", "unexplained": "partly explained"} if self.causes else {}
        named = {cause.effect for cause in self.causes}
        small, uncertain = (
            [cause for cause in found if cause.effect not in named]
            for found in (diagnosis.too_small, diagnosis.uncertain)
        )
        shown = {where for where, off in self.known.items() if where.effect == ARM and off.number.is_known}
        return replace(
            diagnosis,
            invisible=tuple(each for each in diagnosis.invisible if each.where not in shown),
            verdict=verdicts.get(diagnosis.verdict, diagnosis.verdict),
            causes=tuple(by_gain([*(self._with_numbers(cause, extended) for cause in self.causes), *diagnosis.causes])),
            too_small=(*self.too_small, *small),
            uncertain=(*self.uncertain, *uncertain),
            extended_data=extended,
            experiment=experiment,
            tested=diagnosis.tested + len(self.known),
            warnings=(*diagnosis.warnings, *self.warnings),
        )

    def _with_numbers(self, cause: Cause, extended: Data) -> Cause:
        """Return a cause with its numbers in the extended description; an encoder's offset is in none."""

        def value(off: Off) -> float:
            return off.number.value if cause.effect == ENCODER else data_number(extended, off.number.path)

        own = [off for off in self.off if off.where.effect == cause.effect]
        places = tuple(CausePlace(*off.where.place, {off.number.path: (value(off), off.unit)}) for off in own)
        return replace(cause, places=places, intervals={off.number.path: off.size.now for off in own})

    def _experiments(self) -> Iterator[str]:
        effects = {off.where.effect for off in self.off}
        if ENCODER in effects:
            yield (
                "Hold the joint at a stop or in a jig of known angle and read its encoder: that distinguishes an "
                "encoder that slipped from tendons that all moved."
            )
        if effects & {ZERO, SPRING}:
            yield (
                "Take all load off the tendon and read its force sensor: that distinguishes its position or spring "
                "from its force sensor."
            )


# --- finding them -----------------------------------------------------------------------------------------------------


def find_kinematic_causes(given: Input, least_gain: float, seed: int) -> KinematicCauses:
    """Find what is off in recordings that show it: with joint encoders, or with more tendons than joints."""
    data, reference = given.finger.data, [recording.recording for recording in given.reference]
    trained = [rows_of(recording.recording, recording.train) for recording in given.training]
    learned = learn_routing(given.finger, trained, reference, coupled=True)
    is_long = bool(learned)
    if not is_long:
        whole = [recording.recording for recording in given.training]
        learned = learn_routing(given.finger, whole, reference, coupled=True)
    none = KinematicCauses(bool(reference))
    known = {off.where: off for off in _listed(data, learned, bool(reference))}
    if not learned or any(off.number.is_absurd for off in known.values() if off.where.effect != COUPLING):
        return none
    offsets, single = _offsets(data, known)
    every = [each for each in known.values() if each.where.effect != ZERO]
    every += [each for each in known.values() if each.where in single]
    off = [each for each in (*every, *offsets) if _is_certain(each, len(known))]
    keys = known | {each.where: each for each in _by_joint(data, known)}
    warnings = () if reference else tuple(varying_sentences(given.finger, learned))
    found = replace(none, known=keys, warnings=warnings)
    if is_long:
        return _judged(given, found, off, known, Unseen(given, learned, seed), least_gain)
    return replace(found, uncertain=tuple(_causes(given, found, off, known, lambda own: NO_GAIN)))


def _judged(
    given: Input, found: KinematicCauses, off: Sequence[Off], known: dict[Where, Off], unseen: Unseen, least_gain: float
) -> KinematicCauses:
    """Divide what is off into causes and what is too small or uncertain."""
    small = [each for each in off if abs(each.number.off) < each.least]
    kept = [each for each in off if each not in small]
    base = Geometry.of(given.finger.data).as_reference(list(known.values()))
    while True:
        causes = list(_causes(given, found, kept, known, partial(unseen.gain, base, kept)))
        weak = {cause.effect for cause in causes if not (cause.gain.low > 0.0 and cause.gain.value >= least_gain)}
        if not weak:
            break
        small += [each for each in kept if each.where.effect in weak]
        kept = [each for each in kept if each.where.effect not in weak]
    rest = list(_causes(given, found, small, known, lambda own: unseen.gain(base, [*kept, *own], own)))
    certain = [cause for cause in rest if cause.gain.low > 0.0]
    uncertain = [replace(cause, experiment=LONGER) for cause in rest if not cause.gain.low > 0.0]
    named = {cause.where.effect for cause in certain} & {ARM, SPRING, ZERO}
    minor = () if found.is_change else tuple(each for each in small if each.where.effect in named)
    judged = replace(found, off=tuple(kept), causes=tuple(causes), too_small=tuple(certain), minor=minor)
    return replace(judged, uncertain=tuple(uncertain))


def _is_certain(off: Off, tested: int) -> bool:
    return off.number.differs and off.number.p_value * tested < SIGNIFICANCE


def _listed(data: Data, learned: Sequence[TendonRouting], is_change: bool) -> Iterator[Off]:
    """Yield every number that the recordings show."""
    arms = moment_arms(data)
    for each in learned:
        i, largest = each.tendon, float(np.abs(arms[each.tendon]).max())
        for j, arm in each.arms.items():
            effect = ARM if arms[i, j] else COUPLING
            least = LEAST_SHARE[effect] * abs(arms[i, j] or largest)
            yield Off(Where(effect, j + 1, i + 1), arm, least)
        zero, force = _zero(each, is_change)
        spring = each.stiffness
        least = spring.material if each.seen_from else LEAST_SHARE[SPRING] * spring.described
        yield Off(Where(SPRING, None, i + 1), spring, least, force)
        yield Off(Where(ZERO, None, i + 1), zero, LEAST_ANGLE * largest)


def _zero(routing: TendonRouting, is_change: bool) -> tuple[Learned, float]:
    """Return the zero of a tendon, and the force (N) about which its spring is off.

    That may be any force up to the middle of the motion: 0 for a spring of another stiffness, the middle for one that
    is described for its working point, and between them for one that stiffens. Where one of these explains the zero,
    the zero is not off. Without a reference, a spring that is off by less than counts could explain a small one, too:
    cords are soft at first.
    """
    zero, spring, force = routing.zero, routing.stiffness, float(routing.span[0, -1])
    softer = 1.0 / spring.value - 1.0 / spring.described if spring.is_known else 0.0
    centre = min(max(-zero.off / softer, 0.0), force) if softer else 0.0
    off = zero.off + centre * softer
    if centre:
        zero = replace(zero, value=zero.described + off, p_value=_p_value(off, zero.half))
    least = 0.0 if is_change else spring.material * abs(force) / spring.described**2
    return replace(zero, material=max(zero.material, least)), centre


# --- zeros ------------------------------------------------------------------------------------------------------------


def _offsets(data: Data, known: dict[Where, Off]) -> tuple[list[Off], set[Where]]:
    """Return the offsets of encoders that explain the zeros, and the zeros that none explains."""
    zeros = _zeros(known)
    if not any(zero.number.differs for zero in zeros):
        return [], set()
    found = encoder_offsets(*_of_zeros(data, zeros))
    numbers = zip(found.joints.tolist(), found.offset.tolist(), found.half.tolist(), strict=True)
    alone = {zero.where for zero, single in zip(zeros, found.single, strict=True) if single}
    return [_encoder(j, offset, half) for j, offset, half in numbers], alone


def _by_joint(data: Data, known: dict[Where, Off]) -> Iterator[Off]:
    """Yield what each joint's encoder would be off by if it explained the zeros alone."""
    if zeros := _zeros(known):
        off, known_to, arms = _of_zeros(data, zeros)
        for j in np.flatnonzero(arms.any(axis=0)).tolist():
            own = arms[:, j] != 0.0
            offset, half = offset_of(off[own], known_to[own], arms[own][:, [j]])
            yield _encoder(j, float(offset[0]), float(half[0]))


def _zeros(known: dict[Where, Off]) -> list[Off]:
    return [each for where, each in known.items() if where.effect == ZERO and each.number.is_known]


def _of_zeros(data: Data, zeros: Sequence[Off]) -> tuple[Numbers, Numbers, Numbers]:
    """Return how far zeros are off, to what they are known (m) [t], and the arms of their tendons [t, n]."""
    off, known_to = (np.array([getattr(zero.number, name) for zero in zeros]) for name in ("off", "known_to"))
    return off, known_to, moment_arms(data)[[(zero.where.tendon or 1) - 1 for zero in zeros]]


def _encoder(j: int, offset: float, half: float) -> Off:
    number = Learned(f"joint_position[{j + 1}]", offset, half, 0.0, True, 0.0, _p_value(offset, half))
    return Off(Where(ENCODER, j + 1), number, LEAST_ANGLE)


def _p_value(off: float, half: float) -> float:
    """Return the p-value of a number that is off, from the half of its 95 % interval."""
    return 2.0 * float(ndtr(-1.96 * abs(off) / max(half, 1e-300)))


# --- causes -----------------------------------------------------------------------------------------------------------


def _causes(
    given: Input,
    found: KinematicCauses,
    off: Sequence[Off],
    known: dict[Where, Off],
    gain_of: Callable[[Sequence[Off]], Interval],
) -> Iterator[Cause]:
    """Yield one cause for each effect, with its places."""
    arms = moment_arms(given.finger.data)
    for effect in dict.fromkeys(each.where.effect for each in off):
        own = sorted((each for each in off if each.where.effect == effect), key=lambda each: -abs(each.number.off))
        joints, tendons = ({getattr(each.where, name) for each in own} for name in ("joint", "tendon"))
        where = Where(effect, *(kind.pop() if len(kind) == 1 else None for kind in (joints, tendons)))
        rivals = dict.fromkeys(rival for each in own for rival in _rivals(each.where, arms))
        at_largest = f", at the largest of {len(own)} places" if len(own) > 1 else ""
        yield Cause(
            where,
            TITLES.get(effect) or title_of(effect),
            EXPLANATIONS[effect],
            p_value=min(1.0, max(each.number.p_value for each in own) * len(known)),
            gain=gain_of(own),
            gain_unit="m",
            confusable_with=tuple(rivals),
            size=_size(effect, own[0].size, found.is_change) + at_largest,
            places=tuple(CausePlace(*each.where.place, {}) for each in own),
            changed=own[0].size if found.is_change else None,
        )


def _rivals(where: Where, arms: Numbers) -> Iterator[Where]:
    """Yield what the equation cannot distinguish from this."""
    if where.effect == ENCODER and where.joint is not None:
        yield from (Where(ZERO, None, int(i) + 1) for i in np.flatnonzero(arms[:, where.joint - 1]))
    elif where.effect in (ZERO, SPRING) and where.tendon is not None:
        yield Where("force_offset" if where.effect == ZERO else "force_gain", None, where.tendon)
        alone = np.flatnonzero((arms[where.tendon - 1] != 0.0) & ((arms != 0.0).sum(axis=0) == 1))
        yield from (Where(ENCODER, int(j) + 1) for j in alone if where.effect == ZERO)
