"""TendonFinger.fmu: simulated s per CPU s at communication steps of 1 and 10 ms, inputs held or new each step.

    taskset -c 0 .venv/bin/python bench/compare_plant_fmu.py

The FMU's own functions are called (fmi2SetReal of one motor command, fmi2DoStep), from Python by ctypes, whose share is
measured with fmi2GetVersion and taken off.
"""

from __future__ import annotations

import argparse
import ctypes
import math
import sys
import tempfile
import time
from pathlib import Path

from rich.console import Console
from rich.table import Table

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "python_tests" / "support"))

from fmu_binary import Instance, UnpackedFmu, unpack  # noqa: E402
from tendonfmu.simulate.fmu_packaging import build_plant_fmu  # noqa: E402

RIG = ROOT / "examples" / "rigs" / "index_finger.json"
SETTINGS = [(1, 1e-6), (1, 1e-5), (1, 1e-4), (2, 1e-3), (2, 5e-4)]
STEPS = (1e-3, 1e-2)


def simulate(
    fmu: UnpackedFmu, integrator: int, accuracy: float, step: float, new_inputs: bool, seconds: float
) -> float:
    """Simulated seconds per CPU second of one run."""
    with Instance(fmu, logger=False) as instance:
        instance.set_integer("integrator", integrator)
        instance.set_real({"relative_tolerance" if integrator == 1 else "step": accuracy})
        instance.initialise()
        reference = instance.vrs(["tendon_position_command[1]"])
        count, command = round(seconds / step), ctypes.c_double()

        started = time.process_time()
        for _ in range(count * (2 if new_inputs else 1)):
            fmu.library.fmi2GetVersion()
        called = time.process_time()
        for k in range(count):
            if new_inputs:
                command.value = 1e-5 * math.sin(6.0 * k * step)
                fmu.library.fmi2SetReal(instance.component, reference, 1, ctypes.byref(command))
            status = fmu.library.fmi2DoStep(instance.component, k * step, step, 1)
            if status != 0:
                raise RuntimeError(f"fmi2DoStep at {k * step} s returned {status}")
        return seconds / (time.process_time() - called - (called - started))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=10.0, help="simulated time of a run")
    parser.add_argument("--rounds", type=int, default=3, help="the best of these counts")
    options = parser.parse_args()
    table = Table(title="TendonFinger.fmu, index finger (4 joints, 8 tendons): simulated s per CPU s")
    for heading in ("integrator", "accuracy", "inputs", *(f"step {1e3 * step:g} ms" for step in STEPS)):
        table.add_column(heading, justify="right" if heading.startswith("step") else "left")
    with tempfile.TemporaryDirectory() as folder:
        fmu = unpack(build_plant_fmu(RIG, Path(folder) / "finger.fmu"), Path(folder) / "fmu")
        for integrator, accuracy in SETTINGS:
            name, unit = ("CVODE", f"{accuracy:g}") if integrator == 1 else ("fixed step", f"{1e3 * accuracy:g} ms")
            for new_inputs in (False, True):
                best = [
                    max(
                        simulate(fmu, integrator, accuracy, step, new_inputs, options.seconds)
                        for _ in range(options.rounds)
                    )
                    for step in STEPS
                ]
                table.add_row(name, unit, "new each step" if new_inputs else "held", *(f"{each:.0f}" for each in best))
    Console().print(table)


if __name__ == "__main__":
    main()
