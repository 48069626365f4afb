"""Changes of measured machines: known ones put on recordings of EMPS, the da Vinci jaw and PSM, and real ones of two.

What `then`, `now` and the strength of a change are: README.md. Needs ../shared/data or $TENDONFMU_DATA.
"""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy import io, signal

from evidence.diagnosis.case import Case
from evidence.diagnosis.measured import (
    EFFECTS,
    FORCE,
    LOAD,
    Array,
    Columns,
    Description,
    Effect,
    Machine,
    bent,
    diagnosed_model,
    first_magnitude,
    largest_force,
    less,
    magnitude_of,
    put,
    residual,
    residuals,
)
from evidence.fingers.matched_strength import averaged
from evidence.judge import Truth
from evidence.runner import DATA, EXAMPLES
from tendonfmu import convert
from tendonfmu.estimate.fitting import FitWarning, FrictionFit
from tendonfmu.recordings.converters import convert_file
from tendonfmu.recordings.converters.emps import CUTOFF

Makers = dict[int, Callable[[], Case]]  # by number; they raise ValueError where the case cannot be

UNCHANGED = "nothing"
# What a change of speed alone may show of a model that is not exact: not false where `now` is faster or slower.
BY_SPEED = ("viscous_friction", "stribeck", "time_delay", "inertia")
# A change of load that no sensor shows is a constant torque: these answers say so. Names of friction are wrong there.
LOAD_NAMES = ("contact", "force_offset", "gravity")

THINNED = {"emps": 2, "davinci": 2, "psm": 1}  # samples to one: the remainder of the EMPS model grows by 1 %
PITCH = 2  # the joint of PSM: its weight and presliding are what `diagnose` names (docs/evidence/psm.md)
PRETENSION = 13.0  # N, da Vinci: the closing cable never goes slack
JAMMED = {"07": 16.5}  # s; the instrument jams after that
PULSE = 5.0695  # V, measured (README of the data); the drive's gain makes newtons of it
MODELS = ("diagnosed", "plain")
KINEMATICS = {"emps": 3, "davinci": 1, "psm": 3}
PLAIN = {"emps": EXAMPLES / "emps" / "emps.json", "davinci": EXAMPLES / "davinci" / "jaw_nominal.json"}

STRENGTHS = (0.1, 0.3, 1.0)
ABSORBED = 0.5  # share of the variance that refitting to `now` leaves, below which numbers of the model have changed
LOUDEST = 0.5  # of the machine's largest torque: a change that adds more is no longer the same machine
# s: two of the four cycles; one of the two at 0.1 Hz, five of the ten at 0.5 Hz; half of an excitation
HALF_EMPS, HALF_JAW, HALF_PSM = 12.48, 10.0, 15.0


# --- recordings -------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Stretch:
    """A part of a run: plain, pulses or loaded of EMPS (loaded: its pulses are known load), else the run's name."""

    run: str
    begin: float = 0.0  # s
    end: float = 1e6

    def __str__(self) -> str:
        return self.run if self.end > 1e5 else f"{self.run} {self.begin:g}-{self.end:g} s"


@cache
def recording(machine: str, run: str) -> Columns:
    """All of a run, at 1 kHz; at 200 Hz of PSM."""
    if machine == "psm":
        columns = json.loads((EXAMPLES / "psm" / f"joint_{PITCH}.json").read_text(encoding="utf-8"))
        converted = convert(DATA / "psm" / f"{run}.parquet", columns)
        found = {f"{name}[1]": values[:, 0] for name, values in converted.groups.items()}
        return part_of({"time": converted.time} | found, 0.0, 1e6)
    if machine == "davinci":
        file = DATA / "davinci_tool" / "Tool_4_Maryland_L_4" / f"{run}.TXT"
        return part_of(convert_file("davinci", file, {"pretension": PRETENSION}), 0.0, JAMMED.get(run, 1e6))
    file = DATA / "emps" / ("DATA_EMPS.mat" if run == "plain" else "DATA_EMPS_PULSES.mat")
    columns = convert_file("emps", file, {"decimation": 1})
    return with_pulses_as_load(columns, file) if run == "loaded" else columns


def with_pulses_as_load(columns: Columns, file: Path) -> Columns:
    """The pulses taken off the drive's force, and off the torque that accelerates: a known push of the same size."""
    raw = io.loadmat(file)
    time, on = np.ravel(raw["t"]), np.ravel(raw["pulses_N"]) > 0
    force = PULSE * float(np.ravel(raw["gtau"])[0]) * on
    smooth = signal.filtfilt(*signal.butter(4, CUTOFF, fs=1.0 / float(np.median(np.diff(time)))), force)
    pulse = np.interp(columns["time"], time, smooth)
    return dict(columns) | {FORCE: columns[FORCE] - pulse, LOAD: columns[LOAD] - pulse}


