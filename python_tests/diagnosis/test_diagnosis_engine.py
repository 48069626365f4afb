"""Parts of a diagnosis on made recordings: predicted forces, starting points, and one whole search."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid

from fit_cases import plain
from fit_data import make_recording, wavy_forces, wavy_motion
from repetitions import repeated
from tendonfmu.diagnosis import base as base_module
from tendonfmu.diagnosis import search as search_module
from tendonfmu.diagnosis.base import find_base
from tendonfmu.diagnosis.delay import Positions
from tendonfmu.diagnosis.diagnosis import PHASES
from tendonfmu.diagnosis.effects import Place, Term, Where, by_name
from tendonfmu.diagnosis.extension_diagnosis import merged
from tendonfmu.diagnosis.extension_fit import FitSettings, FittedModel
from tendonfmu.diagnosis.result import with_error
from tendonfmu.diagnosis.samples import Samples, as_described, corrected_arms, predicted_forces
from tendonfmu.diagnosis.search import ExtensionSearch, Trial, search
from tendonfmu.diagnosis.selection import Judged, LeastSizes, least_sizes
from tendonfmu.model.description import Finger
from tendonfmu.model.native import Instance
from tendonfmu.recordings.prepared import FitRecording, Held, prepare
from tendonfmu.recordings.recording import Recording
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
        "bias": {"drift_variance": 1e-10, "noise_std": 0.002, "forget_rate": 0.0}, "contact": {"threshold": [1.0, 1.0]},
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


def shrunk(share: float) -> dict[str, Any]:
    """The finger with so much of its torque, and of its friction."""
    data = finger()
    data["extensions"] = [{"effect": "force_gain", "tendon": i, "correction": share - 1.0} for i in range(1, 5)]
    edges = [law for tendon in data["tendons"] for law in tendon["edge_friction"] if law]
    for law in [*edges, *(joint["friction"] for joint in data["joints"])]:
        law.update({key: value if key == "stribeck_velocity" else share * value for key, value in law.items()})
    return data


@pytest.mark.parametrize("share", [1.0, 0.5])
def test_predicted_forces_lack_exactly_the_unexplained_torque(share: float, hidden: FitRecording) -> None:
    data = shrunk(share)
    predicted, samples = predicted_forces(data, [hidden])[0], Samples.of(data, [hidden])
    arms = corrected_arms(data)
    taken = (hidden.recording.groups["tendon_force"] - predicted.recording.groups["tendon_force"]) @ arms
    blocks, left = samples.grid.means([taken])[samples.used], samples.drift.without(samples.left(data))
    assert np.abs(blocks - blocks.mean(axis=0) - left).max() < 0.05 * left.std()
    stretch = (hidden.recording.groups["tendon_position"] - predicted.recording.groups["tendon_position"]) * STIFFNESS
    force = hidden.recording.groups["tendon_force"] - predicted.recording.groups["tendon_force"]
    assert np.allclose(stretch, force, atol=1e-9), "angles stay as they were measured"
    # with them a model leaves as much as with the measured ones
    at = samples.at_predicted_forces(data)
    assert (at.drift.without(at.left(data)) - left).std() < 0.2 * left.std()


def test_less_torque_leaves_no_less(hidden: FitRecording) -> None:
    samples = Samples.of(finger(), [hidden])
    whole, half = (as_described(samples.residual(shrunk(share)), shrunk(share)) for share in (1.0, 0.5))
    assert half == pytest.approx(whole, abs=1e-9)


@pytest.mark.parametrize("delay", [0.02, -0.015])
def test_angles_stay_as_the_core_sees_them_where_forces_are_late(delay: float, sound: FitRecording) -> None:
    data = finger() | {"extensions": [{"effect": "time_delay", "delay": delay}]}
    predicted = predicted_forces(data, [sound])[0]
    before, after = (Instance.from_description(data, 1).run(each.recording.arrays()) for each in (sound, predicted))
    inside = slice(20, -20)  # a delay has no force to pair with at the ends
    # interpolated between samples: a millionth of a radian
    assert np.abs(after["joint_angle"] - before["joint_angle"])[inside].max() < 2e-6
    change = sound.recording.groups["tendon_force"] - predicted.recording.groups["tendon_force"]
    assert np.abs(change).max() / STIFFNESS / 0.009 > 1e-5, "uncorrected it would be seen"


# --- where it starts --------------------------------------------------------------------------------------------------

HARDENING, LATE = 4e5, 4  # N/m², samples
BENT = [{"effect": "tendon_nonlinearity", "tendon": i, "hardening": HARDENING} for i in range(1, 5)]


@pytest.mark.parametrize("samples", [4, -3])
def test_positions_and_forces_tell_their_delay(samples: int) -> None:
    made = recorded(finger(), 23, 1, 20.0, samples)
    shown = Positions(described(finger()), [made])
    assert shown.delay == pytest.approx(samples / RATE, abs=max(4.0 * shown.error, 1e-5))
    assert 0.0 < shown.error < 1e-4


@pytest.mark.parametrize(("kinematics", "delay"), [(1, 0.0), (2, LATE / RATE)])
def test_encoders_of_another_clock_tell_their_delay(kinematics: int, delay: float, sound: FitRecording) -> None:
    """It matters where the angles are theirs: forces and positions of the tendons come later than these."""
    groups = sound.recording.groups
    late = {name: np.roll(groups[name], LATE, axis=0) for name in ("tendon_force", "tendon_position")}
    made = replace(sound.with_groups(**late), kinematics=kinematics)
    shown = Positions(described(finger()), [made])
    if kinematics == 1:
        assert shown.delay is None or abs(shown.delay) < 5e-4
    else:
        inside = made.train & (made.time > made.time[2 * LATE]) & (made.time < made.time[-2 * LATE])
        assert shown.delay == pytest.approx(delay, abs=5e-4) and shown.gain([(made, inside)], delay, 0).low > 0.5


@pytest.mark.parametrize(
    "row",
    [
        {"effect": "moment_arm_variation", "slope": 2e-3, "correction": -4e-4},
        {"effect": "pulley_eccentricity", "sine": 1e-3, "cosine": 5e-4, "turns": 2.0},
    ],
    ids=str,
)
def test_encoders_contradict_an_arm_that_changes_at_another_tendon(row: dict[str, Any], sound: FitRecording) -> None:
    arms, given = np.linspace(-0.3, 1.2, 2001), sound.recording.groups
    angle, change = given["joint_position"][:, 1], row.get("slope", 0.0) * arms + row.get("correction", 0.0)
    turned = row.get("turns", 1.0) * arms
    change = change + row.get("sine", 0.0) * np.sin(turned) + row.get("cosine", 0.0) * np.cos(turned)
    travel = cumulative_trapezoid(change, arms, initial=0.0)
    moved = given["tendon_position"].copy()
    moved[:, 2] += np.interp(angle, arms, travel)
    shown = Positions(described(finger()), [replace(sound.with_groups(tendon_position=moved), kinematics=2)])
    here, there = (finger() | {"extensions": [row | {"joint": 2, "tendon": i}]} for i in (3, 4))
    assert shown.contradict(finger(), there) and shown.contradict(here, finger())
    assert not shown.contradict(finger(), here)


def test_no_more_tendons_than_joints_tell_no_delay(sound: FitRecording) -> None:
    data = finger()
    data["tendons"] = data["tendons"][1:3]
    groups = {name: values[:, 1:3] if "tendon" in name else values for name, values in sound.recording.groups.items()}
    encoders = replace(sound, recording=replace(sound.recording, groups=groups))
    few = replace(sound, recording=replace(sound.recording, groups={k: v for k, v in groups.items() if "tendon" in k}))
    assert Positions(described(data), [few]).delay is None
    assert Positions(described(data), [encoders]).delay == pytest.approx(0.0, abs=5e-4), "encoders tell it"
    for tendon in data["tendons"]:
        tendon["stiffness"] = 1e9
    late = np.roll(groups["joint_position"], 1, axis=0) @ corrected_arms(data).T
    rigid = replace(encoders.with_groups(tendon_position=late), kinematics=2)
    assert Positions(described(data), [rigid]).delay is None, "what does not give shows no force"


@pytest.fixture(scope="module")
def bent() -> FitRecording:
    made = recorded(finger(), 23, 1, 20.0, LATE)
    force = np.roll(made.recording.groups["tendon_force"], -LATE, axis=0)
    bent = 2.0 * force / (STIFFNESS + np.sqrt(STIFFNESS**2 + 4.0 * HARDENING * force)) - force / STIFFNESS
    return made.with_groups(tendon_position=made.recording.groups["tendon_position"] + bent)


def test_described_springs_that_are_not_linear_hide_no_delay(bent: FitRecording) -> None:
    """Taken for linear, they leave too much in the equation to tell it."""
    shown = Positions(described(finger() | {"extensions": BENT}), [bent])
    assert shown.delay == pytest.approx(LATE / RATE, abs=5e-4)
    assert Positions(described(finger()), [bent]).delay is None
    assert shown.gain([(bent, bent.train)], LATE / RATE, 0).low > 0.5
    assert shown.gain([(bent, bent.train)], -LATE / RATE, 0).high < 0.0


@pytest.mark.parametrize("row", [BENT[1], {"effect": "backlash", "tendon": 2, "width": 2e-4}], ids=str)
def test_tendons_contradict_a_spring_and_a_play_that_are_not_there(
    row: dict[str, Any], sound: FitRecording, bent: FitRecording
) -> None:
    linear, other = finger(), finger() | {"extensions": [row]}
    assert Positions(described(linear), [sound]).contradict(linear, other)
    assert not Positions(described(linear), [sound]).contradict(other, linear)
    if row in BENT:
        assert not Positions(described(linear), [bent]).contradict(linear, other)
    few = {name: values[:, 1:3] for name, values in sound.recording.groups.items() if "tendon" in name}
    alone = replace(sound, recording=replace(sound.recording, groups=few))
    data = [each | {"tendons": each["tendons"][1:3]} for each in (linear, other)]
    assert not Positions(described(data[0]), [alone]).contradict(*data), "two tendons of two joints cannot know"


def found_base(truth: Mapping[str, Any], seed: int, source: int, delay: int = 0) -> Any:
    made = recorded(truth, seed, source, 20.0, delay)
    return find_base(described(finger()), [made], FitSettings(threads=1), 0.03)


@pytest.mark.parametrize(("samples", "source"), repeated([(0, 3), (4, 3), (4, 1)], 1))
def test_a_search_starts_at_the_true_delay(samples: int, source: int) -> None:
    rows = found_base(finger(), 24, source, samples).model.data.get("extensions") or []
    found = sum(row["delay"] for row in rows if row["effect"] == "time_delay")
    assert found == pytest.approx(samples / RATE, abs=0.6 / RATE)


def test_positions_set_a_described_delay() -> None:
    """Friction that remembers imitates a delay, so no fit moves it."""
    made = recorded(finger(), 24, 1, 20.0, 4)
    data = finger() | {"extensions": [{"effect": "time_delay", "delay": 0.004}]}
    base = find_base(described(data), [made], FitSettings(threads=1), 0.03)
    for model in (base.nominal, base.model):
        (late,) = [row["delay"] for row in model.data["extensions"] if row["effect"] == "time_delay"]
        assert late == base.positions.delay == pytest.approx(4 / RATE, abs=5e-4)


def test_the_same_reference_is_fitted_once(hidden: FitRecording, monkeypatch: pytest.MonkeyPatch) -> None:
    """A history asks for it with every recording."""
    asked = []
    monkeypatch.setattr(base_module, "_found_base", lambda *given: asked.append(given) or len(asked))
    monkeypatch.setattr(base_module, "_LAST", {})
    given, settings = described(finger()), FitSettings(threads=1)
    train = hidden.train.copy()
    train[len(train) // 2] = False
    answers = [
        find_base(given, [hidden], settings, 0.03),
        find_base(described(finger()), [copy.deepcopy(hidden)], settings, 0.03),
        find_base(given, [replace(hidden, train=train)], settings, 0.03),
        find_base(described(with_cover()), [hidden], settings, 0.03),
        find_base(given, [hidden], settings, 0.05),
        find_base(given, [hidden], settings, 0.03),
    ]
    assert answers == [1, 1, 2, 3, 4, 5], "only the last one is kept"


def test_a_search_starts_with_the_memory_that_there_is() -> None:
    distance = 0.4  # s times the thresholds: 0.2 mm
    truth = finger() | {"extensions": [{"effect": "presliding", "displacement": distance}]}
    base = found_base(truth, 25, 3)
    assert "presliding" in {terms[0].mechanism.name for terms in base.start}
    left = [np.sum(base.samples.residual(model.data) ** 2) for model in (base.nominal, base.model)]
    assert left[1] < 0.5 * left[0]


def test_what_a_memory_explains_counts_from_friction_without_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """A described memory of a wrong form explains most of it; beside it, another form explains little."""
    remembering = {"extensions": [{"effect": "presliding", "displacement": 0.4}]}
    monkeypatch.setattr(ExtensionSearch, "_try_next", lambda *_: None)

    def explained(truth: Mapping[str, Any], *rows: Mapping[str, Any]) -> float:
        made = recorded({**truth, **remembering}, 25, 3, 20.0, 0)
        base = find_base(described(finger() | {"extensions": rows}), [made], FitSettings(threads=1), 0.03)
        searched = ExtensionSearch(base, 0.03)
        searched.run(lambda _: None)
        return searched.of_memory

    alone = explained(finger())
    assert alone > 0.0
    for row in ({"displacement": 0.3}, {"stiffness": 3e3}):
        assert explained(finger(), {"effect": "presliding", **row}) == pytest.approx(alone, rel=0.1)
    assert explained(with_cover()) == pytest.approx(alone, rel=0.1), "a missing cover is no memory"


@pytest.mark.parametrize("is_hidden", [False, True])
def test_a_described_memory_stays_where_a_cause_explains_more(is_hidden: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """The other memory is the described one under another name, which explains no more."""
    given = finger() | {"extensions": [{"effect": "presliding", "displacement": 0.4}]}
    truth = copy.deepcopy(given)
    if is_hidden:
        truth["joints"][0]["friction"]["static"] = 0.03
    other = ((Term(by_name("presliding"), Place(), {}),),)
    monkeypatch.setattr(base_module, "remembering", lambda described, nominal, *_: (nominal, list(other)))
    base = find_base(described(given), [recorded(truth, 25, 3, 20.0)], FitSettings(threads=1), 0.03)
    assert base.start == (() if is_hidden else other)


def test_position_dependent_torque_comes_first(hidden: FitRecording) -> None:
    base = find_base(described(finger()), [hidden], FitSettings(threads=1), 0.03)
    first = base.start[0][0]
    assert (first.mechanism.name, first.place.joint) in [("cover_stiffness", 2), ("gravity", 2)]


def test_negative_friction_is_no_cause() -> None:
    rows = [
        {"effect": "load_friction", "joint": 1, "tendon": i, "coulomb": size} for i, size in ((1, 1e-4), (2, -2e-4))
    ]
    terms = [Term(by_name("load_friction"), Place(1, i)) for i in (1, 2)]
    least = LeastSizes(np.zeros(2), np.zeros(2), 0.005, np.zeros(2))
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
    assert after.least(Where("time_delay")) == pytest.approx(0.75 * 0.005)
    torque = groups["tendon_force"] @ corrected_arms(finger())
    torque, angle = (np.abs(each[noisy.train]).max(axis=0) for each in (torque, noisy.model.joint_angle))
    assert after.heaviest == pytest.approx(torque / np.sin(angle))


# --- causes -----------------------------------------------------------------------------------------------------------


def named(effect: str, place: Place, p_value: float, *others: str) -> Judged:
    return Judged(
        Where(effect, place.joint, place.tendon),
        p_value=p_value,
        gain=with_error(0.1, 0.01),
        terms=(Term(by_name(effect), place, {}, (1.0,)),),
        alike=tuple(Judged(Where(each, 1)) for each in others),
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
    assert load.where == Where("load_friction", 1) and gravity.where == Where("gravity")
    assert [each.place for each in load.terms] == [Place(1, 1), Place(1, 2)]
    assert load.p_value == 1e-6
    # each of the places has its own rivals; what is named itself is none
    assert [each.effect for each in load.alike] == ["moment_arm", "force_gain", "inertia"]


@pytest.mark.long
def test_a_hidden_spring_is_found_and_fitted(hidden: FitRecording) -> None:
    given, seen = described(finger()), list[str]()
    base = find_base(given, [hidden], FitSettings(threads=1), 0.03)
    phases = Phases(PHASES, lambda state: seen.append(state.words))
    found = search(base, least_gain=0.03, seed=1, phases=phases)
    first = found.causes[0]
    assert Where("cover_stiffness", 2) in [first.where, *(each.where for each in first.alike)]
    assert len(found.causes) <= 2
    if first.effect == "cover_stiffness":
        assert found.model.data["joints"][1]["cover"]["stiffness"] == pytest.approx(0.02, rel=0.2)
    used = found.view.series.used
    assert np.mean(found.view.residual[used] ** 2) < np.mean(found.first.residual[used] ** 2)
    assert "causes" in seen and "contact" in seen


@pytest.mark.parametrize(
    ("error", "taken"), [(np.tile([0.88, 0.92], 10), True), (np.tile([0.4, 1.4], 10), False)], ids=["even", "scattered"]
)
def test_a_fit_is_taken_where_the_error_falls_beyond_chance(
    error: Numbers, taken: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The rms falls by 5 %, in each stretch, or much in some while it grows in others."""
    rounds, model = ExtensionSearch.__new__(ExtensionSearch), FittedModel({}, {}, {}, 0.0)
    rounds.causes, rounds.model, rounds._least_gain = [], model, 0.03
    rounds.view = SimpleNamespace(selection=SimpleNamespace(base=np.ones(20)), lean=None)  # type: ignore[assignment]
    rounds.base = SimpleNamespace(samples=None, settings=None, look=lambda model: rounds.view)  # type: ignore[assignment]
    monkeypatch.setattr(search_module, "refitted", lambda model, samples, settings: model)
    assert rounds._take(Trial(named("gravity", Place(1), 1e-9), model, error)) is taken
    assert len(rounds.causes) == int(taken)
