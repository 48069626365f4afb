"""What every candidate would add to the model's torque, at every place and every point of its grid.

A column is the difference that a candidate's term of ordinary size makes between two runs of the core, around the
fitted description: where friction has a memory, a change of its limit changes all that follows. The columns of the
description's own numbers are differences, too. All are averaged over blocks of time.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu.arrays import Data, Numbers
from tendonfmu.diagnosis.effects import MECHANISMS, SHARED, Mechanism, Place, Term, Variant, Where
from tendonfmu.diagnosis.extension_fit import structure_of
from tendonfmu.diagnosis.samples import Samples, Span, span_of, with_late_forces
from tendonfmu.errors import TooLargeError
from tendonfmu.estimate import SCALING, Estimator
from tendonfmu.model import law_path, own_copy, set_number, steps_of

Single = NDArray[np.float32]
Worth = Callable[[Mechanism, Place, Mapping[str, float]], bool]

_LARGEST = 1e9  # largest non-linear number in any unit: docs/reference/semantics/effects.md
_MOST_MEMORY = 8.0  # GB, for all columns


@dataclass(frozen=True)
class Proposal:
    """A mechanism at a place and one point of its grid."""

    mechanism: Mechanism
    place: Place
    variant: Variant
    columns: slice  # where its columns are in `CandidateColumns.values`


@dataclass(frozen=True)
class CandidateColumns:
    """Block means of all columns."""

    values: Single  # columns of the candidates, per unit of their magnitudes [B, n, c]
    proposals: tuple[Proposal, ...]  # which columns belong to which candidate, place and shape


def candidate_columns(
    data: Data,
    samples: Samples,
    *,
    mechanisms: Sequence[Mechanism] = MECHANISMS,
    span: Span | None = None,
    worth: Worth | None = None,
) -> CandidateColumns:
    """Compute the columns of all mechanisms that a description lacks."""
    span = span or span_of(data, samples.recordings)
    proposals = tuple(_proposed(data, samples.recordings[0].kinematics, span, mechanisms, worth))
    count = proposals[-1].columns.stop if proposals else 0
    joints, blocks = len(data["joints"]), samples.grid.blocks
    size = blocks * joints * count * 4 / 1e9
    if size > _MOST_MEMORY:
        raise TooLargeError(
            f"{count} columns of candidate causes need {size:.0f} GB; expected at most {_MOST_MEMORY:g} GB: use "
            "a finger of fewer joints and tendons at a time, or shorter recordings"
        )
    values = np.zeros((blocks, joints, count), dtype=np.float32)
    base = samples.left(data)
    for proposal in proposals:
        for k, column in enumerate(_columns(proposal.variant, data, samples, base), start=proposal.columns.start):
            values[:, :, k] = column
    return CandidateColumns(values, proposals)


def _columns(variant: Variant, data: Data, samples: Samples, base: Numbers) -> Iterator[Numbers]:
    """Yield the columns of a variant [B, n]; `base` is what the description leaves [B, n], N·m."""
    if variant.late:
        late = samples.of_recordings(data, with_late_forces(samples.recordings, variant.late))
        yield late.left(data) - base
    elif variant.full is not None:
        yield base - samples.left(variant.full(1.0))
    else:
        for k, size in enumerate(variant.expected):
            magnitudes = [0.0] * variant.count
            magnitudes[k] = size
            yield (base - samples.left(variant.at(magnitudes))) / size


def _proposed(
    data: Data, kinematics: int, span: Span, mechanisms: Sequence[Mechanism], worth: Worth | None
) -> Iterator[Proposal]:
    first = 0
    for mechanism in mechanisms:
        for place in mechanism.places(data, kinematics):
            for variant in mechanism.variants(data, place, span):
                # recordings of another scale can lead to any value; a description accepts none that is larger
                is_sane = all(abs(value) <= _LARGEST for value in variant.shape.values())
                if is_sane and (worth is None or worth(mechanism, place, variant.shape)):
                    yield Proposal(mechanism, place, variant, slice(first, first + variant.count))
                    first += variant.count


# --- from coarse to fine ----------------------------------------------------------------------------------------------
# A candidate combines columns of single places with one set of magnitudes. One effect at many places is one candidate;
# a finer one is taken only if it explains materially more. Where recordings are compared with a reference, the numbers
# that the description has may have changed, too.


LARGEST_SCALING = 0.2  # of the tendon's largest arm, or of its force
LARGEST_VARIATION = 0.5  # of the largest arm, by which an arm changes in the joint's range: cords bow and leave pulleys
LARGEST_DRIFT = 5.0  # of the friction: where it is next to 0, any drift is a multiple of it
LEAST_OF_FAST = 0.3  # least gain of a pulley that turns faster than its joint: any function of the angle resembles it
LARGEST = 1e3  # times an ordinary size: a column of next to nothing would ask for any
LARGEST_SECANT = 3.0  # times the step that its column was computed with; the column is not valid beyond

_OF_LAW = {"friction": "joint_friction", "load_friction": "joint_load_friction"}
_OF_NUMBER = {"viscous": "viscous_friction", "static": "stribeck", "stribeck_velocity": "stribeck"}
EVERYWHERE, SOMEWHERE, HERE = 0, 1, 2  # levels: all places, those of one joint or tendon, a single one
Shares = tuple[Numbers, Numbers, Numbers]  # of numbers in magnitudes [numbers, d]; bounds of the magnitudes [d]
none, square = partial(np.zeros, 0), partial(np.zeros, (0, 0))


@dataclass(frozen=True, eq=False)
class Candidate:
    """A mechanism at one place or several together, or a number that may have changed."""

    where: Where
    terms: tuple[Term, ...] = ()  # what magnitudes of 1 add to a description; none for a number of its own
    mix: Numbers = field(default_factory=square)  # map from magnitudes to columns [c, d]
    low: Numbers = field(default_factory=none)  # bounds of the magnitudes [d]
    high: Numbers = field(default_factory=none)
    level: int = HERE
    ordinary: Numbers = field(default_factory=none)  # magnitudes of an ordinary effect at one place [d]
    step: float = 1.0  # size of its first number at a magnitude of 1, in the unit of the number
    least_gain: float = 0.0  # share of the rms that it must remove to be considered

    @property
    def effect(self) -> str:
        return self.where.effect


def hypotheses(columns: CandidateColumns, arms: Numbers, reach: Numbers, weight: Numbers) -> list[Candidate]:
    """Return all effects that the description may lack, the coarse ones first.

    Parameters
    ----------
    columns
        Columns of single places.
    arms, reach, weight
        Moment arms (m) [m, n]; largest angle in the recordings (rad), and heaviest weight (N·m), of each joint [n].

    Returns
    -------
    list of Candidate
        Each with the bounds that arms and recordings set.
    """
    count = columns.values.shape[2]
    listed = [_single(proposal, count, arms, reach, weight) for proposal in columns.proposals]
    for effect in SHARED:
        by_place: dict[Place, list[Proposal]] = {}
        for proposal in columns.proposals:
            if proposal.mechanism.name == effect:
                by_place.setdefault(proposal.place, []).append(proposal)
        for where, level, places in _groups(effect, list(by_place)):
            for parts in _alike([by_place[place] for place in places]):
                listed.append(_together(where, level, parts, count))
    return sorted(listed, key=lambda candidate: candidate.level)


def _groups(effect: str, places: Sequence[Place]) -> Iterator[tuple[Where, int, list[Place]]]:
    """Yield all places, and the places of each joint and tendon if these are several but not all."""
    if len(places) < 2:
        return
    groups = {Place(): list(places)}
    for place in places:
        if place.joint is not None:
            groups.setdefault(Place(place.joint), []).append(place)
        if place.tendon is not None:
            groups.setdefault(Place(tendon=place.tendon), []).append(place)
    for group, members in groups.items():
        whole = group == Place()
        if len(members) >= 2 and (whole or len(members) < len(places)):
            yield Where(effect, *group), EVERYWHERE if whole else SOMEWHERE, members


# --- effects that the description lacks -------------------------------------------------------------------------------


def _single(proposal: Proposal, count: int, arms: Numbers, reach: Numbers, weight: Numbers) -> Candidate:
    variant, place, name = proposal.variant, proposal.place, proposal.mechanism.name
    mix = np.zeros((count, variant.count))
    mix[proposal.columns] = np.eye(variant.count)
    expected = np.array(variant.expected)
    low, high = _signed(variant, expected)
    if name in SCALING and place.tendon is not None:
        arm = float(np.abs(arms[place.tendon - 1]).max())
        largest = LARGEST_SCALING * (1.0 if name == "force_gain" else arm)
        if name == "moment_arm_variation" and place.joint is not None:
            largest = LARGEST_VARIATION * arm / max(float(reach[place.joint - 1]), 1e-9)
        low, high = np.maximum(low, -largest), np.minimum(high, largest)
    if name == "gravity" and place.joint is not None:
        largest = float(weight[place.joint - 1])
        low, high = np.maximum(low, -largest), np.minimum(high, largest)
    if name == "friction_drift":
        high = np.minimum(high, LARGEST_DRIFT)
    level = EVERYWHERE if place == Place() else HERE
    least = LEAST_OF_FAST if variant.shape.get("turns", 1.0) != 1.0 else 0.0
    terms = (Term(proposal.mechanism, place, variant.shape, (1.0,) * variant.count),)
    return Candidate(Where(name, *place), terms, mix, low, high, level, expected, _step(variant), least)


def _signed(variant: Variant, ordinary: Numbers) -> tuple[Numbers, Numbers]:
    """Return the bounds of the magnitudes [d], whose ordinary sizes are given [d]."""
    signs, most = np.array(variant.signs), LARGEST * ordinary
    low, high = np.where(signs > 0, 0.0, -most), np.where(signs < 0, 0.0, most)
    return low, np.minimum(high, LARGEST_SECANT) if variant.full is not None else high


def _step(variant: Variant) -> float:
    return abs(float(next(iter(variant.shape.values())))) if variant.full is not None and variant.shape else 1.0


def _alike(by_place: Sequence[Sequence[Proposal]]) -> Iterator[list[Proposal]]:
    """Yield, for each k, the k-th shape of each law at every place, as long as all laws have one."""
    laws: list[list[Proposal]] = []
    for proposals in by_place:
        by_law: dict[tuple[str, ...], list[Proposal]] = {}
        for proposal in proposals:
            law = tuple(key for key in ("pulley", "load", "rises") if proposal.variant.shape.get(key))
            by_law.setdefault(law, []).append(proposal)
        laws += [same for law, same in by_law.items() if "rises" not in law]
    if not laws or len({same[0].variant.count for same in laws}) != 1:
        return
    for k in range(min(map(len, laws))):
        yield [same[k] for same in laws]


def _together(where: Where, level: int, parts: Sequence[Proposal], count: int) -> Candidate:
    """Combine shapes so that a magnitude of 1 is an ordinary effect at every place."""
    first = parts[0].variant
    mix = np.zeros((count, first.count))
    for part in parts:
        mix[np.arange(part.columns.start, part.columns.stop), np.arange(first.count)] = part.variant.expected
    terms = tuple(Term(part.mechanism, part.place, part.variant.shape, part.variant.expected) for part in parts)
    ordinary = np.ones(first.count)
    return Candidate(where, terms, mix, *_signed(first, ordinary), level, ordinary, _step(first))


# --- numbers that the description has ---------------------------------------------------------------------------------


@dataclass(frozen=True)
class Number:
    """One unknown of a description's fit."""

    effect: str  # name of the effect
    place: Place
    side: int  # of its law: 1 or −1; 0 if both sides are one
    index: int  # among the unknowns
    path: str
    value: float  # start and bounds in the unit of the unknown
    low: float
    high: float


