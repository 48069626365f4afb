"""Saved states of each FMU: they hold everything, and what is no state of this FMU is refused and changes nothing."""

from __future__ import annotations

import ctypes
import json
import math
import pickle
import random
import struct
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from fmu_binary import DISCARD, ERROR, FINGER, OK, Instance, UnpackedFmu, motion, pointer, unpack
from fmu_kinds import Kind, friction_kind, kind_of, kinds, plant_kind
from plant_fmu_rig import SEED, TOLERANCE, fmu_rig
from plant_rigs import needs_plant
from repetitions import repeated
from repository_paths import ROOT, SUPPORT

NAN = math.nan


# --- they hold everything ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("state", "imst")
def test_saved_state_holds_everything(kind: Kind, state: str) -> None:
    with kind.brought_to(state) as instance, Instance(kind.fmu) as other:
        if state != "t":
            assert instance.write(kind.tuned) == OK
        if state == "i":
            assert instance.write({kind.setting: 2}) == OK
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
from fmu_binary import OK, Instance, UnpackedFmu
from fmu_kinds import MAKERS
kind = MAKERS[sys.argv[4]][1](UnpackedFmu(Path(sys.argv[2])))
cut, steps = map(int, sys.argv[5:])
with Instance(kind.fmu) as instance:
    assert instance.restore(Path(sys.argv[3]).read_bytes()) == OK
    rows = kind.advance(instance, cut, steps)
    sys.stdout.buffer.write(pickle.dumps((rows, instance.save())))
"""


@pytest.mark.parametrize(
    ("fmu", "setting"),
    [*kinds(1, only="friction3 plant"), *repeated([("friction", 1), ("friction", 2), ("friction", 3)], 1)],
)
def test_a_saved_state_continues_in_a_new_process(
    fmu: str, setting: int, request: pytest.FixtureRequest, tmp_path: Path
) -> None:
    kind, cut, steps = kind_of(fmu, request), 130, 150
    with Instance(kind.fmu) as instance:
        assert instance.write({kind.setting: setting}) == OK
        instance.initialise()
        kind.advance(instance, 0, cut)
        saved = instance.save()
        (tmp_path / "saved").write_bytes(saved)
        assert instance.restore(saved) == OK  # a plant that is restored starts its integrator anew
        expected = kind.advance(instance, cut, steps), instance.save()
    arguments = [SUPPORT, kind.fmu.folder, tmp_path / "saved", fmu, cut, steps]
    command = [sys.executable, "-c", CONTINUE, *map(str, arguments)]
    answer = subprocess.run(command, capture_output=True, check=True)
    assert pickle.loads(answer.stdout) == expected


# --- damaged states ---------------------------------------------------------------------------------------------------


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


def hash_of_words(data: bytes) -> int:
    """The core's (hash_bytes in bytes.c), of states, whose length is a multiple of 8."""
    value = 0xCBF29CE484222325 ^ len(data)
    for (word,) in struct.iter_unpack("<Q", data):
        value = (value ^ word) * 0x9E3779B97F4A7C15 % 2**64
        value ^= value >> 29
    value ^= value >> 32
    value = value * 0xD6E8FEB86659FD93 % 2**64
    return value ^ value >> 32


def sealed(state: bytes | bytearray) -> bytes:
    """The state with the checksums that fit: of the friction model's state in it, and its own."""
    changed = bytearray(state)
    core = changed.find(b"TFMUSTA", 40)
    if core >= 0:
        changed[core + 24 : core + 32] = struct.pack("<Q", hash_of_words(changed[core + 32 :]))
    changed[24:32] = struct.pack("<Q", hash_of_words(changed[32:]))
    return bytes(changed)


def with_number(state: bytes, index: int, value: float) -> bytes:
    """The state with another number, from byte 40 on, and the FMU's checksum that belongs to it."""
    changed = bytearray(state)
    changed[40 + 8 * index : 48 + 8 * index] = struct.pack("<d", value)
    changed[24:32] = struct.pack("<Q", hash_of_words(changed[32:]))
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


