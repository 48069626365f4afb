"""Which cause comes next: hypotheses from coarse to fine, and what makes one of them a cause."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import astuple, replace

import numpy as np
import pytest
from numpy.typing import NDArray

from made_columns import BLOCKS, JOINTS, UNSEEN, Made, candidate_columns, coloured, grams_of, waves
from tendonfmu.diagnosis.candidate_columns import (
    EVERYWHERE,
    HERE,
    LARGEST,
    LARGEST_SCALING,
    LARGEST_SECANT,
    LARGEST_VARIATION,
    SOMEWHERE,
    Candidate,
    CandidateColumns,
    hypotheses,
)
from tendonfmu.diagnosis.effects import Place, Where, by_name
from tendonfmu.diagnosis.selection import (
    BEFORE_FIT,
    CERTAIN,
    OF_NOISE,
    OF_SAMPLE,
    Judged,
    LeastSizes,
    Selection,
    names_with,
    noise_of,
    rms_gain,
)
from tendonfmu.statistics.block_grams import standard_error

Numbers = NDArray[np.float64]

LEAST_GAIN = 0.03
# four effects at places of their own, with columns that have nothing in common
APART = [Made("gravity", 1, size=2), Made("cover_stiffness", 2), Made("inertia", 2), Made("joint_coupling", 1)]


@pytest.fixture(scope="module")
def columns() -> Numbers:
    """[B, n, 12]"""
    return waves(np.random.default_rng(2), 12)


@pytest.fixture(scope="module")
def nominal() -> Numbers:
    return waves(np.random.default_rng(3), 5)


def noise(seed: int) -> Numbers:
    return coloured(np.random.default_rng([seed, 4]))


def hypotheses_of(columns: CandidateColumns) -> list[Candidate]:
    """With arms so long that no correction of the torque is too large."""
    return hypotheses(columns, np.full((4, JOINTS), 1e3), np.ones(JOINTS), np.full(JOINTS, np.inf))


def selection_of(
    target: Numbers, nominal: Numbers, values: Numbers, made: Sequence[Made], least: LeastSizes = UNSEEN
) -> Selection:
    found = hypotheses_of(candidate_columns(values, made))
    return Selection(grams_of(target, nominal, values), found, least)


# --- hypotheses -------------------------------------------------------------------------------------------------------

FOUR = [Made("load_friction", j, i, sign=1, expected=(0.1 * j * i,)) for j in (1, 2) for i in (1, 2)]


def keys(found: Sequence[Candidate]) -> dict[tuple[object, ...], Candidate]:
    return {(each.level, *astuple(each.where)): each for each in found}


def test_an_effect_of_surfaces_is_asked_for_everywhere_at_joints_at_tendons_and_at_each_place(columns: Numbers) -> None:
    found = hypotheses_of(candidate_columns(columns[:, :, :4], FOUR))
    by_key = keys(found)
    name = "load_friction"
    assert set(by_key) == {
        (EVERYWHERE, name, None, None),
        *((SOMEWHERE, name, j, None) for j in (1, 2)),
        *((SOMEWHERE, name, None, i) for i in (1, 2)),
        *((HERE, name, j, i) for j in (1, 2) for i in (1, 2)),
    }
    assert [each.level for each in found] == sorted(each.level for each in found)
    # a magnitude of 1 is as much as is ordinary at each place
    assert by_key[EVERYWHERE, name, None, None].mix[:, 0] == pytest.approx([0.1, 0.2, 0.2, 0.4])
    assert by_key[SOMEWHERE, name, 2, None].mix[:, 0] == pytest.approx([0.0, 0.0, 0.2, 0.4])
    tendon = by_key[SOMEWHERE, name, None, 2]
    assert tendon.mix[:, 0] == pytest.approx([0.0, 0.2, 0.0, 0.4])
    assert [(each.place, each.magnitudes) for each in tendon.terms] == [
        (Place(1, 2), (0.2,)),
        (Place(2, 2), (0.4,)),
    ]
    assert by_key[HERE, name, 2, 1].mix[:, 0] == pytest.approx([0.0, 0.0, 1.0, 0.0])
    assert all(each.low == [0.0] for each in found)
    # bounds are in the same unit: the first place limits no other
    assert {each.high[0] for each in found if each.level != HERE} == {LARGEST}
    assert by_key[HERE, name, 1, 2].high == pytest.approx([0.2 * LARGEST])


def test_signs_bound_what_is_learned(columns: Numbers) -> None:
    made = [Made("cover_stiffness", 1, sign=1), Made("inertia", 1, sign=-1), Made("gravity", 1, sign=0)]
    bounds = {
        each.effect: (*each.low, *each.high) for each in hypotheses_of(candidate_columns(columns[:, :, :3], made))
    }
    assert bounds == {"cover_stiffness": (0.0, LARGEST), "inertia": (-LARGEST, 0.0), "gravity": (-LARGEST, LARGEST)}


def test_corrections_of_the_torque_have_a_largest_size(columns: Numbers) -> None:
    """A large one imitates something else."""
    made = [
        Made("force_gain", None, 2),
        Made("moment_arm", 1, 2),
        Made("load_friction", 1, 2),
        Made("moment_arm_variation", 2, 2),
        Made("gravity", 2, None),
    ]
    arms = np.array([[0.01, 0.01], [0.004, -0.008]])
    reach, weight = np.array([1.0, 0.5]), np.array([np.inf, 0.1])
    found = {each.effect: each for each in hypotheses(candidate_columns(columns[:, :, :5], made), arms, reach, weight)}
    assert (found["force_gain"].low, found["force_gain"].high) == (
        -LARGEST_SCALING,
        LARGEST_SCALING,
    )
    assert found["moment_arm"].high == pytest.approx([LARGEST_SCALING * 0.008])
    assert found["moment_arm_variation"].high == pytest.approx([LARGEST_VARIATION * 0.008 / 0.5])
    assert found["gravity"].high == [0.1]
    assert found["load_friction"].high == [LARGEST]


def test_alike_shapes_go_together_and_each_law_has_its_own(columns: Numbers) -> None:
    """The k-th shape of every law at every place; a law that rises from standstill is of one place alone."""
    shapes = ({"stribeck_velocity": 0.1}, {"stribeck_velocity": 0.3}, {"rises": 1.0, "stribeck_velocity": 0.1})
    pulley = tuple({"pulley": 1.0, **shape} for shape in shapes[:2])
    made = [Made("stribeck", 1, 1, shapes=(*shapes, *pulley)), Made("stribeck", 2, 1, shapes=shapes)]
    found = [each for each in hypotheses_of(candidate_columns(columns[:, :, :8], made)) if each.level == EVERYWHERE]
    assert [np.flatnonzero(each.mix[:, 0]).tolist() for each in found] == [[0, 3, 5], [1, 4, 6]]


# --- what is a cause --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(6))
def test_noise_has_no_cause(seed: int, columns: Numbers, nominal: Numbers) -> None:
    target = noise(seed) + nominal @ np.linspace(-3, 3, 5)
    assert selection_of(target, nominal, columns[:, :, :5], APART).best(LEAST_GAIN) is None


def test_a_cause_is_found_with_its_size_and_its_gain(columns: Numbers, nominal: Numbers) -> None:
    target = noise(1) + nominal @ np.linspace(-3, 3, 5) + 0.3 * columns[:, :, 2]
    found = selection_of(target, nominal, columns[:, :, :5], APART).best(LEAST_GAIN)
    assert found is not None
    assert found.where == Where("cover_stiffness", 2)
    assert found.magnitudes == pytest.approx([0.3], rel=0.15)
    assert found.alike == ()
    # variance of the wave over that of the noise, but for what bias and refitting take
    share = 0.3**2 * columns[:, :, 2].var() / (1.0 + 0.3**2 * columns[:, :, 2].var())
    assert found.gain.value == pytest.approx(1.0 - np.sqrt(1.0 - share), rel=0.3)
    assert found.gain.low > 0.0


def test_what_was_tried_is_left_out(columns: Numbers, nominal: Numbers) -> None:
    target = noise(12) + 0.4 * columns[:, :, 2] + 0.3 * columns[:, :, 3]
    selection = selection_of(target, nominal, columns[:, :, :5], APART)
    for tried, effect in (((), "cover_stiffness"), (("cover_stiffness",), "inertia")):
        found = selection.best(LEAST_GAIN, tried)
        assert found is not None and found.effect == effect
    assert selection.best(LEAST_GAIN, ("cover_stiffness", "inertia")) is None


def test_what_is_certain_but_not_material_is_no_cause(columns: Numbers, nominal: Numbers) -> None:
    target = noise(2) + 0.15 * columns[:, :, 2]
    selection = selection_of(target, nominal, columns[:, :, :5], APART)
    first = selection.ranked()[0]
    gain, error = selection.gain(first)
    assert first.effect == "cover_stiffness"
    assert CERTAIN * error < gain < LEAST_GAIN
    assert selection.best(LEAST_GAIN) is None
    assert selection.best(0.8 * gain) is not None


def test_what_is_material_but_not_certain_is_no_cause(columns: Numbers, nominal: Numbers) -> None:
    """A wave that shows in one stretch of sixteen."""
    once = columns[:, :, 2] * (np.arange(BLOCKS) // 200 == 7)[:, None]
    values = np.concatenate([columns[:, :, :2], once[:, :, None], columns[:, :, 3:5]], axis=2)
    selection = selection_of(noise(3) + 2.0 * once, nominal, values, APART)
    assert selection.best(LEAST_GAIN) is None


def test_a_cause_of_the_wrong_sign_is_none(columns: Numbers, nominal: Numbers) -> None:
    target = noise(4) - 0.3 * columns[:, :, 0]
    for sign, found in ((1, False), (-1, True), (0, True)):
        made = [Made("cover_stiffness", 1, sign=sign)]
        best = selection_of(target, nominal, columns[:, :, :1], made).best(LEAST_GAIN)
        assert (best is not None) == found, sign


def test_what_refitting_mends_is_no_cause(columns: Numbers, nominal: Numbers) -> None:
    twin = nominal[:, :, :1] + 0.01 * columns[:, :, :1]
    selection = selection_of(noise(5) + 3.0 * twin[:, :, 0], nominal, twin, [Made("gravity", 1)])
    assert selection.shares[0] < 0.01
    assert selection.ranked() == []


def test_what_cannot_be_told_apart_is_said(columns: Numbers, nominal: Numbers) -> None:
    twin = columns[:, :, 0] + 0.05 * columns[:, :, 5]
    values = np.stack([columns[:, :, 0], twin, columns[:, :, 1]], axis=2)
    made = [Made("cover_stiffness", 1), Made("cover_hardening", 1), Made("inertia", 1)]
    found = selection_of(noise(6) + 0.3 * values[:, :, 0], nominal, values, made).best(LEAST_GAIN)
    assert found is not None
    assert {found.effect, *(each.effect for each in found.alike)} == {"cover_stiffness", "cover_hardening"}


def test_each_further_name_counts_and_what_every_finger_has_does_not() -> None:
    assert names_with("gravity", []) == names_with("gravity", ["presliding", "time_delay"]) == 1
    assert names_with("gravity", ["stribeck", "presliding"]) == 2
    assert names_with("gravity", ["stribeck", "inertia"]) == 3
    assert names_with("presliding", ["stribeck", "inertia"]) == 1
    assert names_with("stribeck", ["stribeck", "inertia"]) == 1  # a further place of it


def test_a_fast_pulley_has_to_take_away_much(columns: Numbers, nominal: Numbers) -> None:
    """Any feature of the angle is a little like it."""
    for turns, size, found in ((9.0, 0.4, False), (9.0, 3.0, True), (1.0, 0.4, True)):
        made = [Made("pulley_eccentricity", 1, 1, shapes=({"turns": turns},))]
        values = columns[:, :, :1] * 1.0
        best = selection_of(noise(9) + size * values[:, :, 0], nominal, values, made).best(LEAST_GAIN)
        assert (best is not None) == found, (turns, size)


def test_what_is_beside_explains_nothing_else(columns: Numbers, nominal: Numbers) -> None:
    """A column that is alike has no gain beside the one that was refused; another cause has."""
    alike = 0.8 * columns[:, :, 0] + 0.6 * columns[:, :, 5]
    values = np.stack([columns[:, :, 0], alike, columns[:, :, 1]], axis=2)
    made = [Made("backlash", 1), Made("presliding", 1), Made("gravity", 1)]
    target = noise(7) + 0.8 * values[:, :, 0] + 0.3 * values[:, :, 2]
    alone = selection_of(target, nominal, values, made)
    found = {each.effect: alone.gain(each)[0] for each in alone.ranked()}
    assert found["backlash"] > found["presliding"] > 3 * LEAST_GAIN
    refused = [each for each in alone.candidates if each.effect == "backlash"]
    beside = Selection(alone.grams, alone.candidates, UNSEEN, refused)
    assert beside.base.sum() == pytest.approx(alone.ranked()[0].unseen.sum(), rel=1e-6)
    best = beside.best(LEAST_GAIN)
    assert best is not None and best.effect == "gravity"
    assert best.magnitudes == pytest.approx([0.3], rel=0.2)
    assert "backlash" not in {each.effect for each in beside.ranked()}


# --- places -----------------------------------------------------------------------------------------------------------


def test_one_effect_at_all_places_is_one_cause(columns: Numbers, nominal: Numbers) -> None:
    made = [replace(each, expected=(1.0,)) for each in FOUR]
    target = noise(9) + 0.2 * columns[:, :, :4].sum(axis=2)
    found = selection_of(target, nominal, columns[:, :, :4], made).best(LEAST_GAIN)
    assert found is not None
    assert found.where == Where("load_friction") and len(found.terms) == 4
    assert found.magnitudes == pytest.approx([0.2], rel=0.15)


@pytest.mark.parametrize(("own", "place"), [((2,), (2, 1)), ((2, 3), (2, None)), ((1, 3), (None, 2))])
def test_an_effect_of_some_places_is_named_there(
    own: tuple[int, ...], place: tuple[int | None, int | None], columns: Numbers, nominal: Numbers
) -> None:
    made = [replace(each, expected=(1.0,)) for each in FOUR]
    target = noise(10) + 0.3 * columns[:, :, list(own)].sum(axis=2)
    found = selection_of(target, nominal, columns[:, :, :4], made).best(LEAST_GAIN)
    assert found is not None
    assert found.where == Where("load_friction", *place)


def test_places_that_differ_little_are_near(columns: Numbers, nominal: Numbers) -> None:
    """Next to what the effect takes away: for its fits to decide."""
    twin = columns[:, :, 0] + 0.2 * columns[:, :, 5]
    values = np.stack([columns[:, :, 0], twin, columns[:, :, 1]], axis=2)
    made = [Made("moment_arm_variation", 1, tendon) for tendon in (1, 2, 3)]
    selection = selection_of(noise(11) + 0.5 * values[:, :, 0], nominal, values, made)
    best = selection.refined("moment_arm_variation")
    assert best.where.tendon == 1
    assert [each.where.tendon for each in selection.near(best)] == [2]


def test_one_place_is_near_several_of_a_joint_but_not_all(columns: Numbers, nominal: Numbers) -> None:
    made = [replace(each, expected=(1.0,)) for each in FOUR]
    selection = selection_of(noise(12) + 0.3 * columns[:, :, 2], nominal, columns[:, :, :4], made)
    here, joint, whole = (
        next(each for each in selection.candidates if each.where == Where("load_friction", *place))
        for place in ((2, 1), (2, None), (None, None))
    )
    unseen = selection.refined("load_friction").unseen
    alone = {each.where for each in selection.near(Judged(**vars(joint), unseen=1.02 * unseen))}
    assert here.where in alone and whole.where not in alone
    assert here.where not in {each.where for each in selection.near(Judged(**vars(whole), unseen=1.02 * unseen))}


# --- gains ------------------------------------------------------------------------------------------------------------


def test_gain_of_the_rms_and_its_error() -> None:
    rng = np.random.default_rng(5)
    before = rng.gamma(20.0, 1.0, (2000, 30))
    after = 0.81 * before * rng.gamma(100.0, 0.01, before.shape)
    gains, errors = np.array([rms_gain(*pair) for pair in zip(before, after, strict=True)]).T
    assert gains.mean() == pytest.approx(0.1, abs=0.002)
    assert errors.mean() == pytest.approx(gains.std(), rel=0.1)
    assert rms_gain(np.zeros(3), np.zeros(3)) == (0.0, np.inf)
    assert rms_gain(np.ones(3), np.zeros(3)) == (1.0, 0.0)
    assert standard_error(after[0] - 0.81 * before[0]) > 0.0


# --- sizes ------------------------------------------------------------------------------------------------------------

SENSORS = LeastSizes(np.array([1e-4, 2e-4]), np.array([1e-6, 2e-6, 3e-6, 4e-6]), 0.004, np.array([0.3, 0.2]))


def test_least_sizes_are_those_of_the_sensors() -> None:
    delay = OF_SAMPLE * 0.004
    assert SENSORS.least(Where("time_delay")) == pytest.approx(delay)
    assert SENSORS.least(Where("backlash", 2)) == pytest.approx(OF_NOISE * 2e-4)
    assert SENSORS.least(Where("backlash", None, 3)) == pytest.approx(OF_NOISE * 3e-6)
    assert SENSORS.least(Where("gravity", 1)) == 0.0
    shows = SENSORS.shows
    assert not shows("backlash", Place(2), {"width": 3.9 * 2e-4})
    assert shows("backlash", Place(2), {"width": -4.1 * 2e-4})
    assert not shows("time_delay", Place(), {"delay": 0.9 * delay}) and shows("time_delay", Place(), {"delay": delay})
    assert shows("gravity", Place(1), {"sine": 1e-9}) and shows("backlash", Place(2), None)
    assert shows("gravity", Place(2), {"cosine": -0.19})
    assert not shows("gravity", Place(2), {"sine": 0.0, "cosine": -0.21}), "more than the torque that was measured"


def test_what_is_far_too_small_is_no_hypothesis(columns: Numbers) -> None:
    made = [
        Made("backlash", 1, shapes=({"width": 2e-4},), secant=True),
        Made("time_delay", shapes=({"delay": -0.01},), secant=True),
        Made("gravity", 1),
    ]
    found = {each.effect: each for each in hypotheses_of(candidate_columns(columns[:, :, :3], made))}
    # before the fit half of the least size will do: 4 times 0.1 mrad of noise; three quarters of 4 ms
    for effect, step, least in (("backlash", 2e-4, 4e-4), ("time_delay", 0.01, 0.003)):
        for times, resolved in ((0.95, False), (1.05, True)):
            magnitude = times * BEFORE_FIT * least / step
            assert SENSORS.resolved(found[effect], [magnitude]) == resolved
            assert SENSORS.resolved(found[effect], [-magnitude]) == resolved
    assert SENSORS.resolved(found["gravity"], [1e-12])


def test_steps_that_lead_to_nothing_visible_are_not_tried() -> None:
    play = by_name("backlash")
    assert SENSORS.worth(play, Place(1), {"width": 4e-4 / LARGEST_SECANT * 1.01})
    assert not SENSORS.worth(play, Place(1), {"width": 4e-4 / LARGEST_SECANT * 0.99})
    assert SENSORS.worth(by_name("gravity"), Place(1), {})


def test_noise_of_positions_is_what_smoothing_takes_off() -> None:
    rng = np.random.default_rng(6)
    smooth = np.sin(np.linspace(0.0, 20.0, 5000))[:, None] * [1.0, 1.0, 1.0, 0.0]
    raw = smooth + rng.standard_normal(smooth.shape) * [1e-3, 2e-3, 0.0, 0.0]
    raw[::50, 0] += 1.0  # a few outliers
    raw[:, 2] = np.round(raw[:, 2] / 0.01) * 0.01
    found = noise_of(raw, smooth)
    assert found[:2] == pytest.approx([1e-3, 2e-3], rel=0.06)
    assert 0.01 / np.sqrt(12.0) * 0.99 <= found[2] < 0.005  # quantisation, uniform: its median says a little more
    assert found[3] == 0.0
    # a position that stands still between few steps has the noise of its steps all the same
    still = np.zeros((5000, 1))
    still[2500:] = 0.01
    assert noise_of(still, still) == pytest.approx([0.01 / np.sqrt(12.0)])
