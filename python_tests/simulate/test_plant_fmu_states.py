"""TendonFinger.fmu: calls that are refused, its life, saved states, solver failures."""

from __future__ import annotations

import ctypes
import json
import math
import re
from collections.abc import Callable
from ctypes import c_double
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from test_fmu_states import with_number

from fmu_binary import ERROR, OK, Instance, UnpackedFmu, unpack
from fmu_kinds import plant_kind
from plant_fmu_rig import SEED, TOLERANCE, fmu_rig, play
from plant_rigs import needs_plant
from repetitions import repeated
from repository_paths import ROOT
from tendonfmu.simulate.fmu_packaging import build_plant_fmu

pytestmark = needs_plant

NAN, INF = math.nan, math.inf
COMMAND, FORCE = "tendon_position_command[1]", "push_force[3]"
# docs/reference/simulated_finger_fmu.md: a restored run differs from the uninterrupted one by less than this many
# times the
# relative tolerance: largest difference of a joint or tendon over the largest absolute value of that same one
RESTART_ERROR = {"truth.joint_position": 100.0, "truth.tendon_force": 500.0, "truth.friction_torque": 1000.0}
INDEX_FINGER = ROOT / "examples" / "rigs" / "index_finger.json"


def running(fmu: UnpackedFmu, steps: int = 5) -> Instance:
    instance = Instance(fmu)
    instance.initialise()
    play(instance, steps)
    return instance


# --- refused calls ----------------------------------------------------------------------------------------------------


def pointer(value: object) -> object:
    return ctypes.byref(value)  # type: ignore[arg-type]


