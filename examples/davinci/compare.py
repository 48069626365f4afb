"""Runs jaw.json as an FMU over the da Vinci recordings: rms errors as a table, curves and errors as a figure.

python examples/davinci/compare.py [-o docs/figures/davinci.png]
"""

from __future__ import annotations

import argparse
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaw_recordings import FAST, SLOW, Array, data_folder, read_run, rms
from reference_figure import ReferenceCurves, ReferenceFigure, draw_reference

from tendonfmu.fmu.fmpy_client import run_fmu
from tendonfmu.fmu.packaging import build_fmu

JAW = Path(__file__).with_name("jaw.json")
LIMIT = 0.025  # N·m
DRAWN = {"00": "lightest load", "04": "middle load", "09": "heaviest load"}
SETTLED = 2.5  # s; the data's own notes leave out what comes before


@dataclass(frozen=True)
class Comparison:
    """One run: time [N] s, torques [N] N·m; `measured` is the spindle's."""

    time: Array
    measured: Array
    compensated: Array
    external: Array

    def error(self, since: float = 0.0) -> float:
        """rms of compensated minus external torque, N·m."""
        return rms((self.compensated - self.external)[self.time >= since])

    def error_without(self, since: float = 0.0) -> float:
        """The same with the spindle's torque as it is: no friction model."""
        return rms((self.measured - self.external)[self.time >= since])

    def curves(self, title: str) -> ReferenceCurves:
        return ReferenceCurves(title, self.time, self.measured, self.compensated, self.external)


def compare(fmu: Path, folder: Path, name: str) -> Comparison:
    """Runs the FMU over one of the recordings."""
    run = read_run(folder, name)
    table = run_fmu(fmu, run)
    external = run.groups["external_torque"][:, 0]
    return Comparison(run.time, table["joint_torque[1]"], table["compensated_torque[1]"], external)


def print_table(runs: dict[str, Comparison]) -> None:
    print("| run | mean load | no model | compensated | no model, from 2.5 s | compensated, from 2.5 s |")
    print("| --- | ---: | ---: | ---: | ---: | ---: |")
    for name, run in runs.items():
        figures = (run.error_without(), run.error(), run.error_without(SETTLED), run.error(SETTLED))
        print(f"| {name} | {1e3 * run.external.mean():.0f} |" + "".join(f" {1e3 * value:.1f} |" for value in figures))


def figure_of(runs: dict[str, Comparison]) -> ReferenceFigure:
    return ReferenceFigure(
        title="da Vinci instrument, one jaw: compensated torque and the sensor at the jaw",
        drawn=[runs[name].curves(f"run {name}, {load}") for name, load in DRAWN.items()],
        names=list(SLOW),
        error=np.array([runs[name].error() for name in SLOW]),
        error_without=np.array([runs[name].error_without() for name in SLOW]),
        limit=LIMIT,
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-o", "--output", type=Path, help="figure to write, .png")
    options = parser.parse_args()
    folder = data_folder()
    with tempfile.TemporaryDirectory() as scratch:
        fmu = Path(scratch) / "jaw.fmu"
        build_fmu(JAW, fmu)
        runs = {name: compare(fmu, folder, name) for name in (*SLOW, *FAST)}
    print_table(runs)
    if options.output:
        draw_reference(figure_of(runs), options.output)


if __name__ == "__main__":
    main()
