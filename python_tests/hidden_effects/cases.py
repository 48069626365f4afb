"""Makers of the matched cases of a campaign: one function a group, a case by its seed (campaign_plan.py lists them)."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from effects_hidden import placed, scaled
from experiments import perform_experiment
from hidden_unknown import UNKNOWN
from joint_strength import shown_strength
from matched_rig import Hand, Made, Unreachable, random_hand, record

Array = NDArray[Any]

VISIBLE = 0.02  # share that survives refitting, from which an effect counts as one that can be seen
ABSORBED = 0.005  # and up to which it counts as absorbed
SLOW_TENSION = 8.0  # s: hands whose pretension hardly changes hide what scales with it
ATTEMPTS = 40  # fingers and places, of which the first suitable one is taken
OTHER_MOTION = 1_000_000  # added to the seed of the motion
PUSH = (0.08, 0.2)  # N·m, unlabelled contacts


def fitting_hand(effects: Collection[str], seed: int, attempt: int, options: dict[str, Any]) -> Hand:
    """A finger on which the effects are possible, with the sensors that show them."""
    joints = options["joints"]
    source = 1 if "tendon_nonlinearity" in effects else 2
    if {"pulley_friction", "joint_coupling", "rubbing"} & set(effects):
        joints = max(joints, 2)  # tendons of one joint rub by its velocity: that is friction that grows with the load
    return random_hand(
        seed * 1000 + attempt,
        joints,
        presliding=options["presliding"],
        source=source,
        rate=options["rate"],
        wander=options["wander"],
    )


def settings(options: dict[str, Any]) -> dict[str, Any]:
    """The options of every maker, with what is usual. test: s; gain_recordings: how many of that length."""
    usual = {
        "joints": 2,
        "seconds": 60.0,
        "rate": 500.0,
        "presliding": False,
        "wander": 1.0,
        "test": 0.0,
        "gain_recordings": 0,
    }
    unknown = set(options) - set(usual)
    if unknown:
        raise ValueError(f"arguments.{min(unknown)}: unknown; expected {', '.join(usual)}")
    return usual | options


def files(folder: Path, hand: Hand, made: Made, seed: int, options: dict[str, Any], **keys: Any) -> dict[str, Any]:
    """What the campaign wants of a maker: recording, nominal, and recordings of other motions where asked for."""
    recording, nominal = made.write(folder)
    found = {
        "finger": nominal.name, "recordings": [recording.name], "kinematics": hand.source,
        "rig": "matched", **keys,
    }  # fmt: skip
    others = ["test.parquet"] if options["test"] > 0 else []
    others += [f"gain_{k + 1}.parquet" for k in range(options["gain_recordings"])]
    for number, name in enumerate(others, start=1):
        other = record(hand, seed + number * OTHER_MOTION, options["test"])
        pq.write_table(pa.table(other.columns), folder / name)
    found |= {key: names for key, names in (("test", others[:1]), ("gain_recordings", others[1:])) if names}
    facts = {name: options[name] for name in ("seconds", "rate", "wander")} | {"joints": len(hand.truth["joints"])}
    found["facts"] = facts | {"presliding": float(options["presliding"])} | keys.get("facts", {})
    return found


def truth_of(label: dict[str, Any]) -> dict[str, Any]:
    return {key: label[key] for key in ("effect", "joint", "tendon") if label[key] is not None}


def facts_of(label: dict[str, Any]) -> dict[str, Any]:
    return {key: label[key] for key in ("magnitude", "strength", "surviving_share", "note")}


def null(folder: Path, seed: int, **given: Any) -> dict[str, Any]:
    """Nothing hidden."""
    options = settings(given)
    hand = fitting_hand((), seed, 0, options)
    return files(folder, hand, record(hand, seed, options["seconds"]), seed, options)


def suitable(effect: str, strength: float | None, seed: int, options: dict[str, Any], absorbed: bool) -> Any:
    """The first finger and place at which the effect survives refitting, or is absorbed by it, as wanted."""
    for attempt in range(ATTEMPTS):
        hand = fitting_hand((effect,), seed, attempt, options)
        if absorbed:
            hand = replace(hand, tension_time=SLOW_TENSION)
        try:
            # first at its usual size: most places are refused by their share, and that takes one look
            bare, hidden = placed(hand, effect, seed + attempt)
            found, label = scaled(bare, hidden, None, motion=seed, seconds=options["seconds"])
            share = label["surviving_share"]
            if share > ABSORBED if absorbed else share < VISIBLE:
                continue
            if strength is not None:
                found, label = scaled(bare, hidden, strength, motion=seed, seconds=options["seconds"])
        except Unreachable:
            continue
        return found, label
    raise Unreachable(f"{effect}: no finger of {ATTEMPTS} where it has strength {strength}; expected another seed")


def single(folder: Path, effect: str, strength: float, seed: int, **given: Any) -> dict[str, Any]:
    """One effect, of the list or not, at a strength."""
    options = settings(given)
    hand, label = suitable(effect, strength, seed, options, absorbed=False)
    truth = {"effect": "unknown"} if effect in UNKNOWN else truth_of(label)
    facts = facts_of(label) | {"hidden": effect}
    made = record(hand, seed, options["seconds"])
    return files(folder, hand, made, seed, options, truth=[truth], facts=facts)


@lru_cache(maxsize=1)  # the experiment is made by the same finger, in the process that made the first recording
def absorbing(effect: str, seed: int, given: tuple[tuple[str, Any], ...]) -> Any:
    return suitable(effect, None, seed, settings(dict(given)), absorbed=True)


def absorbed(folder: Path, effect: str, seed: int, **given: Any) -> dict[str, Any]:
    """One effect that refitting absorbs, at its usual size; and how strong it is where a motion shows it best."""
    options = settings(given)
    hand, label = absorbing(effect, seed, tuple(sorted(given.items())))
    made = record(hand, seed, options["seconds"])
    facts = facts_of(label) | {"shown_strength": shown_strength(hand, seed, options["seconds"])}
    found = files(folder, hand, made, seed, options, truth=[truth_of(label)], facts=facts)
    return found | {"experiment": f"{Path(__file__).resolve()}:perform"}


def perform(folder: Path, motion: dict[str, Any], effect: str, seed: int, **given: Any) -> str:
    """The experiment that a diagnosis of `absorbed` asks for, on the same hand."""
    hand, _ = absorbing(effect, seed, tuple(sorted(given.items())))
    made = perform_experiment(hand, motion, seed)
    pq.write_table(pa.table(made.columns), folder / "experiment.parquet")
    return "experiment.parquet"


def double(folder: Path, effects: list[str], strength: float, seed: int, **given: Any) -> dict[str, Any]:
    """Two effects, each of the strength by itself."""
    options = settings(given)
    for attempt in range(ATTEMPTS):
        hand = fitting_hand(effects, seed, attempt, options)
        try:
            hidden = []
            for k, effect in enumerate(effects):  # both are taken out of the descriptions before either is scaled
                hand, each = placed(hand, effect, 2 * (seed + attempt) + k)
                hidden.append(each)
            labels = []
            for each in hidden:
                bare = replace(hand, hidden=())
                with_it, label = scaled(bare, each, strength, motion=seed, seconds=options["seconds"])
                if label["surviving_share"] < VISIBLE:
                    raise Unreachable(f"{each.effect}: absorbed")
                labels.append((label, with_it))
        except (Unreachable, StopIteration):
            continue
        both = labels[-1][1] if hidden[0].hand is None else labels[0][1]
        own = [with_it.hidden[0] for _, with_it in labels]
        both = replace(both, hidden=tuple(own))
        facts = {"strength": labels[0][0]["strength"], "second": labels[1][0]["strength"]}
        made = record(both, seed, options["seconds"])
        return files(folder, both, made, seed, options, truth=[truth_of(label) for label, _ in labels], facts=facts)
    raise Unreachable(f"{effects}: no finger of {ATTEMPTS} with both; expected another seed")


def contact(folder: Path, seed: int, **given: Any) -> dict[str, Any]:
    """Nothing hidden, but somebody touches the finger a few times and no label says so."""
    options = settings(given)
    hand = fitting_hand((), seed, 0, options)
    rng = np.random.default_rng([seed, 64])
    time = np.arange(round(options["seconds"] * hand.rate)) / hand.rate
    load = np.zeros((len(time), options["joints"]))
    for begin in np.sort(rng.uniform(2.0, options["seconds"] - 2.0, 3)):
        length, joint = rng.uniform(0.3, 1.0), int(rng.integers(options["joints"]))
        phase = np.clip((time - begin) / length, 0.0, 1.0)
        load[:, joint] += rng.uniform(*PUSH) * rng.choice([-1.0, 1.0]) * np.sin(np.pi * phase)
    made = record(hand, seed, options["seconds"], external=load)
    return files(folder, hand, made, seed, options, truth=[{"effect": "contact"}])
