"""How fast is a step: of the C interface, of the FMU, and of the simulated finger?

bench_step.cpp and bench_fmu.cpp are built by CMake with TENDONFMU_BUILD_BENCH.
"""

from __future__ import annotations

import json
import statistics
import subprocess
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from evidence import table
from evidence.cases import INDEX_RIG, ROOT, say
from evidence.part import Figures, Part
from tendonfmu.arrays import Numbers
from tendonfmu.model import native

Description = dict[str, Any]

# --- steps, called from C ---------------------------------------------------------------------------------------------

SAMPLES = 5000  # at 1 kHz
REPETITIONS = 5


def law(scale: float, velocity: float, place: int) -> Description:
    """Friction whose numbers differ from those of every other place."""
    coulomb = scale * (1 + 0.01 * (place % 17))
    widened = velocity * (1 + 0.02 * (place % 11))
    return {"static": 1.4 * coulomb, "coulomb": coulomb, "stribeck_velocity": widened, "viscous": 0.1 * scale}


def finger(joints: int, tendons: int, points: int) -> Description:
    """Friction at every place, every law different, `points` working points at every edge; the paper's rule."""

    def edge(i: int, j: int) -> Description:
        angles = [-1.0 + 0.5 * k + 0.013 * i for k in range(points)]
        return {"angles": angles, "laws": [law(0.02, 0.005, 7 * i + 3 * j + k) for k in range(points)]}

    def arm(i: int, j: int) -> float:
        return (1 - 2 * (i % 2)) * (0.009 - 0.0005 * j + 0.0001 * i) if j <= i // 2 else 0.0

    return {
        "format": "tendonfmu-finger-1",
        "name": "bench",
        "joints": [
            {"cover": {"stiffness": 0.02}, "friction": law(0.005, 0.1, j), "load_friction": law(1e-4, 0.1, j + 3)}
            for j in range(joints)
        ],
        "tendons": [
            {
                "stiffness": 4000.0 + 100.0 * i,
                "moment_arms": [arm(i, j) for j in range(joints)],
                "pulley_friction": [law(0.01, 0.004, i + 5 * j) for j in range(joints - 1)],
                "edge_friction": [edge(i, j) for j in range(joints)],
            }
            for i in range(tendons)
        ],
        "contact": {"threshold": [5.0] * joints},
    }


def calibrated(plain: Description) -> Description:
    """With all that `tendonfmu calibrate` writes, presliding apart."""
    joints = len(plain["joints"])
    numbers = ("friction", "friction_limit", "motor_load", "friction_change", "friction_reserve")
    band = {"noise": [5.0] * joints, **{name: [0.1] * joints for name in numbers}}
    contact = {
        "threshold": [5.0] * joints,
        "method": "bands",
        "bands": [band] * 4,
        "deviation": [0.002] * joints,
    }
    return {**plain, "contact": contact, "bias": {"noise_time": 0.001}, "sensor_fault": {}}


def motion(description: Description, shaking: bool = False) -> Numbers:
    """[N, 1 + 2m] time, forces, positions. All joints move at once, or sides and rests change all the time."""
    joints, tendons = len(description["joints"]), len(description["tendons"])
    time, j = 1e-3 * np.arange(SAMPLES)[:, None], np.arange(joints)
    angles = 0.8 * np.sin(time * (0.7 + 0.3 * j) + j) + 0.1 * np.sin(3.1 * time)
    if shaking:
        k = np.arange(SAMPLES)[:, None]
        angles = np.where(k % 4 < 2, 0.01, -0.01) * np.where(k % 2 == 0, 1.0, 1.2) * (1 + j)
    i = np.arange(tendons)
    force = 20.0 + i + 3.0 * np.sin(time + i)
    arms = np.array([tendon["moment_arms"] for tendon in description["tendons"]])
    return np.hstack([time, force, angles @ arms.T + force / (4000.0 + 100.0 * i)])


def write_cases(folder: Path) -> list[Path]:
    """Model images and their samples, as bench_case.h reads them."""
    middle = finger(4, 8, 5)
    presliding = {"extensions": [{"effect": "presliding", "displacement": 0.05}]}
    cases: dict[str, tuple[Description, bool]] = {
        "4x8x5": (middle, False),
        "shaking": (middle, True),
        "calibrated": (calibrated(middle), False),
        "presliding": (calibrated(middle) | presliding, False),
        "memory": (middle | presliding, False),
        "1x2x1": (finger(1, 2, 1), False),
        "16x64x5": (finger(16, 64, 5), False),
    }
    for name, (description, shaking) in cases.items():
        (folder / f"{name}.image").write_bytes(native.image_from_json(json.dumps(description)))
        motion(description, shaking).tofile(folder / f"{name}.samples")
    return [folder / f"{name}.image" for name in cases]


def bench(folder: Path, target: str, files: list[Path], only: str = "-million") -> list[dict[str, Any]]:
    """Medians of the benchmarks of a program of this folder whose names have, or with "-" have not, a word."""
    build = folder / "build"
    settings = ["-DTENDONFMU_BUILD_BENCH=ON", f"-DTENDONFMU_BUILD_FMU={'ON' if target == 'bench_fmu' else 'OFF'}"]
    for command in (
        ["cmake", "-S", str(ROOT), "-B", str(build), "-DCMAKE_BUILD_TYPE=Release", *settings],
        ["cmake", "--build", str(build), "--target", target],
    ):
        say(" ".join(command))
        subprocess.run(command, check=True, capture_output=True)
    options = [f"--benchmark_repetitions={REPETITIONS}", "--benchmark_enable_random_interleaving=true"]
    options.append(f"--benchmark_filter={only}")
    program = build / "evidence" / "speed" / target
    done = subprocess.run(
        [str(program), *options, "--benchmark_format=json", *map(str, files)],
        check=True,
        capture_output=True,
        text=True,
    )
    rows = json.loads(done.stdout)["benchmarks"]
    return [row for row in rows if row.get("aggregate_name") == "median"]


