"""The list of a campaign's cases, and what its makers make: matched and foreign."""

from __future__ import annotations

import argparse
import json
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from campaign_plan import FOREIGN, STRENGTHS, planned
from effects_hidden import placed, scaled
from joint_strength import shown_strength
from matched_rig import random_hand
from tendonfmu.diagnosis.campaign.cases import Case, made, read_cases

ALL = argparse.Namespace(
    null=460, per_effect=4, strengths=list(STRENGTHS), double=60, absorbed=80, unknown=48, contact=16, foreign=1,
    seconds=60.0, rate=500.0, seed=7,
)  # fmt: skip


@pytest.fixture(scope="module")
def listed() -> list[dict[str, Any]]:
    return list(planned(ALL))


def test_the_campaign_is_as_large_as_it_has_to_be(listed: list[dict[str, Any]], tmp_path: Path) -> None:
    counts = Counter(case["group"] for case in listed)
    assert counts["null"] >= 500 and counts["single"] >= 300 and counts["absorbed"] >= 60
    assert counts["double"] >= 60 and counts["unknown"] >= 60
    measured = [case for case in listed if case["arguments"].get("gain_recordings")]
    assert len(measured) >= 200
    (tmp_path / "cases.json").write_text(json.dumps({"format": "tendonfmu-campaign-1", "cases": listed}))
    assert len(read_cases(tmp_path / "cases.json")) == len(listed)  # names are unique, keys are known


def test_a_campaign_that_is_cut_has_some_of_everything(listed: list[dict[str, Any]]) -> None:
    begun = listed[: len(listed) // 10]
    for name, least in {"null": 40, "single": 25, "double": 5, "absorbed": 7, "unknown": 5}.items():
        assert sum(case["group"] == name for case in begun) >= least
    singles = [case["arguments"].get("strength") for case in begun if case["group"] == "single"]
    assert {*STRENGTHS, None} <= set(singles)  # None: foreign
    assert {case["arguments"].get("joints") for case in begun} >= {1, 2, 4}
    assert sum(str(FOREIGN) in case["maker"] for case in begun) >= 7


def test_the_same_seed_lists_the_same_cases(listed: list[dict[str, Any]]) -> None:
    assert list(planned(ALL)) == listed
    other = list(planned(argparse.Namespace(**{**vars(ALL), "seed": 8})))
    assert {case["name"] for case in other} == {case["name"] for case in listed} and other != listed


def foreign(folder: Path, function: str, **arguments: Any) -> Case:
    folder.mkdir()
    return made(Case("a", "single", folder, maker=f"{FOREIGN}:{function}", arguments=arguments), folder)


def test_foreign_fingers_of_numpy_follow_the_seed(tmp_path: Path) -> None:
    cases = [
        foreign(tmp_path / str(k), "numpy_finger", number=8, seed=seed, seconds=4.0, gain_recordings=2)
        for k, seed in enumerate((5, 5, 6))
    ]
    texts = [case.recordings[0].read_bytes() for case in cases]
    assert texts[0] == texts[1] != texts[2]
    nominals = [json.loads(case.finger.read_text(encoding="utf-8")) for case in cases if case.finger]
    assert nominals[0] == nominals[1] != nominals[2]
    assert cases[0].truth[0].effect == "edge_friction" and "presliding" in cases[0].also
    assert len(cases[0].gain_recordings) == 2 and len(cases[0].test) == 1
    assert cases[0].facts["joints"] == 3.0 and cases[0].rig == "numpy"


def test_foreign_fingers_of_mujoco_have_the_joints_asked_for(tmp_path: Path) -> None:
    pytest.importorskip("mujoco", reason="SKIPPED: mujoco is not installed")
    for joints, number in ((1, 3), (4, 24)):
        case = foreign(
            tmp_path / str(joints), "mujoco_finger", number=number, seed=9, joints=joints, seconds=2.0, rate=250.0
        )
        assert case.finger is not None
        assert len(json.loads(case.finger.read_text(encoding="utf-8"))["joints"]) == joints
        assert case.facts["joints"] == joints and case.rig == "mujoco" and "inertia" in case.also


def test_what_a_force_sensor_adds_stays_absorbed_and_what_it_scales_shows_at_other_tensions() -> None:
    """An offset is a constant torque at every pretension; a gain grows with it."""
    bare = replace(random_hand(4, 1, rate=250.0), tension_time=8.0)
    found = {}
    for effect in ("force_offset", "force_gain"):
        hand, hidden = placed(bare, effect, 1)
        hand, _ = scaled(hand, hidden, None, motion=2, seconds=20.0)
        found[effect] = shown_strength(hand, 2, 20.0)
    assert found["force_offset"] < 0.01 and found["force_gain"] > 1.0
