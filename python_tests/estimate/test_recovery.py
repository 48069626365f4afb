"""A fit finds the 472 numbers of a finger that made its recording itself (evidence/fit/recovery.py).

Here one seed, 400 s at 25 Hz: as much noise per second as at 1 kHz, so nearly the same errors, at a fortieth of the
time. docs/evidence/fit.md has the figures of 20 seeds at 1 kHz.
"""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

SEED, DURATION, RATE = 1, 400.0, 25.0


@pytest.fixture(scope="module")
def case() -> Any:
    from evidence.fit.recovery_case import make_case

    return make_case(SEED, DURATION, RATE)


@pytest.fixture(scope="module")
def row() -> dict[str, float]:
    """Of one seed, fitted both ways."""
    from evidence.fit.recovery import run_seed

    return run_seed(SEED, DURATION, RATE)


@pytest.mark.long
def test_the_recording_is_the_models_own(case: Any) -> None:
    """At the truth nothing is left but the noise: ½ Σ e²/S has the mean and the spread of so many unit normals."""
    from evidence.fit.recovery_case import image
    from tendonfmu.estimate.estimation import Estimator

    known = Estimator(image(case.truth))
    known.add_recording(case.recording, external_torque=case.recording["external_torque"])
    cost, gradient, information = known.evaluate(known.start)
    count = len(case.recording["time"]) * known.joints
    assert abs(2 * cost - count) < 5 * np.sqrt(2 * count)
    pull = gradient @ np.linalg.solve(information + np.diag((10 * known.scale) ** -2.0), gradient)
    assert abs(pull - len(gradient)) < 5 * np.sqrt(2 * len(gradient))
    assert case.recording["tendon_force"].min() > 1.0


@pytest.mark.long
def test_the_fit_starts_off_the_truth(case: Any) -> None:
    from evidence.fit.recovery_case import START_SPREAD, image
    from tendonfmu.estimate.estimation import Estimator

    true, start = (Estimator(image(case.truth)).start, Estimator(image(case.start)).start)
    off = np.log(start / true)
    assert len(off) == 472
    assert abs(np.std(off) / START_SPREAD - 1) < 5 / np.sqrt(2 * 472)
    assert json.dumps(case.truth) != json.dumps(case.start)


@pytest.mark.long
def test_an_excite_motion_tells_most_of_the_numbers(row: dict[str, float]) -> None:
    assert row["numbers"] == 472
    assert row["identifiable"] >= 0.7 * 472


@pytest.mark.long
@pytest.mark.parametrize("method", ["batch", "ekf"])
def test_they_are_found_within_their_errors(row: dict[str, float], method: str) -> None:
    """One seed; the errors of neighbours go along with one another, so the limits of 20 seeds are too narrow here."""
    assert row[f"{method}_far"] <= 0.03 * row["identifiable"]
    assert 0.6 < row[f"{method}_variance"] < 1.6


@pytest.mark.long
def test_both_methods_agree(row: dict[str, float]) -> None:
    assert row["converged"] == 1
    assert row["apart_rms"] < 1.0