BAD_CALLS: dict[str, tuple[Callable[[Instance], int], str]] = {
    "huge input": (lambda i: i.set_real({FORCE: 1e5}), "push_force[3] = 100000: expected -10000 to 10000 N"),
    "truth written": (lambda i: i.set_real({"truth.friction_level": 1.0}), "truth.friction_level: an output is not"),
    "fixed parameter": (lambda i: i.set_real({"step": 1e-4}), "step: a fixed parameter is written before"),
    "huge step": (lambda i: i.step(0.005, 1e12), "communicationStepSize of at most 1000 s, got point 0.005 s"),
    "time going back": (lambda i: i.step(0.003), "where the last step ended, got point 0.003 s"),
    "gap": (lambda i: i.step(0.006), "where the last step ended, got point 0.006 s and step 0.001 s"),
    "directional derivative": (
        lambda i: i.call(
            "GetDirectionalDerivative",
            i.vrs(["truth.external_torque[1]"]), 1, i.vrs([FORCE]), 1, pointer(c_double(1)), pointer(c_double()),
        ),
        "providesDirectionalDerivative is false",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD_CALLS)
def test_refused_call_is_named_and_changes_no_byte(plant_fmu: UnpackedFmu, case: str) -> None:
    call, expected = BAD_CALLS[case]
    with running(plant_fmu) as instance, running(plant_fmu) as untouched:
        before, shown = instance.save(), instance.outputs()
        assert call(instance) == ERROR
        assert expected in instance.last_message
        assert instance.messages[-1][:2] == (ERROR, "logStatusError")
        assert instance.save() == before and instance.outputs() == shown
        for each in (instance, untouched):
            assert each.restore(before) == OK
        assert play(instance, 20, begin=5) == play(untouched, 20, begin=5)


@pytest.mark.parametrize(
    ("write", "expected"),
    [
        (lambda i: i.set_integer("integrator", 3), "integrator = 3: expected 1 to 2"),
        (lambda i: i.set_integer("push_link", 3), "push_link = 3: expected 1 to 2"),
        (lambda i: i.set_integer("push_link", 0), "push_link = 0: expected 1 to 2"),
        (lambda i: i.set_integer("seed", -1), "seed = -1: expected 0 to 2147483647"),
        (lambda i: i.set_real({"relative_tolerance": 1.0}), "relative_tolerance = 1: expected 1e-10 to 0.01 1"),
        (lambda i: i.set_real({"step": 0.0}), "step = 0: expected 1e-06 to 0.01 s"),
        (lambda i: i.set_real({"push_point[2]": NAN}), "push_point[2] = nan: expected -10 to 10 m"),
    ],
)
def test_settings_out_of_range(plant_fmu: UnpackedFmu, write: Callable[[Instance], int], expected: str) -> None:
    with Instance(plant_fmu) as instance:
        before = instance.save()
        assert write(instance) == ERROR and expected in instance.last_message
        assert instance.save() == before


# --- solver failures --------------------------------------------------------------------------------------------------

TOO_HARD = {FORCE: -1e4, COMMAND: 10.0, "tendon_position_command[2]": -10.0, "pretension": 1e4}


def test_a_solver_failure_leaves_the_finger_where_it_was(plant_fmu: UnpackedFmu) -> None:
    """The fixed step's: CVODE solves whatever the inputs may hold. Its own failures are tests of runtime/tests."""
    with Instance(plant_fmu) as instance, Instance(plant_fmu) as untouched:
        for each in (instance, untouched):
            assert each.set_integer("integrator", 2) == OK
            each.initialise()
            play(each, 5)
        before, shown = instance.save(), instance.outputs()
        assert instance.set_real(TOO_HARD) == OK
        assert instance.step(0.005, 1.0) == ERROR
        assert re.match(r"fmi2DoStep: .* at t = 0\.0.*: (try|check) .*", instance.last_message), instance.last_message
        assert instance.outputs() == shown
        assert instance.step(0.005) == ERROR and "not allowed in state error" in instance.last_message
        for each in (instance, untouched):
            assert each.restore(before) == OK
        assert play(instance, 50, begin=5) == play(untouched, 50, begin=5)


def test_an_initialisation_that_fails_can_be_mended(plant_fmu: UnpackedFmu) -> None:
    with Instance(plant_fmu) as instance, Instance(plant_fmu) as plain:
        assert instance.set_integer("integrator", 2) == OK and instance.set_real(TOO_HARD) == OK
        assert instance.setup() == OK and instance.call("EnterInitializationMode") == OK
        assert instance.call("ExitInitializationMode") == ERROR
        assert re.match(r"fmi2ExitInitializationMode: .* at t = -0\.3", instance.last_message), instance.last_message
        assert instance.call("Reset") == OK
        for each in (instance, plain):
            each.initialise()
        assert play(instance, 20) == play(plain, 20)


# --- saved states -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("integrator", [1, 2])
def test_restored_runs_are_equal_and_near_the_uninterrupted_one(plant_fmu: UnpackedFmu, integrator: int) -> None:
    with Instance(plant_fmu) as instance, Instance(plant_fmu) as other:
        for each in (instance, other):
            assert each.set_integer("integrator", integrator) == OK
        instance.initialise()
        play(instance, 130)
        saved = instance.save()
        uninterrupted = np.array(play(instance, 300, begin=130))
        restored = []
        for each in (instance, other, instance):
            assert each.restore(saved) == OK
            restored.append(play(each, 300, begin=130))
        assert restored[0] == restored[1] == restored[2]
        if integrator == 2:
            assert restored[0] == uninterrupted.tolist()  # to the bit
        for group, share in restart_errors(plant_fmu, np.array(restored[0]), uninterrupted, TOLERANCE).items():
            print(f"integrator {integrator}, {group}: {share:.1f} relative tolerances")
            assert share < RESTART_ERROR[group]


def restart_errors(
    fmu: UnpackedFmu, restored: NDArray[np.float64], uninterrupted: NDArray[np.float64], tolerance: float
) -> dict[str, float]:
    """By group of RESTART_ERROR: the worst of its joints or tendons, in relative tolerances."""
    share = np.abs(restored - uninterrupted).max(axis=0) / np.maximum(np.abs(uninterrupted).max(axis=0), 1e-300)
    names = fmu.names("output")
    return {
        group: float(max(share[k] for k, name in enumerate(names) if name.startswith(group)) / tolerance)
        for group in RESTART_ERROR
    }


@pytest.mark.parametrize("tolerance", repeated([1e-4, 1e-5, 1e-6, 1e-7, 1e-8], 0))
def test_the_bound_on_restored_runs_of_the_index_finger(tolerance: float, tmp_path: Path) -> None:
    """Five cuts, a second each, as docs/reference/simulated_finger_fmu.md says."""
    fmu = unpack(build_plant_fmu(INDEX_FINGER, tmp_path / "index.fmu"), tmp_path / "index")

    def second(instance: Instance, begin: int) -> NDArray[np.float64]:
        rows = []
        for k in range(begin, begin + 1000):
            assert instance.step(k * 0.001, 0.001) == OK
            rows.append(instance.outputs())
        return np.array(rows)

    # the restored run is another instance's: a restored one would differ from itself no more
    with Instance(fmu) as instance, Instance(fmu) as other:
        assert instance.set_real({"relative_tolerance": tolerance}) == OK
        instance.initialise()
        assert instance.step(0.0, 1.5) == OK
        for begin in range(1500, 6500, 1000):
            assert other.restore(instance.save()) == OK
            errors = restart_errors(fmu, second(other, begin), second(instance, begin), tolerance)
            print(f"{tolerance:g}, cut at {begin} ms: {errors}")
            assert all(0.0 < errors[group] < bound for group, bound in RESTART_ERROR.items()), errors


@pytest.mark.parametrize("state", "ims")
def test_states_of_another_rig_of_the_same_size_are_refused(plant_fmu: UnpackedFmu, state: str, tmp_path: Path) -> None:
    """Also before the finger has settled, when they hold nothing of it."""
    (tmp_path / "rig.json").write_text(json.dumps(fmu_rig(seed=SEED + 1)))
    heavier = unpack(build_plant_fmu(tmp_path / "rig.json", tmp_path / "heavier.fmu"), tmp_path / "heavier")
    with plant_kind(plant_fmu).brought_to(state) as instance, plant_kind(heavier).brought_to(state) as other:
        before = other.save()
        assert len(instance.save()) == len(before)
        assert other.restore(instance.save()) == ERROR
        assert "state of another FMU" in other.last_message
        assert other.save() == before


def test_a_damaged_state_of_a_finger_that_has_not_settled_is_refused(plant_fmu: UnpackedFmu) -> None:
    """Its plant is zeros; with a checksum that fits, anything else was ignored."""
    with Instance(plant_fmu) as instance:
        before = instance.save()
        assert instance.restore(with_number(before, (len(before) - 48) // 8, 1.0)) == ERROR
        assert "damaged state: a number" in instance.last_message
        assert instance.save() == before


def test_a_state_of_other_settings_brings_them(plant_fmu: UnpackedFmu) -> None:
    with Instance(plant_fmu) as fixed, running(plant_fmu) as instance:
        assert fixed.set_integer("integrator", 2) == OK
        fixed.initialise()
        play(fixed, 50)
        saved = fixed.save()
        for each in (fixed, instance):
            assert each.restore(saved) == OK
        assert instance.get_integers(["integrator"]) == [2]
        assert play(instance, 50, begin=50) == play(fixed, 50, begin=50)
