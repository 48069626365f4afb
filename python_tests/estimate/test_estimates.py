"""`estimated` in a description: what counts as known, that it changes no output, and what a drawing shows of it."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
import pytest

from fit_cases import small_finger
from fit_finger import made_recording
from tendonfmu.errors import InputError
from tendonfmu.estimate import known_numbers
from tendonfmu.estimate.estimates import with_estimates
from tendonfmu.estimate.structure import estimable_numbers
from tendonfmu.model import native, read_finger
from tendonfmu.report import friction_figure

COULOMB = "joints[1].friction.coulomb"


def finger_with(entry: Any) -> dict[str, Any]:
    return {**copy.deepcopy(small_finger()), "estimated": {COULOMB: entry}}


def test_it_changes_no_output() -> None:
    value = small_finger()["joints"][0]["friction"]["coulomb"]
    arrays = made_recording().arrays()
    plain, known = (native.run_recording(data, arrays, 3) for data in (small_finger(), finger_with([value, 1e-4])))
    assert all(np.array_equal(values, known[name], equal_nan=True) for name, values in plain.items())


@pytest.mark.parametrize("entry", [1.0, [1.0], [1.0, -1.0], ["a", 0.1], [1.0, 0.1, 0.1], None])
def test_what_is_no_value_and_error_is_refused(entry: Any) -> None:
    with pytest.raises(InputError, match=r"estimated\.joints"):
        read_finger(finger_with(entry))


def test_replacing_a_number_makes_it_a_guess() -> None:
    finger = read_finger(finger_with([small_finger()["joints"][0]["friction"]["coulomb"], 1e-4]))
    assert set(known_numbers(finger.data)) == {COULOMB}
    assert not known_numbers(finger.replace({COULOMB: 0.9 * finger.data["joints"][0]["friction"]["coulomb"]}).data)


def test_friction_that_only_shows_together_is_drawn_as_the_sum_over_its_tendon() -> None:
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
    caption = friction_figure(known.data).caption
    assert f"All places of tendon {finger.tendon_names[0]} together: 4 %." in caption
    places = 2 + sum(joint.get("friction") is not None for joint in data["joints"])
    assert f"Left out: {places} places" in caption
