"""Speed and memory of the fit, beside other ways to do the same, in one run:

    .venv/bin/pip install --require-hashes -r requirements-fit-peers.lock    # filterpy; left out where it is not there
    .venv/bin/python bench/compare_fit.py --output fit.json

The index finger (472 numbers) over 400 s of an `excite` motion at 1 kHz; forces made by the model itself, with other
numbers than the fit starts from, white noise and a wandering bias. Each way runs in a process of its own, one after the
other, whose peak memory is the kernel's (ru_maxrss). The product uses all cores, the peers one. They take as many
samples as they can finish, and their times are scaled by the samples; the iterations of least squares are its own, on
the samples that it took. Before any time is worth anything they must agree with the product on those samples.
fit_ways.py has data and ways, fit_peers.py the peers.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

# numpy stays outside: a process starts with the peak memory of the one that it comes from.
WAYS_FILE = Path(__file__).resolve().parent / "fit_ways.py"
FULL = 400_000  # samples
AGREEMENT = 0.05  # standard errors between two ways on the same samples

# way: what it is, samples that it takes, and the way of the product that it must agree with
WAYS: dict[str, tuple[str, int, str | None]] = {
    "command": ("tendonfmu fit, file to report", FULL, None),
    "batch": ("batch, to convergence", FULL, None),
    "ekf": ("EKF, both passes", FULL, None),
    "product": ("numpy JᵀJ of one pass, J given", 20_000, None),
    "least_squares": ("scipy least_squares, compiled Jacobian, dense", 8_000, "batch_to_the_end"),
    "symmetric": ("numpy EKF, P − W Wᵀ", 2_000, "ekf_sample_by_sample"),
    "joseph": ("numpy EKF, Joseph form", 300, "ekf_sample_by_sample"),
    "filterpy": ("filterpy ExtendedKalmanFilter", 150, "ekf_sample_by_sample"),
}
# Of the peers' linear algebra: how their threads share a busy machine would be measured instead.
TESTS = str(Path(__file__).resolve().parent.parent / "python_tests" / "support")
ONE_THREAD = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "PYTHONPATH": TESTS}
GOALS = {"batch": 20.0, "ekf": 60.0}  # s
MOST_MEMORY = 1e9  # bytes, of the product's ways


def run(way: str, folder: Path, **options: float) -> dict[str, Any]:
    """What fit_ways.py prints. Ends the program where it fails."""
    command = [sys.executable, str(WAYS_FILE), way, "--folder", str(folder)]
    for name, value in options.items():
        command += [f"--{name}", str(value)]
    result = subprocess.run(command, stdout=subprocess.PIPE, text=True, env=os.environ | ONE_THREAD, check=False)
    if result.returncode != 0:
        sys.exit(f"{way} failed")
    found: dict[str, Any] = json.loads(result.stdout)
    return found


def apart(found: dict[str, Any], expected: dict[str, Any]) -> float:
    """Largest difference of two estimates in standard errors."""
    pairs = zip(found["z"], expected["z"], expected["std"], strict=True)
    return max(abs(own - other) / std for own, other, std in pairs)


def measure(way: str, folder: Path, scale: float) -> dict[str, Any]:
    """One line of the table, as JSON: seconds as measured and as scaled to all samples, memory, agreement."""
    what, samples, judge = WAYS[way]
    found = run(way, folder, samples=max(100, min(samples, round(FULL * scale))))
    line = {"way": way, "what": what}
    if "missing" in found:
        return line | {"missing": found["missing"]}
    line |= {name: found[name] for name in ("samples", "seconds", "cpu_seconds", "peak_memory")}
    line |= {name: found[name] for name in ("iterations", "passes", "converged", "cost") if name in found}
    line |= {f"{name}_scaled": found[name] * FULL / found["samples"] for name in ("seconds", "cpu_seconds")}
    if judge is not None:
        line["apart"] = apart(found, run(judge, folder, samples=found["samples"]))
        if not line["apart"] < AGREEMENT:
            sys.exit(f"{way} and {judge} are {line['apart']:.3g} standard errors apart: no times are worth showing")
    return line


def table_of(lines: list[dict[str, Any]]) -> Table:
    table = Table(title="472 numbers (468 and a bias for each joint), 400 s at 1 kHz")
    for heading in ("way", "samples", "iterations", "CPU s", "400 s: CPU s", "400 s: wall s", "peak memory", "apart"):
        table.add_column(heading, justify="left" if heading == "way" else "right")
    for line in lines:
        if "missing" in line:
            table.add_row(line["what"], "not run:", line["missing"], *[""] * 5)
            continue
        table.add_row(
            line["what"],
            f"{line['samples']:,}",
            str(line.get("iterations", "")),
            f"{line['cpu_seconds']:.3g}",
            f"{line['cpu_seconds_scaled']:,.4g}",
            f"{line['seconds_scaled']:,.4g}",
            f"{line['peak_memory'] / 1e6:,.0f} MB",
            f"{line['apart']:.0e}" if "apart" in line else "",
        )
    return table


def misses(lines: list[dict[str, Any]]) -> list[str]:
    """Goals that were not reached, in words."""
    found = []
    for line in lines:
        goal = GOALS.get(line["way"])
        if goal is None:
            continue
        if not line["seconds_scaled"] <= goal:
            found.append(f"{line['what']}: {line['seconds_scaled']:.1f} s, goal {goal:g} s")
        if not line["peak_memory"] <= MOST_MEMORY:
            found.append(f"{line['what']}: {line['peak_memory'] / 1e9:.2f} GB, goal {MOST_MEMORY / 1e9:g} GB")
        if not line.get("converged", True):
            found.append(f"{line['what']}: not converged")
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--ways", nargs="+", choices=WAYS, default=list(WAYS))
    parser.add_argument("--scale", type=float, default=1.0, help="of all samples; less than 1 for a short trial")
    parser.add_argument("--output", type=Path, help="JSON of all figures")
    asked = parser.parse_args()
    lines: list[dict[str, Any]] = []
    console = Console(width=140)
    with tempfile.TemporaryDirectory() as name:
        duration = max(20.0, asked.scale * FULL / 1000.0) + 3.0
        run("data", Path(name), duration=duration)
        for way in asked.ways:
            lines.append(measure(way, Path(name), asked.scale))
            console.print(f"{lines[-1]['what']}: {lines[-1].get('seconds', 0.0):.3g} s", style="dim")
    console.print(table_of(lines))
    load = os.getloadavg()
    machine = f"{platform.machine()}, {os.cpu_count()} processors, load {load[0]:.1f}"
    console.print(f"{machine}. Apart: from the product on the same samples, largest difference in standard errors.")
    for miss in misses(lines):
        console.print(f"MISSED {miss}")
    if asked.output is not None:
        text = json.dumps({"machine": machine, "ways": lines}, indent=1, ensure_ascii=False)
        asked.output.write_text(text + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
