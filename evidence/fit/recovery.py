"""Does a fit find numbers that are known?"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from evidence.cases import run_cases
from evidence.fit import recovery_case as case
from evidence.fit.recovery_case import DURATION, Case, Scale, identifiable, run_seed
from evidence.part import Figures
from evidence.table import Row, column

# name: (seeds, samples per second, prior)
SETTINGS = {
    "100 Hz": (20, 100.0, case.PRIOR),
    "1 kHz": (2, 1000.0, case.PRIOR),
    "100 Hz, prior 100 %": (12, 100.0, 1.0),
}


def measure(folder: Path, workers: int) -> Figures:
    """All seeds of all settings."""
    cases = {
        f"{rate:g}_{prior:g}_seed_{seed}": (seed, DURATION, rate, prior)
        for seeds, rate, prior in SETTINGS.values()
        for seed in range(seeds)
    }
    rows = run_cases(run_seed, cases, folder, workers)
    figures: Figures = {}
    for name, (seeds, _, _) in SETTINGS.items():
        figures[name], rows = summary(rows[:seeds]), rows[seeds:]
    columns = list(figures.values())
    return {**figures, "lines": [[key, *(f"{of[key]:.4g}" for of in columns)] for key in columns[0]]}


def summary(rows: Sequence[Row]) -> dict[str, float]:
    """All seeds together; mean squares are over all identifiable numbers of all seeds."""

    def of(key: str) -> Any:
        return column(rows, key)

    known = of("identifiable")
    values: dict[str, float] = {
        "seeds": len(rows),
        "identifiable, mean": float(np.mean(known / of("numbers"))),
        "identifiable, least": float(np.min(known / of("numbers"))),
    }
    for key, method in (("batch", "batch"), ("ekf", "filter, last pass"), ("ekf_first", "filter, first pass")):
        values[f"{method}: within 3 standard errors"] = float(1 - of(f"{key}_far").sum() / known.sum())
        values[f"{method}: mean square"] = float(np.sum(of(f"{key}_variance") * known) / known.sum())
    values["not converged"] = int(np.sum(of("converged") == 0))
    return values


# --- levers -----------------------------------------------------------------------------------------------------------

RATE = 100.0  # 1/s; as much noise per second as at 1 kHz
FINGERS_NOISE = {"noise_std": 0.004, "noise_std_per_force": 0.0006, "noise_time": 0.002, "drift_variance": 1e-6}
SLOW = {"max_speed": 1.0, "max_acceleration": 10.0}
LIGHT = {"vary": None, "pretensions": (10.0,)}
# name: (what changes in the bias of the finger, what changes in the motion)
LEVERS: dict[str, tuple[dict[str, float], dict[str, Any]]] = {
    "the case above": ({}, {}),
    "noise of 0.25 mN·m instead of 0.5": ({"noise_std": 2.5e-4}, {}),
    "noise of 1 mN·m": ({"noise_std": 1e-3}, {}),
    "drift of 0.3 mN·m in 1 s instead of 0.1": ({"drift_variance": 1e-7}, {}),
    "`--max-speed 2 --max-acceleration 10`": ({}, {"max_speed": 2.0, "max_acceleration": 10.0}),
    "`--max-speed 1 --max-acceleration 10`": ({}, SLOW),
    "`--pretension 35` instead of `--vary-tension 15:60`": ({}, {"vary": None, "pretensions": (35.0,)}),
    "`--pretension 10`": ({}, LIGHT),
    "`excite`'s default motion": ({}, LIGHT | SLOW),
    "100 s instead of 400 s": ({}, {"duration": 100.0}),
    "the file's own noise": (FINGERS_NOISE, {}),
    "the file's own noise, `excite`'s default motion": (FINGERS_NOISE, LIGHT | SLOW),
}


def levers(folder: Path, workers: int) -> Figures:
    """What makes numbers identifiable, one thing changed at a time."""
    rows = run_cases(lever, {f"lever_{k:02d}": (name,) for k, name in enumerate(LEVERS)}, folder, workers)
    shares = [row["identifiable"] / row["numbers"] for row in rows]
    lines = [
        [name, str(row["identifiable"]), f"{100 * share:.0f} %"]
        for name, row, share in zip(LEVERS, rows, shares, strict=True)
    ]
    return {"numbers": rows[0]["numbers"], "usual": shares[0], "worst": shares[-1], "lines": lines}


def lever(name: str) -> Row:
    """The case with one thing changed; nothing is fitted."""
    bias, motion = LEVERS[name]
    truth = case.true_finger()
    truth["bias"] = truth["bias"] | bias
    made = case.training_motion(truth, 0, rate=RATE, **{"duration": DURATION} | motion)
    recording = case.carried(truth, made)
    recording["external_torque"] = np.zeros_like(made.joint_position)  # what is measured does not matter here
    known = identifiable(Case(truth, truth, recording), Scale(truth))
    return {"numbers": len(known), "identifiable": int(known.sum())}
