"""The same grasp with the FMUs of an SSP package, stepped by ecos or libcosim; the controller acts between the steps.

python ssp_masters.py GRASP.ssp [ecos or libcosim]     prints the measures of grasp.py
"""

from __future__ import annotations

import io
import sys
import tempfile
import zipfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Protocol

import fmpy
import numpy as np
from controller import STEP, Array, Loop, Task
from grasp import RECORDED, TRUTH, measures, record, show

from tendonfmu.simulate.ssp import FRICTION_FMU


class Master(Protocol):
    """What the loop needs of a master: numbers by component and name, and a step of 1 ms."""

    def get(self, component: str, names: Sequence[str]) -> Array: ...
    def contact(self) -> bool: ...
    def set(self, component: str, names: Sequence[str], values: Sequence[float]) -> None: ...
    def step(self) -> None: ...
    def close(self) -> None: ...


class Ecos:
    def __init__(self, package: Path) -> None:
        from ecospy import EcosSimulation

        self._simulation = EcosSimulation(ssp_path=str(package), step_size=STEP)
        self._simulation.init()

    def get(self, component: str, names: Sequence[str]) -> Array:
        return np.array([self._simulation.get_real(f"{component}::{name}") for name in names])

    def contact(self) -> bool:
        return bool(self._simulation.get_bool("friction::contact"))

    def set(self, component: str, names: Sequence[str], values: Sequence[float]) -> None:
        for name, value in zip(names, values, strict=True):
            self._simulation.set_real(f"{component}::{name}", float(value))

    def step(self) -> None:
        self._simulation.step()

    def close(self) -> None:
        self._simulation.terminate()
        self._simulation.free()


class Libcosim:
    """Reads the unpacked package; values are set by a manipulator, which holds them until they are set again."""

    def __init__(self, package: Path) -> None:
        from libcosimpy.CosimExecution import CosimExecution
        from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
        from libcosimpy.CosimManipulator import CosimManipulator
        from libcosimpy.CosimObserver import CosimObserver

        log_output_level(CosimLogLevel.FATAL)
        self._folder = tempfile.TemporaryDirectory()
        with zipfile.ZipFile(package) as archive:
            archive.extractall(self._folder.name)
        self._execution = CosimExecution.from_ssp_file(self._folder.name, step_size=round(STEP * 1e9))
        self._observer, self._manipulator = CosimObserver.create_last_value(), CosimManipulator.create_override()
        self._execution.add_observer(self._observer)
        self._execution.add_manipulator(self._manipulator)
        self._index = {name: self._execution.slave_index_from_instance_name(name) for name in ("plant", "friction")}
        self._vr = {
            name: {each.name.decode(): each.reference for each in self._execution.slave_variables(index)}
            for name, index in self._index.items()
        }

    def get(self, component: str, names: Sequence[str]) -> Array:
        references = [self._vr[component][name] for name in names]
        return np.array(self._observer.last_real_values(self._index[component], references))

    def contact(self) -> bool:
        return bool(self._observer.last_boolean_values(self._index["friction"], [self._vr["friction"]["contact"]])[0])

    def set(self, component: str, names: Sequence[str], values: Sequence[float]) -> None:
        references = [self._vr[component][name] for name in names]
        if not self._manipulator.slave_real_values(self._index[component], references, [float(x) for x in values]):
            raise RuntimeError(f"libcosim: {component} takes no {names[0]}")

    def step(self) -> None:
        if not self._execution.step():
            raise RuntimeError("libcosim: a step failed")

    def close(self) -> None:
        del self._execution
        self._folder.cleanup()


MASTERS: dict[str, Callable[[Path], Master]] = {"ecos": Ecos, "libcosim": Libcosim}


def start_values(package: Path, names: Sequence[str]) -> Array:
    """Of parameters of the friction FMU, from its description: libcosim shows no value before the first step."""
    with zipfile.ZipFile(package) as archive:
        description = fmpy.read_model_description(io.BytesIO(archive.read(f"resources/{FRICTION_FMU}")), validate=False)
    start = {variable.name: variable.start for variable in description.modelVariables}
    return np.array([float(start[name]) for name in names])


def run(master_name: str, package: Path, task: Task) -> tuple[dict[str, Array], Loop]:
    """As grasp.run; the pretension is that of the package's rig."""
    master = MASTERS[master_name](package)
    loop = Loop(task, start_values(package, Loop.ARMS), start_values(package, Loop.THRESHOLDS))
    rows: list[list[float]] = []
    now, told = 0.0, ""
    while not loop.done(now):
        if loop.phase != told:
            master.set("friction", Loop.THRESHOLDS, loop.thresholds)
            told = loop.phase
        master.step()
        now = STEP * (len(rows) + 1)
        sample = master.get("friction", Loop.FRICTION)
        contact = master.contact()
        master.set("plant", Loop.INPUTS, loop.step(now, master.get("plant", Loop.PLANT), sample, contact))
        rows.append(record(now, loop, contact, sample, master.get("plant", TRUTH)))
    master.close()
    return dict(zip(RECORDED, np.array(rows).T, strict=True)), loop


def main(arguments: list[str]) -> int:
    if not 1 <= len(arguments) <= 2 or (arguments[1:] and arguments[1] not in MASTERS):
        print("usage: ssp_masters.py GRASP.ssp [ecos or libcosim]", file=sys.stderr)
        return 2
    if not Path(arguments[0]).is_file():
        print(f"ssp_masters.py: {arguments[0]}: no such file; make_ssp.py makes it", file=sys.stderr)
        return 2
    name = arguments[1] if len(arguments) > 1 else "ecos"
    table, loop = run(name, Path(arguments[0]), Task())
    show(measures(table, loop))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
