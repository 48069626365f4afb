"""The numbers of a description as what may have changed: each has an effect and a place, and moves alone."""

from __future__ import annotations

import copy
import re
from dataclasses import astuple
from typing import Any

import numpy as np
import pytest

from fit_cases import small_finger
from random_fingers import random_extended, random_finger
from tendonfmu.diagnosis.candidate_columns import (
    EVERYWHERE,
    HERE,
    SOMEWHERE,
    Candidate,
    Number,
    estimator_of,
    number_hypotheses,
    numbers_of,
    with_numbers,
)
from tendonfmu.diagnosis.change_diagnosis import _main
from tendonfmu.diagnosis.effects.mechanism import data_number
from tendonfmu.report.diagnosis_types import EFFECTS
from worn_finger import described

Description = dict[str, Any]

HIDDEN = set(EFFECTS) - {"contact", "unknown"}
SEEDS = range(20)


def description(seed: int) -> Description:
    return random_extended(seed, random_finger(seed))


def parts_of(path: str) -> tuple[int | None, int | None]:
    """Joint and tendon that a path of friction or of a cover names."""
    joint, tendon = re.match(r"joints\[(\d+)\]", path), re.match(r"tendons\[(\d+)\]\.\w+\[(\d+)\]", path)
    if tendon:
        return int(tendon[2]), int(tendon[1])
    return (int(joint[1]) if joint else None), None


@pytest.mark.parametrize("seed", SEEDS)
def test_every_number_has_an_effect_of_the_contract_and_a_place(seed: int) -> None:
    data = description(seed)
    numbers = numbers_of(data)
    assert [each.index for each in numbers] == list(range(len(numbers)))
    joints, tendons = len(data["joints"]), len(data["tendons"])
    for each in numbers:
        assert each.effect in HIDDEN, each.path
        assert each.low <= each.value <= each.high, each.path
        assert 1 <= (each.place.joint or 1) <= joints and 1 <= (each.place.tendon or 1) <= tendons, each.path
        if each.path.startswith("extensions"):
            row = data["extensions"][int(re.findall(r"\d+", each.path)[0]) - 1]
            assert (each.effect, each.place.joint, each.place.tendon) == (
                row["effect"],
                row.get("joint"),
                row.get("tendon"),
            )
        else:
            assert (each.place.joint, each.place.tendon) == parts_of(each.path)


@pytest.mark.parametrize("seed", SEEDS)
def test_every_number_can_have_with_numbers(seed: int) -> None:
    """By itself or with others; and no hypothesis leaves the box of a number."""
    numbers = numbers_of(description(seed))
    first = 7
    found = number_hypotheses(numbers, first + len(numbers), first)
    assert [each.level for each in found] == sorted(each.level for each in found)
    covered = np.zeros(len(numbers), dtype=bool)
    for each in found:
        assert each.effect in HIDDEN and not each.terms
        own = each
        assert not own.mix[:first].any() and own.mix[first:].any(axis=0).all()
        assert (own.low <= 0.0).all() and (own.high >= 0.0).all()
        covered |= own.mix[first:].any(axis=1)
        for bound in (own.low, own.high):
            for k, size in enumerate(bound):
                moved = own.mix[first:, k] * (size if np.isfinite(size) else 0.0)
                for number, step in zip(numbers, moved, strict=True):
                    slack = 1e-9 * (abs(number.value) + abs(step))  # rounding
                    if each.effect != "asymmetric_friction":
                        assert number.low - slack <= number.value + step <= number.high + slack, (each.where, number)
    assert covered.all()


def by_key(data: Description) -> dict[tuple[str, int | None, int | None], Candidate]:
    numbers = numbers_of(data)
    return {astuple(each.where): each for each in number_hypotheses(numbers, len(numbers), 0)}


def test_places_of_one_effect_can_have_changed_together() -> None:
    found = by_key(described())
    levels = {key: each.level for key, each in found.items() if key[0] == "edge_friction"}
    assert levels == {
        ("edge_friction", None, None): EVERYWHERE,
        ("edge_friction", 1, 1): HERE,
        ("edge_friction", 1, 2): HERE,
    }
    levels = {key: each.level for key, each in by_key(small_finger()).items() if key[0] == "edge_friction"}
    assert levels[("edge_friction", None, None)] == EVERYWHERE
    assert {key[1:] for key, level in levels.items() if level == SOMEWHERE} == {
        (1, None),
        (2, None),
        *((None, i) for i in range(1, 5)),
    }


def test_both_sides_of_a_law_change_alike_or_against_each_other() -> None:
    side = {"static": 0.01, "coulomb": 0.01, "stribeck_velocity": 0.1, "viscous": 0.0}
    friction = {"positive": side, "negative": {**side, "static": 0.02, "coulomb": 0.02}}
    data = described(friction=friction)
    numbers = numbers_of(data)
    found = by_key(data)
    same, against = (found[(effect, 1, None)] for effect in ("joint_friction", "asymmetric_friction"))
    own = {each.path: each for each in numbers if each.effect == "joint_friction"}
    for path, number in own.items():
        assert same.mix[number.index, 0] == pytest.approx(number.value), path
        assert against.mix[number.index, 0] == (1.0 if ".positive." in path else -1.0), path
    assert same.low[0] == pytest.approx(-1.0, abs=1e-3) and against.high[0] == -against.low[0] <= 0.01


# --- a description with changed numbers -------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", SEEDS)
def test_nothing_added_changes_nothing(seed: int) -> None:
    data = description(seed)
    before = copy.deepcopy(data)
    assert with_numbers(data, np.zeros(len(numbers_of(data)))) == data == before


def moved_paths(before: Description, after: Description) -> set[str]:
    _, paths = estimator_of(before)
    return {path for path in paths if data_number(before, path) != data_number(after, path)}


@pytest.mark.parametrize("seed", range(6))
def test_adding_to_a_number_moves_it_alone(seed: int) -> None:
    """Coulomb friction takes the static one with it, by the same share or sum: both are one law."""
    data = description(seed)
    before, numbers = copy.deepcopy(data), numbers_of(data)
    for k in np.random.default_rng(seed).permutation(len(numbers))[:12]:
        each = numbers[k]
        room = min(each.high - each.value, 0.3 * abs(each.value) if each.value else 0.01)
        if room <= 0.0:
            continue
        added = np.zeros(len(numbers))
        added[each.index] = room
        moved = moved_paths(data, after := with_numbers(data, added))
        assert own_paths(each) >= moved and each.path in moved, (each.path, moved)
        assert data == before
        again = numbers_of(after)[each.index]
        assert again.value == pytest.approx(each.value + room, rel=1e-6)


def own_paths(number: Number) -> set[str]:
    """What moves with a number: static friction is known as so much more than coulomb friction."""
    stem, _, name = number.path.rpartition(".")
    return {number.path, f"{stem}.static"} if name == "coulomb" else {number.path}


def test_what_is_added_stays_in_the_box() -> None:
    data = described()
    numbers = numbers_of(data)
    for sign in (1.0, -1.0):
        for each in numbers_of(with_numbers(data, sign * np.full(len(numbers), 1e6))):
            assert each.low <= each.value <= each.high


def test_a_new_cover_that_hardens_is_as_large_as_its_cubic_spring() -> None:
    """Its other number, of another unit, says about which angle."""
    now = {"extensions": [{"effect": "cover_hardening", "joint": 1, "stiffness": 0.05, "quadratic": 0.3}]}
    assert _main(["extensions[1].stiffness", "extensions[1].quadratic"], now) == ["extensions[1].stiffness"]
