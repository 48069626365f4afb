"""The functions of FMI 3.0: which is allowed when, what is refused and why, and that all of the headers are there."""

from __future__ import annotations

import ctypes
import importlib.util
import math
import re
from collections.abc import Callable
from ctypes import c_double, c_int32, c_uint32, c_void_p
from pathlib import Path

import pytest

from fmi3_binary import LOGGER, OTHER_TYPES, TYPES, Instance3, UnpackedFmu3
from fmu_binary import ARM, COULOMB, ERROR, OK, WARNING, UnpackedFmu, motion
from fmu_kinds import CALLS_3, friction3_kind

FORCE, OUTPUT, SOURCE = "tendon_force", "compensated_torque", "kinematics_source"
NAN, INF = math.nan, math.inf

REFUSED = {
    "EnterEventMode": "there is no Event Mode",
    "EnterStepMode": "leads out of the Event Mode, and there is none",
    "EvaluateDiscreteStates": "there is no Event Mode",
    "UpdateDiscreteStates": "there is no Event Mode",
    "EnterConfigurationMode": "there are no structural parameters",
    "ExitConfigurationMode": "there are no structural parameters",
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
    **dict.fromkeys(
        (
            "EnterContinuousTimeMode",
            "CompletedIntegratorStep",
            "SetTime",
            "SetContinuousStates",
            "GetContinuousStateDerivatives",
            "GetEventIndicators",
            "GetContinuousStates",
            "GetNominalsOfContinuousStates",
            "GetNumberOfEventIndicators",
            "GetNumberOfContinuousStates",
        ),
        "belongs to model exchange",
    ),
}
ELSEWHERE = {"GetVersion", "FreeInstance"} | {
    f"Instantiate{kind}" for kind in ("CoSimulation", "ModelExchange", "ScheduledExecution")
}


def forces(fmu: UnpackedFmu3, **changes: float) -> dict[str, list[float]]:
    """Forces of 5 N, but for elements given as `_2=value`, from 1."""
    values = [5.0] * fmu.variables[FORCE].count
    for key, value in changes.items():
        values[int(key[1:]) - 1] = value
    return {FORCE: values}


# --- all functions ----------------------------------------------------------------------------------------------------


def test_every_function_of_the_headers_is_there_and_tried_here(small_fmu3: UnpackedFmu3) -> None:
    spec = importlib.util.find_spec("fmpy")
    assert spec and spec.submodule_search_locations
    header = (Path(spec.submodule_search_locations[0]) / "c-code" / "fmi3Functions.h").read_text()
    names = set(re.findall(r"fmi3FullName\(fmi3(\w+)\)", header))
    assert len(names) == 75
    assert names == set(CALLS_3) | set(REFUSED) | ELSEWHERE
    for name in names:
        assert getattr(small_fmu3.library, f"fmi3{name}")


@pytest.mark.parametrize("name", REFUSED)
def test_what_there_is_not_is_refused_by_name(small_fmu3: UnpackedFmu3, name: str) -> None:
    function = getattr(small_fmu3.library, f"fmi3{name}")
    function.argtypes = [c_void_p] * 7
    with friction3_kind(small_fmu3).brought_to("s") as instance:
        assert function(instance.component, *[None] * 6) == ERROR
        assert instance.messages[-1][:2] == (ERROR, "logStatusError")
        assert instance.last_message.startswith(f"fmi3{name}: ") and REFUSED[name] in instance.last_message
        assert instance.step(0.0) == ERROR  # the standard has the instance terminated
        assert instance.call("Reset") == OK and instance.enter_initialisation() == OK
    assert function(*[None] * 7) == ERROR


def test_no_instance_is_an_error_and_no_crash(small_fmu3: UnpackedFmu3) -> None:
    kind = friction3_kind(small_fmu3)
    with kind.brought_to("s") as instance:
        for name in CALLS_3:
            function = getattr(small_fmu3.library, f"fmi3{name}")
            assert function(None, *kind.good_arguments(instance, name)) == ERROR, name
    small_fmu3.library.fmi3FreeInstance(None)


