"""Speed and memory of the fit: python -m evidence.fit.speed --output fit.json

Each way runs in a process of its own.
"""

from __future__ import annotations

import json
import os
import platform
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from evidence import tables
from evidence.fit.made_data import model_torques, noise_scale
from evidence.runner import INDEX_FINGER, ROOT, parser, plain, write
from tendonfmu.arrays import Array
from tendonfmu.estimate import Choice, Estimator, FrictionFit, Structure, build_structure
from tendonfmu.estimate.estimation import Learner
from tendonfmu.excite import Plan, plan_excitation, read_subject
from tendonfmu.excite.excitation import START
from tendonfmu.excite.training_motion import as_array, find_ranges
from tendonfmu.files import write_table
from tendonfmu.model import balanced_forces, read_finger

FULL = 400_000  # samples
RATE = 1000.0  # Hz
BEGIN = round(START * RATE)  # before it, all joints rest
PRETENSIONS = (15.0, 30.0)  # N, in turn
ALTERNATE = 50.0  # s
SPREAD = 0.3  # of the logarithm of each number of the truth about the description
FILE = "recording"
PRIOR_STD, TOLERANCE = 1.0, 0.1  # as `tendonfmu fit` has them
ONE_THREAD = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}  # of what is not the product's own


class Watch:
    """Adds up the time spent inside of `with`."""

    def __init__(self) -> None:
        self.seconds = self.cpu_seconds = 0.0

    def __enter__(self) -> Watch:
        self._begin = time.perf_counter(), time.process_time()
        return self

    def __exit__(self, *_: object) -> None:
        self.seconds += time.perf_counter() - self._begin[0]
        self.cpu_seconds += time.process_time() - self._begin[1]

    def times(self) -> dict[str, float]:
        return {"seconds": self.seconds, "cpu_seconds": self.cpu_seconds}


# --- the data ---------------------------------------------------------------------------------------------------------


def other_numbers(node: Any, draw: Callable[[], float]) -> Any:
    """The same description with the numbers of its laws and covers multiplied by draws."""
    if isinstance(node, list):
        return [other_numbers(inner, draw) for inner in node]
    if not isinstance(node, dict):
        return node
    if "coulomb" in node:
        coulomb = node["coulomb"] * draw()
        drop = (node["static"] - node["coulomb"]) * draw()
        return {
            **node,
            "static": coulomb + drop,
            "coulomb": coulomb,
            "stribeck_velocity": node["stribeck_velocity"] * draw(),
            "viscous": node.get("viscous", 0.0) * draw(),
        }
    return {
        key: {**value, "stiffness": value["stiffness"] * draw()}
        if key == "cover" and value
        else other_numbers(value, draw)
        for key, value in node.items()
    }


def make_data(folder: Path, duration: float) -> None:
    """Writes recording.parquet and .npz: a motion of `excite`, and y = T + b + e by another finger's numbers.

    The forces carry that finger's friction; what the jumps of fig. 5, a random walk and white noise add to it comes as
    known load, `external_torque` = Rᵀ f0 − y, so that no tendon goes slack however far the bias wanders.
    """
    rng = np.random.default_rng(1)
    subject = read_subject(INDEX_FINGER)
    truth = other_numbers(subject.finger.data, lambda: float(np.exp(SPREAD * rng.standard_normal())))
    ranges = as_array(find_ranges(subject, []))
    alternate = min(ALTERNATE, duration / 2)
    plan = Plan(ranges, duration=duration, pretensions=PRETENSIONS, alternate=alternate, rate=RATE)
    motion = plan_excitation(truth, plan)
    arrays = {"time": motion.time, "joint_position": motion.joint_position, "joint_velocity": motion.joint_velocity}
    arrays["tendon_force"] = balanced_forces(truth, arrays, motion.pretension)
    torque, jumps = model_torques(truth, arrays)
    white, steps = rng.standard_normal((2, *torque.shape))
    walk = np.sqrt(truth["bias"]["drift_variance"] / RATE) * np.cumsum(steps, axis=0)
    noise = noise_scale(truth, motion.time, arrays["tendon_force"]) * white
    arms, stiffness = np.array(subject.finger.moment_arms), [tendon["stiffness"] for tendon in truth["tendons"]]
    arrays["external_torque"] = arrays["tendon_force"] @ arms - (torque + jumps + walk + noise)
    arrays["tendon_position"] = motion.joint_position @ arms.T + arrays["tendon_force"] / stiffness
    columns = {
        f"{name}[{k}]": column
        for name, array in arrays.items()
        if name != "time"
        for k, column in enumerate(array.T, start=1)
    }
    write_table(folder / f"{FILE}.parquet", {"time": motion.time} | columns)
    np.savez(folder / f"{FILE}.npz", allow_pickle=False, **arrays)


def load(folder: Path, samples: int) -> dict[str, Array]:
    """So many samples of what make_data wrote, from the beginning of the motion on."""
    with np.load(folder / f"{FILE}.npz") as file:
        return {name: np.ascontiguousarray(file[name][BEGIN : BEGIN + samples]) for name in file.files}


def structure() -> Structure:
    return build_structure(read_finger(INDEX_FINGER), Choice())


def call_with(arrays: Mapping[str, Array]) -> dict[str, Any]:
    """Arguments of Estimator.add_recording and Learner.run."""
    given = {name: array for name, array in arrays.items() if name != "external_torque"}
    return {"arrays": given, "kinematics_source": 3, "external_torque": arrays["external_torque"]}


# --- the ways ---------------------------------------------------------------------------------------------------------


