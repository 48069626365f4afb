"""The FMU's life: which call is allowed when, samples and their time, reset, saved states, several instances."""

from __future__ import annotations

import ctypes
import pickle
import random
import struct
import subprocess
import sys
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from ctypes import c_double, c_int, c_size_t, c_void_p
from pathlib import Path

import pytest

from fmu_binary import COULOMB, ERROR, OK, STATIC, Instance, UnpackedFmu, motion
from repository_paths import SUPPORT

FORCE, OUTPUT = "tendon_force[1]", "compensated_torque[1]"
STATES = ("instantiated", "initializationMode", "stepComplete", "terminated", "error")

# FMI 2.0.5, section 4.2.4, co-simulation: states in which a call is allowed, without those that need a step in
# progress or a discarded one. i instantiated, m initialization mode, s step complete, t terminated, e error.
TABLE = {
    "SetDebugLogging": "imste",
    "SetupExperiment": "i",
    "EnterInitializationMode": "i",
    "ExitInitializationMode": "m",
    "Terminate": "s",
    "Reset": "imste",
    "GetReal": "mste",
    "GetInteger": "mste",
    "GetBoolean": "mste",
    "GetString": "mste",
    "SetReal": "ims",
    "SetInteger": "ims",
    "SetBoolean": "ims",
    "SetString": "ims",
    "GetFMUstate": "imste",
    "SetFMUstate": "imste",
    "FreeFMUstate": "imste",
    "SerializedFMUstateSize": "imste",
    "SerializeFMUstate": "imste",
    "DeSerializeFMUstate": "imste",
    "GetDirectionalDerivative": "mste",
    "DoStep": "s",
    "CancelStep": "",
    "GetStatus": "st",
    "GetRealStatus": "st",
    "GetBooleanStatus": "st",
}


def brought_to(fmu: UnpackedFmu, state: str) -> Instance:
    """An instance in a state; "error" from where there is a sample, as most errors happen."""
    instance = Instance(fmu)
    if state == "instantiated":
        return instance
    if state == "initializationMode":
        assert instance.setup() == OK and instance.call("EnterInitializationMode") == OK
        return instance
    instance.initialise(motion(fmu, 0.0))
    if state == "terminated":
        assert instance.call("Terminate") == OK
    if state == "error":
        assert instance.step(-1.0) == ERROR
    return instance


def good_arguments(instance: Instance, name: str) -> tuple[object, ...]:
    """Arguments with which the call succeeds where it is allowed."""
    number, result = c_double(1.0), c_double()
    if name.endswith(("Integer", "Boolean", "String", "Real")) and name[:3] in ("Get", "Set"):
        return (None, 0, None)
    state, size = c_void_p(), c_size_t()
    if "FMUstate" in name:
        assert instance.call("GetFMUstate", ctypes.byref(state)) == OK
        assert instance.call("SerializedFMUstateSize", state, ctypes.byref(size)) == OK
    data = (ctypes.c_char * size.value)()
    if name == "DeSerializeFMUstate":
        assert instance.call("SerializeFMUstate", state, data, size.value) == OK
    references = instance.vrs([OUTPUT]), 1, instance.vrs([FORCE]), 1
    return {
        "SetDebugLogging": (1, 0, None),
        "SetupExperiment": (0, 0.0, 0.0, 0, 0.0),
        "DoStep": (0.0, 0.1, 1),
        "GetFMUstate": (ctypes.byref(c_void_p()),),
        "SetFMUstate": (state,),
        "FreeFMUstate": (ctypes.byref(state),),
        "SerializedFMUstateSize": (state, ctypes.byref(size)),
        "SerializeFMUstate": (state, data, size.value),
        "DeSerializeFMUstate": (data, size.value, ctypes.byref(c_void_p())),
        "GetDirectionalDerivative": (*references, ctypes.byref(number), ctypes.byref(result)),
        "GetStatus": (0, ctypes.byref(c_int())),
        "GetRealStatus": (2, ctypes.byref(result)),
        "GetBooleanStatus": (3, ctypes.byref(c_int())),
    }.get(name, ())


