"""What the matched rig can hide: every effect that `diagnose` may name, and three kinds it may not.

Each builder takes a hand and a random generator, chooses a place, removes the effect from both descriptions where it
stands there, and says how the true finger differs by one magnitude. `hide` scales the magnitude to a strength.
All formulas are physics written here; nothing is taken from the candidates. Places count from 0 inside, from 1 in
`Hidden`.
"""

from __future__ import annotations

import copy
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from friction_physics import Effect, Finger, Motion, last_true
from hidden_sensors import SENSORS
from hidden_unknown import UNKNOWN
from matched_rig import Description, Hand, Hidden, Unreachable, record
from strength import look, residual, surviving

Array = NDArray[Any]
Random = np.random.Generator
Builder = Callable[[Hand, Random], tuple[Hand, Hidden]]
CLOSE = 0.05  # in its logarithm, of the strength asked for
STILL_CLOSE = 0.3  # the same where sticking and sliding make strength a rough function of the magnitude


def edited(hand: Hand, change: Callable[[Description], None]) -> Hand:
    """The hand with both descriptions changed alike."""
    truth, nominal = copy.deepcopy(hand.truth), copy.deepcopy(hand.nominal)
    change(truth)
    change(nominal)
    return replace(hand, truth=truth, nominal=nominal)


KEYS = {"edge": "edge_friction", "pulley": "pulley_friction", "joint": "friction", "load": "load_friction"}


def law_at(data: Description, kind: str, at: tuple[int, ...]) -> Any:
    if kind in ("edge", "pulley"):
        return data["tendons"][at[0]][KEYS[kind]][at[1]]
    return data["joints"][at[0]].get(KEYS[kind])


def set_law(data: Description, kind: str, at: tuple[int, ...], law: Any) -> None:
    if kind in ("edge", "pulley"):
        data["tendons"][at[0]][KEYS[kind]][at[1]] = law
    else:
        data["joints"][at[0]][KEYS[kind]] = law


def law_places(data: Description) -> list[tuple[str, tuple[int, ...]]]:
    """All places where the description has a law."""
    m, n = len(data["tendons"]), len(data["joints"])
    every = [(kind, (i, j)) for kind in ("edge", "pulley") for i in range(m) for j in range(n)]
    every += [(kind, (j,)) for kind in ("joint", "load") for j in range(n)]
    return [(kind, at) for kind, at in every if law_at(data, kind, at) is not None]


def named(kind: str, at: tuple[int, ...]) -> dict[str, int | None]:
    """joint and tendon of a place, from 1. A pulley belongs to its own joint."""
    return {"joint": at[-1] + 1, "tendon": at[0] + 1 if kind in ("edge", "pulley") else None}


def chosen(rng: Random, items: list[Any]) -> Any:
    return items[int(rng.integers(len(items)))]


def effect_of(finger: Finger, kind: str, at: tuple[int, ...]) -> Effect:
    return next(effect for effect in finger.effects if (effect.kind, effect.at) == (kind, at))


def at_a_law(name: str, number: str, start: float, column: int) -> Builder:
    """viscous friction or the Stribeck effect that one law lacks: `column` of its sides gets magnitude·coulomb."""

    def build(hand: Hand, rng: Random) -> tuple[Hand, Hidden]:
        kind, at = chosen(rng, law_places(hand.truth))

        def absent(data: Description) -> None:
            law = law_at(data, kind, at)
            law["viscous" if number == "viscous" else "static"] = 0.0 if number == "viscous" else law["coulomb"]

        def change(finger: Finger, motion: Motion, magnitude: float) -> None:
            effect_of(finger, kind, at).sides[:, column] += magnitude

        law = law_at(hand.truth, kind, at)
        size = start * law["coulomb"] / (law["stribeck_velocity"] if number == "viscous" else 1.0)
        return edited(hand, absent), Hidden(name, **named(kind, at), magnitude=size, note=kind, finger=change)

    return build