def part_of(columns: Columns, begin: float, end: float) -> Columns:
    """From 0 s on again, as a recording of its own."""
    rows = (columns["time"] >= begin) & (columns["time"] < end)
    part = {name: values[rows] for name, values in columns.items()}
    return part | {"time": part["time"] - part["time"][0]}


def thinned(columns: Columns, to_one: int) -> Columns:
    """Means of so many samples each."""
    return {name: averaged(values, to_one) for name, values in columns.items()}


def cut(machine: str, stretches: Sequence[Stretch], known_load: bool = True) -> dict[str, Columns]:
    """Recordings at 1 kHz, by the words of their stretches. known_load: with the column `external_torque`."""
    parts: dict[str, Columns] = {}
    for stretch in stretches:
        columns = part_of(recording(machine, stretch.run), stretch.begin, stretch.end)
        parts[str(stretch)] = {name: values for name, values in columns.items() if known_load or name != LOAD}
    return parts


@cache
def plain_model(machine: str, stretches: tuple[Stretch, ...], known_load: bool) -> Mapping[str, Any]:
    """Coulomb and viscous friction as in examples, fitted to the stretches: what most users have."""
    if machine == "psm":
        start = diagnosed_model(machine)
        start["extensions"] = [row for row in start["extensions"] if row["effect"] == "inertia"]
    else:
        start = json.loads(PLAIN[machine].read_text(encoding="utf-8"))
    parts = cut(machine, stretches, known_load).values()
    return fitted(start, [thinned(part, THINNED[machine]) for part in parts], KINEMATICS[machine])


def fitted(start: Mapping[str, Any], recordings: Sequence[Columns], kinematics: int = 1) -> Mapping[str, Any]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FitWarning)
        fit = FrictionFit(start, kinematics=kinematics, threads=1, uncertainty=False)
        data: Mapping[str, Any] = fit.fit([pd.DataFrame(columns) for columns in recordings]).description_.data
    return data


def model_of(machine: str, model: str, stretches: tuple[Stretch, ...], known_load: bool = True) -> Description:
    """stretches: of the machine as it was, which a plain model is fitted to."""
    return diagnosed_model(machine) if model == "diagnosed" else dict(plain_model(machine, stretches, known_load))


# --- which cases there are --------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Pair:
    """conditions: of `now` against `then`: part (of the same run), load, speed, excitation, identification."""

    machine: str
    conditions: str
    then: tuple[Stretch, ...]
    now: tuple[Stretch, ...]

    @property
    def reversed(self) -> Pair:
        return replace(self, then=self.now, now=self.then)


def halves(machine: str, runs: Sequence[str], middle: float) -> Pair:
    """The second part of the runs against the first."""
    then = tuple(Stretch(run, 0.0, middle) for run in runs)
    return Pair(machine, "part", then, tuple(Stretch(run, middle, 2 * middle) for run in runs))


def whole(machine: str, conditions: str, then: Sequence[str], now: Sequence[str]) -> Pair:
    return Pair(machine, conditions, tuple(map(Stretch, then)), tuple(map(Stretch, now)))


FORWARD = {
    "emps": [
        *(halves("emps", [run], HALF_EMPS) for run in ("plain", "pulses", "loaded")),
        whole("emps", "excitation", ["plain"], ["pulses"]),
        whole("emps", "load", ["plain"], ["loaded"]),
        # halves of different files: their samples differ in every way that whole files do
        *(
            Pair("emps", conditions, (Stretch("plain", *one),), (Stretch(run, *other),))
            for conditions, run in (("excitation", "pulses"), ("load", "loaded"))
            for one, other in (((0.0, HALF_EMPS), (HALF_EMPS, 25.0)), ((HALF_EMPS, 25.0), (0.0, HALF_EMPS)))
        ),
    ],
    "davinci": [
        halves("davinci", ["00", "04", "08"], HALF_JAW),
        halves("davinci", ["01", "05", "09"], HALF_JAW),
        halves("davinci", ["02", "06"], HALF_JAW),
        halves("davinci", ["40", "44", "48"], HALF_JAW),
        halves("davinci", ["42", "46"], HALF_JAW),
        whole("davinci", "load", ["00", "04", "08"], ["02", "06"]),
        whole("davinci", "load", ["01", "05", "09"], ["03", "07"]),
        whole("davinci", "load", ["02", "06"], ["01", "05"]),
        whole("davinci", "load", ["40", "44", "48"], ["42", "46"]),
        whole("davinci", "speed", ["00", "04", "08"], ["40", "44", "48"]),
        whole("davinci", "speed", ["02", "06"], ["42", "46"]),
        whole("davinci", "speed", ["00", "02", "04"], ["40", "42", "44"]),
    ],
}
FOURIER = [f"stribeck_3dof_svd__fourier_test{k}" for k in ("", "2", "3", "4")]
LATEST = [f"latest_3dof_inaxis_svd__fourier_test{k}" for k in ("1", "2")]  # of another identification of the arm
FORWARD["psm"] = [
    *(whole("psm", "excitation", [FOURIER[0], FOURIER[k]], [run for run in FOURIER[1:] if run != FOURIER[k]])
      for k in (1, 2, 3)),
    *(whole("psm", "identification", FOURIER[k : k + 2], LATEST) for k in (0, 2)),
    *(halves("psm", FOURIER[k : k + 2], HALF_PSM) for k in (0, 1, 2)),
]  # fmt: skip
PAIRS = {machine: [*pairs, *(pair.reversed for pair in pairs)] for machine, pairs in FORWARD.items()}
OLDER, ARM = ("emps", "davinci"), ("psm",)  # machines of the beds `hidden` and `arm`


