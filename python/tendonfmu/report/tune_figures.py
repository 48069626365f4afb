"""What the figures of a tuning show, ready to be drawn: false alarms over the level of the bounds."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tendonfmu.arrays import Numbers
from tendonfmu.detect import ContactTuning, tune_report
from tendonfmu.drawing import BLUE, DARK, VERMILION, Sheet, band, curve, dots, mark, panel
from tendonfmu.report.page import write_figures

PAGE = "tuning.html"


def write_tune_figures(tuning: ContactTuning, folder: Path) -> dict[Path, str]:
    """Write the page with the figure of a tuning."""
    page = folder / PAGE
    write_figures(page, "tuning of contact detection", tuning.description_.name, [tail_sheet(tuning)])
    return {page: "false alarms in motion that was kept out, over the level of the bounds"}


def tail_sheet(tuning: ContactTuning) -> Sheet:
    """Show false alarms per hour over the factor on the bounds, in motion that was kept out."""
    report = tune_report.build_report(tuning)
    tail = sorted(report["tail"], key=lambda point: float(point["factor"]))

    def column(name: str) -> Numbers:
        return np.array([point[name] for point in tail], dtype=float)

    factors, intervals = column("factor"), column("interval")
    found, asked = report["kept_out"]["per_hour"], report["false_alarms_per_hour"]
    limits = float(min(factors[0], 0.9)), float(max(factors[-1], 1.1))
    shown = panel(
        "False alarms",
        "False alarms per hour over a factor on the chosen bounds, in motion that was kept out",
        "factor on the chosen bounds",
        "false alarms per hour",
        band(factors, intervals[:, 0], intervals[:, 1], "95 % interval"),
        curve(factors, column("per_hour"), "kept out", BLUE, 1.8),
        curve(np.array(limits), np.full(2, asked), f"asked for: {asked:.3g} per hour", VERMILION, 1.3, "dash"),
        dots(np.ones(1), np.array([found]), f"found: {found:.3g} per hour", DARK),
        mark(1.0),
        size="wide",
        height=480,
        log_x=True,
        near_y=60.0 / report["minutes"],
        x_limits=limits,
        y_limits=(0.0, 1.1 * float(max(intervals.max(), found))),
    )
    title = f"{report['finger']}: {report['minutes']:.0f} min of free motion, {report['method']}"
    return Sheet("tune", "tail", title, [shown])
