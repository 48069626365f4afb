"""How an effect is added to a description: as a friction law, as a change of one, or as a row of `extensions`.

The numbers of each row are in docs/reference/semantics/effects.md. Each function here, or the one that it returns,
takes the effect's name, the description, the place and the shape, and returns the variant.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from tendonfmu.arrays import Data
from tendonfmu.diagnosis.effects.mechanism import (
    SECANT,
    Column,
    Edit,
    Place,
    Shape,
    Term,
    Variant,
    add_cover,
    add_law,
    add_points,
    add_sides,
    law_columns,
    magnitudes_of,
    sides_at,
    with_rows,
)
from tendonfmu.diagnosis.effects.places import ANGLES, largest_coulomb, law_path, laws_at
from tendonfmu.model import DEFAULTS, EFFECT_NUMBERS, LEFT_OUT, get_number, velocity_threshold

Make = Callable[[str, Data, Place, Shape], Variant]

# ordinary Coulomb friction: share of the tendon force, N·m in a joint, N·m per N of load
_ORDINARY = {"edge_friction": 0.02, "pulley_friction": 0.02, "friction": 0.005, "load_friction": 1e-4}
_SLOW_SHARE = 0.3  # of the Coulomb friction: viscous friction at 100 times the threshold of motion
_SPRING = 0.02  # N·m/rad
_OFF_REST = 0.2  # rad, from the described rest angle, which nobody measures: a cover hardens about its own
_VISCOUS = 0.2  # of the Coulomb friction, at a speed of 100 times the threshold of motion
_DROP = 0.25  # of the Coulomb friction
_LEAST_AMPLITUDE = -0.95  # of a Stribeck row: friction does not change its sign
_ASYMMETRY = 0.2  # of the friction, from one direction to the other
_BENT = 0.3  # of the friction, from the middle of the range to its end
_LONGEST = EFFECT_NUMBERS["time_delay"]["delay"].most  # s

# --- rows of `extensions` ---------------------------------------------------------------------------------------------


def row(least: float = -math.inf, **signs: int) -> Make:
    """Return a row that is linear in these numbers, with their expected signs; the shape holds its other numbers."""

    def make(name: str, data: Data, place: Place, shape: Shape) -> Variant:
        path = f"extensions[{len(data.get('extensions') or []) + 1}]"
        columns = tuple(
            Column({f"{path}.{number}": 1.0}, sign, EFFECT_NUMBERS[name][number].scale, least)
            for number, sign in signs.items()
        )
        written = {key: value for key, value in shape.items() if value != LEFT_OUT.get(key)}
        return Variant(data, shape, columns, rows=(_row(name, place, dict.fromkeys(signs, 0.0) | written),))

    return make


def hardening(name: str, data: Data, place: Place, shape: Shape) -> Variant:
    """Return a cubic spring about any angle within `_OFF_REST` of the described rest angle."""
    # stiffness·(b ± c)³ without its linear part and constant: both columns at least 0 span all centres in between
    variant = row(stiffness=1, quadratic=1)(name, data, place, shape)
    (cube,), (square,) = (tuple(column.numbers) for column in variant.columns)
    ends = tuple({cube: 1.0, square: 3.0 * end} for end in (-_OFF_REST, _OFF_REST))
    return replace(variant, columns=tuple(replace(variant.columns[0], numbers=numbers) for numbers in ends))


def variation(name: str, data: Data, place: Place, shape: Shape) -> Variant:
    """Return an arm that changes about the middle of the range: there it was measured."""
    variant = row(slope=0, correction=0)(name, data, place, {})
    (slope,), (correction,) = (tuple(column.numbers) for column in variant.columns)
    about = replace(variant.columns[0], numbers={slope: 1.0, correction: -shape.get("middle", 0.0)})
    return replace(variant, shape=shape, columns=(about,))


def secant(number: str, *, most: float = math.inf) -> Make:
    """Return a row without a useful derivative at zero: its column is a finite difference."""

    def make(name: str, data: Data, place: Place, shape: Shape) -> Variant:
        def full(factor: float) -> dict[str, Any]:
            value = float(shape[number]) * factor
            return with_rows(data, _row(name, place, {number: min(max(value, -most), most)}))

        return Variant(data, shape, SECANT, full=full)

    return make


def _row(effect: str, place: Place, numbers: Mapping[str, float]) -> dict[str, Any]:
    where = {key: value for key, value in (("joint", place.joint), ("tendon", place.tendon)) if value is not None}
    return {"effect": effect, **where, **numbers}


def delay(name: str, data: Data, place: Place, shape: Shape) -> Variant:
    """Return a delay; its column is the effect of a delay on forces that the model explains."""
    # At a reversal the two differ in the sign of the time since.
    return replace(secant("delay", most=_LONGEST)(name, data, place, shape), late=float(shape["delay"]))


# --- friction laws ----------------------------------------------------------------------------------------------------


def changed_law(term: Term) -> str | None:
    """Return the path of the law that a term changes; None if it adds a law or a row."""
    make, shape = term.mechanism.make, term.shape
    if make in (viscous, sides) or (make is stribeck and not shape.get("rises")):
        return law_path(term.place, shape)
    return law_path(term.place, {}) if make is edge and shape else None


def absent_law(**kind: float) -> Make:
    """Return a law where there was none: Coulomb and viscous friction, both at least 0."""

    def make(name: str, data: Data, place: Place, shape: Shape) -> Variant:
        path = law_path(place, kind)
        coulomb = _ORDINARY[path.rsplit(".", 1)[1].split("[")[0]]
        speed = 100 * DEFAULTS[f"velocity_threshold.{'tendon' if path.startswith('tendons') else 'joint'}"]
        columns = (
            Column({f"{path}.coulomb": 1.0}, 1, coulomb),
            Column({f"{path}.viscous": 1.0}, 1, _SLOW_SHARE * coulomb / speed),
        )
        return Variant(data, shape, columns, Edit(path, add_law))

    return make


def edge(name: str, data: Data, place: Place, shape: Shape) -> Variant:
    """Return a new law without angles; with angles, the shares by which friction grows at the ends of the range."""
    if not shape:
        return absent_law()(name, data, place, shape)
    path = law_path(place, {})
    edit = Edit(path, add_points([float(shape[key]) for key in ANGLES]))
    pointed = edit.made(data)
    ends = (_law_shares(pointed, f"{path}.laws[{point}]") for point in (1, 3))
    return Variant(data, shape, tuple(Column(numbers, 0, _BENT) for numbers in ends), edit)


def _law_shares(data: Data, path: str) -> dict[str, float]:
    """Return the direction in which all magnitudes of the law at a path grow by the same share."""
    law = get_number(data, path)
    shares: dict[str, float] = {}
    for side in ("",) if law.get("positive") is None else ("positive", "negative"):
        at = f"{path}.{side}" if side else path
        coulomb, drop, viscous = magnitudes_of(law[side] if side else law)
        shares[f"{at}.coulomb"] = coulomb
        shares |= {f"{at}.static": drop} if drop else {}
        shares |= {f"{at}.viscous": viscous} if viscous else {}
    return shares


def viscous(name: str, data: Data, place: Place, shape: Shape) -> Variant:
    """Return viscous friction in a law without it."""
    path = law_path(place, shape)
    effect = next(law for law in laws_at(data, place) if law.path == path)
    numbers = {at: 1.0 for at, _ in law_columns(data, path, ["viscous"])}
    expected = _VISCOUS * largest_coulomb(data, effect) / (100 * (velocity_threshold(data, effect) or 1e-3))
    return Variant(data, shape, (Column(numbers, 1, expected),))


def stribeck(name: str, data: Data, place: Place, shape: Shape) -> Variant:
    """Return a larger friction near standstill, the law's own `static`, or a smaller one, which is a row."""
    # a law needs static >= coulomb
    velocity = float(shape["stribeck_velocity"])
    if shape.get("rises"):
        rising = row(_LEAST_AMPLITUDE, amplitude=-1)(name, data, place, {"stribeck_velocity": velocity})
        return replace(rising, shape=shape)
    path = law_path(place, shape)
    effect = next(law for law in laws_at(data, place) if law.path == path)
    numbers = {at: 1.0 for at, _ in law_columns(data, path, ["static"])}
    column = Column(numbers, 1, _DROP * largest_coulomb(data, effect))
    return Variant(data, shape, (column,), setting=(path, velocity))


