"""Lists the cases of a campaign: matched rigs and foreign families, fingers of 1, 2 and 4 joints.

    python python_tests/hidden_effects/campaign_plan.py -o cases.json
    tendonfmu campaign cases.json -o campaign --report rates.md

Every case is a maker (cases.py, ../foreign/seeded_cases.py) with a seed; the worker that runs it makes its finger and
recordings. Groups are spread evenly over the list, each in random order, so that a campaign that is cut has some of
each.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from effects_hidden import BUILDERS
from hidden_unknown import UNKNOWN

MATCHED = Path(__file__).resolve().parent / "cases.py"
FOREIGN = MATCHED.parents[1] / "foreign" / "seeded_cases.py"

STRENGTHS = (0.03, 0.1, 0.3)
UNKNOWN_STRENGTHS = (0.3, 1.0)
ABSORBABLE = ("force_gain", "moment_arm", "gravity", "force_offset")
# The gain is measured on a test recording (s), and the true one on several of the same length: friction drifts anew in
# each of them.
MEASURED = {"test": 60.0, "gain_recordings": 4}
LEAST_MEASURED = 0.1  # strength of single effects; weaker ones seldom have a cause, and so no gain
# Four joints take five times as long as two: few of them keep the whole within some hours of processor time.
JOINTS, SHARES = (1, 2, 4), (0.52, 0.42, 0.06)
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
# Numbers of the plans of both families that fit a campaign: at most 500 Hz, and an effect that refitting does not take.
NUMPY_NULL, NUMPY_SINGLE, NUMPY_UNKNOWN = (1, 2, 3, 4, 5), (6, 8, 9, 10, 11, 12, 13, 14, 16, 18), (17, 19, 22)
MUJOCO_NULL, MUJOCO_UNKNOWN, MUJOCO_CONTACT = (1, 2, 20), (17, 18, 22), (15,)
MUJOCO_SINGLE = (3, 5, 6, 8, 10, 11, 12, 13, 14, 16, 21, 24)
SECOND_JOINT = (6, 10, 12, 16, 17, 18, 24)  # plans whose effect is at joint 2, or at a tendon of it
FOREIGN_SECONDS, FOREIGN_GAIN, FOREIGN_RATE = 45.0, 4, 500.0  # s, recordings of that length, Hz

Listed = dict[str, Any]
Options = Mapping[str, Any]


def planned(counts: argparse.Namespace) -> Iterator[Listed]:
    """All cases, each kind in random order and spread evenly over the whole."""
    options = {"seconds": counts.seconds, "rate": counts.rate}
    seed, foreign = counts.seed, counts.foreign
    kinds = [
        _nulls(counts.null, seed, options),
        _singles(counts.per_effect, counts.strengths, seed, options),
        _doubles(counts.double, seed, options | MEASURED),
        _absorbed(counts.absorbed, seed, options),
        _unknown(counts.unknown, seed, options),
        _contacts(counts.contact, seed, options),
        _foreign("null", NUMPY_NULL, MUJOCO_NULL, 5 * foreign, 5 * foreign, seed),
        _foreign("single", NUMPY_SINGLE, MUJOCO_SINGLE, foreign, 2 * foreign, seed),
        _foreign("unknown", NUMPY_UNKNOWN, MUJOCO_UNKNOWN, 2 * foreign, 2 * foreign, seed),
        _foreign("contact", (), MUJOCO_CONTACT, 0, 2 * foreign, seed),
    ]
    random = np.random.default_rng([seed, 68])
    lists = [_shuffled(list(kind), random) for kind in kinds]
    order = [(rank / len(cases), number, rank) for number, cases in enumerate(lists) for rank in range(len(cases))]
    for _, number, rank in sorted(order):
        yield lists[number][rank]


def _shuffled(cases: list[Listed], random: np.random.Generator) -> list[Listed]:
    return [cases[k] for k in random.permutation(len(cases))]


def _case(name: str, group: str, maker: Path, function: str, **arguments: Any) -> Listed:
    return {
        "name": name, "group": group, "maker": f"{maker}:{function}",
        "seed": arguments["seed"], "arguments": arguments,
    }  # fmt: skip


def _matched(name: str, group: str, function: str, seed: int, options: Options, **arguments: Any) -> Listed:
    """joints and presliding by chance, unless they are given."""
    rng = np.random.default_rng([seed, 67])
    by_chance = {"joints": int(rng.choice(JOINTS, p=SHARES)), "presliding": bool(rng.random() < 0.5)}
    return _case(name, group, MATCHED, function, **{**by_chance, **options, **arguments, "seed": seed})


def _nulls(count: int, seed: int, options: Options) -> Iterator[Listed]:
    for k in range(count):
        yield _matched(f"null_{k}", "null", "null", seed + k, options, wander=3.0 if k % 2 else 1.0)


def _singles(count: int, strengths: Sequence[float], seed: int, options: Options) -> Iterator[Listed]:
    effects = [effect for effect in BUILDERS if effect != "force_offset"]  # refitting always absorbs it
    for k in range(count):
        for rank, strength in enumerate(strengths):
            for number, effect in enumerate(effects):
                own = seed + 100_000 + 1000 * k + 100 * rank + number
                name = f"{effect}_{strength:g}_{k}"
                measured = {} if strength < LEAST_MEASURED else MEASURED
                yield _matched(name, "single", "single", own, options | measured, effect=effect, strength=strength)


def _doubles(count: int, seed: int, options: Options) -> Iterator[Listed]:
    rng = np.random.default_rng([seed, 65])
    for k in range(count):
        effects = [str(name) for name in rng.choice(PAIRS, 2, replace=False)]
        static = {"presliding": False} if "presliding" in effects else {}
        own = options | static
        yield _matched(f"double_{k}", "double", "double", seed + 200_000 + k, own, effects=effects, strength=0.3)


def _absorbed(count: int, seed: int, options: Options) -> Iterator[Listed]:
    for k in range(count):
        effect = ABSORBABLE[k % len(ABSORBABLE)]
        yield _matched(f"absorbed_{effect}_{k}", "absorbed", "absorbed", seed + 300_000 + k, options, effect=effect)


def _unknown(count: int, seed: int, options: Options) -> Iterator[Listed]:
    kinds = [(effect, strength) for strength in UNKNOWN_STRENGTHS for effect in UNKNOWN]
    for k in range(count):
        effect, strength = kinds[k % len(kinds)]
        name = f"{effect}_{strength:g}_{k}"
        yield _matched(name, "unknown", "single", seed + 400_000 + k, options, effect=effect, strength=strength)


def _contacts(count: int, seed: int, options: Options) -> Iterator[Listed]:
    for k in range(count):
        yield _matched(f"contact_{k}", "contact", "contact", seed + 500_000 + k, options)


def _foreign(
    group: str, in_numpy: Sequence[int], in_mujoco: Sequence[int], times_numpy: int, times_mujoco: int, seed: int
) -> Iterator[Listed]:
    """Every plan so many times, numpy and MuJoCo in turn."""
    own = seed + 600_000
    lists = [
        [_numpy(group, number, k, own + k) for k in range(times_numpy) for number in in_numpy],
        [_mujoco(group, number, k, own + 100 * number + k) for k in range(times_mujoco) for number in in_mujoco],
    ]
    for rank in range(max(map(len, lists))):
        yield from (cases[rank] for cases in lists if rank < len(cases))


def _numpy(group: str, number: int, k: int, seed: int) -> Listed:
    name = f"numpy_{group}_{number:02d}_{k}"
    return _case(
        name, group, FOREIGN, "numpy_finger", number=number, seed=seed,
        seconds=FOREIGN_SECONDS, gain_recordings=FOREIGN_GAIN,
    )  # fmt: skip


def _mujoco(group: str, number: int, k: int, seed: int) -> Listed:
    joints = int(np.random.default_rng([seed, 67]).choice(JOINTS, p=SHARES))
    if number in SECOND_JOINT:
        joints = max(joints, 2)
    name = f"mujoco_{group}_{number:02d}_{k}"
    return _case(
        name, group, FOREIGN, "mujoco_finger", number=number, seed=seed, joints=joints,
        seconds=FOREIGN_SECONDS, rate=FOREIGN_RATE,
    )  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, required=True, help="CASES.json")
    parser.add_argument("--null", type=int, default=460, help="matched cases with nothing hidden")
    parser.add_argument("--per-effect", type=int, default=4, help="matched cases of each effect and strength")
    parser.add_argument("--strengths", type=float, nargs="+", default=STRENGTHS)
    parser.add_argument("--double", type=int, default=60, help="matched pairs")
    parser.add_argument("--absorbed", type=int, default=80)
    parser.add_argument("--unknown", type=int, default=48, help="matched cases with an effect that the list lacks")
    parser.add_argument("--contact", type=int, default=16)
    parser.add_argument("--foreign", type=int, default=1, help="times this many foreign cases of each plan; 0: none")
    parser.add_argument("--groups", nargs="+", help="of these groups only: null single double absorbed unknown contact")
    parser.add_argument("--seconds", type=float, default=60.0, help="of a matched recording")
    parser.add_argument("--rate", type=float, default=500.0, help="Hz, of matched recordings")
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    cases = [case for case in planned(given) if not given.groups or case["group"] in given.groups]
    given.output.write_text(json.dumps({"format": "tendonfmu-campaign-1", "cases": cases}, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
