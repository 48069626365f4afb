"""Which effects may be missing, from coarse to fine: everywhere, at all places of a joint or tendon, at one place.

A hypothesis combines columns of single places with one set of magnitudes. One effect at many places is one hypothesis;
a finer one is taken only if it explains materially more.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from tendonfmu.arrays import Numbers
from tendonfmu.diagnosis.candidate_columns import CandidateColumns, Proposal, Shape
from tendonfmu.diagnosis.effects import Place

Key = tuple[str, int | None, int | None]

EVERYWHERE, SOMEWHERE, HERE = 0, 1, 2  # levels: all places, those of one joint or tendon, a single one
# Effects of surfaces and materials. A finger tends to have them at all of its places alike. The others belong to one
# sensor, link or pulley.
SHARED = (
    "viscous_friction",
    "stribeck",
    "edge_friction",
    "pulley_friction",
    "joint_friction",
    "joint_load_friction",
    "preload_friction",
    "load_friction",
    "cover_stiffness",
    "cover_hardening",
)
# Corrections of the torque itself: a large one shrinks the torque, and with it everything that is left of it.
SCALING = ("force_gain", "moment_arm", "moment_arm_variation", "pulley_eccentricity")
LARGEST_SCALING = 0.2  # of the tendon's largest arm, or of its force, anywhere in the joint's range
LARGEST_DRIFT = 5.0  # of the friction: where it is next to 0, any drift is a multiple of it
LEAST_OF_FAST = 0.3  # least gain of a pulley that turns faster than its joint: any function of the angle resembles it
LARGEST_SECANT = 3.0  # times the step that its column was computed with; the column is not valid beyond


@dataclass(frozen=True)
class Member:
    """One place of a hypothesis: a proposal with one of its shapes. `weights` multiply the common magnitudes."""

    proposal: Proposal
    shape: Shape
    weights: tuple[float, ...]


@dataclass(frozen=True)
class Hypothesis:
    """One effect at a place or group of places."""

    effect: str  # as reported; None if everywhere
    joint: int | None
    tendon: int | None
    level: int  # EVERYWHERE, SOMEWHERE or HERE
    members: tuple[Member, ...]
    mix: Numbers  # map from magnitudes to candidate columns [c, d]
    low: Numbers  # bounds of the magnitudes [d]
    high: Numbers
    least_gain: float = 0.0  # share of the rms that it must remove to be considered

    @property
    def key(self) -> Key:
        return self.effect, self.joint, self.tendon


def hypotheses(columns: CandidateColumns, arms: Numbers, reach: Numbers) -> list[Hypothesis]:
    """Return all hypotheses, the coarse ones first."""
    count = columns.values.shape[2]
    listed = [
        _single(proposal, shape, count, arms, reach) for proposal in columns.proposals for shape in proposal.shapes
    ]
    for effect in SHARED:
        own = [proposal for proposal in columns.proposals if proposal.candidate.name == effect]
        listed += _groups(effect, own, count)
    return sorted(listed, key=lambda hypothesis: hypothesis.level)


def _single(proposal: Proposal, shape: Shape, count: int, arms: Numbers, reach: Numbers) -> Hypothesis:
    size = shape.columns.stop - shape.columns.start
    mix = np.zeros((count, size))
    mix[shape.columns] = np.eye(size)
    low, high = _bounds(shape)
    place, name = proposal.place, proposal.candidate.name
    if name in SCALING and place.tendon is not None:
        largest = LARGEST_SCALING * (1.0 if name == "force_gain" else float(np.abs(arms[place.tendon - 1]).max()))
        if name == "moment_arm_variation" and place.joint is not None:
            largest /= max(float(reach[place.joint - 1]), 1e-9)
        low, high = np.maximum(low, -largest), np.minimum(high, largest)
    if name == "friction_drift":
        high = np.minimum(high, LARGEST_DRIFT)
    level = EVERYWHERE if place == Place() else HERE
    member = Member(proposal, shape, (1.0,) * size)
    least = LEAST_OF_FAST if shape.shape.get("turns", 1.0) != 1.0 else 0.0
    return Hypothesis(name, place.joint, place.tendon, level, (member,), mix, low, high, least)


def _bounds(shape: Shape) -> tuple[Numbers, Numbers]:
    signs = np.array(shape.signs)
    low, high = np.where(signs > 0, 0.0, -np.inf), np.where(signs < 0, 0.0, np.inf)
    return low, np.minimum(high, LARGEST_SECANT) if shape.secant else high


def _groups(effect: str, proposals: Sequence[Proposal], count: int) -> Iterator[Hypothesis]:
    """Yield hypotheses of all places, and of the places of each joint and tendon if these are several but not all."""
    places = {proposal.place for proposal in proposals}
    if len(places) < 2:
        return
    groups: dict[tuple[int | None, int | None], list[Proposal]] = {(None, None): list(proposals)}
    for proposal in proposals:
        place = proposal.place
        if place.joint is not None:
            groups.setdefault((place.joint, None), []).append(proposal)
        if place.tendon is not None:
            groups.setdefault((None, place.tendon), []).append(proposal)
    for (joint, tendon), members in groups.items():
        own = {proposal.place for proposal in members}
        if len(own) < 2 or ((joint, tendon) != (None, None) and own == places):
            continue
        level = EVERYWHERE if (joint, tendon) == (None, None) else SOMEWHERE
        for shapes in _alike(members):
            yield _together(effect, joint, tendon, level, shapes, count)


def _alike(proposals: Sequence[Proposal]) -> Iterator[list[tuple[Proposal, Shape]]]:
    """Yield, for each k, the k-th shape of each law at every place, as long as all laws have one."""
    laws: list[tuple[Proposal, list[Shape]]] = []
    for proposal in proposals:
        by_law: dict[tuple[str, ...], list[Shape]] = {}
        for shape in proposal.shapes:
            law = tuple(key for key in ("pulley", "load", "rises") if shape.shape.get(key))
            by_law.setdefault(law, []).append(shape)
        laws += [(proposal, shapes) for law, shapes in by_law.items() if "rises" not in law]
    if not laws or len({len(shapes[0].signs) for _, shapes in laws}) != 1:
        return
    for k in range(min(len(shapes) for _, shapes in laws)):
        yield [(proposal, shapes[k]) for proposal, shapes in laws]


def _together(
    effect: str, joint: int | None, tendon: int | None, level: int, parts: Sequence[tuple[Proposal, Shape]], count: int
) -> Hypothesis:
    """Combine shapes so that a magnitude of 1 is an ordinary effect at every place."""
    size = len(parts[0][1].signs)
    mix = np.zeros((count, size))
    members = []
    for proposal, shape in parts:
        mix[np.arange(shape.columns.start, shape.columns.stop), np.arange(size)] = shape.expected
        members.append(Member(proposal, shape, tuple(shape.expected)))
    low, high = _bounds(parts[0][1])
    return Hypothesis(effect, joint, tendon, level, tuple(members), mix, low, high)
