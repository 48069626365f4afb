"""Reads reference results: the three files of an FMI cross-check, or what an FMU carries (fmi-ls-ref).

An FMU carries results if extra/org.fmi-standard.fmi-ls-ref/fmi-ls-manifest.xml lists

- a file of role `experiment` in the format ma-hs-experiments, whose experiments name references, and may name stimuli
  and parameters (SSV); or
- a file of role `result` alone: then NAME_in.csv beside NAME_ref.csv or NAME_out.csv has the inputs.

Start, stop and step come from the experiment, then from NAME_ref.opt beside the results; else the run goes from their
first row to their last, with the step of the FMU's default experiment, or of the rows. The tolerance of the comparison
comes from NAME_ref.opt.
"""

from __future__ import annotations

import csv
import io
import posixpath
import re
import zipfile
import zlib
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]
TIMES = ("StartTime", "StopTime", "StepSize")
OPTIONS = (*TIMES, "RelTol", "AbsTol")
ATTRIBUTES = dict(zip(TIMES, ("startTime", "stopTime", "stepSize"), strict=True))
FOLDER = "extra/org.fmi-standard.fmi-ls-ref"
MANIFEST = f"{FOLDER}/fmi-ls-manifest.xml"
# Of results that come without a tolerance: they mostly stem from another solver, or another importer.
UNSTATED_TOLERANCE = 1e-3
SAME_TIME = 1e-9  # share of a step: reference and result rows closer than this are the same moment


class BadFile(Exception):
    """One line: where, what, what was expected."""


@dataclass(frozen=True)
class Trace:
    """What a run of an FMU must yield.

    `options` has all of OPTIONS. `source` and `inputs_source` name the files in messages. A trace of the cross-check
    must have every output of the FMU (`complete`).
    """

    name: str
    source: str
    reference: Mapping[str, Array]
    options: Mapping[str, float]
    inputs_source: str = ""
    inputs: Mapping[str, Array] | None = None
    start_values: Mapping[str, str] = field(default_factory=dict)
    solver_tolerance: float | None = None
    complete: bool = False


# --- files of the cross-check ----------------------------------------------------------------------------------------


def cross_check_trace(prefix: str, takes_inputs: bool) -> Trace:
    """The trace of FOLDER/NAME. Raises BadFile."""
    input_file, reference_file = Path(f"{prefix}_in.csv"), Path(f"{prefix}_ref.csv")
    option_file = Path(f"{prefix}_ref.opt")
    options = {"RelTol": 0.0, "AbsTol": 0.0} | read_options(_text(option_file, "lines `name,value`"), option_file)
    missing = [name for name in TIMES if name not in options]
    if missing:
        raise BadFile(f"{option_file}: {', '.join(missing)} missing; expected lines `name,value`")
    _check_times(options, option_file)
    reference = read_results(_text(reference_file, "a CSV file with a header"), reference_file)
    inputs = None
    if takes_inputs or input_file.exists():
        inputs = read_table(_text(input_file, "a CSV file with a header"), input_file)
    return Trace(
        Path(prefix).name, str(reference_file), reference, options, str(input_file), inputs=inputs, complete=True
    )


def _text(path: Path, expected: str) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, ValueError):
        raise BadFile(f"{path}: cannot be read; expected {expected}") from None


def read_table(text: str, where: object, leave_out: Collection[str] = ()) -> dict[str, Array]:
    """Columns by name, `time` first and never decreasing: [N], or [N, k] where a cell has k numbers. Raises BadFile."""
    header, *rows = csv.reader(io.StringIO(text), skipinitialspace=True) if text.strip() else [[""]]
    if header[0] != "time" or len(set(header)) < len(header):
        raise BadFile(f"{where}, header: expected `time` first and no name twice")
    found: dict[str, list[list[float]]] = {name: [] for name in header if name not in leave_out}
    for k, row in enumerate(rows):
        if len(row) != len(header):
            raise BadFile(f"{where}, line {k + 2}: {len(row)} columns; expected {len(header)}")
        for name, cell in zip(header, row, strict=True):
            if name in found:
                found[name].append(
                    _numbers(cell, len(found[name][0]) if k else None, f"line {k + 2}, column {name}", where)
                )
    table = {name: np.array(cells) for name, cells in found.items()}
    time = table["time"].reshape(-1)
    if len(rows) < 2 or len(time) > len(rows) or not (np.diff(time) >= 0).all() or time[0] == time[-1]:
        raise BadFile(f"{where}, column time: expected two rows or more, none earlier than the one before")
    return {name: values.reshape(-1) if values.shape[1] == 1 else values for name, values in table.items()}