# --- instantiation ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"token": b"{00000000-0000-0000-0000-000000000000}"}, "instantiationToken is not that of this FMU"),
        ({"token": None}, "instantiationToken is not that of this FMU"),
        ({"resources": None}, "resourcePath is NULL or empty"),
        ({"resources": b"/no/such/folder/"}, "model.image: not found in the folder that resourcePath names"),
        ({"event_mode": True}, "eventModeUsed: expected false"),
        ({"intermediate": (c_uint32 * 1)(100), "intermediate_count": 1}, "there are no intermediate values"),
    ],
)
@pytest.mark.parametrize("logging", [True, False])
def test_bad_instantiation_gives_null_and_a_reason(
    small_fmu3: UnpackedFmu3, changes: dict[str, object], expected: str, logging: bool
) -> None:
    with Instance3(small_fmu3, logging=logging, **changes) as instance:
        assert instance.component is None
        assert instance.last_message.startswith("fmi3InstantiateCoSimulation: ") and expected in instance.last_message


def test_other_kinds_give_null_and_a_reason(small_fmu3: UnpackedFmu3) -> None:
    messages = []
    logger = LOGGER(lambda _e, status, _c, text: messages.append((status, text.decode())))
    common = (b"finger", small_fmu3.token.encode(), small_fmu3.resources, False, False, None)
    assert small_fmu3.library.fmi3InstantiateModelExchange(*common, logger) is None
    assert small_fmu3.library.fmi3InstantiateScheduledExecution(*common, logger, None, None, None) is None
    assert [status for status, _ in messages] == [ERROR, ERROR]
    assert "not for model exchange" in messages[0][1] and "not for scheduled execution" in messages[1][1]


def test_a_path_is_not_decoded_and_needs_no_separator(small_fmu3: UnpackedFmu3, tmp_path: Path) -> None:
    folder = tmp_path / "a%20b ü"
    folder.mkdir()
    (folder / "model.image").write_bytes((small_fmu3.folder / "resources" / "model.image").read_bytes())
    for location in (bytes(folder), bytes(folder) + b"/"):
        with Instance3(small_fmu3, resources=location) as instance:
            assert instance.component, instance.messages


def test_without_logger_and_name(small_fmu3: UnpackedFmu3) -> None:
    with Instance3(small_fmu3, logger=LOGGER(), name=None) as instance:
        assert instance.component and instance.step(0.0) == ERROR  # would log
    assert small_fmu3.library.fmi3GetVersion() == b"3.0"


# --- variables --------------------------------------------------------------------------------------------------------


def test_start_values_are_those_of_the_xml_in_every_state(small_fmu3: UnpackedFmu3) -> None:
    names = [name for name, v in small_fmu3.variables.items() if v.start is not None and v.type == "Float64"]
    assert len(names) > 50
    expected = [float(x) for name in names for x in (small_fmu3.variables[name].start or "").split()]
    with Instance3(small_fmu3) as instance:
        for _ in range(2):
            assert list(instance.get(names)) == expected
            assert list(instance.get([SOURCE], "Int32")) == [1]
            instance.enter_initialisation()


def test_arrays_are_those_of_the_numbers_of_joints_and_tendons(
    small_fmu3: UnpackedFmu3, small_fmu: UnpackedFmu
) -> None:
    """The same variables as in FMI 2.0, in the same order; parameters of the description keep their paths."""
    names = [name for name, v in small_fmu3.variables.items() if v.causality != "independent"]
    assert small_fmu3.element_names(names) == list(small_fmu.variables)
    for name in names:
        variable = small_fmu3.variables[name]
        first = small_fmu.variables[small_fmu3.element_names([name])[0]]
        assert (variable.vr, variable.causality, variable.variability) == (first.vr, first.causality, first.variability)
    assert [small_fmu3.variables[name].size for name in (FORCE, OUTPUT, "contact", COULOMB)] == [3, 2, None, None]


def test_every_variable_reads_as_its_own_type_only(small_fmu3: UnpackedFmu3) -> None:
    for name, variable in small_fmu3.variables.items():
        for kind in (*TYPES, *OTHER_TYPES):
            with Instance3(small_fmu3) as instance:
                assert instance.enter_initialisation() == OK
                room = (c_double * variable.count)()
                status = instance.call(f"Get{kind}", instance.vrs([name]), 1, room, variable.count)
                assert (status == OK) == (kind == variable.type), instance.messages
                if kind != variable.type:
                    text = f"fmi3Get{kind}: {name} is of type {variable.type}, expected {kind}"
                    assert text in instance.last_message


