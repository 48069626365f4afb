"""FrictionFit: what it finds, how well it says that it knows it, and its options."""

from __future__ import annotations

import copy
import json
import re
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fit_cases import small_finger
from fit_finger import asymmetric_finger, made_recording, moved_start, write_recording
from repository_paths import ROOT
from tendonfmu.errors import InputError
from tendonfmu.estimate.files import Unfinished, read_unfinished, write_unfinished
from tendonfmu.estimate.fitting import FitWarning, FrictionFit
from tendonfmu.estimate.structure import get_number, set_number, with_sides
from tendonfmu.model import native
from tendonfmu.recordings.recording import Recording


@pytest.fixture(autouse=True)
def _quiet() -> Any:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FitWarning)
        yield


def shared(finger: Any = None, **options: Any) -> FrictionFit:
    """All tendons alike: 19 unknowns, 70 numbers."""
    return FrictionFit(
        finger or small_finger(), **({"share": ["tendons"], "kinematics": 3, "tolerance": 1e-3} | options)
    )


@pytest.fixture(scope="module")
def fit() -> FrictionFit:
    """One fit that several tests look at: 40 s, started up to a fifth off, a fifth of the time held out."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FitWarning)
        return shared(moved_start(), holdout=0.2).fit(made_recording(duration=40.0), compare=made_recording(seed=5))


# --- what it finds ----------------------------------------------------------------------------------------------------


def test_it_finds_the_truth_from_a_start_that_is_off(fit: FrictionFit) -> None:
    assert fit.converged_ and fit.finished_
    assert len(fit.parameters_) == 70
    errors = [
        (value - get_number(small_finger(), path)) / fit.standard_errors_[path]
        for path, value in fit.parameters_.items()
    ]
    assert np.abs(errors).max() < 4.0
    assert fit.report_["identified"]["count"] > 35
    known = {p["path"] for p in fit.report_["parameters"] if p["identified"]}
    off = [abs(get_number(fit.start_.data, p) / get_number(small_finger(), p) - 1) for p in known]
    left = [abs(fit.parameters_[p] / get_number(small_finger(), p) - 1) for p in known]
    assert np.mean(left) < 0.6 * np.mean(off)


def test_standard_errors_follow_from_the_unknowns(fit: FrictionFit) -> None:
    """static = coulomb + drop, vs = 1/rate: var(Fs) = var(Fc) + var(d) + 2 cov, var(vs) = vs⁴ var(rate)."""
    place = {(u.path.rsplit(".", 1)[0], u.role): k for k, u in enumerate(fit.unknowns_)}
    covariance = fit.z_covariance_
    law = "joints[1].friction"
    c, d, r = (place[law, role] for role in ("coulomb", "drop", "rate"))
    static = np.sqrt(covariance[c, c] + covariance[d, d] + 2 * covariance[c, d])
    velocity = fit.parameters_[f"{law}.stribeck_velocity"]
    assert fit.standard_errors_[f"{law}.static"] == pytest.approx(static, rel=1e-6)
    assert fit.standard_errors_[f"{law}.coulomb"] == pytest.approx(np.sqrt(covariance[c, c]), rel=1e-6)
    error = velocity**2 * np.sqrt(covariance[r, r])
    assert fit.standard_errors_[f"{law}.stribeck_velocity"] == pytest.approx(error, rel=1e-4)
    paths = list(fit.parameters_)
    i, j = paths.index(f"{law}.static"), paths.index(f"{law}.coulomb")
    assert fit.covariance_[i, j] == pytest.approx(covariance[c, c] + covariance[c, d], rel=1e-6)


def test_the_innovations_of_a_true_model_are_white_and_as_large_as_stated(fit: FrictionFit) -> None:
    innovations = fit.report_["innovations"]
    assert innovations["nis"]["consistent"]
    assert all(abs(value) < 0.03 for value in innovations["whiteness"]["lag_one"])
    assert all(value > 1e-3 for value in innovations["whiteness"]["ljung_box_p"])


def test_the_fitted_description_is_one_and_keeps_all_else(fit: FrictionFit) -> None:
    text = fit.description_text()
    native.image_from_json(text)
    fitted, start = json.loads(text), json.loads(json.dumps(moved_start()))
    for path, value in fit.parameters_.items():
        assert get_number(fitted, path) == value
        set_number(fitted, path, 0.0)
        set_number(start, path, 0.0)
    assert all(1 <= len(joint) <= 4 for joint in fitted["contact"].pop("uncertainty"))
    known = fitted.pop("estimated")
    assert fitted == start
    assert list(fitted) == list(start)
    assert len(text.splitlines()) < 130 + len(known)  # a law is a line, and a direction, and a known number


def test_the_residual_is_that_of_the_runtime(fit: FrictionFit) -> None:
    """compensated_torque is taken after the bias update: (1 − K) r, with 1 − K = R/S."""
    recording = made_recording(seed=7, keep=("tendon_force", "tendon_position", "joint_position", "joint_velocity"))
    data = copy.deepcopy(dict(fit.description_.data))
    data["contact"] = {"threshold": [1e6, 1e6]}
    found = native.run_recording(data, recording.arrays(), 3)
    fresh = fit.predict(recording)
    residual = found["joint_torque"] - fresh
    bias = data["bias"]
    known, left = bias["noise_std"] ** 2, []
    for step in np.diff(recording.time):
        spread = known + bias["drift_variance"] * step
        left.append(bias["noise_std"] ** 2 / (spread + bias["noise_std"] ** 2))
        known = spread * left[-1]
    assert np.isnan(fresh[0]).all()
    assert found["compensated_torque"][1:] == pytest.approx(residual[1:] * np.array(left)[:, None], abs=1e-12)
    assert fit.score(recording) == pytest.approx(
        1 - np.sum(residual[1:] ** 2) / np.sum((found["joint_torque"][1:] - found["joint_torque"][1:].mean(0)) ** 2)
    )


def test_rms_are_said_for_what_was_trained_on_held_out_and_compared(fit: FrictionFit) -> None:
    residual = fit.report_["residual"]
    (comparison,) = residual["comparisons"]
    for entry in (residual["train"], residual["held_out"], comparison):
        for j in range(2):
            assert entry["rms"][j] == pytest.approx(3e-3, rel=0.1)  # noise_std, and what the bias has not found yet
            assert entry["rms"][j] < entry["start_rms"][j] < entry["bias_only_rms"][j] < entry["torque_rms"][j]
            assert entry["rms"][j] < entry["model_only_rms"][j]


def test_it_can_be_scored_on_other_recordings(fit: FrictionFit) -> None:
    assert 0.9 < fit.score(made_recording(seed=8)) < 1.0
    assert (
        fit.score(made_recording(seed=8))
        > shared(max_passes=1, only=["joints[1].cover"], share=[])
        .fit(made_recording(duration=1.0))
        .score(made_recording(seed=8))
        - 0.01
    )


# --- the filter ----------------------------------------------------------------------------------------------------


def test_the_filter_agrees_with_the_batch_within_their_errors(fit: FrictionFit) -> None:
    recording = made_recording(duration=40.0)
    ekf = shared(moved_start(), method="ekf", holdout=0.2).fit(recording)
    assert ekf.report_["method"] == "ekf" and ekf.report_["cost"] is None
    known = [p["path"] for p in fit.report_["parameters"] if p["identified"]]
    away = [(ekf.parameters_[path] - fit.parameters_[path]) / fit.standard_errors_[path] for path in known]
    assert np.abs(away).max() < 2.0
    ratio = [ekf.standard_errors_[path] / fit.standard_errors_[path] for path in known]
    assert min(ratio) > 0.4 and max(ratio) < 2.0
    innovations = ekf.report_["innovations"]
    assert innovations["nis"]["consistent"]
    assert all(abs(value) < 0.03 for value in innovations["whiteness"]["lag_one"])
    trained = ekf.recordings_[0].train.sum() * 2
    low, high = innovations["nis"]["interval"]
    assert high - low == pytest.approx(2 * 1.96 * np.sqrt(2 / trained), rel=0.02)  # held-out samples do not count


def test_the_filter_goes_on_from_a_file(tmp_path: Path) -> None:
    """From the values there, with the expected magnitudes of the description."""
    recording = made_recording(duration=40.0)
    stopped = shared(moved_start(), method="ekf", progress=lambda now: now.done < now.total / 2).fit(recording)
    assert stopped.unfinished_ is not None
    file = write_unfinished(tmp_path / "f.json", stopped.unfinished_)
    resumed = shared(moved_start(), method="ekf", start=file).fit(recording)
    fresh = shared(moved_start(), method="ekf").fit(recording)
    assert [u.scale for u in resumed.unknowns_] == pytest.approx([u.scale for u in fresh.unknowns_])
    known = [p["path"] for p in fresh.report_["parameters"] if p["identified"]]
    away = [(resumed.parameters_[p] - fresh.parameters_[p]) / fresh.standard_errors_[p] for p in known]
    assert 0.0 < np.abs(away).max() < 2.0


def test_numbers_that_wander_are_known_less() -> None:
    recording = made_recording()
    still, wandering = (shared(method="ekf", parameter_drift=drift).fit(recording) for drift in (0.0, 1e-2))
    linear = np.array([unknown.role != "rate" for unknown in still.unknowns_])
    ratio = np.diag(wandering.z_covariance_) / np.diag(still.z_covariance_)
    assert np.median(ratio[linear]) > 1.3


# --- why a number is not identified -------------------------------------------------------------------------------


def explained(recording: Recording, path: str, **options: Any) -> tuple[str | None, str]:
    """Reason and advice on one number."""
    fit = shared(share=[], **options).fit(recording)
    found = next(p for p in fit.report_["parameters"] if p["path"] == path)
    return found["reason"], found["advice"] or ""


def test_a_side_that_never_slides_is_told() -> None:
    recording = made_recording()
    np.abs(recording.groups["joint_velocity"], out=recording.groups["joint_velocity"])
    options: dict[str, Any] = {"sides": "asymmetric", "only": ["joints[1].friction"]}
    assert explained(recording, "joints[1].friction.negative.coulomb", **options) == (
        "side",
        "move joint base both ways",
    )
    assert explained(recording, "joints[1].friction.positive.coulomb", **options)[0] != "side"


def test_a_working_point_that_is_never_near_is_told() -> None:
    recording = made_recording()
    recording.groups["joint_position"][:, 0] += 2.0  # beyond both working points, at ±0.4 rad
    options: dict[str, Any] = {"only": ["tendons[*].edge_friction[2]"]}
    found = explained(recording, "tendons[2].edge_friction[2].laws[1].coulomb", **options)
    assert found == ("working_point", "move joint tip while joint base is near -0.4 rad")


def test_speeds_that_are_never_slow_are_told() -> None:
    recording = made_recording()
    velocity = recording.groups["joint_velocity"]
    velocity += 0.8 * np.where(velocity >= 0, 1.0, -1.0)
    reason, advice = explained(recording, "joints[1].friction.stribeck_velocity", only=["joints[1].friction"])
    assert reason == "slow"
    assert re.fullmatch(r"let joint base turn round slowly: strokes at 0.01 to 0\.\d+ rad/s", advice)


def test_what_only_shows_together_names_its_partners() -> None:
    """Two tendons side by side: what one loses, the other may have lost."""
    finger = small_finger()
    finger["tendons"][1]["moment_arms"] = finger["tendons"][0]["moment_arms"]
    recording = made_recording(duration=40.0)
    for name in ("tendon_force", "tendon_position"):
        recording.groups[name][:, 1] = recording.groups[name][:, 0]
    only = ["tendons[1].edge_friction[1].coulomb", "tendons[2].edge_friction[1].coulomb"]
    fit = shared(finger, share=[], only=only).fit(recording)
    one, other = fit.report_["parameters"]
    for this, partner in ((one, other), (other, one)):
        assert this["reason"] == "combination"
        assert this["advice"].endswith(f"--fix or --share it with {partner['path']}")
    assert fit.report_["correlation"]["matrix"][0][1] < -0.8


# --- hold-out ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("share", "blocks"), [(0.2, [(4, 5), (9, 10)]), (0.5, [(k, k + 1) for k in range(1, 10, 2)])])
def test_held_out_blocks_are_spread_evenly(share: float, blocks: list[tuple[int, int]]) -> None:
    """A block of 10 s at most, and short enough that there are two."""
    fit = shared(holdout=share, max_passes=1, tolerance=0.5).fit(made_recording(duration=40.0))
    length = min(10.0, 40.0 * share / 2)
    expected = np.zeros(8000, dtype=bool)
    for begin, end in blocks:
        expected[round(begin * length * 200) : round(end * length * 200)] = True
    found = fit.recordings_[0].held_out
    assert np.sum(found != expected) <= 2 * len(blocks)  # the last sample lies at 39.995 s
    assert not (found & fit.recordings_[0].train).any()


def test_what_is_held_out_has_no_say() -> None:
    recording = made_recording(duration=40.0)
    plain = shared(moved_start(), holdout=0.2).fit(recording)
    held_out = plain.recordings_[0].held_out
    recording.groups["external_torque"][held_out] += np.tile([0.05, -0.05], len(held_out))[: held_out.sum(), None]
    changed = shared(moved_start(), holdout=0.2).fit(recording)
    assert (plain.z_ == changed.z_).all()
    assert changed.report_["residual"]["held_out"]["rms"][0] > 2 * plain.report_["residual"]["held_out"]["rms"][0]


def test_given_numbers_that_do_better_where_nothing_was_fitted_are_kept() -> None:
    recording = made_recording(duration=40.0)
    trained = shared(holdout=0.2).fit(recording).recordings_[0].train
    other = made_recording(duration=40.0, asymmetric=True)
    for name, values in recording.groups.items():
        values[trained] = other.groups[name][trained]
    fit = shared(holdout=0.2).fit(recording)
    start = small_finger()
    assert all(value == pytest.approx(get_number(start, path)) for path, value in fit.parameters_.items())
    assert fit.report_["given_numbers"]["kept"] and "kept" in fit.report_["given_numbers"]["paragraph"]
    held_out = fit.report_["residual"]["held_out"]
    assert held_out["rms"] == pytest.approx(held_out["start_rms"])


# --- structure --------------------------------------------------------------------------------------------------------


def test_fixed_numbers_stay_and_the_others_move() -> None:
    fit = shared(moved_start(), fix=["tendons[*].pulley_friction[*]", "joints[1].cover.stiffness"]).fit(
        made_recording()
    )
    assert not any("pulley" in path or path == "joints[1].cover.stiffness" for path in fit.parameters_)
    start = json.loads(json.dumps(moved_start()))
    for tendon, before in zip(fit.description_.data["tendons"], start["tendons"], strict=True):
        assert tendon["pulley_friction"] == before["pulley_friction"]
    assert all(value != get_number(start, path) for path, value in fit.parameters_.items())


@pytest.mark.parametrize(
    ("share", "unknowns"),
    [(["tendons"], 19 + 6), (["tendons[*].pulley_friction[*]"], 10 + 4 + 4 * 11 + 0), (["pulleys"], 70), ([], 70)],
)
def test_shared_laws_share_their_numbers(share: list[str], unknowns: int) -> None:
    fit = FrictionFit(small_finger(), share=share, kinematics=3, max_passes=2, tolerance=0.5).fit(made_recording())
    assert len(fit.z_) == unknowns
    first = fit.parameters_["tendons[1].pulley_friction[1].coulomb"]
    same = fit.parameters_["tendons[3].pulley_friction[1].coulomb"] == first
    assert same == any("tendons" in each for each in share)


def test_laws_that_share_start_from_their_mean() -> None:
    finger = json.loads(json.dumps(small_finger()))
    finger["tendons"][0]["pulley_friction"][0]["coulomb"] = 0.01
    fit = FrictionFit(finger, share=["tendons"], only=["*pulley*"], kinematics=3, max_passes=1, tolerance=0.5)
    fit.fit(made_recording())
    assert fit.start_.data["tendons"][2]["pulley_friction"][0]["coulomb"] == pytest.approx((0.01 + 3 * 0.02) / 4)


@pytest.mark.long
def test_two_sides_are_told_apart() -> None:
    recording = made_recording(duration=60.0, asymmetric=True)
    fit = shared(sides="asymmetric", only=["joints[*]"], share=[]).fit(recording)
    truth = with_sides(asymmetric_finger(), "asymmetric")
    assert len(fit.z_) == 18
    errors = [(v - get_number(truth, path)) / fit.standard_errors_[path] for path, v in fit.parameters_.items()]
    assert np.abs(errors).max() < 4.5
    rough, smooth = (f"joints[1].friction.{side}.viscous" for side in ("negative", "positive"))
    assert fit.parameters_[rough] - fit.parameters_[smooth] > 5 * fit.standard_errors_[rough]
    one = shared(asymmetric_finger(), sides="symmetric", only=["joints[*]"], share=[]).fit(recording)
    assert one.report_["residual"]["train"]["rms"][0] > fit.report_["residual"]["train"]["rms"][0]
    law = one.description_.data["joints"][0]["friction"]
    assert set(law) == {"static", "coulomb", "stribeck_velocity", "viscous"}


def test_an_initial_bias_in_the_description_is_estimated() -> None:
    finger = small_finger()
    finger["bias"]["initial_torque"] = [0.0, 0.0]
    recording = made_recording()
    recording.groups["external_torque"] -= [0.05, -0.03]  # y gains as much
    fit = shared(finger).fit(recording)
    assert fit.parameters_["bias.initial_torque[1]"] == pytest.approx(0.05, abs=5e-3)
    assert fit.parameters_["bias.initial_torque[2]"] == pytest.approx(-0.03, abs=5e-3)
    assert fit.description_.data["bias"]["initial_torque"] == [
        fit.parameters_["bias.initial_torque[1]"],
        fit.parameters_["bias.initial_torque[2]"],
    ]


def test_an_initial_bias_of_zero_is_known_where_its_error_is_small_beside_the_noise() -> None:
    finger = small_finger()
    finger["bias"].update(initial_torque=[0.0, 0.0], initial_variance=1e-8, drift_variance=1e-9, noise_std=0.01)
    recording = made_recording()
    recording.groups["external_torque"] += 0.002  # brings the estimate to 0
    fit = shared(finger, effective_samples=False).fit(recording)
    (bias,) = (entry for entry in fit.report_["parameters"] if entry["path"] == "bias.initial_torque[2]")
    assert abs(bias["value"]) < 2 * bias["standard_error"] < 0.2 * 0.01
    assert bias["identified"]


@pytest.mark.long
def test_several_recordings_have_a_bias_each() -> None:
    """A step of the bias between recordings says nothing about friction."""
    other = made_recording(seed=2)
    other.groups["external_torque"] -= 0.4
    together = shared().fit([made_recording(), other])
    assert together.report_["innovations"]["nis"]["consistent"]
    plain = shared().fit([made_recording(), made_recording(seed=2)])
    assert together.z_ == pytest.approx(plain.z_, rel=1e-6)


def test_the_prior_holds_what_the_data_do_not_know() -> None:
    finger = moved_start()
    loose, tight = (shared(finger, prior=prior).fit(made_recording()) for prior in (1.0, 1e-4))
    for path, value in tight.parameters_.items():
        assert value == pytest.approx(get_number(finger, path), rel=2e-3)
    assert max(abs(v / get_number(finger, p) - 1) for p, v in loose.parameters_.items()) > 0.1
    wide = shared(finger, scale=["joints[1].friction.viscous=0.5"]).fit(made_recording())
    viscous = next(u for u in wide.unknowns_ if u.path == "joints[1].friction.viscous")
    assert viscous.scale == 0.5


@pytest.mark.parametrize("method", ["batch", "ekf"])
def test_friction_that_starts_at_0_is_found_with_a_scale(method: str) -> None:
    """Nothing else in this finger says how large the friction of a joint may be: the refusal asks for the scale."""
    finger, truth = small_finger(), shared().fit(made_recording()).parameters_["joints[1].friction.coulomb"]
    for joint in finger["joints"]:
        if joint.get("friction") is not None:
            joint["friction"] = {"coulomb": 0.0, "static": 0.0, "stribeck_velocity": 0.01}
    with pytest.raises(InputError, match=r"joints\[1\].friction.coulomb = 0: .* expected a scale"):
        shared(finger, method=method).fit(made_recording())
    found = shared(finger, method=method, scale=["joints[*].friction.coulomb=0.01"]).fit(made_recording())
    assert found.parameters_["joints[1].friction.coulomb"] == pytest.approx(truth, rel=0.3)


# --- refused options --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"only": ["tendons[9]"]}, "--only tendons[9]: matches none of the 70 numbers"),
        ({"fix": ["*.colour"]}, "--fix *.colour: matches none"),
        ({"fix": ["*"]}, "no number is left"),
        ({"scale": ["joints[1].friction"]}, "expected PATTERN=VALUE"),
        ({"scale": ["joints[1].friction.static=-1"]}, "expected PATTERN=VALUE"),
        ({"share": ["fingers"]}, "--share fingers: matches none"),
        ({"fix": "*.colour"}, "--fix *.colour: matches none"),
        ({"parameter_drift": 1e-3}, "drift = 0.001: expected 0 with method batch"),
    ],
)
def test_options_that_make_no_sense_are_refused(options: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError) as refused:
        shared(**options).fit(made_recording())
    assert words in str(refused.value)


def test_laws_of_different_structure_share_nothing() -> None:
    finger = json.loads(json.dumps(small_finger()))
    law = finger["tendons"][0]["pulley_friction"][0]
    law["static"] = law["coulomb"]
    with pytest.raises(InputError, match="without \\(static = coulomb\\); expected laws of the same structure"):
        shared(finger).fit(made_recording())


# --- manners ----------------------------------------------------------------------------------------------------------


def test_parameters_are_read_and_set_as_in_scikit_learn() -> None:
    fit = FrictionFit(small_finger(), prior=2.0)
    again = FrictionFit(**fit.get_params())
    assert again.get_params() == fit.get_params()
    assert all(getattr(fit, name) == value for name, value in fit.get_params().items())
    assert all(again.get_params()[name] is value for name, value in fit.get_params().items())  # else `clone` refuses
    assert (fit.max_passes, fit.sides) == (fit.passes, "given")  # names of earlier versions
    assert again.set_params(prior=3.0, share=["tendons"]) is again
    assert (again.options.prior, again.options.share) == (3.0, ["tendons"])
    with pytest.raises(ValueError, match="no parameter 'colour'"):
        again.set_params(colour=1)
    assert "prior=3.0" in repr(again) and "holdout" not in repr(again)
    with pytest.raises(InputError, match="not fitted yet"):
        again.predict(made_recording())
    with pytest.raises(InputError, match="not fitted yet"):
        again.description_text()


def test_one_pattern_may_be_a_string() -> None:
    fit = shared(only="joints[1].friction", share=(), max_passes=2).fit(made_recording())
    assert set(fit.parameters_) == {
        f"joints[1].friction.{key}" for key in ("static", "coulomb", "stribeck_velocity")
    } | {path for path in fit.parameters_ if path == "joints[1].friction.viscous"}
    assert fit.report_["options"]["only"] == ["joints[1].friction"]


def test_the_page_s_example_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    page = (ROOT / "docs" / "reference" / "commands" / "fit.md").read_text(encoding="utf-8")
    (code,) = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    monkeypatch.chdir(tmp_path)
    Path("finger.json").write_text(json.dumps(small_finger()))
    for seed, day in ((1, "monday"), (2, "tuesday"), (5, "wednesday")):
        write_recording(made_recording(seed=seed), Path(f"{day}.parquet"))
    exec(compile(code, "fit.md", "exec"), {})
    assert native.image_from_json(Path("fitted.json").read_bytes())


@pytest.mark.parametrize("cost", [np.inf, np.nan])
def test_what_was_stopped_in_the_first_pass_can_be_read_again(cost: float, tmp_path: Path) -> None:
    """No cost is known then, and JSON has neither inf nor nan."""
    left = Unfinished("small", "batch", np.ones(1), ["joints[1].friction.coulomb"], cost, {}, small_finger())
    assert np.isnan(read_unfinished(write_unfinished(tmp_path / "fitted.json", left)).cost)


def test_a_stopped_fit_is_marked_and_goes_on(tmp_path: Path) -> None:
    """Long enough that a pass takes over 50 ms: `fit` reports progress that often."""
    recording = [made_recording(duration=40.0)] * 4
    whole = shared(moved_start(), threads=1).fit(recording)

    def stop(progress: Any) -> bool:
        return progress.iteration < 3

    stopped = shared(moved_start(), progress=stop, threads=1).fit(recording)
    assert not stopped.finished_ and not hasattr(stopped, "description_")
    assert stopped.unfinished_ is not None
    native.image_from_json(json.dumps(stopped.unfinished_.description))
    file = write_unfinished(tmp_path / "fitted.json", stopped.unfinished_)
    assert file.name == "fitted.unfinished.json"
    assert json.loads(file.read_text())["format"] == "tendonfmu-fit-unfinished-1"
    resumed = shared(moved_start(), start=file).fit(recording)
    assert resumed.cost_ == pytest.approx(whole.cost_, rel=1e-6)
    assert resumed.z_ == pytest.approx(whole.z_, rel=0.05)
    with pytest.raises(InputError, match="the interrupted fit has 25 unknowns, this fit has 70"):
        shared(moved_start(), start=file, share=[]).fit(recording)
