"""Grids of the non-linear numbers of effects, for recordings of a span."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from tendonfmu.arrays import Data
from tendonfmu.diagnosis.effects.candidate import Place, Shape, row_places
from tendonfmu.diagnosis.effects.places import (
    all_sides,
    edges,
    kind_shape,
    lacks_drop,
    laws_at,
)
from tendonfmu.diagnosis.effects.terms import ANGLES
from tendonfmu.diagnosis.span import Span
from tendonfmu.model import EFFECT_NUMBERS, Effect, velocity_threshold

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


def hardening(data: Data, place: Place, span: Span) -> Grid:
    tendon = (place.tendon or 1) - 1
    largest = float(abs(span.force[tendon]).max())
    stiffness = float(data["tendons"][tendon]["stiffness"])
    return [{"hardening": share * stiffness**2 / largest} for share in _HARDENINGS] if largest > 0 else []


def play(data: Data, place: Place, span: Span) -> Grid:
    at_joint = place.joint is not None
    low, high = span.angle[(place.joint or 1) - 1] if at_joint else span.position[(place.tendon or 1) - 1]
    return [{"width": share * float(high - low)} for share in _PLAYS] if high > low else []