def numbers_of(data: Data) -> list[Number]:
    """Return the numbers in the order of `extension_fit.number_columns`."""
    unknowns = [unknown for unknown in estimator_of(data)[0].unknowns if not unknown.path.startswith("bias.")]
    return [
        Number(*_owner(data, unknown.path), k, unknown.path, unknown.start, unknown.lower, unknown.upper)
        for k, unknown in enumerate(unknowns)
    ]


def estimator_of(data: Data) -> tuple[Estimator, list[str]]:
    """Return an estimator of all numbers that a fit estimates, and the paths of the description's parameters."""
    structure = structure_of(data)
    return Estimator(structure.start.image, structure.group, structure.scale), list(structure.index)


def _owner(data: Data, path: str) -> tuple[str, Place, int]:
    """Return effect, place and side of a number."""
    law = law_path(path)
    if law is not None and law.number is not None:
        side = {"positive": 1, "negative": -1}.get(law.side or "", 0)
        effect = _OF_NUMBER.get(law.number) or _OF_LAW.get(law.kind, law.kind)
        return effect, Place(law.joint, law.tendon), side
    owner, index, *key = steps_of(path)
    if owner == "joints" and key == ["cover", "stiffness"]:
        return "cover_stiffness", Place(int(index) + 1), 0
    if owner == "extensions" and len(key) == 1:
        row = data["extensions"][index]
        return row["effect"], Place(row.get("joint"), row.get("tendon")), 0
    return path, Place(), 0


