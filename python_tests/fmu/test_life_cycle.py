"""The life of each FMU: which call is allowed when, samples and their time, parameters, reset, several instances."""

from __future__ import annotations

import math
import re
import time
from concurrent.futures import ThreadPoolExecutor
from ctypes import c_double, c_int, c_int64, c_void_p

import numpy as np
import pytest

from fmi2_headers import FMPY_HEADERS
from fmu_binary import ARM, COULOMB, DISCARD, ERROR, OK, SOURCE, STATIC, Instance, UnpackedFmu, motion, pointer, spelled
from fmu_kinds import CALLS, STATES, Kind, friction_kind, good_arguments
from plant_fmu_rig import play
from plant_rigs import needs_plant

FORCE, TORQUE = "tendon_force[1]", "joint_torque[1]"

# Functions for what these FMUs have not, and the reason that their refusal gives.
MODEL_EXCHANGE = "belongs to model exchange"
OF_STATES = (
    "SetTime",
    "SetContinuousStates",
    "EnterContinuousTimeMode",
    "CompletedIntegratorStep",
    "GetEventIndicators",
)
OF_STATES += ("GetContinuousStates", "GetNominalsOfContinuousStates")
ABSENT = {
    2: {
        "SetRealInputDerivatives": "canInterpolateInputs is false",
        "GetRealOutputDerivatives": "maxOutputDerivativeOrder is 0",
        **dict.fromkeys((*OF_STATES, "EnterEventMode", "NewDiscreteStates", "GetDerivatives"), MODEL_EXCHANGE),
    },
    3: {
        **dict.fromkeys(("EnterEventMode", "EvaluateDiscreteStates", "UpdateDiscreteStates"), "there is no Event Mode"),
        "EnterStepMode": "leads out of the Event Mode, and there is none",
        **dict.fromkeys(("EnterConfigurationMode", "ExitConfigurationMode"), "there are no structural parameters"),
        "GetNumberOfVariableDependencies": "providesPerElementDependencies is false",
        "GetVariableDependencies": "providesPerElementDependencies is false",
        "GetOutputDerivatives": "maxOutputDerivativeOrder is 0",
        **{
            f"{way}{what}{how}": "there are no clocks"
            for way in ("Get", "Set")
            for what in ("Interval", "Shift")
            for how in ("Decimal", "Fraction")
        },
        "ActivateModelPartition": "belongs to scheduled execution",
        **dict.fromkeys((*OF_STATES, "GetContinuousStateDerivatives"), MODEL_EXCHANGE),
        **dict.fromkeys(("GetNumberOfEventIndicators", "GetNumberOfContinuousStates"), MODEL_EXCHANGE),
    },
}
ELSEWHERE = {"GetVersion", "FreeInstance", "InstantiateCoSimulation"}
ELSEWHERE_IN = {
    2: {"GetTypesPlatform", "GetIntegerStatus", "GetStringStatus"},
    3: {"InstantiateModelExchange", "InstantiateScheduledExecution"},
}


# --- which call is allowed --------------------------------------------------------------------------------------------


def test_every_function_of_the_headers_is_tried(small: UnpackedFmu) -> None:
    version = small.version
    header = (FMPY_HEADERS / f"fmi{version}Functions.h").read_text()
    tried = {*CALLS[version], *ABSENT[version], *ELSEWHERE, *ELSEWHERE_IN[version]}
    assert {spelled(f"fmi3{name}", version) for name in tried} == set(
        re.findall(r"fmi\dFullName\((fmi\d\w+)\)", header)
    )
    assert small.function("GetVersion")() == f"{version}.0".encode()


@pytest.mark.parametrize("state", STATES)
def test_calls_are_allowed_as_the_standard_says(kind: Kind, state: str) -> None:
    with kind.brought_to(state) as first:
        saved = first.save()
    for name, states in kind.calls.items():
        with Instance(kind.fmu) as instance:
            assert instance.restore(saved) == OK
            if state == "e":
                assert instance.step(-1.0) == ERROR
            status = instance.call(name, *good_arguments(instance, name))
            assert (status == OK) == (state in states), (name, instance.messages)
            if status != OK:
                refused = spelled(f"{name}: not allowed in state {STATES[state]}", kind.fmu.version)
                assert refused in instance.last_message
            assert instance.function_of_nobody(name, *good_arguments(instance, name)) == ERROR, name


