"""The FMU's shared library driven by hand: every fmi2 function with any arguments, and all that it logs.

fmpy raises on fmi2Error and refuses arguments that cannot be; the tests of calls want both to reach the binary.
"""

from __future__ import annotations

import abc
import ctypes
import struct
import sys
import zipfile
from collections.abc import Sequence
from ctypes import c_char, c_char_p, c_double, c_int, c_size_t, c_uint, c_void_p
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
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

LOGGER = ctypes.CFUNCTYPE(None, c_void_p, c_char_p, c_int, c_char_p, c_char_p)


class Callbacks(ctypes.Structure):
    _fields_ = [
        ("logger", LOGGER),
        ("allocateMemory", c_void_p),
        ("freeMemory", c_void_p),
        ("stepFinished", c_void_p),
        ("componentEnvironment", c_void_p),
    ]


def _signatures(library: ctypes.CDLL) -> None:
    """Pointers are 64 bits wide: without argument types ctypes would cut them."""
    names = ("Real", "Integer", "Boolean", "String")
    values = {name: [c_void_p, c_void_p, c_size_t, c_void_p] for name in names}
    types: dict[str, list[Any]] = {
        "FreeInstance": [c_void_p],
        "SetDebugLogging": [c_void_p, c_int, c_size_t, c_void_p],
        "SetupExperiment": [c_void_p, c_int, c_double, c_double, c_int, c_double],
        "GetFMUstate": [c_void_p, c_void_p],
        "SetFMUstate": [c_void_p, c_void_p],
        "FreeFMUstate": [c_void_p, c_void_p],
        "SerializedFMUstateSize": [c_void_p, c_void_p, c_void_p],
        "SerializeFMUstate": [c_void_p, c_void_p, c_void_p, c_size_t],
        "DeSerializeFMUstate": [c_void_p, c_void_p, c_size_t, c_void_p],
        "GetDirectionalDerivative": [c_void_p, c_void_p, c_size_t, c_void_p, c_size_t, c_void_p, c_void_p],
        "SetRealInputDerivatives": [c_void_p, c_void_p, c_size_t, c_void_p, c_void_p],
        "GetRealOutputDerivatives": [c_void_p, c_void_p, c_size_t, c_void_p, c_void_p],
        "DoStep": [c_void_p, c_double, c_double, c_int],
        "CancelStep": [c_void_p],
        **{f"Get{name}": arguments for name, arguments in values.items()},
        **{f"Set{name}": arguments for name, arguments in values.items()},
        **{f"Get{kind}Status": [c_void_p, c_int, c_void_p] for kind in ("", "Real", "Integer", "Boolean", "String")},
        **{f: [c_void_p] for f in ("EnterInitializationMode", "ExitInitializationMode", "Terminate", "Reset")},
    }
    for name, arguments in types.items():
        getattr(library, "fmi2" + name).argtypes = arguments
    library.fmi2Instantiate.restype = c_void_p
    library.fmi2Instantiate.argtypes = [c_char_p, c_int, c_char_p, c_char_p, c_void_p, c_int, c_int]
    library.fmi2GetVersion.restype = library.fmi2GetTypesPlatform.restype = c_char_p


@dataclass(frozen=True)
class Variable:
    vr: int
    type: str
    causality: str
    variability: str
    start: str | None
    size: int | None = None  # elements of an array of FMI 3.0; None of a scalar

    @property
    def count(self) -> int:
        return 1 if self.size is None else self.size


