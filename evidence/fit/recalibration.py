"""Fingers fitted again on 20 s under one load or pretension, judged under the others.

    python -m evidence.fit.recalibration

The da Vinci jaw needs the recordings in ../shared/data or $TENDONFMU_DATA. Prints the tables of
docs/evidence/recalibration.md.
"""

from __future__ import annotations

import copy
import json
import sys
import tempfile
import warnings
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

import matched_rig
from evidence import tables
from evidence.runner import EXAMPLES, parser
from evidence.tables import Row
from matched_physics import read_finger
from tendonfmu.estimate import FitWarning, FrictionFit
from tendonfmu.files import write_table
from tendonfmu.model.native import run_recording
from tendonfmu.recordings import Recording, convert_file
from tendonfmu.recordings import read_recording as read_file

sys.path.insert(0, str(EXAMPLES / "davinci"))
from jaw_recordings import FAST, FAULT, SLOW, data_folder, rms, torque_error

Description = Mapping[str, Any]

STRUCTURE = EXAMPLES / "davinci" / "jaw_extended.json"
EVEN = ("00", "02", "04", "06", "08")
PLANTED = (1.0, 1.3, 0.7)  # times the joint's Coulomb friction
COULOMB = "joints[1].friction.coulomb"
PRETENSION = 13.0  # N; as in docs/evidence/davinci.md
LIMIT = 1.05  # of the error before
HANDS = range(1, 13)
STARTS = 4  # of each finger, its numbers off by up to OFF
OFF, SECONDS = 0.3, 20.0
LEVELS = (1.0, 2.0, 4.0)  # times the pretension
SETTLED = 50  # samples; the bias begins with the first one


def fitted(finger: Any, recordings: Sequence[Recording], kinematics: int = 1) -> dict[str, Any]:
    """The description that a plain fit writes."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FitWarning)
        fit = FrictionFit(finger, uncertainty=False, kinematics=kinematics).fit(recordings)
    return dict(json.loads(fit.description_text()))


# --- the jaw ----------------------------------------------------------------------------------------------------------


def read_runs(folder: Path) -> dict[str, Recording]:
    """By name, as `tendonfmu convert davinci --pretension 13` writes them, up to the fault of run 07."""
    runs = {}
    for name in (*SLOW, *FAST):
        file = folder / f"{name}.parquet"
        write_table(file, convert_file("davinci", data_folder() / f"{name}.TXT", {"pretension": PRETENSION}))
        whole = read_file(file)
        end = int(np.searchsorted(whole.time, FAULT.get(name, np.inf), side="right"))
        groups = {group: np.ascontiguousarray(values[:end]) for group, values in whole.groups.items()}
        runs[name] = Recording(file, np.ascontiguousarray(whole.time[:end]), groups)
    return runs


def planted(finger: Description, factor: float) -> dict[str, Any]:
    """The description with another Coulomb friction of the joint, as well known as before."""
    data = copy.deepcopy(dict(finger))
    law = data["joints"][0]["friction"]
    law["static"], law["coulomb"] = factor * law["static"], factor * law["coulomb"]
    for path, entry in (data.get("estimated") or {}).items():
        entry[0] *= factor if path.startswith("joints[1].friction") else 1.0
    return data


def jaw_rows(only: Sequence[str] = (*SLOW, *FAST), factors: Sequence[float] = PLANTED) -> list[Row]:
    """Each start, each run: rms in N·m on each other run."""
    rows = []
    with tempfile.TemporaryDirectory() as scratch:
        runs = read_runs(Path(scratch))
        guess = {key: value for key, value in json.loads(STRUCTURE.read_text()).items() if key != "estimated"}
        known = fitted(guess, [runs[name] for name in EVEN])
        for numbers, start in (("guessed", guess), ("estimated", known)):
            for factor in factors:
                finger = planted(start, factor)
                before = _errors(finger, runs)
                for run in only:
                    after = _errors(fitted(finger, [runs[run]]), runs)
                    rows += [
                        {"numbers": numbers, "factor": f"× {factor:g}", "fitted": run, "judged": other}
                        | {"before": before[other], "after": after[other], "ratio": after[other] / before[other]}
                        for other in runs
                        if other != run
                    ]
    return rows


def _errors(finger: Description, runs: Mapping[str, Recording]) -> dict[str, float]:
    return {name: rms(torque_error(run, run_recording(finger, run.arrays()))) for name, run in runs.items()}


# --- fingers whose truth is known -------------------------------------------------------------------------------------


def sibling_rows(seeds: Iterable[int] = HANDS, starts: int = STARTS) -> list[Row]:
    """Each finger, each start: fitted to one pretension, or to one that varies, and judged at several."""
    rows = []
    for seed in seeds:
        hand = matched_rig.random_hand(
            seed, joints=2 + seed % 2, presliding=True, source=1 if seed % 3 else 2, rate=500.0, cutoff=20.0
        )
        hand = replace(hand, noise=replace(hand.noise, tendon_step=1e-7))
        training = {"one": _recorded(hand, 100 + seed, 1.0), "varied": _recorded(hand, 500 + seed, None)}
        judged = {f"× {level:g}": _recorded(hand, 200 + seed + 100 * k, level) for k, level in enumerate(LEVELS)}
        for k in range(starts):
            start = matched_rig.off_start(np.random.default_rng([seed, k, 9]), hand.truth, OFF)
            before = {level: _left(start, recording, hand.source) for level, recording in judged.items()}
            for pretension, recording in training.items():
                finger = fitted(start, [recording], hand.source)
                for level, other in judged.items():
                    ratio = _left(finger, other, hand.source) / before[level]
                    rows.append({"seed": seed, "pretension": pretension, "judged": level, "ratio": ratio})
    return rows


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
    return float(rms(run_recording(finger, recording.arrays(), kinematics)["compensated_torque"][SETTLED:]))


# --- tables -----------------------------------------------------------------------------------------------------------


def _ratios(rows: Sequence[Row]) -> list[str]:
    ratio = tables.column(rows, "ratio")
    values = [np.median(ratio), np.quantile(ratio, 0.9), ratio.max()]
    return [*(f"{value:.2f}" for value in values), f"{np.sum(ratio > LIMIT)} of {len(ratio)}"]


def report(jaw: Sequence[Row], siblings: Sequence[Row]) -> str:
    """The jaw by numbers and planted factor, on runs of the half that constants were chosen on and of the other."""
    head = ["after/before: median", "90 %", "worst", f"above {LIMIT}"]
    sections = []
    for rows, keys in ((jaw, ("numbers", "factor")), (siblings, ("pretension", "judged"))):
        for row in rows:
            chosen = row["fitted"] in EVEN if "fitted" in row else row["seed"] % 2 == 0
            row["half"] = "chosen on" if chosen else "others"
        sections.append(tables.table([*keys, "half", *head], tables.by(rows, [*keys, "half"], _ratios), text_columns=3))
    return "\n\n".join(sections)


def main() -> None:
    parser(__doc__, output=None).parse_args()
    print(report(jaw_rows(), sibling_rows()))


if __name__ == "__main__":
    main()
