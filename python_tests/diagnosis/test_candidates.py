"""The candidates of a diagnosis: where they are proposed, and that their columns are what the C core makes of them.

Columns are compared with differences of whole runs of the core; the term's own torque is tested elsewhere.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tendonfmu.diagnosis.candidate_columns import CandidateColumns, Proposal, candidate_columns
from tendonfmu.diagnosis.effects import MECHANISMS, Place, Variant, by_name
from tendonfmu.diagnosis.effects.mechanism import add_to_number
from tendonfmu.diagnosis.extension_fit import carried, number_columns
from tendonfmu.diagnosis.samples import Samples, Span, span_of
from tendonfmu.excite.excitation import balanced_forces
from tendonfmu.model import native, own_copy
from tendonfmu.model.description import Finger, finger_of
from tendonfmu.model.friction_places import friction_numbers, moment_arms
from tendonfmu.recordings.prepared import FitRecording, Held, prepare
from tendonfmu.recordings.recording import Recording

Numbers = NDArray[np.float64]
Data = dict[str, Any]

# docs/reference/commands/diagnose.md#the-effects, without `contact` and `unknown`, which are no terms of a model,
# `calibration`, which is several, and the memory of friction, which is chosen first
CONTRACT = (
    "viscous_friction", "stribeck", "asymmetric_friction", "edge_friction", "pulley_friction", "joint_friction",
    "joint_load_friction", "preload_friction", "load_friction", "cover_stiffness", "cover_hardening", "gravity",
    "inertia", "inertia_variation", "friction_drift", "force_gain", "force_offset", "time_delay",
    "moment_arm",
    "moment_arm_variation", "pulley_eccentricity", "tendon_nonlinearity", "joint_coupling", "backlash",
)  # fmt: skip
MEMORY = ("presliding", "relaxation", "cord_stretch")
NOTHING = 1e-11  # N·m at an ordinary magnitude: a column that is all zero but for rounding


def law(static: float, coulomb: float, velocity: float, viscous: float = 0.0) -> dict[str, float]:
    return {"static": static, "coulomb": coulomb, "stribeck_velocity": velocity, "viscous": viscous}


def finger_data() -> Data:
    """Two joints, four tendons; every effect is absent somewhere, and most are present elsewhere."""
    thick, plain = law(0.024, 0.02, 0.004, 0.2), law(0.02, 0.02, 0.005)
    both = {"positive": law(0.02, 0.02, 0.005, 0.1), "negative": law(0.025, 0.025, 0.005, 0.1)}
    arms = ([0.009, 0.0], [-0.009, 0.0], [0.004, 0.008], [-0.004, -0.008])
    edges: list[list[Any]] = [[thick], [], [plain, plain], [both, {"angles": [-0.3, 0.3], "laws": [plain, thick]}]]
    pulleys: list[list[Any]] = [[], [], [], [plain]]
    tendons = [
        {"stiffness": 8000.0, "moment_arms": arm, "edge_friction": edge, "pulley_friction": pulley}
        for arm, edge, pulley in zip(arms, edges, pulleys, strict=True)
    ]
    joints = [
        {"friction": law(0.006, 0.005, 0.1, 0.001), "cover": {"stiffness": 0.02, "rest_angle": 0.1}},
        {"load_friction": law(3e-5, 3e-5, 0.1)},
    ]
    return {
        "format": "tendonfmu-finger-1",
        "name": "candidates",
        "joints": joints,
        "tendons": tendons,
        "contact": {"threshold": [0.03, 0.03]},
        "extensions": [{"effect": "gravity", "joint": 1, "sine": 0.002, "cosine": 0.001}],
    }


def described(data: Mapping[str, Any]) -> Finger:
    return Finger(Path("finger"), data)


def moved(data: Data, seconds: float, seed: int, gap: bool = False) -> Recording:
    """Free motion with rests and reversals at 500 Hz, under forces that the friction asks for."""
    draw, rate = np.random.default_rng(seed), 500
    time = np.arange(int(seconds * rate)) / rate
    angle = np.zeros((len(time), 2))
    for j in range(2):
        for _ in range(3):
            size, speed, phase = draw.uniform(0.1, 0.3), draw.uniform(0.2, 0.7), draw.uniform(0, 6)
            angle[:, j] += size * np.sin(2 * np.pi * speed * time + phase)
    going = np.cumsum(np.sin(2 * np.pi * time / 5) < 0.8) / rate
    angle = np.stack([np.interp(going, time, angle[:, j]) for j in range(2)], axis=1)
    motion: dict[str, Numbers] = {
        "time": time,
        "joint_position": angle,
        "joint_velocity": np.gradient(angle, time, axis=0),
    }
    force = balanced_forces(finger_of(data), motion, 10 + 2 * np.sin(2 * np.pi * time / 11))
    position = angle @ moment_arms(data).T + force / 8000.0
    force += 0.002 * draw.standard_normal(force.shape)
    if gap:
        time = time + 3.0 * (time > seconds / 2)
    groups = {"tendon_force": force, "tendon_position": position, **motion}
    del groups["time"]
    return Recording(Path(f"recording {seed}"), time, groups, None)


class Case:
    """Columns of two recordings, one with a gap."""

    def __init__(self) -> None:
        self.data = finger_data()
        finger = described(self.data)
        made = (moved(self.data, 6.0, 1, gap=True), moved(self.data, 5.0, 2))
        self.recordings: list[FitRecording] = [prepare(finger, each, 1, Held()) for each in made]
        self.samples = Samples.of(self.data, self.recordings)
        self.span: Span = span_of(self.data, self.recordings)
        self.columns: CandidateColumns = candidate_columns(self.data, self.samples, span=self.span)

    def left(self, data: Mapping[str, Any]) -> Numbers:
        return self.samples.left(data)

    def proposals(self, name: str) -> list[tuple[Proposal, Variant]]:
        return [(each, each.variant) for each in self.columns.proposals if each.mechanism.name == name]


@pytest.fixture(scope="module")
def case() -> Case:
    return Case()


def test_a_cover_may_harden_about_any_angle_near_rest(case: Case) -> None:
    """stiffness·(b − c)³ is a mixture of both columns beside a linear part and a constant, as far as |c| <= 0.2."""
    (_, variant) = case.proposals("cover_hardening")[0]
    bend = np.linspace(-0.5, 0.5)
    for centre in (-0.2, 0.05, 0.2):
        shares = 0.3 * np.array([0.2 + centre, 0.2 - centre]) / 0.4
        row = variant.at(shares.tolist())["extensions"][-1]
        cubic = 0.3 * (bend - centre) ** 3 - 0.3 * (3.0 * centre**2 * bend - centre**3)
        np.testing.assert_allclose(row["stiffness"] * bend**3 + row["quadratic"] * bend**2, cubic, atol=1e-12)
    assert variant.signs == (1, 1)


def test_an_arm_changes_about_the_middle_of_the_range(case: Case) -> None:
    for proposal, variant in case.proposals("moment_arm_variation"):
        row = variant.at([-2e-4])["extensions"][-1]
        assert proposal.place.joint is not None and row["slope"] == -2e-4
        low, high = case.span.angle[proposal.place.joint - 1]
        assert row["correction"] == pytest.approx(1e-4 * (low + high), rel=1e-9) and row["correction"] != 0.0


def by_difference(case: Case, base: Data, numbers: Mapping[str, float], step: float) -> Numbers:
    changed = own_copy(base)
    for path, share in numbers.items():
        add_to_number(changed, path, step * share)
    return np.asarray((case.left(base) - case.left(changed)) / step)


def assert_column(found: NDArray[Any], expected: Numbers, ordinary: float, what: str, exact: float = 1e-5) -> None:
    largest = max(float(np.abs(expected).max()), NOTHING / ordinary / exact)
    assert np.abs(found - expected).max() < exact * largest, what


# --- which there are --------------------------------------------------------------------------------------------------


def test_every_effect_of_the_contract_has_a_candidate() -> None:
    assert (
        tuple(candidate.name for candidate in MECHANISMS if candidate.name not in ("calibration", *MEMORY)) == CONTRACT
    )


def test_every_candidate_is_proposed(case: Case) -> None:
    assert {proposal.mechanism.name for proposal in case.columns.proposals} == set(CONTRACT)


# --- places -----------------------------------------------------------------------------------------------------------


def test_places_follow_the_structure(case: Case) -> None:
    """Literal places of the finger above, by hand."""
    expected = {
        "viscous_friction": {(2, 3), (1, 3), (1, 4), (2, None)},
        "stribeck": {(1, 3), (2, 3), (1, 4), (2, None)},
        "asymmetric_friction": {(1, 1), (1, 3), (2, 3), (2, 4), (1, 4), (1, None), (2, None)},
        "edge_friction": {(1, 2), (2, 3)},
        "pulley_friction": {(1, 3)},
        "joint_friction": {(2, None)},
        "joint_load_friction": {(1, None)},
        "cover_stiffness": {(2, None)},
        "gravity": {(2, None)},
        "joint_coupling": {(1, None)},
        "inertia_variation": {(1, None)},
        "time_delay": {(None, None)},
        "load_friction": {(1, 1), (1, 2), (1, 3), (2, 3), (1, 4), (2, 4)},
        "preload_friction": {(1, 1), (1, 2), (1, 3), (2, 3), (1, 4), (2, 4)},
        "friction_drift": {(None, None), (1, None), (2, None), (None, 1), (None, 3), (None, 4)},
        "presliding": set(),
        "force_gain": {(None, 1), (None, 2), (None, 3), (None, 4)},
    }
    for name, places in expected.items():
        found = {(place.joint, place.tendon) for place in by_name(name).places(case.data)}
        assert found == places, name


def test_kinematics_decide_what_can_matter(case: Case) -> None:
    tendons = {Place(tendon=i) for i in range(1, 5)}
    assert set(by_name("backlash").places(case.data, 2)) == {Place(joint=1), Place(joint=2)}
    assert by_name("backlash").places(case.data, 3) == []
    assert set(by_name("tendon_nonlinearity").places(case.data, 1)) == tendons
    assert by_name("tendon_nonlinearity").places(case.data, 2) == []


@pytest.mark.parametrize("name", CONTRACT)
def test_what_is_present_is_not_proposed_again(case: Case, name: str) -> None:
    """Extended by a candidate, a finger is accepted, and this place with this law is no place of it any more."""
    candidate = by_name(name)
    for proposal, variant in case.proposals(name):
        extended = candidate.extended(case.data, proposal.place, variant.shape, variant.expected)
        native.image_from_json(json.dumps(extended))
        kind = {key: value for key, value in variant.shape.items() if key in ("pulley", "load")}
        after = candidate.variants(extended, proposal.place, case.span)
        again = [each for each in after if {key: each.shape.get(key) for key in kind} == kind]
        if proposal.place in candidate.places(extended) and not variant.rows:
            again = [each for each in again if each.shape.keys() == variant.shape.keys()]
            assert again == [], proposal.place
        elif variant.rows or variant.full is not None:
            assert proposal.place not in candidate.places(extended) or name == "stribeck"


# --- columns ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", CONTRACT)
def test_columns_are_differences_of_the_core(case: Case, name: str) -> None:
    """By the term at its ordinary size, or at full strength where it has no derivative at zero."""
    assert_all_columns(case, name)


def late_forces(case: Case, delay: float) -> Numbers:
    """What is left with forces measured late, less what is left as it is."""
    late = []
    for recording in case.recordings:
        groups = dict(recording.recording.groups)
        force = groups["tendon_force"].copy()
        for part in recording.parts:
            time = recording.time[part]
            force[part] = np.stack([np.interp(time - delay, time, one) for one in force[part].T], axis=1)
        late.append(replace(recording, recording=replace(recording.recording, groups=groups | {"tendon_force": force})))
    return Samples.of(case.data, late).left(case.data) - case.left(case.data)


def assert_all_columns(case: Case, name: str) -> None:
    proposals = case.proposals(name)
    assert proposals
    for proposal, variant in proposals:
        values = case.columns.values[:, :, proposal.columns]
        assert values.shape[2] == variant.count
        if name == "time_delay":
            assert_column(values[:, :, 0], late_forces(case, variant.shape["delay"]), 1.0, f"{name} {variant.shape}")
            continue
        if variant.full is not None:
            expected = case.left(case.data) - case.left(variant.full(1.0))
            assert np.abs(expected).max() > 1e-5
            assert_column(values[:, :, 0], expected, 1.0, f"{name} {variant.shape}")
            continue
        assert case.left(variant.data) == pytest.approx(case.left(case.data), rel=1e-9, abs=1e-10)
        for k, column in enumerate(variant.columns):
            expected = by_difference(case, variant.data, column.numbers, column.expected)
            assert_column(values[:, :, k], expected, column.expected, f"{name} {variant.shape} {list(column.numbers)}")


def test_columns_of_numbers_are_differences_of_the_core(case: Case) -> None:
    columns, scale = number_columns(case.data, case.samples)
    listed = [
        number for number in friction_numbers(case.data) if number.key != "stribeck_velocity" and number.key != "static"
    ]
    assert columns.shape[2] == len(scale) >= len(listed)
    for number in listed:
        expected = by_difference(case, case.data, {number.path: 1.0}, 1e-4 * number.reference)
        errors = np.sqrt(np.mean((columns - expected[:, :, None]) ** 2, axis=(0, 1)))
        # near where friction remembers: an element that holds keeps the limit of the other side after a reversal
        assert errors.min() < 0.1 * np.sqrt(np.mean(expected**2)), number.path


# --- what a magnitude means -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", CONTRACT)
def test_a_fit_estimates_what_is_added(case: Case, name: str) -> None:
    """All numbers of the term, also from magnitudes of 0: what is 0 would stay 0."""
    before = {number.path for number in friction_numbers(case.data)}
    for proposal, variant in case.proposals(name):
        extended = proposal.mechanism.extended(case.data, proposal.place, variant.shape, [0.0] * variant.count)
        added = {number.path for number in friction_numbers(extended)} - before
        wanted = {f"extensions[{len(extended['extensions'])}]."} if variant.rows or variant.full is not None else set()
        for path in () if wanted else (path for column in variant.columns for path in column.numbers):
            wanted.add(path)
        assert all(any(each.startswith(path) for each in added | before) for path in wanted), (proposal.place, wanted)
        assert added, (name, proposal.place, variant.shape)


def test_a_drop_that_is_new_stays_where_the_others_numbers_come_from_a_fit(case: Case) -> None:
    """A fit that starts without a drop never finds one."""
    known = own_copy(case.data)
    side = known["tendons"][2]["edge_friction"][0]
    side.update(static=0.06, coulomb=0.06)  # of a fit of the law without a drop
    shape = {"stribeck_velocity": 0.004}
    extended = by_name("stribeck").extended(case.data, Place(1, 3), shape, [0.01])
    found = carried(extended, known)["tendons"][2]["edge_friction"][0]
    assert (found["coulomb"], found["static"]) == pytest.approx((0.06, 0.06 * 0.03 / 0.02))
    assert found["stribeck_velocity"] == 0.004


def test_sizes_stay_within_what_a_description_takes(case: Case) -> None:
    """A candidate's magnitude is an estimate, and may be anything."""
    for name, place, shape, most in (
        ("time_delay", Place(), {"delay": -0.03}, 50.0),
        ("friction_drift", Place(), {"time_constant": 3.0}, -40.0),
        ("force_gain", Place(tendon=1), {}, -3.0),
        ("asymmetric_friction", Place(1, 3), {}, 9.0),
        ("edge_friction", Place(1, 2), {}, -5.0),
    ):
        candidate = by_name(name)
        sizes = [most] * candidate.variant(case.data, place, shape).count
        assert native.image_from_json(json.dumps(candidate.extended(case.data, place, shape, sizes)))


# --- averages ---------------------------------------------------------------------------------------------------------


def test_a_pulley_has_few_forms_however_far_a_joint_seems_to_turn() -> None:
    """Angles that nearly equal arms do not determine span 1e9 rad."""

    def forms(reach: float) -> int:
        span = SimpleNamespace(angle=np.array([[0.0, reach]]))
        return len(by_name("pulley_eccentricity").find_shapes({}, Place(1, 1), span))  # type: ignore[arg-type]

    assert forms(1.0) > 1 and forms(100.0) <= 62 and forms(1e9) <= 62
