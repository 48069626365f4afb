"""Importers that step an FMU over signals: fmpy, ecos, libcosim, and a container of the FMU Manipulation Toolbox.

Each gets the first sample before the initialisation ends, and returns the outputs after every step.
"""

from __future__ import annotations

import importlib.metadata
import multiprocessing
import subprocess
import sysconfig
import tempfile
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]


@dataclass(frozen=True)
class Task:
    """What an importer has to do with an FMU."""

    fmu: Path
    fmi: int  # version
    signals: Array  # structured [N]: time (s, from 0) and inputs, as fmpy reads the CSV file
    outputs: Sequence[str]

    @property
    def step(self) -> float:  # s
        return float(self.signals["time"][1])

    @property
    def inputs(self) -> Sequence[str]:
        return self.signals.dtype.names[1:]

    def scalars(self, k: int) -> list[float]:
        """Return the inputs of sample k, for importers that take scalars only."""
        return [float(np.ravel(self.signals[name][k])[0]) for name in self.inputs]


@dataclass(frozen=True)
class Importer:
    name: str
    package: str  # its distribution on PyPI
    run: Callable[[Task], Array]  # outputs [N - 1, elements of all outputs]
    refuses: Callable[[Task], str] = lambda task: ""  # why it cannot take the FMU

    def version(self) -> str | None:
        """Return the version, or None without the importer."""
        try:
            return importlib.metadata.version(self.package)
        except importlib.metadata.PackageNotFoundError:
            return None


def flat_rows(table: Array, names: Sequence[str]) -> Array:
    """Return the elements of variables side by side. [rows, elements]"""
    return np.column_stack([table[name].reshape(len(table), -1).astype(float) for name in names])


def _fmpy(task: Task) -> Array:
    result = fmpy.simulate_fmu(
        str(task.fmu),
        validate=False,
        input=task.signals,
        output=task.outputs,
        output_interval=task.step,
        stop_time=float(task.signals["time"][-1]),
    )
    return flat_rows(result, task.outputs)[1:]


def _ecos(task: Task) -> Array:
    from ecospy import EcosSimulation, EcosSimulationStructure
    from ecospy.EcosParameterSet import EcosParameterSet

    structure, first, kinds = EcosSimulationStructure(), EcosParameterSet(), _kinds(task.fmu)
    structure.add_model("finger", str(task.fmu))
    for name, value in zip(task.inputs, task.scalars(0), strict=True):
        first.add_real(f"finger::{name}", value)
    structure.add_parameter_set("first sample", first)
    rows = []
    with EcosSimulation(structure=structure, step_size=task.step) as simulation:
        read = {"Boolean": simulation.get_bool}
        simulation.init(parameter_set="first sample")
        for k in range(len(task.signals) - 1):
            for name, value in zip(task.inputs, task.scalars(k), strict=True):
                simulation.set_real(f"finger::{name}", value)
            simulation.step()
            rows.append([read.get(kinds[name], simulation.get_real)(f"finger::{name}") for name in task.outputs])
    return np.array(rows, dtype=float)


def _libcosim(task: Task) -> Array:
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
    from libcosimpy.CosimManipulator import CosimManipulator
    from libcosimpy.CosimObserver import CosimObserver
    from libcosimpy.CosimSlave import CosimLocalSlave

    log_output_level(CosimLogLevel.FATAL)
    execution, kinds = CosimExecution.from_step_size(round(task.step * 1e9)), _kinds(task.fmu)  # ns
    finger = execution.add_local_slave(CosimLocalSlave(str(task.fmu), "finger"))
    observer, manipulator = CosimObserver.create_last_value(), CosimManipulator.create_override()
    execution.add_observer(observer)
    execution.add_manipulator(manipulator)
    vr = {variable.name.decode(): variable.reference for variable in execution.slave_variables(finger)}
    inputs = [vr[name] for name in task.inputs]
    for reference, value in zip(inputs, task.scalars(0), strict=True):
        execution.real_initial_value(finger, reference, value)
    rows, read = [], {"Boolean": observer.last_boolean_values}
    for k in range(len(task.signals) - 1):
        if not manipulator.slave_real_values(finger, inputs, task.scalars(k)) or not execution.step():
            raise RuntimeError(f"step {k + 1} failed")
        rows.append([read.get(kinds[name], observer.last_real_values)(finger, [vr[name]])[0] for name in task.outputs])
    return np.array(rows, dtype=float)


def _container(task: Task) -> Array:
    # The container is an FMU in C that loads and steps ours; fmpy steps it in a process of its own, since it crashed in
    # one that had loaded much else.
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "finger.fmu").write_bytes(task.fmu.read_bytes())
        (folder / "box.csv").write_text("rule;from_fmu;from_port;to_fmu;to_port\nFMU;finger.fmu;;;\n")
        command = [sysconfig.get_path("scripts") + "/fmucontainer", "-container", f"box.csv:{task.step!r}"]
        done = subprocess.run([*command, "-fmi", str(task.fmi)], cwd=folder, capture_output=True, text=True)
        if done.returncode:
            raise RuntimeError(f"fmucontainer: {(done.stderr or done.stdout).strip()}")
        with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as apart:
            return apart.submit(_fmpy, Task(folder / "box.fmu", task.fmi, task.signals, task.outputs)).result()


def _kinds(fmu: Path) -> dict[str, str]:
    return {each.name: each.type for each in fmpy.read_model_description(str(fmu), validate=False).modelVariables}


def _refuses_arrays(task: Task) -> str:
    has_arrays = any(task.signals[name].ndim > 1 for name in task.inputs)
    return "no arrays" if has_arrays else ""


IMPORTERS = (
    Importer("fmpy", "fmpy", _fmpy),
    Importer("ecos", "ecospy", _ecos, _refuses_arrays),
    Importer("libcosim", "libcosimpy", _libcosim, lambda task: "no FMI 3.0" if task.fmi == 3 else ""),
    Importer("FMU Manipulation Toolbox", "fmu_manipulation_toolbox", _container),
)
