"""The cases on which `diagnose` and its rivals are compared: matched rigs, and fingers of other simulators.

    python bench/diagnosis_rivals_cases.py -o cases.json --seed 1

Every case has a training recording of 30 s and a test recording of 15 s. Matched: 12 with nothing hidden, each effect
of the list once at a strength of 0.3, each effect that is not on it at 0.3 and at 1. Foreign: the even cases of
python_tests/foreign in numpy and MuJoCo, without what refitting absorbs; their sizes are their own.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

TESTS = Path(__file__).resolve().parent.parent / "python_tests"
sys.path += [str(TESTS / "foreign"), str(TESTS / "hidden_effects")]

import fingers_in_mujoco  # noqa: E402
import fingers_in_numpy  # noqa: E402
from effects_hidden import BUILDERS  # noqa: E402
from hidden_unknown import UNKNOWN  # noqa: E402
from judgement import is_absorbed  # noqa: E402

TRAIN, TEST = 30.0, 15.0  # s
NULLS = 12
STRENGTH = 0.3
FAMILIES = {"numpy": fingers_in_numpy, "mujoco": fingers_in_mujoco}


def foreign(folder: Path, family: str, number: int) -> dict[str, Any]:
    """A maker for `tendonfmu campaign`: the case of python_tests/foreign with that number."""
    made = FAMILIES[family].make(number, TRAIN, TEST)
    (folder / "finger.json").write_text(json.dumps(made.nominal), encoding="utf-8")
    made.train.to_parquet(folder / "train.parquet", index=False)
    made.test.to_parquet(folder / "test.parquet", index=False)
    truth = {"effect": made.truth.hidden, "joint": made.truth.joint, "tendon": made.truth.tendon}
    listed = {"single": [{key: value for key, value in truth.items() if value is not None}]}
    facts = {"hidden": made.truth.hidden, "joints": made.truth.joints, "simulated_too": ",".join(made.truth.also)}
    return {
        "rig": family,
        "finger": "finger.json",
        "recordings": ["train.parquet"],
        "test": ["test.parquet"],
        "truth": listed.get(group_of(made.truth.hidden), [{"effect": "unknown"}] if truth["effect"] != "none" else []),
        "facts": facts,
    }


def group_of(hidden: str) -> str:
    if hidden == "none":
        return "null"
    return "unknown" if hidden.startswith("unknown") else "single"


def foreign_cases() -> Iterator[dict[str, Any]]:
    for family, module in FAMILIES.items():
        for number in module.NUMBERS:
            truth = module.make(number, 2.0, 2.0).truth if number % 2 == 0 else None
            if truth is None or is_absorbed(truth) or truth.hidden == "contact":
                continue
            yield {
                "name": f"{family}_{number:02d}",
                "group": group_of(truth.hidden),
                "maker": f"{Path(__file__).resolve()}:foreign",
                "arguments": {"family": family, "number": number},
            }


def matched_cases(seed: int) -> Iterator[dict[str, Any]]:
    """Of the makers in python_tests/hidden_effects/cases.py, nothing hidden, one effect and unlisted ones in turn."""
    groups = [list(_nulls(seed)), list(_singles(seed)), list(_unlisted(seed))]
    order = [(rank / len(group), number, rank) for number, group in enumerate(groups) for rank in range(len(group))]
    for _, number, rank in sorted(order):
        yield groups[number][rank]


def _nulls(seed: int) -> Iterator[dict[str, Any]]:
    """Half with presliding, half with a bias that wanders three times as much, two thirds of one joint."""
    for k in range(NULLS):
        options = {"wander": 3.0 if k % 4 >= 2 else 1.0, "joints": 2 if k % 3 == 0 else 1, "presliding": k % 2 == 1}
        yield _case(f"null_{k}", "null", "null", seed=seed + k, **options)


def _singles(seed: int) -> Iterator[dict[str, Any]]:
    for number, effect in enumerate(BUILDERS):
        if effect != "force_offset":  # refitting always absorbs it
            options = {"effect": effect, "strength": STRENGTH, "presliding": number % 2 == 1}
            yield _case(f"{effect}_{STRENGTH:g}_0", "single", "single", seed=seed + 1000 + number, **options)


def _unlisted(seed: int) -> Iterator[dict[str, Any]]:
    for effect in UNKNOWN:
        for strength in (STRENGTH, 1.0):
            options = {"effect": effect, "strength": strength, "presliding": False}
            yield _case(f"{effect}_{strength:g}_0", "unknown", "single", seed=seed + 400_000, **options)


def _case(name: str, group: str, function: str, **given: Any) -> dict[str, Any]:
    arguments = {"joints": 2, "seconds": TRAIN, "rate": 500.0, "test": TEST, **given}
    maker = f"{TESTS / 'hidden_effects' / 'cases.py'}:{function}"
    return {"name": name, "group": group, "maker": maker, "seed": given["seed"], "arguments": arguments}


def all_cases(seed: int) -> list[dict[str, Any]]:
    """Both kinds alternate, so that an interrupted run has some of each."""
    kinds = [list(matched_cases(seed)), list(foreign_cases())]
    order = [(rank / len(kind), number, rank) for number, kind in enumerate(kinds) for rank in range(len(kind))]
    return [kinds[number][rank] for _, number, rank in sorted(order)]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, required=True, help="CASES.json")
    parser.add_argument("--seed", type=int, default=1, help="of the matched rigs")
    given = parser.parse_args()
    found = {"format": "tendonfmu-campaign-1", "cases": all_cases(given.seed)}
    given.output.write_text(json.dumps(found, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
