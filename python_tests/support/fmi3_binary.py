"""The FMU's shared library of FMI 3.0 driven by hand: every fmi3 function with any arguments, and all that it logs."""

from __future__ import annotations

import ctypes
import platform
import sys
import zipfile
from collections.abc import Mapping, Sequence
from ctypes import c_bool, c_char_p, c_double, c_int, c_int32, c_size_t, c_void_p
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from fmu_binary import OK, AnyInstance, UnpackedFmu, Variable

LOGGER = ctypes.CFUNCTYPE(None, c_void_p, c_int, c_char_p, c_char_p)
TYPES: dict[str, Any] = {"Float64": c_double, "Int32": c_int32, "Boolean": c_bool}
OTHER_TYPES = ("Float32", "Int8", "UInt8", "Int16", "UInt16", "UInt32", "Int64", "UInt64", "String")


def _signatures(library: ctypes.CDLL) -> None:
    """Pointers are 64 bits wide: without argument types ctypes would cut them."""
    values = [c_void_p, c_void_p, c_size_t, c_void_p, c_size_t]
    partials = [c_void_p, c_void_p, c_size_t, c_void_p, c_size_t, c_void_p, c_size_t, c_void_p, c_size_t]
    types: dict[str, list[Any]] = {
        "FreeInstance": [c_void_p],
        "SetDebugLogging": [c_void_p, c_bool, c_size_t, c_void_p],
        "EnterInitializationMode": [c_void_p, c_bool, c_double, c_double, c_bool, c_double],
        "GetFMUState": [c_void_p, c_void_p],
        "SetFMUState": [c_void_p, c_void_p],
        "FreeFMUState": [c_void_p, c_void_p],
        "SerializedFMUStateSize": [c_void_p, c_void_p, c_void_p],
        "SerializeFMUState": [c_void_p, c_void_p, c_void_p, c_size_t],
        "DeserializeFMUState": [c_void_p, c_void_p, c_size_t, c_void_p],
        "GetDirectionalDerivative": partials,
        "GetAdjointDerivative": partials,
        "DoStep": [c_void_p, c_double, c_double, c_bool, c_void_p, c_void_p, c_void_p, c_void_p],
        **{f"{way}{name}": values for way in ("Get", "Set") for name in (*TYPES, *OTHER_TYPES)},
        **{f"{way}Binary": [*values[:3], c_void_p, c_void_p, c_size_t] for way in ("Get", "Set")},
        **{f"{way}Clock": values[:4] for way in ("Get", "Set")},
        **{f: [c_void_p] for f in ("ExitInitializationMode", "Terminate", "Reset")},
    }
    for name, arguments in types.items():
        getattr(library, "fmi3" + name).argtypes = arguments
    common = [c_char_p, c_char_p, c_char_p, c_bool, c_bool]
    library.fmi3InstantiateCoSimulation.argtypes = [
        *common, c_bool, c_bool, c_void_p, c_size_t, c_void_p, c_void_p, c_void_p,
    ]  # fmt: skip
    library.fmi3InstantiateModelExchange.argtypes = [*common, c_void_p, c_void_p]
    library.fmi3InstantiateScheduledExecution.argtypes = [*common, *[c_void_p] * 5]
    for kind in ("CoSimulation", "ModelExchange", "ScheduledExecution"):
        getattr(library, f"fmi3Instantiate{kind}").restype = c_void_p
    library.fmi3GetVersion.restype = c_char_p


def fmi3_platform() -> str:
    machine = {"amd64": "x86_64", "arm64": "aarch64"}.get(platform.machine().lower(), platform.machine().lower())
    return f"{machine}-{ {'linux': 'linux', 'darwin': 'darwin', 'win32': 'windows'}[sys.platform] }"


