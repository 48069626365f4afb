"""The cases of a change are what they say: other samples then and now, the change at its strength, the halves alike."""

from __future__ import annotations

import sys
from collections import Counter
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("tendonfmu._estimation", reason="SKIPPED: tendonfmu is not installed with its estimation")

sys.path.insert(0, str(Path(__file__).resolve().parent))

import change_hidden
import change_real
from change_case import HALVES, NOTHING
from change_cases import chosen
from change_effects import CHANGES, check_sound, first_magnitude, hide, magnitude_of
from change_machines import Stretch, diagnosed_model, part_of, thinned, with_pulses_as_load
from measured import FORCE, LOAD, SPEED, Array, Columns, Description, Machine, built_up, residual

RATE, COULOMB, VISCOUS, NOISE, PRESLIDING = 1000.0, 8.0, 30.0, 0.5, 1e-5


def recording(seed: int, noise: float = NOISE) -> Columns:
    """A carriage that goes to and fro for 10 s under a load that comes and goes; `model` is exact but for the noise."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, 10.0, 1.0 / RATE)
    angle = 0.1 * np.sin(2 * np.pi * (0.4 * time + 0.1 * np.sin(0.7 * time)) + rng.uniform(0.0, 6.0))
    speed = np.gradient(angle, time)
    load = 20.0 * np.sin(1.3 * time)
    built = built_up(np.sign(speed), np.diff(angle, prepend=angle[0]), PRESLIDING)
    friction = (COULOMB + VISCOUS * np.abs(speed)) * built
    torque = load + friction + noise * rng.standard_normal(len(time))
    return {
        "time": time,
        FORCE: torque,
        "tendon_position[1]": angle,
        "joint_position[1]": angle,
        SPEED: speed,
        LOAD: load,
    }


def law_of(coulomb: float, viscous: float) -> Description:
    return {"static": coulomb, "coulomb": coulomb, "stribeck_velocity": 0.1, "viscous": viscous}


def model() -> Description:
    """EMPS's, with the friction of `recording` and without what that has not."""
    joint = {"name": "carriage", "friction": law_of(COULOMB, VISCOUS)}
    presliding = {"effect": "presliding", "joint": 1, "displacement": PRESLIDING}
    bias = {**diagnosed_model("emps")["bias"], "initial_torque": [0.0]}
    return diagnosed_model("emps") | {"joints": [joint], "extensions": [presliding], "bias": bias}


def machine(seed: int) -> Machine:
    return Machine("emps", model(), {f"run {seed}": recording(seed)}, 3)


THEN, NOW = machine(1), machine(2)


def added(altered: Columns) -> Array:
    return np.asarray(altered[FORCE] - NOW.recordings["run 2"][FORCE])


@pytest.mark.parametrize("name", sorted(CHANGES))
def test_a_change_grows_with_its_size_and_touches_no_motion(name: str) -> None:
    change, columns = CHANGES[name], NOW.recordings["run 2"]
    size = first_magnitude(change, NOW)
    small, large = (change.put(NOW, columns, share * size) for share in (0.5, 1.0))
    assert 0.0 < np.std(added(small)) < np.std(added(large))
    assert {key for key in columns if not np.array_equal(columns[key], large[key])} == {FORCE}


@pytest.mark.parametrize("name", ["coulomb", "growing", "along_the_stroke", "near_standstill", "with_time", "viscous"])
def test_more_friction_takes_power_out_in_both_directions(name: str) -> None:
    columns = NOW.recordings["run 2"]
    torque = added(CHANGES[name].put(NOW, columns, first_magnitude(CHANGES[name], NOW)))
    for way in (-1, 1):
        rows = np.sign(columns[SPEED]) == way
        assert np.mean(torque[rows] * columns[SPEED][rows]) > 0.0


JOINT, PLACE = {"joint": 1}, {"joint": 1, "tendon": 1}
# what a description has more of when the effect has grown: a row of extensions, or a number of its joint
GROWN: dict[str, Description] = {
    "cover_stiffness": {"cover": {"stiffness": 1.0, "rest_angle": 0.0}},
    "joint_friction": {"friction": law_of(COULOMB + 0.1, VISCOUS)},
    "viscous_friction": {"friction": law_of(COULOMB, VISCOUS + 1.0)},
    "force_gain": {"tendon": 1, "correction": 0.01},
    "moment_arm": PLACE | {"correction": 0.01},
    "moment_arm_variation": PLACE | {"slope": 0.1},
    "preload_friction": PLACE | {"coulomb": 0.1},
    "load_friction": PLACE | {"coulomb": 0.01},
    "inertia": JOINT | {"inertia": 0.1},
    "friction_drift": JOINT | {"amplitude": 0.1, "time_constant": 3.0},
    "stribeck": JOINT | {"amplitude": 0.1, "stribeck_velocity": 0.05},
    "time_delay": {"delay": 0.002},
    "presliding": JOINT | {"displacement": PRESLIDING + 0.002},  # as much as the change: it is not linear
}
SIGNED = [
    (name, effect)
    for name, change in CHANGES.items()
    for effect in change.names
    if effect in change.signs and effect in GROWN
]


