"""Inputs that no sample can have, and inputs that nobody has set: what a step and the end of the initialisation do."""

from __future__ import annotations

import math
import re
import sys
from ctypes import c_double, c_int
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from fmpy.fmi1 import FMICallException

from fmu_binary import COULOMB, DISCARD, ERROR, OK, SOURCE, WARNING, Instance, UnpackedFmu, motion, pointer, spelled
from fmu_kinds import STEP, Kind, friction_kind, good_arguments, plant_kind
from plant_fmu_rig import play
from plant_rigs import needs_plant

NAN = math.nan
BAD = (NAN, math.inf, -math.inf, sys.float_info.max, -2e12)
FORCE, TORQUE, PUSH = "tendon_force[2]", "joint_torque[1]", "push_force[3]"


def inputs_in_use(kind: Kind) -> list[str]:
    """With kinematics source 1."""
    return [name for name in kind.fmu.names("input") if not name.startswith("joint_")]


def sound(kind: Kind, time: float) -> dict[str, float]:
    return motion(kind.fmu, time) if kind.has_derivatives else dict.fromkeys(kind.fmu.names("input"), 0.0)


# --- discarded steps --------------------------------------------------------------------------------------------------


def test_a_step_with_a_bad_input_is_discarded_and_the_next_one_goes_on(kind: Kind) -> None:
    expected = r" = (nan|-?inf|[-+e.\d]+)( at time 0.005 s)?: expected .*(1e\+12|-10 to 10|-10000 to 10000) (N|m)$"
    with kind.brought_to("s") as instance, kind.brought_to("s") as untouched:
        shown, rows = instance.outputs(), []
        for name in inputs_in_use(kind):
            for value in BAD:
                assert instance.write({name: value}) == OK
                before = instance.save()
                assert instance.step(0.005) == DISCARD
                status, category, text = instance.messages[-1]
                assert (status, category) == (DISCARD, "logStatusDiscard")
                assert re.match(spelled("fmi3DoStep: ", kind.fmu.version) + re.escape(name) + expected, text), text
                assert instance.save() == before and instance.outputs() == shown
                assert instance.write(sound(kind, 0.005)) == OK
        for one in (instance, untouched):
            assert one.write(sound(kind, 0.005)) == OK and one.step(0.005) == OK
            rows.append((kind.advance(one, 6, 5), one.save()))
        assert rows[0] == rows[1]


def test_a_master_may_leave_a_bad_sample_out(small: UnpackedFmu) -> None:
    """As a recording that has lost it."""
    kind, rows = friction_kind(small), []
    for bad in (True, False):
        with kind.brought_to("s") as instance:
            if bad:
                assert instance.write({FORCE: NAN}) == OK and instance.step(0.005) == DISCARD
            rows.append((kind.advance(instance, 6, 5), instance.save()))
    assert rows[0] == rows[1]


def test_inputs_out_of_use_may_be_anything(small: UnpackedFmu) -> None:
    with friction_kind(small).brought_to("s") as instance:
        for name in ("joint_position[1]", "joint_velocity[2]"):
            assert instance.write({name: NAN}) == OK and instance.step(0.005) == OK
    with Instance(small) as instance:
        assert instance.write({SOURCE: 3}) == OK
        instance.initialise(motion(small, 0.0))
        assert instance.write({"tendon_position[1]": NAN}) == OK and instance.step(0.1) == OK
        assert instance.write({"joint_velocity[2]": NAN}) == OK and instance.step(0.2) == DISCARD
        assert "joint_velocity[2] = nan" in instance.last_message


def test_what_the_status_says_after_a_discarded_step(small_fmu: UnpackedFmu) -> None:
    reached, flag = c_double(), c_int(-1)
    with friction_kind(small_fmu).brought_to("s") as instance:
        for force, status, end in ((NAN, DISCARD, 0.005), (5.0, OK, 0.006)):
            assert instance.write({FORCE: force}) == OK and instance.step(0.005) == status
            assert instance.call("GetStatus", 0, pointer(flag)) == OK and flag.value == status
            assert instance.call("GetRealStatus", 2, pointer(reached)) == OK
            assert reached.value == pytest.approx(end, rel=1e-15)
            assert instance.call("GetBooleanStatus", 3, pointer(flag)) == OK and flag.value == 0
        assert instance.write({FORCE: NAN}) == OK and instance.step(0.006) == DISCARD
        assert instance.restore(instance.save()) == OK  # leads out of the standard's stepFailed
        assert instance.call("GetStatus", 0, pointer(flag)) == OK and flag.value == OK


