"""How often effects hidden in the EMPS and da Vinci recordings are found: python -m evidence.diagnosis.measured_cases

What is to be hidden is first taken off recording and model where they have it already. Strength: variance of the torque
that the effect adds and that refitting the model's own numbers cannot absorb, over that of what the model leaves of the
unaltered recording, both in blocks of 10 ms. Needs ../shared/data or $TENDONFMU_DATA. Writes FOLDER/measured.md.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pandas as pd

from evidence.diagnosis.case import Case, causes_of
from evidence.diagnosis.change_measured import KINEMATICS, recording
from evidence.diagnosis.measured import (
    EFFECTS,
    FORCE,
    Array,
    Columns,
    Description,
    Effect,
    Machine,
    add_torque,
    angle_of,
    bent,
    built_up,
    diagnosed_model,
    first_magnitude,
    less,
    magnitude_of,
    put,
    residuals,
    rows_of,
    side_of,
    speed_of,
)
from evidence.judge import Truth, judge
from evidence.runner import parser, publish, run_cases
from evidence.tables import Row, by, count, table

MACHINES = ("emps", "davinci")
STRENGTHS = (0.03, 0.1, 0.3, 1.0)
NOTHING = "nothing"  # the unaltered recording
SECONDS = 16.5  # da Vinci: before run 07 jams
RUNS, CHOSEN = ("00", "02", "04", "06", "08"), 3  # da Vinci: even loads, which the model was diagnosed with; of a case
WINDOWS = ((0.0, 24.9), (0.0, 18.7), (6.2, 24.9), (3.1, 21.8))  # s, EMPS: cycles of 6.24 s


# --- machines without an effect: recordings less what the model says of it, and the model without it ------------------

Taken = Callable[[Columns], Columns]


def without(machine: Machine, taken: Taken, *effects: str, **joint: None) -> Machine:
    """Recordings changed by `taken`; the model without the rows of these effects, and with these keys of its joint."""
    model = copy.deepcopy(machine.model)
    model["extensions"] = [row for row in model.get("extensions") or [] if row["effect"] not in effects]
    model["joints"][0] |= joint
    recordings = {name: taken(columns) for name, columns in machine.recordings.items()}
    return replace(machine, model=model, recordings=recordings)


def law_torque(law: Description, speed: Array, side: Array) -> Array:
    """A law's F(v), the side given (docs/reference/semantics.md#friction-laws)."""

    def one(half: Description) -> Array:
        drop, slow = half["static"] - half["coulomb"], half["stribeck_velocity"]
        fading = drop * np.exp(-np.abs(speed) / slow)
        return np.asarray(half["coulomb"] + fading + half.get("viscous", 0.0) * np.abs(speed))

    forward, back = law.get("positive", law), law.get("negative", law)
    return np.where(side > 0, one(forward), -one(back))


def free_of_friction(machine: Machine) -> Machine:
    """Recordings less the joint's own friction by the model, which then has none."""
    joint, sliding = machine.model["joints"][0], rows_of(machine.model, "presliding")
    constant = sum(row["coulomb"] for row in rows_of(machine.model, "preload_friction")) * machine.arm

    def taken(columns: Columns) -> Columns:
        speed = speed_of(machine, columns)
        side = np.where(speed < 0, -1.0, 1.0)
        torque = law_torque(joint["friction"], speed, side)
        for row in rows_of(machine.model, "stribeck"):
            torque = torque * (1.0 + row["amplitude"] * np.exp(-np.abs(speed) / row["stribeck_velocity"]))
        for row in sliding:
            step = np.diff(angle_of(machine, columns), prepend=angle_of(machine, columns)[0])
            torque = np.abs(torque) * built_up(side, step, row["displacement"])
        return add_torque(machine, columns, -torque - constant * side)

    # presliding stays where the joint has friction that grows with the load, which it acts on too
    gone = () if joint.get("load_friction") is not None else ("presliding",)
    return without(machine, taken, "stribeck", "preload_friction", *gone, friction=None)


def free_of_delay(machine: Machine) -> Machine:
    """Forces moved to the time of the positions by the model's own delay, which it then has not."""
    rows = rows_of(machine.model, "time_delay")
    if not rows:
        return machine
    late = rows[0]["delay"]  # negative: the force of t answers to the motion of t − late

    def taken(columns: Columns) -> Columns:
        return columns | {FORCE: np.interp(columns["time"] + late, columns["time"], columns[FORCE])}

    return without(machine, taken, "time_delay")


def free_of_spring(machine: Machine) -> Machine:
    """Recordings less all torques that follow the angle alone, as the model has them: cover and weight."""
    cover = machine.model["joints"][0].get("cover") or {"stiffness": 0.0, "rest_angle": 0.0}

    def taken(columns: Columns) -> Columns:
        angle = angle_of(machine, columns)
        bent = angle - cover.get("rest_angle", 0.0)
        torque = cover["stiffness"] * bent
        for row in rows_of(machine.model, "gravity"):
            torque = torque + row.get("sine", 0.0) * np.sin(angle) + row.get("cosine", 0.0) * np.cos(angle)
        for row in rows_of(machine.model, "cover_hardening"):
            torque = torque + row["stiffness"] * bent**3
        return add_torque(machine, columns, -torque)

    return without(machine, taken, "gravity", "cover_hardening", cover=None)


