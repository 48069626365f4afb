"""The FMU of FMI 3.0 computes what that of FMI 2.0 computes, bit by bit, whatever is called."""

from __future__ import annotations

import ctypes
import json
import random
import struct
from collections.abc import Sequence
from ctypes import c_double
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from fmi3_binary import Instance3, UnpackedFmu3, unpack3
from fmu_binary import ERROR, FINGER, OK, STATIC, Instance, UnpackedFmu, motion, unpack
from repository_paths import ROOT, TESTS
from tendonfmu.fmu import build_fmu, run_fmu
from tendonfmu.recordings import read_recording

TUNABLE = (STATIC, "contact.threshold[1]", "velocity_threshold.tendon", "bias.noise_std", "velocity_filter_cutoff")
EVENTS = ("tune", "save", "restore", "swap", "reset", "refuse")


def bits(values: Sequence[float]) -> bytes:
    return struct.pack(f"<{len(values)}d", *values)


class Pair:
    """An instance of each version; every call goes to both."""

    def __init__(self, fmu2: UnpackedFmu, fmu3: UnpackedFmu3) -> None:
        self.fmu2 = fmu2
        self.two, self.three = Instance(fmu2), Instance3(fmu3)
        self.saved: list[tuple[bytes, float]] = []
        self.samples = 0

    def begin(self, start: float, source: int) -> None:
        assert self.two.setup(start) == OK
        assert self.two.set_integer("kinematics_source", source) == OK
        assert self.two.call("EnterInitializationMode") == OK
        assert self.three.set({"kinematics_source": source}, "Int32") == OK
        assert self.three.enter_initialisation(start) == OK
        self.write(motion(self.fmu2, start))
        self.compare()  # the first sample, taken for the time being
        assert self.two.call("ExitInitializationMode") == self.three.call("ExitInitializationMode") == OK
        self.now = start

    def write(self, values: dict[str, float]) -> None:
        assert self.two.set_real(values) == self.three.set_elements(values) == OK

    def step(self, length: float, seed: int) -> None:
        self.write(motion(self.fmu2, self.now, seed))
        assert self.two.step(self.now, length) == self.three.step(self.now, length) == OK, self.two.messages[-1:]
        self.now += length
        self.samples += 1
        self.compare()

    def compare(self) -> None:
        assert bits(self.two.outputs()) == bits(self.three.outputs())

    def save(self) -> None:
        states = self.two.save(), self.three.save()
        assert states[0] == states[1]  # the same bytes: a state of either serves both
        self.saved.append((states[0], self.now))

    def restore(self, state: tuple[bytes, float]) -> None:
        assert self.two.restore(state[0]) == self.three.restore(state[0]) == OK
        self.now = state[1]
        self.compare()

    def tune(self, name: str, factor: float) -> None:
        (value,) = self.two.get_real([name])
        assert self.three.get([name])[0] == value
        self.write({name: value * factor})

    def restart(self, start: float, source: int) -> None:
        assert self.two.call("Reset") == self.three.call("Reset") == OK
        self.begin(start, source)

    def refuse(self) -> None:
        good = self.two.save(), self.now
        assert self.two.step(self.now, -1.0) == self.three.step(self.now, -1.0) == ERROR
        self.compare()
        self.restore(good)


