"""What is left of the torque on unseen motion, by what a description remembers of friction, on fingers by seed.

Odd seeds with nothing hidden. Errors are of means over 10 ms, without a learning bias: one constant a joint and
recording.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from evidence.cases import run_cases
from evidence.families import cases
from evidence.families.finger import NONE
from evidence.part import Figures
from evidence.table import Row, number, table, where
from tendonfmu import run
from tendonfmu.arrays import Numbers
from tendonfmu.commands.fit import fit
from tendonfmu.estimate import FitWarning
from tendonfmu.model import Finger, read_finger
from tendonfmu.recordings import Held, prepare, read_recording

SEEDS = [2 * pair + 1 for pair, effect in enumerate(cases.ORDER) if effect == NONE][:2]
MEAN, SETTLED = 0.01, 1.0  # s, of a mean; after which a recording counts
ENCODERS, TENDONS = 2, 1  # kinematics
_CLIPPED = {"effect": "presliding", "displacement": 0.1}  # s, times the velocity thresholds
_RELAXING = {**_CLIPPED, "relaxation_time": 0.1}
_STIFF = {"effect": "presliding", "stiffness": 2e4, "relaxation_time": 0.1}
_CORDS = {"effect": "cord_stretch", "stiffness": 2e4}
FORMS: dict[str, tuple[Mapping[str, Any], ...]] = {
    "none: it jumps": (),
    "clipped": (_CLIPPED,),
    "clipped, two elements": ({**_CLIPPED, "displacement": 0.04}, {**_CLIPPED, "displacement": 0.4}),
    "clipped, relaxing": (_RELAXING,),
    "clipped, relaxing, cords": (_RELAXING, _CORDS),
    "the same, absolute stiffness": (_STIFF, _CORDS),
}
CHOSEN = "chosen by the product"


def measure(folder: Path, workers: int) -> Figures:
    forms = [*FORMS, CHOSEN]
    named = {
        f"{family}_{seed}_{k}_{kinematics}": (folder / "cases", family, seed, form, kinematics)
        for family in cases.FAMILIES
        for seed in SEEDS
        for k, form in enumerate(forms)
        for kinematics in (ENCODERS, *((TENDONS,) if form in (forms[0], CHOSEN) else ()))
    }
    rows = run_cases(left_of_form, named, folder, workers)
    return {"forms": rows, "chosen": {family: typical(rows, family, CHOSEN) for family in cases.FAMILIES}}


def left_of_form(folder: Path, family: str, seed: int, form: str, kinematics: int) -> Row:
    """A description fitted to a case's training recording, and what it leaves on the test."""
    case = cases.kept(folder, family, seed)
    fitted = learned(case.nominal, [case.recordings["train"]], form, kinematics)
    left = residual(fitted, case.recordings["test"], kinematics)
    return {"family": family, "seed": seed, "form": form, "kinematics": kinematics, "left": rms_by_joint(left)}


def learned(nominal: Mapping[str, Any], recordings: Sequence[pd.DataFrame], form: str, kinematics: int) -> Finger:
    """The description with that memory, fitted; the product's own choice where the form is CHOSEN."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FitWarning)
        if form != CHOSEN:
            given = {**nominal, "extensions": [dict(row) for row in FORMS[form]]}
            return fit(given, list(recordings), kinematics=kinematics).finger
        return chosen(nominal, recordings, kinematics)


def chosen(nominal: Mapping[str, Any], recordings: Sequence[pd.DataFrame], kinematics: int) -> Finger:
    """The description with the memory that the product chooses."""
    from tendonfmu.estimate.memory_choice import choose_memory

    given = read_finger(dict(nominal))
    prepared = [prepare(given, read_recording(recording), kinematics, Held()) for recording in recordings]
    return choose_memory(given, prepared, threads=1).finger


def residual(fitted: Finger, recording: pd.DataFrame, kinematics: int) -> Numbers:
    """[B, n] N·m, what the finger leaves of a recording, without what a bias would learn."""
    silent = fitted.steady  # nothing is forgotten: a place that sticks keeps what it held
    out = run(silent, recording, kinematics=kinematics).frame
    joints = len(silent.data["joints"])
    left = out[[f"compensated_torque[{j + 1}]" for j in range(joints)]].to_numpy()
    time = recording["time"].to_numpy()
    size = round(MEAN / float(np.median(np.diff(time))))
    left = left[time >= time[0] + SETTLED]
    left = left[: len(left) // size * size].reshape(-1, size, joints).mean(axis=1)
    return np.asarray(left - left.mean(axis=0))


def rms_by_joint(left: Numbers) -> list[float]:
    return [float(value) for value in np.sqrt((left**2).mean(axis=0))]


# --- tables -----------------------------------------------------------------------------------------------------------


def typical(rows: Sequence[Row], family: str, form: str, kinematics: int = ENCODERS) -> float | None:
    """Median over the seeds of the rms over all joints [mN·m]."""
    members = where(rows, family=family, form=form, kinematics=kinematics)
    left = [1e3 * float(np.sqrt(np.mean(np.square(row["left"])))) for row in members]
    return float(np.median(left)) if left else None


def forms_table(figures: Figures) -> str:
    rows, lines = figures["forms"], []
    for form in (*FORMS, CHOSEN):
        for kinematics, angles in ((ENCODERS, "encoders"), (TENDONS, "tendons")):
            values = [typical(rows, family, form, kinematics) for family in cases.FAMILIES]
            if any(value is not None for value in values):
                lines.append([form, angles, *(number(value) for value in values)])
    return table(["friction remembers", "angles from", *cases.FAMILIES], lines, 2)