@dataclass
class UnpackedFmu:
    """folder: of the unpacked FMU. mode: how the library is loaded (ctypes.RTLD_LOCAL or RTLD_GLOBAL)."""

    folder: Path
    mode: int = ctypes.DEFAULT_MODE
    library: ctypes.CDLL = field(init=False)
    variables: dict[str, Variable] = field(init=False)
    number = "Real"  # the type of numbers

    def __post_init__(self) -> None:
        self.read(ElementTree.parse(self.folder / "modelDescription.xml").getroot())
        self.binary = next(path for path in (self.folder / "binaries" / self.platform()).iterdir())
        self.library = ctypes.CDLL(str(self.binary), mode=self.mode)
        self.declare()

    def read(self, root: ElementTree.Element) -> None:
        self.guid = root.attrib["guid"]
        self.variables = {}
        for scalar in root.iter("ScalarVariable"):
            kind, a = scalar[0], scalar.attrib
            start = kind.attrib.get("start")
            reference = int(a["valueReference"])
            self.variables[a["name"]] = Variable(reference, kind.tag, a["causality"], a["variability"], start)

    def platform(self) -> str:
        return fmi_platform()

    def declare(self) -> None:
        _signatures(self.library)

    def names(self, causality: str, kind: str = "") -> list[str]:
        wanted = causality, kind or self.number
        return [name for name, v in self.variables.items() if (v.causality, v.type) == wanted]

    def count(self, names: Sequence[str]) -> int:
        """Elements of these variables together."""
        return sum(self.variables[name].count for name in names)

    def element_names(self, names: Sequence[str]) -> list[str]:
        """Names of the elements, as in FMI 2.0."""
        elements = []
        for name in names:
            size = self.variables[name].size
            elements += [name] if size is None else [f"{name}[{i}]" for i in range(1, size + 1)]
        return elements

    def with_derivatives(self) -> list[str]:
        """The outputs that are numbers but for discrete ones."""
        return [name for name in self.names("output") if self.variables[name].variability == "continuous"]

    @property
    def location(self) -> bytes:
        return (self.folder / "resources").as_uri().encode()


def fmi_platform() -> str:
    system = {"linux": "linux", "darwin": "darwin", "win32": "win"}[sys.platform]
    return f"{system}{8 * struct.calcsize('P')}"


def unpack(fmu: Path, folder: Path, mode: int = ctypes.DEFAULT_MODE) -> UnpackedFmu:
    with zipfile.ZipFile(fmu) as archive:
        archive.extractall(folder)
    return UnpackedFmu(folder, mode)


class AnyInstance(abc.ABC):
    """What instances of both versions of FMI have: calls by name, and the state as bytes."""

    version: int
    library: ctypes.CDLL
    component: int | None
    messages: list[Any]  # (status, category, text, ...)
    fmu: Any

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, e: BaseException | None, trace: TracebackType | None) -> None:
        getattr(self.library, f"fmi{self.version}FreeInstance")(self.component)
        self.component = None

    def call(self, name: str, *arguments: Any) -> int:
        status: int = getattr(self.library, f"fmi{self.version}{name}")(self.component, *arguments)
        return status

    @property
    def last_message(self) -> str:
        return str(self.messages[-1][2])

    def vrs(self, names: Sequence[str]) -> ctypes.Array[c_uint]:
        return (c_uint * len(names))(*(self.fmu.variables[name].vr for name in names))

    @abc.abstractmethod
    def enter_initialisation(self, start: float = 0.0) -> int: ...

    @abc.abstractmethod
    def write(self, values: dict[str, float]) -> int:
        """Write numbers by the names of FMI 2.0."""

    @abc.abstractmethod
    def step(self, time: float, step: float = 0.001) -> int: ...

    @abc.abstractmethod
    def outputs(self) -> list[float]: ...

    def initialise(self, inputs: dict[str, float] | None = None, start: float = 0.0) -> None:
        """Through the initialisation mode, with inputs of the first sample."""
        assert self.enter_initialisation(start) == OK, self.last_message
        if inputs:
            assert self.write(inputs) == OK, self.last_message
        assert self.call("ExitInitializationMode") == OK, self.last_message

    def save(self) -> bytes:
        """The state as bytes."""
        word = {2: "FMUstate", 3: "FMUState"}[self.version]
        state, size = c_void_p(), c_size_t()
        assert self.call(f"Get{word}", ctypes.byref(state)) == OK
        assert self.call(f"Serialized{word}Size", state, ctypes.byref(size)) == OK
        data = (c_char * size.value)()
        assert self.call(f"Serialize{word}", state, data, size.value) == OK
        assert self.call(f"Free{word}", ctypes.byref(state)) == OK and state.value is None
        return bytes(data)

    def restore(self, data: bytes) -> int:
        """Takes over a state from bytes; the status of the call that refused, if one did."""
        word, read = {2: ("FMUstate", "DeSerializeFMUstate"), 3: ("FMUState", "DeserializeFMUState")}[self.version]
        state = c_void_p()
        status = self.call(read, data, len(data), ctypes.byref(state))
        if status == OK:
            status = self.call(f"Set{word}", state)
        self.call(f"Free{word}", ctypes.byref(state))
        return status


