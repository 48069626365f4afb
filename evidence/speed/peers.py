"""The same finger over the same recording, stepped in four ways, side by side in one run:

    pip install --require-hashes -r requirements-peers.lock
    python -m evidence.speed.peers --model python_tests/support/oracle.py

All four must agree before their times are worth anything. Each time is the median of `ROUNDS` rounds in which the four
take turns; the slow ones take fewer samples of the same recording.
"""

from __future__ import annotations

import importlib
import json
import statistics
import sys
import tempfile
import textwrap
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from evidence import tables
from evidence.runner import EXAMPLES, INDEX_FINGER, parser
from tendonfmu.fmu import build_fmu, run_fmu
from tendonfmu.model import native
from tendonfmu.recordings import Recording, read_recording

RECORDING = EXAMPLES / "demo_recording" / "index_finger_pushes.parquet"
ROUNDS = 5
FEW = 300  # samples for the slow ones

# A slave with the FMU's variables (docs/reference/semantics.md#fmu-variables) around the numpy model.
SLAVE = """
import json, os, sys
sys.path.insert(0, os.path.join(os.path.dirname(__file__)))
import numpy as np
import oracle
from pythonfmu import Boolean, Fmi2Causality, Fmi2Slave, Fmi2Variability, Integer, Real



class NumpyFinger(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        with open(os.path.join(self.resources, "index_finger.json"), encoding="utf-8") as file:
            self.finger = oracle.FingerOracle(json.load(file), 1)
        n, m = self.finger.n, self.finger.m
        self.kinematics_source = 1
        self.register_variable(Integer("kinematics_source", causality=Fmi2Causality.parameter,
                                       variability=Fmi2Variability.fixed))
        for name, count in (("tendon_force", m), ("tendon_position", m), ("joint_position", n), ("joint_velocity", n)):
            setattr(self, name, np.zeros(count))
            for i in range(count):
                self._register(Real, name, i, Fmi2Causality.input)
        for name in ("compensated_torque", "joint_torque", "friction_torque", "bias_torque", "joint_angle",
                     "joint_speed"):
            setattr(self, name, np.zeros(n))
            for i in range(n):
                self._register(Real, name, i, Fmi2Causality.output)
        self.joint_contact, self.slack, self.contact = np.zeros(n, bool), np.zeros(m, bool), False
        for name, count in (("joint_contact", n), ("slack", m)):
            for i in range(count):
                self._register(Boolean, name, i, Fmi2Causality.output)
        self.register_variable(Boolean("contact", causality=Fmi2Causality.output))

    def _register(self, kind, name, i, causality):
        def get():
            value = getattr(self, name)[i]
            return bool(value) if kind is Boolean else float(value)

        def put(value):
            getattr(self, name)[i] = value

        self.register_variable(kind(f"{name}[{i + 1}]", causality=causality, getter=get, setter=put))

    def do_step(self, current_time, step_size):
        step = self.finger.step(current_time, {"tendon_force": self.tendon_force.copy(),
                                               "tendon_position": self.tendon_position.copy()})
        for name, value in step.values.items():
            setattr(self, name, bool(np.asarray(value)) if name == "contact" else np.asarray(value))
        return True
"""


def slave_fmu(folder: Path, model: Path) -> Path:
    """An FMU of the numpy model, made by PythonFMU."""
    try:
        from pythonfmu.builder import FmuBuilder
    except ImportError:
        sys.exit("PythonFMU is not installed: .venv/bin/pip install --require-hashes -r requirements-peers.lock")
    script = folder / "numpy_finger.py"
    script.write_text(textwrap.dedent(SLAVE), encoding="utf-8")
    parts = [model, model.with_name("oracle_finger.py"), INDEX_FINGER]
    return Path(FmuBuilder.build_FMU(script, dest=folder, project_files=parts))


def first(recording: Recording, samples: int) -> Recording:
    return replace(
        recording, time=recording.time[:samples], groups={n: a[:samples] for n, a in recording.groups.items()}
    )


def seconds(action: Callable[[], Any]) -> float:
    begin = time.perf_counter()
    action()
    return time.perf_counter() - begin


def column_sum(columns: dict[str, Any], samples: int) -> float:
    return float(sum(np.abs(columns[f"compensated_torque[{j}]"][:samples]).sum() for j in range(1, 5)))


def main() -> None:
    options = parser(__doc__, output=None)
    options.add_argument("--model", type=Path, required=True, help="the naive numpy model of the tests, oracle.py")
    model = options.parse_args().model.resolve()
    sys.path.insert(0, str(model.parent))
    oracle = importlib.import_module(model.stem)

    recording = read_recording(RECORDING)
    short = first(recording, FEW)
    description = json.loads(INDEX_FINGER.read_text(encoding="utf-8"))
    arrays, few = recording.arrays(), short.arrays()
    with tempfile.TemporaryDirectory() as name:
        fmu = build_fmu(INDEX_FINGER, Path(name) / "index_finger.fmu")
        slave = slave_fmu(Path(name), model)
        finger = native.Instance.from_description(description)

        def c_interface() -> Any:
            finger.reset()
            return finger.run(arrays)

        ways: list[tuple[str, int, Callable[[], Any]]] = [
            (f"C interface, kernel {finger.kernel}", len(recording), c_interface),
            ("FMU through fmpy", len(recording), lambda: run_fmu(fmu, recording)),
            ("numpy (the tests' naive model)", FEW, lambda: oracle.run(description, few, 1)),
            ("PythonFMU of that, through fmpy", FEW, lambda: run_fmu(slave, short)),
        ]
        expected = np.abs(oracle.run(description, few, 1).outputs["compensated_torque"]).sum()
        for got in (
            np.abs(finger.run(few)["compensated_torque"]).sum(),
            column_sum(run_fmu(fmu, short), FEW),
            column_sum(run_fmu(slave, short), FEW),
        ):
            if not np.isclose(got, expected, rtol=1e-9):
                sys.exit(f"the four do not agree: {got!r} and {expected!r}; no times are worth showing")
        times: dict[str, list[float]] = {way[0]: [] for way in ways}
        for _ in range(ROUNDS):
            for label, samples, action in ways:
                times[label].append(seconds(action) / samples)
    base = statistics.median(times[ways[0][0]])
    medians = {label: statistics.median(values) for label, values in times.items()}
    lines = [[label, f"{1e6 * median:.2f} µs", f"{median / base:.0f}"] for label, median in medians.items()]
    print(tables.table(["index finger, 4 joints, 8 tendons, 60 s at 500 Hz", "a step", "ratio"], lines))


if __name__ == "__main__":
    main()
