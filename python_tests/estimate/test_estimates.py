"""`estimated` in a description: what counts as known, that it changes no output, and what a drawing shows of it."""

from __future__ import annotations

import copy
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fit_cases import small_finger
from fit_data import make_recording, wavy_motion
from fit_finger import made_recording, moved_start
from tendonfmu.errors import InputError
from tendonfmu.estimate import FrictionFit, known_numbers
from tendonfmu.estimate.files import with_estimates
from tendonfmu.estimate.structure import estimable_numbers
from tendonfmu.model import get_number, native, read_finger, set_number
from tendonfmu.recordings import Recording

pytestmark = pytest.mark.filterwarnings("ignore::tendonfmu.estimate.fitting.FitWarning")

COULOMB = "joints[1].friction.coulomb"


def finger_with(entry: Any) -> dict[str, Any]:
    return {**copy.deepcopy(small_finger()), "estimated": {COULOMB: entry}}


def test_it_changes_no_output() -> None:
    value = small_finger()["joints"][0]["friction"]["coulomb"]
    arrays = made_recording().arrays()
    plain, known = (native.run_recording(data, arrays, 3) for data in (small_finger(), finger_with([value, 1e-4])))
    assert all(np.array_equal(values, known[name], equal_nan=True) for name, values in plain.items())


@pytest.mark.parametrize("entry", [1.0, [1.0], [1.0, -1.0], ["a", 0.1]])
def test_what_is_no_value_and_error_is_refused(entry: Any) -> None:
    with pytest.raises(InputError, match=r"estimated\.joints"):
        read_finger(finger_with(entry))


def test_replacing_a_number_makes_it_a_guess() -> None:
    finger = read_finger(finger_with([small_finger()["joints"][0]["friction"]["coulomb"], 1e-4]))
    assert set(known_numbers(finger.data)) == {COULOMB}
    assert not known_numbers(finger.replace({COULOMB: 0.9 * finger.data["joints"][0]["friction"]["coulomb"]}).data)


def test_friction_that_only_shows_together_is_known_as_the_sum_over_its_tendon() -> None:
    """Two places that always slide together: what one takes, the other may have taken."""
    data = copy.deepcopy(small_finger())
    for tendon in data["tendons"]:
        tendon |= {"pulley_friction": None, "edge_friction": None}
    law = {"static": 0.02, "coulomb": 0.02, "stribeck_velocity": 0.01, "viscous": 0.0}
    data["tendons"][0] |= {"pulley_friction": [law, None], "edge_friction": [None, law]}
    finger = read_finger(data)
    numbers = estimable_numbers(finger.data)
    size = np.array([number.value for number in numbers])
    covariance = np.diag(size**2)
    pair = [k for k, number in enumerate(numbers) if number.path.startswith("tendons[1]")]
    covariance[np.ix_(pair, pair)] = 0.01**2 * np.array([[1.0, -0.99], [-0.99, 1.0]])
    known = with_estimates(finger, numbers, covariance, size)
    assert set(known_numbers(known.data)) == {"tendons[1]"}


# --- fits -------------------------------------------------------------------------------------------------------------


def fitted(finger: Any, *recordings: Recording) -> FrictionFit:
    """All tendons alike: 19 unknowns, 70 numbers."""
    return FrictionFit(finger, share=["tendons"], kinematics=3, tolerance=1e-3).fit(recordings)


def test_what_a_fit_wrote_is_known_to_the_next_one_until_somebody_changes_it() -> None:
    first = fitted(moved_start(), made_recording(duration=40.0))
    assert first.report_["given_numbers"]["start"] == "guessed"
    finger = first.description_.to_dict()
    again = fitted(finger, made_recording(seed=5, duration=3.0))
    paragraph = again.report_["given_numbers"]["paragraph"]
    assert again.report_["given_numbers"]["start"] == "estimated" and "were estimated before" in paragraph
    reasons = {entry["path"]: entry["reason"] for entry in again.report_["parameters"]}
    kept = [path for path, reason in reasons.items() if reason == "kept"]
    assert len(kept) > 5 and all(not number.identified for number in again.numbers_ if number.number.path in kept)
    path = next(path for path in kept if path.endswith("viscous"))
    set_number(finger, path, 1.01 * get_number(finger, path))
    assert set(known_numbers(first.description_.to_dict())) - set(known_numbers(finger)) == {path}


def at_pretension(force: float, seed: int = 1) -> Recording:
    motion = wavy_motion(seed, 20.0, 200.0, 2)
    forces = np.full((len(motion["time"]), 4), force)
    groups = dict(make_recording(small_finger(), motion, forces, seed).recording)
    return Recording(Path(f"{force:g}_{seed}.parquet"), groups.pop("time"), groups)


def test_a_fit_of_two_pretensions_identifies_and_one_alone_leaves_the_other_no_worse() -> None:
    """Friction in the joint and at the edge are one number at a single pretension."""
    start, truth = json.loads(json.dumps(moved_start())), small_finger()
    low, high = (at_pretension(force) for force in (8.0, 32.0))
    one, both = (fitted(start, *recordings) for recordings in ([low], [low, high]))
    assert both.report_["identified"]["count"] > one.report_["identified"]["count"]

    def left(finger: Any, force: float) -> float:
        recording = at_pretension(force, seed=9)
        torque = [native.run_recording(data, recording.arrays(), 3)["friction_torque"] for data in (finger, truth)]
        bias = [native.run_recording(data, recording.arrays(), 3)["bias_torque"] for data in (finger, truth)]
        return float(np.sqrt(np.mean((torque[0] - bias[0] - torque[1] + bias[1]) ** 2)))

    for force in (8.0, 32.0):
        assert left(one.description_.data, force) < 1.05 * left(start, force)
    assert left(both.description_.data, 32.0) < 0.5 * left(start, 32.0)