@pytest.mark.parametrize("state", STATES)
@pytest.mark.parametrize("name", TABLE)
def test_calls_are_allowed_as_the_standard_says(small_fmu: UnpackedFmu, name: str, state: str) -> None:
    letter = "imste"[STATES.index(state)]
    with brought_to(small_fmu, state) as instance:
        status = instance.call(name, *good_arguments(instance, name))
        assert (status == OK) == (letter in TABLE[name]), instance.messages
        if status != OK:
            assert f"fmi2{name}: not allowed in state {state}" in instance.last_message


def test_after_an_error_only_reset_or_a_saved_state_lead_on(small_fmu: UnpackedFmu) -> None:
    with brought_to(small_fmu, "stepComplete") as instance:
        good = instance.save()
        for _ in range(2):
            assert instance.step(-1.0) == ERROR
            assert instance.step(1.0) == ERROR and "not allowed in state error" in instance.last_message
            assert instance.restore(good) == OK
            assert instance.step(1.0) == OK
        assert instance.step(-1.0) == ERROR
        assert instance.call("Reset") == OK
        instance.initialise()
        assert instance.step(1.0) == OK


# --- samples and time -------------------------------------------------------------------------------------------------


def test_inputs_show_in_outputs_before_the_first_step(small_fmu: UnpackedFmu) -> None:
    with brought_to(small_fmu, "initializationMode") as instance:
        for force in (1.0, 3.0, 2.0):
            assert instance.set_real({FORCE: force}) == OK
            assert instance.get_real(["joint_torque[1]"]) == [0.009 * force]
        tuned = {STATIC: 0.5, COULOMB: 0.4}
        assert instance.set_real(tuned) == OK
        assert instance.get_real(["joint_torque[1]"]) == [0.018]
        assert instance.call("ExitInitializationMode") == OK
        assert instance.get_real(["joint_torque[1]"]) == [0.018]
        assert list(instance.get_real(list(tuned))) == list(tuned.values())  # they survive the trial


def test_looking_at_outputs_in_initialisation_mode_leaves_no_trace(small_fmu: UnpackedFmu) -> None:
    with Instance(small_fmu) as curious, Instance(small_fmu) as plain:
        for instance in (curious, plain):
            assert instance.set_integer("kinematics_source", 2) == OK
            assert instance.setup(2.0) == OK and instance.call("EnterInitializationMode") == OK
            for k in range(3):
                assert instance.set_real(motion(small_fmu, 0.1 * k)) == OK
                if instance is curious:
                    instance.outputs()
            assert instance.call("ExitInitializationMode") == OK
        assert curious.save() == plain.save()


def test_outputs_belong_to_the_sample_last_taken(small_fmu: UnpackedFmu) -> None:
    with brought_to(small_fmu, "stepComplete") as instance:
        first = instance.outputs()
        assert instance.set_real(motion(small_fmu, 0.3)) == OK
        assert instance.outputs() == first
        assert instance.step(0.0) == OK  # at the time of the first sample: changes nothing, even with other inputs
        assert instance.outputs() == first
        assert instance.step(0.3) == OK
        second = instance.outputs()
        assert second != first
        assert instance.set_real(motion(small_fmu, 0.6)) == OK and instance.step(0.3) == OK
        assert instance.outputs() == second


def test_steps_of_any_length(small_fmu: UnpackedFmu) -> None:
    """Jitter, 1/60 s, past the stop time by rounding, and 10^12 s at once."""
    with Instance(small_fmu) as instance:
        assert instance.setup(-1.0, 1.0) == OK and instance.call("EnterInitializationMode") == OK
        assert instance.call("ExitInitializationMode") == OK
        now = -1.0
        for step in (1 / 60, 1e-9, 0.3, 1 / 60, 0.7, 0.966667):
            assert instance.step(now, step) == OK
            now += step
        assert now > 1.0 and instance.step(now, 1 / 60) == OK
        assert instance.step(1.5, 0.01) == ERROR and "not past the stop time" in instance.last_message
    with brought_to(small_fmu, "stepComplete") as instance:
        begin = time.thread_time()
        assert instance.step(0.0, 1e12) == OK and instance.step(1e12, 1e12) == OK
        assert time.thread_time() - begin < 0.1  # of the processor: a loaded machine may take longer
        assert all(abs(value) < 1e12 for value in instance.outputs())