def test_the_last_successful_time_of_fmi_3_0(small_fmu3: UnpackedFmu) -> None:
    with Instance(small_fmu3) as instance:
        instance.initialise(motion(small_fmu3, 0.0), start=2.0)
        assert instance.write({FORCE: NAN}) == OK
        assert instance.step(2.5, 0.25) == DISCARD and instance.reached.value == 2.0  # step() sees that no flag is set
        assert instance.write({FORCE: 5.0}) == OK
        assert instance.step(2.5, 0.25) == OK and instance.reached.value == 2.75
        assert instance.write({FORCE: NAN}) == OK
        assert instance.step(2.75, 0.25) == DISCARD and instance.reached.value == 2.75
        assert instance.read(["time"]) == [2.75]


def test_a_state_may_be_saved_with_bad_inputs(kind: Kind) -> None:
    name = inputs_in_use(kind)[0]
    for state in "ims":
        with kind.brought_to(state) as instance, Instance(kind.fmu) as other:
            assert instance.write({name: NAN}) == OK
            assert state != "s" or instance.step(0.005) == DISCARD
            saved = instance.save()
            assert other.restore(saved) == OK and other.save() == saved
            assert instance.restore(saved) == OK  # a plant that is restored starts its integrator anew
            rows = []
            for one in (instance, other):
                if state != "s":
                    assert state == "m" or one.enter_initialisation() == OK
                    assert one.call("ExitInitializationMode") == WARNING
                time = 0.005 if state == "s" else 0.0
                assert one.step(time) == DISCARD
                assert one.write(sound(kind, time)) == OK and one.step(time) == OK
                rows.append((one.outputs(), one.save()))
            assert rows[0] == rows[1]


def test_what_is_no_fault_of_the_inputs_is_an_error(small: UnpackedFmu) -> None:
    with friction_kind(small).brought_to("s") as instance:
        assert instance.write({FORCE: NAN, COULOMB: 0.5}) == OK
        assert instance.step(0.005) == ERROR and "expected at least coulomb" in instance.last_message


def test_a_master_that_repeats_a_bad_step_is_stopped(kind: Kind) -> None:
    """Some would never end. Other points, or a good step in between, begin the count anew."""
    name = inputs_in_use(kind)[0]
    with kind.brought_to("s") as instance:
        for start in (0.005, 0.006):
            assert instance.write({name: NAN}) == OK
            for _ in range(1000):
                assert instance.step(start) == DISCARD
            if start == 0.005:
                assert instance.write(sound(kind, start)) == OK and instance.step(start) == OK
        assert instance.step(0.006) == ERROR and "the step was tried 1000 times" in instance.last_message


# --- fmpy -------------------------------------------------------------------------------------------------------------


def recorded(small: UnpackedFmu, rows: int) -> Any:
    """Inputs of fmpy, with a NaN in row 5. Arrays of FMI 3.0 must have one size in fmpy: those of the tendons."""
    names = [n for n, v in small.variables.items() if v.causality == "input" and n.startswith("tendon")]
    kinds = {n: (len(small.elements(n)),) for n in names}
    table = np.zeros(
        rows, dtype=[("time", float), *((n, float, k if small.version == 3 else ()) for n, k in kinds.items())]
    )
    table["time"] = STEP * np.arange(rows)
    for k in range(rows):
        for element, value in motion(small, STEP * k).items():
            name, at = small.place(element)
            if name in kinds:
                table[name][(k, at) if small.version == 3 else k] = value
    first = small.place(FORCE)
    table[first[0]][(5, first[1]) if small.version == 3 else 5] = NAN
    return table


@pytest.mark.parametrize("fixture", ["small_fmu", "small_fmu3"])
def test_fmpy_ends_with_an_exception_at_a_bad_sample(fixture: str, request: pytest.FixtureRequest) -> None:
    """fmpy 0.3.32 itself repeats a discarded step of FMI 2.0 for ever."""
    fmu: UnpackedFmu = request.getfixturevalue(fixture)
    path: Path = request.getfixturevalue(fixture + "_path")
    messages: list[str] = []
    with pytest.raises(FMICallException, match=f"fmi{fmu.version}DoStep"):
        fmpy.simulate_fmu(
            str(path),
            validate=False,
            input=recorded(fmu, 20),
            stop_time=0.019,
            output_interval=STEP,
            debug_logging=True,
            logger=lambda *arguments: messages.append(str(arguments[-1])),
        )
    assert messages and f"{FORCE} = nan at time 0.005 s" in messages[-1]


# --- initialisation without inputs, and with bad ones -----------------------------------------------------------------


def test_without_inputs_the_first_step_takes_the_first_sample(small: UnpackedFmu) -> None:
    kind, rows = friction_kind(small), []
    with Instance(small) as given, Instance(small) as late:
        given.initialise(motion(small, 0.0))
        late.initialise()
        assert "the first step takes the first sample" in late.last_message
        for one in (given, late):
            rows.append(kind.advance(one, 0, 50))
        assert rows[0] == rows[1]
        assert given.save()[88:] == late.save()[88:]  # but for checksums, and whether an input was set in time


