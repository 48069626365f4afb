"""The rivals of a diagnosis: each finds what its theory says it finds, and the table asks everybody the same."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from repository_paths import ROOT
from tendonfmu.diagnosis.campaign.cases import Case
from tendonfmu.diagnosis.result import Where

sys.path += [str(ROOT / "bench"), str(ROOT / "python_tests" / "hidden_effects")]

import cases as matched
from diagnosis_rivals import beside
from diagnosis_rivals_table import judged, markdown
from rival_columns import Plain, Trial
from rival_knockoffs import by_knockoffs
from rival_parity import by_parity, detected, parity_relations, signature_matrix
from rival_selection import by_bic, by_correlation, by_random_cv, stepwise

ARMS = np.array([[0.01, 0.008], [-0.01, 0.008], [0.0, -0.009]])
STEP = 0.01


def columns_at_joints(rng: np.random.Generator, joints: list[int], blocks: int = 4000) -> Plain:
    """A column of slow random values for each of `joints` (from 0, of 2), whose torque is at that joint alone."""
    found = np.zeros((blocks, 2, len(joints)))
    for k, joint in enumerate(joints):
        found[:, joint, k] = np.repeat(rng.standard_normal(blocks // 50), 50)
    names = ("gravity", "inertia", "backlash", "stribeck", "cover_stiffness", "joint_coupling")
    trials = tuple(Trial(Where(names[k], joint + 1), slice(k, k + 1)) for k, joint in enumerate(joints))
    return Plain(rng.standard_normal(2 * blocks), found.reshape(2 * blocks, -1), trials)


def with_cause(data: Plain, number: int, size: float) -> Plain:
    return Plain(data.target + size * data.columns[:, number], data.columns, data.trials)


@pytest.mark.parametrize("way", [by_correlation, by_bic, by_random_cv])
def test_in_white_noise_the_first_name_is_right(way: Any) -> None:
    for seed in range(5):
        data = with_cause(columns_at_joints(np.random.default_rng(seed), [0, 1, 0, 1]), 2, 0.3)
        assert stepwise(data, way)[0].where == Where("backlash", 1)


def test_the_correlation_keeps_its_level_in_white_noise() -> None:
    drawn = (columns_at_joints(np.random.default_rng(seed), [0, 1, 0]) for seed in range(100))
    assert sum(bool(stepwise(data, by_correlation)) for data in drawn) <= 5  # 1 % of 100: P(> 5) < 1e-3


def test_knockoffs_name_what_is_there() -> None:
    pytest.importorskip("knockpy", reason="SKIPPED: knockpy is not installed (requirements-diagnosis-peers.lock)")
    for seed in range(3):
        data = with_cause(columns_at_joints(np.random.default_rng(seed), [0, 1, 0, 1, 0, 1]), 3, 0.5)
        assert by_knockoffs(data)[0].where == Where("stribeck", 2)


# --- parity -----------------------------------------------------------------------------------------------------------


def test_a_tendons_parity_relation_does_not_see_its_force() -> None:
    relations = parity_relations(ARMS)
    assert len(relations) == 5
    for arms, directions in zip(ARMS, relations[2:], strict=True):
        assert np.abs(arms @ directions).max() < 1e-15
        assert directions.T @ directions == pytest.approx(np.eye(1))
    assert len(parity_relations(np.array([[0.01], [-0.01]]))) == 1


def test_parity_keeps_its_level_in_white_noise() -> None:
    relations = parity_relations(ARMS)
    rng = np.random.default_rng(3)
    alarms = sum(bool(detected(rng.standard_normal((4000, 2)), relations, STEP).any()) for _ in range(200))
    assert alarms <= 8  # 1 % of 200: P(> 8) < 1e-3


def test_parity_names_all_effects_with_the_signature() -> None:
    data = columns_at_joints(np.random.default_rng(4), [0, 1, 0])
    signatures = signature_matrix(data, parity_relations(ARMS))
    # joint 2 alone: seen by all but the balance of joint 1; the third tendon pulls at joint 2 alone
    assert signatures[Where("inertia", 2)].tolist() == [False, True, True, True, False]
    assert signatures[Where("gravity", 1)].tolist() == [True, False, True, True, True]
    found = by_parity(with_cause(data, 2, 1.0), ARMS, STEP)
    assert found.causes == [Where("gravity", 1), Where("backlash", 1)]
    assert by_parity(with_cause(with_cause(data, 0, 1.0), 1, 1.0), ARMS, STEP).causes == []


# --- on a recording ---------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> Case:
    """A spring that the description lacks, ten times the noise's variance."""
    folder = tmp_path_factory.mktemp("rivals")
    made = matched.single(folder, "cover_stiffness", 10.0, 11, seconds=20.0, test=10.0, joints=1)
    return Case(
        "case",
        "single",
        folder,
        finger=folder / made["finger"],
        recordings=(folder / "recording.parquet",),
        test=(folder / "test.parquet",),
        kinematics=made["kinematics"],
    )