def test_what_there_is_not_is_refused_by_name(small: UnpackedFmu) -> None:
    for name, reason in ABSENT[small.version].items():
        with friction_kind(small).brought_to("s") as instance:
            assert instance.call(name, *[None] * 6) == ERROR
            assert instance.messages[-1][:2] == (ERROR, "logStatusError")
            expected = rf"{spelled(f'fmi3{name}', small.version)}: .*{reason}"
            assert re.match(expected, instance.last_message), instance.last_message
            assert instance.step(0.0) == ERROR  # the standard has the instance terminated
            assert instance.call("Reset") == OK and instance.enter_initialisation() == OK
            assert instance.function_of_nobody(name, *[None] * 6) == ERROR
    small.function("FreeInstance")(None)


def test_after_an_error_only_reset_or_a_saved_state_lead_on(kind: Kind) -> None:
    refused = spelled("not allowed in state Terminated after an error", kind.fmu.version)
    with kind.brought_to("s") as instance:
        good = instance.save()
        for _ in range(2):
            assert instance.step(-1.0) == ERROR
            assert instance.write(kind.tuned) == ERROR
            assert instance.step(1.0) == ERROR and refused in instance.last_message
            assert instance.restore(good) == OK
            kind.advance(instance, 5, 1)
        assert instance.step(-1.0) == ERROR
        assert instance.call("Reset") == OK
        instance.initialise()
        kind.advance(instance, 0, 1)


# --- samples and time -------------------------------------------------------------------------------------------------


def test_inputs_show_in_outputs_before_the_first_step(small: UnpackedFmu) -> None:
    with Instance(small) as instance:
        assert instance.enter_initialisation() == OK
        for force in (1.0, 3.0, 2.0):
            assert instance.write({FORCE: force}) == OK
            assert instance.read([TORQUE]) == [0.009 * force]
        tuned = {STATIC: 0.5, COULOMB: 0.4}
        assert instance.write(tuned) == OK
        assert instance.read([TORQUE]) == [0.018]
        assert instance.call("ExitInitializationMode") == OK
        assert instance.read([TORQUE, *tuned]) == [0.018, 0.5, 0.4]  # parameters survive the trial


@needs_plant
def test_a_push_shows_in_outputs_before_the_first_step(plant_fmu: UnpackedFmu) -> None:
    """At the second link's tip (0.04 m out, links 0.04 m): τ = −Jᵀ F, at rest with all angles near 0."""
    with Instance(plant_fmu) as instance:
        assert instance.enter_initialisation() == OK
        assert instance.read(["truth.contact"]) == [0]
        for force in (1.0, 2.0):
            assert instance.write({"push_force[3]": force}) == OK
            torque = instance.read(["truth.external_torque[1]", "truth.external_torque[2]"])
            np.testing.assert_allclose(torque, [0.08 * force, 0.04 * force], rtol=0.02)
            assert instance.read(["truth.contact_force[3]", "truth.contact"]) == [force, 1]
        forces = [f"truth.tendon_force[{i}]" for i in range(1, 5)]
        before = np.mean(instance.read(forces))
        assert instance.write({"pretension": 5.0}) == OK
        assert np.mean(instance.read(forces)) == pytest.approx(before + 5.0, abs=0.05)  # it has settled with it
        shown = instance.outputs()
        assert instance.call("ExitInitializationMode") == OK and instance.outputs() == shown


def test_looking_at_outputs_in_initialisation_mode_leaves_no_trace(kind: Kind) -> None:
    rows = []
    for curious in (True, False):
        with Instance(kind.fmu) as instance:
            assert instance.write({kind.setting: 2}) == OK and instance.enter_initialisation() == OK
            for k in range(3):
                inputs = motion(kind.fmu, 0.1 * k) if kind.has_derivatives else {"push_force[1]": 1e-3 * k}
                assert instance.write(inputs) == OK
                assert not curious or instance.outputs()
            assert instance.call("ExitInitializationMode") == OK
            rows.append((kind.advance(instance, 0, 50), instance.save()))
    assert rows[0] == rows[1]


def test_outputs_belong_to_the_sample_last_taken(small: UnpackedFmu) -> None:
    with Instance(small) as instance:
        instance.initialise(motion(small, 0.0))
        first = instance.outputs()
        assert instance.write(motion(small, 0.3)) == OK and instance.outputs() == first
        assert instance.step(0.0) == OK  # at the time of the first sample: changes nothing, even with other inputs
        assert instance.outputs() == first
        assert instance.step(0.3) == OK
        second = instance.outputs()
        assert second != first
        assert instance.write(motion(small, 0.6)) == OK and instance.step(0.3) == OK
        assert instance.outputs() == second


