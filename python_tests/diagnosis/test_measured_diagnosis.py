"""The diagnosed models of EMPS, the da Vinci jaw and PSM hold: needs ../shared/data or $TENDONFMU_DATA."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

import tendonfmu as tf
from evidence import machines
from optional_parts import needs

emps = needs("emps data")
davinci = needs("davinci data")
psm = needs("psm data")
EMPS_LIMITS = {machines.PLAIN: 2.2, machines.PULSES: 3.1}  # % of the force
JAW_LIMIT = 0.008  # N·m
STALL = (17.08, 17.45)  # s, run 07


@emps
@pytest.mark.parametrize(("name", "limit"), EMPS_LIMITS.items())
def test_the_diagnosed_carriage_misses_little_of_the_force(name: str, limit: float) -> None:
    assert machines.share_missed(machines.HERE / "emps" / "extended.json", machines.emps_run(name)) <= limit


def jaw_error(model: Any) -> float:
    """rms of compensated minus external torque over the odd loads, N·m, before run 07 jams."""
    odd = [machines.jaw_run(name) for name in machines.ODD]
    return float(machines.errors(model, odd, 1, "compensated_torque")[0])


@davinci
def test_the_diagnosed_jaw_tells_the_torque_at_loads_it_was_not_trained_on() -> None:
    assert jaw_error(machines.HERE / "davinci" / "extended.json") <= JAW_LIMIT
    assert jaw_error(machines.HERE / "davinci" / "nominal.json") > 2 * JAW_LIMIT


@emps
@pytest.mark.long
def test_the_carriage_s_causes_are_named() -> None:
    """The published cause, and those that the publication does not have; nothing of the mass, which is known."""
    machine = machines.emps()
    found = tf.diagnose(machine.finger, machine.learned, kinematics=3)
    named = [cause.effect for cause in found.causes]
    assert {"asymmetric_friction", "time_delay", "stribeck"} <= set(named[:3])
    assert "inertia" not in named
    assert found.extended.data["extensions"]
    assert machines.share_missed(found.extended, machine.learned[0]) <= EMPS_LIMITS[machines.PLAIN]


@davinci
@pytest.mark.long
def test_the_jaw_s_causes_are_named_and_its_stall_is_an_event() -> None:
    even, odd = ([machines.jaw_run(k, whole=True) for k in names] for names in (machines.EVEN, machines.ODD))
    found = tf.diagnose(machines.HERE / "davinci" / "nominal.json", even, test=odd)
    growing = {"load_friction", "joint_load_friction", "edge_friction"}
    named = [cause.effect for cause in found.causes[:3]]
    assert "presliding" in named and growing & set(named)
    stalls = [event for event in found.found.events if Path(event.recording).stem == "07"]
    assert any(event.start < STALL[1] and event.end > STALL[0] for event in stalls)
    assert jaw_error(found.extended) <= JAW_LIMIT


@psm
@pytest.mark.long
def test_the_arm_s_inertia_varies_as_it_folds() -> None:
    machine = machines.psm(1, 2)
    unseen = next(iter(machine.judged.values()))
    report = tf.diagnose(machine.finger, machine.learned, test=unseen, kinematics=3).report
    cause = report["causes"][0]
    assert (cause["effect"], cause["joint"]) == ("inertia_variation", 1)
    assert max(report["extended"]["test_rms"]) < 0.15  # N·m, of efforts of 0.8
