"""The three FMUs that this project makes, for tests of what they have in common: life cycle, states, refused calls."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Mapping
from ctypes import c_double, c_int, c_size_t, c_void_p
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import fmpy
import pytest

import plant_fmu_rig
from fmu_binary import COULOMB, ERROR, OK, STATIC, Instance, UnpackedFmu, motion, pointer
from plant_rigs import needs_plant

STEP = 0.001  # s
TYPES = ("Float64", "Int32", "Boolean", "String")
OTHER_TYPES = ("Float32", "Int8", "UInt8", "Int16", "UInt16", "UInt32", "Int64", "UInt64", "Binary", "Clock")

# States in which a call is allowed: i instantiated, m initialization mode, s between steps, t terminated, e error.
STATES = {"i": "Instantiated", "m": "Initialization Mode", "s": "Step Mode", "t": "Terminated"}
STATES |= {"e": "Terminated after an error"}
OF_BOTH = {
    **dict.fromkeys(("SetDebugLogging", "Reset"), "imste"),
    "EnterInitializationMode": "i",
    "ExitInitializationMode": "m",
    **dict.fromkeys(("Terminate", "DoStep"), "s"),
    **{f"Set{kind}": "ims" for kind in TYPES},
    **{f"{way}FMUState": "imste" for way in ("Get", "Set", "Free", "Serialize", "Deserialize")},
    "SerializedFMUStateSize": "imste",
    "GetDirectionalDerivative": "mste",
}
CALLS = {
    # FMI 2.0.5, section 4.2.4, without the states that need a step in progress or a discarded one
    2: OF_BOTH
    | {f"Get{kind}": "mste" for kind in TYPES}
    | {"SetupExperiment": "i", "CancelStep": ""}
    | dict.fromkeys(("GetStatus", "GetRealStatus", "GetBooleanStatus"), "st"),
    # FMI 3.0, sections 2.3 and 4.2, for co-simulation without Event Mode
    3: OF_BOTH
    | {f"Get{kind}": "imste" for kind in (*TYPES, *OTHER_TYPES)}
    | {f"Set{kind}": "ims" for kind in OTHER_TYPES}
    | {"GetAdjointDerivative": "mste"},
}


@dataclass(frozen=True)
class Kind:
    """One of the FMUs."""

    fmu: UnpackedFmu
    tuned: Mapping[str, float]  # parameters or inputs to be written before a step
    advance: Callable[[Instance, int, int], list[list[float]]]  # outputs after each of some steps; first, number
    setting: str  # an integer that is fixed in the step mode
    has_derivatives: bool = True

    @property
    def calls(self) -> dict[str, str]:
        calls = CALLS[self.fmu.version]
        return {name: states for name, states in calls.items() if self.has_derivatives or "Derivative" not in name}

    def brought_to(self, state: str) -> Instance:
        """Make an instance in a state; in "e" from where there is a sample, as most errors happen."""
        instance = Instance(self.fmu)
        if state == "m":
            assert instance.enter_initialisation() == OK
        elif state in "ste":
            instance.initialise()
            self.advance(instance, 0, 5)
        if state == "t":
            assert instance.call("Terminate") == OK
        if state == "e":
            assert instance.step(-1.0) == ERROR
        return instance


def _advance_friction(instance: Instance, first: int, steps: int) -> list[list[float]]:
    rows = []
    for k in range(first, first + steps):
        assert instance.write(motion(instance.fmu, STEP * k)) == OK, instance.last_message
        assert instance.step(STEP * k, STEP) == OK, instance.last_message
        rows.append(instance.outputs())
    return rows


def _advance_plant(instance: Instance, first: int, steps: int) -> list[list[float]]:
    return plant_fmu_rig.play(instance, steps, begin=first)


def friction_kind(fmu: UnpackedFmu) -> Kind:
    return Kind(fmu, {STATIC: 0.9, COULOMB: 0.8}, _advance_friction, "kinematics_source")


def plant_kind(fmu: UnpackedFmu) -> Kind:
    return Kind(fmu, {"push_force[3]": 0.3, "pretension": 1.0}, _advance_plant, "push_link", has_derivatives=False)


# name of the kind: fixture of its FMU, and what makes the kind of it
MAKERS = {
    "friction": ("small_fmu", friction_kind),
    "friction3": ("small_fmu3", friction_kind),
    "plant": ("plant_fmu", plant_kind),
}


def kinds(*values: Any, only: str = "") -> list[Any]:
    """Return parameters for `kind`: all, or those whose names are in `only`; the simulated finger may be missing."""
    names = only.split() or MAKERS
    return [pytest.param(name, *values, marks=needs_plant if name == "plant" else ()) for name in names]


def kind_of(name: str, request: pytest.FixtureRequest) -> Kind:
    fixture, make = MAKERS[name]
    return make(request.getfixturevalue(fixture))


def declared_dependencies(folder_or_file: Path) -> dict[str, set[str]]:
    """Return the inputs that each output of an FMU depends on; arrays in FMI 3.0."""
    description = fmpy.read_model_description(str(folder_or_file), validate=False)
    return {u.variable.name: {d.name for d in u.dependencies or ()} for u in description.outputs}


# --- calls with good arguments ----------------------------------------------------------------------------------------


def good_arguments(instance: Instance, name: str) -> tuple[Any, ...]:
    """Return arguments with which a call succeeds where it is allowed."""
    if "FMUState" in name:
        return _state_arguments(instance, name)
    if "Derivative" in name:
        return _derivative_arguments(instance, name)
    if name[3:] in (*TYPES, *OTHER_TYPES):
        no_values = {"Clock": (None,), "Binary": (None, None, 0)}.get(name[3:], (None, 0))
        return (None, 0, *(no_values if instance.version == 3 else (None,)))
    arguments: dict[str, tuple[Any, ...]] = {
        "SetDebugLogging": (True, 0, None),
        "SetupExperiment": (False, 0.0, 0.0, False, 0.0),
        "EnterInitializationMode": (False, 0.0, 0.0, False, 0.0) if instance.version == 3 else (),
        "DoStep": (5 * STEP, STEP, True, *([None] * 4 if instance.version == 3 else [])),
        "GetStatus": (0, pointer(c_int())),
        "GetRealStatus": (2, pointer(c_double())),
        "GetBooleanStatus": (3, pointer(c_int())),
    }
    return arguments.get(name, ())


def _state_arguments(instance: Instance, name: str) -> tuple[Any, ...]:
    state, size = c_void_p(), c_size_t()
    assert instance.call("GetFMUState", pointer(state)) == OK
    assert instance.call("SerializedFMUStateSize", state, pointer(size)) == OK
    data = (ctypes.c_char * size.value)()
    assert instance.call("SerializeFMUState", state, data, size.value) == OK
    return {
        "GetFMUState": (pointer(c_void_p()),),
        "SetFMUState": (state,),
        "FreeFMUState": (pointer(state),),
        "SerializedFMUStateSize": (state, pointer(size)),
        "SerializeFMUState": (state, data, size.value),
        "DeserializeFMUState": (data, size.value, pointer(c_void_p())),
    }[name]


def _derivative_arguments(instance: Instance, name: str) -> tuple[Any, ...]:
    """Of all compensated torques by all tendon forces of the small finger."""
    outputs = instance.fmu.whole(["compensated_torque[1]", "compensated_torque[2]"])
    inputs = instance.fmu.whole([f"tendon_force[{i}]" for i in (1, 2, 3)])
    rows, columns = instance.fmu.count(outputs), instance.fmu.count(inputs)
    of_outputs, of_inputs = (c_double * rows)(), (c_double * columns)()
    lists = instance.vrs(outputs), len(outputs), instance.vrs(inputs), len(inputs)
    if instance.version == 2:
        return (*lists, of_inputs, of_outputs)
    if name == "GetAdjointDerivative":
        return (*lists, of_outputs, rows, of_inputs, columns)
    return (*lists, of_inputs, columns, of_outputs, rows)