@dataclass(frozen=True)
class Plan:
    """One case to be made. number: its parity is the half. pairs: the first one with which the strength can be had."""

    number: int
    hidden: str  # a name of EFFECTS, or UNCHANGED
    strength: float
    model: str
    pairs: tuple[Pair, ...]


def numbered(plans: Sequence[Plan], after: int = 0) -> list[Plan]:
    """With numbers in place of the halves 1 (odd) and 0 (even), each half counted on."""
    following = {1: after + 1, 0: after + 2}
    result = []
    for plan in plans:
        result.append(replace(plan, number=following[plan.number]))
        following[plan.number] += 2
    return result


def unchanged_plans(machines: Sequence[str]) -> list[Plan]:
    """Every pair of stretches, by both models, which lie in different halves."""
    return numbered(
        [
            Plan((k + m) % 2, UNCHANGED, 0.0, model, (pair,))
            for machine in machines
            for k, pair in enumerate(PAIRS[machine])
            for m, model in enumerate(MODELS)
        ]
    )


def changed_plans(machines: Sequence[str], after: int) -> list[Plan]:
    """Every change at every strength once in each half, by the one model in one and by the other in the other; the
    order of the pairs is drawn."""
    plans = []
    for m, machine in enumerate(machines):
        pairs_of = [pair for pair in PAIRS[machine] if pair.conditions != "identification"]
        for k, name in enumerate(name for name, effect in EFFECTS.items() if machine in (*effect.machines, *ARM)):
            for s, strength in enumerate(STRENGTHS):
                for half in (1, 0):
                    order = np.random.default_rng([14, m, k, s, half]).permutation(len(pairs_of))
                    pairs = tuple(pairs_of[place] for place in order)
                    plans.append(Plan(half, name, strength, MODELS[(k + s + half) % 2], pairs))
    return numbered(plans, after)


def plans(machines: Sequence[str]) -> list[Plan]:
    """All cases of the bed: those without a change first."""
    unchanged = unchanged_plans(machines)
    last = max(plan.number for plan in unchanged)
    return [*unchanged, *changed_plans(machines, last + last % 2)]


def hidden_makers(machines: Sequence[str] = OLDER) -> Makers:
    return {plan.number: partial(make, plan) for plan in plans(machines)}


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
    then, now = cut(pair.machine, pair.then), cut(pair.machine, pair.now)
    allowed = BY_SPEED if pair.conditions == "speed" else ()
    truth, by = Truth(joint=1, tendon=1, allowed=allowed), ""
    unaltered: Iterable[Columns] = ()
    if plan.hidden != UNCHANGED:
        effect = EFFECTS[plan.hidden]
        seen = Machine(pair.machine, model, {name: dict(part) for name, part in now.items()}, KINEMATICS[pair.machine])
        hidden = hide(seen, effect, plan.strength)
        unaltered, now, by = now.values(), dict(hidden.now), hidden.by
        signs = {name: effect.sign * sign for name, sign in effect.signs.items() if name in effect.names}
        truth = replace(truth, effects=effect.names, allowed=(*allowed, *effect.also), signs=signs)
    case = changed_case(
        pair.machine, plan.model, plan.hidden, pair.conditions, model, then.values(), now.values(), truth, plan.strength
    )
    before = [pd.DataFrame(thinned(columns, THINNED[pair.machine])) for columns in unaltered]
    return replace(case, unaltered=before, facts={**case.facts, "by": by})


