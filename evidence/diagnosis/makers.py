"""What makes the cases of a campaign by their seed: matched rigs that hide something."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import pandas as pd

from evidence.diagnosis.case import Case
from evidence.diagnosis.hidden_effects import UNKNOWN, placed, scaled
from evidence.fingers.matched_rig import Hand, Unreachable, random_hand, record
from evidence.judge import Truth

VISIBLE = 0.02  # share that survives refitting, from which an effect counts as one that can be seen
ABSORBED = 0.005  # and up to which it counts as absorbed
SLOW_TENSION = 8.0  # s: hands whose pretension hardly changes hide what scales with it
ATTEMPTS = 40  # fingers and places, of which the first suitable one is taken
OTHER_MOTION = 1_000_000  # added to the seed of the motion


@dataclass(frozen=True)
class Plan:
    """A case to be made."""

    name: str
    group: str  # null, single, double, absorbed (one effect that refitting hides), unknown (not on the list)
    seed: int
    maker: Callable[..., Case]  # a function of this module, called where the case runs
    arguments: Mapping[str, Any]

    def make(self) -> Case:
        return replace(self.maker(self.seed, **self.arguments), seed=self.seed)


@dataclass(frozen=True)
class Options:
    """What a matched case is made of."""

    joints: int = 2
    seconds: float = 60.0
    rate: float = 500.0  # Hz
    presliding: bool = False
    wander: float = 1.0  # factor of the bias's random walk
    test: float = 0.0  # s
    gain_recordings: int = 0  # as long as the test


# --- matched rigs -----------------------------------------------------------------------------------------------------


def null(seed: int, options: Options) -> Case:
    """Nothing hidden."""
    return _case(_fitting_hand((), seed, 0, options), seed, options)


def single(seed: int, options: Options, effect: str, strength: float) -> Case:
    """One effect, of the list or not, at a strength."""
    hand, label = _suitable(effect, strength, seed, options, absorbed=False)
    truths = () if effect in UNKNOWN else (_truth_of(label),)
    return _case(hand, seed, options, truths, _facts_of(label) | {"hidden": effect})


def absorbed(seed: int, options: Options, effect: str) -> Case:
    """One effect that refitting absorbs, at its usual size."""
    hand, label = _suitable(effect, None, seed, options, absorbed=True)
    return _case(hand, seed, options, (_truth_of(label),), _facts_of(label))


def double(seed: int, options: Options, effects: Sequence[str], strength: float) -> Case:
    """Two effects, each of the strength by itself."""
    for attempt in range(ATTEMPTS):
        hand = _fitting_hand(effects, seed, attempt, options)
        try:
            hidden = []
            for k, effect in enumerate(effects):  # both are taken out of the descriptions before either is scaled
                hand, placed_effect = placed(hand, effect, 2 * (seed + attempt) + k)
                hidden.append(placed_effect)
            scaled_hands, labels = [], []
            for placed_effect in hidden:
                scaled_hand, label = scaled(
                    replace(hand, hidden=()), placed_effect, strength, motion=seed, seconds=options.seconds
                )
                if label["surviving_share"] < VISIBLE:
                    raise Unreachable(f"{placed_effect.effect}: absorbed")
                scaled_hands.append(scaled_hand)
                labels.append(label)
        except (Unreachable, StopIteration):
            continue
        base = scaled_hands[1] if hidden[0].hand is None else scaled_hands[0]
        both = replace(base, hidden=tuple(scaled_hand.hidden[0] for scaled_hand in scaled_hands))
        facts = {"strength": labels[0]["strength"], "second": labels[1]["strength"]}
        return _case(both, seed, options, tuple(map(_truth_of, labels)), facts)
    raise Unreachable(f"{effects}: no finger of {ATTEMPTS} with both; expected another seed")


def _fitting_hand(effects: Collection[str], seed: int, attempt: int, options: Options) -> Hand:
    """A finger on which the effects are possible, with the sensors that show them."""
    joints = options.joints
    if {"pulley_friction", "joint_coupling", "rubbing"} & set(effects):
        joints = max(joints, 2)  # tendons of one joint rub by its velocity: that is friction that grows with the load
    return random_hand(
        seed * 1000 + attempt,
        joints,
        presliding=options.presliding,
        source=1 if "tendon_nonlinearity" in effects else 2,
        rate=options.rate,
        wander=options.wander,
    )


def _suitable(effect: str, strength: float | None, seed: int, options: Options, absorbed: bool) -> Any:
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


def _case(
    hand: Hand,
    seed: int,
    options: Options,
    truths: tuple[Truth, ...] = (),
    facts: Mapping[str, Any] | None = None,
) -> Case:
    """The recording, and those of other motions that are asked for."""
    motions = (options.test > 0) + options.gain_recordings
    others = [record(hand, seed + number * OTHER_MOTION, options.test) for number in range(1, motions + 1)]
    frames = [pd.DataFrame(made.columns) for made in others]
    known = {"joints": len(hand.truth["joints"]), "wander": options.wander, "presliding": options.presliding}
    return Case(
        machine="matched",
        finger=hand.nominal,
        recordings=[pd.DataFrame(record(hand, seed, options.seconds).columns)],
        kinematics=hand.source,
        truths=truths,
        test=frames[:1],
        gain_recordings=frames[1:],
        facts=known | dict(facts or {}),
    )


def _truth_of(label: Mapping[str, Any]) -> Truth:
    return Truth((label["effect"],), label["joint"], label["tendon"])


def _facts_of(label: Mapping[str, Any]) -> dict[str, Any]:
    return {key: label[key] for key in ("magnitude", "strength", "surviving_share", "note")}
