"""Steps the two FMUs of an SSP package by hand with fmpy, both at the same time, as masters do that know no order.

python step_by_hand.py FINGER.ssp [SECONDS]     prints the torques at the end of each tenth of a second
"""

from __future__ import annotations

import shutil
import sys
import tempfile
import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
from fmpy.fmi2 import FMU2Slave
from numpy.typing import NDArray

STEP = 0.001  # s
COMPONENTS = {"plant": "TendonFinger.fmu", "friction": "friction.fmu"}


class Component:
    """One FMU of the package in initialisation mode."""

    def __init__(self, name: str, fmu: Path) -> None:
        self._folder = fmpy.extract(str(fmu))
        description = fmpy.read_model_description(self._folder, validate=False)
        self._vr = {variable.name: variable.valueReference for variable in description.modelVariables}
        self.inputs = [v.name for v in description.modelVariables if v.causality == "input" and v.type == "Real"]
        self.outputs = [v.name for v in description.modelVariables if v.causality == "output" and v.type == "Real"]
        self.fmu = FMU2Slave(
            guid=description.guid,
            unzipDirectory=self._folder,
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName=name,
        )
        self.fmu.instantiate()
        self.fmu.setupExperiment(startTime=0.0)
        self.fmu.enterInitializationMode()

    def get(self, names: Sequence[str]) -> list[float]:
        return list(self.fmu.getReal([self._vr[name] for name in names]))

    def set(self, names: Sequence[str], values: Sequence[float]) -> None:
        self.fmu.setReal([self._vr[name] for name in names], values)

    def close(self) -> None:
        self.fmu.terminate()
        self.fmu.freeInstance()
        shutil.rmtree(self._folder, ignore_errors=True)


def run(package: Path, steps: int, *, sequential: bool = False, blind_start: bool = False) -> dict[str, NDArray[Any]]:
    """Rows of all Real outputs after each step, as `plant.tendon_force[1]`, and `time`, the end of the step.

    sequential: the plant steps first, and the friction FMU takes the sample of that same time: no coupling delay.
    blind_start: the friction FMU starts from inputs of 0, as in fmpy's `simulate_ssp` without start values.
    """
    folder = Path(tempfile.mkdtemp(prefix="step-by-hand-"))
    with zipfile.ZipFile(package) as archive:
        archive.extractall(folder)
    try:
        plant, friction = (Component(name, folder / "resources" / fmu) for name, fmu in COMPONENTS.items())
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    coupled = friction.inputs
    sample = [0.0] * len(coupled) if blind_start else plant.get(coupled)
    friction.set(coupled, sample)
    for component in (plant, friction):
        component.fmu.exitInitializationMode()

    rows = []
    now = 0.0
    for _ in range(steps):
        plant.fmu.doStep(now, STEP)
        if sequential:
            friction.set(coupled, plant.get(coupled))
            friction.fmu.doStep(now + STEP, STEP)
        else:
            friction.set(coupled, sample)
            friction.fmu.doStep(now, STEP)
            sample = plant.get(coupled)
        now += STEP
        rows.append([now, *plant.get(plant.outputs), *friction.get(friction.outputs)])
    names = [f"plant.{name}" for name in plant.outputs] + [f"friction.{name}" for name in friction.outputs]
    for component in (plant, friction):
        component.close()
    return dict(zip(["time", *names], np.array(rows).T, strict=True))


def main(arguments: list[str]) -> int:
    if not 1 <= len(arguments) <= 2:
        print("usage: step_by_hand.py FINGER.ssp [SECONDS]", file=sys.stderr)
        return 2
    seconds = float(arguments[1]) if len(arguments) > 1 else 2.0
    table = run(Path(arguments[0]), round(seconds / STEP))
    joints = sum(name.startswith("friction.compensated_torque") for name in table)
    print("time s   " + "   ".join(f"joint {j}: compensated, true external mN·m" for j in range(1, joints + 1)))
    for k in range(99, len(table["time"]), 100):
        pairs = [
            (table[f"friction.compensated_torque[{j}]"][k], table[f"plant.truth.external_torque[{j}]"][k])
            for j in range(1, joints + 1)
        ]
        print(
            f"{table['time'][k]:6.3f}   " + "   ".join(f"{1e3 * ours:8.2f} {1e3 * true:8.2f}" for ours, true in pairs)
        )
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