def command(folder: Path) -> dict[str, Any]:
    """`tendonfmu fit` of the whole file: reading, judging and the report included."""
    with Watch() as watch:
        fit = FrictionFit(INDEX_FINGER, kinematics=3).fit([folder / f"{FILE}.parquet"])
    samples = sum(recording["used"] for recording in fit.report_["recordings"])
    return watch.times() | {"passes": fit.report_["passes"], "converged": fit.converged_, "samples": samples}


def batch(arrays: Mapping[str, Array], tolerance: float = TOLERANCE) -> dict[str, Any]:
    chosen = structure()
    estimator = Estimator(chosen.start.image, chosen.group, chosen.scale)
    estimator.add_recording(**call_with(arrays))
    with Watch() as watch:
        fit = estimator.fit(prior_std=PRIOR_STD, tolerance=tolerance)
    figures = {name: getattr(fit, name) for name in ("z", "cost", "passes", "converged")}
    return watch.times() | figures | {"std": np.sqrt(np.diag(fit.covariance)), "iterations": fit.steps}


def ekf(arrays: Mapping[str, Array], passes: int = 2, block: int = 8) -> dict[str, Any]:
    chosen = structure()
    learner = Learner(chosen.start.image, chosen.group, chosen.scale, prior_std=PRIOR_STD, block=block)
    with Watch() as watch:
        for number in range(passes):
            if number > 0:
                learner.begin_pass()
            learner.run(**call_with(arrays))
    return {"passes": passes} | watch.times() | {"z": learner.z, "std": np.sqrt(np.diag(learner.covariance))}


Function = Callable[[Mapping[str, Array]], dict[str, Any]]


@dataclass(frozen=True)
class Way:
    what: str
    samples: int  # that it takes
    run: Function | None  # None: the command, from the file


WAYS = {
    "command": Way("tendonfmu fit, file to report", FULL, None),
    "batch": Way("batch, to convergence", FULL, batch),
    "ekf": Way("EKF, both passes", FULL, ekf),
}


# --- one process for each ---------------------------------------------------------------------------------------------


def measured(name: str, folder: Path, samples: int) -> dict[str, Any]:
    """Figures of a way, in this process."""
    function = WAYS[name].run
    if function is None:
        figures = command(folder)
    else:
        arrays = load(folder, samples)
        figures = function(arrays) | {"samples": len(arrays["time"])}
    return figures | {"peak_memory": peak_memory()}


def peak_memory() -> int:
    """Bytes, of this process on Linux, where getrusage counts what the parent had before it started this program."""
    known = re.search(r"VmHWM:\s*(\d+)", Path("/proc/self/status").read_text(encoding="utf-8"))
    return 1024 * int(known[1]) if known else 0


def apart_from(name: str, folder: Path, samples: int) -> dict[str, Any]:
    """What `measured` gives, in a process of its own. Ends the program where it fails."""
    words = [sys.executable, "-m", "evidence.fit.speed", "--one", name, str(folder), str(samples)]
    result = subprocess.run(words, stdout=subprocess.PIPE, text=True, env=os.environ | ONE_THREAD, cwd=ROOT)
    if result.returncode != 0:
        sys.exit(f"{name} failed")
    return dict(json.loads(result.stdout))


def line_of(name: str, folder: Path, scale: float) -> dict[str, Any]:
    """One line of the table, as JSON: seconds as measured and as scaled to all samples, memory."""
    way = WAYS[name]
    figures = apart_from(name, folder, max(100, min(way.samples, round(FULL * scale))))
    line: dict[str, Any] = {"way": name, "what": way.what}
    kept = ("samples", "seconds", "cpu_seconds", "peak_memory", "iterations", "passes", "converged", "cost")
    line |= {key: figures[key] for key in kept if key in figures}
    line |= {f"{key}_scaled": figures[key] * FULL / figures["samples"] for key in ("seconds", "cpu_seconds")}
    return line


# --- the table --------------------------------------------------------------------------------------------------------


def table_of(lines: list[dict[str, Any]]) -> str:
    head = ["way", "samples", "iterations", "CPU s", "400 s: CPU s", "400 s: wall s", "peak memory"]
    rows = []
    for line in lines:
        scaled = [f"{line[key]:,.4g}" for key in ("cpu_seconds_scaled", "seconds_scaled")]
        memory = f"{line['peak_memory'] / 1e6:,.0f} MB"
        counts = [f"{line['samples']:,}", line.get("iterations", ""), f"{line['cpu_seconds']:.3g}"]
        rows.append([line["what"], *counts, *scaled, memory])
    return tables.table(head, rows)


def main() -> None:
    options = parser(__doc__, output=None)
    options.add_argument("--ways", nargs="+", choices=WAYS, default=list(WAYS))
    options.add_argument("--scale", type=float, default=1.0, help="of all samples; less than 1 for a short trial")
    options.add_argument("--output", type=Path, help="JSON of all figures")
    options.add_argument(
        "--one", nargs=3, metavar=("WAY", "FOLDER", "SAMPLES"), help="a way, here: used by the program"
    )
    given = options.parse_args()
    if given.one:
        print(json.dumps(plain(measured(given.one[0], Path(given.one[1]), int(given.one[2])))))
        return
    lines: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory() as name:
        make_data(Path(name), max(20.0, given.scale * FULL / RATE) + 3.0)
        for way in given.ways:
            lines.append(line_of(way, Path(name), given.scale))
    print(table_of(lines))
    machine = f"{platform.machine()}, {os.cpu_count()} processors, load {os.getloadavg()[0]:.1f}"
    print(f"\n{machine}.")
    if given.output is not None:
        write(given.output, {"machine": machine, "ways": lines})


if __name__ == "__main__":
    main()