@pytest.mark.parametrize("seed", range(6))
def test_random_lives_have_the_same_bits(small_fmu: UnpackedFmu, small_fmu3: UnpackedFmu3, seed: int) -> None:
    """Resets, tunable parameters between steps, saved states, refused calls, steps of any length, all three sources."""
    draw = random.Random(seed)
    pair = Pair(small_fmu, small_fmu3)
    seen = set()
    with pair.two, pair.three:
        pair.begin(draw.uniform(-1, 1), 1 + seed % 3)
        for _ in range(300):
            event = draw.choice(EVENTS) if draw.random() < 0.15 else "step"
            if event in ("restore", "swap") and not pair.saved:
                continue
            seen.add(event)
            if event == "step":
                pair.step(draw.choice([0.001, 1 / 60, draw.uniform(1e-4, 0.1)]), seed)
            elif event == "tune":
                pair.tune(draw.choice(TUNABLE), draw.uniform(1.0, 1.1))
            elif event == "save":
                pair.save()
            elif event == "restore":
                pair.restore(draw.choice(pair.saved))
            elif event == "swap":
                pair.restore((pair.three.save(), pair.now))  # the state of FMI 3.0 into FMI 2.0
            elif event == "reset":
                pair.restart(draw.uniform(-1, 1), draw.randint(1, 3))
            else:
                pair.refuse()
        assert pair.two.call("Terminate") == pair.three.call("Terminate") == OK
        pair.compare()
        pair.restart(0.0, 1)
        pair.step(0.001, seed)
    assert seen == {*EVENTS, "step"} and pair.samples > 200


def test_a_recording_gives_the_same_columns(tmp_path: Path) -> None:
    finger = ROOT / "examples" / "fingers" / "index_finger.json"
    recording = read_recording(TESTS / "reference" / "index_finger_in.csv")
    fmus = [build_fmu(finger, tmp_path / f"{fmi}.fmu", illustrated=False, fmi=fmi) for fmi in (2, 3)]
    two, three = (run_fmu(fmu, recording) for fmu in fmus)
    assert list(two) == list(three) and len(two) > 20
    assert {name for name in two if two[name].dtype != three[name].dtype} == set()
    assert {name for name in two if two[name].tobytes() != three[name].tobytes()} == set()
    assert len(np.unique(two["compensated_torque[1]"])) > 0.9 * len(recording)  # it moves