def test_steps_of_any_length(small: UnpackedFmu) -> None:
    """Jitter, 1/60 s, past the stop time by rounding, and 10^12 s at once."""
    with Instance(small) as instance:
        assert instance.enter_initialisation(-1.0, 1.0) == instance.call("ExitInitializationMode") == OK
        now = -1.0
        for step in (1 / 60, 1e-9, 0.3, 1 / 60, 0.7, 0.966667):
            assert instance.step(now, step) == OK
            now += step
        assert now > 1.0
    with Instance(small) as instance:
        instance.initialise(motion(small, 0.0))
        begin = time.thread_time()
        assert instance.step(0.0, 1e12) == OK and instance.step(1e12, 1e12) == OK
        assert time.thread_time() - begin < 0.1  # of the processor: a loaded machine may take longer
        assert all(abs(value) < 1e12 for value in instance.outputs())


@pytest.mark.parametrize("begin", [0.0, -3.7])
def test_no_step_leads_past_the_stop_time(kind: Kind, begin: float) -> None:
    """However the client adds up its time: ten steps of 0.1 s, not an eleventh."""
    added = [begin]
    for _ in range(10):
        added.append(added[-1] + 0.1)
    for times in (added, [begin + 0.1 * k for k in range(11)]):
        with Instance(kind.fmu) as instance:
            assert instance.enter_initialisation(begin, begin + 1.0) == instance.call("ExitInitializationMode") == OK
            for time_now in times[:10]:
                assert instance.step(time_now, 0.1) == OK, instance.last_message
            assert instance.step(times[10], 0.1) == ERROR
            assert "expected a step that ends at the stop time or before" in instance.last_message


@pytest.mark.parametrize(
    ("start", "stop", "expected"),
    [
        (math.nan, None, "startTime = nan"),
        (math.inf, None, "startTime = inf"),
        (1.0, 0.5, "stopTime = 0.5"),
        (0.0, math.nan, "nan"),
    ],
)
def test_bad_experiment(small: UnpackedFmu, start: float, stop: float | None, expected: str) -> None:
    with Instance(small) as instance:
        assert instance.enter_initialisation(start, stop) == ERROR and expected in instance.last_message


def test_the_experiment_of_fmi_2_0_may_be_left_out(small_fmu: UnpackedFmu) -> None:
    with Instance(small_fmu) as instance:
        assert instance.call("EnterInitializationMode") == instance.call("ExitInitializationMode") == OK
        assert instance.step(0.0) == OK


def test_time_of_fmi_3_0_is_the_end_of_the_last_step(small_fmu3: UnpackedFmu) -> None:
    with Instance(small_fmu3) as instance:
        assert instance.read(["time"]) == [0.0]
        instance.initialise(start=3.0)
        assert instance.read(["time"]) == [3.0]
        assert instance.step(3.0, 0.25) == OK
        assert instance.read(["time"]) == [3.25] and instance.reached.value == 3.25
        state = instance.save()
        assert instance.step(3.25, -1.0) == ERROR and instance.reached.value == 3.25
        assert instance.restore(state) == OK and instance.read(["time"]) == [3.25]
        assert instance.write({"time": 1.0}) == ERROR
        assert "fmi3SetFloat64: time: the independent variable is not written" in instance.last_message


def test_status_inquiries_of_fmi_2_0(small_fmu: UnpackedFmu) -> None:
    with friction_kind(small_fmu).brought_to("s") as instance:
        assert instance.step(0.0045, 1 / 60) == OK
        reached, flag = c_double(), c_int(-1)
        assert instance.call("GetRealStatus", 2, pointer(reached)) == OK and reached.value == 0.0045 + 1 / 60
        assert instance.call("GetBooleanStatus", 3, pointer(flag)) == OK and flag.value == 0
        assert instance.call("GetStatus", 0, pointer(flag)) == OK and flag.value == OK
        for name, which in (("Status", 1), ("RealStatus", 0), ("IntegerStatus", 0), ("StringStatus", 1)):
            assert instance.call("Get" + name, which, pointer(c_int64())) == DISCARD
        assert instance.step(0.006) == OK  # an inquiry without an answer is no error
        assert instance.call("GetRealStatus", 2, c_void_p()) == ERROR


# --- parameters -------------------------------------------------------------------------------------------------------


def test_start_values_are_those_of_the_xml(kind: Kind) -> None:
    fmu = kind.fmu
    starts = {name: v.start.split() for name, v in fmu.variables.items() if v.start is not None}
    elements = [element for name in starts for element in fmu.elements(name)]
    numbers = {"true": 1.0, "false": 0.0}
    with Instance(fmu) as instance:
        for state in ("i", "m"):
            if state in CALLS[fmu.version]["GetFloat64"]:
                expected = [numbers.get(x) if x in numbers else float(x) for start in starts.values() for x in start]
                assert instance.read(elements) == expected and len(expected) > 15
            instance.enter_initialisation()


