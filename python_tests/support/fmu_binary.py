"""The library of an FMU driven by hand, in FMI 2.0 and 3.0: every function with any arguments, and all that it logs.

fmpy raises on an error and refuses impossible arguments; the tests of calls want both to reach the binary. Whatever the
version, functions and types have their names of FMI 3.0, and variables those of FMI 2.0 (`tendon_force[1]`).
"""

from __future__ import annotations

import ctypes
import platform
import struct
import sys
import zipfile
from collections.abc import Mapping, Sequence
from ctypes import c_bool, c_char, c_char_p, c_double, c_int, c_int32, c_int64, c_size_t, c_uint, c_void_p
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree

import numpy as np

if TYPE_CHECKING:
    from typing_extensions import Self

OK, WARNING, DISCARD, ERROR = 0, 1, 2, 3

LAW = {"static": 0.03, "coulomb": 0.02, "stribeck_velocity": 0.005, "viscous": 0.3}
# Small, with something of everything: two joints, an asymmetric law, working points, a cable loop, a pulley.
FINGER: dict[str, Any] = {
    "format": "tendonfmu-finger-1",
    "name": "small_finger",
    "joints": [
        {"name": "first", "friction": {"static": 0.008, "coulomb": 0.006, "stribeck_velocity": 0.1, "viscous": 0.001}},
        {"name": "second", "cover": {"stiffness": 0.02, "rest_angle": 0.1}},
    ],
    "tendons": [
        {
            "name": "flexor",
            "stiffness": 4000.0,
            "moment_arms": [0.009, 0.007],
            "pulley_friction": [LAW, None],
            "edge_friction": [LAW, {"angles": [-0.5, 0.5], "laws": [LAW, {"positive": LAW, "negative": LAW}]}],
        },
        {"name": "extensor", "stiffness": 5000.0, "moment_arms": [-0.008, -0.006], "edge_friction": [LAW]},
        {"name": "loop", "stiffness": 6000.0, "moment_arms": [0.005, -0.004], "bidirectional": True},
    ],
    "contact": {"threshold": [0.03, 0.02], "threshold_per_force": [0.001, 0.001]},
}
STATIC = "tendons[1].edge_friction[1].static"
COULOMB = "tendons[1].edge_friction[1].coulomb"
ARM = "tendons[1].moment_arms[1]"
SOURCE = "kinematics_source"

# What FMI 2.0 calls otherwise: functions, types, arguments, states. In messages, too.
WORDS_2 = {
    "fmi3InstantiateCoSimulation": "fmi2Instantiate",
    "fmi3": "fmi2",
    "Float64": "Real",
    "Int32": "Integer",
    "Deserialize": "DeSerialize",
    "FMUState": "FMUstate",
    "instantiationToken": "fmuGUID",
    "resourcePath": "fmuResourceLocation",
    "valueReferences": "vr",
    "values": "value",
    "Instantiated": "instantiated",
    "Initialization Mode": "initializationMode",
    "Step Mode": "stepComplete",
    "Terminated after an error": "error",
    "Terminated": "terminated",
}
C_TYPES = {
    2: {"Float64": c_double, "Int32": c_int32, "Boolean": c_int32},
    3: {"Float64": c_double, "Int32": c_int32, "Boolean": c_bool},
}
LOGGERS = {
    2: ctypes.CFUNCTYPE(None, c_void_p, c_char_p, c_int, c_char_p, c_char_p),
    3: ctypes.CFUNCTYPE(None, c_void_p, c_int, c_char_p, c_char_p),
}


class Callbacks(ctypes.Structure):
    """Those of FMI 2.0."""

    _fields_ = [
        ("logger", LOGGERS[2]),
        ("allocateMemory", c_void_p),
        ("freeMemory", c_void_p),
        ("stepFinished", c_void_p),
        ("componentEnvironment", c_void_p),
    ]


def spelled(text: str, version: int) -> str:
    """Return a name or message of FMI 3.0 as the version has it."""
    for word, other in WORDS_2.items() if version == 2 else ():
        text = text.replace(word, other)
    return text


def pointer(value: Any) -> Any:
    return ctypes.byref(value)


