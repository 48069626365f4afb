"""Calls with bad arguments: what is refused is named, and leaves every byte of the state alone. And what is logged."""

from __future__ import annotations

import ctypes
import itertools
import math
import re
import sys
from collections.abc import Callable
from ctypes import c_double, c_uint, c_void_p
from typing import Any

import numpy as np
import pytest

from fmu_binary import ARM, COULOMB, ERROR, LOGGERS, OK, SOURCE, WARNING, Instance, UnpackedFmu, pointer, spelled
from fmu_kinds import OTHER_TYPES, TYPES, Kind, friction_kind, kind_of, kinds, plant_kind
from plant_fmu_rig import play
from plant_rigs import needs_plant

NAN, INF = math.nan, math.inf
FORCE, OUTPUT = "tendon_force[1]", "compensated_torque[1]"
PUSH = "push_force[3]"


# --- instantiation ----------------------------------------------------------------------------------------------------

BAD_INSTANTIATIONS: list[tuple[str, dict[str, Any], str]] = [
    ("23", {"identifier": b"{00000000-0000-0000-0000-000000000000}"}, "instantiationToken is not that of this FMU"),
    ("23", {"identifier": None}, "instantiationToken is not that of this FMU"),
    ("23", {"resources": None}, "resourcePath is NULL or empty"),
    ("23", {"resources": b""}, "resourcePath is NULL or empty"),
    ("2", {"resources": b"file:///no/such/folder"}, "model.image: not found in the folder that resourcePath names"),
    ("3", {"resources": b"/no/such/folder/"}, "model.image: not found in the folder that resourcePath names"),
    ("2", {"resources": b"http://example.org/resources"}, "expected a file URI"),
    ("2", {"type": 0}, "expected fmi2CoSimulation"),
    ("3", {"event_mode": True}, "eventModeUsed: expected false"),
    ("3", {"intermediate": (c_uint * 1)(100), "intermediate_count": 1}, "there are no intermediate values"),
]


def test_bad_instantiation_gives_null_and_a_reason(small: UnpackedFmu) -> None:
    for versions, changes, expected in BAD_INSTANTIATIONS:
        for logging in (True, False):
            if str(small.version) in versions:
                with Instance(small, logging=logging, **changes) as instance:
                    assert instance.component is None
                    status, category, text = instance.messages[-1]
                    assert (status, category) == (ERROR, "logStatusError")
                    assert text.startswith(spelled("fmi3InstantiateCoSimulation: ", small.version))
                    assert spelled(expected, small.version) in text


def test_other_kinds_of_fmi_3_0_give_null_and_a_reason(small_fmu3: UnpackedFmu) -> None:
    messages = []
    logger = LOGGERS[3](lambda _e, status, _c, text: messages.append((status, text.decode())))
    common = b"finger", small_fmu3.identifier, small_fmu3.resources, False, False, None
    assert small_fmu3.function("InstantiateModelExchange")(*common, logger) == 0
    assert small_fmu3.function("InstantiateScheduledExecution")(*common, logger, None, None, None) == 0
    assert [status for status, _ in messages] == [ERROR, ERROR]
    assert "not for model exchange" in messages[0][1] and "not for scheduled execution" in messages[1][1]


def test_instantiation_without_callbacks_logger_name_or_environment(small: UnpackedFmu) -> None:
    changes: list[dict[str, Any]] = [{"logger": False, "name": None}]
    changes += [{"callbacks": None}] if small.version == 2 else [{"environment": None}]
    for change in changes:
        with Instance(small, **change) as instance:
            assert instance.component and instance.step(0.0) == ERROR  # would log
            assert instance.environments == ({None} if "environment" in change else set())
        with Instance(small, identifier=b"wrong", **change) as instance:
            assert instance.component is None


