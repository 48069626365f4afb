"""How an FMU is run over a recording, sample by sample. No other module uses fmpy."""

from __future__ import annotations

import ctypes
import errno
import os
import re
import shutil
import stat
import struct
import tempfile
import zipfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu.errors import InputError
from tendonfmu.model import FLAGS, INPUTS, NUMBERS, OPTIONAL_NUMBERS, PLACE, REST, SENSORS, inputs_used
from tendonfmu.recordings import Recording

Progress = Callable[[int], None]

# An FMU of `tendonfmu build` has some 4 MB in 200 files; what is larger by far is no FMU and would fill the disk.
LARGEST_UNPACKED, MOST_MEMBERS = 1 << 30, 10_000


@dataclass(frozen=True)
class Variables:
    """Variables of one FMU.

    Attributes
    ----------
    references
        Group -> name -> value reference, in the order of their index.
    types
        Group -> FMI type.
    """

    references: Mapping[str, Mapping[str, int]]
    types: Mapping[str, str]

    def of_type(self, kind: str) -> dict[str, int]:
        """Return name -> value reference of all groups of an FMI type."""
        return {
            name: reference
            for group, names in self.references.items()
            if self.types[group] == kind
            for name, reference in names.items()
        }

    @property
    def joints(self) -> int:
        return len(self.references["compensated_torque"])

    @property
    def tendons(self) -> int:
        return len(self.references["slack"])


def run_fmu(
    path: Path,
    recording: Recording,
    *,
    kinematics_source: int = 1,
    parameters: Mapping[str, float] | None = None,
    progress: Progress | None = None,
) -> dict[str, NDArray[Any]]:
    """Run a friction FMU over a recording.

    For sample k the inputs are set, fmi2DoStep takes the sample at t_k, and the outputs after it belong to t_k. The
    last step goes one sample beyond the recording.

    Parameters
    ----------
    path
        The FMU.
    recording
        Signals of the same finger.
    kinematics_source
        1, 2 or 3.
    parameters
        Start values by path, in addition to `kinematics_source`.
    progress
        Called with the number of samples done.

    Returns
    -------
    dict of arrays
        Column name -> [N], `time` first. Each row belongs to the time of its own sample.

    Raises
    ------
    InputError
        The file is no friction FMU, the recording does not fit it, or the FMU refuses something, in its own words.
    """
    with _unpacked(path) as folder:
        run = _Run(path, folder, parameters or {})
        recording.require(run.variables.joints, run.variables.tendons, run.inputs(kinematics_source))
        return run.over(recording, kinematics_source, progress)


@contextmanager
def _unpacked(path: Path) -> Iterator[Path]:
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    folder = Path(tempfile.mkdtemp(prefix="tendonfmu-"))
    try:
        _unpack(path, folder)
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _unpack(path: Path, folder: Path) -> None:
    """Unpack an FMU. Whatever zipfile and fmpy fail with is for the file, unless it is for the folder."""
    from fmpy import extract

    try:
        _check_members(path)
        extract(os.fspath(path), unzipdir=str(folder))
    except (InputError, MemoryError):
        raise
    except OSError as error:
        if error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS):
            raise InputError(f"{path}: cannot be unpacked into {folder.parent} ({error.strerror})") from None
        raise InputError(f"{path}: not an FMU ({_one_line(error)})") from None
    except Exception as error:
        raise InputError(f"{path}: not an FMU ({_one_line(error)})") from None
    if not (folder / "modelDescription.xml").is_file():
        raise InputError(f"{path}: no modelDescription.xml in it; expected an FMU of `tendonfmu build`")
    for library in folder.glob("binaries/*/*.so"):
        if not _is_whole(library.read_bytes()):
            raise InputError(f"{path}: {library.name} ends early; expected a whole library")


def _is_whole(library: bytes) -> bool:
    """Return whether a 64-bit ELF library has all its sections: loading one without ends the process (SIGBUS)."""
    if library[:6] != b"\x7fELF\x02\x01" or len(library) < 64:
        return True  # of another kind: the loader refuses what it does not know
    (table,) = struct.unpack_from("<Q", library, 40)
    size, count = struct.unpack_from("<HH", library, 58)
    return len(library) >= table + size * count


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split()) or type(error).__name__