def test_an_input_that_was_set_in_part_is_the_first_sample(small: UnpackedFmu) -> None:
    """The others stand at 0. Before the initialisation mode counts, too."""
    for early in (True, False):
        with Instance(small) as instance:
            assert not early or instance.write({FORCE: 2.0}) == OK
            assert instance.enter_initialisation() == OK
            assert early or instance.write({FORCE: 2.0}) == OK
            assert instance.call("ExitInitializationMode") == OK
            assert "the first sample is taken" in instance.last_message
            first = instance.outputs()
            assert instance.write(motion(small, 0.0)) == OK and instance.outputs() == first
            assert instance.step(0.0) == OK and instance.outputs() == first


def test_outputs_follow_the_inputs_until_the_first_sample(small: UnpackedFmu) -> None:
    kind = friction_kind(small)
    with Instance(small) as instance:
        instance.initialise(start=1.0)
        assert instance.read([TORQUE, "compensated_torque[1]", "contact"]) == [0.0, 0.0, 0]
        for force in (1.0, 3.0):
            assert instance.write({"tendon_force[1]": force}) == OK
            saved = instance.save()
            assert instance.read([TORQUE]) == [0.009 * force] and instance.save() == saved
            assert (
                instance.call("GetDirectionalDerivative", *good_arguments(instance, "GetDirectionalDerivative")) == OK
            )
            assert instance.save() == saved and instance.restore(saved) == OK
        assert instance.step(0.5) == ERROR and "not before the start time" in instance.last_message
        assert instance.restore(saved) == OK and instance.step(1.5) == OK
        kind.advance(instance, 1600, 3)


def test_terminated_before_the_first_sample(small: UnpackedFmu) -> None:
    with Instance(small) as instance, Instance(small) as other:
        instance.initialise()
        assert instance.call("Terminate") == OK and instance.read([TORQUE]) == [0.0]
        assert other.restore(instance.save()) == OK and other.read([TORQUE]) == [0.0]
        assert other.step(0.0) == ERROR


def test_bad_inputs_put_the_initialisation_off_until_the_first_step(kind: Kind) -> None:
    name = inputs_in_use(kind)[0]
    with Instance(kind.fmu) as instance, Instance(kind.fmu) as plain:
        assert instance.enter_initialisation() == OK
        assert instance.write({name: NAN}) == OK
        numbers = kind.fmu.names("output")
        whole = kind.fmu.whole(numbers)
        for state in "ms":
            found = (c_double * len(numbers))(*[7.0] * len(numbers))
            assert instance.transfer("Get", "Float64", instance.vrs(whole), found, len(numbers)) == WARNING
            assert (
                f"{name} = nan" in instance.last_message and "outputs are 0 with such inputs" in instance.last_message
            )
            assert not any(found)
            if kind.has_derivatives:
                unknowns, knowns = kind.fmu.whole(["joint_torque[1]"]), kind.fmu.whole([name])
                seed, count = [1.0] * kind.fmu.count(knowns), kind.fmu.count(unknowns)
                zeros = WARNING, [0.0] * count
                assert instance.derive("Directional", unknowns, knowns, seed, count) == zeros
            if state == "m":
                assert instance.call("ExitInitializationMode") == WARNING
                warned = [text for status, _, text in instance.messages if status == WARNING]
                assert re.match(spelled("fmi3ExitInitializationMode: ", kind.fmu.version) + re.escape(name), warned[-1])
        assert instance.step(0.0) == DISCARD
        assert instance.write(sound(kind, 0.0)) == OK
        plain.initialise(sound(kind, 0.0))
        rows = [kind.advance(one, 0, 20) for one in (instance, plain)]
        assert rows[0] == rows[1]


@needs_plant
def test_the_simulated_finger_settles_without_inputs(plant_fmu: UnpackedFmu) -> None:
    """Its inputs are what is added to the rig's own motion: 0 is one."""
    kind = plant_kind(plant_fmu)
    with Instance(plant_fmu) as instance, Instance(plant_fmu) as zeros:
        instance.initialise()
        assert "the finger has settled" in instance.last_message
        zeros.initialise(sound(kind, 0.0))
        assert play(instance, 20) == play(zeros, 20)


@needs_plant
def test_a_finger_that_settles_late_does_so_at_the_start_time(plant_fmu: UnpackedFmu) -> None:
    with Instance(plant_fmu) as instance:
        assert instance.write({PUSH: NAN}) == OK and instance.enter_initialisation(5.0) == OK
        assert instance.call("ExitInitializationMode") == WARNING
        assert instance.write({PUSH: 0.0}) == OK
        saved = instance.save()
        assert instance.step(5.5) == ERROR and "where the last step ended" in instance.last_message
        assert instance.restore(saved) == OK and instance.step(5.0) == OK
