"""The simulated index finger by its own integrators and by scipy's, side by side in one run:

    OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 taskset -c 0 python -m evidence.speed.plant
    taskset -c 0 python -m evidence.speed.plant --fmu

scipy's solvers are given the library's own right-hand side; CVODE and the fixed step have their Jacobians analytic.
--fmu: TendonFinger.fmu instead, its functions called by ctypes, whose share is measured with fmi2GetVersion and taken
off. Times are CPU times on one core.
"""

from __future__ import annotations

import ctypes
import math
import statistics
import tempfile
import time
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
from fmpy.fmi2 import FMU2Slave
from scipy.integrate import solve_ivp

from evidence import tables
from evidence.runner import INDEX_RIG, parser
from tendonfmu.arrays import Array
from tendonfmu.simulate import build_plant_fmu, read_rig
from tendonfmu.simulate.plant import Plant, SolverError

START, SPAN, LONG = 1.5, 0.5, 20.0  # s: where the comparison begins, in motion; simulated by scipy, by the library
PEER_TOLERANCES = (1e-4, 1e-5)
ROUNDS = 3
COMPARED = ("joint_position", "tendon_force", "friction_torque")


def started(rig: str, **settings: Any) -> Plant:
    plant = Plant(rig)
    plant.configure(sensors=False, **settings)
    plant.initialise()
    plant.advance(START)
    return plant


def absolute_tolerance(plant: Plant, tolerance: float, size: int) -> Array:
    """rad, rad/s, m, m/s, bristles, heat and works: the relative tolerance of sizes that matter in a finger."""
    n, m = plant.joints, plant.tendons
    blocks = [np.full(n, 1e-1), np.full(n, 1.0), np.full(m, 1e-3), np.full(m, 1e-2)]
    return tolerance * np.concatenate([*blocks, np.full(size - 2 * n - 2 * m, 1.0)])


def scipy_rows(plant: Plant, exact: Array) -> list[list[str]]:
    lines = []
    y, end = plant.continuous_state(), START + SPAN
    for name in ("LSODA", "Radau", "BDF"):
        for tolerance in PEER_TOLERANCES:
            before = time.process_time()
            absolute = absolute_tolerance(plant, tolerance, y.size)
            solved = solve_ivp(plant.derivative, (START, end), y, name, t_eval=[end], rtol=tolerance, atol=absolute)
            used = time.process_time() - before
            if not solved.success:
                raise SystemExit(f"scipy {name}: {solved.message}")
            error = np.abs(solved.y[: plant.joints, -1] - exact).max()
            lines.append(
                [f"scipy {name}", f"{tolerance:.0e}", f"{SPAN:g}", f"{SPAN / used:.3g}", f"{error:.1e}", "", ""]
            )
    return lines


def library_rows(text: str, tight: dict[str, Array], moments: Array) -> list[list[str]]:
    """The library's integrators take turns in every round; times are medians."""
    choices: list[tuple[str, str, dict[str, Any]]] = [
        ("CVODE", f"{tolerance:.0e}", {"integrator": "cvode", "relative_tolerance": tolerance})
        for tolerance in (1e-4, 1e-5, 1e-6, 1e-7)
    ]
    choices += [
        ("fixed step", f"{step * 1e3:g} ms", {"integrator": "fixed_step", "step": step})
        for step in (1e-4, 2.5e-4, 5e-4, 1e-3, 2e-3)
    ]
    times: list[list[float]] = [[] for _ in choices]
    ends: list[list[str]] = [[] for _ in choices]
    for _ in range(ROUNDS):
        for k, (_, _, settings) in enumerate(choices):
            before = time.process_time()
            try:
                plant = started(text, **settings)
                before = time.process_time()
                got = plant.run(moments)
            except SolverError as failed:
                times[k].append(float("nan"))
                ends[k] = [str(failed).split(":")[0]]
                continue
            times[k].append(time.process_time() - before)
            ends[k] = [f"{np.abs(got[name] - tight[name]).max():.1e}" for name in COMPARED]
    lines = []
    for (name, label, _), used, end in zip(choices, times, ends, strict=True):
        lines.append([name, label, f"{LONG:g}", f"{LONG / statistics.median(used):.3g}", *end])
    return lines


