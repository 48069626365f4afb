"""contact.uncertainty of a fit: the directions, the error that is stated of them, and what they are good for."""

from __future__ import annotations

import copy
import json
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from fit_cases import plain, small_finger
from fit_finger import made_recording, moved_start
from tendonfmu.estimate.fitting import FrictionFit
from tendonfmu.estimate.prior import posterior_factor
from tendonfmu.model import native
from tendonfmu.statistics.error_directions import few_directions, predicted

pytestmark = pytest.mark.filterwarnings("ignore::tendonfmu.estimate.fitting.FitWarning")

Numbers = NDArray[np.float64]
SHARED = {"share": ["tendons"], "kinematics": 3, "tolerance": 1e-3}


def fitted(finger: dict[str, Any], recording: Any, **options: Any) -> FrictionFit:
    return FrictionFit(finger, **(SHARED | options)).fit(recording)


def parts_of(data: dict[str, Any], recording: Any) -> Numbers:
    arrays = {name: values[::10] for name, values in recording.arrays().items()}
    return native.Instance.from_description(data, 3).run(arrays, parts=True)["friction_parts"]


# --- covariance -------------------------------------------------------------------------------------------------------


def test_factor_of_a_covariance_is_exact_and_survives_rounding() -> None:
    rng = np.random.default_rng(7)
    size = 10.0 ** rng.uniform(-9.0, 0.0, 40)  # units of very different size
    columns = rng.standard_normal((30, 40)) / size  # data that know 30 combinations of 40 numbers
    information, units = columns.T @ columns, np.outer(size, size)
    factor, share = posterior_factor(information, np.diag(size**2))
    expected = np.linalg.inv(np.eye(40) + information * units)
    np.testing.assert_allclose(factor @ factor.T / units, expected, atol=1e-9)
    np.testing.assert_allclose(factor.T @ information @ factor, np.diag(share), atol=1e-9)
    # the inverse of what knows some numbers 1e6 times better than others has negative eigenvalues
    factor, share = posterior_factor(1e11 * information, np.diag(size**2))
    covariance = factor @ factor.T
    std = np.sqrt(np.diag(covariance))
    assert np.linalg.eigvalsh(covariance / np.outer(std, std)).min() > -1e-12
    assert share.min() >= 0.0 and share.max() <= 1.0 and np.count_nonzero(share > 0.999) == 30


# --- directions -------------------------------------------------------------------------------------------------------


def random_slopes(seed: int, unknowns: int) -> tuple[Numbers, Numbers]:
    """Parts [K, 6], the fifth never moves; slopes [K, unknowns] that the parts explain in part only."""
    rng = np.random.default_rng(seed)
    parts = rng.standard_normal((400, 6)) * [1.0, 0.3, 2.0, 1e-3, 0.0, 1.0]
    return parts, parts @ rng.standard_normal((6, unknowns)) + 0.3 * rng.standard_normal((400, unknowns))


def test_four_directions_are_exact_where_there_are_no_more() -> None:
    parts, _ = random_slopes(1, 1)
    slopes = parts @ np.random.default_rng(2).standard_normal((6, 4))
    directions, captured = few_directions(parts, slopes)
    assert directions.shape == (4, 6) and captured == pytest.approx(1.0, abs=1e-12)
    assert predicted(parts, directions) == pytest.approx(np.sqrt(np.sum(slopes**2, axis=1)), rel=1e-6)
    assert not directions[:, 4].any()  # of a part that the motion does not show nothing is said
    assert few_directions(parts, 0.0 * slopes) == (pytest.approx(np.zeros((0, 6))), 1.0)


def test_more_directions_capture_more_and_err_less() -> None:
    parts, slopes = random_slopes(3, 12)
    std = np.sqrt(np.sum(slopes**2, axis=1))
    found = [few_directions(parts, slopes, most) for most in range(1, 6)]
    captured = [share for _, share in found]
    errors = [np.sqrt(np.mean((predicted(parts, directions) - std) ** 2)) for directions, _ in found]
    assert all(np.diff(captured) > 0) and captured[0] > 0.1 and captured[-1] < 1.0
    assert all(np.diff(errors) < 1e-9) and errors[-1] < 0.8 * errors[0]
    # what is left out is put back: the mean variance is near the true one, although a part of it is captured only
    assert np.mean(predicted(parts, found[3][0]) ** 2) == pytest.approx(np.mean(std**2), rel=0.1)


# --- a fit ------------------------------------------------------------------------------------------------------------