def sides(name: str, data: Data, place: Place, shape: Shape) -> Variant:
    """Return a law with two sides; its magnitude is the difference between them in shares of the law."""
    path = law_path(place, shape)
    edit = Edit(path, add_sides)
    split = edit.made(data)
    dry: dict[str, float] = {}
    thick: dict[str, float] = {}
    values = [magnitudes_of(side) for side in sides_at(split, path)]
    paths = [at for at, _ in law_columns(split, path, ["coulomb"])]
    for at, (coulomb, drop, viscous) in zip(paths, values, strict=True):
        law, half = at.rsplit(".", 1)[0], 0.5 if ".positive." in at else -0.5
        dry |= {f"{law}.coulomb": half * coulomb} | ({f"{law}.static": half * drop} if drop else {})
        thick |= {f"{law}.viscous": half * viscous} if viscous else {}
    columns = tuple(Column(numbers, 0, _ASYMMETRY) for numbers in (dry, thick) if numbers)
    return Variant(data, shape, columns, edit)


def spring(name: str, data: Data, place: Place, shape: Shape) -> Variant:
    """Return the spring of a cover at a joint without one."""
    path = f"joints[{place.joint}]"
    return Variant(data, shape, (Column({f"{path}.cover.stiffness": 1.0}, 1, _SPRING),), Edit(path, add_cover))