def test_experiment_may_be_left_out(small_fmu: UnpackedFmu) -> None:
    with Instance(small_fmu) as instance:
        assert instance.call("EnterInitializationMode") == OK
        assert instance.call("ExitInitializationMode") == OK
        assert instance.step(0.0) == OK


# --- reset ------------------------------------------------------------------------------------------------------------


def play(instance: Instance, seed: int = 0, samples: int = 60) -> list[list[float]]:
    """Outputs of a run of uneven steps."""
    clock = random.Random(seed)
    now, rows = 0.0, []
    instance.initialise(motion(instance.fmu, now, seed))
    for _ in range(samples):
        rows.append(instance.outputs())
        now += clock.uniform(0.0005, 0.02)
        assert instance.set_real(motion(instance.fmu, now, seed)) == OK
        assert instance.step(now) == OK
    return rows


@pytest.mark.parametrize("state", STATES)
def test_reset_leads_back_to_the_beginning_from_anywhere(small_fmu: UnpackedFmu, state: str) -> None:
    with Instance(small_fmu) as fresh, brought_to(small_fmu, state) as instance:
        beginning = fresh.save()
        if state in ("instantiated", "initializationMode"):
            assert instance.set_integer("kinematics_source", 3) == OK
        if state in ("instantiated", "initializationMode", "stepComplete"):
            assert instance.set_real({**motion(small_fmu, 1.0), STATIC: 0.9}) == OK
        assert instance.call("Reset") == OK
        assert instance.save() == beginning
        assert play(instance) == play(fresh)


# --- saved states -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("state", STATES[:4])
def test_saved_state_holds_everything(small_fmu: UnpackedFmu, state: str) -> None:
    with brought_to(small_fmu, state) as instance, Instance(small_fmu) as other:
        if state != "terminated":
            assert instance.set_real({**motion(small_fmu, 1.0), STATIC: 0.9, COULOMB: 0.8}) == OK
        saved = instance.save()
        assert other.restore(saved) == OK
        assert other.save() == saved
        for one in (instance, other):
            if state == "instantiated":
                assert one.call("EnterInitializationMode") == OK
            if state in ("instantiated", "initializationMode"):
                assert one.call("ExitInitializationMode") == OK
            if state != "terminated":
                assert one.step(0.5) == OK
        assert instance.outputs() == other.outputs()
        assert instance.save() == other.save()


CONTINUE = """
import pickle, sys
from pathlib import Path
sys.path.insert(0, sys.argv[1])
from fmu_binary import OK, Instance, UnpackedFmu, motion
saved, times = pickle.loads(Path(sys.argv[3]).read_bytes())
fmu = UnpackedFmu(Path(sys.argv[2]))
with Instance(fmu) as instance:
    assert instance.restore(saved) == OK
    rows = []
    for now in times:
        assert instance.set_real(motion(fmu, now)) == OK and instance.step(now) == OK
        rows.append(instance.outputs())
    sys.stdout.buffer.write(pickle.dumps((rows, instance.save())))
"""


@pytest.mark.parametrize("seed", range(3))
def test_save_at_a_random_time_and_continue_in_a_new_process(small_fmu: UnpackedFmu, tmp_path: Path, seed: int) -> None:
    clock = random.Random(seed)
    times = sorted(clock.uniform(0.0, 2.0) for _ in range(200))
    cut = clock.randrange(1, 150)
    with Instance(small_fmu) as instance:
        assert instance.set_integer("kinematics_source", 1 + seed) == OK
        instance.initialise(motion(small_fmu, 0.0))
        rows = []
        for k, now in enumerate(times):
            if k == cut:
                (tmp_path / "saved").write_bytes(pickle.dumps((instance.save(), times[cut:])))
            assert instance.set_real(motion(small_fmu, now)) == OK and instance.step(now) == OK
            rows.append(instance.outputs())
        end = instance.save()
    here = str(SUPPORT)
    command = [sys.executable, "-c", CONTINUE, here, str(small_fmu.folder), str(tmp_path / "saved")]
    answer = subprocess.run(command, capture_output=True, check=True)
    assert pickle.loads(answer.stdout) == (rows[cut:], end)