def number_hypotheses(numbers: Sequence[Number], count: int, first: int) -> list[Candidate]:
    """Return changes of each effect at each place, of one joint or tendon, and everywhere; the coarse ones first."""

    # of `count` columns, those of the numbers begin at `first`
    def changed(where: Where, level: int, members: Sequence[Number], shares: Shares) -> Candidate:
        of_numbers, low, high = shares
        mix = np.zeros((count, of_numbers.shape[1]))
        mix[[first + member.index for member in members]] = of_numbers
        return Candidate(where, (), mix, low, high, level)

    by_place: dict[tuple[str, Place], list[Number]] = {}
    for number in numbers:
        by_place.setdefault((number.effect, number.place), []).append(number)
    listed = []
    for (effect, place), members in by_place.items():
        level, has_sides = EVERYWHERE if place == Place() else HERE, any(member.side for member in members)
        listed.append(changed(Where(effect, *place), level, members, (_scaled if has_sides else _free)(members)))
        if has_sides and effect != "stribeck":
            listed.append(changed(Where("asymmetric_friction", *place), level, members, _apart(members)))
    for effect in SHARED:
        of_effect = {place: members for (name, place), members in by_place.items() if name == effect}
        for where, level, places in _groups(effect, list(of_effect)):
            members = [number for place in places for number in of_effect[place]]
            listed.append(changed(where, level, members, _scaled(members)))
    return sorted(listed, key=lambda candidate: candidate.level)