@pytest.mark.long
@pytest.mark.slow
def test_each_rival_answers_on_a_recording(case: Case) -> None:
    answered = beside(case)
    assert {"correlation", "bic", "random_cv", "parity", "discrepancy"} <= set(answered)
    assert "cover_stiffness" in [where.effect for where in answered["bic"].names]
    assert answered["parity"].alarm and answered["parity"].one_of
    assert answered["discrepancy"].names == ()


@pytest.mark.long
def test_the_discrepancy_predicts_where_it_has_learned(case: Case) -> None:
    """A correction with the wrong sign, or late, would make it worse. 70 % (1 − 1/√11) is what there is at most, and
    the bias filter takes most of a slow torque without any model."""
    learned = beside(replace(case, test=case.recordings))["discrepancy"].gain
    unseen = beside(case)["discrepancy"].gain
    assert learned is not None and unseen is not None
    assert 0.1 < learned < 0.7 and unseen < learned


# --- the table --------------------------------------------------------------------------------------------------------


def row(group: str, rig: str = "numpy", **given: Any) -> dict[str, Any]:
    silent = {"causes": "[]", "parity.causes": "[]", "parity.cause_count": 0, "gain": 0.0}
    discrepancy = {"discrepancy.causes": "[]", "discrepancy.cause_count": 0, "discrepancy.gain": 0.1}
    return {"name": "x", "group": group, "rig": rig, "error": "", "joints": 2.0, **silent, **discrepancy, **given}


def listed(*causes: tuple[str, int | None, int | None]) -> str:
    return json.dumps([{"effect": effect, "joint": joint, "tendon": tendon} for effect, joint, tendon in causes])


def test_presliding_is_false_on_matched_rigs_alone() -> None:
    causes = listed(("presliding", None, None))
    assert judged(row("null", causes=causes), "diagnose").false == 0
    assert judged(row("null", rig="matched, static", causes=causes), "diagnose").false == 1


def test_a_set_without_an_order_is_first_only_alone() -> None:
    true = {"true_effect": "gravity", "true_joint": 1.0, "true_tendon": None}
    two = listed(("inertia", 1, None), ("gravity", 1, None))
    found = judged(row("single", **true, **{"parity.causes": two}), "parity")
    assert (found.false, found.in_set, found.first, found.at_place, found.set_size) == (0, True, False, True, 2)
    alone = judged(row("single", **true, **{"parity.causes": listed(("gravity", 2, None))}), "parity")
    assert (alone.first, alone.at_place, alone.set_size) == (True, False, 1)
    own = judged(row("single", **true, causes=two), "diagnose")
    assert (own.false, own.in_set, own.first, own.at_place) == (1, True, False, True)


def test_what_a_simulator_has_anyway_is_not_false() -> None:
    true = {"true_effect": "gravity", "true_joint": 1.0, "true_tendon": None, "simulated_too": "inertia,stribeck"}
    assert judged(row("single", **true, causes=listed(("inertia", 1, None))), "diagnose").false == 0


def test_the_table_has_a_column_for_each_and_says_what_names_nothing() -> None:
    rows = [row("null"), row("null", causes=listed(("gravity", 1, None))), row("null") | {"error": "InputError: x"}]
    lines = markdown(rows).splitlines()
    assert lines[0] == "|  | diagnose | parity | discrepancy |"
    assert "| foreign, nothing hidden: names something | 1 of 2 | 0 of 2 | names nothing |" in lines
    assert (
        "| foreign, nothing hidden: gain, median and range | 0.0 % (0.0 to 0.0) | – | 10.0 % (10.0 to 10.0) |" in lines
    )
    assert lines[-1] == "1 of 3 cases ended in an error and are left out."
