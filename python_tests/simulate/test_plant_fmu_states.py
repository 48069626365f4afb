"""TendonFinger.fmu: calls that are refused, its life, saved states, solver failures."""

from __future__ import annotations

import ctypes
import json
import math
import pickle
import re
import struct
import subprocess
import sys
from collections.abc import Callable
from ctypes import c_double, c_int, c_size_t, c_void_p
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from test_fmu_states import STATES, TABLE, checksum

from fmu_binary import DISCARD, ERROR, OK, WARNING, Instance, UnpackedFmu, unpack
from plant_fmu_rig import SEED, TOLERANCE, fmu_rig, play
from plant_rigs import needs_plant
from repetitions import repeated
from repository_paths import ROOT, SUPPORT
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


def brought_to(fmu: UnpackedFmu, state: str) -> Instance:
    instance = Instance(fmu)
    if state == "initializationMode":
        assert instance.setup() == OK and instance.call("EnterInitializationMode") == OK
    elif state != "instantiated":
        instance.initialise()
        play(instance, 5)
    if state == "terminated":
        assert instance.call("Terminate") == OK
    if state == "error":
        assert instance.step(-1.0) == ERROR
    return instance


# --- refused calls ----------------------------------------------------------------------------------------------------


def pointer(value: object) -> object:
    return ctypes.byref(value)  # type: ignore[arg-type]


def set_boolean(instance: Instance, name: str) -> int:
    return instance.call("SetBoolean", instance.vrs([name]), 1, pointer(c_int(0)))