def test_related_parameters_may_be_written_one_by_one_in_any_order(small: UnpackedFmu) -> None:
    for first, second in ((STATIC, COULOMB), (COULOMB, STATIC)):
        values = {STATIC: 0.002, COULOMB: 0.001} if first == COULOMB else {STATIC: 0.2, COULOMB: 0.1}
        with friction_kind(small).brought_to("s") as instance:
            for name in (second, first):  # coulomb above static in between, or static below coulomb
                assert instance.write({name: values[name]}) == OK
            assert instance.step(0.006) == OK, instance.last_message
            assert instance.read([STATIC, COULOMB]) == [values[STATIC], values[COULOMB]]


def test_impossible_parameters_refuse_the_sample_and_change_nothing(small: UnpackedFmu) -> None:
    for state, name in (("s", "DoStep"), ("m", "ExitInitializationMode")):
        with friction_kind(small).brought_to(state) as instance:
            good = instance.save()
            assert instance.write({COULOMB: 0.5}) == OK
            before = instance.save()
            for _ in range(2):
                assert (instance.step(0.006) if state == "s" else instance.call(name)) == ERROR
                refused = spelled(f"fmi3{name}: {STATIC} = 0.03: expected at least coulomb = 0.5", small.version)
                assert refused in instance.last_message
                assert instance.save() == before and instance.restore(before) == OK
            assert instance.restore(good) == OK
            assert (instance.step(0.006) if state == "s" else instance.call(name)) == OK


def test_parameters_take_effect_with_the_next_sample(small: UnpackedFmu) -> None:
    with friction_kind(small).brought_to("s") as tuned, friction_kind(small).brought_to("s") as plain:
        shown = tuned.outputs()
        assert tuned.write({"contact.threshold[1]": 0.0, "contact.threshold_per_force[1]": 0.0}) == OK
        assert tuned.outputs() == shown
        for instance in (tuned, plain):
            assert instance.write(motion(small, 0.01)) == OK and instance.step(0.01) == OK
        assert tuned.outputs() != plain.outputs()
        assert tuned.read(["joint_contact[1]"]) == [1]


def test_fixed_parameters_can_be_written_before_the_first_sample(small: UnpackedFmu) -> None:
    with Instance(small) as instance:
        assert instance.write({ARM: 0.02, SOURCE: 2}) == OK
        assert instance.enter_initialisation() == OK
        assert instance.write({FORCE: 10.0, "joint_position[1]": 0.25, SOURCE: 3}) == OK
        assert instance.call("ExitInitializationMode") == OK
        assert instance.read([TORQUE, "joint_angle[1]", SOURCE]) == [pytest.approx(0.2, rel=1e-15), 0.25, 3]


# --- reset and several instances --------------------------------------------------------------------------------------


@pytest.mark.parametrize("state", STATES)
def test_reset_leads_back_to_the_beginning_from_anywhere(kind: Kind, state: str) -> None:
    with Instance(kind.fmu) as fresh, kind.brought_to(state) as instance:
        beginning = fresh.save()
        if state in "ims":
            assert instance.write(kind.tuned) == OK
        assert instance.call("Reset") == OK
        assert instance.save() == beginning
        rows = []
        for one in (instance, fresh):
            one.initialise()
            rows.append(kind.advance(one, 0, 60))
        assert rows[0] == rows[1]


def test_interleaved_instances_equal_instances_alone(kind: Kind) -> None:
    with Instance(kind.fmu) as instance:
        instance.initialise()
        alone = kind.advance(instance, 0, 100)
    with Instance(kind.fmu) as first, Instance(kind.fmu) as second:
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
        with Instance(kind.fmu) as instance:
            instance.initialise()
            return kind.advance(instance, 0, 100 + first)

    expected = [run(k) for k in range(4)]
    with ThreadPoolExecutor(4) as pool:
        assert list(pool.map(run, range(4))) == expected


# --- settings and time of the simulated finger ------------------------------------------------------------------------


@needs_plant
def test_a_start_time_other_than_zero_changes_nothing(plant_fmu: UnpackedFmu) -> None:
    rows = []
    for start in (0.0, 5.0, -1.25, 1e5):
        with Instance(plant_fmu) as instance:
            instance.initialise(start=start)
            rows.append(play(instance, 250, start=start))
    assert rows[0] == rows[1] == rows[2] == rows[3]
