"""Steps the two FMUs of an SSP package by hand with fmpy, both at the same time, as masters do that have no order.

python step_by_hand.py FINGER.ssp [SECONDS]     prints torques and contact at the end of each tenth of a second
"""

from __future__ import annotations

import argparse
import shutil
import tempfile
import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
from numpy.typing import NDArray

STEP = 0.001  # s
LONGEST = 3600.0  # s
COMPONENTS = ("TendonFinger.fmu", "friction.fmu")


class Component:
    """One FMU of the package in initialisation mode."""

    def __init__(self, fmu: Path) -> None:
        self._folder = fmpy.extract(str(fmu))
        description = fmpy.read_model_description(self._folder, validate=False)
        self._vr = {variable.name: variable.valueReference for variable in description.modelVariables}
        self.inputs = [v.name for v in description.modelVariables if v.causality == "input" and v.type == "Real"]
        self.outputs = [v.name for v in description.modelVariables if v.causality == "output" and v.type == "Real"]
        self.flags = [v.name for v in description.modelVariables if v.causality == "output" and v.type == "Boolean"]
        self.fmu = fmpy.instantiate_fmu(self._folder, description, "CoSimulation")
        self.fmu.setupExperiment(startTime=0.0)
        self.fmu.enterInitializationMode()

    def get(self, names: Sequence[str]) -> list[float]:
        return list(self.fmu.getReal([self._vr[name] for name in names]))

    def results(self) -> list[float]:
        """All outputs, flags as 0 and 1."""
        flags = self.fmu.getBoolean([self._vr[name] for name in self.flags])
        return [*self.get(self.outputs), *(float(flag) for flag in flags)]

    def set(self, names: Sequence[str], values: Sequence[float]) -> None:
        self.fmu.setReal([self._vr[name] for name in names], values)

    def close(self) -> None:
        self.fmu.terminate()
        self.fmu.freeInstance()
        shutil.rmtree(self._folder, ignore_errors=True)


def run(package: Path, steps: int, *, sequential: bool = False, blind_start: bool = False) -> dict[str, NDArray[Any]]:
    """Rows of all outputs after each step, as `plant.tendon_force[1]`, flags 0 or 1, and `time`, the end of the step.

    sequential: the plant steps first, and the friction FMU takes the sample of that same time: no coupling delay.
    blind_start: the friction FMU starts from inputs of 0, as in fmpy's `simulate_ssp` without start values.
    """
    with tempfile.TemporaryDirectory() as folder, zipfile.ZipFile(package) as archive:
        archive.extractall(folder)
        plant, friction = (Component(Path(folder, "resources", fmu)) for fmu in COMPONENTS)
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
        rows.append([now, *plant.results(), *friction.results()])
    names = ["time"]
    for prefix, component in (("plant", plant), ("friction", friction)):
        names += [f"{prefix}.{name}" for name in component.outputs + component.flags]
        component.close()
    return dict(zip(names, np.array(rows).T, strict=True))


def show(table: dict[str, NDArray[Any]]) -> None:
    """A row each tenth of a second; of contact, whether the friction FMU detects one and whether there is one."""
    joints = sum(name.startswith("friction.compensated_torque[") for name in table)
    heads = [f"joint {j}: compensated, true external mN·m" for j in range(1, joints + 1)]
    print("   ".join(["time s", "contact: detected, true", *heads]))
    for k in range(99, len(table["time"]), 100):
        pairs = [
            (table[f"friction.compensated_torque[{j}]"][k], table[f"plant.truth.external_torque[{j}]"][k])
            for j in range(1, joints + 1)
        ]
        contact = [f"{table[name][k]:1.0f}" for name in ("friction.contact", "plant.truth.contact")]
        torques = [f"{1e3 * ours:8.2f} {1e3 * true:8.2f}" for ours, true in pairs]
        print("   ".join([f"{table['time'][k]:6.3f}", " ".join(contact), *torques]))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("package", type=Path, metavar="FINGER.ssp", help="package of make_ssp.py")
    parser.add_argument("seconds", type=float, nargs="?", default=2.0, metavar="SECONDS")
    given = parser.parse_args()
    if not STEP <= given.seconds <= LONGEST:
        parser.error(f"SECONDS = {given.seconds}: expected a number from {STEP:g} to {LONGEST:g}")
    try:
        table = run(given.package, round(given.seconds / STEP))
    except (OSError, zipfile.BadZipFile) as wrong:
        parser.error(f"{wrong}: expected a package of make_ssp.py")
    show(table)


if __name__ == "__main__":
    main()
