"""FrictionFit: what it finds, how well it says that it knows it, and its options."""

from __future__ import annotations

import copy
import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fit_cases import small_finger
from fit_finger import asymmetric_finger, made_recording, moved_start
from tendonfmu.errors import InputError
from tendonfmu.estimate.fitting import FrictionFit
from tendonfmu.estimate.structure import with_sides
from tendonfmu.model import get_number, native, set_number

pytestmark = pytest.mark.filterwarnings("ignore::tendonfmu.estimate.fitting.FitWarning")

Groups = dict[str, np.ndarray[Any, Any]]

PULLEY_WITHOUT_DROP = json.loads(json.dumps(small_finger()))
PULLEY_WITHOUT_DROP["tendons"][0]["pulley_friction"][0]["static"] = 0.02


def shared(finger: Any = None, **options: Any) -> FrictionFit:
    """All tendons alike: 19 unknowns, 70 numbers."""
    return FrictionFit(
        finger or small_finger(), **({"share": ["tendons"], "kinematics": 3, "tolerance": 1e-3} | options)
    )


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
    innovations = fit.report_["innovations"]
    residual = fit.report_["residual"]
    for entry in (residual["train"], residual["held_out"], *residual["comparisons"]):
        assert entry["rms"] == pytest.approx([3e-3] * 2, rel=0.1)  # noise_std, and what the bias has not found yet
        rising = [entry[key] for key in ("rms", "start_rms", "bias_only_rms", "torque_rms")]
        assert (np.diff(rising, axis=0) > 0).all()
    assert innovations["nis"]["consistent"]
    assert all(abs(value) < 0.03 for value in innovations["whiteness"]["lag_one"])
    assert all(value > 1e-3 for value in innovations["whiteness"]["ljung_box_p"])


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


def test_the_fitted_description_is_one_and_keeps_all_else(fit: FrictionFit) -> None:
    text = fit.description_.text
    native.image_from_json(text)
    fitted, start = json.loads(text), json.loads(json.dumps(moved_start()))
    for path, value in fit.parameters_.items():
        assert get_number(fitted, path) == value
        set_number(fitted, path, 0.0)
        set_number(start, path, 0.0)
    known = fitted.pop("estimated")
    assert fitted == start
    assert list(fitted) == list(start)
    assert len(text.splitlines()) < 130 + len(known)  # a law is a line, and a known number


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


# --- the filter -------------------------------------------------------------------------------------------------------


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


# --- why a number is not identified -----------------------------------------------------------------------------------


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


@pytest.mark.parametrize(("share", "length", "blocks"), [(0.2, 4.0, [(4, 5), (9, 10)]), (0.5, 10.0, [(1, 2), (3, 4)])])
def test_held_out_blocks_are_spread_evenly(share: float, length: float, blocks: list[tuple[int, int]]) -> None:
    """A block of 10 s at most, and short enough that there are two. length: s, of a block."""
    fit = shared(holdout=share, passes=1, tolerance=0.5).fit(made_recording(duration=40.0))
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


def test_what_scales_the_measured_torque_stays() -> None:
    """A gain of -1 would leave no torque, and so no error: motion does not tell it."""
    finger = small_finger()
    finger["extensions"] = [{"effect": "force_gain", "tendon": 1, "correction": -0.02}]
    path = "extensions[1].correction"
    free = shared(finger, threads=1).fit(made_recording())
    asked = shared(finger, threads=1, share=[], only=[path]).fit(made_recording())
    assert path not in free.parameters_ and get_number(free.description_.data, path) == -0.02
    assert list(asked.parameters_) == [path]


@pytest.mark.parametrize("remembers", [False, True])
def test_a_described_delay_stays_where_friction_remembers(remembers: bool) -> None:
    """That imitates a delay; what positions showed of it, as `diagnose` writes it, would be lost."""
    finger = small_finger()
    memory = [{"effect": "presliding", "displacement": 0.2}] if remembers else []
    finger["extensions"] = [{"effect": "time_delay", "delay": 0.004}, *memory]
    path = "extensions[1].delay"
    free = shared(finger, passes=1, tolerance=0.5).fit(made_recording())
    assert (path in free.parameters_) != remembers
    assert (get_number(free.description_.data, path) == 0.004) == remembers
    if remembers:
        asked = shared(finger, share=[], only=[path], passes=1, tolerance=0.5).fit(made_recording())
        assert list(asked.parameters_) == [path]