def _numbers(cell: str, count: int | None, place: str, where: object) -> list[float]:
    """The numbers of a cell: those of an array are separated by spaces."""
    found = [number(text, f"{where}, {place}") for text in cell.split() or [cell]]
    if count not in (None, len(found)):
        many = "1 number" if len(found) == 1 else f"{len(found)} numbers"
        raise BadFile(f"{where}, {place}: {many}; expected {count}, as in the row before")
    return found


def read_results(text: str, where: object, leave_out: Collection[str] = ()) -> dict[str, Array]:
    """The same with one row a time, the last one: the values after an event. Raises BadFile."""
    table = read_table(text, where, leave_out)
    last = np.append(np.diff(table["time"]) > 0, True)
    return {name: values[last] for name, values in table.items()}


def read_options(text: str, where: object) -> dict[str, float]:
    """The numbers of NAME_ref.opt that are given. Raises BadFile."""
    found = {}
    for line in filter(str.strip, text.splitlines()):
        name, _, value = (part.strip() for part in line.partition(","))
        if name in OPTIONS:
            found[name] = number(value, f"{where}, {name}")
    return found


def _check_times(options: Mapping[str, float], where: object) -> None:
    if not options["StopTime"] > options["StartTime"] or not options["StepSize"] > 0.0:
        raise BadFile(f"{where}: expected StopTime after StartTime and StepSize above 0")


def number(text: str, where: str) -> float:
    """A finite number; true and false are 1 and 0. Raises BadFile."""
    try:
        value = float({"true": "1", "false": "0"}.get(text, text))
    except ValueError:
        value = np.nan
    if not np.isfinite(value):
        raise BadFile(f"{where}: {text!r}; expected a finite number")
    return value


# --- what an FMU carries ---------------------------------------------------------------------------------------------


def expect_whole(fmu: Path) -> None:
    """Raises BadFile for an archive with a damaged member: its checksums show it."""
    try:
        with zipfile.ZipFile(fmu) as archive:
            damaged = archive.testzip()
    except (OSError, zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError) as wrong:
        raise BadFile(f"{fmu}: {wrong}; expected an archive that is whole") from None
    if damaged is not None:
        raise BadFile(f"{fmu}: {damaged}: damaged (its checksum in the archive differs); expected it whole")


def carried_traces(fmu: Path, step: float | None, not_numeric: Collection[str]) -> list[Trace]:
    """The traces in an FMU. step: that of its default experiment (s). Raises BadFile.

    Columns of variables in `not_numeric` (texts, binary data) are left out.
    """
    with zipfile.ZipFile(fmu) as archive:
        names = frozenset(archive.namelist())
        files = {name: archive.read(name) for name in names if name.startswith("extra/")}
    if MANIFEST not in files:
        raise BadFile(f"{fmu}: no {MANIFEST} in it; expected reference results in the FMU, or FOLDER/NAME of a trace")
    carried = _Carried(fmu, names, files, step, not_numeric)
    related = list(carried.related())
    documents = [(MANIFEST, carried.xml(MANIFEST))]  # drafts of the standard had the experiments in the manifest
    documents += [(path, carried.xml(path)) for path, role in related if role.split("/")[0] == "experiment"]
    traces = [trace for path, root in documents for trace in carried.experiments(path, root)]
    named = {trace.source for trace in traces}
    alone = [path for path, role in related if role == "result" and path.endswith(".csv")]
    traces += [carried.result(path) for path in alone if carried.where(path) not in named]
    if not traces:
        raise BadFile(f"{fmu}: {MANIFEST}: no experiment with references and no result in CSV; expected one")
    return traces


