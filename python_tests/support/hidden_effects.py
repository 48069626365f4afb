"""What the matched rig can hide: every effect that `diagnose` may name, and two that it may not.

Each builder takes the effect out of both descriptions at a random place and says how the true finger differs by one
magnitude; `hide` scales it to a strength. Formulas are physics written here. Places count from 0, in `Hidden` from 1.
"""

from __future__ import annotations

import copy
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.signal import lfilter

from hidden_sensors import SENSORS, Random
from matched_physics import Array, Description, Effect, Finger, Motion, build_up, held_sign
from matched_rig import Hand, Hidden, Unreachable, record
from matched_strength import look, residual, surviving

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
    at_tendons = [(kind, (i, j)) for kind in ("edge", "pulley") for i in range(m) for j in range(n)]
    every = [*at_tendons, *((kind, (j,)) for kind in ("joint", "load") for j in range(n))]
    return [(kind, at) for kind, at in every if law_at(data, kind, at) is not None]


def named(kind: str, at: tuple[int, ...]) -> tuple[int, int | None]:
    """Joint and tendon of a place, from 1. A pulley belongs to its own joint."""
    return at[-1] + 1, at[0] + 1 if kind in ("edge", "pulley") else None


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
        return edited(hand, absent), Hidden(name, *named(kind, at), magnitude=size, note=kind, finger=change)

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
    return hand, Hidden("asymmetric_friction", *named(kind, at), magnitude=size, note=kind, finger=change)


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
        return bare, Hidden(name, *named(kind, at), magnitude=size, finger=change)

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


def at_joints(motion: Motion, joints: int | slice, torque: Array) -> Array:
    """[N, n] a torque at some joints."""
    torques = np.zeros_like(motion.angle)
    torques[:, joints] = torque
    return torques


def hardening(finger: Finger, motion: Motion, force: Array, size: float, at: Any, draw: Array) -> Array:
    j = at["joint"]
    return at_joints(motion, j, size * (motion.angle[:, j] - finger.rest[j]) ** 3)


def weight(finger: Finger, motion: Motion, force: Array, size: float, at: Any, draw: Array) -> Array:
    """A link whose pitch is the sum of the angles before it; the base stands at a random tilt."""
    before = slice(at["joint"] + 1)
    pitch = motion.angle[:, before].sum(axis=1)
    return at_joints(motion, before, (size * np.sin(pitch + np.pi * draw[0]))[:, None])


def accelerated(finger: Finger, motion: Motion, force: Array, size: float, at: Any, draw: Array) -> Array:
    torque = np.zeros(len(motion.time))
    torque[1:] = size * np.diff(motion.velocity[:, at["joint"]]) / np.diff(motion.time)
    return at_joints(motion, at["joint"], torque)


def coupling(finger: Finger, motion: Motion, force: Array, size: float, at: Any, draw: Array) -> Array:
    j = at["joint"]
    twist = (motion.angle[:, j] - finger.rest[j]) - (motion.angle[:, j + 1] - finger.rest[j + 1])
    return at_joints(motion, slice(j, j + 2), np.column_stack([size * twist, -size * twist]))


def built_up(finger: Finger, motion: Motion, tendon: int | None, joint: int) -> Array:
    """[N] friction over the most it may be: it builds up as the other friction of its tendon or joint does."""
    kinds, at = (("joint", "load"), joint) if tendon is None else (("edge", "pulley"), tendon)
    velocity = motion.velocity[:, joint] if tendon is None else motion.tendon[:, tendon, joint]
    known = (effect.memory for effect in finger.effects if effect.kind in kinds and effect.at[0] == at)
    memory = next((memory for memory in known if memory is not None), None)
    if memory is not None:
        return build_up(velocity, motion.time, memory)
    return held_sign(velocity, finger.joint_threshold if tendon is None else finger.tendon_threshold)


def preload(finger: Finger, motion: Motion, force: Array, size: float, at: Any, draw: Array) -> Array:
    """A bushing before the joint that clamps the tendon whatever its force."""
    i, j = at["tendon"], at["joint"]
    drag = size * built_up(finger, motion, i, j)
    return at_joints(motion, slice(j, None), drag[:, None] * finger.arms[i, j:])


def by_load(finger: Finger, motion: Motion, force: Array, size: float, at: Any, draw: Array) -> Array:
    sign = built_up(finger, motion, None, at["joint"])
    return at_joints(motion, at["joint"], size * np.abs(force[:, at["tendon"]]) * sign)


def cover(hand: Hand, rng: Random) -> tuple[Hand, Hidden]:
    j = int(rng.integers(len(hand.truth["joints"])))

    def change(finger: Finger, motion: Motion, magnitude: float) -> None:
        finger.cover[j] = magnitude

    bare = edited(hand, lambda data: data["joints"][j].pop("cover", None))
    return bare, Hidden("cover_stiffness", joint=j + 1, magnitude=0.02, finger=change)