BAD_CALLS: dict[str, tuple[Callable[[Instance], int], str]] = {
    "NaN input": (lambda i: i.set_real({COMMAND: NAN}), "tendon_position_command[1] = nan: expected -10 to 10 m"),
    "infinite input": (lambda i: i.set_real({"pretension": INF}), "pretension = inf: expected -10000 to 10000 N"),
    "huge input": (lambda i: i.set_real({FORCE: 1e5}), "push_force[3] = 100000: expected -10000 to 10000 N"),
    "second of two": (lambda i: i.set_real({FORCE: 1.0, "push_force[1]": NAN}), "push_force[1] = nan"),
    "output written": (lambda i: i.set_real({"truth.slack[1]": 1.0}), "truth.slack[1] is of type Boolean"),
    "truth written": (lambda i: i.set_real({"truth.friction_level": 1.0}), "truth.friction_level: an output is not"),
    "fixed parameter": (lambda i: i.set_real({"step": 1e-4}), "step: a fixed parameter is written before"),
    "fixed integer": (lambda i: i.set_integer("seed", 2), "seed: a fixed parameter is written before"),
    "fixed boolean": (lambda i: set_boolean(i, "sensors"), "sensors: a fixed parameter is written before"),
    "unknown reference": (
        lambda i: i.call("GetReal", pointer(c_int(99)), 1, pointer(c_double())),
        "fmi2GetReal: no variable has the value reference 99",
    ),
    "wrong type": (lambda i: i.set_integer(FORCE, 1), "push_force[3] is of type Real, expected Integer"),
    "NULL values": (lambda i: i.call("SetReal", i.vrs([FORCE]), 1, None), "fmi2SetReal: value is NULL"),
    "step of zero": (lambda i: i.step(0.005, 0.0), "expected a finite communicationStepSize above 0 s"),
    "negative step": (lambda i: i.step(0.005, -0.1), "above 0 s, got point 0.005 s and step -0.1"),
    "NaN step": (lambda i: i.step(0.005, NAN), "and step nan s"),
    "infinite step": (lambda i: i.step(0.005, INF), "and step inf s"),
    "huge step": (lambda i: i.step(0.005, 1e12), "communicationStepSize of at most 1000 s, got point 0.005 s"),
    "NaN point": (lambda i: i.step(NAN), "currentCommunicationPoint = nan s: expected a finite number"),
    "time going back": (lambda i: i.step(0.003), "where the last step ended, got point 0.003 s"),
    "gap": (lambda i: i.step(0.006), "where the last step ended, got point 0.006 s and step 0.001 s"),
    "input derivatives": (
        lambda i: i.call("SetRealInputDerivatives", i.vrs([FORCE]), 1, pointer(c_int(1)), pointer(c_double())),
        "canInterpolateInputs is false",
    ),
    "directional derivative": (
        lambda i: i.call(
            "GetDirectionalDerivative",
            i.vrs(["truth.external_torque[1]"]), 1, i.vrs([FORCE]), 1, pointer(c_double(1)), pointer(c_double()),
        ),
        "providesDirectionalDerivative is false",
    ),
    "cancelled step": (lambda i: i.call("CancelStep"), "fmi2CancelStep: not allowed in state stepComplete"),
    "no state": (lambda i: i.call("SetFMUstate", None), "fmi2SetFMUstate: FMUstate is NULL"),
    "model exchange": (lambda i: i.library.fmi2EnterEventMode(c_void_p(i.component)), "belongs to model exchange"),
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


@pytest.mark.parametrize("state", STATES)
@pytest.mark.parametrize("name", [name for name in TABLE if name != "GetDirectionalDerivative"])
def test_calls_are_allowed_as_the_standard_says(plant_fmu: UnpackedFmu, name: str, state: str) -> None:
    letter = "imste"[STATES.index(state)]
    with brought_to(plant_fmu, state) as instance:
        saved, size = c_void_p(), c_size_t()
        assert instance.call("GetFMUstate", pointer(saved)) == OK
        assert instance.call("SerializedFMUstateSize", saved, pointer(size)) == OK
        data = (ctypes.c_char * size.value)()
        assert instance.call("SerializeFMUstate", saved, data, size.value) == OK
        access = name.endswith(("Integer", "Boolean", "String", "Real")) and name[:3] in ("Get", "Set")
        arguments: tuple[object, ...] = {
            "SetDebugLogging": (1, 0, None),
            "SetupExperiment": (0, 0.0, 0.0, 0, 0.0),
            "DoStep": (0.005, 0.001, 1),
            "GetFMUstate": (pointer(c_void_p()),),
            "SetFMUstate": (saved,),
            "FreeFMUstate": (pointer(saved),),
            "SerializedFMUstateSize": (saved, pointer(size)),
            "SerializeFMUstate": (saved, data, size.value),
            "DeSerializeFMUstate": (data, size.value, pointer(c_void_p())),
            "GetStatus": (0, pointer(c_int())),
            "GetRealStatus": (2, pointer(c_double())),
            "GetBooleanStatus": (3, pointer(c_int())),
        }.get(name, (None, 0, None) if access else ())
        status = instance.call(name, *arguments)
        assert (status == OK) == (letter in TABLE[name]), instance.messages
        if status != OK:
            assert f"fmi2{name}: not allowed in state {state}" in instance.last_message


def test_logging(plant_fmu: UnpackedFmu) -> None:
    with Instance(plant_fmu, logging=False) as instance:
        assert instance.step(0.0) == ERROR and instance.messages == []
    with Instance(plant_fmu) as instance:
        names = (ctypes.c_char_p * 1)(b"logEvents")
        assert instance.call("SetDebugLogging", 1, 1, names) == OK
        instance.initialise()
        assert instance.step(-1.0) == ERROR
        assert [(m[1], m[2], m[3]) for m in instance.messages] == [
            ("logEvents", "fmi2ExitInitializationMode: the finger has settled", 4711)
        ]
        assert instance.call("SetDebugLogging", 1, 1, (ctypes.c_char_p * 1)(b"all")) == WARNING


def test_status_inquiries(plant_fmu: UnpackedFmu) -> None:
    with running(plant_fmu) as instance:
        time = c_double()
        assert instance.call("GetRealStatus", 2, pointer(time)) == OK and time.value == pytest.approx(0.005, abs=1e-15)
        assert instance.call("GetIntegerStatus", 0, pointer(c_int())) == DISCARD


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


# --- reset ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("state", STATES)
def test_reset_leads_back_to_the_beginning_from_anywhere(plant_fmu: UnpackedFmu, state: str) -> None:
    with Instance(plant_fmu) as fresh, brought_to(plant_fmu, state) as instance:
        beginning = fresh.save()
        if state in ("instantiated", "initializationMode"):
            assert instance.set_integer("integrator", 2) == OK and instance.set_real({FORCE: 1.0}) == OK
        assert instance.call("Reset") == OK
        assert instance.save() == beginning
        for each in (instance, fresh):
            each.initialise()
        assert play(instance, 60) == play(fresh, 60)


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


@pytest.mark.parametrize("state", STATES[:4])
def test_saved_state_holds_everything(plant_fmu: UnpackedFmu, state: str) -> None:
    with brought_to(plant_fmu, state) as instance, Instance(plant_fmu) as other:
        if state in ("instantiated", "initializationMode"):
            assert instance.set_integer("integrator", 2) == OK
            assert instance.call("SetBoolean", instance.vrs(["scheduled_motion"]), 1, pointer(c_int(0))) == OK
        if state != "terminated":
            assert instance.set_real({FORCE: 0.3, "pretension": 1.0}) == OK
        saved = instance.save()
        for each in (instance, other):
            assert each.restore(saved) == OK
            if state == "instantiated":
                assert each.call("EnterInitializationMode") == OK
            if state in ("instantiated", "initializationMode"):
                assert each.call("ExitInitializationMode") == OK
            if state != "terminated":
                assert each.step(0.005 if state == "stepComplete" else 0.0) == OK
        assert instance.outputs() == other.outputs()
        numbers = ["relative_tolerance", "step", FORCE, "pretension"]
        assert list(instance.get_real(numbers)) == list(other.get_real(numbers))
        assert instance.get_integers(["integrator", "seed"]) == other.get_integers(["integrator", "seed"])


@pytest.mark.parametrize("state", STATES[:3])
def test_states_of_another_rig_of_the_same_size_are_refused(plant_fmu: UnpackedFmu, state: str, tmp_path: Path) -> None:
    """Also before the finger has settled, when they hold nothing of it."""
    (tmp_path / "rig.json").write_text(json.dumps(fmu_rig(seed=SEED + 1)))
    heavier = unpack(build_plant_fmu(tmp_path / "rig.json", tmp_path / "heavier.fmu"), tmp_path / "heavier")
    with brought_to(plant_fmu, state) as instance, brought_to(heavier, state) as other:
        before = other.save()
        assert len(instance.save()) == len(before)
        assert other.restore(instance.save()) == ERROR
        assert "state of another FMU" in other.last_message
        assert other.save() == before


def test_a_damaged_state_of_a_finger_that_has_not_settled_is_refused(plant_fmu: UnpackedFmu) -> None:
    """Its plant is zeros; with a checksum that fits, anything else was ignored."""
    with Instance(plant_fmu) as instance:
        bad = bytearray(instance.save())
        bad[-3] = 1
        bad[24:32] = struct.pack("<Q", checksum(bytes(bad)))
        before = instance.save()
        assert instance.restore(bytes(bad)) == ERROR
        assert "damaged state: a number" in instance.last_message
        assert instance.save() == before


CONTINUE = """
import pickle, sys
from pathlib import Path
sys.path.insert(0, sys.argv[1])
from fmu_binary import OK, Instance, UnpackedFmu
from plant_fmu_rig import SEED, TOLERANCE, fmu_rig, play
with Instance(UnpackedFmu(Path(sys.argv[2]))) as instance:
    assert instance.restore(Path(sys.argv[3]).read_bytes()) == OK
    sys.stdout.buffer.write(pickle.dumps(play(instance, 150, begin=130)))
"""


def test_continue_in_a_new_process(plant_fmu: UnpackedFmu, tmp_path: Path) -> None:
    with running(plant_fmu, 130) as instance:
        (tmp_path / "saved").write_bytes(instance.save())
        assert instance.restore((tmp_path / "saved").read_bytes()) == OK
        rows = play(instance, 150, begin=130)
    command = [sys.executable, "-c", CONTINUE, str(SUPPORT), plant_fmu.folder, tmp_path / "saved"]
    answer = subprocess.run(command, capture_output=True, check=True)
    assert pickle.loads(answer.stdout) == rows


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


def test_damaged_states_are_refused_and_change_nothing(plant_fmu: UnpackedFmu) -> None:
    with running(plant_fmu) as instance:
        good = instance.save()
        bad_states = [good[:-1], good + b"\0", b"", bytes(len(good))]
        for at in [*range(0, 96, 5), *range(96, len(good), 41), len(good) - 1]:
            bad_states.append(good[:at] + bytes([good[at] ^ 0x11]) + good[at + 1 :])
        for bad in bad_states:
            assert instance.restore(bad) == ERROR
            assert "fmi2DeSerializeFMUstate: " in instance.last_message
            assert instance.save() == good
            assert instance.restore(good) == OK


@pytest.mark.parametrize("at", ["phase", "running", "start", "integrator", "flag", "force", "plant"])
def test_states_that_cannot_be_are_refused_even_with_a_right_checksum(plant_fmu: UnpackedFmu, at: str) -> None:
    """Numbers from byte 40: life (5), inputs (8), then the model's: running, start, ..., settings (from 17)."""
    number, value = {
        "phase": (0, 1.0),
        "running": (13, 0.0),
        "start": (14, NAN),
        "integrator": (17, 1.5),
        "flag": (20, 7.0),
        "force": (12, 1e9),
        "plant": (50, 1e9),
    }[at]
    with running(plant_fmu) as instance, running(plant_fmu) as untouched:
        good = instance.save()
        bad = bytearray(good)
        bad[40 + 8 * number : 48 + 8 * number] = struct.pack("<d", value)
        bad[24:32] = struct.pack("<Q", checksum(bytes(bad)))
        assert instance.restore(bytes(bad)) == ERROR and "state: " in instance.last_message
        assert instance.save() == good
        for each in (instance, untouched):
            assert each.restore(good) == OK
        assert play(instance, 20, begin=5) == play(untouched, 20, begin=5)


def test_free_without_terminate_from_every_state(plant_fmu: UnpackedFmu) -> None:
    for state in STATES:
        with brought_to(plant_fmu, state):
            pass