def scaling_finger() -> dict[str, Any]:
    """One coulomb friction per tendon and nothing else: T is Σ r·f·F, and an error of F a relative one of that part."""
    finger = copy.deepcopy(small_finger())
    finger["joints"] = [{"name": name} for name in ("base", "tip")]
    for i, tendon in enumerate(finger["tendons"]):
        tendon["edge_friction"] = [plain(0.02 + 0.01 * i, 0.004), None]
        del tendon["pulley_friction"]
    return finger


def test_parameters_that_only_scale_tendons_are_told_exactly() -> None:
    recording = made_recording(duration=20.0)
    found = fitted(scaling_finger(), recording, share=[], prior=1e3)
    directions = found.description_.data["contact"]["uncertainty"]
    value = np.array([found.parameters_[f"tendons[{i}].edge_friction[1].coulomb"] for i in range(1, 5)])
    entry, parts = found.report_["uncertainty"], parts_of(dict(found.description_.data), recording)
    own = list(found.parameters_)
    order = [own.index(f"tendons[{i}].edge_friction[1].coulomb") for i in range(1, 5)]
    covariance = found.covariance_[np.ix_(order, order)]
    slopes = parts[:, 0, :4] / value
    std = np.sqrt(np.einsum("ku,uv,kv->k", slopes, covariance, slopes))
    seen = std > 0
    told = predicted(parts[:, 0], np.array(directions[0]))[seen] / std[seen]
    # the prior says nothing beside these data: the whole information shrinks
    assert told == pytest.approx(np.full(seen.sum(), np.sqrt(entry["inflation"][0])), rel=1e-4)
    assert entry["captured"][0] == pytest.approx(1.0, abs=1e-9)
    # written with 6 digits
    assert max(entry["train"]["error_rms"][0], entry["loaded"]["error_rms"][0] / 4) < 5e-6 * entry["train"]["std"][0]


def test_residuals_that_last_count_for_more() -> None:
    """As much noise again, each value held for 0.1 s: of that the bias takes a part, and fewer samples are new."""
    recording = made_recording(duration=40.0)
    noise = 0.003 * np.random.default_rng(9).standard_normal((len(recording) // 20 + 1, 2))
    recording.groups["external_torque"] = (
        recording.groups["external_torque"] - np.repeat(noise, 20, axis=0)[: len(recording)]
    )
    plain = fitted(moved_start(), recording, effective_samples=False)
    assert all(2.2 < each < 20.0 for each in plain.report_["uncertainty"]["inflation"])
    # the effective number of samples, which comes from the residuals alone, leaves nothing to inflate but by chance
    found = fitted(moved_start(), recording, effective_samples=True)
    assert all(0.4 < each < 1.8 for each in found.report_["uncertainty"]["inflation"])
    std = [np.array(each.report_["uncertainty"]["train"]["std"]) for each in (plain, found)]
    assert std[1] == pytest.approx(std[0], rel=0.1)


def test_directions_of_an_earlier_fit_do_not_stay(fit: FrictionFit) -> None:
    before = copy.deepcopy(dict(fit.description_.data))
    before["contact"]["uncertainty_level"] = 2.0
    recording = made_recording(duration=20.0)
    without = fitted(before, recording, uncertainty=False, max_passes=2)
    assert without.description_.data["contact"] == {"threshold": [0.03, 0.03]}
    assert without.report_["uncertainty"] is None
    again = fitted(before, recording, max_passes=2).description_.data["contact"]
    assert again["uncertainty_level"] == 2.0 and again["uncertainty"] != before["contact"]["uncertainty"]
    stopped = FrictionFit(before, **SHARED, progress=lambda _: False).fit(recording)
    assert stopped.unfinished_ is not None and "uncertainty" not in json.dumps(stopped.unfinished_.description)


def test_the_report_says_how_well_the_directions_tell_it(fit: FrictionFit) -> None:
    entry = fit.report_["uncertainty"]
    assert entry["blocks"] >= 10 and entry["block_time"] >= 1.0
    for which in ("train", "held_out", "loaded"):
        std, error, worst = (np.array(entry[which][key]) for key in ("std", "error_rms", "error_worst"))
        assert (std > 0).all() and (error < (0.4 if which != "loaded" else 0.8) * std).all() and (worst >= error).all()
    assert entry["directions"] == [len(each) for each in fit.description_.data["contact"]["uncertainty"]]
    # white noise of the settings' size: nothing to inflate but by chance (16 blocks)
    assert all(0.5 < each < 1.8 for each in entry["inflation"])