def some_place(hand: Hand, rng: Random, everywhere: bool) -> tuple[dict[str, int], list[tuple[str, tuple[int, ...]]]]:
    """A joint or a tendon that has friction (or, at times, the whole finger), and the laws there."""
    every = law_places(hand.truth)
    kind, at = chosen(rng, every)
    if everywhere and rng.random() < 0.4:
        return {}, every
    tendon = kind in ("edge", "pulley")
    laws = [(k, a) for k, a in every if (k in ("edge", "pulley")) == tendon and a[0] == at[0]]
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
    hidden = Hidden(
        "presliding", place.get("joint"), place.get("tendon"), magnitude=1.0, note=note, hand=weaker, finger=change
    )
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
    return hand, Hidden(
        "friction_drift", place.get("joint"), place.get("tendon"), magnitude=0.3, note=note, finger=change
    )


# --- not on the list of effects: the right answer is `unknown` --------------------------------------------------------


def periodic(hand: Hand, rng: Random) -> tuple[Hand, Hidden]:
    """A torque that comes and goes in time alone, such as the cogging of a motor that turns by itself; half beat."""
    j = int(rng.integers(len(hand.truth["joints"])))
    frequency, phase = float(np.exp(rng.uniform(np.log(0.6), np.log(3.0)))), float(rng.uniform(0.0, 2.0 * np.pi))
    beat = float(rng.uniform(0.05, 0.2)) if rng.random() < 0.5 else 0.0

    def change(finger: Finger, motion: Motion, magnitude: float) -> None:
        def torque(motion: Motion, force: Array) -> Array:
            envelope = np.cos(2.0 * np.pi * beat * motion.time)
            return at_joints(motion, j, magnitude * envelope * np.sin(2.0 * np.pi * frequency * motion.time + phase))

        finger.extras.append(torque)

    return hand, Hidden("periodic", joint=j + 1, magnitude=0.002, note=f"{frequency:.2f} Hz", finger=change)


def ageing(hand: Hand, rng: Random) -> tuple[Hand, Hidden]:
    """Friction of a tendon that remembers for seconds how much it slid: it falls while it slides and heals at rest."""
    with_edge = [i for i, tendon in enumerate(hand.truth["tendons"]) if any(law for law in tendon["edge_friction"])]
    if not with_edge:
        raise Unreachable("ageing: no tendon has an edge that rubs")
    i = chosen(rng, with_edge)
    memory = float(rng.uniform(2.0, 5.0))

    def change(finger: Finger, motion: Motion, magnitude: float) -> None:
        share = 1.0 - np.exp(-(motion.time[1] - motion.time[0]) / memory)
        slides = np.minimum(np.abs(motion.tendon[:, i, 0]) / 0.005, 1.0)
        level = lfilter([share], [1.0, share - 1.0], slides)
        factor = 1.0 - magnitude * (level - level.mean())
        if factor.min() < 0.02:
            raise Unreachable("ageing: friction would turn round")
        for effect in finger.effects:
            if effect.kind in ("edge", "pulley") and effect.at[0] == i:
                effect.factor = factor

    return hand, Hidden("ageing", tendon=i + 1, magnitude=0.5, note=f"memory {memory:.1f} s", finger=change)


UNKNOWN: dict[str, Builder] = {"periodic": periodic, "ageing": ageing}

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

    strength: of the recording of `motion` that lasts `seconds` (matched_strength.py); None: the usual magnitude.
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
        reached, share = surviving(seen, residual(base, made), hand)
        miss = 0.0 if strength is None else abs(np.log(max(reached, 1e-300) / strength))
        best = (miss, size, reached, share) if best is None or miss < best[0] else best
        if miss < CLOSE:
            break
        assert strength is not None  # without one the first size is taken
        size *= float(np.clip(np.sqrt(strength / max(reached, 1e-300)), 0.05, 20.0))
        if not hidden.magnitude / 300.0 < size < hidden.magnitude * 300.0:
            break
    assert best is not None
    miss, size, reached, share = best
    if miss > STILL_CLOSE:
        raise Unreachable(f"{hidden.effect}: strength {reached:.3g} at {size:.3g}, expected {strength}")
    label = {
        "effect": hidden.effect, "joint": hidden.joint, "tendon": hidden.tendon, "magnitude": size,
        "strength": reached, "surviving_share": share, "note": hidden.note,
    }  # fmt: skip
    base = hand if hidden.hand is None else hidden.hand(hand, size)
    return replace(base, hidden=(*hand.hidden, replace(hidden, magnitude=size))), label
