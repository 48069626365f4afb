"""Speed and memory of the fit, beside other ways to do the same, in one run:

    pip install --require-hashes -r requirements-fit-peers.lock    # filterpy; left out where it is not there
    python -m evidence.fit.compare --output fit.json

The index finger (472 numbers) over 400 s of an `excite` motion at 1 kHz; forces made by the model itself, with other
numbers than the fit starts from, white noise and a wandering bias. Each way runs in a process of its own, one after the
other, whose peak memory is the kernel's (ru_maxrss). The product uses all cores, the peers one. They take as many
samples as they can finish, and their times are scaled by the samples; the iterations of least squares are its own, on
the samples that it took. Before any time is worth anything they must agree with the product on those samples.
ways.py has data and ways, peers.py the peers.
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

# numpy stays outside: a process starts with the peak memory of the one that it comes from.
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
ONE_THREAD = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
ROOT = Path(__file__).resolve().parents[2]
GOALS = {"batch": 20.0, "ekf": 60.0}  # s
MOST_MEMORY = 1e9  # bytes, of the product's ways


def run(way: str, folder: Path, **options: float) -> dict[str, Any]:
    """What ways.py prints. Ends the program where it fails."""
    command = [sys.executable, "-m", "evidence.fit.ways", way, "--folder", str(folder)]
    for name, value in options.items():
        command += [f"--{name}", str(value)]
    result = subprocess.run(command, stdout=subprocess.PIPE, text=True, env=os.environ | ONE_THREAD, cwd=ROOT)
    if result.returncode != 0:
        sys.exit(f"{way} failed")
    return dict(json.loads(result.stdout))


def apart(estimate: dict[str, Any], expected: dict[str, Any]) -> float:
    """Largest difference of two estimates in standard errors."""
    pairs = zip(estimate["z"], expected["z"], expected["std"], strict=True)
    return max(abs(own - other) / std for own, other, std in pairs)


def measure(way: str, folder: Path, scale: float) -> dict[str, Any]:
    """One line of the table, as JSON: seconds as measured and as scaled to all samples, memory, agreement."""
    what, samples, judge = WAYS[way]
    figures = run(way, folder, samples=max(100, min(samples, round(FULL * scale))))
    line = {"way": way, "what": what}
    if "missing" in figures:
        return line | {"missing": figures["missing"]}
    line |= {name: figures[name] for name in ("samples", "seconds", "cpu_seconds", "peak_memory")}
    line |= {name: figures[name] for name in ("iterations", "passes", "converged", "cost") if name in figures}
    line |= {f"{name}_scaled": figures[name] * FULL / figures["samples"] for name in ("seconds", "cpu_seconds")}
    if judge is not None:
        line["apart"] = apart(figures, run(judge, folder, samples=figures["samples"]))
        if not line["apart"] < AGREEMENT:
            sys.exit(f"{way} and {judge} are {line['apart']:.3g} standard errors apart: no times are worth showing")
    return line


def table_of(lines: list[dict[str, Any]]) -> str:
    cells = ["| way | samples | iterations | CPU s | 400 s: CPU s | 400 s: wall s | peak memory | apart |"]
    cells.append("| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: |")
    for line in lines:
        if "missing" in line:
            cells.append(f"| {line['what']} | not run: {line['missing']} | | | | | | |")
            continue
        values = [
            line["what"],
            f"{line['samples']:,}",
            str(line.get("iterations", "")),
            f"{line['cpu_seconds']:.3g}",
            f"{line['cpu_seconds_scaled']:,.4g}",
            f"{line['seconds_scaled']:,.4g}",
            f"{line['peak_memory'] / 1e6:,.0f} MB",
            f"{line['apart']:.0e}" if "apart" in line else "",
        ]
        cells.append(f"| {' | '.join(values)} |")
    return "\n".join(cells)


def misses(lines: list[dict[str, Any]]) -> list[str]:
    """Goals that were not reached, in words."""
    missed = []
    for line in lines:
        goal = GOALS.get(line["way"])
        if goal is None:
            continue
        if not line["seconds_scaled"] <= goal:
            missed.append(f"{line['what']}: {line['seconds_scaled']:.1f} s, goal {goal:g} s")
        if not line["peak_memory"] <= MOST_MEMORY:
            missed.append(f"{line['what']}: {line['peak_memory'] / 1e9:.2f} GB, goal {MOST_MEMORY / 1e9:g} GB")
        if not line.get("converged", True):
            missed.append(f"{line['what']}: not converged")
    return missed


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--ways", nargs="+", choices=WAYS, default=list(WAYS))
    options.add_argument("--scale", type=float, default=1.0, help="of all samples; less than 1 for a short trial")
    options.add_argument("--output", type=Path, help="JSON of all figures")
    given = options.parse_args()
    lines: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory() as name:
        duration = max(20.0, given.scale * FULL / 1000.0) + 3.0
        run("data", Path(name), duration=duration)
        for way in given.ways:
            lines.append(measure(way, Path(name), given.scale))
            print(f"{lines[-1]['what']}: {lines[-1].get('seconds', 0.0):.3g} s", file=sys.stderr)
    print(table_of(lines))
    machine = f"{platform.machine()}, {os.cpu_count()} processors, load {os.getloadavg()[0]:.1f}"
    print(f"\n{machine}. Apart: from the product on the same samples, largest difference in standard errors.")
    for miss in misses(lines):
        print(f"MISSED {miss}")
    if given.output is not None:
        text = json.dumps({"machine": machine, "ways": lines}, indent=1, ensure_ascii=False)
        given.output.write_text(text + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
