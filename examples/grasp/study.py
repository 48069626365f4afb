"""The tables of README.md: contacts and held forces, with and without compensation.

python study.py TendonFinger.fmu friction.fmu        (some minutes on two processors)
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial
from itertools import product
from pathlib import Path

import numpy as np
from closings import COMPENSATED, Closing, best_raw, thresholds_of
from controller import Array, Loop, Task
from grasp import Component, measures, run

PRETENSIONS, SPEEDS = (10.0, 20.0, 40.0), (0.1, 0.2, 0.4)  # N, rad/s
WAYS = {"steady": (0.8,), "searching": Task.way}
NEVER_STOP = (1e6,) * 4  # on thresholds
FORCES = (0.5, 1.0, 2.0)  # N
GAINS = ((1.0, 0.0), (4.0, 0.02), (8.0, 0.05))  # rad/s per N, rad per N
FREQUENCIES = (0.1, 0.25, 0.5, 1.0)  # Hz, of the plate's stroke

Fmus = tuple[Path, Path]
Best = dict[tuple[str, float], Task]


def closing(fmus: Fmus, thresholds: Array, task: Task) -> Closing:
    return Closing.of(run(*fmus, task)[0], task, thresholds)


def numbers(fmus: Fmus, task: Task) -> dict[str, float]:
    return measures(*run(*fmus, task))


def row(*cells: object) -> None:
    print("| " + " | ".join(map(str, cells)) + " |", flush=True)


def head(*cells: str) -> None:
    print()
    row(*cells)
    row(*("---" for _ in cells))


def stops(found: Iterable[tuple[float, float]]) -> str:
    """A cell: force N (delay ms) by speed."""
    texts = []
    for delay, force in found:
        texts.append("**false**" if delay < 0.0 else "never" if np.isinf(delay) else f"{force:.2f} ({1e3 * delay:.0f})")
    return ", ".join(texts)


def contacts(pool: ProcessPoolExecutor, fmus: Fmus, thresholds: Array) -> Best:
    """Prints where each detector stops; returns the task with the best thresholds of both by way and pretension."""
    cases = list(product(WAYS, PRETENSIONS, SPEEDS))
    free = [Task(way=WAYS[w], pretension=p, speed=v, touch=None, threshold_scale=NEVER_STOP) for w, p, v in cases]
    touching = [replace(task, way=(*task.way[:-1], 0.5), touch=Task.touch) for task in free]
    found = list(pool.map(partial(closing, fmus, thresholds), free + touching))
    head(
        "way", "pretension N", "false stops as described", "as described", "best thresholds", "raw, best", "its mean s"
    )
    best: Best = {}
    for way, pretension in product(WAYS, PRETENSIONS):
        chosen = [k for k, case in enumerate(cases) if case[:2] == (way, pretension)]
        ours, there = ([found[k + shift] for k in chosen] for shift in (0, len(cases)))
        scale, (seconds, raw) = thresholds_of(ours, COMPENSATED), best_raw(ours, there)
        false = sum(np.isfinite(each.stop(COMPENSATED, np.ones(4))[0]) for each in ours)
        cells = [(COMPENSATED, np.ones(4)), (COMPENSATED, scale), (f"raw, {seconds:g} s", raw)]
        texts = [stops(each.stop(name, limit) for each in there) for name, limit in cells]
        row(way, f"{pretension:g}", f"{false} of {len(ours)}", *texts, f"{seconds:g}")
        best[way, pretension] = Task(way=WAYS[way], pretension=pretension, threshold_scale=tuple(map(float, scale)),
                                     raw_threshold=tuple(map(float, raw)), raw_time=seconds)  # fmt: skip
    return best


def errors(found: dict[str, float], forces: Sequence[float]) -> list[str]:
    """Cells: mean ± rms N."""
    if np.isnan(found["stopped_at"]):
        return ["never stopped"] * len(forces)
    return [f"{found[f'mean_error_{f:g}N']:+.2f}, {found[f'rms_error_{f:g}N']:.2f}" for f in forces]


def compared(pool: ProcessPoolExecutor, fmus: Fmus, tasks: Sequence[Task]) -> list[list[dict[str, float]]]:
    """For each task: with compensation; raw; raw with the offset that, in hindsight, leaves no mean error."""
    ours = pool.map(partial(numbers, fmus), tasks)
    raw_tasks = [replace(task, compensated=False) for task in tasks]
    raw = list(pool.map(partial(numbers, fmus), raw_tasks))
    shifted = []
    for task, found in zip(raw_tasks, raw, strict=True):
        means = [found.get(f"mean_error_{force:g}N", 0.0) for force in task.forces]
        shifted.append(replace(task, raw_offset=float(np.mean(means))))
    return [list(three) for three in zip(ours, raw, pool.map(partial(numbers, fmus), shifted), strict=True)]


def held(pool: ProcessPoolExecutor, fmus: Fmus, best: Best) -> None:
    names = ("compensated", "raw", "raw, offset in hindsight")
    tasks = [replace(best["steady", p], forces=FORCES) for p in PRETENSIONS]
    head("pretension N", "force from", "stop, peak N", *(f"{force:g} N: mean, rms" for force in FORCES))
    for task, three in zip(tasks, compared(pool, fmus, tasks), strict=True):
        for name, found in zip(names, three, strict=True):
            first = f"{found['stop_force']:.2f}, {found['peak_force']:.2f}"
            row(f"{task.pretension:g}", name, first, *errors(found, FORCES))

    base = best["steady", PRETENSIONS[0]]
    head("gains", "force from", *(f"{force:g} N: mean, rms" for force in base.forces))
    tasks = [replace(base, integral=i, proportional=p) for i, p in GAINS]
    for task, three in zip(tasks, compared(pool, fmus, tasks), strict=True):
        for name, found in zip(names, three, strict=True):
            row(f"{task.integral:g}, {task.proportional:g}", name, *errors(found, task.forces))

    head("plate: Hz, largest mm/s", "force from", *(f"{force:g} N: mean, rms" for force in base.forces))
    tasks = [replace(base, frequency=f, hold=max(base.hold, 1.5 + 1.0 / f)) for f in FREQUENCIES]
    for task, three in zip(tasks, compared(pool, fmus, tasks), strict=True):
        fastest = 2e3 * np.pi * task.frequency * task.stroke
        for name, found in zip(names, three, strict=True):
            row(f"{task.frequency:g}, {fastest:.1f}", name, *errors(found, task.forces))


def main() -> int:
    if len(sys.argv) != 3:
        print("usage: study.py TendonFinger.fmu friction.fmu", file=sys.stderr)
        return 2
    fmus = Path(sys.argv[1]), Path(sys.argv[2])
    friction = Component(fmus[1])
    thresholds = friction.get(Loop.THRESHOLDS)
    friction.fmu.freeInstance()
    with ProcessPoolExecutor(2) as pool:
        held(pool, fmus, contacts(pool, fmus, thresholds))
    return 0


if __name__ == "__main__":
    sys.exit(main())
