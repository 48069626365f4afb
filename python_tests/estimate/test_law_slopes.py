"""Derivatives by the numbers of friction laws from one run, against differences between runs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from test_core_runs import REMEMBERING, finger

from fit_finger import made_recording
from tendonfmu.estimate.core_runs import CoreRuns, SlowDrift
from tendonfmu.estimate.estimation import Estimator
from tendonfmu.estimate.memory_fit import LawSlopes
from tendonfmu.estimate.structure import Choice, build_structure
from tendonfmu.model import finger_from_data
from tendonfmu.recordings import Held, prepare

STIFF = {"effect": "presliding", "stiffness": 2e4}
SOFT = {"effect": "presliding", "displacement": 2.0, "share": 0.5}
NEAR = 0.2  # of a column: jumps in the middle of a block; what is held since before a reversal, by the other side
HELD = 0.5  # of what changes with speed: its limit changes while friction is held
CORDS = {"effect": "cord_stretch", "stiffness": 2e4}


@pytest.mark.parametrize(
    "rows",
    [
        (),
        (REMEMBERING,),
        (REMEMBERING, SOFT),
        (STIFF,),
        ({**STIFF, "relaxation_time": 0.01},),
        ({**STIFF, "relaxation_time": 0.01}, CORDS),
    ],
)
def test_they_are_the_differences_of_runs(rows: tuple[dict[str, Any], ...]) -> None:
    given = finger_from_data(finger(*rows), Path("small.json"))
    structure = build_structure(given, Choice())
    runs = CoreRuns(structure.start, [prepare(given, made_recording(rate=200.0), 3, Held())])
    estimator = Estimator(structure.start.image, structure.group, structure.scale)
    slopes = LawSlopes(structure, runs).at(estimator.start)
    drift = SlowDrift(runs.time, runs.stretch, runs.used)
    compared = 0
    for k, unknown in enumerate(estimator.unknowns):
        if unknown.path.startswith(("bias.", "extensions[")):
            assert not slopes[:, :, k].any()
            continue
        moved = estimator.start.copy()
        moved[k] += 1e-4 * unknown.scale
        begin, there = estimator.values(estimator.start), estimator.values(moved)
        after = {path: there[row] for path, row in structure.index.items() if there[row] != begin[row]}
        wanted = drift.without(runs.columns([(after, 1e-4)]))[:, :, 0]
        own = drift.without(slopes[:, :, [k]] * unknown.scale)[:, :, 0]
        if np.abs(wanted).max() > 1e-5:
            compared += 1
            least = NEAR if unknown.role in ("coulomb", "value") or not rows else HELD
            assert np.sum((own - wanted) ** 2) < least**2 * np.sum(wanted**2), unknown.name
    assert compared > 8