@pytest.mark.parametrize(("name", "effect"), SIGNED)
def test_the_sign_of_the_truth_is_that_of_the_models_own_number(name: str, effect: str) -> None:
    """What the change adds to the residual is what the model with more, or less, of the effect takes off it."""
    change, columns = CHANGES[name], NOW.recordings["run 2"]
    grown = model()
    if effect in ("cover_stiffness", "joint_friction", "viscous_friction"):
        grown["joints"][0] |= GROWN[effect]
    else:
        kept = [row for row in grown["extensions"] if row["effect"] != effect]
        grown["extensions"] = [*kept, {"effect": effect} | GROWN[effect]]
    before = residual(NOW, columns)
    put_in = residual(NOW, change.put(NOW, columns, change.sign * first_magnitude(change, NOW))) - before
    taken_off = before - residual(replace(NOW, model=grown), columns)
    assert np.corrcoef(put_in, taken_off)[0, 1] * change.sign * change.signs[effect] > 0.3


def test_a_change_of_a_number_counts_as_a_whole_and_one_of_no_number_by_what_refitting_leaves() -> None:
    noise = NOISE / np.sqrt(10.0)  # means of 10 ms
    friction = hide(THEN, NOW, NOW, CHANGES["coulomb"], 1.0)
    assert friction.by == "whole" and friction.survives_now < 0.02
    assert friction.magnitude == pytest.approx(noise, rel=0.1)  # a square wave of the noise's variance
    assert friction.survives_both == pytest.approx(0.5, abs=0.1)  # half of it is in the mean of then and now
    spring = hide(THEN, NOW, NOW, CHANGES["spring"], 1.0)
    assert spring.by == "survives_now" and spring.survives_now == pytest.approx(1.0, rel=0.03)


def test_what_is_hidden_has_its_strength_in_the_recordings() -> None:
    hidden = hide(THEN, NOW, NOW, CHANGES["less_coulomb"], 0.3)
    before, after = (residual(NOW, columns) for columns in (NOW.recordings["run 2"], hidden.now["run 2"]))
    assert np.var(after - before) / np.var(before) == pytest.approx(0.3, rel=0.03)
    assert hidden.magnitude < 0.0


def test_what_no_sound_magnitude_has_is_refused() -> None:
    with pytest.raises(ValueError, match="strength 1: no sound magnitude"):
        hide(THEN, NOW, NOW, replace(CHANGES["delay"], most=1e-6), 1.0)
    with pytest.raises(ValueError, match=r"N\.m that are sound"):
        check_sound(20.0 * np.sign(NOW.recordings["run 2"][SPEED]), NOW)


@pytest.mark.parametrize(("power", "first"), [(2.0, 0.01), (2.0, 50.0), (0.5, 1e-3), (6.0, 3.0)])
def test_the_search_for_a_strength_finds_it_from_anywhere(power: float, first: float) -> None:
    found = magnitude_of(0.3, lambda size: (size / 4.0) ** power, first, 100.0)
    assert (found / 4.0) ** power == pytest.approx(0.3, rel=0.03)


# --- recordings -------------------------------------------------------------------------------------------------------


def test_parts_begin_at_zero_and_keep_their_samples() -> None:
    part = part_of(recording(3), 2.0, 4.0)
    assert part["time"][0] == 0.0 and len(part["time"]) == 2000
    assert np.array_equal(part[FORCE], recording(3)[FORCE][2000:4000])


def test_thinning_takes_means() -> None:
    columns = {"time": np.arange(5.0), FORCE: np.array([1.0, 3.0, 5.0, 9.0, 100.0])}
    assert thinned(columns, 2)[FORCE].tolist() == [2.0, 7.0]


def test_pulses_become_a_known_load_that_leaves_the_balance_alone(tmp_path: Path) -> None:
    from scipy.io import savemat

    columns = recording(4)
    on = (columns["time"] > 3.0) & (columns["time"] < 4.0)
    savemat(tmp_path / "pulses.mat", {"t": columns["time"], "pulses_N": 5 * on, "gtau": 35.15})
    loaded = with_pulses_as_load(columns, tmp_path / "pulses.mat")
    pulse = columns[FORCE] - loaded[FORCE]
    assert pulse[3500] == pytest.approx(178.2, rel=1e-3) and pulse[1000] == pytest.approx(0.0, abs=1e-9)
    assert np.allclose(loaded[FORCE] - loaded[LOAD], columns[FORCE] - columns[LOAD])