def test_going_back_and_forth_in_one_instance(small_fmu: UnpackedFmu) -> None:
    with brought_to(small_fmu, "stepComplete") as instance:
        saved = instance.save()
        futures = []
        for _ in range(3):
            assert instance.restore(saved) == OK
            assert instance.set_real(motion(small_fmu, 0.2)) == OK and instance.step(0.2) == OK
            futures.append(instance.outputs())
        assert futures[0] == futures[1] == futures[2]


def damaged_states(good: bytes) -> dict[str, bytes]:
    states = {"cut": good[:-1], "longer": good + b"\0", "nothing": b"", "zeros": bytes(len(good))}
    for at in [*range(0, 96, 5), *range(96, len(good), 41), len(good) - 1]:
        states[f"byte {at}"] = good[:at] + bytes([good[at] ^ 0x11]) + good[at + 1 :]
    return states


def test_damaged_states_are_refused_and_change_nothing(small_fmu: UnpackedFmu) -> None:
    with brought_to(small_fmu, "stepComplete") as instance:
        good = instance.save()
        for name, bad in damaged_states(good).items():
            assert instance.restore(bad) == ERROR, name
            assert "fmi2DeSerializeFMUstate: " in instance.last_message
            assert instance.save() == good
            assert instance.restore(good) == OK


def checksum(data: bytes) -> int:
    value = 0xCBF29CE484222325
    for byte in data[32:]:
        value = (value ^ byte) * 0x100000001B3 % 2**64
    return value


@pytest.mark.parametrize(("index", "value"), [(0, 7.0), (0, 0.0), (0, 1.5), (1, 2.0), (2, float("nan")), (5, 1e300)])
def test_states_that_cannot_be_are_refused_even_with_a_right_checksum(
    small_fmu: UnpackedFmu, index: int, value: float
) -> None:
    """Numbers 0 phase, 1 whether there is a stop time, 2 start time, 5 first input."""
    with brought_to(small_fmu, "stepComplete") as instance:
        good = instance.save()
        bad = bytearray(good)
        bad[40 + 8 * index : 48 + 8 * index] = struct.pack("<d", value)
        bad[24:32] = struct.pack("<Q", checksum(bytes(bad)))
        assert instance.restore(bytes(bad)) == ERROR and "damaged state" in instance.last_message
        assert instance.save() == good


# --- several instances ------------------------------------------------------------------------------------------------


def test_interleaved_instances_equal_instances_alone(small_fmu: UnpackedFmu) -> None:
    alone = []
    for seed in (0, 1):
        with Instance(small_fmu) as instance:
            alone.append(play(instance, seed))
    with Instance(small_fmu) as first, Instance(small_fmu) as second:
        both: list[list[list[float]]] = [[], []]
        clocks = [random.Random(0), random.Random(1)]
        now = [0.0, 0.0]
        for seed, instance in enumerate((first, second)):
            instance.initialise(motion(small_fmu, 0.0, seed))
        for _ in range(60):
            for seed, instance in enumerate((first, second)):
                both[seed].append(instance.outputs())
                now[seed] += clocks[seed].uniform(0.0005, 0.02)
                assert instance.set_real(motion(small_fmu, now[seed], seed)) == OK
                assert instance.step(now[seed]) == OK
    assert both == alone


def test_instances_in_threads(small_fmu: UnpackedFmu) -> None:
    """ctypes releases the interpreter lock in every call, so the binary runs in parallel."""

    def run(seed: int) -> list[list[float]]:
        with Instance(small_fmu, logger=False) as instance:
            return play(instance, seed, 150)

    expected = [run(seed) for seed in range(8)]
    with ThreadPoolExecutor(8) as pool:
        assert list(pool.map(run, range(8))) == expected


def test_free_without_terminate_from_every_state(small_fmu: UnpackedFmu) -> None:
    makers: list[Callable[[], Instance]] = [lambda state=state: brought_to(small_fmu, state) for state in STATES]
    for make in makers:
        with make():
            pass