def changed_case(
    machine: str,
    model: str,  # diagnosed or plain
    hidden: str,  # name of the change as its bed calls it
    conditions: str,  # how `now` was recorded: part, load, speed, excitation
    finger: Mapping[str, Any],
    then: Iterable[Columns],
    now: Iterable[Columns],
    truth: Truth,
    strength: float = 0.0,  # variance of the added torque over that of what the model leaves of the unaltered `now`
) -> Case:
    """The machine as it was (`then`) and with a change, or without one (`now`): no sample is in both."""
    known = {"machine": machine, "model": model, "hidden": hidden, "conditions": conditions, "strength": strength}
    reference, recordings = (
        [pd.DataFrame(thinned(columns, THINNED[machine])) for columns in part] for part in (then, now)
    )
    return Case(machine, finger, recordings, KINEMATICS[machine], truths=(truth,), reference=reference, facts=known)


# --- the bed `real`: what really changed at the da Vinci instrument ---------------------------------------------------
# Load: every pair of runs at one speed, `external_torque` taken out of both. What changed is a nearly constant torque
# on the jaw: right answers are LOAD_NAMES. Friction did not change: it grows with the load by one law. To say nothing
# is no error where the bias of each recording may take a constant; the table counts it apart.
# Speed: 0.1 Hz and 0.5 Hz under one load, with the column: nothing but what speed explains (BY_SPEED).
# Directions, models and halves alternate.

SLOW = tuple(f"0{load}" for load in range(10))
FAST = ("40", "42", "44", "46", "48")
BY_LOAD = (*combinations(SLOW, 2), *combinations(FAST, 2))
SPEEDS = tuple((f"0{fast[1]}", fast) for fast in FAST)


def real_plans() -> Iterator[tuple[int, str, str, str, str]]:
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


def real_change(conditions: str, model: str, then: str, now: str) -> Case:
    by_speed = conditions == "speed"
    finger = model_of("davinci", model, (Stretch(then),), by_speed)
    before, after = (cut("davinci", (Stretch(run),), by_speed).values() for run in (then, now))
    truth = Truth(allowed=BY_SPEED) if by_speed else Truth(LOAD_NAMES)
    hidden = UNCHANGED if by_speed else "other_load"
    return changed_case("davinci", model, hidden, conditions, finger, before, after, truth)


def real_makers() -> Makers:
    return {number: partial(real_change, *plan) for number, *plan in real_plans()}


# --- changes at a strength --------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Hidden:
    """Recordings with a change, and variances of its torque over that of what the model leaves."""

    now: Mapping[str, Columns]
    magnitude: float
    by: str  # which of the variances was set to the strength
    survives_now: float  # less what refitting the model's numbers to `now` alone absorbs
    whole: float  # less a constant of each recording


def hide(now: Machine, effect: Effect, strength: float, physics: Machine | None = None) -> Hidden:
    """The change at a strength. now: seen through the case's model. physics: `now` through the diagnosed one.

    Raises ValueError where no sound magnitude has the strength.
    """
    physics = physics or replace(now, model=diagnosed_model(now.name))
    before, absorbed = residuals(now), bent(now)
    constants = spans([len(residual(now, columns)) for columns in now.recordings.values()])
    noise = less(before, constants)
    loudness = float(noise @ noise)

    def altered(magnitude: float) -> dict[str, dict[str, Array]]:
        return put(physics, effect, effect.sign * magnitude).recordings

    def added(magnitude: float) -> Array:
        return np.asarray(residuals(replace(now, recordings=altered(magnitude))) - before)

    def measured(torque: Array) -> dict[str, float]:
        kept = {"whole": less(torque, constants), "survives_now": less(torque, absorbed)}
        return {name: float(left @ left) / loudness for name, left in kept.items()}

    magnitude = first_magnitude(effect, physics)
    start = measured(added(magnitude))
    # decided once, at the first magnitude, so that the search does not jump
    by = "whole" if start["survives_now"] < ABSORBED * start["whole"] else "survives_now"
    magnitude = magnitude_of(strength, lambda tried: measured(added(tried))[by], magnitude, effect.most)
    torque = added(magnitude)
    check_sound(torque, physics)
    return Hidden(altered(magnitude), effect.sign * magnitude, by, **measured(torque))


def spans(lengths: Sequence[int]) -> Array:
    """[B, R] orthonormal: a constant of each recording."""
    total = np.repeat(np.eye(len(lengths)), lengths, axis=1).T
    return np.asarray(total / np.sqrt(np.array(lengths, dtype=float)))


def check_sound(torque: Array, machine: Machine) -> None:
    """Raises ValueError where the torque is too large for the machine to be the same still."""
    most = LOUDEST * largest_force(machine) * machine.arm
    swing = float(np.percentile(np.abs(torque - torque.mean()), 95))
    if swing > most:
        raise ValueError(f"it takes {swing:.3g} N.m, more than the {most:.3g} N.m that are sound")