def steps(folder: Path, _workers: int) -> Figures:
    rows = bench(folder, "bench_step", write_cases(folder))
    return {row["run_name"]: 1e9 * row["per_step"] for row in rows}


def fmu_steps(folder: Path, _workers: int) -> Figures:
    rows = bench(folder, "bench_fmu", write_cases(folder)[:1])
    return {row["run_name"]: 1e9 * row["per_step"] for row in rows}


def worst(folder: Path, _workers: int) -> Figures:
    """By case: ns of `SLOW`."""
    rows = bench(folder, "bench_step", [file for file in write_cases(folder) if file.stem in SLOW_CASES], "million")
    return {row["run_name"].split("/")[1]: [1e9 * row[name] for name in SLOW] for row in rows}


SLOW_CASES = {"shaking": "joints shaking", "presliding": "all that `calibrate` writes"}
SLOW = {
    "median": "median",
    "slowest_sample": "slowest sample, in its fastest round",
    "one_in_10000": "one in 10,000 is slower",
    "worst": "slowest",
}
STEPS = {
    "avx2/4x8x5": "AVX2, picked at run time",
    "sse2/4x8x5": "SSE2, baseline x86-64",
    "plain/4x8x5": "plain C, any machine",
    "avx2/shaking": "AVX2, joints shaking so that sides, rests and working points change all the time",
    "avx2/memory": "AVX2, presliding at all places",
    "avx2/calibrated": "AVX2, all that `calibrate` writes, presliding apart",
    "avx2/presliding": "AVX2, all that `calibrate` writes",
    "avx2/1x2x1": "AVX2, 1 joint × 2 tendons × 1 point",
    "avx2/16x64x5": "AVX2, 16 joints × 64 tendons × 5 points",
}
WAYS = {"fmi2": "FMI 2.0, value by value"}


def time_table(names: Mapping[str, str], head: str) -> Callable[[Figures], str]:
    return lambda figures: table.table(
        [head, "time, ns"], [[words, f"{figures[name]:,.0f}"] for name, words in names.items() if name in figures]
    )


def slow_table(figures: Figures) -> str:
    rows = [[words, *(f"{figures[case][k]:,.0f}" for case in SLOW_CASES)] for k, words in enumerate(SLOW.values())]
    return table.table(["of a million steps, AVX2; ns", *SLOW_CASES.values()], rows)


# --- the simulated finger ---------------------------------------------------------------------------------------------

START, SPAN = 1.5, 20.0  # s: where it begins, in motion; simulated
ROUNDS = 3
TOLERANCES = (1e-4, 1e-5, 1e-6, 1e-7)


def plant(_folder: Path, _workers: int) -> Figures:
    """Simulated seconds per CPU second at each tolerance, and the largest errors against 1e-9."""
    from tendonfmu.simulate import read_rig
    from tendonfmu.simulate.plant import Plant

    text = read_rig(INDEX_RIG).json()
    moments = np.arange(START, START + SPAN, 0.01)[1:]

    def measured(tolerance: float) -> tuple[float, dict[str, Numbers]]:
        simulated = Plant(text)
        simulated.configure(sensors=False, relative_tolerance=tolerance)
        simulated.initialise()
        simulated.advance(START)
        before = time.process_time()
        signals = simulated.run(moments)
        return time.process_time() - before, signals

    _, exact = measured(1e-9)
    figures = {}
    for tolerance in TOLERANCES:
        runs = [measured(tolerance) for _ in range(ROUNDS)]
        errors = [np.abs(runs[0][1][key] - exact[key]).max() for key in ("joint_position", "tendon_force")]
        figures[f"CVODE, {tolerance:.0e}"] = [SPAN / statistics.median(used for used, _ in runs), *map(float, errors)]
    return figures


def plant_table(figures: Figures) -> str:
    lines = [
        [name, f"{speed:.3g}", *(f"{error:.1e}" for error in errors)] for name, (speed, *errors) in figures.items()
    ]
    head = ["solver", "simulated s per CPU s", "largest error: angle, rad", "tendon force, N"]
    return table.table(head, lines)


PARTS = {
    "steps": Part(
        steps,
        headlines={"avx2/4x8x5": (0.0, 1500.0), "avx2/presliding": (0.0, 4000.0)},
        tables={"steps": time_table(STEPS, "what")},
    ),
    "worst": Part(
        worst,
        headlines={"shaking.1": (0.0, 9000.0)},
        tables={"million": slow_table},
    ),
    "fmu_steps": Part(
        fmu_steps,
        headlines={"fmi2": (0.0, 2000.0)},
        tables={"steps": time_table(WAYS, "a step by the")},
    ),
    "plant": Part(
        plant,
        minutes=0.5,
        headlines={"CVODE, 1e-06.0": (30.0, 300.0)},
        tables={"solvers": plant_table},
    ),
}