@pytest.mark.parametrize(
    ("share", "unknowns"),
    [(["tendons"], 19 + 6), (["tendons[*].pulley_friction[*]"], 10 + 4 + 4 * 11), ([], 70)],
)
def test_shared_laws_share_their_numbers(share: list[str], unknowns: int) -> None:
    fit = FrictionFit(small_finger(), share=share, kinematics=3, passes=2, tolerance=0.5).fit(made_recording())
    assert len(fit.z_) == unknowns
    first = fit.parameters_["tendons[1].pulley_friction[1].coulomb"]
    same = fit.parameters_["tendons[3].pulley_friction[1].coulomb"] == first
    assert same == any("tendons" in each for each in share)


def test_laws_that_share_start_from_their_mean() -> None:
    finger = json.loads(json.dumps(small_finger()))
    finger["tendons"][0]["pulley_friction"][0]["coulomb"] = 0.01
    fit = shared(finger, only=["*pulley*"], passes=1, tolerance=0.5).fit(made_recording())
    assert fit.start_.data["tendons"][2]["pulley_friction"][0]["coulomb"] == pytest.approx((0.01 + 3 * 0.02) / 4)


@pytest.mark.long
def test_two_sides_are_told_apart() -> None:
    recording = made_recording(duration=60.0, asymmetric=True)
    fit = shared(asymmetric=True, only=["joints[*]"], share=[]).fit(recording)
    truth = with_sides(asymmetric_finger(), "asymmetric")
    assert len(fit.z_) == 18
    errors = [(v - get_number(truth, path)) / fit.standard_errors_[path] for path, v in fit.parameters_.items()]
    assert np.abs(errors).max() < 4.5
    rough, smooth = (f"joints[1].friction.{side}.viscous" for side in ("negative", "positive"))
    assert fit.parameters_[rough] - fit.parameters_[smooth] > 5 * fit.standard_errors_[rough]
    one = shared(asymmetric_finger(), asymmetric=False, only=["joints[*]"], share=[]).fit(recording)
    assert one.report_["residual"]["train"]["rms"][0] > fit.report_["residual"]["train"]["rms"][0]
    law = one.description_.data["joints"][0]["friction"]
    assert set(law) == {"static", "coulomb", "stribeck_velocity", "viscous"}


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


# --- manners ----------------------------------------------------------------------------------------------------------


# --- why a number is not identified -----------------------------------------------------------------------------------


def one_way(groups: Groups) -> None:
    np.abs(groups["joint_velocity"], out=groups["joint_velocity"])


def beyond_all_points(groups: Groups) -> None:
    groups["joint_position"][:, 0] += 2.0  # the working points are at ±0.4 rad


def never_slow(groups: Groups) -> None:
    groups["joint_velocity"] += 0.8 * np.where(groups["joint_velocity"] >= 0, 1.0, -1.0)


@pytest.mark.parametrize(
    ("change", "path", "reason", "advice"),
    [
        (one_way, "joints[1].friction.negative.coulomb", "side", "move joint base both ways"),
        (
            beyond_all_points,
            "tendons[2].edge_friction[2].laws[1].coulomb",
            "working_point",
            "move joint tip while joint base is near -0.4 rad",
        ),
        (
            never_slow,
            "joints[1].friction.stribeck_velocity",
            "slow",
            r"let joint base turn round slowly: strokes at 0.01 to 0\.\d+ rad/s",
        ),
    ],
)
def test_the_report_says_why_a_number_is_not_identified(
    change: Callable[[Groups], None], path: str, reason: str, advice: str
) -> None:
    recording = made_recording()
    change(recording.groups)
    asymmetric = True if reason == "side" else None
    fit = shared(share=[], asymmetric=asymmetric, only=[path.split(".laws")[0].split(".negative")[0]]).fit(recording)
    entries = {entry["path"]: entry for entry in fit.report_["parameters"]}
    assert entries[path]["reason"] == reason
    assert entries[path]["advice"] == advice or re.fullmatch(advice, entries[path]["advice"])
    if reason == "side":
        assert entries[path.replace("negative", "positive")]["reason"] != "side"


# --- a bias that the description states -------------------------------------------------------------------------------


def test_an_initial_bias_in_the_description_is_estimated() -> None:
    finger = small_finger()
    finger["bias"]["initial_torque"] = [0.0, 0.0]
    recording = made_recording()
    recording.groups["external_torque"] -= [0.05, -0.03]  # y gains as much
    found = shared(finger).fit(recording).description_.data["bias"]["initial_torque"]
    assert found == pytest.approx([0.05, -0.03], abs=5e-3)


