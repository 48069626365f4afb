"""What the figures of a tuning show: alarms over level, bounds over force, and the worst moments."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tendonfmu.arrays import Numbers
from tendonfmu.detect import ContactTuning, FreeRun, rate_limit, tail_levels
from tendonfmu.statistics import intervals

JOINTS = 4  # drawn at most
WORST = 4  # moments
AROUND = 0.6  # s before and after a moment
APART = 2.0  # s; moments nearer than this have one cause
_FACTORS = np.geomspace(0.4, 2.5, 60)


@dataclass(frozen=True)
class TailFigure:
    """Alarms per hour over the factor on the chosen thresholds."""

    title: str  # heading
    factors: Numbers
    in_sample: Numbers  # rates with bounds chosen on the same blocks, and on other blocks
    held_out: Numbers
    low: Numbers  # 95 % interval of `held_out`
    high: Numbers
    wished: float
    limit: float
    confidence: float  # probability of that limit
    least: float


@dataclass(frozen=True)
class BoundPanel:
    """Bounds of one joint over the force."""

    joint: str  # its name
    force: Numbers
    own: Numbers
    others: Mapping[str, Numbers]
    at: Numbers
    friction: Numbers
    points: Numbers
    rms: Numbers


@dataclass(frozen=True)
class BoundFigure:
    title: str
    signal: str
    panels: list[BoundPanel]


@dataclass(frozen=True)
class Moment:
    """Signal and bound around one of the highest peaks."""

    title: str  # where and when
    time: Numbers
    signal: Numbers  #
    bound: Numbers
    own: Numbers


@dataclass(frozen=True)
class WorstFigure:
    title: str
    signal: str
    moments: list[Moment]


def tail_figure(tuning: ContactTuning) -> TailFigure:
    found = tuning.tail(_FACTORS)
    rates = [intervals.rate(held, tuning.hours_) for _, _, held in found]
    return TailFigure(
        title=f"{tuning.description_.name}: {60 * tuning.hours_:.0f} min of free motion, {tuning.method}",
        factors=_FACTORS,
        in_sample=np.array([count / tuning.hours_ for _, count, _ in found]),
        held_out=np.array([each.value for each in rates]),
        low=np.array([each.low for each in rates]),
        high=np.array([each.high for each in rates]),
        wished=tuning.rate_,
        limit=rate_limit(tuning.held_out_[0], tuning.hours_, tuning.confidence),
        confidence=tuning.confidence,
        least=1.0 / tuning.hours_,
    )


def _main(tuning: ContactTuning) -> str:
    return "innovation" if "innovation" in tuning.lines_ else "residual"


def bound_figure(tuning: ContactTuning) -> BoundFigure:
    name = _main(tuning)
    search, bound, cells = tuning.searches_[name], tuning.bounds_[name], tuning.cells_
    over = search.excess(bound.stuck_share, bound.jump_share)
    at, levels = tail_levels(cells, over, np.ones(len(cells.order), dtype=bool), tuning.rate_)
    added = bound.stuck_share * search.mean_stuck + bound.jump_share * search.mean_jump
    friction = np.array([added[cells.group == g].mean(axis=0) for g in range(cells.groups)])
    force = np.linspace(0.0, 1.1 * float(at.max()), 60)
    own = bound.own(force)
    others = {each: found.own(force) for each, found in tuning.bounds_.items() if each != name}
    rms = np.array([each.rms for each in tuning.pretensions_])
    names = tuning.description_.joint_names
    chosen = np.sort(np.argsort(-own.mean(axis=0), kind="stable")[:JOINTS])
    return BoundFigure(
        title=f"{tuning.description_.name}: bounds, {tuning.method}",
        signal=name,
        panels=[
            BoundPanel(
                joint=names[j],
                force=force,
                own=own[:, j],
                others={each: values[:, j] for each, values in others.items()},
                at=at,
                friction=own_at(bound.base[j], bound.per_force[j], at) + friction[:, j],
                points=levels[:, j],
                rms=rms[:, j],
            )
            for j in chosen
        ],
    )


def own_at(base: float, per_force: float, force: Numbers) -> Numbers:
    """Return the bound base + per_force·force [k] N·m."""
    return np.asarray(base + per_force * force)


def worst_figure(tuning: ContactTuning) -> WorstFigure:
    """Find the highest ratios of a cell to its bound, one of those near each other."""
    name = _main(tuning)
    line, cells = tuning.lines_[name], tuning.cells_
    moments: list[Moment] = []
    taken: list[tuple[int, float]] = []
    for k in np.argsort(-line.statistic, kind="stable"):
        part, time = int(cells.part[k]), float(cells.time[k])
        if any(part == other and abs(time - then) < APART for other, then in taken):
            continue
        taken.append((part, time))
        moments.append(_moment(tuning, name, tuning.runs_[part], time))
        if len(moments) == WORST:
            break
    return WorstFigure(f"{tuning.description_.name}: nearest to an alarm", name, moments)


def _moment(tuning: ContactTuning, name: str, run: FreeRun, at: float) -> Moment:
    time = run.part.time - run.part.time[0]
    rows = np.flatnonzero(np.abs(time - at) <= AROUND)
    bound = tuning.bounds_[name]
    signal = np.asarray(getattr(run, name)[rows], dtype=float)
    own = bound.own(run.part.mean_force[rows])
    whole = own + bound.stuck_share * run.stuck[rows] + bound.jump_share * run.jump[rows]
    near = np.abs(time[rows] - at) <= 0.05
    j = int(np.argmax(np.max((np.abs(signal) - (whole - own))[near] / own[near], axis=0)))
    joint, source = tuning.description_.joint_names[j], Path(run.part.source).name
    force = float(run.part.mean_force[rows].mean())
    return Moment(
        title=f"{joint}, {source}, {run.part.time[0] + at:.1f} s, {force:.3g} N",
        time=time[rows] - at,
        signal=signal[:, j],
        bound=whole[:, j],
        own=own[:, j],
    )