def asymmetric(hand: Hand, rng: Random) -> tuple[Hand, Hidden]:
    kind, at = chosen(rng, law_places(hand.truth))
    sign = chosen(rng, [-1.0, 1.0])

    def change(finger: Finger, motion: Motion, magnitude: float) -> None:
        sides = effect_of(finger, kind, at).sides
        sides[0, 0] += sign * magnitude / 2.0
        sides[1, 0] -= sign * magnitude / 2.0
        if sides[:, 0].min() < 0.0:
            raise Unreachable("asymmetric_friction: one side would drive")

    size = 0.3 * law_at(hand.truth, kind, at)["coulomb"]
    return hand, Hidden("asymmetric_friction", **named(kind, at), magnitude=size, note=kind, finger=change)


def missing_law(name: str, kind: str, size: float, speed: float) -> Builder:
    """A whole friction effect that the nominal does not have; Coulomb, with a Stribeck effect every other time."""

    def build(hand: Hand, rng: Random) -> tuple[Hand, Hidden]:
        m, n = len(hand.truth["tendons"]), len(hand.truth["joints"])
        if kind == "pulley" and n < 2:
            raise Unreachable("pulley_friction: one joint alone has no pulley that a tendon runs over")
        at = (int(rng.integers(m)), int(rng.integers(n - (kind == "pulley")))) if kind in ("edge", "pulley") else (
            int(rng.integers(n)),)  # fmt: skip
        shape = np.array([1.0, 0.4 * (rng.random() < 0.5), speed, 0.0])
        memory = next(
            (
                row["displacement"]
                for row in hand.truth["extensions"]
                if row.get("tendon" if len(at) == 2 else "joint") == at[0] + 1
            ),
            None,
        )

        def change(finger: Finger, motion: Motion, magnitude: float) -> None:
            sides = np.tile(shape * [magnitude, magnitude, 1.0, 1.0], (2, 1))
            finger.effects.append(Effect(kind, at, sides, memory))

        bare = edited(hand, lambda data: set_law(data, kind, at, None))
        return bare, Hidden(name, **named(kind, at), magnitude=size, finger=change)

    return build


def added(
    name: str, size: float, place: Callable[[Hand, Random], dict[str, int]], torque: Callable[..., Array]
) -> Builder:
    """A torque beside the nominal's: torque(finger, motion, force, magnitude, place, random numbers) -> [N, n]."""

    def build(hand: Hand, rng: Random) -> tuple[Hand, Hidden]:
        at = place(hand, rng)
        draw = rng.uniform(-1.0, 1.0, 4)

        def change(finger: Finger, motion: Motion, magnitude: float) -> None:
            finger.extras.append(lambda motion, force: torque(finger, motion, force, magnitude, at, draw))

        return hand, Hidden(
            name,
            joint=at["joint"] + 1 if "joint" in at else None,
            tendon=at["tendon"] + 1 if "tendon" in at else None,
            magnitude=size,
            finger=change,
        )

    return build


def joint(hand: Hand, rng: Random) -> dict[str, int]:
    return {"joint": int(rng.integers(len(hand.truth["joints"])))}


def inner_joint(hand: Hand, rng: Random) -> dict[str, int]:
    if len(hand.truth["joints"]) < 2:
        raise Unreachable("joint_coupling: one joint alone has no next one")
    return {"joint": int(rng.integers(len(hand.truth["joints"]) - 1))}


def both(hand: Hand, rng: Random) -> dict[str, int]:
    return joint(hand, rng) | {"tendon": int(rng.integers(len(hand.truth["tendons"])))}


def held_sign(velocity: Array, threshold: float) -> Array:
    """Sign of the last velocity above the threshold, 0 before there was one."""
    last = last_true(np.abs(velocity) > threshold)
    return np.where(last >= 0, np.sign(velocity[last]), 0.0)


def hardening(finger: Finger, motion: Motion, force: Array, size: float, at: Any, draw: Array) -> Array:
    found = np.zeros_like(motion.angle)
    found[:, at["joint"]] = size * (motion.angle[:, at["joint"]] - finger.rest[at["joint"]]) ** 3
    return found


def weight(finger: Finger, motion: Motion, force: Array, size: float, at: Any, draw: Array) -> Array:
    """A link whose pitch is the sum of the angles before it; the base stands at a random tilt."""
    tilt = np.pi * draw[0]
    pitch = motion.angle[:, : at["joint"] + 1].sum(axis=1)
    found = np.zeros_like(motion.angle)
    found[:, : at["joint"] + 1] = (size * np.sin(pitch + tilt))[:, None]
    return found


