"""The bed `hidden`: known changes put on measured recordings of EMPS and the da Vinci jaw.

`then` and `now` are different stretches of the recordings (change_machines.py); `now` has a known effect on it
(change_effects.py), or nothing. No sample is in both.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from change_case import BY_SPEED, HALVES, NOTHING, Case, Columns, Truth
from change_effects import CHANGES, hide
from change_machines import KINEMATICS, MODELS, Stretch, cut, diagnosed_model, model_of, seen, thinned
from measured import Machine

BED = "hidden"
STRENGTHS = (0.1, 0.3, 1.0)


@dataclass(frozen=True)
class Pair:
    """conditions: of `now` against `then`: part (of the same run), load, speed, excitation."""

    machine: str
    conditions: str
    then: tuple[Stretch, ...]
    now: tuple[Stretch, ...]

    @property
    def reversed(self) -> Pair:
        return Pair(self.machine, self.conditions, self.now, self.then)

    def __str__(self) -> str:
        return " against ".join(", ".join(map(str, group)) for group in (self.now, self.then))


@dataclass(frozen=True)
class Plan:
    """One case to be made. hidden: a name of CHANGES, or nothing. pairs: the first with which the strength can be had
    counts."""

    number: int
    hidden: str
    strength: float
    model: str
    pairs: tuple[Pair, ...]


def halves(machine: str, runs: Sequence[str], middle: float) -> Pair:
    """The second part of the runs against the first."""
    return Pair(
        machine,
        "part",
        tuple(Stretch(run, 0.0, middle) for run in runs),
        tuple(Stretch(run, middle, 2 * middle) for run in runs),
    )


def whole(machine: str, conditions: str, then: Sequence[str], now: Sequence[str]) -> Pair:
    return Pair(machine, conditions, tuple(map(Stretch, then)), tuple(map(Stretch, now)))


HALF_EMPS, HALF_JAW = 12.48, 10.0  # s: two of the four cycles; one of the two at 0.1 Hz, five of the ten at 0.5 Hz
EMPS_PARTS = [halves("emps", [run], HALF_EMPS) for run in ("plain", "pulses", "loaded")]
EMPS_OTHER = [
    whole("emps", "excitation", ["plain"], ["pulses"]),
    whole("emps", "load", ["plain"], ["loaded"]),
]
# halves of different files: their samples differ in every way that whole files do
EMPS_CROSSED = [
    Pair("emps", conditions, (Stretch("plain", *one),), (Stretch(run, *other),))
    for conditions, run in (("excitation", "pulses"), ("load", "loaded"))
    for one, other in (((0.0, HALF_EMPS), (HALF_EMPS, 25.0)), ((HALF_EMPS, 25.0), (0.0, HALF_EMPS)))
]
JAW_GROUPS = (["00", "04", "08"], ["01", "05", "09"], ["02", "06"], ["40", "44", "48"], ["42", "46"])
JAW_PARTS = [halves("davinci", runs, HALF_JAW) for runs in JAW_GROUPS]
JAW_LOADS = [
    whole("davinci", "load", then, now)
    for then, now in (
        (["00", "04", "08"], ["02", "06"]),
        (["01", "05", "09"], ["03", "07"]),
        (["02", "06"], ["01", "05"]),
        (["40", "44", "48"], ["42", "46"]),
    )
]
JAW_SPEEDS = [
    whole("davinci", "speed", then, now)
    for then, now in (
        (["00", "04", "08"], ["40", "44", "48"]),
        (["02", "06"], ["42", "46"]),
        (["00", "02", "04"], ["40", "42", "44"]),
    )
]
PAIRS = {
    "emps": [*EMPS_PARTS, *EMPS_OTHER, *EMPS_CROSSED],
    "davinci": [*JAW_PARTS, *JAW_LOADS, *JAW_SPEEDS],
}
PAIRS = {machine: [*pairs, *(pair.reversed for pair in pairs)] for machine, pairs in PAIRS.items()}


def numbers(halves_of: Sequence[int]) -> list[int]:
    """A number for each, odd (1) or even (0) as asked for, each half counted on."""
    given = {1: 1, 0: 2}
    found = []
    for half in halves_of:
        found.append(given[half])
        given[half] += 2
    return found


def nulls() -> list[Plan]:
    """Nothing changed: every pair of stretches, by both models, which lie in different halves."""
    wanted = [
        (pair, model, (k + m) % 2)
        for machine in PAIRS
        for k, pair in enumerate(PAIRS[machine])
        for m, model in enumerate(MODELS)
    ]
    given = numbers([half for *_, half in wanted])
    return [Plan(n, NOTHING, 0.0, model, (pair,)) for n, (pair, model, _) in zip(given, wanted, strict=True)]


def effects(after: int) -> list[Plan]:
    """Every change at every strength once in each half, by the one model in one and by the other in the other; the
    order of the pairs is drawn."""
    found: list[Plan] = []
    for m, machine in enumerate(PAIRS):
        for k, name in enumerate(name for name, change in CHANGES.items() if machine in change.machines):
            for s, strength in enumerate(STRENGTHS):
                for half in HALVES:
                    order = np.random.default_rng([14, m, k, s, half]).permutation(len(PAIRS[machine]))
                    pairs = tuple(PAIRS[machine][each] for each in order)
                    found.append(Plan(half, name, strength, MODELS[(k + s + half) % 2], pairs))
    given = numbers([plan.number for plan in found])
    return [replace(plan, number=after + n) for n, plan in zip(given, found, strict=True)]


def plans() -> list[Plan]:
    """All cases of the bed: those without a change first."""
    quiet = nulls()
    last = max(plan.number for plan in quiet)
    return [*quiet, *effects(last + last % 2)]


def make(plan: Plan) -> Case:
    """Raises ValueError where no sound magnitude of the change has the strength, with any of its pairs."""
    for pair in plan.pairs:
        try:
            return made_of(plan, pair)
        except ValueError as impossible:
            reason = impossible
    raise reason


def made_of(plan: Plan, pair: Pair) -> Case:
    model = model_of(pair.machine, plan.model, pair.then)
    then: Mapping[str, Columns] = cut(pair.machine, pair.then)
    now: Mapping[str, Columns] = cut(pair.machine, pair.now)
    truth = Truth(
        number=plan.number,
        bed=BED,
        machine=pair.machine,
        model=plan.model,
        hidden=plan.hidden,
        also=BY_SPEED if pair.conditions == "speed" else (),
        joint=1,
        tendon=1,
        conditions=pair.conditions,
        kinematics=KINEMATICS[pair.machine],
        samples=str(pair),
    )
    if plan.hidden != NOTHING:
        truth, now = with_change(truth, plan, seen(pair.machine, model, then), seen(pair.machine, model, now))
    return Case(truth, model, *(tuple(map(thinned, each.values())) for each in (then, now)))


def with_change(truth: Truth, plan: Plan, then: Machine, now: Machine) -> tuple[Truth, Mapping[str, Columns]]:
    """The truth with what was hidden, and the recordings with it."""
    change = CHANGES[plan.hidden]
    hidden = hide(then, now, replace(now, model=diagnosed_model(now.name)), change, plan.strength)
    truth = replace(
        truth,
        effects=change.names,
        also=(*truth.also, *change.also),
        signs={name: change.sign * sign for name, sign in change.signs.items() if name in change.names},
        strength=plan.strength,
        size=hidden.magnitude,
        unit=change.unit,
        by=hidden.by,
        survives_now=hidden.survives_now,
        survives_both=hidden.survives_both,
        whole=hidden.whole,
    )
    return truth, hidden.now


def makers() -> dict[int, Callable[[], Case]]:
    """By number, what makes the case. It raises ValueError where the case cannot be."""
    return {plan.number: partial(make, plan) for plan in plans()}