@pytest.mark.parametrize("count", repeated([200, 20_000], 0))
def test_a_spoilt_state_is_refused_or_a_sound_one(small_fmu: UnpackedFmu, count: int) -> None:
    """Under the old checksums each is refused. Under those that fit it is refused with no byte changed; or it is what
    the FMU then saves, and the next samples are finite or refused."""
    chance, taken = random.Random(1), 0
    with Instance(small_fmu) as instance:
        instance.initialise(motion(small_fmu, 0.0))
        friction_kind(small_fmu).advance(instance, 1, 200)
        good = instance.save()
        assert sealed(good) == good
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
                if instance.write(motion(small_fmu, 0.001 * k)) != OK or instance.step(0.001 * k) != OK:
                    break
                assert all(map(math.isfinite, instance.outputs())), number
    assert 0.1 * count < taken < count


# Numbers of the FMU's part. Life: 0 phase, 1 whether there is a stop time, 2 start time, 5 whether an input was set;
# then inputs from 6 on, and of the plant what runs (14, 15), settings (from 18) and state.
IMPOSSIBLE = {
    "friction": [(0, 7.0), (0, 0.0), (0, 1.5), (1, 2.0), (2, NAN), (5, 2.0)],
    "plant": [(0, 1.0), (14, 0.0), (15, NAN), (18, 1.5), (21, 7.0), (51, 1e9)],
}


@pytest.mark.parametrize("name", kinds(only="friction plant"))
def test_states_that_cannot_be_are_refused_even_with_a_right_checksum(
    name: str, request: pytest.FixtureRequest
) -> None:
    kind = kind_of(name, request)
    with kind.brought_to("s") as instance, kind.brought_to("s") as untouched:
        good = instance.save()
        for index, value in IMPOSSIBLE[name]:
            assert instance.restore(with_number(good, index, value)) == ERROR, (index, value)
            assert "state: " in instance.last_message
            assert instance.save() == good
            for one in (instance, untouched):
                assert one.restore(good) == OK
            assert kind.advance(instance, 5, 3) == kind.advance(untouched, 5, 3)
            assert instance.restore(good) == OK


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
                    assert instance.step(0.001 * k, 0.001) in (OK, DISCARD, ERROR)
                    assert all(map(math.isfinite, instance.outputs())), (index, value)
                assert time.thread_time() - begin < 1.0
        assert instance.restore(good) == OK


# --- states of another FMU --------------------------------------------------------------------------------------------


def test_blocks_of_another_fmu_are_neither_read_nor_written(small: UnpackedFmu, tmp_path: Path) -> None:
    """Its states are of another length."""
    from tendonfmu.fmu import build_fmu

    description = FINGER | {"name": "other finger", "tendons": FINGER["tendons"][:2]}
    other_fmu = unpack(build_fmu(description, tmp_path / "other.fmu", fmi=small.version), tmp_path / "other")
    with Instance(small) as mine, Instance(other_fmu) as other:
        block, size = ctypes.c_void_p(), ctypes.c_size_t()
        assert other.call("GetFMUState", pointer(block)) == OK
        assert other.call("SerializedFMUStateSize", block, pointer(size)) == OK
        before = ctypes.string_at(block, size.value)
        assert before == other.save()
        assert mine.call("SerializedFMUStateSize", block, pointer(size)) == ERROR
        own = mine.save()
        for name, arguments in {
            "SerializeFMUState": (block, (ctypes.c_char * len(own))(), len(own)),
            "GetFMUState": (pointer(block),),
            "SetFMUState": (block,),
            "DeserializeFMUState": (own, len(own), pointer(block)),
        }.items():
            assert mine.call(name, *arguments) == ERROR
            assert ": state of another FMU" in mine.last_message
            assert ctypes.string_at(block, len(before)) == before
        assert mine.call("Reset") == OK and mine.restore(before) == ERROR


