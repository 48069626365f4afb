"""Where the effects of a description are, and where there could be one."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np

from tendonfmu.arrays import Data
from tendonfmu.diagnosis.effects.mechanism import Place, Shape, magnitudes_of, row_places, sides_at
from tendonfmu.diagnosis.samples import Span
from tendonfmu.model import EFFECT_NUMBERS, Effect, effects, moment_arms, number_of, velocity_threshold

# --- parts of a finger ------------------------------------------------------------------------------------------------


def joints(data: Data, kinematics: int = 1) -> list[Place]:
    return [Place(joint=j) for j in range(1, len(data["joints"]) + 1)]


def tendons(data: Data, kinematics: int = 1) -> list[Place]:
    return [Place(tendon=i) for i in range(1, len(data["tendons"]) + 1)]


def nowhere(data: Data, kinematics: int = 1) -> list[Place]:
    """Return no place: the effect is found in another way than by its columns."""
    return []


def whole_finger(data: Data, kinematics: int = 1) -> list[Place]:
    return [Place()]


def passes(data: Data, kinematics: int = 1) -> list[Place]:
    """Return the joints that each tendon reaches: it turns this joint or one beyond, so ẋ_ij is not always 0."""
    places = []
    for i, arms in enumerate(moment_arms(data), start=1):
        reached = np.flatnonzero(arms)
        places += [Place(j, i) for j in range(1, (int(reached[-1]) + 2) if len(reached) else 1)]
    return places


def joints_before_others(data: Data, kinematics: int = 1) -> list[Place]:
    return joints(data)[:-1]


def moving_parts(data: Data, kinematics: int) -> list[Place]:
    """Return joints, and tendons if their positions are used."""
    return (joints(data) if kinematics != 3 else []) + (tendons(data) if kinematics == 1 else [])


def stretching_tendons(data: Data, kinematics: int) -> list[Place]:
    """Return the tendons if the joint angles come from the tendon positions; otherwise stretch does not matter."""
    return tendons(data) if kinematics == 1 else []


# --- friction laws ----------------------------------------------------------------------------------------------------


def place_of(effect: Effect) -> Place:
    """Return joint and tendon of a law; friction in a joint has no tendon."""
    return Place(effect.joint, effect.tendon or None)


def kind_shape(effect: Effect) -> dict[str, float]:
    """Return what distinguishes the two laws of one place: {"pulley": 1} or {"load": 1}."""
    return {"pulley_friction": {"pulley": 1.0}, "load_friction": {"load": 1.0}}.get(effect.kind, {})


def law_of(shape: Shape) -> str:
    """Return which of the two laws of a place a shape belongs to: "pulley", "load", or "" for the other one."""
    return next((kind for kind in ("pulley", "load") if shape.get(kind)), "")


def law_path(place: Place, shape: Shape) -> str:
    """Return the path of the effect at a place; `shape` holds what `kind_shape` returned."""
    if place.tendon is None:
        return f"joints[{place.joint}].{'load_friction' if shape.get('load') else 'friction'}"
    kind = "pulley_friction" if shape.get("pulley") else "edge_friction"
    return f"tendons[{place.tendon}].{kind}[{place.joint}]"


def laws_at(data: Data, place: Place) -> list[Effect]:
    """Return the present laws of a place."""
    return [effect for effect in effects(data) if place_of(effect) == place]


def all_sides(data: Data, effect: Effect) -> list[tuple[float, float, float]]:
    """Return Coulomb, static − coulomb and viscous friction of each side of each law of an effect."""
    return [magnitudes_of(side) for side in sides_at(data, effect.path)]


def largest_coulomb(data: Data, effect: Effect) -> float:
    """Return the largest Coulomb friction of an effect; a tiny one in place of 0."""
    return max(coulomb for coulomb, _, _ in all_sides(data, effect)) or 1e-6


def lacks_viscous(data: Data, effect: Effect) -> bool:
    return all(viscous == 0 for _, _, viscous in all_sides(data, effect))


def lacks_drop(data: Data, effect: Effect) -> bool:
    """Return whether static equals coulomb in all laws of an effect."""
    return all(drop == 0 for _, drop, _ in all_sides(data, effect))


def lacks_sides(data: Data, effect: Effect) -> bool:
    return all(law.get("positive") is None for law in effect.laws)


def laws_where(lacks: Callable[[Data, Effect], bool]) -> Callable[[Data, int], list[Place]]:
    """Return a function that lists the places with a law that lacks something, each once."""

    def places(data: Data, kinematics: int) -> list[Place]:
        return list(dict.fromkeys(place_of(effect) for effect in effects(data) if lacks(data, effect)))

    return places


def edges(data: Data) -> dict[Place, bool]:
    """Return the present edges and whether they have working points."""
    present = (effect for effect in effects(data) if effect.kind == "edge_friction")
    return {Place(effect.joint, effect.tendon): bool(effect.angles) for effect in present}


def absent_edges(data: Data, kinematics: int) -> list[Place]:
    """Return the places without an edge, and those whose edge does not depend on the angle of the joint before."""
    known = edges(data)
    return [place for place in passes(data) if place not in known or (not known[place] and (place.joint or 1) > 1)]


def absent_pulleys(data: Data, kinematics: int) -> list[Place]:
    present = {(effect.joint, effect.tendon) for effect in effects(data) if effect.kind == "pulley_friction"}
    return [
        place
        for place, after in pairwise(passes(data))
        if place.tendon == after.tendon and (place.joint, place.tendon) not in present
    ]


def joints_without(key: str) -> Callable[[Data, int], list[Place]]:
    """Return a function that lists the joints without a law of this name."""

    def places(data: Data, kinematics: int) -> list[Place]:
        return [place for place in joints(data) if _joint(data, place).get(key) is None]

    return places


def joints_without_spring(data: Data, kinematics: int) -> list[Place]:
    return [place for place in joints(data) if not (_joint(data, place).get("cover") or {}).get("stiffness")]


def _joint(data: Data, place: Place) -> Any:
    return data["joints"][(place.joint or 1) - 1]


def passes_without_sheath(data: Data, kinematics: int) -> list[Place]:
    """Return each joint that a tendon reaches, unless a row says that the tendon rubs before all of them."""
    everywhere = row_places(data, "preload_friction")
    return [place for place in passes(data) if Place(tendon=place.tendon) not in everywhere]


# --- parts with friction ----------------------------------------------------------------------------------------------


def rubbing_parts(data: Data) -> list[Place]:
    """Return the joints with friction of their own, then the tendons with friction along them."""
    present = list(effects(data))
    at_joints = sorted({effect.joint for effect in present if not effect.tendon})
    at_tendons = sorted({effect.tendon for effect in present if effect.tendon})
    return [*(Place(joint=j) for j in at_joints), *(Place(tendon=i) for i in at_tendons)]


def rubbing_parts_and_all(data: Data, kinematics: int) -> list[Place]:
    """Return each joint and tendon with friction, and everywhere if there are several."""
    places = rubbing_parts(data)
    return ([Place()] if len(places) > 1 else []) + places


def thresholds(data: Data) -> tuple[float, float]:
    """Return the velocity thresholds of motion, of tendons and of joints."""
    return number_of(data, "velocity_threshold.tendon"), number_of(data, "velocity_threshold.joint")


# --- grids of non-linear numbers --------------------------------------------------------------------------------------


ANGLES = ("angle_low", "angle_middle", "angle_high")  # shape of an edge with working points, rad
Grid = list[dict[str, float]]

_STRIBECK_VELOCITIES = (0.03, 0.1, 0.3)  # of the 95 % speed
_LEAST_VELOCITY = 1.0  # of the threshold of motion: a smaller velocity leaves nothing of the effect during motion
_NARROW = 0.02  # rad; with less motion of the joint before, the influence of its angle on an edge does not show
_FARTHEST = 1e5  # rad; no joint turns this far
_PLAYS = (0.0006, 0.005, 0.03)  # widths, of the range of the position; the smallest serves as a derivative
_TIME_CONSTANTS = (0.1, 0.6)  # of a drift, of the duration
MOST_TURNS = 12.0  # of a pulley that the tendon turns, per turn of the joint: arm over radius
_APART = 2.0  # rad, over the joint's range, between neighbours in the grid: halfway both fit well
_MOST_PULLEYS = 60  # a joint that turns many times, or angles that the arms do not determine, would ask for millions
_FEWEST = 1.5 * 2.0 * np.pi  # rad, over the joint's range, of a fast pulley: less looks like any function
_HARDENINGS = (0.01, 0.2)  # hardening·e²/(k·e) at the largest force, e = f/k
_DELAYS = (0.002, 0.01)  # s; larger delays are scanned for (base.py)
_LONGEST = EFFECT_NUMBERS["time_delay"]["delay"].most  # s
_LEAST_STEPS, _MOST_STEPS = 0.5, 60.0  # samples: the smallest visible delay, and what the model remembers


def either(*shapes: Shape) -> Callable[[Data, Place, Span], Grid]:
    """Return a function that lists the same shapes at every place."""
    return lambda data, place, span: [dict(shape) for shape in shapes]


def laws_that_lack(lacks: Callable[[Data, Effect], bool]) -> Callable[[Data, Place, Span], Grid]:
    """Return a function that lists the laws of a place that lack something."""
    return lambda data, place, span: [kind_shape(effect) for effect in laws_at(data, place) if lacks(data, effect)]


def stribeck(data: Data, place: Place, span: Span) -> Grid:
    """Return the velocities of each law, and those of a friction that rises from rest."""
    shapes: Grid = []
    for effect in laws_at(data, place):
        if not lacks_drop(data, effect):
            continue
        fast = span.tendon_speed[effect.tendon - 1, effect.drive - 1] if effect.tendon else span.speed[effect.drive - 1]
        least = _LEAST_VELOCITY * velocity_threshold(data, effect)
        grid = sorted({max(float(fast) * share, least, 1e-9) for share in _STRIBECK_VELOCITIES})
        shapes += [{**kind_shape(effect), "stribeck_velocity": velocity} for velocity in grid]
        if _can_rise(data, effect) and effect == laws_at(data, place)[0]:
            shapes += [{"rises": 1.0, "stribeck_velocity": velocity} for velocity in grid]
    return shapes


def _can_rise(data: Data, effect: Effect) -> bool:
    """Return whether a row may let the friction of this joint rise from rest: viscous friction is the simpler one."""
    thick = all(viscous > 0 for _, _, viscous in all_sides(data, effect))
    return not effect.tendon and thick and Place(joint=effect.joint) not in row_places(data, "stribeck")


def edge(data: Data, place: Place, span: Span) -> Grid:
    """Return an edge without angles where there is none, else the range of the joint before as working points."""
    if place not in edges(data):
        return [{}]
    low, high = (float(end) for end in span.angle[(place.joint or 2) - 2])
    if not high - low > _NARROW or max(abs(low), abs(high)) > _FARTHEST:
        return []
    return [dict(zip(ANGLES, np.linspace(low, high, 3).tolist(), strict=True))]


def sheath(data: Data, place: Place, span: Span) -> Grid:
    """Return two forms: the joints beyond feel the friction, too; if there are some, also that they do not."""
    arms = data["tendons"][(place.tendon or 1) - 1]["moment_arms"]
    return [{}, {"beyond": 0.0}] if any(arms[place.joint or 0 :]) else [{}]


def drift(data: Data, place: Place, span: Span) -> Grid:
    return [{"time_constant": share * span.duration} for share in _TIME_CONSTANTS if span.duration > 0]


def delay(data: Data, place: Place, span: Span) -> Grid:
    longest = min(_LONGEST, _MOST_STEPS * span.step)
    grid = sorted({min(max(delay, _LEAST_STEPS * span.step), longest) for delay in _DELAYS})
    return [{"delay": sign * delay} for delay in grid for sign in (1, -1)]


def pulley(data: Data, place: Place, span: Span) -> Grid:
    """Return the forms: the pulley turns with the joint, or so much faster that it makes more than one turn."""
    low, high = span.angle[(place.joint or 1) - 1]
    reach = max(float(high - low), _APART / MOST_TURNS)
    first = _FEWEST / reach
    fast = np.arange(first, MOST_TURNS, max(_APART / reach, (MOST_TURNS - first) / _MOST_PULLEYS))
    return [{"turns": float(turns)} for turns in (1.0, *fast)]


def middle(data: Data, place: Place, span: Span) -> Grid:
    """Return the middle of the joint's range, where an arm is as described."""
    return [{"middle": float(span.angle[(place.joint or 1) - 1].mean())}]


def hardening(data: Data, place: Place, span: Span) -> Grid:
    tendon = (place.tendon or 1) - 1
    largest = float(abs(span.force[tendon]).max())
    stiffness = float(data["tendons"][tendon]["stiffness"])
    return [{"hardening": share * stiffness**2 / largest} for share in _HARDENINGS] if largest > 0 else []


def play(data: Data, place: Place, span: Span) -> Grid:
    at_joint = place.joint is not None
    low, high = span.angle[(place.joint or 1) - 1] if at_joint else span.position[(place.tendon or 1) - 1]
    return [{"width": share * float(high - low)} for share in _PLAYS] if high > low else []