def free_of_growth(machine: Machine) -> Machine:
    """Recordings less the friction that grows with the force, as the model's rows have it; a law of the joint that does
    so stays, and takes its share of what is hidden."""
    rows = rows_of(machine.model, "load_friction")
    if not rows:
        return machine
    lost = sum(row["coulomb"] for row in rows)

    def taken(columns: Columns) -> Columns:
        return add_torque(machine, columns, -lost * np.abs(columns[FORCE]) * side_of(machine, columns))

    return without(machine, taken, "load_friction")


FREE: Mapping[str, Callable[[Machine], Machine]] = {
    # friction is taken off at the time at which it acts, so the forces are moved there first
    "coulomb": lambda machine: free_of_friction(free_of_delay(machine)),
    "gain": lambda machine: machine,
    "delay": free_of_delay,
    "spring": free_of_spring,
    "growing": free_of_growth,
}


# --- hiding -----------------------------------------------------------------------------------------------------------


def hide(machine: Machine, effect: Effect, strength: float, sign: float = 1.0) -> Machine:
    """The effect at a strength. machine: freed of it. Raises ValueError where no magnitude has the strength."""
    before, nuisance = residuals(machine), bent(machine)
    noise = less(before, nuisance)

    def strength_at(magnitude: float) -> float:
        left = less(residuals(put(machine, effect, sign * magnitude)) - before, nuisance)
        return float(left @ left) / float(noise @ noise)

    magnitude = magnitude_of(strength, strength_at, first_magnitude(effect, machine), effect.most)
    return put(machine, effect, sign * magnitude)


def window(columns: Mapping[str, Array], begin: float, end: float) -> Columns:
    """Both ends included, with the times of the whole."""
    rows = (columns["time"] >= begin) & (columns["time"] <= end)
    return {name: values[rows] for name, values in columns.items()}


@cache
def machine_of(name: str, part: int) -> Machine:
    """A part of the recordings, with the diagnosed model."""
    if name == "emps":
        parts = {name: window(recording(name, "plain"), *WINDOWS[part % len(WINDOWS)])}
    else:
        drawn = np.random.default_rng([part, 26]).permutation(RUNS)[:CHOSEN]
        parts = {run: window(recording(name, run), 0.0, SECONDS) for run in sorted(map(str, drawn))}
    return Machine(name, diagnosed_model(name), parts, KINEMATICS[name])


# --- cases and tables -------------------------------------------------------------------------------------------------


def run_case(name: str, effect: str, strength: float, part: int) -> dict[str, Any]:
    """part: of the recordings; it also gives the sign of an effect that has two."""
    machine, row = machine_of(name, part), {"machine": name, "effect": effect, "strength": strength}
    if effect != NOTHING:
        sign = -1.0 if effect == "gain" and part % 2 else 1.0
        try:
            machine = hide(FREE[effect](machine), EFFECTS[effect], strength, sign)
        except ValueError as impossible:
            return row | {"impossible": str(impossible)}
    recordings = [pd.DataFrame(columns) for columns in machine.recordings.values()]
    diagnosis = Case(name, machine.model, recordings, machine.kinematics, seed=part).diagnosed()
    judgement = judge(causes_of(diagnosis), Truth(EFFECTS[effect].names if effect != NOTHING else ()))
    return row | {
        "verdict": diagnosis.verdict,
        "causes": " ".join(cause.effect for cause in diagnosis.causes),
        "detected": bool(diagnosis.causes),
        "in_set": judgement.in_set,
        "first": judgement.first,
    }


def cases_of(parts: int) -> dict[str, tuple[str, str, float, int]]:
    """The null first, then from the strongest on: what can be run in the time is the more telling part."""
    cases = [(machine, NOTHING, 0.0, part) for machine in MACHINES for part in range(parts)]
    cases += [
        (machine, effect, strength, part)
        for part in range(parts)
        for strength in reversed(STRENGTHS)
        for effect in FREE
        for machine in MACHINES
    ]
    return {
        "_".join(f"{value:g}" if isinstance(value, float) else str(value) for value in case): case for case in cases
    }


def markdown(rows: Sequence[Row]) -> str:
    made = [row for row in rows if "impossible" not in row]
    made.sort(key=lambda row: (MACHINES.index(row["machine"]), row["strength"]))
    lines = by(
        [{**row, "strength": row["strength"] or "nothing hidden"} for row in made], ("machine", "strength"), cells
    )
    return table(("machine", "strength", "cases", "detected", "true cause in the set", "first"), lines) + "\n"


def cells(rows: Sequence[Row]) -> list[str]:
    """Strength 0: nothing is hidden, so no cause is true."""
    answers = [[row[key] for row in rows if row[key] is not None] for key in ("detected", "in_set", "first")]
    return [str(len(rows)), *(count(hits, with_interval=True) if hits else "" for hits in answers)]


def main() -> None:
    options = parser(__doc__)
    options.add_argument("--cases", type=int, default=4, help="parts of the recordings, at each effect and strength")
    options.add_argument("--minutes", type=float, default=math.inf, help="begin no case after these")
    given = options.parse_args()
    cases = cases_of(given.cases)
    rows = run_cases(run_case, cases, given.output, given.workers, given.scheduler, stop_after=60.0 * given.minutes)
    publish(given.output / "measured.md", markdown(rows))


if __name__ == "__main__":
    main()
