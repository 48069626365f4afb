"""The life of each FMU: which call is allowed when, samples and their time, reset, saved states, several instances."""

from __future__ import annotations

import math
import pickle
import random
import struct
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from fmu_binary import COULOMB, ERROR, OK, STATIC, Instance, UnpackedFmu, motion
from fmu_kinds import CALLS, MAKERS, Kind
from plant_rigs import needs_plant
from repetitions import repeated
from repository_paths import SUPPORT

FORCE = "tendon_force[1]"
STATES = "imste"
NAN = float("nan")


def kind_of(name: str, request: pytest.FixtureRequest) -> Kind:
    fixture, make = MAKERS[name]
    return make(request.getfixturevalue(fixture))


def marked(name: str, *values: object, **options: object) -> object:
    """Values for parametrize; those of the simulated finger need it."""
    return pytest.param(name, *values, marks=needs_plant if name == "plant" else (), **options)  # type: ignore[arg-type]


@pytest.fixture(params=[marked(name) for name in MAKERS])
def kind(request: pytest.FixtureRequest) -> Kind:
    return kind_of(request.param, request)


@pytest.mark.parametrize("state", STATES)
@pytest.mark.parametrize(("fmu", "name"), [marked(fmu, name) for fmu, names in CALLS.items() for name in names])
def test_calls_are_allowed_as_the_standard_says(
    fmu: str, name: str, state: str, request: pytest.FixtureRequest
) -> None:
    kind = kind_of(fmu, request)
    with kind.brought_to(state) as instance:
        status = instance.call(name, *kind.good_arguments(instance, name))
        assert (status == OK) == (state in kind.calls[name]), instance.messages
        if status != OK:
            assert f"{name}: not allowed in state {kind.states[state]}" in instance.last_message


def test_after_an_error_only_reset_or_a_saved_state_lead_on(kind: Kind) -> None:
    with kind.brought_to("s") as instance:
        good = instance.save()
        for _ in range(2):
            assert instance.step(-1.0) == ERROR
            assert instance.write(dict(kind.tuned)) == ERROR
            assert instance.step(1.0) == ERROR and f"not allowed in state {kind.states['e']}" in instance.last_message
            assert instance.restore(good) == OK
            kind.advance(instance, 5, 1)
        assert instance.step(-1.0) == ERROR
        assert instance.call("Reset") == OK
        instance.initialise()
        kind.advance(instance, 0, 1)


# --- samples and time -------------------------------------------------------------------------------------------------


def initialising(fmu: UnpackedFmu) -> Instance:
    instance = Instance(fmu)
    assert instance.enter_initialisation() == OK
    return instance


def stepping(fmu: UnpackedFmu) -> Instance:
    instance = Instance(fmu)
    instance.initialise(motion(fmu, 0.0))
    return instance


def test_inputs_show_in_outputs_before_the_first_step(small_fmu: UnpackedFmu) -> None:
    with initialising(small_fmu) as instance:
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
    with stepping(small_fmu) as instance:
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
        assert now > 1.0
    with stepping(small_fmu) as instance:
        begin = time.thread_time()
        assert instance.step(0.0, 1e12) == OK and instance.step(1e12, 1e12) == OK
        assert time.thread_time() - begin < 0.1  # of the processor: a loaded machine may take longer
        assert all(abs(value) < 1e12 for value in instance.outputs())


@pytest.mark.parametrize("begin", [0.0, -3.7])
def test_no_step_leads_past_the_stop_time(kind: Kind, begin: float) -> None:
    """However the client adds up its time: ten steps of 0.1 s, not an eleventh."""
    sums = {"multiples": [begin + 0.1 * k for k in range(11)], "sum": [begin]}
    for _ in range(10):
        sums["sum"].append(sums["sum"][-1] + 0.1)
    for times in sums.values():
        with kind.make(kind.fmu) as instance:
            if instance.version == 2:
                assert instance.setup(begin, begin + 1.0) == OK and instance.call("EnterInitializationMode") == OK
            else:
                assert instance.enter_initialisation(begin, begin + 1.0) == OK
            assert instance.call("ExitInitializationMode") == OK
            for time_now in times[:10]:
                assert instance.step(time_now, 0.1) == OK, instance.last_message
            assert instance.step(times[10], 0.1) == ERROR
            assert "expected a step that ends at the stop time or before" in instance.last_message