def accelerated(finger: Finger, motion: Motion, force: Array, size: float, at: Any, draw: Array) -> Array:
    found = np.zeros_like(motion.angle)
    found[1:, at["joint"]] = size * np.diff(motion.velocity[:, at["joint"]]) / np.diff(motion.time)
    return found


def coupling(finger: Finger, motion: Motion, force: Array, size: float, at: Any, draw: Array) -> Array:
    j = at["joint"]
    twist = (motion.angle[:, j] - finger.rest[j]) - (motion.angle[:, j + 1] - finger.rest[j + 1])
    found = np.zeros_like(motion.angle)
    found[:, j], found[:, j + 1] = size * twist, -size * twist
    return found


def preload(finger: Finger, motion: Motion, force: Array, size: float, at: Any, draw: Array) -> Array:
    """A bushing before the joint that clamps the tendon whatever its force."""
    i, j = at["tendon"], at["joint"]
    found = np.zeros_like(motion.angle)
    drag = size * held_sign(motion.tendon[:, i, j], finger.tendon_threshold)
    found[:, j:] = drag[:, None] * finger.arms[i, j:]
    return found


def by_load(finger: Finger, motion: Motion, force: Array, size: float, at: Any, draw: Array) -> Array:
    found = np.zeros_like(motion.angle)
    sign = held_sign(motion.velocity[:, at["joint"]], finger.joint_threshold)
    found[:, at["joint"]] = size * np.abs(force[:, at["tendon"]]) * sign
    return found


def cover(hand: Hand, rng: Random) -> tuple[Hand, Hidden]:
    j = int(rng.integers(len(hand.truth["joints"])))

    def change(finger: Finger, motion: Motion, magnitude: float) -> None:
        finger.cover[j] = magnitude

    bare = edited(hand, lambda data: data["joints"][j].pop("cover", None))
    return bare, Hidden("cover_stiffness", joint=j + 1, magnitude=0.02, finger=change)


def some_place(hand: Hand, rng: Random, everywhere: bool) -> tuple[dict[str, int], list[tuple[str, tuple[int, ...]]]]:
    """A joint or a tendon that has friction (or, at times, the whole finger), and the laws there."""
    found = law_places(hand.truth)
    kind, at = chosen(rng, found)
    if everywhere and rng.random() < 0.4:
        return {}, found
    tendon = kind in ("edge", "pulley")
    laws = [(k, a) for k, a in found if (k in ("edge", "pulley")) == tendon and a[0] == at[0]]
    return {"tendon" if tendon else "joint": at[0] + 1}, laws


def presliding(hand: Hand, rng: Random) -> tuple[Hand, Hidden]:
    """At a place whose friction is scaled: with less of it there is less hysteresis, whatever its distance."""
    place, laws = some_place(hand, rng, everywhere=False)
    key = next(iter(place))
    distance = float(rng.uniform(1.5e-4, 5e-4) if key == "tendon" else rng.uniform(0.015, 0.05))

    def absent(data: Description) -> None:
        data["extensions"] = [row for row in data["extensions"] if row.get(key) != place[key]]

    def weaker(hand: Hand, magnitude: float) -> Hand:
        def change(data: Description) -> None:
            for kind, at in laws:
                law = law_at(data, kind, at)
                law |= {name: magnitude * law[name] for name in ("static", "coulomb", "viscous")}

        return edited(hand, change)

    def change(finger: Finger, motion: Motion, magnitude: float) -> None:
        for kind, at in laws:
            effect_of(finger, kind, at).memory = distance

    note = f"displacement {distance:.3g}"
    hidden = Hidden("presliding", **place, magnitude=1.0, note=note, hand=weaker, finger=change)
    return edited(hand, absent), hidden