class Instance(AnyInstance):
    """One instance of FMI 2.0. `messages` holds (status, category, text, environment, name)."""

    version = 2

    def __init__(self, fmu: UnpackedFmu, *, logging: bool = True, logger: bool = True, **changes: Any) -> None:
        self.fmu = fmu
        self.library = fmu.library
        self.messages: list[tuple[int, str, str, int | None, str]] = []

        def log(environment: int | None, name: bytes, status: int, category: bytes, text: bytes) -> None:
            self.messages.append((status, category.decode(), text.decode(), environment, name.decode()))

        self.callbacks = Callbacks(logger=LOGGER(log) if logger else LOGGER(), componentEnvironment=4711)
        arguments = {
            "name": b"finger",
            "type": 1,
            "guid": fmu.guid.encode(),
            "location": fmu.location,
            "callbacks": ctypes.byref(self.callbacks),
            "visible": 0,
            "logging": int(logging),
            **changes,
        }
        self.component = self.library.fmi2Instantiate(*arguments.values())

    def write(self, values: dict[str, float]) -> int:
        return self.set_real(values)

    def set_real(self, values: dict[str, float]) -> int:
        numbers = (c_double * len(values))(*values.values())
        return self.call("SetReal", self.vrs(list(values)), len(values), numbers)

    def get_real(self, names: Sequence[str]) -> np.ndarray[Any, np.dtype[np.float64]]:
        numbers = (c_double * len(names))(*([np.nan] * len(names)))
        assert self.call("GetReal", self.vrs(names), len(names), numbers) == OK, self.last_message
        return np.array(numbers)

    def set_integer(self, name: str, value: int) -> int:
        return self.call("SetInteger", self.vrs([name]), 1, ctypes.byref(c_int(value)))

    def get_integers(self, names: Sequence[str], kind: str = "Integer") -> list[int]:
        numbers = (c_int * len(names))(*([-1] * len(names)))
        assert self.call("Get" + kind, self.vrs(names), len(names), numbers) == OK, self.last_message
        return list(numbers)

    def outputs(self) -> list[float]:
        flags = self.get_integers(self.fmu.names("output", "Boolean"), "Boolean")
        return [*self.get_real(self.fmu.names("output")), *flags]

    def setup(self, start: float = 0.0, stop: float | None = None) -> int:
        return self.call("SetupExperiment", 0, 0.0, start, stop is not None, stop or 0.0)

    def enter_initialisation(self, start: float = 0.0) -> int:
        return self.setup(start) or self.call("EnterInitializationMode")

    def step(self, time: float, step: float = 0.001) -> int:
        return self.call("DoStep", time, step, 1)


def motion(fmu: Any, time: float, seed: int = 0) -> dict[str, float]:
    """Inputs that move: forces about 5 N, positions of a bending finger, with rests (sliding and sticking)."""
    phase = 0.3 * seed
    swing = np.clip(1.5 * np.sin(8.0 * time + phase), -1.0, 1.0)
    inputs = {}
    for k, name in enumerate(fmu.element_names(fmu.names("input"))):
        if name.startswith("tendon_force"):
            inputs[name] = 5.0 + 2.0 * np.sin(3.0 * time + k)
        elif name.startswith("tendon_position"):
            inputs[name] = 0.002 + 0.001 * swing * (1 - 0.3 * k)
        elif name.startswith("joint_position"):
            inputs[name] = 0.4 * swing
        else:
            inputs[name] = 0.4 * 8.0 * np.cos(8.0 * time + phase) * (abs(swing) < 1.0)
    return inputs
