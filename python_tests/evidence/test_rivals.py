"""The rivals of a diagnosis: each finds what its theory says it finds, and the table asks everybody the same."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from evidence.diagnosis import makers
from evidence.diagnosis.case import Case
from evidence.diagnosis.makers import Options
from evidence.diagnosis.rival_methods import (
    Plain,
    Trial,
    by_bic,
    by_correlation,
    by_parity,
    by_random_cv,
    parity_relations,
    signature_matrix,
    stepwise,
)
from evidence.diagnosis.rivals import Answer, judged, markdown, rival_answers
from evidence.judge import Truth
from tendonfmu.diagnosis.cause import Where

ARMS = np.array([[0.01, 0.008], [-0.01, 0.008], [0.0, -0.009]])
STEP = 0.01


def columns_at_joints(rng: np.random.Generator, joints: list[int], blocks: int = 4000) -> Plain:
    """A column of slow random values for each of `joints` (from 0, of 2), whose torque is at that joint alone."""
    columns = np.zeros((blocks, 2, len(joints)))
    for k, joint in enumerate(joints):
        columns[:, joint, k] = np.repeat(rng.standard_normal(blocks // 50), 50)
    names = ("gravity", "inertia", "backlash", "stribeck", "cover_stiffness", "joint_coupling")
    trials = tuple(Trial(Where(names[k], joint + 1), slice(k, k + 1)) for k, joint in enumerate(joints))
    return Plain(rng.standard_normal(2 * blocks), columns.reshape(2 * blocks, -1), trials)


def with_cause(data: Plain, number: int, size: float) -> Plain:
    return Plain(data.target + size * data.columns[:, number], data.columns, data.trials)


@pytest.mark.parametrize("way", [by_correlation, by_bic, by_random_cv])
def test_in_white_noise_the_first_name_is_right(way: Any) -> None:
    for seed in range(5):
        data = with_cause(columns_at_joints(np.random.default_rng(seed), [0, 1, 0, 1]), 2, 0.3)
        assert stepwise(data, way)[0].where == Where("backlash", 1)


# --- parity -----------------------------------------------------------------------------------------------------------


def test_a_tendons_parity_relation_does_not_see_its_force() -> None:
    relations = parity_relations(ARMS)
    assert len(relations) == 5
    for arms, directions in zip(ARMS, relations[2:], strict=True):
        assert np.abs(arms @ directions).max() < 1e-15
        assert directions.T @ directions == pytest.approx(np.eye(1))
    assert len(parity_relations(np.array([[0.01], [-0.01]]))) == 1


def test_parity_names_all_effects_with_the_signature() -> None:
    data = columns_at_joints(np.random.default_rng(4), [0, 1, 0])
    signatures = signature_matrix(data, parity_relations(ARMS))
    # joint 2 alone: seen by all but the balance of joint 1; the third tendon pulls at joint 2 alone
    assert signatures[Where("inertia", 2)].tolist() == [False, True, True, True, False]
    assert signatures[Where("gravity", 1)].tolist() == [True, False, True, True, True]
    parity = by_parity(with_cause(data, 2, 1.0), ARMS, STEP)
    assert parity.causes == [Where("gravity", 1), Where("backlash", 1)]
    assert by_parity(with_cause(with_cause(data, 0, 1.0), 1, 1.0), ARMS, STEP).causes == []


# --- on a recording ---------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def case() -> Case:
    """A spring that the description lacks, ten times the noise's variance."""
    options = Options(seconds=20.0, test=10.0, joints=1)
    return makers.single(11, options, "cover_stiffness", 10.0)


@pytest.mark.long
@pytest.mark.slow
def test_each_rival_answers_on_a_recording(case: Case) -> None:
    answers = rival_answers(case)
    assert {"correlation", "bic", "random_cv", "parity"} <= set(answers)
    assert "cover_stiffness" in [cause["effect"] for cause in answers["bic"].causes]
    assert answers["parity"].one_of and answers["parity"].unnamed is False


# --- the table --------------------------------------------------------------------------------------------------------


def made_case(*truths: Truth) -> Case:
    return Case("numpy", {}, [], truths=truths)


def causes(*listed: tuple[str, int | None, int | None]) -> list[dict[str, Any]]:
    return [{"effect": effect, "joint": joint, "tendon": tendon} for effect, joint, tendon in listed]


NEUTRAL = ("presliding", "unknown")  # on foreign fingers
GRAVITY, NOTHING = Truth(("gravity",), 1, neutral=NEUTRAL), Truth(neutral=NEUTRAL)


def test_presliding_is_false_on_matched_rigs_alone() -> None:
    answer = Answer(causes(("presliding", None, None)))
    assert judged(made_case(NOTHING), answer)["false"] == 0
    assert judged(made_case(), answer)["false"] == 1


def test_a_set_without_an_order_is_first_only_alone() -> None:
    two = causes(("inertia", 1, None), ("gravity", 1, None))
    row = judged(made_case(GRAVITY), Answer(two, one_of=True))
    assert [row[key] for key in ("false", "in_set", "first", "at_place", "set_size")] == [0, True, False, True, 2]
    alone = judged(made_case(GRAVITY), Answer(causes(("gravity", 2, None)), one_of=True))
    assert (alone["first"], alone["at_place"], alone["set_size"]) == (True, False, 1)
    ordered = judged(made_case(GRAVITY), Answer(two))
    assert [ordered[key] for key in ("false", "in_set", "first", "at_place")] == [1, True, False, True]


def test_the_table_has_a_column_for_each() -> None:
    def row(named: Answer) -> dict[str, Any]:
        answers = {"diagnose": named, "parity": Answer(unnamed=True)}
        verdicts = {who: judged(made_case(), answer) for who, answer in answers.items()}
        return {"group": "null", "rig": "numpy", "error": "", "answers": verdicts}

    rows = [row(Answer()), row(Answer(causes(("gravity", 1, None)))), {"error": "InputError: x"}]
    lines = markdown(rows).splitlines()
    assert lines[0] == "|  | diagnose | parity |"
    assert "| foreign, nothing hidden: names something | 1/2 | 0/2 |" in lines
    assert lines[-1].startswith("1 of 3 cases")