# --- plans ------------------------------------------------------------------------------------------------------------


def share_samples(one: Stretch, other: Stretch) -> bool:
    """`loaded` are the samples of `pulses`."""
    same = one.run.replace("loaded", "pulses") == other.run.replace("loaded", "pulses")
    return same and one.begin < other.end and other.begin < one.end


@pytest.mark.parametrize("pair", [pair for pairs in change_hidden.PAIRS.values() for pair in pairs], ids=str)
def test_then_and_now_share_no_sample(pair: change_hidden.Pair) -> None:
    assert not any(share_samples(one, other) for one, other in product(pair.then, pair.now))


def test_there_are_enough_cases_and_both_halves_are_alike() -> None:
    plans = change_hidden.plans()
    assert len({plan.number for plan in plans}) == len(plans)
    assert sum(plan.hidden != NOTHING for plan in plans) >= 150
    assert sum(plan.hidden == NOTHING for plan in plans) >= 50
    counted = [
        Counter((plan.pairs[0].machine, plan.hidden, plan.strength) for plan in plans if plan.number % 2 == half)
        for half in HALVES
    ]
    assert counted[0] == counted[1]
    models = Counter(plan.model for plan in plans if plan.number % 2)
    assert abs(models["plain"] - models["diagnosed"]) <= 2


def test_real_changes_are_all_pairs_of_loads_and_speeds() -> None:
    told = list(change_real.truths())
    assert len({truth.number for truth, *_ in told}) == len(told)
    by_load = {frozenset((then, now)) for truth, then, now in told if truth.conditions == "load"}
    assert len(by_load) == 10 * 9 // 2 + 5 * 4 // 2
    assert all(then[0] == now[0] for truth, then, now in told if truth.conditions == "load")
    assert all(then[1] == now[1] for truth, then, now in told if truth.conditions == "speed")


def test_a_few_are_spread_over_all() -> None:
    assert chosen(list(range(1, 101)), "odd", 3) == [1, 49, 99]
    assert chosen([4, 1, 3, 2], "even", None) == [2, 4]


# --- simulated fingers ------------------------------------------------------------------------------------------------


def test_a_repeat_has_the_motion_and_other_noise() -> None:
    pytest.importorskip("mujoco", reason="SKIPPED: mujoco is not installed")
    import change_fingers as fingers
    import numpy_maxwell
    import numpy_tanh

    how = fingers.How(motion=1, noise=1, seconds=3.0)
    for simulator in (numpy_tanh, numpy_maxwell):
        one, two, other = (
            fingers.record_numpy(simulator, fingers.NO_CHANGE, each)
            for each in (how, replace(how, noise=2), replace(how, motion=2))
        )
        assert np.allclose(one.measured, two.measured, rtol=0.0, atol=1e-12)
        assert not np.array_equal(one.columns[FORCE], two.columns[FORCE])
        assert np.std(one.measured - other.measured) > 1e-3


def test_a_number_is_changed_inside_and_put_back() -> None:
    pytest.importorskip("mujoco", reason="SKIPPED: mujoco is not installed")
    import change_fingers as fingers
    import numpy_tanh
    from change_simulated import scaled

    before = numpy_tanh.COVER
    how = fingers.How(motion=1, noise=1, seconds=3.0)
    stiffer = fingers.record_numpy(numpy_tanh, scaled("COVER", 1.3, 0, shape=(2,)), how)
    usual = fingers.record_numpy(numpy_tanh, fingers.NO_CHANGE, how)
    more = stiffer.measured - usual.measured
    assert np.std(more[:, 0]) > 1e-4 and np.std(more[:, 1]) < 0.02 * np.std(more[:, 0])
    assert before == numpy_tanh.COVER


def test_an_offset_is_on_the_sensor_alone() -> None:
    pytest.importorskip("mujoco", reason="SKIPPED: mujoco is not installed")
    import change_fingers as fingers
    import numpy_tanh

    how = fingers.How(motion=1, noise=1, seconds=3.0)
    usual, off = (
        fingers.record_numpy(numpy_tanh, change, how) for change in (fingers.NO_CHANGE, fingers.Change(offset=(3, 1.5)))
    )
    moved = {name for name in usual.columns if not np.array_equal(usual.columns[name], off.columns[name])}
    assert moved == {"tendon_force[3]"}
    assert np.allclose(off.measured - usual.measured, 1.5 * numpy_tanh.ARMS[2])
