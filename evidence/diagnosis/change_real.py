"""The bed `real`: what really changed at the da Vinci instrument, another load that no sensor shows, or another speed.

Load: every pair of runs at one speed, `external_torque` taken out of both. What changed is a nearly constant torque on
the jaw: right answers are those of changes.LOAD. Friction did not change: it grows with the load by one law. To say
nothing is no error where the bias of each recording may take a constant; the table counts it apart.
Speed: 0.1 Hz and 0.5 Hz under one load, with the column: nothing but what speed explains (changes.BY_SPEED).
Directions, models and halves alternate.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from itertools import combinations

from evidence.diagnosis.change_measured import KINEMATICS, MODELS, Stretch, cut, model_of, thinned
from evidence.diagnosis.changes import BY_SPEED, LOAD, UNCHANGED, Change, Makers
from evidence.judge import Truth

MACHINE = "davinci"
SLOW = tuple(f"0{load}" for load in range(10))
FAST = ("40", "42", "44", "46", "48")
BY_LOAD = (*combinations(SLOW, 2), *combinations(FAST, 2))
SPEEDS = tuple((f"0{fast[1]}", fast) for fast in FAST)


def plans() -> Iterator[tuple[int, str, str, str, str]]:
    """Number, conditions, model and the runs then and now. Load: each pair once, by one model; speed: each pair in both
    directions by both."""
    for k, pair in enumerate(BY_LOAD):
        then, now = pair if k // 2 % 2 == 0 else pair[::-1]
        # four in a row: both models and both halves in every combination
        yield k + 1, "load", MODELS[(k // 2 + k) % 2], then, now
    for m, model in enumerate(MODELS):
        for k, pair in enumerate(SPEEDS):
            for d, (then, now) in enumerate((pair, pair[::-1])):
                yield 101 + 20 * m + 2 * k + (d + k + m) % 2, "speed", model, then, now


def make(conditions: str, model: str, then: str, now: str) -> Change:
    with_load = conditions == "speed"
    return Change(
        machine=MACHINE,
        model=model,
        hidden=UNCHANGED if with_load else "other_load",
        conditions=conditions,
        kinematics=KINEMATICS[MACHINE],
        finger=model_of(MACHINE, model, (Stretch(then),), with_load),
        then=[thinned(columns) for columns in cut(MACHINE, (Stretch(then),), with_load).values()],
        now=[thinned(columns) for columns in cut(MACHINE, (Stretch(now),), with_load).values()],
        truth=Truth(allowed=BY_SPEED) if with_load else Truth(LOAD),
    )


def makers() -> Makers:
    return {number: partial(make, *plan) for number, *plan in plans()}
