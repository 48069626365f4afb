"""Which figures of a tuning are written as files."""

from __future__ import annotations

from pathlib import Path

from tendonfmu.detect import ContactTuning
from tendonfmu.errors import InputError
from tendonfmu.report.tune_figures import bound_figure, tail_figure, worst_figure
from tendonfmu.report.tune_plots import draw_bounds, draw_tail, draw_worst


def write_figures(tuning: ContactTuning, folder: Path) -> dict[Path, str]:
    """Draw the figures of a tuning as PNG files."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: cannot be made ({error.strerror})") from None
    draw_tail(tail_figure(tuning), folder / "tail.png")
    draw_bounds(bound_figure(tuning), folder / "bounds.png")
    draw_worst(worst_figure(tuning), folder / "worst.png")
    return {
        folder / "tail.png": "false alarms over the level of the bounds",
        folder / "bounds.png": "bounds over the mean force",
        folder / "worst.png": "the moments of free motion nearest to an alarm",
    }