def test_damaged_image_is_refused(small_fmu: UnpackedFmu, tmp_path: Any) -> None:
    image = (small_fmu.folder / "resources" / "model.image").read_bytes()
    flipped = bytearray(image)
    flipped[len(image) // 2] ^= 1
    for bad in (image[:-8], bytes(flipped), b"", b"no image"):
        (tmp_path / "model.image").write_bytes(bad)
        with Instance(small_fmu, resources=tmp_path.as_uri().encode()) as instance:
            assert instance.component is None
            assert "fmi2Instantiate: model.image: " in instance.last_message


@needs_plant
def test_another_rig_or_a_damaged_one_is_refused(plant_fmu: UnpackedFmu, tmp_path: Any) -> None:
    text = (plant_fmu.folder / "resources" / "rig.json").read_bytes()
    for bad, expected in (
        (text.replace(b'"seed": 7', b'"seed": 8'), "fmuGUID is not that of this FMU"),
        (text[:-2], "fmi2Instantiate: rig.json: "),
        (text.replace(b'"settle": 0.3', b'"settle": -3'), "fmi2Instantiate: rig.json: settle"),
        (text.replace(b'"seed": 7', b'"seed": 7000000000'), "rig.json: seed: expected at most 2147483647"),
    ):
        assert bad != text
        (tmp_path / "rig.json").write_bytes(bad)
        refused = Instance(plant_fmu, resources=tmp_path.as_uri().encode())
        assert refused.component is None and expected in refused.last_message


# --- arguments --------------------------------------------------------------------------------------------------------


def get(instance: Instance, references: list[int], count: int) -> int:
    return instance.transfer("Get", "Float64", (c_uint * len(references))(*references), (c_double * 9)(), count)


def derive(instance: Instance, name: str, unknown: str, known: str, seed: list[float], count: int) -> int:
    """Call for a derivative of the variable of an element by another."""
    status: int = instance.derive(name, *(instance.fmu.whole([each]) for each in (unknown, known)), seed, count)[0]
    return status


def first(instance: Instance, name: str) -> Any:
    """Return the value reference of the variable that an element belongs to."""
    return instance.vrs(instance.fmu.whole([name]))


BadCall = tuple[Callable[[Instance], int], str]
BAD_CALLS: dict[str, BadCall] = {
    "output written": (lambda i: i.write({OUTPUT: 1.0}), "compensated_torque.*: an output is not written"),
    "flag written": (lambda i: i.write({"contact": 1}), "fmi3SetBoolean: contact: an output is not written"),
    "parameter below range": (lambda i: i.write({COULOMB: -1.0}), f"{COULOMB} = -1: expected 0 to 1e+09 1"),
    "parameter at open end": (
        lambda i: i.write({"joints[1].friction.stribeck_velocity": 0.0}),
        "joints[1].friction.stribeck_velocity = 0: expected above 0 and at most 1e+09 rad/s",
    ),
    "fixed parameter": (
        lambda i: i.write({ARM: 0.01}),
        f"{ARM}: a fixed parameter is written before fmi3ExitInitializationMode only",
    ),
    "fixed setting": (lambda i: i.write({SOURCE: 2}), "kinematics_source: a fixed parameter is written before"),
    "unknown reference": (lambda i: get(i, [99], 1), "fmi3GetFloat64: no variable has the value reference 99"),
    "unknown reference written": (
        lambda i: i.transfer("Set", "Float64", (c_uint * 1)(-1), pointer(c_double()), 1),
        "fmi3SetFloat64: no variable has the value reference 4294967295",
    ),
    "other type written": (
        lambda i: i.transfer("Set", "Int32", first(i, FORCE), (c_double * 3)(), 3),
        "tendon_force.* is of type Float64, expected Int32",
    ),
    "string written": (
        lambda i: i.transfer("Set", "String", first(i, FORCE), pointer(c_void_p()), 3),
        "fmi3SetString: tendon_force.* is of type Float64, expected String",
    ),
    "no references": (
        lambda i: i.call("GetFloat64", None, 1, (c_double * 1)(), 1),
        "fmi3GetFloat64: valueReferences is NULL",
    ),
    "no values": (lambda i: i.transfer("Set", "Float64", first(i, FORCE), None, 3), "fmi3SetFloat64: values is NULL"),
    "time going back": (lambda i: i.step(0.003), "not before the sample already taken, got point 0.003 s"),
    "step of no length": (lambda i: i.step(0.005, 0.0), "fmi3DoStep: expected a finite communicationStepSize above 0"),
    "state to nowhere": (lambda i: i.call("GetFMUState", None), "fmi3GetFMUState: FMUState is NULL"),
    "no state": (lambda i: i.call("SetFMUState", None), "fmi3SetFMUState: FMUState is NULL"),
    "size of no state": (
        lambda i: i.call("SerializedFMUStateSize", None, pointer(c_void_p())),
        "fmi3SerializedFMUStateSize: FMUState is NULL",
    ),
    "state of no bytes": (
        lambda i: i.call("DeserializeFMUState", b"", 0, pointer(c_void_p())),
        "fmi3DeserializeFMUState: size = 0: expected",
    ),
    "derivative by a parameter": (
        lambda i: derive(i, "Directional", OUTPUT, COULOMB, [1.0], 2),
        f"{COULOMB}: not a known: derivatives are by the inputs",
    ),
    "derivative by an output": (
        lambda i: derive(i, "Directional", OUTPUT, OUTPUT, [1.0, 1.0], 2),
        "compensated_torque.*: not a known",
    ),
    "derivative of an input": (
        lambda i: derive(i, "Directional", FORCE, FORCE, [1.0] * 3, 3),
        "tendon_force.*: not an unknown",
    ),
    "derivative of a discrete output": (
        lambda i: derive(i, "Directional", "compensated_torque_std[1]", FORCE, [1.0] * 3, 2),
        "compensated_torque_std.*: discrete: it has no derivative",
    ),
    "derivative of a flag": (lambda i: derive(i, "Directional", "contact", FORCE, [1.0] * 3, 1), "contact is of type"),
}
BAD_CALLS_3: dict[str, BadCall] = {
    "too few numbers": (
        lambda i: get(i, [100, 1000], 4),
        "fmi3GetFloat64: nValues = 4: expected 5, the elements of all variables together",
    ),
    "too many numbers": (lambda i: get(i, [100], 4), "fmi3GetFloat64: nValues = 4: expected 3"),
    "too few to write": (
        lambda i: i.call("SetFloat64", first(i, FORCE), 1, (c_double * 3)(), 2),
        "fmi3SetFloat64: nValues = 2: expected 3",
    ),
    "element of an array": (lambda i: get(i, [101], 1), "fmi3GetFloat64: no variable has the value reference 101"),
    "seed of another length": (
        lambda i: derive(i, "Directional", OUTPUT, FORCE, [1.0] * 2, 2),
        "fmi3GetDirectionalDerivative: nSeed = 2: expected 3",
    ),
    "sensitivity of another length": (
        lambda i: derive(i, "Adjoint", OUTPUT, FORCE, [1.0] * 2, 2),
        "fmi3GetAdjointDerivative: nSensitivity = 2: expected 3",
    ),
    "seed of NaN": (
        lambda i: derive(i, "Adjoint", OUTPUT, FORCE, [1.0, NAN], 3),
        "a number of the seed (dvKnown) is not finite",
    ),
}
BAD_CALLS_PLANT: dict[str, BadCall] = {
    "truth written": (lambda i: i.write({"truth.friction_level": 1.0}), "truth.friction_level: an output is not"),
    "fixed parameter": (lambda i: i.write({"seed": 3}), "seed: a fixed parameter is written before"),
    "huge step": (lambda i: i.step(0.005, 1e12), "communicationStepSize of at most 1000 s, got point 0.005 s"),
    "time going back": (lambda i: i.step(0.003), "where the last step ended, got point 0.003 s"),
    "gap": (lambda i: i.step(0.006), "where the last step ended, got point 0.006 s and step 0.001 s"),
    "derivative": (
        lambda i: derive(i, "Directional", "truth.external_torque[1]", PUSH, [1.0], 1),
        "providesDirectionalDerivative is false",
    ),
}


@pytest.mark.parametrize(
    ("name", "case"),
    [
        *(pytest.param(*each.values, case) for case in BAD_CALLS for each in kinds(only="friction friction3")),
        *(("friction3", case) for case in BAD_CALLS_3),
        *(pytest.param("plant", case, marks=needs_plant) for case in BAD_CALLS_PLANT),
    ],
)
def test_refused_call_is_named_and_changes_no_byte(name: str, case: str, request: pytest.FixtureRequest) -> None:
    kind = kind_of(name, request)
    call, expected = {"friction": BAD_CALLS, "plant": BAD_CALLS_PLANT}.get(name, BAD_CALLS | BAD_CALLS_3)[case]
    pattern = re.escape(spelled(expected, kind.fmu.version)).replace(re.escape(".*"), r"(\[1\])?")
    with kind.brought_to("s") as instance, kind.brought_to("s") as untouched:
        before, shown = instance.save(), instance.outputs()
        assert call(instance) == ERROR
        assert re.search(pattern, instance.last_message), instance.last_message
        assert instance.messages[-1][:2] == (ERROR, "logStatusError") and instance.environments == {4711}
        assert instance.save() == before
        for one in (instance, untouched):
            assert one.restore(before) == OK
        assert instance.outputs() == shown
        assert kind.advance(instance, 5, 5) == kind.advance(untouched, 5, 5)


@needs_plant
@pytest.mark.parametrize(
    ("name", "value", "expected"),
    [
        ("push_link", 3, "push_link = 3: expected 1 to 2"),
        ("seed", -1, "seed = -1: expected 0 to 2147483647"),
        ("relative_tolerance", 1.0, "relative_tolerance = 1: expected 1e-10 to 0.01 1"),
        ("push_point[2]", NAN, "push_point[2] = nan: expected -10 to 10 m"),
    ],
)
def test_settings_out_of_range(plant_fmu: UnpackedFmu, name: str, value: float, expected: str) -> None:
    with Instance(plant_fmu) as instance:
        before = instance.save()
        assert instance.write({name: value}) == ERROR and expected in instance.last_message
        assert instance.save() == before


def test_the_source_of_kinematics_is_one_of_three(small: UnpackedFmu) -> None:
    with Instance(small) as instance:
        for value in (0, 4, 2**31 - 1, -(2**31)):
            assert instance.write({SOURCE: value}) == ERROR
            assert f"kinematics_source = {value}: expected 1 to 3" in instance.last_message
            assert instance.call("Reset") == OK


def test_every_variable_reads_as_its_own_type_only(small: UnpackedFmu) -> None:
    types = TYPES if small.version == 2 else (*TYPES, *OTHER_TYPES)
    with friction_kind(small).brought_to("m") as instance:
        saved = instance.save()
        for name, variable in small.variables.items():
            for kind in types:
                room = (c_double * (variable.size or 1))()
                arguments = (room, room, len(room)) if kind == "Binary" else (room, len(room))
                if kind == "Clock" or small.version == 2:
                    arguments = (room,)
                status = instance.call(f"Get{kind}", instance.vrs([name]), 1, *arguments)
                assert (status == OK) == (kind == variable.type), instance.messages
                if status != OK:
                    expected = f"fmi3Get{kind}: {name} is of type {variable.type}, expected {kind}"
                    assert spelled(expected, small.version) in instance.last_message
                    assert instance.restore(saved) == OK


def test_outputs_of_fmi_3_0_have_no_value_before_the_initialisation(small_fmu3: UnpackedFmu) -> None:
    with Instance(small_fmu3) as instance:
        assert get(instance, [small_fmu3.variables["compensated_torque"].vr], 2) == ERROR
        assert "compensated_torque: an output has no value before the initialisation mode" in instance.last_message


# --- times and numbers ------------------------------------------------------------------------------------------------

TIMES = (NAN, INF, -INF, -1.0, -0.0, 0.0, 1e-300, -1e12, 1e12, 1e15, 1.1e15, -1.1e15, 1e300, sys.float_info.max)
STEPS = (NAN, INF, -INF, 0.0, -0.0, -1e-3, -1e12, 5e-324, 1e-300, 1e-12, 0.001, 1e12, 1e300, sys.float_info.max)
BAD = (NAN, INF, -INF, sys.float_info.max, -sys.float_info.max)


def test_every_pair_of_time_and_step_is_refused_or_carried_out(kind: Kind) -> None:
    last = 0.005 if kind.fmu.version == 2 and not kind.has_derivatives else 0.004  # step ended there; sample is of then
    with kind.brought_to("s") as instance:
        before = instance.save()
        for time, step in itertools.product((*TIMES, last), STEPS):
            allowed = abs(time) <= 1e15 and math.isfinite(step) and step > 0.0 and time >= last
            if instance.step(time, step) == OK:
                assert allowed and all(map(math.isfinite, instance.outputs())), (time, step)
            else:
                assert instance.save() == before and instance.messages, (time, step)
            assert instance.restore(before) == OK
        assert instance.step(0.005) == OK


@pytest.mark.parametrize("state", "ims")
def test_every_parameter_that_is_no_number_is_refused_by_name(kind: Kind, state: str) -> None:
    whole = [n for n, v in kind.fmu.variables.items() if v.causality == "parameter" and v.type == "Float64"]
    elements = [element for name in whole for element in kind.fmu.elements(name)]
    with kind.brought_to(state) as instance:
        before = instance.save()
        for name, value in itertools.product(elements, BAD):
            assert instance.write({name: value}) == ERROR and name in instance.last_message, (name, value)
            assert instance.save() == before and instance.restore(before) == OK, (name, value)


# --- the simulated finger's solver ------------------------------------------------------------------------------------

TOO_HARD = {PUSH: -1e4}  # N, on a lever of 10 m: beyond the acceleration that counts as a motion
LEVER = {"push_point[1]": 10.0}


@needs_plant
def test_a_solver_failure_leaves_the_finger_where_it_was(plant_fmu: UnpackedFmu) -> None:
    with Instance(plant_fmu) as instance, Instance(plant_fmu) as untouched:
        for each in (instance, untouched):
            assert each.write(LEVER) == OK
            each.initialise()
            play(each, 5)
        before, shown = instance.save(), instance.outputs()
        assert instance.write(TOO_HARD) == OK
        assert instance.step(0.005, 1.0) == ERROR
        assert re.match(r"fmi2DoStep: .* at t = 0\.0.*: (try|check) .*", instance.last_message), instance.last_message
        assert instance.outputs() == shown
        for each in (instance, untouched):
            assert each.restore(before) == OK
        assert play(instance, 50, begin=5) == play(untouched, 50, begin=5)


@needs_plant
def test_an_initialisation_that_fails_can_be_mended(plant_fmu: UnpackedFmu) -> None:
    with Instance(plant_fmu) as instance, Instance(plant_fmu) as plain:
        assert instance.write(LEVER | TOO_HARD) == OK and instance.enter_initialisation() == OK
        assert instance.call("ExitInitializationMode") == ERROR
        assert re.match(r"fmi2ExitInitializationMode: .* at t = -0\.3", instance.last_message), instance.last_message
        assert instance.call("Reset") == OK
        for each in (instance, plain):
            each.initialise()
        assert play(instance, 20) == play(plain, 20)


@needs_plant
def test_the_tolerance_of_an_experiment(plant_fmu: UnpackedFmu) -> None:
    for given, used in ((1e-4, 1e-4), (0.1, 0.01), (1e-12, 1e-10)):  # 0.1 is Maestro's, for all FMUs of a system
        with Instance(plant_fmu) as instance:
            assert instance.enter_initialisation(tolerance=given) == OK
            changed = [text for _, _, text in instance.messages if f"this FMU goes on with {used:g}" in text]
            assert bool(changed) == (given != used)
            assert instance.read(["relative_tolerance"]) == [used]
    for written_first in (True, False):  # a value that was written stands, whatever the order
        with plant_kind(plant_fmu).brought_to("i") as instance:
            for write in (written_first, not written_first):
                experiment = True, 1e-4, 0.0, False, 0.0
                done = (
                    instance.write({"relative_tolerance": 1e-8})
                    if write
                    else instance.call("SetupExperiment", *experiment)
                )
                assert done == OK
            assert instance.call("EnterInitializationMode") == OK
            assert instance.read(["relative_tolerance"]) == [1e-8]
    for bad in (0.0, -1.0, NAN, INF):
        with Instance(plant_fmu) as instance:
            assert instance.enter_initialisation(tolerance=bad) == ERROR
            assert "tolerance = " in instance.last_message and "a finite number above 0" in instance.last_message


# --- logging ----------------------------------------------------------------------------------------------------------


def categories(*names: bytes | None) -> tuple[int, ctypes.Array[ctypes.c_char_p]]:
    return len(names), (ctypes.c_char_p * len(names))(*names)


def test_messages_follow_the_switches(small: UnpackedFmu) -> None:
    """FMI 3.0.3: an error is logged whatever is switched off. FMI 2.0: it follows the settings as all else does."""
    with Instance(small, logging=False) as instance:
        for settings, told in (
            ((), small.version == 3),
            ((True, *categories(b"logEvents")), small.version == 3),
            ((False, 0, None), small.version == 3),
            ((True, 0, None), True),
        ):
            assert not settings or instance.call("SetDebugLogging", *settings) == OK
            instance.messages.clear()
            assert instance.call("ExitInitializationMode") == ERROR
            assert [message[:2] for message in instance.messages] == [(ERROR, "logStatusError")] * told
        assert instance.last_message.startswith(spelled("fmi3ExitInitializationMode: not allowed in", small.version))
        assert instance.call("SetDebugLogging", True, *categories(b"logEvents")) == OK
        instance.messages.clear()
        assert instance.call("Reset") == OK
        assert [message[1] for message in instance.messages] == ["logEvents"]
        assert instance.call("SetDebugLogging", False, *categories(b"logEvents")) == OK
        assert instance.call("Reset") == OK and len(instance.messages) == 1


def test_unknown_category_is_a_warning(small: UnpackedFmu) -> None:
    """The text of FMI 2.0 is a format that importers print by printf: a lone percent sign would read the stack."""
    shown = "%%s%%n%%d" if small.version == 2 else "%s%n%d"
    for name, told in ((b"logEverything", "logEverything"), (b"%s%n%d", shown), (None, "NULL")):
        with Instance(small) as instance:
            assert instance.call("SetDebugLogging", True, *categories(name)) == WARNING
            assert f'no category "{told}"' in instance.last_message
            assert instance.call("SetDebugLogging", True, 1, None) == ERROR


def test_the_hosts_floating_point_stays(kind: Kind) -> None:
    """Subnormal numbers are still there, and rounding is to nearest."""
    with kind.brought_to("s"):
        assert np.float64(5e-324) / 1 > 0 and np.float64(2.3e-308) / 4 > 0
        assert np.float64(1) + np.float64(2) ** -53 == 1 and np.float64(-1) - np.float64(2) ** -53 == -1
