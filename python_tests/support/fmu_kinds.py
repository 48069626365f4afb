"""The three FMUs that this project makes, for tests of what they have in common: life cycle, states, refused calls."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Mapping
from ctypes import c_double, c_int, c_size_t, c_void_p
from dataclasses import dataclass
from typing import Any

import plant_fmu_rig
from fmi3_binary import OTHER_TYPES, TYPES, Instance3
from fmu_binary import ERROR, OK, AnyInstance, Instance, motion

# FMI 2.0.5, section 4.2.4, co-simulation: states in which a call is allowed, without those that need a step in
# progress or a discarded one. i instantiated, m initialization mode, s step complete, t terminated, e error.
CALLS_2 = {
    **dict.fromkeys(("SetDebugLogging", "Reset"), "imste"),
    **dict.fromkeys(("SetupExperiment", "EnterInitializationMode"), "i"),
    "ExitInitializationMode": "m",
    **dict.fromkeys(("Terminate", "DoStep"), "s"),
    **{f"Get{kind}": "mste" for kind in ("Real", "Integer", "Boolean", "String")},
    **{f"Set{kind}": "ims" for kind in ("Real", "Integer", "Boolean", "String")},
    **{f"{way}FMUstate": "imste" for way in ("Get", "Set", "Free", "Serialize", "DeSerialize")},
    "SerializedFMUstateSize": "imste",
    "GetDirectionalDerivative": "mste",
    "CancelStep": "",
    **dict.fromkeys(("GetStatus", "GetRealStatus", "GetBooleanStatus"), "st"),
}
# FMI 3.0, sections 2.3 and 4.2, for co-simulation without Event Mode.
CALLS_3 = {
    **dict.fromkeys(("SetDebugLogging", "Reset"), "imste"),
    "EnterInitializationMode": "i",
    "ExitInitializationMode": "m",
    **dict.fromkeys(("Terminate", "DoStep"), "s"),
    **{f"Get{kind}": "imste" for kind in (*TYPES, *OTHER_TYPES, "Binary", "Clock")},
    **{f"Set{kind}": "ims" for kind in (*TYPES, *OTHER_TYPES, "Binary", "Clock")},
    **{f"{way}FMUState": "imste" for way in ("Get", "Set", "Free", "Serialize", "Deserialize")},
    "SerializedFMUStateSize": "imste",
    **dict.fromkeys(("GetDirectionalDerivative", "GetAdjointDerivative"), "mste"),
}
STEP = 0.001  # s


@dataclass(frozen=True)
class Kind:
    """One of the FMUs."""

    fmu: Any  # unpacked
    make: Callable[..., AnyInstance]
    calls: Mapping[str, str]  # states in which a call is allowed, by the letters of `states`
    states: Mapping[str, str]  # what messages call them
    tuned: Mapping[str, float]  # parameters or inputs to be written before a step
    advance: Callable[[AnyInstance, int, int], list[list[float]]]  # outputs after each of some steps; first, number

    def brought_to(self, state: str) -> AnyInstance:
        """Make an instance in a state; in "e" from where there is a sample, as most errors happen."""
        instance = self.make(self.fmu)
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

    def good_arguments(self, instance: AnyInstance, name: str) -> tuple[Any, ...]:
        """Return arguments with which a call succeeds where it is allowed."""
        by_version = _arguments_2 if instance.version == 2 else _arguments_3
        return by_version(instance, name)


def _advance_friction(instance: AnyInstance, first: int, steps: int) -> list[list[float]]:
    rows = []
    for k in range(first, first + steps):
        assert instance.write(motion(instance.fmu, STEP * k)) == OK, instance.last_message
        assert instance.step(STEP * k, STEP) == OK, instance.last_message
        rows.append(instance.outputs())
    return rows


def _advance_plant(instance: AnyInstance, first: int, steps: int) -> list[list[float]]:
    assert isinstance(instance, Instance)
    return plant_fmu_rig.play(instance, steps, begin=first)


def _saved(instance: AnyInstance, name: str) -> tuple[c_void_p, c_size_t, Any]:
    """Return a state, its size and its bytes, for the calls that take them."""
    word = "FMUstate" if instance.version == 2 else "FMUState"
    state, size = c_void_p(), c_size_t()
    if word in name:
        assert instance.call(f"Get{word}", ctypes.byref(state)) == OK
        assert instance.call(f"Serialized{word}Size", state, ctypes.byref(size)) == OK
    data = (ctypes.c_char * size.value)()
    if name.lower().startswith("deserialize"):
        assert instance.call(f"Serialize{word}", state, data, size.value) == OK
    return state, size, data


def _state_arguments(instance: AnyInstance, name: str) -> dict[str, tuple[Any, ...]]:
    state, size, data = _saved(instance, name)
    found: dict[str, tuple[Any, ...]] = {
        "GetFMUState": (ctypes.byref(c_void_p()),),
        "SetFMUState": (state,),
        "FreeFMUState": (ctypes.byref(state),),
        "SerializedFMUStateSize": (state, ctypes.byref(size)),
        "SerializeFMUState": (state, data, size.value),
        "DeserializeFMUState": (data, size.value, ctypes.byref(c_void_p())),
    }
    return {key.lower(): arguments for key, arguments in found.items()}


def _arguments_2(instance: AnyInstance, name: str) -> tuple[Any, ...]:
    if name[3:] in ("Real", "Integer", "Boolean", "String"):
        return (None, 0, None)
    if name == "GetDirectionalDerivative":
        unknown, known = instance.vrs(["compensated_torque[1]"]), instance.vrs(["tendon_force[1]"])
        return (unknown, 1, known, 1, ctypes.byref(c_double(1.0)), ctypes.byref(c_double()))
    others: dict[str, tuple[Any, ...]] = {
        "SetDebugLogging": (1, 0, None),
        "SetupExperiment": (0, 0.0, 0.0, 0, 0.0),
        "DoStep": (5 * STEP, STEP, 1),
        "GetStatus": (0, ctypes.byref(c_int())),
        "GetRealStatus": (2, ctypes.byref(c_double())),
        "GetBooleanStatus": (3, ctypes.byref(c_int())),
    }
    return others.get(name) or _state_arguments(instance, name).get(name.lower(), ())


def _arguments_3(instance: AnyInstance, name: str) -> tuple[Any, ...]:
    if name[3:] == "Clock":
        return (None, 0, None)
    if name[3:] == "Binary":
        return (None, 0, None, None, 0)
    if name[3:] in (*TYPES, *OTHER_TYPES):
        return (None, 0, None, 0)
    joints, tendons = (instance.fmu.variables[of].count for of in ("compensated_torque", "tendon_force"))
    of_outputs, of_inputs = (c_double * joints)(), (c_double * tendons)()
    references = instance.vrs(["compensated_torque"]), 1, instance.vrs(["tendon_force"]), 1
    others: dict[str, tuple[Any, ...]] = {
        "SetDebugLogging": (True, 0, None),
        "EnterInitializationMode": (False, 0.0, 0.0, False, 0.0),
        "DoStep": (5 * STEP, STEP, True, None, None, None, None),
        "GetDirectionalDerivative": (*references, of_inputs, tendons, of_outputs, joints),
        "GetAdjointDerivative": (*references, of_outputs, joints, of_inputs, tendons),
    }
    return others.get(name) or _state_arguments(instance, name).get(name.lower(), ())


_STATES_2 = {"i": "instantiated", "m": "initializationMode", "s": "stepComplete", "t": "terminated", "e": "error"}
_STATES_3 = {
    **{"i": "Instantiated", "m": "Initialization Mode", "s": "Step Mode"},
    **{"t": "Terminated", "e": "Terminated after an error"},
}
_FRICTION = {"tendons[1].edge_friction[1].static": 0.9, "tendons[1].edge_friction[1].coulomb": 0.8}


def friction_kind(fmu: Any) -> Kind:
    return Kind(fmu, Instance, CALLS_2, _STATES_2, _FRICTION, _advance_friction)


def friction3_kind(fmu: Any) -> Kind:
    return Kind(fmu, Instance3, CALLS_3, _STATES_3, _FRICTION, _advance_friction)


def plant_kind(fmu: Any) -> Kind:
    """It has no derivatives."""
    calls = {name: states for name, states in CALLS_2.items() if name != "GetDirectionalDerivative"}
    return Kind(fmu, Instance, calls, _STATES_2, {"push_force[3]": 0.3, "pretension": 1.0}, _advance_plant)


MAKERS = {
    "friction": ("small_fmu", friction_kind),
    "friction3": ("small_fmu3", friction3_kind),
    "plant": ("plant_fmu", plant_kind),
}
CALLS = {"friction": CALLS_2, "friction3": CALLS_3, "plant": plant_kind(None).calls}