def test_experiment_may_be_left_out(small_fmu: UnpackedFmu) -> None:
    with Instance(small_fmu) as instance:
        assert instance.call("EnterInitializationMode") == OK
        assert instance.call("ExitInitializationMode") == OK
        assert instance.step(0.0) == OK


# --- reset ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("state", STATES)
def test_reset_leads_back_to_the_beginning_from_anywhere(kind: Kind, state: str) -> None:
    with kind.make(kind.fmu) as fresh, kind.brought_to(state) as instance:
        beginning = fresh.save()
        if state in "ims":
            assert instance.write(dict(kind.tuned)) == OK
        assert instance.call("Reset") == OK
        assert instance.save() == beginning
        rows = []
        for one in (instance, fresh):
            one.initialise()
            rows.append(kind.advance(one, 0, 60))
        assert rows[0] == rows[1]


# --- saved states -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("state", STATES[:4])
def test_saved_state_holds_everything(kind: Kind, state: str) -> None:
    with kind.brought_to(state) as instance, kind.make(kind.fmu) as other:
        if state != "t":
            assert instance.write(dict(kind.tuned)) == OK
        if state == "i" and isinstance(instance, Instance):
            setting = "integrator" if "integrator" in kind.fmu.variables else "kinematics_source"
            assert instance.set_integer(setting, 2) == OK
        saved = instance.save()
        assert other.restore(saved) == OK and other.save() == saved
        for one in (instance, other):  # a plant that is restored starts its integrator anew
            assert one.restore(saved) == OK
            if state == "i":
                assert one.enter_initialisation() == OK
            if state in "im":
                assert one.call("ExitInitializationMode") == OK
            if state != "t":
                kind.advance(one, 5 if state == "s" else 0, 3)
        assert instance.outputs() == other.outputs()
        assert instance.save() == other.save()


CONTINUE = """
import pickle, sys
from pathlib import Path
sys.path.insert(0, sys.argv[1])
from fmi3_binary import UnpackedFmu3
from fmu_binary import OK, UnpackedFmu
from fmu_kinds import MAKERS
name, cut, steps = sys.argv[4], int(sys.argv[5]), int(sys.argv[6])
kind = MAKERS[name][1]((UnpackedFmu3 if name == "friction3" else UnpackedFmu)(Path(sys.argv[2])))
with kind.make(kind.fmu) as instance:
    assert instance.restore(Path(sys.argv[3]).read_bytes()) == OK
    rows = kind.advance(instance, cut, steps)
    sys.stdout.buffer.write(pickle.dumps((rows, instance.save())))
"""


@pytest.mark.parametrize(
    ("fmu", "source"), [("friction", 1), ("friction", 2), ("friction", 3), ("friction3", 1), marked("plant", 0)]
)
def test_a_saved_state_continues_in_a_new_process(
    fmu: str, source: int, request: pytest.FixtureRequest, tmp_path: Path
) -> None:
    kind, cut, steps = kind_of(fmu, request), 130, 150
    with kind.make(kind.fmu) as instance:
        if source > 1 and isinstance(instance, Instance):
            assert instance.set_integer("kinematics_source", source) == OK
        instance.initialise()
        kind.advance(instance, 0, cut)
        saved = instance.save()
        (tmp_path / "saved").write_bytes(saved)
        if fmu == "plant":  # restoring starts its integrator anew
            assert instance.restore(saved) == OK
        expected = kind.advance(instance, cut, steps), instance.save()
    arguments = [SUPPORT, kind.fmu.folder, tmp_path / "saved", fmu, cut, steps]
    command = [sys.executable, "-c", CONTINUE, *map(str, arguments)]
    answer = subprocess.run(command, capture_output=True, check=True)
    assert pickle.loads(answer.stdout) == expected