def _check_members(path: Path) -> None:
    """Refuse an archive whose members would lie outside of its folder or fill the disk, before any is unpacked."""
    with zipfile.ZipFile(path) as archive:
        members = archive.infolist()
    if len(members) > MOST_MEMBERS:
        raise InputError(f"{path}: {len(members)} files in it; expected an FMU, of at most {MOST_MEMBERS}")
    size = sum(member.file_size for member in members)  # no more is unpacked, whatever the data hold
    if size > LARGEST_UNPACKED:
        raise InputError(f"{path}: {size / 1e9:.3g} GB when unpacked; expected an FMU, of at most 1.07 GB")
    for member in members:
        if ".." in member.filename.split("/") or stat.S_ISLNK(member.external_attr >> 16):
            raise InputError(f"{path}: {member.filename!r} is a link or leads out of it; expected an FMU")


def _description_of(path: Path, folder: Path) -> Any:
    """Return fmpy's ModelDescription. Whatever it fails with is for the file: it takes any XML to be one."""
    from fmpy import read_model_description

    try:
        return read_model_description(str(folder), validate=False)
    except MemoryError:
        raise
    except Exception as error:
        reason = f"modelDescription.xml: {_one_line(error)}"
        raise InputError(f"{path}: {reason}; expected an FMU of `tendonfmu build`") from None