def as_argument(value: Any) -> Any:
    """Return a number as ctypes takes it. 64 bits are right for every narrower integer, in registers and on a stack."""
    if isinstance(value, float):
        return c_double(value)
    return c_int64(value) if isinstance(value, int) else value


@dataclass(frozen=True)
class Variable:
    vr: int
    type: str  # as FMI 3.0 calls it
    causality: str
    variability: str
    start: str | None
    size: int | None = None  # elements of an array of FMI 3.0; None of a scalar


@dataclass
class UnpackedFmu:
    """folder: of the unpacked FMU. mode: how the library is loaded (ctypes.RTLD_LOCAL or RTLD_GLOBAL)."""

    folder: Path
    mode: int = ctypes.DEFAULT_MODE
    version: int = field(init=False)
    identifier: bytes = field(init=False)  # GUID or instantiation token
    library: ctypes.CDLL = field(init=False)
    variables: dict[str, Variable] = field(init=False, default_factory=dict)

    def __post_init__(self) -> None:
        root = ElementTree.parse(self.folder / "modelDescription.xml").getroot()
        self.version = int(root.attrib["fmiVersion"][0])
        self.identifier = (root.get("guid") or root.attrib["instantiationToken"]).encode()
        types = {spelled(name, self.version): name for name in C_TYPES[self.version]}
        for variable in root.find("ModelVariables") or ():
            a = variable.attrib
            typed = variable[0] if self.version == 2 else variable
            dimension = variable.find("Dimension")
            self.variables[a["name"]] = Variable(
                int(a["valueReference"]),
                types[typed.tag],
                a["causality"],
                a["variability"],
                typed.get("start"),
                None if dimension is None else int(dimension.attrib["start"]),
            )
        self.binary = next((self.folder / "binaries" / fmi_platform(self.version)).iterdir())
        self.library = ctypes.CDLL(str(self.binary), mode=self.mode)
        self.function("InstantiateCoSimulation").restype = c_void_p
        self.function("GetVersion").restype = c_char_p

    def function(self, name: str) -> Any:
        return getattr(self.library, spelled(f"fmi3{name}", self.version))

    @property
    def resources(self) -> bytes:
        folder = self.folder / "resources"
        return folder.as_uri().encode() if self.version == 2 else bytes(folder) + b"/"

    def elements(self, name: str) -> list[str]:
        """Return the elements of a variable by their names of FMI 2.0."""
        size = self.variables[name].size
        return [name] if size is None else [f"{name}[{i}]" for i in range(1, size + 1)]

    def names(self, causality: str, kind: str = "Float64") -> list[str]:
        """Return names of FMI 2.0."""
        wanted = causality, kind
        whole = [name for name, v in self.variables.items() if (v.causality, v.type) == wanted]
        return [element for name in whole for element in self.elements(name)]

    def place(self, name: str) -> tuple[str, int]:
        """Return the variable of an element and its index, from 0."""
        if name in self.variables:
            return name, 0
        group, _, index = name.rstrip("]").rpartition("[")
        return group, int(index) - 1

    def whole(self, names: Sequence[str], kind: str | None = None) -> list[str]:
        """Return the variables of elements, each once; of a type, or of all."""
        found = dict.fromkeys(self.place(name)[0] for name in names)
        return [name for name in found if kind in (None, self.variables[name].type)]

    def count(self, names: Sequence[str]) -> int:
        """Return the number of elements of whole variables together."""
        return sum(self.variables[name].size or 1 for name in names)


def fmi_platform(version: int = 2) -> str:
    if version == 2:
        return {"linux": "linux", "darwin": "darwin", "win32": "win"}[sys.platform] + str(8 * struct.calcsize("P"))
    machine = {"amd64": "x86_64", "arm64": "aarch64"}.get(platform.machine().lower(), platform.machine().lower())
    return f"{machine}-" + {"linux": "linux", "darwin": "darwin", "win32": "windows"}[sys.platform]


def unpack(fmu: Path, folder: Path, mode: int = ctypes.DEFAULT_MODE) -> UnpackedFmu:
    with zipfile.ZipFile(fmu) as archive:
        archive.extractall(folder)
    return UnpackedFmu(folder, mode)


