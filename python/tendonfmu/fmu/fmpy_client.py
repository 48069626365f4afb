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
from contextlib import contextmanager, redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from tendonfmu.errors import InputError, OutputError
from tendonfmu.files import counted
from tendonfmu.model import FLAGS, INPUTS, NUMBERS, OPTIONAL_NUMBERS, PLACE, SENSORS, inputs_used
from tendonfmu.recordings import Recording

Progress = Callable[[int], None]
Pointer = Any  # to the first number of an array of ctypes
KINDS = ("Real", "Boolean", "Integer")
FOR_READERS = ("sources/", "documentation/")  # no run needs these folders; with them unpacking takes five times as long
# Types of FMI 3.0 by the names that they have in FMI 2.0.
KIND_OF = {"Float64": "Real", "Int32": "Integer"}
# An FMU of `tendonfmu build` has some 4 MB in 200 files; what is larger by far is no FMU and would fill the disk.
LARGEST_UNPACKED, MOST_MEMBERS = 1 << 30, 10_000


@dataclass(frozen=True)
class Group:
    """A group of variables, such as the forces of all tendons."""

    names: tuple[str, ...]  # of the elements, in the order of their index
    references: tuple[int, ...]  # value references: one of each element in FMI 2.0, one of the whole array in FMI 3.0
    kind: str  # "Real", "Integer" or "Boolean"


def run_fmu(
    path: Path,
    recording: Recording,
    *,
    kinematics_source: int = 1,
    progress: Progress | None = None,
) -> dict[str, NDArray[Any]]:
    """Run a friction FMU over a recording."""
    # returns [N]
    with _unpacked(path) as folder:
        run = _Run(path, folder)
        recording.require(run.joints, run.tendons, run.inputs(kinematics_source))
        return run.over(recording, kinematics_source, progress)


@contextmanager
def _unpacked(path: Path) -> Iterator[Path]:
    if not path.is_file():
        raise InputError(f"{path}: no such file; expected an FMU")
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
        extract(os.fspath(path), unzipdir=str(folder), include=lambda name: not name.startswith(FOR_READERS))
    except (InputError, MemoryError):
        raise
    except OSError as error:
        if error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS):
            raise OutputError(f"{path}: cannot be unpacked into {folder.parent} ({error.strerror})") from None
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
    return bool(len(library) >= table + size * count)


def _one_line(error: Exception) -> str:
    """Return what an error says, in one line."""
    return " ".join(str(error).split()) or type(error).__name__


def _check_members(path: Path) -> None:
    """Check an archive before any of it is unpacked."""
    with zipfile.ZipFile(path) as archive:
        members = archive.infolist()
    if len(members) > MOST_MEMBERS:
        raise InputError(f"{path}: {counted(len(members), 'file')} in it; expected an FMU, of at most {MOST_MEMBERS}")
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


def _samples_at_end(folder: Path) -> bool:
    """Return whether a step of the FMU takes the sample at its end."""
    root = ElementTree.parse(folder / "modelDescription.xml").getroot()
    places = (
        "VendorAnnotations/Tool[@name='tendonfmu']/SampleAt",
        "Annotations/Annotation[@type='tendonfmu.SampleAt']",
    )
    return "end" in {root.findtext(place) for place in places}


def _steps(time: NDArray[np.float64], at_end: bool) -> Iterator[tuple[float, float]]:
    """Yield begin and length (s) of the step that takes each sample; length 0: the initialisation has taken it."""
    lengths = np.diff(time)
    if not at_end:
        yield from zip(time.tolist(), [*lengths.tolist(), lengths[-1] if len(lengths) else 1e-3], strict=True)
        return
    lengths += time[1:] - (time[:-1] + lengths)  # so that begin and length add up to the sample's own time
    yield from zip(time[[0, *range(len(lengths))]].tolist(), [0.0, *lengths.tolist()], strict=True)


class _Slave:
    """What instances of both versions of FMI have. fmpy raises bare exceptions when the FMU refuses a call."""

    def __init__(self, slave: Any) -> None:
        self._slave = slave

    def exit_initialisation(self) -> None:
        self._slave.exitInitializationMode()

    def terminate(self) -> None:
        self._slave.terminate()

    def free(self) -> None:
        self._slave.freeInstance()