class _Run:
    """One instance of an FMU. Its arrays are laid out once, so that a step is three calls."""

    def __init__(self, path: Path, folder: Path, parameters: Mapping[str, float]) -> None:
        from fmpy.fmi2 import FMU2Slave

        self.path = path
        self._at = str(path)  # place in error messages: the FMU, later the recording's row
        self._parameters = parameters
        self._messages: list[str] = []
        description = _description_of(path, folder)
        if description.fmiVersion != "2.0" or description.coSimulation is None:
            raise InputError(f"{path}: FMI {description.fmiVersion}; expected an FMI 2.0 co-simulation FMU")
        self._all = {variable.name: variable for variable in description.modelVariables}
        missing = {group for group in (*OPTIONAL_NUMBERS, *PLACE, *REST, *SENSORS) if not self._has(group)}
        present = [
            group for group in (*NUMBERS, *OPTIONAL_NUMBERS, *FLAGS, *PLACE, *REST, *SENSORS) if group not in missing
        ]
        outputs = {group: self._group(group) for group in present}
        types = {group: str(self._all[next(iter(names))].type) for group, names in outputs.items()}
        self.variables = Variables(outputs, types)
        self._inputs = {group: self._group(group) for group in INPUTS}
        try:
            self._slave = FMU2Slave(
                guid=description.guid,
                unzipDirectory=str(folder),
                modelIdentifier=description.coSimulation.modelIdentifier,
                instanceName=description.modelName,
            )
        except (InputError, TypeError, AttributeError, NameError, AssertionError, MemoryError):
            raise
        except (
            Exception
        ) as error:  # no library for this system, or none that can be loaded: fmpy raises bare exceptions
            raise InputError(f"{path}: not an FMU ({_one_line(error).replace(str(folder), '')})") from None

    def inputs(self, source: int) -> tuple[str, ...]:
        """Return the groups of inputs that the FMU uses."""
        return inputs_used(source, self._has(REST[-1]) or self._has(SENSORS[-1]))

    def _has(self, group: str) -> bool:
        return group in self._all or f"{group}[1]" in self._all

    def _group(self, group: str) -> dict[str, int]:
        if group in self._all:
            return {group: self._all[group].valueReference}
        found = {}
        for name, variable in self._all.items():
            if match := re.fullmatch(rf"{group}\[(\d+)\]", name):
                found[int(match[1])] = variable.valueReference
        if not found:
            raise InputError(f"{self.path}: no variable {group}[1]; expected a friction FMU of `tendonfmu build`")
        return {f"{group}[{i}]": found[i] for i in sorted(found)}

    @contextmanager
    def _refusals(self) -> Iterator[None]:
        """Turn fmpy's exceptions into one line with the FMU's own words."""
        try:
            yield
        except (InputError, TypeError, AttributeError, NameError, AssertionError, ArithmeticError, MemoryError):
            raise
        except Exception as error:  # fmpy raises bare exceptions
            reason = self._messages[-1] if self._messages else str(error)
            raise InputError(f"{self._at}: {reason}") from None

    def _instantiate(self) -> None:
        from fmpy import calloc, free
        from fmpy.fmi2 import (
            fmi2CallbackAllocateMemoryTYPE,
            fmi2CallbackFreeMemoryTYPE,
            fmi2CallbackFunctions,
            fmi2CallbackLoggerTYPE,
        )

        def log(_environment: Any, _instance: bytes, status: int, _category: bytes, message: bytes) -> None:
            if status > 1:
                self._messages.append(message.decode("utf-8", "replace").replace("%%", "%"))

        self._callbacks = fmi2CallbackFunctions()
        self._callbacks.logger = fmi2CallbackLoggerTYPE(log)
        self._callbacks.allocateMemory = fmi2CallbackAllocateMemoryTYPE(calloc)
        self._callbacks.freeMemory = fmi2CallbackFreeMemoryTYPE(free)
        self._slave.instantiate(callbacks=self._callbacks, loggingOn=True)

    def _initialise(self, start: float, source: int) -> None:
        self._slave.setupExperiment(startTime=start)
        if "kinematics_source" not in self._all:
            raise InputError(
                f"{self.path}: no parameter kinematics_source; expected a friction FMU of `tendonfmu build`"
            )
        self._slave.setInteger([self._all["kinematics_source"].valueReference], [source])
        for path, value in self._parameters.items():
            if path not in self._all:
                raise InputError(f"{self.path}: no parameter {path!r} in this FMU")
            self._slave.setReal([self._all[path].valueReference], [value])
        self._slave.enterInitializationMode()

    def over(self, recording: Recording, source: int, progress: Progress | None) -> dict[str, NDArray[Any]]:
        with self._refusals():
            self._instantiate()
        try:
            with self._refusals():
                self._initialise(float(recording.time[0]), source)
                columns = self._step(recording, self.inputs(source), progress)
                self._slave.terminate()
        finally:
            self._slave.freeInstance()
        ordered = (name for names in self.variables.references.values() for name in names)
        return {"time": recording.time, **{name: columns[name] for name in ordered}}

    def _step(
        self, recording: Recording, groups: tuple[str, ...], progress: Progress | None
    ) -> dict[str, NDArray[Any]]:
        slave, component = self._slave, self._slave.component
        set_vr = _references([vr for group in groups for vr in self._inputs[group].values()])
        kinds = ("Real", "Boolean", "Integer")
        get_vr, flag_vr, whole_vr = (_references(list(self.variables.of_type(kind).values())) for kind in kinds)
        samples = np.ascontiguousarray(np.hstack([recording.groups[group] for group in groups]))
        numbers = np.empty((len(recording), len(get_vr)))
        flags = np.empty((len(recording), len(flag_vr)), dtype=np.int32)
        whole = np.empty((len(recording), len(whole_vr)), dtype=np.int32)
        inputs, real, boolean, integer = (_rows(table) for table in (samples, numbers, flags, whole))
        times = recording.time.tolist()
        steps = np.diff(recording.time).tolist()
        steps.append(steps[-1] if steps else 1e-3)

        self._at = f"{recording.path}: row 1"
        slave.fmi2SetReal(component, set_vr, len(set_vr), inputs(0))
        slave.exitInitializationMode()
        for k, (time, step) in enumerate(zip(times, steps, strict=True)):
            self._at = f"{recording.path}: row {k + 1}"
            slave.fmi2SetReal(component, set_vr, len(set_vr), inputs(k))
            slave.fmi2DoStep(component, time, step, 1)
            slave.fmi2GetReal(component, get_vr, len(get_vr), real(k))
            slave.fmi2GetBoolean(component, flag_vr, len(flag_vr), boolean(k))
            if len(whole_vr):
                slave.fmi2GetInteger(component, whole_vr, len(whole_vr), integer(k))
            if progress and (k + 1) % 500 == 0:
                progress(k + 1)
        if progress:
            progress(len(times))
        tables: tuple[NDArray[Any], ...] = (numbers, flags.astype(bool), whole)
        return {
            name: table[:, i]
            for kind, table in zip(kinds, tables, strict=True)
            for i, name in enumerate(self.variables.of_type(kind))
        }


def _references(values: list[int]) -> Any:
    return (ctypes.c_uint * len(values))(*values)


def _rows(rows: NDArray[Any]) -> Callable[[int], Any]:
    """Return a function from k to row k in place, as FMI's array of numbers."""
    row = (ctypes.c_double if rows.dtype == np.float64 else ctypes.c_int) * rows.shape[1]
    first, stride = rows.ctypes.data, rows.strides[0]
    return lambda k: row.from_address(first + k * stride)