def test_going_back_and_forth_in_one_instance(kind: Kind) -> None:
    with kind.brought_to("s") as instance:
        saved = instance.save()
        futures = []
        for _ in range(3):
            assert instance.restore(saved) == OK
            futures.append(kind.advance(instance, 5, 20))
        assert futures[0] == futures[1] == futures[2]


def damaged_states(good: bytes) -> dict[str, bytes]:
    states = {"cut": good[:-1], "longer": good + b"\0", "nothing": b"", "zeros": bytes(len(good))}
    for at in [*range(0, 96, 5), *range(96, len(good), 41), len(good) - 1]:
        states[f"byte {at}"] = good[:at] + bytes([good[at] ^ 0x11]) + good[at + 1 :]
    return states


def test_damaged_states_are_refused_and_change_nothing(kind: Kind) -> None:
    with kind.brought_to("s") as instance:
        good = instance.save()
        for name, bad in damaged_states(good).items():
            assert instance.restore(bad) == ERROR, name
            assert "erializeFMU" in instance.last_message
            assert instance.save() == good
            assert instance.restore(good) == OK


def hash_of_bytes(data: bytes) -> int:
    """FNV-1a."""
    value = 0xCBF29CE484222325
    for byte in data:
        value = (value ^ byte) * 0x100000001B3 % 2**64
    return value


def hash_of_words(data: bytes) -> int:
    """That of the core's own states (hash_bytes in bytes.c), whose length is a multiple of 8."""
    value = 0xCBF29CE484222325 ^ len(data)
    for (word,) in struct.iter_unpack("<Q", data):
        value = (value ^ word) * 0x9E3779B97F4A7C15 % 2**64
        value ^= value >> 29
    value ^= value >> 32
    value = value * 0xD6E8FEB86659FD93 % 2**64
    return value ^ value >> 32


def sealed(state: bytes | bytearray) -> bytes:
    """The state of an FMU for fingers with the checksums that fit: of the core's state in it, and its own."""
    changed = bytearray(state)
    core = changed.find(b"TFMUSTA", 40)
    if core >= 0:
        changed[core + 24 : core + 32] = struct.pack("<Q", hash_of_words(changed[core + 32 :]))
    changed[24:32] = struct.pack("<Q", hash_of_bytes(changed[32:]))
    return bytes(changed)


def with_number(state: bytes, index: int, value: float) -> bytes:
    """The state with another number and the checksum that belongs to it."""
    changed = bytearray(state)
    changed[40 + 8 * index : 48 + 8 * index] = struct.pack("<d", value)
    changed[24:32] = struct.pack("<Q", hash_of_bytes(changed[32:]))
    return bytes(changed)


def with_plain_zeros(state: bytes) -> bytes:
    """The state with 0 for -0, under checksums that fit."""
    words = struct.unpack_from(f"<{len(state) // 8}Q", state)
    return sealed(struct.pack(f"<{len(words)}Q", *(0 if word == 1 << 63 else word for word in words)))