def drift(hand: Hand, rng: Random) -> tuple[Hand, Hidden]:
    place, laws = some_place(hand, rng, everywhere=True)
    time_constant = float(rng.uniform(8.0, 30.0))
    sign = chosen(rng, [-1.0, 1.0])

    def change(finger: Finger, motion: Motion, magnitude: float) -> None:
        if sign * magnitude < -0.9:
            raise Unreachable("friction_drift: friction would turn round")
        growth = 1.0 + sign * magnitude * (1.0 - np.exp(-(motion.time - motion.time[0]) / time_constant))
        for kind, at in laws:
            effect_of(finger, kind, at).factor = growth

    note = f"time constant {time_constant:.1f} s"
    return hand, Hidden("friction_drift", **place, magnitude=0.3, note=note, finger=change)


BUILDERS: dict[str, Builder] = {
    "viscous_friction": at_a_law("viscous_friction", "viscous", 0.2, 3),
    "stribeck": at_a_law("stribeck", "drop", 0.5, 1),
    "asymmetric_friction": asymmetric,
    "edge_friction": missing_law("edge_friction", "edge", 0.03, 0.006),
    "pulley_friction": missing_law("pulley_friction", "pulley", 0.02, 0.006),
    "joint_friction": missing_law("joint_friction", "joint", 0.005, 0.3),
    "joint_load_friction": missing_law("joint_load_friction", "load", 1e-4, 0.3),
    "preload_friction": added("preload_friction", 0.5, both, preload),
    "load_friction": added("load_friction", 3e-4, both, by_load),
    "cover_stiffness": cover,
    "cover_hardening": added("cover_hardening", 0.05, joint, hardening),
    "gravity": added("gravity", 0.01, joint, weight),
    "inertia": added("inertia", 2e-4, joint, accelerated),
    "presliding": presliding,
    "friction_drift": drift,
    "joint_coupling": added("joint_coupling", 0.02, inner_joint, coupling),
    **SENSORS,
}


def placed(hand: Hand, effect: str, seed: int) -> tuple[Hand, Hidden]:
    """The hand without the effect in its descriptions, and the effect at a random place, at its usual magnitude."""
    builder = {**BUILDERS, **UNKNOWN}[effect]
    return builder(hand, np.random.default_rng([seed, 63]))


def hide(
    hand: Hand, effect: str, strength: float | None, *, seed: int, motion: int, seconds: float
) -> tuple[Hand, dict[str, Any]]:
    """The hand with an effect hidden in it, and its label.

    strength: of the recording of `motion` that lasts `seconds` (see strength.py); None: the usual magnitude.
    Raises Unreachable where no magnitude within a factor 300 of the usual one has that strength.
    """
    hand, hidden = placed(hand, effect, seed)
    return scaled(hand, hidden, strength, motion=motion, seconds=seconds)


def scaled(
    hand: Hand, hidden: Hidden, strength: float | None, *, motion: int, seconds: float
) -> tuple[Hand, dict[str, Any]]:
    """This hidden effect added to the hand at the magnitude that has the strength by itself, and its label."""
    size, seen, best = hidden.magnitude, None, None
    for _ in range(12):
        base = hand if hidden.hand is None else hidden.hand(hand, size)
        alone = replace(base, hidden=(replace(hidden, magnitude=size),))
        made = record(alone, motion, seconds, quiet=True)
        seen = look(base, made) if seen is None or hidden.hand is not None else seen
        found, share = surviving(seen, residual(base, made), hand)
        miss = 0.0 if strength is None else abs(np.log(max(found, 1e-300) / strength))
        best = (miss, size, found, share) if best is None or miss < best[0] else best
        if miss < CLOSE:
            break
        size *= float(np.clip(np.sqrt(strength / max(found, 1e-300)), 0.05, 20.0))
        if not hidden.magnitude / 300.0 < size < hidden.magnitude * 300.0:
            break
    assert best is not None
    miss, size, found, share = best
    if miss > STILL_CLOSE:
        raise Unreachable(f"{hidden.effect}: strength {found:.3g} at {size:.3g}, expected {strength}")
    label = {
        "effect": hidden.effect, "joint": hidden.joint, "tendon": hidden.tendon, "magnitude": size,
        "strength": found, "surviving_share": share, "note": hidden.note,
    }  # fmt: skip
    base = hand if hidden.hand is None else hidden.hand(hand, size)
    return replace(base, hidden=(*hand.hidden, replace(hidden, magnitude=size))), label
