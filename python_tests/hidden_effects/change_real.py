"""The bed `real`: what really changed at the da Vinci instrument, another load that no sensor shows, or another speed.

Load: every pair of runs at one speed, `external_torque` taken out of both. What changed is a nearly constant torque on
the jaw: right answers are those of change_judgement.LOAD. Friction did not change: it grows with the load by one law.
To say nothing is no error where the bias of each recording may take a constant; the table counts it apart.
Speed: 0.1 Hz and 0.5 Hz under one load, with the column: nothing but what speed explains (change_case.BY_SPEED).
Directions, models and halves alternate.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import partial
from itertools import combinations
from typing import Any

from change_case import BY_SPEED, NOTHING, Case, Truth
from change_judgement import LOAD
from change_machines import KINEMATICS, MODELS, Stretch, cut, model_of, thinned

BED, MACHINE = "real", "davinci"
OTHER_LOAD = "other_load"
SLOW = tuple(f"0{load}" for load in range(10))
FAST = ("40", "42", "44", "46", "48")
BY_LOAD = (*combinations(SLOW, 2), *combinations(FAST, 2))
SPEEDS = tuple((f"0{fast[1]}", fast) for fast in FAST)


def truths() -> Iterator[tuple[Truth, str, str]]:
    """With the runs then and now. Load: each pair once, by one model; speed: each pair in both directions by both."""
    for k, pair in enumerate(BY_LOAD):
        then, now = pair if k // 2 % 2 == 0 else pair[::-1]
        # four in a row: both models and both halves in every combination
        yield truth(k + 1, OTHER_LOAD, LOAD, (), "load", MODELS[(k // 2 + k) % 2], then, now), then, now
    for m, model in enumerate(MODELS):
        for k, pair in enumerate(SPEEDS):
            for d, (then, now) in enumerate((pair, pair[::-1])):
                number = 101 + 20 * m + 2 * k + (d + k + m) % 2
                yield truth(number, NOTHING, (), BY_SPEED, "speed", model, then, now), then, now


def truth(
    number: int,
    hidden: str,
    effects: tuple[str, ...],
    also: tuple[str, ...],
    conditions: str,
    model: str,
    then: str,
    now: str,
) -> Truth:
    return Truth(
        number,
        BED,
        MACHINE,
        model,
        hidden,
        effects,
        also,
        conditions=conditions,
        kinematics=KINEMATICS[MACHINE],
        samples=f"{now} against {then}",
    )


def make(told: Truth, then: str, now: str) -> Case:
    known = told.conditions == "speed"
    model: Mapping[str, Any] = model_of(MACHINE, told.model, (Stretch(then),), known)
    recordings = [cut(MACHINE, (Stretch(run),), known) for run in (then, now)]
    return Case(told, model, *(tuple(map(thinned, each.values())) for each in recordings))


def makers() -> dict[int, Callable[[], Case]]:
    """By number, what makes the case."""
    return {told.number: partial(make, told, then, now) for told, then, now in truths()}