def test_time_is_the_end_of_the_last_step(small_fmu3: UnpackedFmu3) -> None:
    with Instance3(small_fmu3) as instance:
        assert list(instance.get(["time"])) == [0.0]
        instance.enter_initialisation(start=3.0)
        assert list(instance.get(["time", FORCE])) == [3.0, 0.0, 0.0, 0.0]
        assert instance.call("ExitInitializationMode") == OK
        assert instance.step(3.0, 0.25) == OK
        assert list(instance.get(["time"])) == [3.25] and instance.last_successful_time.value == 3.25
        state = instance.save()
        assert instance.step(3.25, -1.0) == ERROR and instance.last_successful_time.value == 3.25
        assert instance.restore(state) == OK and list(instance.get(["time"])) == [3.25]
        assert instance.set({"time": 1.0}) == ERROR
        assert "fmi3SetFloat64: time: the independent variable is not written" in instance.last_message


def get(instance: Instance3, references: list[int], count: int) -> int:
    return instance.call(
        "GetFloat64", (c_uint32 * len(references))(*references), len(references), (c_double * 9)(), count
    )


def pointer(value: object) -> object:
    return ctypes.byref(value)  # type: ignore[arg-type]


BAD_CALLS: dict[str, tuple[Callable[[Instance3], int], str]] = {
    "NaN element": (
        lambda i: i.set(forces(i.fmu, _2=NAN)),
        "fmi3SetFloat64: tendon_force[2] = nan: expected -1e+12 to 1e+12 N",
    ),
    "second array": (lambda i: i.set({**forces(i.fmu), "joint_position": [0.0, NAN]}), "joint_position[2] = nan"),
    "output written": (lambda i: i.set({OUTPUT: [1.0, 1.0]}), "compensated_torque: an output is not written"),
    "fixed parameter": (
        lambda i: i.set({ARM: 0.01}),
        f"{ARM}: a fixed parameter is written before fmi3ExitInitializationMode only",
    ),
    "fixed setting": (lambda i: i.set({SOURCE: 2}, "Int32"), "kinematics_source: a fixed parameter is written before"),
    "too few numbers": (
        lambda i: get(i, [100, 1000], 4),
        "fmi3GetFloat64: nValues = 4: expected 5, the elements of all variables together",
    ),
    "too many numbers": (lambda i: get(i, [100], 4), "fmi3GetFloat64: nValues = 4: expected 3"),
    "too few to write": (
        lambda i: i.call("SetFloat64", i.vrs([FORCE]), 1, (c_double * 3)(), 2),
        "fmi3SetFloat64: nValues = 2: expected 3",
    ),
    "element of an array": (lambda i: get(i, [101], 1), "fmi3GetFloat64: no variable has the value reference 101"),
    "unknown reference": (lambda i: get(i, [100, 99], 4), "fmi3GetFloat64: no variable has the value reference 99"),
    "wrong type": (lambda i: i.set({FORCE: [1, 1, 1]}, "Int32"), "tendon_force is of type Float64, expected Int32"),
    "a type of no variable": (
        lambda i: i.call("SetFloat32", i.vrs([FORCE]), 1, pointer(c_double()), 3),
        "fmi3SetFloat32: tendon_force is of type Float64, expected Float32",
    ),
    "clock": (
        lambda i: i.call("GetClock", i.vrs(["contact"]), 1, pointer(c_double())),
        "fmi3GetClock: contact is of type Boolean, expected Clock",
    ),
    "NULL values": (lambda i: i.call("SetFloat64", i.vrs([FORCE]), 1, None, 3), "fmi3SetFloat64: values is NULL"),
    "state of no bytes": (
        lambda i: i.call("DeserializeFMUState", b"", 0, pointer(c_void_p())),
        "fmi3DeserializeFMUState: size = 0: expected",
    ),
    "step of no length": (lambda i: i.step(0.0, 0.0), "fmi3DoStep: expected a finite communicationStepSize above 0 s"),
    "seed of another length": (
        lambda i: i.call(
            "GetDirectionalDerivative",
            *(i.vrs([OUTPUT]), 1, i.vrs([FORCE]), 1, (c_double * 3)(), 2, (c_double * 2)(), 2),
        ),
        "fmi3GetDirectionalDerivative: nSeed = 2: expected 3",
    ),
    "sensitivity of another length": (
        lambda i: i.call(
            "GetAdjointDerivative",
            *(i.vrs([OUTPUT]), 1, i.vrs([FORCE]), 1, (c_double * 2)(), 2, (c_double * 3)(), 2),
        ),
        "fmi3GetAdjointDerivative: nSensitivity = 2: expected 3",
    ),
    "seed of NaN": (
        lambda i: i.call(
            "GetAdjointDerivative",
            *(i.vrs([OUTPUT]), 1, i.vrs([FORCE]), 1, (c_double * 2)(1.0, NAN), 2, (c_double * 3)(), 3),
        ),
        "a number of the seed (dvKnown) is not finite",
    ),
    "derivative by an output": (
        lambda i: i.call(
            "GetDirectionalDerivative",
            *(i.vrs([OUTPUT]), 1, i.vrs([OUTPUT]), 1, (c_double * 2)(), 2, (c_double * 2)(), 2),
        ),
        "compensated_torque: not a known: derivatives are by the inputs",
    ),
}


