"""What the figures of a tuning show, ready to be drawn: alarms over level, bounds over force, and the worst moments."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tendonfmu.arrays import Numbers
from tendonfmu.detect import ContactTuning, FreeRun, rate_limit, tail_levels
from tendonfmu.drawing import Band, Curve, Dots, Panel, Sheet
from tendonfmu.report.numbers import with_ends
from tendonfmu.report.page import write_figures
from tendonfmu.statistics import intervals

PAGE = "tuning.html"
JOINTS = 4  # drawn at most
WORST = 4  # moments
AROUND = 0.6  # s before and after a moment
APART = 2.0  # s; moments nearer than this have one cause
_FACTORS = np.geomspace(0.4, 2.5, 60)
_TICKS = (0.4, 0.5, 0.6, 0.8, 1.0, 1.25, 1.6, 2.0, 2.5)
_OTHERS = {"residual": ("share", "threshold of the residual"), "drift": ("slow_limits", "threshold of slow loads")}


def write_tune_figures(tuning: ContactTuning, folder: Path) -> dict[Path, str]:
    """Write the page with the figures of a tuning."""
    page = folder / PAGE
    sheets = [tail_sheet(tuning), bound_sheet(tuning), worst_sheet(tuning)]
    write_figures(page, "tuning of contact detection", tuning.description_.name, sheets)
    return {page: "false alarms over the level of the bounds, bounds over the force, moments nearest to an alarm"}


def tail_sheet(tuning: ContactTuning) -> Sheet:
    """Show false alarms per hour over the factor on the bounds, in sample and held out."""
    tail = tuning.tail(_FACTORS)
    held_out, low, high = with_ends(intervals.rate(held, tuning.hours_) for _, _, held in tail)
    in_sample = np.array([count / tuning.hours_ for _, count, _ in tail])
    limit = rate_limit(tuning.held_out_[0], tuning.hours_, tuning.confidence)
    ends = np.array([_FACTORS[0], _FACTORS[-1]])
    x = np.repeat(_FACTORS, 2)[1:]

    def stairs(values: Numbers) -> Numbers:
        return np.repeat(values, 2)[:-1]

    panel = Panel(
        title="False alarms",
        alt="False alarms per hour over a factor on the chosen thresholds, in sample and held out",
        x_label="factor on the chosen thresholds",
        y_label="false alarms per hour",
        size="wide",
        height=480,
        bands=(Band("confidence", x, stairs(low), stairs(high)),),
        curves=(
            Curve("fitted", x, stairs(held_out)),
            Curve("slow", x, stairs(in_sample)),
            Curve("ninety", ends, np.full(2, tuning.rate_)),
        ),
        dots=(Dots("dark_dots", np.ones(1), np.array([limit])),),
        ticks=tuple((factor, f"{factor:g}") for factor in _TICKS),
        log_x=True,
        near_y=1.0 / tuning.hours_,
        line=1.0,
        x_limits=(float(_FACTORS[0]), float(_FACTORS[-1])),
        y_limits=(0.0, 1.3 * float(max(high.max(), in_sample.max(), limit))),
    )
    keys = (
        ("fitted", "held out: bounds of other blocks"),
        ("confidence", "95 % interval"),
        ("slow", "in sample: of the same blocks"),
        ("ninety", f"tuned for {tuning.rate_:.3g} per hour"),
        ("dark_dots", f"chosen level: at most {limit:.3g} per hour ({100 * tuning.confidence:g} %)"),
    )
    title = f"{tuning.description_.name}: {60 * tuning.hours_:.0f} min of free motion, {tuning.method}"
    return Sheet("tune", "tail", title, keys, [panel])


def _main(tuning: ContactTuning) -> str:
    return "innovation" if "innovation" in tuning.lines_ else "residual"


def bound_sheet(tuning: ContactTuning) -> Sheet:
    """Show the bounds over the mean force by joint."""
    name = _main(tuning)
    search, bound, cells = tuning.searches_[name], tuning.bounds_[name], tuning.cells_
    over = search.excess(bound.stuck_share, bound.jump_share)
    at, levels = tail_levels(cells, over, np.ones(len(cells.order), dtype=bool), tuning.rate_)
    added = bound.stuck_share * search.mean_stuck + bound.jump_share * search.mean_jump
    friction = np.array([added[cells.group == g].mean(axis=0) for g in range(cells.groups)])
    force = np.linspace(0.0, 1.1 * float(at.max()), 60)
    own = bound.own(force)
    others = {_OTHERS[other]: found.own(force) for other, found in tuning.bounds_.items() if other != name}
    rms = np.array([pretension.rms for pretension in tuning.pretensions_])
    panels = []
    for j in np.sort(np.argsort(-own.mean(axis=0), kind="stable")[:JOINTS]):
        with_friction = bound.base[j] + bound.per_force[j] * at + friction[:, j]
        curves = [Curve("fitted", force, 1e3 * own[:, j])]
        curves += [Curve(style, force, 1e3 * values[:, j]) for (style, _), values in others.items()]
        dots = {"start_dots": with_friction, "own_dots": levels[:, j], "dark_dots": rms[:, j]}
        highest = max(float(np.nanmax(values)) for values in (*(curve.y for curve in curves), 1e3 * with_friction))
        panels.append(
            Panel(
                title=tuning.description_.joint_names[j],
                alt=f"Bounds of {tuning.description_.joint_names[j]} over the mean tendon force",
                x_label="mean tendon force (N)",
                y_label="torque (mN·m)",
                size="medium",
                height=330,
                curves=tuple(curves),
                dots=tuple(Dots(style, at, 1e3 * values) for style, values in dots.items()),
                x_limits=(0.0, float(force[-1])),
                y_limits=(0.0, 1.08 * max(highest, 1e3 * float(np.nanmax(levels[:, j])))),
            )
        )
    keys = (
        ("fitted", f"threshold of the {name}"),
        ("start_dots", "with H and J, on average"),
        ("own_dots", "the joint alone, at the wished rate"),
        ("dark_dots", "rms of the residual"),
        *others,
    )
    return Sheet("tune", "bounds", f"{tuning.description_.name}: bounds, {tuning.method}", keys, panels)


def worst_sheet(tuning: ContactTuning) -> Sheet:
    """Show signal and bound around the highest ratios of a cell to its bound, one of those near each other."""
    name = _main(tuning)
    line, cells = tuning.lines_[name], tuning.cells_
    panels: list[Panel] = []
    taken: list[tuple[int, float]] = []
    for k in np.argsort(-line.statistic, kind="stable"):
        part, time = int(cells.part[k]), float(cells.time[k])
        if any(part == other and abs(time - then) < APART for other, then in taken):
            continue
        taken.append((part, time))
        panels.append(_moment(tuning, name, tuning.runs_[part], time))
        if len(panels) == WORST:
            break
    keys = (("negative", name), ("threshold", "threshold alone"), ("bound", "bound with H and J"))
    return Sheet("tune", "worst", f"{tuning.description_.name}: nearest to an alarm", keys, panels)


def _moment(tuning: ContactTuning, name: str, run: FreeRun, at: float) -> Panel:
    time = run.part.time - run.part.time[0]
    rows = np.flatnonzero(np.abs(time - at) <= AROUND)
    bound = tuning.bounds_[name]
    signal = np.asarray(getattr(run, name)[rows], dtype=float)
    own = bound.own(run.part.mean_force[rows])
    whole = own + bound.stuck_share * run.stuck[rows] + bound.jump_share * run.jump[rows]
    near = np.abs(time[rows] - at) <= 0.05
    j = int(np.argmax(np.max((np.abs(signal) - (whole - own))[near] / own[near], axis=0)))
    joint, source = tuning.description_.joint_names[j], Path(run.part.source).name
    x, force = time[rows] - at, float(run.part.mean_force[rows].mean())
    return Panel(
        title=joint,
        note=f"{source}, {run.part.time[0] + at:.1f} s, {force:.3g} N",
        alt=f"{name} of {joint} and its bounds around {run.part.time[0] + at:.1f} s of {source}",
        x_label="time from the peak (s)",
        y_label="torque (mN·m)",
        size="medium",
        height=330,
        bands=tuple(
            Band(style, x, -1e3 * limit[:, j], 1e3 * limit[:, j])
            for style, limit in (("bound", whole), ("threshold", own))
        ),
        curves=(Curve("negative", x, 1e3 * signal[:, j]),),
        x_limits=(float(x[0]), float(x[-1])),
    )