def rows(every: float) -> list[list[str]]:
    text = read_rig(INDEX_RIG).json()
    reference, same = (started(text, integrator="cvode", relative_tolerance=1e-9) for _ in range(2))
    end = START + SPAN
    moments = np.union1d(np.arange(START, START + LONG, every)[1:], [end])
    tight = reference.run(moments)
    exact = tight["joint_position"][np.searchsorted(moments, end)]
    return scipy_rows(same, exact) + library_rows(text, tight, moments)


# --- TendonFinger.fmu -------------------------------------------------------------------------------------------------

SETTINGS = {"CVODE": (1, "relative_tolerance", (1e-6, 1e-5, 1e-4)), "fixed step": (2, "step", (1e-3, 5e-4))}
STEPS = (1e-3, 1e-2)
SECONDS = 10.0  # simulated


def fmu_speed(folder: Path, values: dict[str, float], step: float, new_inputs: bool) -> float:
    """Simulated seconds per CPU second of one run."""
    model = fmpy.read_model_description(folder)
    references = {variable.name: variable.valueReference for variable in model.modelVariables}
    fmu = FMU2Slave(
        guid=model.guid,
        unzipDirectory=str(folder),
        modelIdentifier=model.coSimulation.modelIdentifier,
        instanceName="fmu",
    )
    fmu.instantiate()
    for name, value in values.items():
        if name == "integrator":
            fmu.setInteger([references[name]], [int(value)])
        else:
            fmu.setReal([references[name]], [value])
    fmu.setupExperiment(startTime=0.0)
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    set_real, do_step, get_version = (getattr(fmu.dll, f"fmi2{name}") for name in ("SetReal", "DoStep", "GetVersion"))
    do_step.argtypes = [ctypes.c_void_p, ctypes.c_double, ctypes.c_double, ctypes.c_int]
    reference = (ctypes.c_uint * 1)(references["tendon_position_command[1]"])
    count, command = round(SECONDS / step), ctypes.c_double()
    started = time.process_time()
    for _ in range(count * (2 if new_inputs else 1)):
        get_version()
    called = time.process_time()
    for k in range(count):
        if new_inputs:
            command.value = 1e-5 * math.sin(6.0 * k * step)
            set_real(fmu.component, reference, 1, ctypes.byref(command))
        if do_step(fmu.component, k * step, step, 1):
            raise RuntimeError(f"fmi2DoStep at {k * step} s was refused")
    used = time.process_time() - called - (called - started)
    fmu.terminate()
    fmu.freeInstance()
    return SECONDS / used


def fmu_rows() -> list[list[str]]:
    lines = []
    with tempfile.TemporaryDirectory() as folder:
        unpacked = Path(fmpy.extract(str(build_plant_fmu(INDEX_RIG, Path(folder) / "finger.fmu")), f"{folder}/fmu"))
        for name, (integrator, setting, accuracies) in SETTINGS.items():
            for accuracy in accuracies:
                label = f"{accuracy:g}" if integrator == 1 else f"{1e3 * accuracy:g} ms"
                for new_inputs in (False, True):
                    case = {"integrator": integrator, setting: accuracy}
                    best = [max(fmu_speed(unpacked, case, step, new_inputs) for _ in range(ROUNDS)) for step in STEPS]
                    lines.append([name, label, "new each step" if new_inputs else "held", *(f"{x:.0f}" for x in best)])
    return lines


def main() -> None:
    options = parser(__doc__, output=None)
    options.add_argument("--every", type=float, default=0.01, help="s between the library's outputs")
    options.add_argument("--fmu", action="store_true", help="TendonFinger.fmu instead")
    given = options.parse_args()
    if given.fmu:
        head = ["integrator", "accuracy", "inputs", *(f"step {1e3 * step:g} ms" for step in STEPS)]
        print(tables.table(head, fmu_rows(), 3))
        return
    lines = rows(given.every)
    head = ["integrator", "tolerance or step", "simulated s", "per CPU s"]
    print(tables.table([*head, "joint_position [rad]", "tendon_force [N]", "friction_torque [N·m]"], lines))
    print("\nLast columns: largest errors against CVODE at 1e-9 (scipy: at its end).")


if __name__ == "__main__":
    main()
