"""Fits whose residuals are coloured, and fits that begin from an earlier one."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from fit_cases import small_finger
from fit_finger import made_recording, moved_start
from tendonfmu.errors import InputError
from tendonfmu.estimate.files import read_previous_fit
from tendonfmu.estimate.fitting import FrictionFit
from tendonfmu.files import report_text
from tendonfmu.recordings.recording import Recording

pytestmark = pytest.mark.filterwarnings("ignore::tendonfmu.estimate.fitting.FitWarning")

Numbers = NDArray[np.float64]
SHARED = {"share": ["tendons"], "kinematics": 3, "tolerance": 0.05}
TRUTH = small_finger()


def fitted(finger: Any, *recordings: Recording, **options: Any) -> FrictionFit:
    return FrictionFit(finger, **(SHARED | options)).fit(list(recordings))


def held_noise(seed: int, duration: float, size: float) -> Recording:
    """The model's own recording with a further error of this size (N·m), each value of it held for 0.1 s."""
    recording = made_recording(seed=seed, duration=duration)
    noise = size * np.random.default_rng(1000 + seed).standard_normal((len(recording) // 20 + 1, 2))
    recording.groups["external_torque"] -= np.repeat(noise, 20, axis=0)[: len(recording)]
    return recording


# --- white residuals --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("method", ["batch", "ekf"])
def test_a_model_that_is_right_is_fitted_as_before_bit_for_bit(method: str) -> None:
    recording = made_recording(duration=20.0)
    found, plain = (fitted(moved_start(), recording, method=method, effective_samples=each) for each in (True, False))
    effective = found.report_["innovations"]["effective"]
    assert effective["worth"] == effective["samples"]
    assert np.array_equal(found.z_, plain.z_) and np.array_equal(found.z_covariance_, plain.z_covariance_)
    assert found.report_["innovations"] == plain.report_["innovations"]


# --- coloured residuals -----------------------------------------------------------------------------------------------


def scores(found: FrictionFit) -> Numbers:
    """(estimate − truth)/standard error of the Coulomb friction, which all of the motion tells."""
    known = fitted_truth()
    paths = [path for path in found.parameters_ if path.endswith(".coulomb")]
    return np.array([(found.parameters_[path] - known[path]) / found.standard_errors_[path] for path in paths])


def fitted_truth() -> dict[str, float]:
    from tendonfmu.estimate.structure import estimable_numbers

    return {number.path: number.value for number in estimable_numbers(TRUTH)}


@pytest.mark.long
@pytest.mark.parametrize("method", ["batch", "ekf"])
def test_standard_errors_cover_the_truth(method: str) -> None:
    """rms of the scores: 1 where the standard errors are right. Every sample counted, it is far above."""
    recordings = [held_noise(seed, 20.0, 0.006) for seed in (1, 2, 4, 5, 6)]  # in 3 a tendon goes slack
    passes = {"passes": 6} if method == "ekf" else {}  # as many as settle it
    fits = {
        effective: [
            # with a wide prior: else numbers that are right stay where they are
            fitted(TRUTH, recording, method=method, effective_samples=effective, prior=1.0, **passes)
            for recording in recordings
        ]
        for effective in (True, False)
    }
    spread = {
        key: np.sqrt(np.mean(np.concatenate([scores(each) for each in found]) ** 2)) for key, found in fits.items()
    }
    assert 0.6 < spread[True] < 1.5 and spread[False] > 2.2
    # the interval of the NIS knows of the colour
    wide, narrow = (np.diff(found[0].report_["innovations"]["nis"]["interval"])[0] for found in fits.values())
    effective = fits[True][0].report_["innovations"]["effective"]
    share = sum(effective["worth"]) / sum(effective["samples"])
    assert share < 0.3 and (method == "ekf" or wide == pytest.approx(narrow / np.sqrt(share), rel=0.05))


def test_what_coloured_residuals_do_not_tell_stays_where_it_was() -> None:
    """A start that is right and a prior of 5 %: with every sample counted, colour alone moves the numbers far more."""
    recording = held_noise(21, 10.0, 0.02)
    moved = {}
    for effective in (True, False):
        found = fitted(TRUTH, recording, prior=0.05, effective_samples=effective)
        known = fitted_truth()
        moved[effective] = np.array([found.parameters_[path] / known[path] - 1 for path in found.parameters_])
    rms = {effective: float(np.sqrt(np.mean(each**2))) for effective, each in moved.items()}
    assert rms[True] < 0.05
    assert rms[False] > 1.5 * rms[True]


# --- from a previous fit ----------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def previous(tmp_path_factory: pytest.TempPathFactory) -> tuple[FrictionFit, Path, Path]:
    """A fit, its report and its description."""
    folder = tmp_path_factory.mktemp("previous")
    found = fitted(moved_start(), made_recording(duration=20.0), tolerance=1e-3, prior=1.0)
    report, description = folder / "report.json", folder / "finger.json"
    report.write_text(report_text(found.report_), encoding="utf-8")
    found.description_.write(description)
    return found, report, description


@pytest.mark.parametrize("method", ["batch", "ekf"])
def test_a_second_fit_from_the_first_is_a_fit_to_both(previous: tuple[FrictionFit, Path, Path], method: str) -> None:
    """Where nothing can have changed, the previous fit stands for its recording."""
    first, report, _ = previous
    other = made_recording(seed=5, duration=20.0)
    exact = {"tolerance": 1e-3} if method == "batch" else {}
    second = fitted(moved_start(), other, previous=report, prior=1e-6, method=method, **exact)
    both = fitted(moved_start(), made_recording(duration=20.0), other, tolerance=1e-3, prior=1.0)
    # beyond a tenth of a number the laws are not linear within its error, and the previous fit is no Gaussian
    paths = [path for path, value in both.parameters_.items() if both.standard_errors_[path] < 0.1 * abs(value)]
    error = np.array([both.standard_errors_[path] for path in paths])
    far = {
        name: np.array([found.parameters_[path] - both.parameters_[path] for path in paths]) / error
        for name, found in (("first", first), ("second", second))
    }
    assert len(paths) > 10 and np.sqrt(np.mean(far["first"] ** 2)) > 0.8
    assert np.sqrt(np.mean(far["second"] ** 2)) < 0.4
    known = np.array([second.standard_errors_[path] for path in paths]) / error
    assert np.median(known) == pytest.approx(1.0, abs=0.1) and known.max() < 1.5


def test_what_is_no_previous_fit_of_this_finger_is_refused(
    previous: tuple[FrictionFit, Path, Path], tmp_path: Path
) -> None:
    other = json.loads(previous[1].read_text(encoding="utf-8"))
    for entry in other["parameters"]:
        entry["path"] = f"extensions[9].{entry['path']}"
    for content, words in (
        ({"format": "tendonfmu-fit-1"}, "expected a whole report"),
        ({"format": "tendonfmu-score-1"}, "format"),
        ([1, 2], "expected"),
        (other, r"none of its \d+ numbers"),
    ):
        file = tmp_path / "previous.json"
        file.write_text(json.dumps(content), encoding="utf-8")
        with pytest.raises(InputError, match=rf"previous\.json.*{words}"):
            fitted(TRUTH, made_recording(), previous=file)


def test_from_a_description_numbers_count_as_known_to_within_the_change(
    previous: tuple[FrictionFit, Path, Path],
) -> None:
    first, _, description = previous
    still = made_recording(seed=5, still=1)
    found = fitted(moved_start(), still, previous=description, prior=0.03)
    for path, value in first.parameters_.items():
        if path.startswith("joints[2].load_friction"):  # that joint never moves
            assert found.parameters_[path] == pytest.approx(value, rel=1e-3)
    coulomb = "joints[2].load_friction.coulomb"
    if coulomb in found.parameters_:
        expected = np.hypot(first.standard_errors_[coulomb], 0.03 * found.parameters_[coulomb])
        assert found.standard_errors_[coulomb] == pytest.approx(expected, rel=0.02)


def test_a_previous_fit_is_read_with_its_covariance(previous: tuple[FrictionFit, Path, Path]) -> None:
    first, report, description = previous
    found = read_previous_fit(report)
    assert found.values == first.parameters_ and found.share == 1.0
    root = np.sqrt(np.diag(first.z_covariance_))
    assert found.covariance / np.outer(root, root) == pytest.approx(
        first.z_covariance_ / np.outer(root, root), abs=1e-3
    )
    bare = read_previous_fit(description)
    known = [entry for entry in first.report_["parameters"] if entry["standard_error"] <= 0.3 * entry["value"]]
    assert set(first.parameters_) <= set(bare.values)
    assert len(bare.names) == len(known) and np.isfinite(bare.covariance).all()