class _Slave2(_Slave):
    """FMI 2.0."""

    numbers: ClassVar[Mapping[str, type[np.generic]]] = {"Real": np.float64, "Boolean": np.int32, "Integer": np.int32}

    def initialise(self, start: float, reference: int, value: int) -> None:
        """Write a whole number by its value reference, and enter the initialisation mode."""
        self._slave.setupExperiment(startTime=start)
        self._slave.setInteger([reference], [value])
        self._slave.enterInitializationMode()

    def writer(self, references: list[int], count: int) -> Callable[[Pointer], None]:
        """Return a function that writes `count` numbers to Real variables."""
        vr, write, component = _references(references), self._slave.fmi2SetReal, self._slave.component
        return lambda values: write(component, vr, count, values)

    def reader(self, kind: str, references: list[int], count: int) -> Callable[[Pointer], None]:
        """Return a function that reads `count` values."""
        vr, read, component = _references(references), getattr(self._slave, f"fmi2Get{kind}"), self._slave.component
        return lambda values: read(component, vr, count, values)

    def step(self, time: float, step: float) -> None:
        self._slave.fmi2DoStep(self._slave.component, time, step, 1)


class _Slave3(_Slave):
    """FMI 3.0."""

    numbers: ClassVar[Mapping[str, type[np.generic]]] = {"Real": np.float64, "Boolean": np.bool_, "Integer": np.int32}

    def __init__(self, slave: Any) -> None:
        super().__init__(slave)
        flags = [ctypes.c_bool() for _ in range(3)]
        self._answers = (*map(ctypes.byref, flags), ctypes.byref(ctypes.c_double()))

    def initialise(self, start: float, reference: int, value: int) -> None:
        self._slave.setInt32([reference], [value])
        self._slave.enterInitializationMode(startTime=start)

    def writer(self, references: list[int], count: int) -> Callable[[Pointer], None]:
        vr, write, component = _references(references), self._slave.fmi3SetFloat64, self._slave.component
        return lambda values: write(component, vr, len(vr), values, count)

    def reader(self, kind: str, references: list[int], count: int) -> Callable[[Pointer], None]:
        name = {other: name for name, other in KIND_OF.items()}.get(kind, kind)
        vr, read, component = _references(references), getattr(self._slave, f"fmi3Get{name}"), self._slave.component
        return lambda values: read(component, vr, len(vr), values, count)

    def step(self, time: float, step: float) -> None:
        self._slave.fmi3DoStep(self._slave.component, time, step, True, *self._answers)