class Instance:
    """One instance. Calls return the status; `messages` holds (status, category, text).

    changes: other arguments of the instantiation, by the names below.
    """

    def __init__(self, fmu: UnpackedFmu, *, logging: bool = True, logger: bool = True, **changes: Any) -> None:
        self.fmu, self.version = fmu, fmu.version
        self.messages: list[tuple[int, str, str]] = []
        self.environments: set[int | None] = set()  # that the logger was called with

        def log2(environment: int | None, name: bytes, status: int, category: bytes, text: bytes) -> None:
            assert name == b"finger"
            log3(environment, status, category, text)

        def log3(environment: int | None, status: int, category: bytes, text: bytes) -> None:
            self.environments.add(environment)
            self.messages.append((status, category.decode(), text.decode()))

        make = LOGGERS[self.version]
        self.logger = make(log2 if self.version == 2 else log3) if logger else make()
        arguments: dict[str, Any] = {"name": b"finger"}
        if self.version == 2:
            self.callbacks = Callbacks(logger=self.logger, componentEnvironment=4711)
            arguments |= {"type": 1, "identifier": fmu.identifier, "resources": fmu.resources}
            arguments |= {"callbacks": pointer(self.callbacks), "visible": False, "logging": logging}
        else:
            arguments |= {"identifier": fmu.identifier, "resources": fmu.resources, "visible": False}
            arguments |= {"logging": logging, "event_mode": False, "early_return": False, "intermediate": None}
            arguments |= {"intermediate_count": 0, "environment": c_void_p(4711), "logger": self.logger, "update": None}
        assert set(changes) <= set(arguments)
        instantiate = fmu.function("InstantiateCoSimulation")
        self.component: int | None = instantiate(*map(as_argument, (arguments | changes).values()))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.fmu.function("FreeInstance")(c_void_p(self.component))
        self.component = None

    def call(self, name: str, *arguments: Any) -> int:
        status: int = self.fmu.function(name)(c_void_p(self.component), *map(as_argument, arguments))
        return status

    def function_of_nobody(self, name: str, *arguments: Any) -> int:
        """Call a function with the arguments of this instance, but NULL for the instance."""
        status: int = self.fmu.function(name)(c_void_p(), *map(as_argument, arguments))
        return status

    @property
    def last_message(self) -> str:
        return self.messages[-1][2]

    # --- variables

    def vrs(self, names: Sequence[str]) -> ctypes.Array[c_uint]:
        """Return value references of whole variables."""
        return (c_uint * len(names))(*(self.fmu.variables[name].vr for name in names))

    def transfer(self, way: str, kind: str, references: Any, values: Any, count: int) -> int:
        """Get or set values of a type; count: the elements together, which FMI 3.0 is told."""
        sizes = (count,) if self.version == 3 else ()
        return self.call(f"{way}{kind}", references, len(references), values, *sizes)

    def get(self, names: Sequence[str], kind: str = "Float64") -> list[float]:
        """Read whole variables: their elements one after another."""
        count = self.fmu.count(names)
        numbers = (C_TYPES[self.version][kind] * count)()
        assert self.transfer("Get", kind, self.vrs(names), numbers, count) == OK, self.last_message
        return list(numbers)

    def set(self, values: Mapping[str, float | Sequence[float]], kind: str = "Float64") -> int:
        """Write whole variables in one call."""
        flat = np.concatenate([np.atleast_1d(value) for value in values.values()]).tolist()
        numbers = (C_TYPES[self.version][kind] * len(flat))(*flat)
        return self.transfer("Set", kind, self.vrs(list(values)), numbers, len(flat))

    def read(self, names: Sequence[str]) -> list[float]:
        """Read elements of any types."""
        found: dict[str, list[float]] = {}
        for kind in C_TYPES[self.version]:
            whole = self.fmu.whole(names, kind)
            numbers = iter(self.get(whole, kind) if whole else ())
            found |= {name: [next(numbers) for _ in range(self.fmu.count([name]))] for name in whole}
        return [found[name][k] for name, k in map(self.fmu.place, names)]

    def write(self, values: Mapping[str, float]) -> int:
        """Write elements, one call for each type; others of their arrays keep their values."""
        for kind in C_TYPES[self.version]:
            whole: dict[str, list[float]] = {}
            for name in self.fmu.whole(list(values), kind):
                elements = self.fmu.elements(name)
                missing = not set(elements) <= set(values)
                whole[name] = self.get([name], kind) if missing else [0.0] * len(elements)
                for k, element in enumerate(elements):
                    whole[name][k] = values.get(element, whole[name][k])
            status = self.set(whole, kind) if whole else OK
            if status != OK:
                return status
        return OK

    def outputs(self) -> list[float]:
        """All outputs that are numbers, then the flags."""
        return self.read([*self.fmu.names("output"), *self.fmu.names("output", "Boolean")])

    def derive(
        self, name: str, unknowns: Sequence[str], knowns: Sequence[str], seed: Sequence[float], count: int
    ) -> Any:
        """Call for a derivative of whole variables, Directional or Adjoint: return the status and `count` numbers."""
        seeds, found = (c_double * len(seed))(*seed), (c_double * count)(*[np.nan] * count)
        numbers = (seeds, len(seed), found, count) if self.version == 3 else (seeds, found)
        lists = self.vrs(unknowns), len(unknowns), self.vrs(knowns), len(knowns)
        return self.call(f"Get{name}Derivative", *lists, *numbers), list(found)

    # --- life

    def enter_initialisation(
        self, start: float = 0.0, stop: float | None = None, tolerance: float | None = None
    ) -> int:
        experiment = tolerance is not None, tolerance or 0.0, start, stop is not None, stop or 0.0
        if self.version == 3:
            return self.call("EnterInitializationMode", *experiment)
        return self.call("SetupExperiment", *experiment) or self.call("EnterInitializationMode")

    def initialise(self, inputs: Mapping[str, float] | None = None, start: float = 0.0) -> None:
        """Through the initialisation mode, with inputs of the first sample."""
        assert self.enter_initialisation(start) == OK, self.last_message
        assert self.write(inputs or {}) == OK, self.last_message
        assert self.call("ExitInitializationMode") == OK, self.last_message

    def step(self, time: float, step: float = 0.001) -> int:
        if self.version == 2:
            return self.call("DoStep", float(time), float(step), True)
        flags, self.reached = (c_bool * 3)(True, True, True), c_double()
        pointers = [ctypes.byref(flags, k) for k in range(3)]
        status = self.call("DoStep", float(time), float(step), True, *pointers, pointer(self.reached))
        assert not any(flags)  # no event, no termination, no early return
        return status

    def save(self) -> bytes:
        """Return the state as bytes."""
        state, size = c_void_p(), c_size_t()
        assert self.call("GetFMUState", pointer(state)) == OK
        assert self.call("SerializedFMUStateSize", state, pointer(size)) == OK
        data = (c_char * size.value)()
        assert self.call("SerializeFMUState", state, data, size.value) == OK
        assert self.call("FreeFMUState", pointer(state)) == OK and state.value is None
        return bytes(data)

    def restore(self, data: bytes) -> int:
        """Take over a state from bytes; return the status of the call that refused, if one did."""
        state = c_void_p()
        status = self.call("DeserializeFMUState", data, len(data), pointer(state))
        if status == OK:
            status = self.call("SetFMUState", state)
        self.call("FreeFMUState", pointer(state))
        return status


def motion(fmu: UnpackedFmu, time: float, seed: int = 0) -> dict[str, float]:
    """Return inputs that move: forces about 5 N, positions of a bending finger, with rests (sliding and sticking)."""
    phase = 0.3 * seed
    swing = float(np.clip(1.5 * np.sin(8.0 * time + phase), -1.0, 1.0))
    inputs = {}
    for k, name in enumerate(fmu.names("input")):
        if name.startswith("tendon_force"):
            inputs[name] = 5.0 + 2.0 * np.sin(3.0 * time + k)
        elif name.startswith("tendon_position"):
            inputs[name] = 0.002 + 0.001 * swing * (1 - 0.3 * k)
        elif name.startswith("joint_position"):
            inputs[name] = 0.4 * swing
        else:
            inputs[name] = 0.4 * 8.0 * np.cos(8.0 * time + phase) * (abs(swing) < 1.0)
    return inputs