class UnpackedFmu3(UnpackedFmu):
    number = "Float64"

    def read(self, root: ElementTree.Element) -> None:
        self.guid = self.token = root.attrib["instantiationToken"]
        self.variables = {}
        for each in root.find("ModelVariables") or ():
            a, dimension = each.attrib, each.find("Dimension")
            size = None if dimension is None else int(dimension.attrib["start"])
            self.variables[a["name"]] = Variable(
                int(a["valueReference"]), each.tag, a["causality"], a["variability"], a.get("start"), size
            )

    def platform(self) -> str:
        return fmi3_platform()

    def declare(self) -> None:
        _signatures(self.library)

    @property
    def resources(self) -> bytes:
        return str(self.folder / "resources").encode() + b"/"


def unpack3(fmu: Path, folder: Path) -> UnpackedFmu3:
    with zipfile.ZipFile(fmu) as archive:
        archive.extractall(folder)
    return UnpackedFmu3(folder)


class Instance3(AnyInstance):
    """One instance. Calls return the fmi3Status; `messages` holds (status, category, text)."""

    version = 3

    def __init__(self, fmu: UnpackedFmu3, *, logging: bool = True, **changes: Any) -> None:
        self.fmu = fmu
        self.library = fmu.library
        self.messages: list[tuple[int, str, str]] = []

        def log(environment: int | None, status: int, category: bytes, text: bytes) -> None:
            assert environment == 4711
            self.messages.append((status, category.decode(), text.decode()))

        self.logger = LOGGER(log)
        arguments = {
            "name": b"finger",
            "token": fmu.token.encode(),
            "resources": fmu.resources,
            "visible": False,
            "logging": logging,
            "event_mode": False,
            "early_return": False,
            "intermediate": None,
            "intermediate_count": 0,
            "environment": 4711,
            "logger": self.logger,
            "update": None,
            **changes,
        }
        self.component = self.library.fmi3InstantiateCoSimulation(*arguments.values())

    def set(self, values: Mapping[str, float | Sequence[float]], kind: str = "Float64") -> int:
        """Write whole variables."""
        flat = [element for value in values.values() for element in (value if isinstance(value, Sequence) else [value])]
        numbers = (TYPES[kind] * len(flat))(*flat)
        return self.call(f"Set{kind}", self.vrs(list(values)), len(values), numbers, len(flat))

    def write(self, values: Mapping[str, float]) -> int:
        return self.set_elements(values)

    def set_elements(self, values: Mapping[str, float]) -> int:
        """Write inputs and parameters by the names of FMI 2.0; of an array all elements must be there."""
        whole: dict[str, float | list[float]] = {}
        for name, value in values.items():
            group = name.partition("[")[0]
            if group in self.fmu.variables and name not in self.fmu.variables:
                array = whole.setdefault(group, [])
                assert isinstance(array, list)
                array.append(value)
            else:
                whole[name] = value
        return self.set(whole)

    def get(self, names: Sequence[str], kind: str = "Float64") -> NDArray[Any]:
        """Read whole variables: their elements one after another."""
        count = self.fmu.count(names)
        numbers = (TYPES[kind] * count)()
        assert self.call(f"Get{kind}", self.vrs(names), len(names), numbers, count) == OK, self.last_message
        return np.array(numbers)

    def outputs(self) -> list[float]:
        """All Float64 and Boolean outputs, as `Instance.outputs` of FMI 2.0."""
        names = self.fmu.names
        return [*self.get(names("output")), *map(int, self.get(names("output", "Boolean"), "Boolean"))]

    def enter_initialisation(self, start: float = 0.0, stop: float | None = None) -> int:
        return self.call("EnterInitializationMode", False, 0.0, start, stop is not None, stop or 0.0)

    def step(self, time: float, step: float = 0.001) -> int:
        flags = (c_bool * 3)(True, True, True)
        self.last_successful_time = c_double()
        pointers = [ctypes.byref(flags, k) for k in range(3)]
        status = self.call("DoStep", time, step, True, *pointers, ctypes.byref(self.last_successful_time))
        assert not any(flags)
        return status