class _Run:
    """One instance of an FMU. Its arrays are laid out once, so that a step is a few calls."""

    def __init__(self, path: Path, folder: Path) -> None:
        self.path = path
        self._at = str(path)  # place in error messages: the FMU, later the recording's row
        self._messages: list[str] = []
        self._folder, self._description = folder, _description_of(path, folder)
        self._at_end = _samples_at_end(folder)
        description = self._description
        slaves: dict[str, type[_Slave2 | _Slave3]] = {"2": _Slave2, "3": _Slave3}
        slave = slaves.get(str(description.fmiVersion).partition(".")[0])
        if slave is None or description.coSimulation is None:
            raise InputError(f"{path}: FMI {description.fmiVersion}; expected a co-simulation FMU of FMI 2.0 or 3.0")
        self._all = {variable.name: variable for variable in description.modelVariables}
        wanted = (*NUMBERS, *OPTIONAL_NUMBERS, *FLAGS, *PLACE, *SENSORS)
        optional = (*OPTIONAL_NUMBERS, *PLACE, *SENSORS)
        self._outputs = {name: self._group(name) for name in wanted if name not in optional or self._has(name)}
        self._inputs = {group: self._group(group) for group in INPUTS}
        self._kind = slave

    @property
    def joints(self) -> int:
        return len(self._outputs["compensated_torque"].names)

    @property
    def tendons(self) -> int:
        return len(self._outputs["slack"].names)

    def inputs(self, source: int) -> tuple[str, ...]:
        """Return the groups of inputs that the FMU uses."""
        return inputs_used(source, self._watches_motors() or self._has(SENSORS[-1]))

    def _watches_motors(self) -> bool:
        """Return whether the load of the motors counts in a bound of contact."""
        number = re.compile(r"contact\.bands\[\d\]\.(motor_load|friction_change|friction_reserve)\[\d+\]")
        return any(float(each.start or 0) > 0.0 for name, each in self._all.items() if number.fullmatch(name))

    def _has(self, group: str) -> bool:
        return group in self._all or f"{group}[1]" in self._all

    def _group(self, group: str) -> Group:
        if group in self._all:
            variable = self._all[group]
            kind = KIND_OF.get(str(variable.type), str(variable.type))
            sizes = [int(dimension.start) for dimension in variable.dimensions or ()]
            names = tuple(f"{group}[{i}]" for i in range(1, sizes[0] + 1)) if sizes else (group,)
            return Group(names, (variable.valueReference,), kind)
        count = 0
        while f"{group}[{count + 1}]" in self._all:
            count += 1
        if not count:
            raise InputError(f"{self.path}: no variable {group}[1]; expected a friction FMU of `tendonfmu build`")
        names = tuple(f"{group}[{i}]" for i in range(1, count + 1))
        return Group(names, tuple(self._all[name].valueReference for name in names), str(self._all[names[0]].type))

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

    def _log(self, *call: Any) -> None:
        """Keep an error: the last of a call are the status, a category and the text."""
        status, _, text = call[-3:]
        if status > 1:
            self._messages.append(text.decode("utf-8", "replace").replace("%%", "%"))

    def _instance(self) -> _Slave2 | _Slave3:
        """Load the library and make the instance."""
        from fmpy import instantiate_fmu

        before = Path.cwd()
        try:
            with redirect_stdout(None):
                slave = instantiate_fmu(
                    str(self._folder), self._description, "CoSimulation", debug_logging=True, logger=self._log
                )
        except (TypeError, AttributeError, NameError, AssertionError, MemoryError):
            raise
        # no library for this system, one that cannot be loaded, or a refusal: fmpy raises bare exceptions
        except Exception as error:
            reason = f"not an FMU ({_one_line(error).replace(str(self._folder), '')})"
            raise InputError(f"{self.path}: {self._messages[-1] if self._messages else reason}") from None
        finally:
            os.chdir(before)  # fmpy loads a library in its folder, and stays there if that fails
        return self._kind(slave)

    def _initialise(self, slave: _Slave2 | _Slave3, start: float, source: int) -> None:
        if "kinematics_source" not in self._all:
            raise InputError(
                f"{self.path}: no parameter kinematics_source; expected a friction FMU of `tendonfmu build`"
            )
        slave.initialise(start, self._all["kinematics_source"].valueReference, source)

    def over(self, recording: Recording, source: int, progress: Progress | None) -> dict[str, NDArray[Any]]:
        slave = self._instance()
        try:
            with self._refusals():
                self._initialise(slave, float(recording.time[0]), source)
                columns = self._step(slave, recording, self.inputs(source), progress)
                slave.terminate()
        finally:
            slave.free()
        ordered = (name for group in self._outputs.values() for name in group.names)
        return {"time": recording.time, **{name: columns[name] for name in ordered}}

    def _step(
        self, slave: _Slave2 | _Slave3, recording: Recording, groups: tuple[str, ...], progress: Progress | None
    ) -> dict[str, NDArray[Any]]:
        samples = np.ascontiguousarray(np.hstack([recording.groups[group] for group in groups]))
        write = slave.writer([vr for group in groups for vr in self._inputs[group].references], samples.shape[1])
        inputs = _rows(samples)
        reading = []
        columns: dict[str, tuple[str, NDArray[Any]]] = {}
        for kind in KINDS:
            of_kind = [group for group in self._outputs.values() if group.kind == kind]
            names = [name for group in of_kind for name in group.names]
            if names:
                table = np.empty((len(recording), len(names)), dtype=slave.numbers[kind])
                references = [vr for group in of_kind for vr in group.references]
                reading.append((slave.reader(kind, references, len(names)), _rows(table)))
                columns |= {name: (kind, table[:, i]) for i, name in enumerate(names)}

        self._at = f"{recording.path}: row 1"
        write(inputs(0))
        slave.exit_initialisation()
        for k, (begin, length) in enumerate(_steps(recording.time, self._at_end)):
            self._at = f"{recording.path}: row {k + 1}"
            write(inputs(k))
            if length:
                slave.step(begin, length)
            for read, row in reading:
                read(row(k))
            if progress and (k + 1) % 500 == 0:
                progress(k + 1)
        if progress:
            progress(len(recording))
        return {name: values.astype(bool) if kind == "Boolean" else values for name, (kind, values) in columns.items()}


def _references(values: list[int]) -> Any:
    return (ctypes.c_uint * len(values))(*values)


def _rows(rows: NDArray[Any]) -> Callable[[int], Pointer]:
    """Return a function from k to row k in place, as FMI's array of values."""
    row = np.ctypeslib.as_ctypes_type(rows.dtype) * rows.shape[1]
    first, stride = rows.ctypes.data, rows.strides[0]
    return lambda k: row.from_address(first + k * stride)