@dataclass(frozen=True)
class _Carried:
    """The files of an FMU below extra/, by path. names: of all its files."""

    fmu: Path
    names: Collection[str]
    files: Mapping[str, bytes]
    step: float | None
    not_numeric: Collection[str]

    def where(self, path: str) -> str:
        return f"{self.fmu}: {path}"

    def text(self, path: str) -> str:
        try:
            return self.files[path].decode("utf-8-sig")
        except KeyError:
            raise BadFile(f"{self.where(path)}: not in the FMU; expected it, as another file names it") from None
        except ValueError:
            raise BadFile(f"{self.where(path)}: expected UTF-8") from None

    def xml(self, path: str) -> ElementTree.Element:
        try:
            return ElementTree.fromstring(self.text(path))
        except ElementTree.ParseError as wrong:
            raise BadFile(f"{self.where(path)}: {wrong}; expected XML") from None

    def path(self, base: str, source: str | None) -> str:
        """The path of a URI that stands in the file `base`."""
        parts = urlsplit(source or "")
        if not parts.path or parts.scheme or parts.netloc:
            raise BadFile(f"{self.where(base)}: source {source!r}; expected a relative path in the FMU")
        return posixpath.normpath(posixpath.join(posixpath.dirname(base), unquote(parts.path)))

    def related(self) -> Iterator[tuple[str, str]]:
        """Path and role of each file below extra/. Raises BadFile for one that is gone."""
        for each in _children(self.xml(MANIFEST), "Related"):
            source, role = each.get("source"), each.get("role", "")
            needed = role.split("/")[0] in ("experiment", "result")
            if not needed and urlsplit(source or "").scheme:
                continue  # elsewhere, and not for this check
            path = self.path(MANIFEST, source)
            if path in self.files:
                yield path, role
            elif path not in self.names:
                raise BadFile(f"{self.where(path)}: not in the FMU; expected it, as {MANIFEST} lists it")

    def experiments(self, path: str, root: ElementTree.Element) -> Iterator[Trace]:
        for each in _children(root, "Experiment"):
            references = _sources(each, "References")
            if not references:
                continue
            times = dict(each.attrib)
            for setting in _children(each, "TransientSimulation"):
                times |= setting.attrib
            own = {
                option: number(times[attribute], f"{self.where(path)}, {attribute}")
                for option, attribute in ATTRIBUTES.items()
                if attribute in times
            }
            tolerance = each.get("tolerance")
            yield self._trace(
                each.get("name", path),
                self.path(path, references[0]),
                next((self.path(path, source) for source in _sources(each, "Stimuli")), None),
                own,
                start_values=self._start_values([self.path(path, name) for name in _sources(each, "Parameters")]),
                solver_tolerance=None if tolerance is None else number(tolerance, f"{self.where(path)}, tolerance"),
            )

    def result(self, path: str) -> Trace:
        """The trace of a result without an experiment."""
        inputs = f"{_stem(path)}_in.csv"
        return self._trace(posixpath.basename(_stem(path)), path, inputs if inputs in self.files else None, {})

    def _trace(self, name: str, path: str, inputs: str | None, own: Mapping[str, float], **more: Any) -> Trace:
        reference = read_results(self.text(path), self.where(path), self.not_numeric)
        time, option_path = reference["time"], f"{_stem(path)}_ref.opt"
        options = {
            "StartTime": float(time[0]),
            "StopTime": float(time[-1]),
            "StepSize": self.step or float(np.median(np.diff(time))),
            "RelTol": UNSTATED_TOLERANCE,
            "AbsTol": 0.0,
        }
        if option_path in self.files:
            options |= {"RelTol": 0.0} | read_options(self.text(option_path), self.where(option_path))
        options |= own
        _check_times(options, self.where(path))
        if time[0] < options["StartTime"] or time[-1] > options["StopTime"] + SAME_TIME * options["StepSize"]:
            raise BadFile(
                f"{self.where(path)}, column time: outside of {options['StartTime']} to {options['StopTime']} s"
            )
        if inputs is not None:
            more |= {"inputs_source": self.where(inputs), "inputs": read_table(self.text(inputs), self.where(inputs))}
        return Trace(name, self.where(path), reference, options, **more)

    def _start_values(self, paths: list[str]) -> dict[str, str]:
        """Values by variable of parameter sets (SSV), applied to variables of the same names."""
        return {
            parameter.get("name", ""): value.get("value", "")
            for path in paths
            for parameters in _children(self.xml(path), "Parameters")
            for parameter in _children(parameters, "Parameter")
            for value in list(parameter)[:1]
        }


def _children(parent: ElementTree.Element, name: str) -> list[ElementTree.Element]:
    """Children of a name in any namespace."""
    return [each for each in parent if isinstance(each.tag, str) and each.tag.rpartition("}")[2] == name]


def _sources(parent: ElementTree.Element, name: str) -> list[str]:
    return [each.get("source", "") for each in _children(parent, name)]


def _stem(path: str) -> str:
    return re.sub(r"(_ref|_out)?\.csv$", "", path)
