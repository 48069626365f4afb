"""Calls of the FMU with good and bad arguments: what is refused is named, and leaves every byte of the state alone."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable
from ctypes import c_double, c_int, c_void_p

import numpy as np
import pytest

from fmu_binary import ARM, COULOMB, DISCARD, ERROR, OK, STATIC, WARNING, Instance, UnpackedFmu, motion

SOURCE = "kinematics_source"
FORCE = "tendon_force[1]"
OUTPUT = "compensated_torque[1]"
NAN, INF = math.nan, math.inf


def running(fmu: UnpackedFmu, steps: int = 5) -> Instance:
    instance = Instance(fmu)
    instance.initialise(motion(fmu, 0.0))
    for k in range(1, steps):
        assert instance.set_real(motion(fmu, 0.001 * k)) == OK
        assert instance.step(0.001 * k) == OK
    return instance


# --- what the variables are -------------------------------------------------------------------------------------------


def test_start_values_are_those_of_the_xml(small_fmu: UnpackedFmu) -> None:
    with Instance(small_fmu) as instance:
        assert instance.setup() == OK and instance.call("EnterInitializationMode") == OK
        names = [n for n, v in small_fmu.variables.items() if v.start is not None and v.type == "Real"]
        assert len(names) > 50
        assert list(instance.get_real(names)) == [float(small_fmu.variables[n].start or "") for n in names]
        assert instance.get_integers([SOURCE]) == [1]


def test_versions(small_fmu: UnpackedFmu) -> None:
    assert small_fmu.library.fmi2GetVersion() == b"2.0"
    assert small_fmu.library.fmi2GetTypesPlatform() == b"default"


# --- instantiation ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"guid": b"{00000000-0000-0000-0000-000000000000}"}, "fmuGUID is not that of this FMU"),
        ({"guid": None}, "fmuGUID is not that of this FMU"),
        ({"type": 0}, "expected fmi2CoSimulation"),
        ({"location": None}, "fmuResourceLocation is NULL"),
        ({"location": b""}, "fmuResourceLocation is NULL or empty"),
        ({"location": b"file:///no/such/folder"}, "model.image: not found"),
        ({"location": b"http://example.org/resources"}, "expected a file URI"),
    ],
)
@pytest.mark.parametrize("logging", [True, False])
def test_bad_instantiation_gives_null_and_a_reason(
    small_fmu: UnpackedFmu, changes: dict[str, bytes | None], expected: str, logging: bool
) -> None:
    with Instance(small_fmu, logging=logging, **changes) as instance:
        assert instance.component is None
        assert expected in instance.last_message and instance.messages[-1][1] == "logStatusError"


def test_instantiation_without_callbacks_or_logger(small_fmu: UnpackedFmu) -> None:
    for arguments in ({"callbacks": None}, {"logger": False}, {"name": None, "logger": False}):
        for guid in (small_fmu.guid.encode(), b"wrong"):
            with Instance(small_fmu, **arguments, guid=guid) as instance:
                assert (instance.component is not None) == (guid != b"wrong")
                if instance.component:
                    assert instance.step(0.0) == ERROR  # would log


@pytest.mark.parametrize("damage", ["cut", "flipped", "empty", "text"])
def test_damaged_image_is_refused(small_fmu: UnpackedFmu, tmp_path, damage: str) -> None:  # type: ignore[no-untyped-def]
    image = (small_fmu.folder / "resources" / "model.image").read_bytes()
    flipped = bytearray(image)
    flipped[len(image) // 2] ^= 1
    bytes_of = {"cut": image[:-8], "flipped": bytes(flipped), "empty": b"", "text": b"no image"}
    (tmp_path / "model.image").write_bytes(bytes_of[damage])
    with Instance(small_fmu, location=tmp_path.as_uri().encode()) as instance:
        assert instance.component is None
        assert "fmi2Instantiate: model.image: " in instance.last_message


# --- refused arguments ------------------------------------------------------------------------------------------------


def pointer(value: object) -> object:
    return ctypes.byref(value)  # type: ignore[arg-type]


# Numbers and times that cannot be: test_fmu_refusals.py.
BAD_CALLS: dict[str, tuple[Callable[[Instance], int], str]] = {
    "second of two inputs": (lambda i: i.set_real({FORCE: 1.0, "tendon_force[2]": NAN}), "tendon_force[2] = nan"),
    "output written": (lambda i: i.set_real({OUTPUT: 1.0}), "compensated_torque[1]: an output is not written"),
    "parameter below range": (lambda i: i.set_real({COULOMB: -1.0}), f"{COULOMB} = -1: expected 0 to 1e+09 1"),
    "parameter at open end": (
        lambda i: i.set_real({"joints[1].friction.stribeck_velocity": 0.0}),
        "joints[1].friction.stribeck_velocity = 0: expected above 0 and at most 1e+09 rad/s",
    ),
    "fixed parameter": (lambda i: i.set_real({ARM: 0.01}), f"{ARM}: a fixed parameter is written before"),
    "fixed integer": (lambda i: i.set_integer(SOURCE, 2), "kinematics_source: a fixed parameter is written before"),
    "unknown reference read": (
        lambda i: i.call("GetReal", pointer(c_int(99)), 1, pointer(c_double())),
        "fmi2GetReal: no variable has the value reference 99",
    ),
    "unknown reference written": (
        lambda i: i.call("SetReal", pointer(c_int(-1)), 1, pointer(c_double())),
        "fmi2SetReal: no variable has the value reference 4294967295",
    ),
    "wrong type written": (lambda i: i.set_integer(FORCE, 1), "tendon_force[1] is of type Real, expected Integer"),
    "Boolean output written": (
        lambda i: i.call("SetBoolean", i.vrs(["contact"]), 1, pointer(c_int(1))),
        "fmi2SetBoolean: contact: an output is not written",
    ),
    "string written": (
        lambda i: i.call("SetString", i.vrs([FORCE]), 1, pointer(c_void_p())),
        "fmi2SetString: tendon_force[1] is of type Real, expected String",
    ),
    "NULL references": (lambda i: i.call("GetReal", None, 1, pointer(c_double())), "fmi2GetReal: vr is NULL"),
    "NULL values": (lambda i: i.call("SetReal", i.vrs([FORCE]), 1, None), "fmi2SetReal: value is NULL"),
    "time going back": (lambda i: i.step(0.003), "not before the sample already taken, got point 0.003 s"),
    "input derivatives": (
        lambda i: i.call("SetRealInputDerivatives", i.vrs([FORCE]), 1, pointer(c_int(1)), pointer(c_double())),
        "canInterpolateInputs is false",
    ),
    "output derivatives": (
        lambda i: i.call("GetRealOutputDerivatives", i.vrs([OUTPUT]), 1, pointer(c_int(1)), pointer(c_double())),
        "maxOutputDerivativeOrder is 0",
    ),
    "cancelled step": (lambda i: i.call("CancelStep"), "fmi2CancelStep: not allowed in state stepComplete"),
    "state to nowhere": (lambda i: i.call("GetFMUstate", None), "fmi2GetFMUstate: FMUstate is NULL"),
    "no state": (lambda i: i.call("SetFMUstate", None), "fmi2SetFMUstate: FMUstate is NULL"),
    "size of no state": (
        lambda i: i.call("SerializedFMUstateSize", None, pointer(ctypes.c_size_t())),
        "fmi2SerializedFMUstateSize: FMUstate is NULL",
    ),
    "model exchange": (lambda i: i.library.fmi2EnterEventMode(c_void_p(i.component)), "belongs to model exchange"),
}


@pytest.mark.parametrize("case", BAD_CALLS)
def test_refused_call_is_named_and_changes_no_byte(small_fmu: UnpackedFmu, case: str) -> None:
    call, expected = BAD_CALLS[case]
    with running(small_fmu) as instance:
        before = instance.save()
        assert call(instance) == ERROR
        assert expected in instance.last_message
        status, category, _, environment, name = instance.messages[-1]
        assert (status, category, environment, name) == (ERROR, "logStatusError", 4711, "finger")
        assert instance.save() == before
        assert instance.restore(before) == OK and instance.step(0.005) == OK


@pytest.mark.parametrize("null", ["FreeFMUstate", "Reset", "Terminate", "CancelStep"])
def test_no_instance(small_fmu: UnpackedFmu, null: str) -> None:
    arguments = [None] * len(getattr(small_fmu.library, "fmi2" + null).argtypes)
    assert getattr(small_fmu.library, "fmi2" + null)(*arguments) == ERROR
    small_fmu.library.fmi2FreeInstance(None)


def test_nothing_asked_is_nothing_wrong(small_fmu: UnpackedFmu) -> None:
    with running(small_fmu) as instance:
        for kind in ("Real", "Integer", "Boolean", "String"):
            assert instance.call("Get" + kind, None, 0, None) == OK
            assert instance.call("Set" + kind, None, 0, None) == OK


@pytest.mark.parametrize(
    ("start", "stop", "expected"),
    [(NAN, None, "startTime = nan"), (INF, None, "startTime = inf"), (1.0, 0.5, "stopTime = 0.5"), (0.0, NAN, "nan")],
)
def test_bad_experiment(small_fmu: UnpackedFmu, start: float, stop: float | None, expected: str) -> None:
    with Instance(small_fmu) as instance:
        assert instance.setup(start, stop) == ERROR and expected in instance.last_message


# --- parameters that hang together ------------------------------------------------------------------------------------


def test_related_parameters_may_be_written_one_by_one_in_any_order(small_fmu: UnpackedFmu) -> None:
    for first, second in ((STATIC, COULOMB), (COULOMB, STATIC)):
        values = {STATIC: 0.002, COULOMB: 0.001} if first == COULOMB else {STATIC: 0.2, COULOMB: 0.1}
        with running(small_fmu) as instance:
            for name in (second, first):  # coulomb above static in between, or static below coulomb
                assert instance.set_real({name: values[name]}) == OK
            assert instance.step(0.006) == OK, instance.last_message
            assert list(instance.get_real([STATIC, COULOMB])) == [values[STATIC], values[COULOMB]]


def test_impossible_parameters_refuse_the_step_and_change_nothing(small_fmu: UnpackedFmu) -> None:
    with running(small_fmu) as instance:
        good = instance.save()
        assert instance.set_real({COULOMB: 0.5}) == OK
        before = instance.save()
        assert instance.step(0.006) == ERROR
        assert f"fmi2DoStep: {STATIC} = 0.03: expected at least coulomb = 0.5" in instance.last_message
        assert instance.save() == before
        assert instance.restore(good) == OK
        assert instance.step(0.006) == OK
    with Instance(small_fmu) as instance:
        assert instance.set_real({COULOMB: 0.5}) == OK and instance.setup() == OK
        assert instance.call("EnterInitializationMode") == OK
        before = instance.save()
        assert instance.call("ExitInitializationMode") == ERROR and "at least coulomb" in instance.last_message
        assert instance.save() == before


def test_parameters_take_effect_with_the_next_sample(small_fmu: UnpackedFmu) -> None:
    with running(small_fmu) as tuned, running(small_fmu) as plain:
        shown = tuned.outputs()
        changed = {"contact.threshold[1]": 0.0, "contact.threshold_per_force[1]": 0.0}
        assert tuned.set_real(changed) == OK
        assert tuned.outputs() == shown
        for instance in (tuned, plain):
            assert instance.set_real(motion(small_fmu, 0.01)) == OK and instance.step(0.01) == OK
        assert tuned.outputs() != plain.outputs()
        assert tuned.get_integers(["joint_contact[1]"], "Boolean") == [1]


def test_a_step_at_the_same_time_leaves_parameters_to_the_next_sample(small_fmu: UnpackedFmu) -> None:
    """The derivatives too stay those of the sample taken."""
    viscous = "joints[1].friction.viscous"
    with Instance(small_fmu) as instance:
        assert instance.set_integer(SOURCE, 3) == OK
        instance.initialise({**motion(small_fmu, 0.0), "joint_velocity[1]": 1.0})
        assert instance.set_real({**motion(small_fmu, 0.005), "joint_velocity[1]": 1.0}) == OK
        assert instance.step(0.005) == OK

        def slope() -> float:
            return float(derivative(instance, ["friction_torque[1]"], {"joint_velocity[1]": 1.0})[0])

        before = slope()
        assert instance.set_real({viscous: 5.0}) == OK
        assert instance.step(0.005) == OK and slope() == before
        assert instance.step(0.006) == OK and slope() != before


def test_fixed_parameters_can_be_written_before_the_first_sample(small_fmu: UnpackedFmu) -> None:
    with Instance(small_fmu) as instance:
        assert instance.set_real({ARM: 0.02}) == OK and instance.set_integer(SOURCE, 2) == OK
        assert instance.setup() == OK and instance.call("EnterInitializationMode") == OK
        forces = {"tendon_force[1]": 10.0, "joint_position[1]": 0.25}
        assert instance.set_real(forces) == OK and instance.set_integer(SOURCE, 3) == OK
        assert instance.call("ExitInitializationMode") == OK
        assert instance.get_real(["joint_torque[1]"]) == [pytest.approx(0.2, rel=1e-15)]
        assert instance.get_real(["joint_angle[1]"]) == [0.25]
        assert instance.get_integers([SOURCE]) == [3]


# --- derivatives ------------------------------------------------------------------------------------------------------


def derivative(instance: Instance, unknowns: list[str], direction: dict[str, float]) -> np.ndarray:
    knowns, seeds = list(direction), (c_double * len(direction))(*direction.values())
    result = (c_double * len(unknowns))()
    u, k = instance.vrs(unknowns), instance.vrs(knowns)
    assert instance.call("GetDirectionalDerivative", u, len(unknowns), k, len(knowns), seeds, result) == OK
    return np.array(result)


def test_derivatives_in_initialisation_mode(small_fmu: UnpackedFmu) -> None:
    with Instance(small_fmu) as instance:
        assert instance.setup() == OK and instance.call("EnterInitializationMode") == OK
        assert derivative(instance, ["joint_torque[1]"], {FORCE: 1.0}) == [0.009]
        assert derivative(instance, ["joint_torque[2]"], {FORCE: 2.0}) == [0.014]


@pytest.mark.parametrize(
    ("unknown", "known", "expected"),
    [
        (OUTPUT, STATIC, f"{STATIC}: not a known"),
        (OUTPUT, OUTPUT, f"{OUTPUT}: not a known"),
        (FORCE, FORCE, f"{FORCE}: not an unknown"),
        ("compensated_torque_std[1]", FORCE, "compensated_torque_std[1]: discrete: it has no derivative"),
        ("contact", FORCE, "contact is of type Boolean"),
    ],
)
def test_derivatives_that_are_not_provided(small_fmu: UnpackedFmu, unknown: str, known: str, expected: str) -> None:
    with running(small_fmu) as instance:
        seed, result = c_double(1.0), c_double()
        arguments = (instance.vrs([unknown]), 1, instance.vrs([known]), 1, pointer(seed), pointer(result))
        assert instance.call("GetDirectionalDerivative", *arguments) == ERROR
        assert expected in instance.last_message


# --- logging and status -----------------------------------------------------------------------------------------------


def test_logging_off_says_nothing(small_fmu: UnpackedFmu) -> None:
    with Instance(small_fmu, logging=False) as instance:
        assert instance.step(0.0) == ERROR
        assert instance.messages == []
        assert instance.call("SetDebugLogging", 1, 0, None) == OK
        assert instance.step(0.0) == ERROR
        assert "fmi2DoStep: not allowed in state error" in instance.last_message


def test_categories_are_honoured(small_fmu: UnpackedFmu) -> None:
    with Instance(small_fmu) as instance:
        names = (ctypes.c_char_p * 1)(b"logEvents")
        assert instance.call("SetDebugLogging", 1, 1, names) == OK
        assert instance.step(0.0) == ERROR and instance.messages == []
        assert instance.call("Reset") == OK
        assert [m[1] for m in instance.messages] == ["logEvents"]
        assert instance.call("SetDebugLogging", 0, 1, names) == OK
        assert instance.call("Reset") == OK and len(instance.messages) == 1


def test_unknown_category_is_a_warning(small_fmu: UnpackedFmu) -> None:
    with Instance(small_fmu) as instance:
        names = (ctypes.c_char_p * 2)(b"logEverything", None)
        assert instance.call("SetDebugLogging", 1, 2, names) == WARNING
        assert 'no category "logEverything"' in instance.messages[0][2]
        assert instance.call("SetDebugLogging", 1, 1, None) == ERROR


def test_percent_signs_in_names_do_not_format(small_fmu: UnpackedFmu) -> None:
    """The logger's text is a format: importers print it through printf. A lone percent sign would read the stack."""
    with Instance(small_fmu) as instance:
        names = (ctypes.c_char_p * 1)(b"%s%n%d")
        assert instance.call("SetDebugLogging", 1, 1, names) == WARNING
        assert "%%s%%n%%d" in instance.last_message


def test_status_inquiries(small_fmu: UnpackedFmu) -> None:
    with running(small_fmu) as instance:
        assert instance.step(0.0045, 1 / 60) == OK
        time, flag = c_double(), c_int(-1)
        assert instance.call("GetRealStatus", 2, pointer(time)) == OK and time.value == 0.0045 + 1 / 60
        assert instance.call("GetBooleanStatus", 3, pointer(flag)) == OK and flag.value == 0
        assert instance.call("GetStatus", 0, pointer(flag)) == OK and flag.value == OK
        for name, kind in (("Status", 1), ("RealStatus", 0), ("IntegerStatus", 0), ("StringStatus", 1)):
            assert instance.call("Get" + name, kind, pointer(ctypes.c_int64())) == DISCARD
        assert instance.step(0.006) == OK  # an inquiry without an answer is no error
        assert instance.call("GetRealStatus", 2, None) == ERROR