@pytest.mark.parametrize("name", BAD_CALLS)
def test_a_bad_call_is_named_and_changes_nothing(small_fmu3: UnpackedFmu3, name: str) -> None:
    call, expected = BAD_CALLS[name]
    with friction3_kind(small_fmu3).brought_to("s") as instance:
        assert isinstance(instance, Instance3)
        before = instance.save()
        assert call(instance) == ERROR
        assert expected in instance.last_message and instance.messages[-1][:2] == (ERROR, "logStatusError")
        assert instance.save() == before


def test_outputs_have_no_value_before_the_initialisation(small_fmu3: UnpackedFmu3) -> None:
    with Instance3(small_fmu3) as instance:
        assert get(instance, [small_fmu3.variables[OUTPUT].vr], 2) == ERROR
        assert "compensated_torque: an output has no value before the initialisation mode" in instance.last_message


def test_log_categories_and_no_log(small_fmu3: UnpackedFmu3) -> None:
    with Instance3(small_fmu3, logging=False) as instance:
        instance.initialise(motion(small_fmu3, 0.0))
        assert instance.call("Terminate") == OK and instance.messages == []
        names = (ctypes.c_char_p * 2)(b"logEvents", b"no such")
        assert instance.call("SetDebugLogging", True, 2, names) == WARNING
        assert instance.call("Reset") == OK
        assert [category for _, category, _ in instance.messages] == ["logEvents"]
        assert instance.last_message == "fmi3Reset: as after fmi3InstantiateCoSimulation"


def test_errors_are_logged_whatever_is_switched_off(small_fmu3: UnpackedFmu3) -> None:
    """FMI 3.0.3: an error is logged without loggingOn and without its category; all else follows the settings."""
    events, unknown = ((ctypes.c_char_p * 1)(name) for name in (b"logEvents", b"no such"))
    with Instance3(small_fmu3, logging=False) as instance:
        for settings in ((), (True, 1, events), (False, 0, None)):
            assert not settings or instance.call("SetDebugLogging", *settings) == OK
            instance.messages.clear()
            assert instance.call("ExitInitializationMode") == ERROR
            assert [message[:2] for message in instance.messages] == [(ERROR, "logStatusError")]
            assert instance.last_message.startswith("fmi3ExitInitializationMode: not allowed in state ")
        assert instance.call("SetDebugLogging", False, 1, unknown) == WARNING and len(instance.messages) == 1


def test_the_environment_may_be_null(small_fmu3: UnpackedFmu3) -> None:
    calls: list[object] = []
    logger = LOGGER(lambda environment, *more: calls.append((environment, *more[:2])))
    with Instance3(small_fmu3, environment=None, logger=logger) as instance:
        assert instance.step(0.0) == ERROR
        assert calls == [(None, ERROR, b"logStatusError")]


def test_integers_are_32_bits(small_fmu3: UnpackedFmu3) -> None:
    with Instance3(small_fmu3) as instance:
        for value in (0, 4, 2**31 - 1, -(2**31)):
            assert instance.call("SetInt32", instance.vrs([SOURCE]), 1, pointer(c_int32(value)), 1) == ERROR
            assert f"kinematics_source = {value}: expected 1 to 3" in instance.last_message
            assert instance.call("Reset") == OK
