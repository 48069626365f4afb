"""The cases of the hidden-effect campaign: `tendonfmu campaign` takes the file that this writes.

    python python_tests/hidden_effects/cases.py -o cases.json --null 300 --per-effect 10 --strengths 0.03 0.1
    tendonfmu campaign cases.json -o campaign --report rates.md

Every case is one maker (a function below) with a seed; the worker that runs it makes its finger and recordings.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Collection, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from effects_hidden import BUILDERS, placed, scaled
from experiments import perform_experiment
from hidden_unknown import UNKNOWN
from matched_rig import Hand, Made, Unreachable, random_hand, record
from numpy.typing import NDArray

Array = NDArray[Any]

VISIBLE = 0.02  # share that survives refitting, from which an effect counts as one that can be seen
ABSORBED = 0.005  # and up to which it counts as absorbed
ABSORBABLE = ("force_offset", "force_gain", "moment_arm", "gravity")
SLOW_TENSION = 8.0  # s: hands whose pretension hardly changes hide what scales with it
ATTEMPTS = 40  # fingers and places, of which the first suitable one is taken
OTHER_MOTION = 1_000_000  # added to the seed of the motion
MEASURED = {"test": 60.0, "reference": 240.0}  # s, of cases whose gain is measured: to measure it on, and the true one
PUSH = (0.08, 0.2)  # N·m, unlabelled contacts
PAIRS = (
    "load_friction",
    "preload_friction",
    "cover_hardening",
    "gravity",
    "inertia",
    "presliding",
    "friction_drift",
    "time_delay",
    "joint_coupling",
    "edge_friction",
    "joint_friction",
    "stribeck",
    "pulley_friction",
)


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
    """The options of every maker, with what is usual."""
    usual = {
        "joints": 2,
        "seconds": 60.0,
        "rate": 500.0,
        "presliding": False,
        "wander": 1.0,
        "test": 0.0,
        "reference": 0.0,
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
        "rig": "matched, presliding" if options["presliding"] else "matched, static", **keys,
    }  # fmt: skip
    for number, key in enumerate(("test", "reference"), start=1):
        if options[key] > 0:
            other = record(hand, seed + number * OTHER_MOTION, options[key])
            pq.write_table(pa.table(other.columns), folder / f"{key}.parquet")
            found[key] = [f"{key}.parquet"]
    facts = {name: options[name] for name in ("joints", "seconds", "rate", "wander")}
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


def absorbed(folder: Path, effect: str, seed: int, **given: Any) -> dict[str, Any]:
    """One effect that refitting absorbs, at its usual size."""
    options = settings(given)
    hand, label = suitable(effect, None, seed, options, absorbed=True)
    made = record(hand, seed, options["seconds"])
    found = files(folder, hand, made, seed, options, truth=[truth_of(label)], facts=facts_of(label))
    return found | {"experiment": f"{Path(__file__).resolve()}:perform"}


def perform(folder: Path, motion: dict[str, Any], effect: str, seed: int, **given: Any) -> str:
    """The experiment that a diagnosis of `absorbed` asks for, on the same hand."""
    hand, _ = suitable(effect, None, seed, settings(given), absorbed=True)
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


# --- the plan ---------------------------------------------------------------------------------------------------------


def planned(
    nulls: int, per_effect: int, strengths: list[float], doubles: int, seed: int, **options: Any
) -> Iterator[dict[str, Any]]:
    """All cases, every other on the presliding rig; groups alternate, so that a stopped campaign has some of each."""
    groups = [
        _nulls(nulls, seed, options),
        _singles(per_effect, strengths, seed, options),
        _doubles(doubles, seed, options),
        _absorbed(per_effect, seed, options),
        _unknown(per_effect, seed, options),
        _contacts(per_effect, seed, options),
    ]
    lists = [list(group) for group in groups]
    order = [(rank / len(cases), number, rank) for number, cases in enumerate(lists) for rank in range(len(cases))]
    for _, number, rank in sorted(order):
        yield lists[number][rank]


def _case(name: str, group: str, function: str, options: dict[str, Any], k: int, **arguments: Any) -> dict[str, Any]:
    given = options | arguments | {"presliding": k % 2 == 1}
    maker = f"{Path(__file__).name}:{function}"
    return {"name": name, "group": group, "maker": maker, "seed": arguments["seed"], "arguments": given}


def _nulls(count: int, seed: int, options: dict[str, Any]) -> Iterator[dict[str, Any]]:
    for k in range(count):
        wander = 3.0 if k % 4 >= 2 else 1.0
        joints = options["joints"] if k % 3 == 0 else 1
        yield _case(f"null_{k}", "null", "null", options, k, seed=seed + k, wander=wander, joints=joints)


def _singles(count: int, strengths: list[float], seed: int, options: dict[str, Any]) -> Iterator[dict[str, Any]]:
    for k in range(count):
        for strength in strengths:
            for number, effect in enumerate(BUILDERS):
                if effect != "force_offset":  # refitting always absorbs it
                    yield _case(
                        f"{effect}_{strength:g}_{k}", "single", "single", options, k + number,
                        effect=effect, strength=strength, seed=seed + 1000 + 100 * k + number,
                    )  # fmt: skip


def _doubles(count: int, seed: int, options: dict[str, Any]) -> Iterator[dict[str, Any]]:
    rng = np.random.default_rng([seed, 65])
    for k in range(count):
        effects = [str(name) for name in rng.choice(PAIRS, 2, replace=False)]
        static = "presliding" in effects
        yield _case(
            f"double_{k}", "double", "double", options, 0 if static else k,
            effects=effects, strength=0.3, seed=seed + 200_000 + k,
        )  # fmt: skip


def _absorbed(count: int, seed: int, options: dict[str, Any]) -> Iterator[dict[str, Any]]:
    for k in range(count):
        for effect in ABSORBABLE:
            yield _case(
                f"absorbed_{effect}_{k}", "absorbed", "absorbed", options, k, effect=effect, seed=seed + 300_000 + k
            )


def _unknown(count: int, seed: int, options: dict[str, Any]) -> Iterator[dict[str, Any]]:
    for k in range(count):
        for effect in UNKNOWN:
            for strength in (0.3, 1.0):
                name = f"{effect}_{strength:g}_{k}"
                yield _case(
                    name, "unknown", "single", options, k, effect=effect, strength=strength, seed=seed + 400_000 + k
                )


def _contacts(count: int, seed: int, options: dict[str, Any]) -> Iterator[dict[str, Any]]:
    for k in range(count):
        yield _case(f"contact_{k}", "contact", "contact", options, k, seed=seed + 500_000 + k)


def main() -> None:
    parser = argparse.ArgumentParser(description="Writes the cases of the hidden-effect campaign.")
    parser.add_argument("-o", "--output", type=Path, required=True, help="CASES.json")
    parser.add_argument("--null", type=int, default=300)
    parser.add_argument("--per-effect", type=int, default=10, help="cases of each effect and strength")
    parser.add_argument("--strengths", type=float, nargs="+", default=[0.03, 0.1])
    parser.add_argument("--double", type=int, default=100)
    parser.add_argument("--groups", nargs="+", help="of these groups only: null single double absorbed unknown contact")
    parser.add_argument(
        "--measured", action="store_true", help="with recordings to measure the gain on, and the true one"
    )
    parser.add_argument("--joints", type=int, default=2)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--rate", type=float, default=500.0)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    cases = list(
        planned(
            given.null, given.per_effect, given.strengths, given.double, given.seed,
            **(MEASURED if given.measured else {}), joints=given.joints, seconds=given.seconds, rate=given.rate,
        )
    )  # fmt: skip
    cases = [case for case in cases if not given.groups or case["group"] in given.groups]
    here = Path(__file__).resolve().parent
    for case in cases:
        case["maker"] = str(here / case["maker"])
    given.output.write_text(json.dumps({"format": "tendonfmu-campaign-1", "cases": cases}, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
