"""Does a plain fit to 20 s under one load or pretension keep a good model good under the others?"""

from __future__ import annotations

import copy
import json
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

import matched_rig
from evidence.cases import run_cases
from evidence.machines import EVEN, FAST, HERE, ODD, jaw_run
from evidence.part import Figures
from evidence.table import Row, by, column, rms
from matched_physics import read_finger
from tendonfmu.estimate import FitWarning, FrictionFit
from tendonfmu.model.native import run_recording
from tendonfmu.recordings import Recording

Description = Mapping[str, Any]

FACTORS = (1.0, 1.3, 0.7)  # times the joint's Coulomb friction, before the fit
LIMIT = 1.05  # of the error before
HANDS = range(1, 13)
STARTS, OFF = 4, 0.3  # of each finger, every number off by up to OFF
SECONDS = 20.0
LEVELS = (1.0, 2.0, 4.0)  # times the pretension
SETTLED = 50  # samples; the bias begins with the first one


def measure(folder: Path, workers: int) -> Figures:
    """Errors after over before, of the jaw and of fingers whose truth is known."""
    starts = {
        f"jaw_{numbers}_{factor:g}": (numbers, factor) for numbers in ("guessed", "estimated") for factor in FACTORS
    }
    jaw = run_cases(jaw_rows, starts, folder, workers)
    fingers = run_cases(finger_rows, {f"finger_{seed:02d}": (seed,) for seed in HANDS}, folder, workers)
    return {
        "jaw": _summary(jaw, ("numbers", "factor")),
        "fingers": _summary(fingers, ("pretension", "judged")),
    }


def _summary(cases: Sequence[Row], keys: Sequence[str]) -> Figures:
    rows = [row for case in cases for row in case["rows"]]
    ratio = column(rows, "ratio")
    above = {"worst": float(ratio.max()), "above": int(np.sum(ratio > LIMIT)), "of": len(ratio)}
    return above | {"lines": by(rows, keys, _ratios)}


def _ratios(rows: Sequence[Row]) -> list[str]:
    ratio = column(rows, "ratio")
    values = [np.median(ratio), np.quantile(ratio, 0.9), ratio.max()]
    return [*(f"{value:.2f}" for value in values), f"{np.sum(ratio > LIMIT)} of {len(ratio)}"]


def fitted(finger: Any, recordings: Sequence[Recording], kinematics: int = 1) -> dict[str, Any]:
    """The description that a plain fit writes."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FitWarning)
        fit = FrictionFit(finger, uncertainty=False, kinematics=kinematics).fit(recordings)
    return dict(json.loads(fit.description_text()))


# --- the da Vinci jaw -------------------------------------------------------------------------------------------------


def jaw_rows(numbers: str, factor: float) -> Row:
    """One start, fitted to each run and judged on each other one."""
    runs = {name: jaw_run(name) for name in (*EVEN, *ODD, *FAST)}
    file = HERE / "davinci" / "extended.json"
    start = {key: value for key, value in json.loads(file.read_text(encoding="utf-8")).items() if key != "estimated"}
    if numbers == "estimated":
        start = fitted(start, [runs[name] for name in EVEN])
    finger = planted(start, factor)
    before = _errors(finger, runs)
    rows = []
    for run in runs:
        after = _errors(fitted(finger, [runs[run]]), runs)
        about = {"numbers": numbers, "factor": f"× {factor:g}"}
        rows += [about | {"ratio": after[other] / before[other]} for other in runs if other != run]
    return {"rows": rows}


def planted(finger: Description, factor: float) -> dict[str, Any]:
    """The description with another Coulomb friction of the joint, as well known as before."""
    data = copy.deepcopy(dict(finger))
    law = data["joints"][0]["friction"]
    law["static"], law["coulomb"] = factor * law["static"], factor * law["coulomb"]
    for path, entry in (data.get("estimated") or {}).items():
        entry[0] *= factor if path.startswith("joints[1].friction") else 1.0
    return data


def _errors(finger: Description, runs: Mapping[str, Recording]) -> dict[str, float]:
    """[N·m] rms of the compensated torque less what the sensor at the jaw felt, of each run."""
    outputs = {name: run_recording(finger, run.arrays()) for name, run in runs.items()}
    return {name: rms(outputs[name]["compensated_torque"] - runs[name].groups["external_torque"]) for name in runs}


# --- fingers whose truth is known -------------------------------------------------------------------------------------


def finger_rows(seed: int) -> Row:
    """One finger, each start: fitted to one pretension, or to one that varies, and judged at several."""
    hand = matched_rig.random_hand(
        seed, joints=2 + seed % 2, presliding=True, source=1 if seed % 3 else 2, rate=500.0, cutoff=20.0
    )
    hand = replace(hand, noise=replace(hand.noise, tendon_step=1e-7))
    training = {"one": _recorded(hand, 100 + seed, 1.0), "varied": _recorded(hand, 500 + seed, None)}
    judged = {f"× {level:g}": _recorded(hand, 200 + seed + 100 * k, level) for k, level in enumerate(LEVELS)}
    rows = []
    for k in range(STARTS):
        start = matched_rig.off_start(np.random.default_rng([seed, k, 9]), hand.truth, OFF)
        before = {level: _left(start, recording, hand.source) for level, recording in judged.items()}
        for pretension, recording in training.items():
            finger = fitted(start, [recording], hand.source)
            for level, other in judged.items():
                ratio = _left(finger, other, hand.source) / before[level]
                rows.append({"pretension": pretension, "judged": level, "ratio": ratio})
    return {"rows": rows}


def _recorded(hand: Any, seed: int, level: float | None) -> Recording:
    """20 s at a constant pretension; None: at one that varies from half to double."""
    arms = read_finger(hand.truth).arms
    time = np.arange(round(SECONDS * hand.rate)) / hand.rate
    motion, force = (np.random.default_rng([seed, part]) for part in (61, 62))
    encoders = np.column_stack([matched_rig.strokes(motion, time) for _ in range(arms.shape[1])])
    if level is None:
        pretension = matched_rig.pretension(force, time, arms, hand.level, hand.tension_time)
    else:
        pretension = np.tile(level * hand.level * matched_rig.pulling_null_vector(arms), (len(time), 1))
    made = matched_rig.recorded(hand, time, encoders, pretension, 0.0, force, hand.noise)
    return Recording.from_frame(pd.DataFrame(made.columns))


def _left(finger: Description, recording: Recording, kinematics: int) -> float:
    """[N·m] rms of the compensated torque."""
    return rms(run_recording(finger, recording.arrays(), kinematics)["compensated_torque"][SETTLED:])
