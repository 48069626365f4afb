"""Cases of a change are what they say: other samples then and now, the change at its strength, the halves alike."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from evidence.diagnosis import change_measured, changes
from evidence.diagnosis.case import Case, Run
from evidence.diagnosis.change_measured import (
    ARM,
    LOAD_NAMES,
    OLDER,
    UNCHANGED,
    Stretch,
    changed_case,
    check_sound,
    hide,
    real_plans,
    with_pulses_as_load,
)
from evidence.diagnosis.changes import WITH, answer_of, markdown, run_case
from evidence.diagnosis.measured import (
    EFFECTS,
    FORCE,
    SPEED,
    Array,
    Columns,
    Description,
    Machine,
    built_up,
    diagnosed_model,
    first_magnitude,
    magnitude_of,
    residual,
)
from evidence.diagnosis.measured import LOAD as LOAD_TORQUE
from evidence.judge import Truth
from optional_parts import require

RATE, COULOMB, VISCOUS, NOISE, PRESLIDING = 1000.0, 8.0, 30.0, 0.5, 1e-5


def recording(seed: int, noise: float = NOISE) -> Columns:
    """A carriage that moves back and forth for 10 s under a load that varies; `model` is exact but for the noise."""
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
        LOAD_TORQUE: load,
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


NOW = machine(2)


def added(altered: Columns) -> Array:
    return np.asarray(altered[FORCE] - NOW.recordings["run 2"][FORCE])


@pytest.mark.parametrize("name", sorted(EFFECTS))
def test_a_change_grows_with_its_size_and_touches_no_motion(name: str) -> None:
    change, columns = EFFECTS[name], NOW.recordings["run 2"]
    size = first_magnitude(change, NOW)
    small, large = (change.put(NOW, columns, share * size) for share in (0.5, 1.0))
    assert 0.0 < np.std(added(small)) < np.std(added(large))
    assert {key for key in columns if not np.array_equal(columns[key], large[key])} == {FORCE}


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
    for name, change in EFFECTS.items()
    for effect in change.names
    if effect in change.signs and effect in GROWN
]


@pytest.mark.parametrize(("name", "effect"), SIGNED)
def test_the_sign_of_the_truth_is_that_of_the_models_own_number(name: str, effect: str) -> None:
    """What the change adds to the residual is what the model with more, or less, of the effect takes off it."""
    change, columns = EFFECTS[name], NOW.recordings["run 2"]
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
    friction = hide(NOW, EFFECTS["coulomb"], 1.0, NOW)
    assert friction.by == "whole" and friction.survives_now < 0.02
    assert friction.magnitude == pytest.approx(noise, rel=0.1)  # a square wave of the noise's variance
    spring = hide(NOW, EFFECTS["spring"], 1.0, NOW)
    assert spring.by == "survives_now" and spring.survives_now == pytest.approx(1.0, rel=0.03)


def test_what_no_sound_magnitude_has_is_refused() -> None:
    with pytest.raises(ValueError, match="strength 1: no sound magnitude"):
        hide(NOW, replace(EFFECTS["delay"], most=1e-6), 1.0, NOW)
    with pytest.raises(ValueError, match=r"N\.m that are sound"):
        check_sound(20.0 * np.sign(NOW.recordings["run 2"][SPEED]), NOW)


@pytest.mark.parametrize(("power", "first"), [(2.0, 0.01), (2.0, 50.0), (0.5, 1e-3), (6.0, 3.0)])
def test_the_search_for_a_strength_finds_it_from_anywhere(power: float, first: float) -> None:
    magnitude = magnitude_of(0.3, lambda size: (size / 4.0) ** power, first, 100.0)
    assert (magnitude / 4.0) ** power == pytest.approx(0.3, rel=0.03)


# --- recordings -------------------------------------------------------------------------------------------------------


def test_pulses_become_a_known_load_that_leaves_the_balance_alone(tmp_path: Path) -> None:
    from scipy.io import savemat

    columns = recording(4)
    on = (columns["time"] > 3.0) & (columns["time"] < 4.0)
    savemat(tmp_path / "pulses.mat", {"t": columns["time"], "pulses_N": 5 * on, "gtau": 35.15})
    loaded = with_pulses_as_load(columns, tmp_path / "pulses.mat")
    pulse = columns[FORCE] - loaded[FORCE]
    assert pulse[3500] == pytest.approx(178.2, rel=1e-3) and pulse[1000] == pytest.approx(0.0, abs=1e-9)
    assert np.allclose(loaded[FORCE] - loaded[LOAD_TORQUE], columns[FORCE] - columns[LOAD_TORQUE])


# --- plans ------------------------------------------------------------------------------------------------------------


def share_samples(one: Stretch, other: Stretch) -> bool:
    """`loaded` are the samples of `pulses`."""
    same = one.run.replace("loaded", "pulses") == other.run.replace("loaded", "pulses")
    return same and one.begin < other.end and other.begin < one.end


@pytest.mark.parametrize("pair", [pair for pairs in change_measured.PAIRS.values() for pair in pairs])
def test_then_and_now_share_no_sample(pair: change_measured.Pair) -> None:
    assert not any(share_samples(one, other) for one, other in product(pair.then, pair.now))


@pytest.mark.parametrize(("machines", "cases", "unchanged"), [(OLDER, 258, 84), (ARM, 128, 32)])
def test_both_halves_are_alike(machines: tuple[str, ...], cases: int, unchanged: int) -> None:
    plans = change_measured.plans(machines)
    assert len({plan.number for plan in plans}) == len(plans) == cases
    assert sum(plan.hidden == UNCHANGED for plan in plans) == unchanged
    counted = [
        Counter((plan.pairs[0].machine, plan.hidden, plan.strength) for plan in plans if plan.number % 2 == half)
        for half in (0, 1)
    ]
    assert counted[0] == counted[1]
    models = Counter(plan.model for plan in plans if plan.number % 2)
    assert abs(models["plain"] - models["diagnosed"]) <= 2


def test_real_changes_are_all_pairs_of_loads_and_speeds() -> None:
    plans = list(real_plans())
    assert len({number for number, *_ in plans}) == len(plans)
    by_load = {frozenset((then, now)) for _, conditions, _, then, now in plans if conditions == "load"}
    assert len(by_load) == 10 * 9 // 2 + 5 * 4 // 2
    assert all(then[0] == now[0] for _, conditions, _, then, now in plans if conditions == "load")
    assert all(then[1] == now[1] for _, conditions, _, then, now in plans if conditions == "speed")


# --- simulated fingers ------------------------------------------------------------------------------------------------


@pytest.fixture
def simulated() -> Any:
    require("mujoco")
    from evidence.diagnosis import change_simulated

    return change_simulated


def test_a_repeat_has_the_motion_and_other_noise(simulated: Any) -> None:
    how = simulated.How(motion=1, noise=1, seconds=3.0)
    for simulator in (simulated.numpy_tanh, simulated.numpy_maxwell):
        record = partial(simulated.record, simulator, simulated.NONE)
        one, two, other = map(record, (how, replace(how, noise=2), replace(how, motion=2)))
        assert np.allclose(one.measured, two.measured, rtol=0.0, atol=1e-12)
        assert not np.array_equal(one.columns[FORCE], two.columns[FORCE])
        assert np.std(one.measured - other.measured) > 1e-3


def test_a_number_is_changed_inside_and_put_back(simulated: Any) -> None:
    tanh, how = simulated.numpy_tanh, simulated.How(motion=1, noise=1, seconds=3.0)
    before = tanh.COVER
    differences = (simulated.scaled("COVER", 1.3, 0, shape=(2,)), simulated.NONE)
    stiffer, usual = (simulated.record(tanh, difference, how).measured for difference in differences)
    more = np.std(stiffer - usual, axis=0)
    assert more[0] > 1e-4 and more[1] < 0.02 * more[0] and before == tanh.COVER


# --- rows and tables --------------------------------------------------------------------------------------------------

MORE_FRICTION = Truth(("joint_friction",), joint=1, tendon=1, signs={"joint_friction": 1})


def cause(effect: str, **more: Any) -> dict[str, Any]:
    return {"effect": effect, "joint": 1, "tendon": None, **more}


def change(hidden: str, truth: Truth, conditions: str = "part") -> Case:
    columns = {"time": np.arange(3.0), FORCE: np.arange(3.0)}
    strength = 0.3 if truth.effects else 0.0
    return changed_case("emps", "plain", hidden, conditions, {"name": "a"}, [columns], [columns], truth, strength)


def row(bed: str, of: Case, *causes: dict[str, Any], exit_code: int = 0) -> dict[str, Any]:
    report = {"verdict": "explained", "causes": list(causes)} if exit_code == 0 else None
    answer = answer_of(of, WITH, Run(exit_code, "broken", 2.0, 300.0, report))
    return {"bed": bed, "name": "a", **of.facts, "answers": [answer]}


def test_tables_count_cases_apart_by_what_they_hide() -> None:
    nothing, coulomb = change(UNCHANGED, Truth(joint=1, tendon=1)), change("coulomb", MORE_FRICTION)
    load = change("other_load", Truth(LOAD_NAMES), "load")
    taken_up = row("hidden", coulomb) | {"by": "whole"}
    taken_up["answers"] = [answer | {"asked": "no reference"} for answer in taken_up["answers"]]
    rows = [
        taken_up,
        row("hidden", nothing),
        row("hidden", nothing, cause("gravity")),
        row("hidden", nothing, exit_code=3),
        row("hidden", coulomb, cause("joint_friction", reference=1.0, now=1.3)),
        row("real", load, cause("contact")),
        row("real", load, cause("load_friction")),
        {"bed": "hidden", "impossible": "no sound magnitude"},
    ]
    text = markdown(rows)
    assert "7 answers, 1 without a report; 8 cases, 1 that cannot be made." in text and "exit 3: broken" in text
    assert "| reference | 1/2 (1 to 99 %) | 1/2 (1 to 99 %) | 0/2 (0 to 84 %) | 2.0, 2.0 |" in text
    assert "1 answers without a reference are left out" in text and "| no reference |" not in text
    once = "1/1 (3 to 100 %)"
    assert f"| reference | 0.3 | {once} | {once} | {once} | {once} | 0/1 (0 to 98 %) | 2.0, 2.0 |" in text
    assert "| reference | plain | 1/2 (1 to 99 %) | 1/2 (1 to 99 %) | 0/2 (0 to 84 %) | 0/2 (0 to 84 %) |" in text


def test_the_reference_is_given_only_where_it_is_asked_for(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    calls = []

    def run(case: Case, with_reference: bool) -> Run:
        calls.append(case.write(tmp_path, with_reference))
        assert all((tmp_path / name).is_file() for name in calls[-1] if name.endswith((".json", ".parquet")))
        return Run(0, "", 1.0, 1.0, {"verdict": "adequate", "causes": []})

    def impossible() -> Case:
        raise ValueError("no sound magnitude")

    makers = {1: lambda: change("coulomb", MORE_FRICTION), 2: impossible}
    monkeypatch.setattr(changes, "makers", lambda bed: makers)
    monkeypatch.setattr(changes, "run_command", run)
    assert [answer["in_set"] for answer in run_case("hidden", 1)["answers"]] == [False, False]
    base, kinematics = ["finger.json", "recording_1.parquet"], ["--kinematics", "3"]
    assert calls == [[*base, "--reference", "reference_1.parquet", *kinematics], [*base, *kinematics]]
    assert run_case("hidden", 2) == {"bed": "hidden", "impossible": "no sound magnitude"}


def test_what_the_machine_lacks_anyway_is_not_false_beside_a_change(monkeypatch: pytest.MonkeyPatch) -> None:
    found = {"before": [cause("gravity")], "after": [cause("gravity"), cause("backlash")]}

    def run(case: Case, with_reference: bool) -> Run:
        causes = found["before" if case.recordings is case.unaltered else "after"]
        return Run(0, "", 1.0, 1.0, {"verdict": "explained", "causes": causes})

    of = change("coulomb", MORE_FRICTION)
    monkeypatch.setattr(changes, "makers", lambda bed: {1: lambda: replace(of, unaltered=list(of.recordings))})
    monkeypatch.setattr(changes, "run_command", run)
    with_it, without = (answer["false"] for answer in run_case("hidden", 1)["answers"])
    assert tuple(with_it) == ("gravity", "backlash") and tuple(without) == ("backlash",)
