"""Closes the simulated finger on a moving object, stops at the contact and holds a force: two FMUs in fmpy.

python grasp.py TendonFinger.fmu friction.fmu [--without] [--pretension N] [--speed RAD/S] [-o TABLE.csv]

`TendonFinger.fmu` of rig.json is the hand, `friction.fmu` of a finger description the friction model. Each millisecond
both are stepped at the same time, as SSP masters do; then the controller gives the inputs of the next step.
"""

from __future__ import annotations

import argparse
import csv
import math
import shutil
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

import fmpy
import numpy as np
from controller import JOINTS, RIG_PRETENSION, SPACE, STEP, Array, Loop, Task, numbered

SETTLED = 1.5  # s after a new force is wanted, from which on errors count


class Component:
    """An FMU in initialisation mode."""

    def __init__(self, path: Path) -> None:
        self._folder = fmpy.extract(str(path))
        description = fmpy.read_model_description(self._folder, validate=False)
        self.vr = {variable.name: variable.valueReference for variable in description.modelVariables}
        self.inputs = [variable.name for variable in description.modelVariables if variable.causality == "input"]
        self.fmu = fmpy.instantiate_fmu(self._folder, description, "CoSimulation")
        self.fmu.setupExperiment(startTime=0.0)
        self.fmu.enterInitializationMode()

    def get(self, names: Sequence[str]) -> Array:
        return np.array(self.fmu.getReal([self.vr[name] for name in names]))

    def set(self, names: Sequence[str], values: Sequence[float]) -> None:
        self.fmu.setReal([self.vr[name] for name in names], values)

    def close(self) -> None:
        self.fmu.terminate()
        self.fmu.freeInstance()
        shutil.rmtree(self._folder, ignore_errors=True)


TRUTH = numbered("truth.contact_force", SPACE) + numbered("truth.external_torque", JOINTS)
RECORDED = [
    "time",
    "c",
    "force",
    "estimate",
    "wanted",
    "contact",
    *Loop.FRICTION,
    *TRUTH,
]  # force: |true contact force|


def record(now: float, loop: Loop, contact: bool, sample: Array, truth: Array) -> list[float]:
    force = float(np.linalg.norm(truth[: len(SPACE)]))
    return [now, loop.c, force, loop.estimate, loop.wanted(now), float(contact), *sample, *truth]


def run(hand: Path, model: Path, task: Task) -> tuple[dict[str, Array], Loop]:
    """Columns over the steps, and the loop as it ends."""
    plant, friction = Component(hand), Component(model)
    loop = Loop(task, friction.get(Loop.ARMS), friction.get(Loop.THRESHOLDS))
    plant.set(["pretension"], [task.pretension - RIG_PRETENSION])
    friction.set(friction.inputs, plant.get(friction.inputs))
    for each in (plant, friction):
        each.fmu.exitInitializationMode()
    rows: list[list[float]] = []
    now, told = 0.0, ""
    while not loop.done(now):
        friction.set(friction.inputs, plant.get(friction.inputs))
        if loop.phase != told:
            friction.set(Loop.THRESHOLDS, loop.thresholds)
            told = loop.phase
        friction.fmu.doStep(now, STEP)
        plant.fmu.doStep(now, STEP)
        now = STEP * (len(rows) + 1)
        contact = bool(friction.fmu.getBoolean([friction.vr["contact"]])[0])
        sample = friction.get(Loop.FRICTION)
        plant.set(Loop.INPUTS, loop.step(now, plant.get(Loop.PLANT), sample, contact))
        rows.append(record(now, loop, contact, sample, plant.get(TRUTH)))
    for each in (plant, friction):
        each.close()
    return dict(zip(RECORDED, np.array(rows).T, strict=True)), loop


def measures(table: dict[str, Array], loop: Loop) -> dict[str, float]:
    """Times of touch and stop s, force at the stop and the largest before force control N, errors of the held force N.

    NaN where there was none. A false stop comes before the touch.
    """
    now, force = table["time"], table["force"]
    touched = now[force > 0.0]
    stop = now <= (math.inf if math.isnan(loop.held_at) else loop.held_at)
    found = {
        "touched_at": touched[0] if touched.size else math.nan,
        "stopped_at": loop.stopped_at,
        "stop_force": force[now <= loop.stopped_at][-1] if loop.stopped_at > 0.0 else math.nan,
        "peak_force": force[stop].max(),
    }
    found["delay"] = found["stopped_at"] - found["touched_at"]
    for k, wanted in enumerate(loop.task.forces):
        since = now - loop.held_at - k * loop.task.hold
        error = force[(since >= SETTLED) & (since < loop.task.hold)] - wanted
        for name, value in (("mean", error.mean()), ("rms", math.sqrt((error**2).mean()))) if error.size else ():
            found[f"{name}_error_{wanted:g}N"] = value
    return {name: float(value) for name, value in found.items()}


def show(found: Mapping[str, float]) -> None:
    for name, value in found.items():
        print(f"{name:>16} {value:8.3f} {'s' if name.endswith(('_at', 'delay')) else 'N'}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("hand", type=Path, help="FMU of rig.json")
    parser.add_argument("model", type=Path, help="FMU of a description of the same finger")
    parser.add_argument("--without", action="store_true", help="compensation: joint torques as they are")
    parser.add_argument("--pretension", type=float, default=RIG_PRETENSION, help="N")
    parser.add_argument("--speed", type=float, default=Task.speed, help="rad/s")
    parser.add_argument("-o", "--output", type=Path, help="CSV of every step")
    given = parser.parse_args()
    task = Task(compensated=not given.without, pretension=given.pretension, speed=given.speed)
    for file in (given.hand, given.model):
        if not file.is_file():
            parser.error(f"{file}: no such file; README.md says how it is built")
    begin = time.perf_counter()
    try:
        table, loop = run(given.hand, given.model, task)
    except KeyError as missing:
        parser.error(f"no variable {missing}: expected FMUs of rig.json and of a description of the same finger")
    wall = time.perf_counter() - begin
    show(measures(table, loop))
    print(f"{'steps':>16} {len(table['time']):8} in {wall:.1f} s")
    if given.output:
        with given.output.open("w", newline="", encoding="utf-8") as file:
            rows = csv.writer(file)
            rows.writerow(table)
            rows.writerows(zip(*table.values(), strict=True))


if __name__ == "__main__":
    sys.exit(main())