@needs_plant
@pytest.mark.parametrize("state", "ims")
def test_states_of_another_rig_of_the_same_size_are_refused(plant_fmu: UnpackedFmu, state: str, tmp_path: Path) -> None:
    """Also before the finger has settled, when they hold nothing of it."""
    from tendonfmu.simulate.ssp import build_plant_fmu

    (tmp_path / "rig.json").write_text(json.dumps(fmu_rig(seed=SEED + 1)))
    another = unpack(build_plant_fmu(tmp_path / "rig.json", tmp_path / "another.fmu"), tmp_path / "another")
    with plant_kind(plant_fmu).brought_to(state) as instance, plant_kind(another).brought_to(state) as other:
        before = other.save()
        assert len(instance.save()) == len(before)
        assert other.restore(instance.save()) == ERROR
        assert "state of another FMU" in other.last_message
        assert other.save() == before


# --- states of the simulated finger -----------------------------------------------------------------------------------


@needs_plant
def test_a_damaged_state_of_a_finger_that_has_not_settled_is_refused(plant_fmu: UnpackedFmu) -> None:
    """Its plant is zeros; with a checksum that fits, anything else was ignored."""
    with Instance(plant_fmu) as instance:
        before = instance.save()
        assert instance.restore(with_number(before, (len(before) - 48) // 8, 1.0)) == ERROR
        assert "damaged state: a number" in instance.last_message
        assert instance.save() == before


# docs/reference/simulated_finger_fmu.md: a restored run differs from the uninterrupted one by less than this many times
# the relative tolerance: largest difference of a joint or tendon over the largest absolute value of that same one
RESTART_ERROR = {"truth.joint_position": 100.0, "truth.tendon_force": 500.0, "truth.friction_torque": 1000.0}


def restart_errors(
    fmu: UnpackedFmu, restored: NDArray[Any], uninterrupted: NDArray[Any], tolerance: float
) -> dict[str, float]:
    """By group of RESTART_ERROR: the worst of its joints or tendons, in relative tolerances."""
    share = np.abs(restored - uninterrupted).max(axis=0) / np.maximum(np.abs(uninterrupted).max(axis=0), 1e-300)
    names = fmu.names("output")
    return {
        group: float(max(share[k] for k, name in enumerate(names) if name.startswith(group)) / tolerance)
        for group in RESTART_ERROR
    }


def second(instance: Instance, begin: int) -> NDArray[Any]:
    """Outputs over a second from a time in ms."""
    rows = []
    for k in range(begin, begin + 1000):
        assert instance.step(k * 0.001, 0.001) == OK
        rows.append(instance.outputs())
    return np.array(rows)


@needs_plant
@pytest.mark.parametrize("tolerance", [TOLERANCE, *repeated([1e-5, 1e-7, 1e-8])])
def test_the_bound_on_restored_runs_of_the_index_finger(index_plant: UnpackedFmu, tolerance: float) -> None:
    """Cuts a second apart, as docs/reference/simulated_finger_fmu.md says: five, two of them in ./test."""
    # the restored run is another instance's: a restored one would differ from itself no more
    with Instance(index_plant) as instance, Instance(index_plant) as other:
        assert instance.write({"relative_tolerance": tolerance}) == OK
        instance.initialise()
        assert instance.step(0.0, 1.5) == OK
        for begin in range(1500, 3500 if tolerance == TOLERANCE else 6500, 1000):
            assert other.restore(instance.save()) == OK
            errors = restart_errors(index_plant, second(other, begin), second(instance, begin), tolerance)
            assert all(0.0 < errors[group] < bound for group, bound in RESTART_ERROR.items()), errors


@pytest.fixture(scope="module")
def index_plant(tmp_path_factory: pytest.TempPathFactory) -> UnpackedFmu:
    from tendonfmu.simulate.ssp import build_plant_fmu

    folder = tmp_path_factory.mktemp("index")
    return unpack(build_plant_fmu(ROOT / "examples/rigs/index_finger.json", folder / "index.fmu"), folder / "unpacked")