def _free(numbers: Sequence[Number]) -> Shares:
    """Let each number change by itself: those of working points, or of a term with several numbers."""
    value, low, high = (np.array([getattr(number, name) for number in numbers]) for name in ("value", "low", "high"))
    return np.eye(len(numbers)), low - value, high - value


def _scaled(numbers: Sequence[Number]) -> Shares:
    """Let all numbers change by the same share."""
    _, low, high = _free(numbers)
    size = np.array([abs(number.value) for number in numbers])
    size = np.where(size > 0.0, size, size.max(initial=0.0) or 1.0)
    return size[:, None], np.array([(low / size).max()]), np.array([(high / size).min()])


def _apart(numbers: Sequence[Number]) -> Shares:
    """Let the two sides of a law change against each other."""
    most = np.array([min(number.value - number.low for number in numbers)])
    return np.array([[float(number.side)] for number in numbers]), -most, most


def with_numbers(data: Data, added: Numbers) -> dict[str, Any]:
    """Return the description with `added` [u] added to its unknowns, within their bounds."""
    estimator, paths = estimator_of(data)
    z = estimator.start.copy()
    rows = [k for k, unknown in enumerate(estimator.unknowns) if not unknown.path.startswith("bias.")]
    z[rows] += added
    low, high = (np.array([getattr(unknown, end) for unknown in estimator.unknowns]) for end in ("lower", "upper"))
    before, after = estimator.values(estimator.start), estimator.values(np.clip(z, low, high))
    result = own_copy(data)
    for path, one, other in zip(paths, before, after, strict=True):
        if one != other:
            set_number(result, path, float(other))
    return result
