"""Matched rigs that hide something, by their seed, for `diagnose`."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import pandas as pd

from hidden_effects import UNKNOWN, placed, scaled
from matched_rig import Hand, Unreachable, random_hand, record
from tendonfmu.diagnosis import Diagnosis, diagnose

VISIBLE = 0.02  # share that survives refitting, from which an effect counts as one that can be seen
ABSORBED = 0.005  # and up to which it counts as absorbed
SLOW_TENSION = 8.0  # s: hands whose pretension hardly changes hide what scales with it
ATTEMPTS = 40  # fingers and places, of which the first suitable one is taken
OTHER_MOTION = 1_000_000  # added to the seed of the motion


class Truth(NamedTuple):
    effects: tuple[str, ...]
    joint: int | None  # from 1
    tendon: int | None


@dataclass(frozen=True)
class Options:
    """What a matched case is made of."""

    joints: int = 2
    seconds: float = 60.0
    rate: float = 500.0  # Hz
    presliding: bool = False
    wander: float = 1.0  # factor of the bias's random walk
    test: float = 0.0  # s


@dataclass(frozen=True)
class Case:
    """A nominal description, what was recorded of the hand, and what is hidden in it."""

    hand: Hand
    recording: pd.DataFrame
    test: Sequence[pd.DataFrame]
    seed: int
    truths: tuple[Truth, ...] = ()  # one for each hidden effect that the list has
    facts: Mapping[str, Any] = field(default_factory=dict)  # magnitude, strength and surviving share of the first one

    def diagnosed(self) -> Diagnosis:
        hand = self.hand
        return diagnose(hand.nominal, [self.recording], self.test, kinematics=hand.source, seed=self.seed)


def null(seed: int, options: Options) -> Case:
    """Nothing hidden."""
    return _case(_fitting_hand((), seed, 0, options), seed=seed, options=options)


def single(seed: int, options: Options, effect: str, strength: float) -> Case:
    """One effect, of the list or not, at a strength."""
    return _case(*_suitable(effect, strength, seed, options, absorbed=False), options=options, seed=seed)


def absorbed(seed: int, options: Options, effect: str) -> Case:
    """One effect that refitting absorbs, at its usual size."""
    return _case(*_suitable(effect, None, seed, options, absorbed=True), options=options, seed=seed)


def double(seed: int, options: Options, effects: Sequence[str], strength: float) -> Case:
    """Two effects, each of the strength by itself."""
    for attempt in range(ATTEMPTS):
        hand = _fitting_hand(effects, seed, attempt, options)
        try:
            hidden = []
            for k, effect in enumerate(effects):  # both are taken out of the descriptions before either is scaled
                hand, placed_effect = placed(hand, effect, 2 * (seed + attempt) + k)
                hidden.append(placed_effect)
            made = [
                scaled(replace(hand, hidden=()), effect, strength, motion=seed, seconds=options.seconds)
                for effect in hidden
            ]
        except (Unreachable, StopIteration):
            continue
        if any(label["surviving_share"] < VISIBLE for _, label in made):
            continue
        base = made[1][0] if hidden[0].hand is None else made[0][0]
        both = replace(base, hidden=tuple(hand.hidden[0] for hand, _ in made))
        return _case(both, *(label for _, label in made), seed=seed, options=options)
    raise Unreachable(f"{effects}: no finger of {ATTEMPTS} with both; expected another seed")


def _fitting_hand(effects: Collection[str], seed: int, attempt: int, options: Options) -> Hand:
    """A finger on which the effects are possible, with the sensors that show them."""
    joints = options.joints
    if {"pulley_friction", "joint_coupling"} & set(effects):
        joints = max(joints, 2)
    return random_hand(
        seed * 1000 + attempt,
        joints,
        presliding=options.presliding,
        source=1 if "tendon_nonlinearity" in effects else 2,
        rate=options.rate,
        wander=options.wander,
    )


def _suitable(
    effect: str, strength: float | None, seed: int, options: Options, absorbed: bool
) -> tuple[Hand, dict[str, Any]]:
    """The first finger and place at which the effect survives refitting, or is absorbed by it, as wanted."""
    for attempt in range(ATTEMPTS):
        hand = _fitting_hand((effect,), seed, attempt, options)
        if absorbed:
            hand = replace(hand, tension_time=SLOW_TENSION)
        try:
            # first at its usual size: most places are refused by their share, and that takes one look
            bare, hidden = placed(hand, effect, seed + attempt)
            hand, label = scaled(bare, hidden, None, motion=seed, seconds=options.seconds)
            share = label["surviving_share"]
            if share > ABSORBED if absorbed else share < VISIBLE:
                continue
            if strength is not None:
                hand, label = scaled(bare, hidden, strength, motion=seed, seconds=options.seconds)
        except Unreachable:
            continue
        return hand, label
    raise Unreachable(f"{effect}: no finger of {ATTEMPTS} where it has strength {strength}; expected another seed")


def _case(hand: Hand, *labels: Mapping[str, Any], seed: int, options: Options) -> Case:
    """The recording, and one of another motion if that is asked for."""
    test = [record(hand, seed + OTHER_MOTION, options.test)] if options.test else []
    return Case(
        hand=hand,
        recording=pd.DataFrame(record(hand, seed, options.seconds).columns),
        test=[pd.DataFrame(made.columns) for made in test],
        seed=seed,
        truths=tuple(
            Truth((label["effect"],), label["joint"], label["tendon"])
            for label in labels
            if label["effect"] not in UNKNOWN
        ),
        facts=labels[0] if labels else {},
    )