def test_all_outputs_that_there_may_be(tmp_path: Path) -> None:
    """Force at the tip, link of a contact (an Int32), contact at rest, faults of sensors."""
    description = {
        **FINGER,
        "links": [{"axis": [0, 0, 1]}, {"axis": [0, 0, 1], "offset": [0.05, 0, 0]}],
        "tip": [0.04, 0, 0],
        "contact": {"threshold": [0.03, 0.02], "rest": {"travel": 1e-4, "threshold": [0.1, 0.1]}},
        "sensor_fault": {},
    }
    (tmp_path / "finger.json").write_text(json.dumps(description))
    fmus = [build_fmu(tmp_path / "finger.json", tmp_path / f"{k}.fmu", illustrated=False, fmi=k) for k in (2, 3)]
    pair = Pair(unpack(fmus[0], tmp_path / "2"), unpack3(fmus[1], tmp_path / "3"))
    assert "contact_observable" in pair.three.fmu.variables and "contact_at_rest" in pair.three.fmu.variables
    links = set()
    with pair.two, pair.three:
        pair.begin(0.0, 1)
        for k in range(400):
            pair.step(0.005, k // 100)
            assert pair.two.get_integers(["contact_link"]) == list(pair.three.get(["contact_link"], "Int32"))
            links |= set(pair.two.get_integers(["contact_link"]))
    assert len(links) > 1
    assert pair.three.fmu.variables["fingertip_force"].size == 3


# --- derivatives ------------------------------------------------------------------------------------------------------


def jacobian2(instance: Instance, unknowns: list[str], knowns: list[str]) -> NDArray[np.float64]:
    columns = []
    for known in knowns:
        found = (c_double * len(unknowns))()
        direction = ctypes.byref(c_double(1.0))
        lists = instance.vrs(unknowns), len(unknowns), instance.vrs([known]), 1
        assert instance.call("GetDirectionalDerivative", *lists, direction, found) == OK
        columns.append(list(found))
    return np.array(columns).T


def derive(instance: Instance3, name: str, unknowns: list[str], knowns: list[str], seed: list[float]) -> list[float]:
    """`name`: Directional or Adjoint."""
    count = instance.fmu.count(unknowns if name == "Directional" else knowns)
    found = (c_double * count)(*[np.nan] * count)
    lists = instance.vrs(unknowns), len(unknowns), instance.vrs(knowns), len(knowns)
    numbers = (c_double * len(seed))(*seed)
    status = instance.call(f"Get{name}Derivative", *lists, numbers, len(seed), found, count)
    assert status == OK, instance.last_message
    return list(found)


@pytest.mark.parametrize("source", [1, 2, 3])
@pytest.mark.parametrize("mode", ["Initialization Mode", "Step Mode"])
def test_derivatives(small_fmu: UnpackedFmu, small_fmu3: UnpackedFmu3, source: int, mode: str) -> None:
    """Directional ones have the bits of FMI 2.0; adjoint ones are the transposed Jacobian times the seed."""
    pair = Pair(small_fmu, small_fmu3)
    unknowns, knowns = small_fmu3.with_derivatives(), small_fmu3.names("input")
    with pair.two, pair.three:
        if mode == "Step Mode":
            pair.begin(0.0, source)
            for _ in range(20):
                pair.step(0.002, 1)
        else:
            assert pair.two.setup() == pair.two.set_integer("kinematics_source", source) == OK
            assert pair.two.call("EnterInitializationMode") == OK
            assert pair.three.set({"kinematics_source": source}, "Int32") == pair.three.enter_initialisation() == OK
            pair.write(motion(small_fmu, 0.0))
        before = pair.three.save()
        j = jacobian2(pair.two, small_fmu3.element_names(unknowns), small_fmu3.element_names(knowns))
        assert np.abs(j).max() > 1e-3
        for k in range(j.shape[1]):
            seed = [float(i == k) for i in range(j.shape[1])]
            assert bits(derive(pair.three, "Directional", unknowns, knowns, seed)) == bits(list(j[:, k]))
        weights = np.random.default_rng(1).normal(size=j.shape[0])
        found = np.array(derive(pair.three, "Adjoint", unknowns, knowns, list(weights)))
        # sums of 30 products in another order: rounding only
        np.testing.assert_allclose(found, j.T @ weights, rtol=0, atol=1e-14 * np.abs(j).sum() * np.abs(weights).max())
        assert pair.three.save() == before
        if mode == "Step Mode":
            pair.step(0.002, 1)


def test_parts_of_arrays_lists_and_repeated_variables(small_fmu3: UnpackedFmu3) -> None:
    with Instance3(small_fmu3) as instance:
        instance.initialise()
        force, torque = ["tendon_force"], ["joint_torque"]
        once = derive(instance, "Directional", torque, force, [1.0, 2.0, 3.0])
        # the same known twice: the directions add up, as in FMI 2.0
        twice = derive(instance, "Directional", torque * 2, force * 2, [0.0, 2.0, 3.0, 1.0, 0.0, 0.0])
        assert twice == once * 2 and any(once)
        arms = [[0.009, -0.008, 0.005], [0.007, -0.006, -0.004]]  # joint_torque = transposed moment arms times forces
        np.testing.assert_allclose(once, np.array(arms) @ [1.0, 2.0, 3.0], rtol=1e-15)
        adjoint = derive(instance, "Adjoint", torque, force, [1.0, 10.0])
        np.testing.assert_allclose(adjoint, np.array(arms).T @ [1.0, 10.0], rtol=1e-15)


def test_both_versions_refuse_a_state_of_another_finger(
    small_fmu: UnpackedFmu, small_fmu3: UnpackedFmu3, tmp_path: Path
) -> None:
    other = build_fmu(
        ROOT / "examples" / "fingers" / "index_finger.json", tmp_path / "other.fmu", illustrated=False, fmi=3
    )
    with Instance3(unpack3(other, tmp_path / "other")) as stranger:
        state = stranger.save()
    with Instance(small_fmu) as two, Instance3(small_fmu3) as three:
        assert two.restore(state) == three.restore(state) == ERROR
        assert two.messages[-1][2].partition(": ")[2] == three.last_message.partition(": ")[2]
