"""Parts of a diagnosis on made recordings: predicted forces, starting points, errors online, and one whole search."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from fit_cases import plain
from fit_data import make_recording, wavy_forces, wavy_motion
from repetitions import repeated
from tendonfmu.diagnosis.cause import Cause, Where, with_error
from tendonfmu.diagnosis.cause_gains import merged
from tendonfmu.diagnosis.diagnosis import PHASES
from tendonfmu.diagnosis.effects import Place, Term, by_name
from tendonfmu.diagnosis.effects.shapes import is_spring, usual_time
from tendonfmu.diagnosis.extension_fit import FitSettings, FittedModel, fit_numbers
from tendonfmu.diagnosis.gain import OnlineError
from tendonfmu.diagnosis.least_sizes import LeastSizes
from tendonfmu.diagnosis.search import ExtensionSearch, Trial, search
from tendonfmu.diagnosis.signal_choice import choose, delay_of_positions, least_sizes, scan
from tendonfmu.diagnosis.span import span_of
from tendonfmu.diagnosis.view import bias_of, predicted_of, series_of
from tendonfmu.model.description import Finger
from tendonfmu.model.friction_places import moment_arms
from tendonfmu.model.native import Instance
from tendonfmu.recordings import make_grid
from tendonfmu.recordings.prepared import FitRecording, Held, prepare
from tendonfmu.recordings.recording import Recording
from tendonfmu.statistics.splines import residual_of
from tendonfmu.tasks.phases import Phases

Numbers = NDArray[np.float64]
RATE = 200.0  # Hz
STIFFNESS = 4000.0  # N/m


def finger() -> dict[str, Any]:
    arms = [[0.009, 0.006], [0.009, -0.006], [-0.008, 0.005], [-0.008, -0.005]]
    tendons = [
        {"name": f"t{i}", "stiffness": STIFFNESS, "moment_arms": row, "edge_friction": [plain(0.03, 0.004), None]}
        for i, row in enumerate(arms, start=1)
    ]
    return {
        "format": "tendonfmu-finger-1", "name": "nominal", "tendons": tendons,
        "joints": [{"name": "a", "friction": plain(0.006, 0.08)}, {"name": "b", "friction": plain(0.004, 0.08)}],
        "bias": {"drift_variance": 1e-6, "noise_std": 0.002, "forget_rate": 3.0}, "contact": {"threshold": [1.0, 1.0]},
    }  # fmt: skip


def described(data: Mapping[str, Any]) -> Finger:
    return Finger(Path("finger.json"), data)


def recorded(truth: Mapping[str, Any], seed: int, source: int, seconds: float = 40.0, delay: int = 0) -> FitRecording:
    """Made by the core; the noise is in the forces, which are measured `delay` samples late (early where negative)."""
    motion = wavy_motion(seed, seconds, RATE, 2)
    made = make_recording(truth, motion, wavy_forces(seed, motion["time"], 4), seed, noise_in_forces=True)
    groups = dict(made.recording)
    time = groups.pop("time")
    kept = slice(50, len(time) - 50)
    groups["tendon_force"] = np.roll(groups["tendon_force"], delay, axis=0)
    inner = {name: values[kept] for name, values in groups.items()}
    recording = Recording(Path("made.parquet"), time[kept] - time[50], inner)
    return prepare(described(finger()), recording, source, Held())


def with_cover() -> dict[str, Any]:
    truth = copy.deepcopy(finger())
    truth["joints"][1]["cover"] = {"stiffness": 0.02}
    return truth


@pytest.fixture(scope="module")
def hidden() -> FitRecording:
    """40 s in which the second joint has a cover that the description lacks."""
    return recorded(with_cover(), 21, 3)


@pytest.fixture(scope="module")
def sound() -> FitRecording:
    """40 s of what the description describes, by tendon positions."""
    return recorded(finger(), 22, 1)


# --- forces as the model predicts them --------------------------------------------------------------------------------


def test_predicted_forces_lack_exactly_the_unexplained_torque(hidden: FitRecording) -> None:
    grid = make_grid([hidden])
    series = series_of(finger(), [hidden], grid)
    predicted = predicted_of(finger(), [hidden], grid, series)[0]
    arms = moment_arms(finger())
    taken = (hidden.recording.groups["tendon_force"] - predicted.recording.groups["tendon_force"]) @ arms
    nothing = np.zeros((*series.target.shape, 0))
    left = residual_of(series, bias_of(finger(), series), nothing)
    blocks = grid.segments[0].mean(taken[grid.segments[0].part])
    assert np.abs(blocks - left).max() < 0.2 * left.std()
    assert np.corrcoef(blocks[:, 0], left[:, 0])[0, 1] > 0.99
    stretch = (hidden.recording.groups["tendon_position"] - predicted.recording.groups["tendon_position"]) * STIFFNESS
    force = hidden.recording.groups["tendon_force"] - predicted.recording.groups["tendon_force"]
    assert np.allclose(stretch, force, atol=1e-9), "angles stay as they were measured"


@pytest.mark.parametrize("delay", [0.02, -0.015])
def test_angles_stay_as_the_core_sees_them_where_forces_are_late(delay: float, sound: FitRecording) -> None:
    data = finger() | {"extensions": [{"effect": "time_delay", "delay": delay}]}
    grid = make_grid([sound])
    series = series_of(data, [sound], grid)
    predicted = predicted_of(data, [sound], grid, series)[0]
    before, after = (Instance.from_description(data, 1).run(each.recording.arrays()) for each in (sound, predicted))
    inside = slice(20, -20)  # a delay has no force to pair with at the ends
    # interpolated between samples: a millionth of a radian
    assert np.abs(after["joint_angle"] - before["joint_angle"])[inside].max() < 2e-6
    change = sound.recording.groups["tendon_force"] - predicted.recording.groups["tendon_force"]
    assert np.abs(change).max() / STIFFNESS / 0.009 > 1e-5, "uncorrected it would be seen"


# --- where it starts --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("samples", [4, -3])
def test_positions_and_forces_tell_their_delay(samples: int) -> None:
    made = recorded(finger(), 23, 1, 20.0, samples)
    assert delay_of_positions(finger(), [made]) == pytest.approx(samples / RATE, abs=5e-4)


def test_no_more_tendons_than_joints_tell_no_delay(sound: FitRecording) -> None:
    data = finger()
    data["tendons"] = data["tendons"][1:3]
    groups = {name: values[:, 1:3] if "tendon" in name else values for name, values in sound.recording.groups.items()}
    few = replace(sound, recording=replace(sound.recording, groups=groups))
    assert delay_of_positions(data, [few]) is None


def scanned(made: FitRecording) -> Any:
    grid = make_grid([made])
    nominal = fit_numbers(finger(), [made], FitSettings(threads=1))
    return scan(nominal.data, [made], grid, 0.004)


@pytest.mark.parametrize(("samples", "source"), repeated([(0, 3), (4, 3), (-4, 3), (4, 1)], 1, 2))
def test_the_scan_starts_at_the_true_delay(samples: int, source: int) -> None:
    starts = scanned(recorded(finger(), 24, source, 20.0, samples))
    assert starts[0].delay == pytest.approx(samples / RATE, abs=0.6 / RATE)
    assert starts[0].presliding == () or source == 1  # noise of the forces is noise of those angles
    assert [each.error for each in starts] == sorted(each.error for each in starts)
    assert any(each.delay == 0.0 and each.presliding == () for each in starts)


def test_the_scan_starts_with_presliding_where_there_is_some() -> None:
    distance = 0.1  # s times the thresholds: 0.4 mm, 8 mrad
    truth = finger() | {"extensions": [{"effect": "presliding", "displacement": distance}]}
    starts = scanned(recorded(truth, 25, 3, 20.0))
    assert [each.place for each in starts[0].presliding] == [Place()]
    assert distance / 5.0 < starts[0].presliding[0].shape["displacement"] < 5.0 * distance
    without = min(each.error for each in starts if not each.presliding)
    assert starts[0].error < 0.7 * without


def test_the_scan_finds_joints_that_are_softer_than_their_tendons() -> None:
    soft = [{"effect": "presliding", "joint": j, "displacement": 0.05} for j in (1, 2)]
    truth = finger() | {"extensions": [{"effect": "presliding", "displacement": 0.05}, *soft]}  # 25 µm at tendons
    starts = scanned(recorded(truth, 25, 3, 20.0))
    assert [each.place for each in starts[0].presliding] == [Place(), Place(joint=1), Place(joint=2)]


def test_negative_friction_is_no_cause() -> None:
    rows = [
        {"effect": "load_friction", "joint": 1, "tendon": i, "coulomb": size} for i, size in ((1, 1e-4), (2, -2e-4))
    ]
    terms = [Term(by_name("load_friction"), Place(1, i)) for i in (1, 2)]
    least = LeastSizes(np.zeros(2), np.zeros(2), 0.005, 0.0)
    assert not least.shows_all("load_friction", terms, finger() | {"extensions": rows})
    assert least.shows_all("load_friction", terms[:1], finger() | {"extensions": rows})


def test_least_sizes_follow_the_sensors(sound: FitRecording) -> None:
    rng = np.random.default_rng(2)
    groups = dict(sound.recording.groups)
    groups["tendon_position"] = groups["tendon_position"] + 1e-5 * rng.standard_normal(groups["tendon_position"].shape)
    noisy = prepare(described(finger()), replace(sound.recording, groups=groups), 1, Held())
    before, after = (least_sizes(finger(), [each], 0.005) for each in (sound, noisy))
    assert after.tendon_noise == pytest.approx(np.hypot(before.tendon_noise, 1e-5 * np.sqrt(0.85)), rel=0.15)
    assert np.all(after.joint_noise > 2.0 * before.joint_noise)
    assert after.least("time_delay", None, None) == pytest.approx(0.75 * 0.005)


# --- as it runs online ------------------------------------------------------------------------------------------------


def test_the_online_error_sees_what_the_bias_filter_follows(hidden: FitRecording) -> None:
    """A spring is slow: r shows a part of what the means of 10 ms show."""
    left = np.sum(np.nan_to_num(hidden.run(finger()).residual) ** 2, axis=1)
    error = OnlineError(finger(), [hidden])
    assert error.square(finger()) == pytest.approx(left[hidden.train].sum(), rel=1e-9)
    found, better = error.by_stretch(finger()), error.by_stretch(with_cover())
    assert len(found) == pytest.approx(hidden.time[-1] / 2.0, abs=1.0)
    assert better.sum() / found.sum() < error.square(with_cover()) / error.square(finger()) < 1.0


def test_what_is_not_trained_on_is_not_judged(hidden: FitRecording) -> None:
    half = replace(hidden, train=hidden.train & (hidden.time < 20.0))
    spoilt = dict(half.recording.groups)
    spoilt["tendon_force"] = spoilt["tendon_force"] + 5.0 * (half.time >= 20.0)[:, None]
    other = prepare(described(finger()), replace(half.recording, groups=spoilt), 3, Held())
    other = replace(other, train=half.train)
    one, two = (OnlineError(finger(), [each]) for each in (half, other))
    assert one.by_stretch(finger()) == pytest.approx(two.by_stretch(finger()), rel=1e-9)
    assert one.square(finger()) == pytest.approx(two.square(finger()), rel=1e-9)


# --- causes -----------------------------------------------------------------------------------------------------------


def named(effect: str, place: Place, p_value: float, *others: str) -> Cause:
    return Cause(
        Where(effect, place.joint, place.tendon),
        p_value=p_value,
        gain=with_error(0.1, 0.01),
        terms=(Term(by_name(effect), place, {}, (1.0,)),),
        alike=tuple(Cause(Where(each, 1)) for each in others),
    )


def test_places_of_one_effect_are_one_cause() -> None:
    found = merged(
        [
            named("load_friction", Place(1, 1), 1e-3, "moment_arm", "force_gain"),
            named("gravity", Place(1), 1e-2),
            named("load_friction", Place(1, 2), 1e-6, "force_gain", "gravity", "inertia"),
            named("gravity", Place(2), 1e-4),
        ]
    )
    load, gravity = found
    assert load.key == ("load_friction", 1, None) and gravity.key == ("gravity", None, None)
    assert [each.place for each in load.terms] == [Place(1, 1), Place(1, 2)]
    assert load.p_value == 1e-6
    # each of the places has its own rivals; what is named itself is none
    assert [each.effect for each in load.alike] == ["moment_arm", "force_gain", "inertia"]


@pytest.mark.long
def test_a_hidden_spring_is_found_and_fitted(hidden: FitRecording) -> None:
    given, seen = described(finger()), list[str]()
    chosen = choose(given, [hidden], FitSettings(threads=1))
    phases = Phases(PHASES, lambda state: seen.append(state.words))
    found = search(given, [hidden], chosen, least_gain=0.03, seed=1, phases=phases)
    first = found.causes[0]
    assert ("cover_stiffness", 2, None) in [first.key, *(each.key for each in first.alike)]
    assert len(found.causes) == 1 and len(found.models) == 2
    assert first.p_value < 1e-3
    if first.effect == "cover_stiffness":
        assert found.extended.data["joints"][1]["cover"]["stiffness"] == pytest.approx(0.02, rel=0.2)
    used = found.last.series.used
    assert np.mean(found.last.residual[used] ** 2) < np.mean(found.first.residual[used] ** 2)
    assert "causes" in seen and "contact" in seen


class Fitted(ExtensionSearch):
    """Rounds whose fits leave what is said here, by effect; None: the fit bears nothing out."""

    def __init__(self, errors: Mapping[str, float | None], causes: Sequence[str] = ()) -> None:
        self.errors, self.tried = errors, list[str]()
        self.causes = [named(each, Place(), 1e-9) for each in causes]

    def _named(self, cause: Cause, selection: Any) -> Cause:
        return replace(named(cause.effect, Place(1), 1e-9), direction=cause.direction)

    def _tried(self, cause: Cause) -> Trial:
        self.tried.append(cause.effect)
        error = self.errors[cause.effect]
        noise = np.random.default_rng(3).uniform(0.9, 1.1, 20)
        model = None if error is None else FittedModel({}, {}, {}, 0.0)
        return Trial(cause, model, np.array([np.inf]) if error is None else error * noise)


@pytest.mark.parametrize(
    ("error", "taken"), [(np.tile([0.88, 0.92], 10), True), (np.tile([0.4, 1.4], 10), False)], ids=["even", "scattered"]
)
def test_a_fit_is_taken_where_the_error_falls_beyond_chance(error: Numbers, taken: bool) -> None:
    """The rms falls by 5 %, in each stretch, or much in some while it grows in others."""
    rounds, model = Fitted({}), FittedModel({}, {}, {}, 0.0)
    rounds.models, rounds._least_gain = [], 0.03
    rounds.view = SimpleNamespace(selection=SimpleNamespace(base=np.ones(20)), lean=None)  # type: ignore[assignment]
    rounds._runs_better = lambda model: True  # type: ignore[method-assign]
    rounds._look = lambda model, candidates: rounds.view  # type: ignore[method-assign]
    assert rounds._take(Trial(named("gravity", Place(1), 1e-9), model, error)) is taken
    assert len(rounds.causes) == len(rounds.models) == int(taken)


def test_presliding_as_long_as_the_motion_is_a_spring(hidden: FitRecording) -> None:
    span = span_of(finger(), [hidden])
    for share, spring in ((0.01, False), (0.3, True)):
        everywhere = {"effect": "presliding", "displacement": share * usual_time(finger(), span)}
        assert is_spring({**finger(), "extensions": [everywhere]}, span) == spring
        joint = {"effect": "presliding", "joint": 1, "displacement": share * float(span.travel[0])}
        assert is_spring({**finger(), "extensions": [joint]}, span) == spring
    assert not is_spring(finger(), span)