def test_an_initial_bias_near_zero_is_identified_by_its_own_error() -> None:
    finger = small_finger()
    finger["bias"].update(initial_torque=[0.0, 0.0], initial_variance=1e-8, drift_variance=1e-9, noise_std=0.01)
    recording = made_recording()
    recording.groups["external_torque"] += 0.002  # brings the estimate to 0
    fit = shared(finger, effective_samples=False).fit(recording)
    (bias,) = (entry for entry in fit.report_["parameters"] if entry["path"] == "bias.initial_torque[2]")
    assert abs(bias["value"]) < 2 * bias["standard_error"] < 0.2 * 0.01
    assert bias["identified"]


# --- options and manners ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"only": ["tendons[9]"]}, "--only tendons[9]: matches none of the 70 numbers"),
        ({"fix": "*.colour"}, "--fix *.colour: matches none"),
        ({"fix": ["*"]}, "no number is left"),
        ({"scale": ["joints[1].friction"]}, "expected PATTERN=VALUE"),
        ({"scale": ["joints[1].friction.static=-1"]}, "expected PATTERN=VALUE"),
        ({"share": ["fingers"]}, "--share fingers: matches none"),
        ({"start": "left.json", "method": "ekf"}, "start: expected none with method ekf"),
        ({"drift": 1e-3}, "drift = 0.001: expected 0 with method batch"),
        ({"finger": PULLEY_WITHOUT_DROP}, "without (static = coulomb); expected laws of the same structure"),
    ],
)
def test_options_that_make_no_sense_are_refused(options: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError) as refused:
        shared(**options).fit(made_recording())
    assert words in str(refused.value)


def test_what_is_not_fitted_says_so() -> None:
    fit = FrictionFit(small_finger(), prior=2.0)
    for not_fitted in (lambda: fit.predict(made_recording()), fit.picture):
        with pytest.raises(InputError, match="not fitted yet"):
            not_fitted()


@pytest.mark.parametrize("method", [pytest.param("batch", marks=pytest.mark.long), "ekf"])
def test_a_stopped_fit_is_marked_and_another_goes_on_from_its_finger(method: str, tmp_path: Path) -> None:
    """Several recordings, so that a pass takes over 50 ms: `fit` reports progress that often."""
    recording = [made_recording(duration=40.0)] * (4 if method == "batch" else 1)

    def goes_on(now: Any) -> bool:
        return now.iteration < 3 if method == "batch" else now.done < now.total / 2

    stopped = shared(moved_start(), method=method, progress=goes_on).fit(recording)
    assert not stopped.finished_ and not hasattr(stopped, "description_")
    assert stopped.unfinished_ is not None
    whole = shared(moved_start(), method=method).fit(recording)
    if method == "batch":
        stopped.unfinished_.write(tmp_path / "left.json")
        again = shared(moved_start(), start=tmp_path / "left.json").fit(recording)
    else:
        again = shared(stopped.unfinished_, method=method).fit(recording)
    assert away(again, whole) < (0.1 if method == "batch" else 2.0)


def away(one: FrictionFit, other: FrictionFit) -> float:
    """The largest difference of what `other` has identified, in its standard errors."""
    known = [entry["path"] for entry in other.report_["parameters"] if entry["identified"]]
    return max(abs(one.parameters_[path] - other.parameters_[path]) / other.standard_errors_[path] for path in known)


def test_where_a_fit_starts_is_not_what_is_known_before(tmp_path: Path) -> None:
    """At the end of a fit with a wide prior, data ask for nothing: as prior, its numbers would stay."""
    wide = shared(moved_start(), prior=1.0).fit(made_recording())
    wide.description_.write(tmp_path / "wide.json")
    whole, again = (
        shared(moved_start(), start=start).fit(made_recording()) for start in (None, tmp_path / "wide.json")
    )
    assert away(again, whole) < 0.1 < away(wide, whole)


def test_numbers_that_wander_are_known_less() -> None:
    recording = made_recording()
    still, wandering = (shared(method="ekf", drift=drift).fit(recording) for drift in (0.0, 1e-2))
    linear = np.array([unknown.role != "rate" for unknown in still.unknowns_])
    ratio = np.diag(wandering.z_covariance_) / np.diag(still.z_covariance_)
    assert np.median(ratio[linear]) > 1.3