def spoilt(state: bytes, chance: random.Random) -> bytes:
    """The state with one bit changed, or one number that is none or far away."""
    changed = bytearray(state)
    if chance.random() < 0.5:
        changed[chance.randrange(len(state))] ^= 1 << chance.randrange(8)
    else:
        at = 8 * chance.randrange(len(state) // 8)
        changed[at : at + 8] = struct.pack("<d", chance.choice([NAN, math.inf, 1e300, -1.5]))
    return bytes(changed)


@pytest.mark.parametrize("count", repeated([500, 20_000], 0))
def test_a_spoilt_state_is_refused_or_a_sound_one(small_fmu: UnpackedFmu, count: int) -> None:
    """Under the old checksums each is refused. Under those that fit it is refused with no byte changed; or it is what
    the FMU then saves, and the next samples are finite or refused."""
    chance, taken = random.Random(1), 0
    with Instance(small_fmu) as instance:
        instance.initialise(motion(small_fmu, 0.0))
        MAKERS["friction"][1](small_fmu).advance(instance, 1, 200)
        good = instance.save()
        assert sealed(good) == good
        for length in range(len(good) + 64):
            assert (instance.restore(good[:length].ljust(length, b"\0")) == OK) == (length == len(good)), length
        for number in range(count):
            assert instance.restore(good) == OK
            changed = spoilt(good, chance)
            refused = instance.restore(changed) == ERROR and instance.save() == good
            assert refused or changed == good, number
            offered = sealed(changed)
            if instance.restore(offered) == ERROR:
                assert instance.save() == good, number
                continue
            taken += offered != good  # what was done to a checksum is mended
            assert with_plain_zeros(instance.save()) == with_plain_zeros(offered), number
            for k in range(201, 221):
                inputs = motion(small_fmu, 0.001 * k)
                if instance.set_real(inputs) != OK or instance.step(0.001 * k) != OK:
                    break
                assert all(map(math.isfinite, instance.outputs())), number
    assert 0.1 * count < taken < count


# Numbers from byte 40. Life: 0 phase, 1 whether there is a stop time, 2 start time; then inputs from 5 on, and of the
# plant what runs (13, 14), settings (from 17) and state.
IMPOSSIBLE = {
    "friction": [(0, 7.0), (0, 0.0), (0, 1.5), (1, 2.0), (2, NAN), (5, 1e300)],
    "plant": [(0, 1.0), (13, 0.0), (14, NAN), (17, 1.5), (20, 7.0), (12, 1e9), (50, 1e9)],
}


@pytest.mark.parametrize(
    ("fmu", "index", "value"), [marked(fmu, *numbers) for fmu, rows in IMPOSSIBLE.items() for numbers in rows]
)
def test_states_that_cannot_be_are_refused_even_with_a_right_checksum(
    fmu: str, index: int, value: float, request: pytest.FixtureRequest
) -> None:
    kind = kind_of(fmu, request)
    with kind.brought_to("s") as instance, kind.brought_to("s") as untouched:
        good = instance.save()
        assert instance.restore(with_number(good, index, value)) == ERROR and "state: " in instance.last_message
        assert instance.save() == good
        for one in (instance, untouched):
            assert one.restore(good) == OK
        assert kind.advance(instance, 5, 20) == kind.advance(untouched, 5, 20)


def test_whatever_number_stands_in_a_state(kind: Kind) -> None:
    """Each is refused, or steps are refused or give finite outputs, soon. The models' own: tests of the runtime."""
    with kind.brought_to("s") as instance:
        good = instance.save()
        of_model = max(good.find(magic) for magic in (b"TFMUSTA", b"TFplant"))
        for index in range((of_model - 40) // 8):
            for value in (NAN, math.inf, -math.inf, -1.0, 1e300, -1e6, 0.5, 2.0**53):
                if instance.restore(with_number(good, index, value)) == ERROR:
                    assert "state" in instance.last_message
                    continue
                begin = time.thread_time()
                for k in (5, 6):
                    assert instance.step(0.001 * k, 0.001) in (OK, ERROR)
                    assert all(map(math.isfinite, instance.outputs())), (index, value)
                assert time.thread_time() - begin < 1.0
        assert instance.restore(good) == OK


# --- several instances ------------------------------------------------------------------------------------------------


def test_interleaved_instances_equal_instances_alone(kind: Kind) -> None:
    with kind.make(kind.fmu) as instance:
        instance.initialise()
        alone = kind.advance(instance, 0, 100)
    with kind.make(kind.fmu) as first, kind.make(kind.fmu) as second:
        both: list[list[list[float]]] = [[], []]
        for one in (first, second):
            one.initialise()
        for k in range(100):
            for rows, one in zip(both, (first, second), strict=True):
                rows += kind.advance(one, k, 1)
    assert both == [alone, alone]


def test_instances_in_threads(kind: Kind) -> None:
    """ctypes releases the interpreter lock in every call, so the binary runs in parallel."""

    def run(first: int) -> list[list[float]]:
        with kind.make(kind.fmu) as instance:
            instance.initialise()
            return kind.advance(instance, 0, 100 + first)

    expected = [run(k) for k in range(4)]
    with ThreadPoolExecutor(4) as pool:
        assert list(pool.map(run, range(4))) == expected
