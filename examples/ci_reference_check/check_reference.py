"""Runs a co-simulation FMU over reference results. Exit 0: it agrees, 1: it does not, 2: bad usage or files.

    python check_reference.py MODEL.fmu [options]                  # the results that the FMU carries (fmi-ls-ref)
    python check_reference.py MODEL.fmu FOLDER/NAME [options]      # a trace of the FMI cross-check:

    NAME_in.csv    time and inputs (may be absent when the FMU takes none)
    NAME_ref.csv   time and the outputs that `fmpy.simulate_fmu` must yield
    NAME_ref.opt   StartTime, StopTime, StepSize, RelTol, AbsTol, one `name,value` a line; in the FMU it may be absent

A variable agrees when each of its rows lies within RelTol · (largest magnitude of its reference) + AbsTol. FMI 2.0 and
3.0. Needs the Python packages fmpy and numpy only.
"""

from __future__ import annotations

import argparse
import contextlib
import csv
import io
import sys
import zipfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

try:
    import fmpy
    import numpy as np
    from numpy.typing import NDArray
except ModuleNotFoundError as missing:
    print(f"check_reference: no {missing.name} in {sys.executable}; expected fmpy and numpy there", file=sys.stderr)
    sys.exit(2)

Array = NDArray[Any]
Table = Mapping[str, Array]  # columns by name, `time` first: [N], or [N, k] of arrays of FMI 3.0
TIMES = ("StartTime", "StopTime", "StepSize")
FOLDER = "extra/org.fmi-standard.fmi-ls-ref/"
UNSTATED_TOLERANCE = 1e-3  # of results that an FMU carries without one: they mostly stem from another importer
FMI_TYPES: dict[str, Any] = {
    **{"Real": np.float64, "Integer": np.int32, "Enumeration": np.int32, "Boolean": np.bool_},  # FMI 2.0
    **{f"Float{bits}": np.dtype(f"float{bits}").type for bits in (32, 64)},
    **{f"{sign}Int{bits}": np.dtype(f"{sign.lower()}int{bits}").type for sign in ("", "U") for bits in (8, 16, 32, 64)},
}


class BadFile(Exception):
    """One line: where, what, what was expected."""


@dataclass(frozen=True)
class Trace:
    """What a run of an FMU must yield; `source` is its file in messages."""

    name: str
    source: str
    inputs: Table | None
    reference: Table
    options: Mapping[str, float]  # TIMES, RelTol, AbsTol


# --- files -----------------------------------------------------------------------------------------------------------


def number(text: str, where: str) -> float:
    """A finite number; true and false are 1 and 0. Raises BadFile."""
    try:
        value = float({"true": "1", "false": "0"}.get(text, text))
    except ValueError:
        value = np.nan
    if not np.isfinite(value):
        raise BadFile(f"{where}: {text!r}; expected a finite number")
    return value


def read_table(text: str, where: str) -> Table:
    """Columns by name; of rows with the same time, as at an event, the last one. Raises BadFile."""
    header, *rows = csv.reader(io.StringIO(text), skipinitialspace=True) if text.strip() else [[""]]
    if header[0] != "time" or len(set(header)) < len(header) or any(len(row) != len(header) for row in rows):
        raise BadFile(f"{where}: expected `time` first, no name twice, and rows as long as the header")
    found = {}
    for column, name in enumerate(header):
        cells = [
            [number(text, f"{where}, line {k}, column {name}") for text in row[column].split() or [""]]
            for k, row in enumerate(rows, start=2)
        ]
        if len({len(cell) for cell in cells}) > 1:
            raise BadFile(f"{where}, column {name}: expected as many numbers in each row")
        found[name] = np.array(cells)[:, 0] if cells and len(cells[0]) == 1 else np.array(cells)
    time = found["time"]
    if len(rows) < 2 or time.ndim != 1 or (np.diff(time) < 0).any() or time[0] == time[-1]:
        raise BadFile(f"{where}, column time: expected two rows or more, none earlier than the one before")
    return {name: values[np.append(np.diff(time) > 0, True)] for name, values in found.items()}


def read_options(text: str, where: str) -> dict[str, float]:
    """The numbers of NAME_ref.opt. Raises BadFile."""
    pairs = [[part.strip() for part in line.split(",", 1)] for line in text.splitlines() if "," in line]
    options = {name: number(value, f"{where}, {name}") for name, value in pairs if name in (*TIMES, "RelTol", "AbsTol")}
    if gone := [name for name in TIMES if name not in options]:
        raise BadFile(f"{where}: {', '.join(gone)} missing; expected lines `name,value`")
    if not options["StopTime"] > options["StartTime"] or not options["StepSize"] > 0.0:
        raise BadFile(f"{where}: expected StopTime after StartTime and StepSize above 0")
    return {"RelTol": 0.0, "AbsTol": 0.0} | options


def trace_of(texts: Mapping[str, str], name: str, model: Any, where: str) -> Trace:
    """The trace NAME of texts by file. Raises BadFile."""
    result = next((each for each in (f"{name}_ref.csv", f"{name}_out.csv") if each in texts), None)
    if result is None:
        raise BadFile(f"{where}{name}_ref.csv: cannot be read; expected a CSV file with a header")
    reference = read_table(texts[result], f"{where}{result}")
    inputs, options = f"{name}_in.csv", f"{name}_ref.opt"
    if inputs not in texts and any(each.causality == "input" for each in model.modelVariables):
        raise BadFile(f"{where}{inputs}: cannot be read; expected the inputs of the FMU")
    step = model.defaultExperiment and model.defaultExperiment.stepSize
    usual = {"StartTime": reference["time"][0], "StopTime": reference["time"][-1], "RelTol": UNSTATED_TOLERANCE}
    usual |= {"StepSize": float(step or np.median(np.diff(reference["time"]))), "AbsTol": 0.0}
    return Trace(
        name,
        f"{where}{result}",
        read_table(texts[inputs], f"{where}{inputs}") if inputs in texts else None,
        reference,
        read_options(texts[options], f"{where}{options}") if options in texts else usual,
    )


def carried_traces(fmu: Path, model: Any) -> list[Trace]:
    """The traces in an FMU. Raises BadFile."""
    with zipfile.ZipFile(fmu) as archive:
        members = [name for name in archive.namelist() if name.startswith(FOLDER) and name.endswith((".csv", ".opt"))]
        texts = {name.removeprefix(FOLDER): archive.read(name).decode("utf-8-sig", "replace") for name in members}
    results = [file for file in texts if file.endswith(("_ref.csv", "_out.csv"))]
    if not results:
        raise BadFile(f"{fmu}: no {FOLDER}NAME_ref.csv in it; expected reference results there, or FOLDER/NAME")
    return [trace_of(texts, file.rpartition("_")[0], model, f"{fmu}: {FOLDER}") for file in sorted(results)]


def cross_check_trace(prefix: Path, model: Any) -> Trace:
    """The trace FOLDER/NAME, which must have every output of the FMU. Raises BadFile."""
    files = [prefix.with_name(f"{prefix.name}_{end}") for end in ("in.csv", "ref.csv", "ref.opt")]
    if not files[2].is_file():
        raise BadFile(f"{files[2]}: cannot be read; expected lines `name,value`")
    texts = {file.name: file.read_text(encoding="utf-8", errors="replace") for file in files if file.is_file()}
    trace = trace_of(texts, prefix.name, model, f"{prefix.parent}/")
    outputs = [each.name for each in model.modelVariables if each.causality == "output"]
    if gone := [name for name in outputs if name not in trace.reference]:
        raise BadFile(f"{trace.source}: no column {', '.join(gone)}; expected one for each output of the FMU")
    return trace


# --- the FMU ---------------------------------------------------------------------------------------------------------


def read_model(path: Path) -> Any:
    """fmpy's description of the FMU. Raises BadFile."""
    try:
        model = fmpy.read_model_description(str(path), validate=False)
        with zipfile.ZipFile(path) as archive:
            damaged = archive.testzip()
    except Exception as failed:  # fmpy has no error class of its own
        raise BadFile(f"{path}: {str(failed).splitlines()[0]}; expected an FMU") from None
    if damaged:
        raise BadFile(f"{path}: {damaged}: damaged (its checksum in the archive differs); expected it whole")
    if model.fmiVersion.split(".")[0] not in ("2", "3") or model.coSimulation is None:
        raise BadFile(f"{path}: FMI {model.fmiVersion}; expected an FMU of FMI 2.0 or 3.0 for co-simulation")
    platforms = fmpy.supported_platforms(str(path))
    if fmpy.platform not in platforms and fmpy.platform_tuple not in platforms:
        raise BadFile(f"{path}: binaries for {', '.join(platforms) or 'no platform'}; expected {fmpy.platform}")
    return model


def expect_variables(model: Any, names: Iterable[str], where: str) -> None:
    """Raises BadFile for a name that is no number or array of one dimension of the FMU."""
    known = {each.name for each in model.modelVariables if each.type in FMI_TYPES and len(each.dimensions) <= 1}
    if gone := [name for name in names if name not in known]:
        raise BadFile(f"{where}: {', '.join(gone)}: not a numeric variable of the FMU")


def columns(table: Table | None) -> list[str]:
    return [name for name in table or () if name != "time"]


def run(path: Path, model: Any, trace: Trace, start_values: Mapping[str, str]) -> Array:
    """What simulate_fmu yields over a trace, a structured array. Raises BadFile, or what fmpy raises."""
    expect_variables(model, [*columns(trace.inputs), *columns(trace.reference)], trace.source)
    signals = None
    if trace.inputs is not None:
        kinds = {each.name: FMI_TYPES.get(each.type) for each in model.modelVariables} | {"time": np.float64}
        types = [(name, kinds[name], values.shape[1:]) for name, values in trace.inputs.items()]
        signals = np.zeros(len(trace.inputs["time"]), dtype=types)
        for name, values in trace.inputs.items():
            signals[name] = values
    with contextlib.redirect_stdout(io.StringIO()):  # fmpy prints a warning for each input without a column
        result: Array = fmpy.simulate_fmu(
            str(path),
            validate=False,
            fmi_type="CoSimulation",
            start_time=trace.options["StartTime"],
            stop_time=trace.options["StopTime"],
            output_interval=trace.options["StepSize"],
            input=signals,
            output=columns(trace.reference),
            start_values=dict(start_values),
        )
    return result


# --- comparison ------------------------------------------------------------------------------------------------------


def compare(trace: Trace, result: Array, tolerance: float | None) -> Iterator[tuple[str, float, float]]:
    """Variable, largest deviation and tolerance of each column of the reference, of an array for each element."""
    time, relative = trace.reference["time"], trace.options["RelTol"] if tolerance is None else tolerance
    for name in columns(trace.reference):
        reference, found = (table[name].reshape(len(table[name]), -1) for table in (trace.reference, result))
        for i, (expected, values) in enumerate(zip(reference.T, found.T, strict=True), start=1):
            nearly = 1e-9 * np.diff(time).min()
            held = np.maximum(np.searchsorted(result["time"], time + nearly, side="right") - 1, 0)
            same = np.abs(result["time"][held] - time) <= nearly
            lines = values.dtype.kind == "f"  # between rows a Real is a line, anything else holds
            at = np.where(same | (not lines), values[held], np.interp(time, result["time"], values))
            allowed = relative * np.abs(expected).max() + trace.options["AbsTol"]
            element = f"{name}[{i}]" if found.shape[1] > 1 else name
            yield element, float(np.abs(at.astype(np.float64) - expected).max()), float(allowed)


def print_verdicts(verdicts: Sequence[tuple[str, float, float]]) -> int:
    """Print a line for each variable; return how many differ."""
    width = max(len(name) for name in ["variable", *(name for name, _, _ in verdicts)])
    print(f"{'variable':<{width}}  largest deviation  tolerance  verdict")
    differing = 0
    for name, deviation, tolerance in verdicts:
        agrees = deviation <= tolerance  # a deviation that is no number agrees with nothing
        print(f"{name:<{width}}  {deviation:17.3e}  {tolerance:9.3e}  {'agrees' if agrees else 'DIFFERS'}")
        differing += not agrees
    return differing


def check(fmu: Path, trace: Path | None, settings: Mapping[str, str], tolerance: float | None) -> int:
    """Compare and print; return how many variables differ. Raises BadFile, or what fmpy raises."""
    model = read_model(fmu)
    expect_variables(model, settings, "--set")
    differing = 0
    for each in carried_traces(fmu, model) if trace is None else [cross_check_trace(trace, model)]:
        verdicts = list(compare(each, run(fmu, model, each, settings), tolerance))
        count = print_verdicts(verdicts)
        print(f"{fmu.name}: {count} of {len(verdicts)} variables differ from {each.name}")
        differing += count
    return differing


def setting(text: str) -> tuple[str, str]:
    name, equals, value = text.rpartition("=")
    if not (name and equals) or not np.isfinite(float(value)):
        raise ValueError(text)
    return name, value


def main(arguments: Sequence[str]) -> int:
    parser = argparse.ArgumentParser(description="Compares a co-simulation FMU with reference results.")
    parser.add_argument("fmu", type=Path, metavar="MODEL.fmu")
    words = "of NAME_in.csv, NAME_ref.csv and NAME_ref.opt; without it, the results that the FMU carries"
    parser.add_argument("trace", nargs="?", type=Path, metavar="FOLDER/NAME", help=words)
    parser.add_argument("--set", type=setting, action="append", default=[], metavar="VARIABLE=VALUE", dest="settings")
    parser.add_argument("--tolerance", type=float, metavar="RELTOL", help="in place of the one of the trace")
    options = parser.parse_args(arguments)
    try:
        return int(check(options.fmu, options.trace, dict(options.settings), options.tolerance) > 0)
    except BadFile as bad:
        print(f"check_reference: {bad}", file=sys.stderr)
        return 2
    except Exception as failed:  # of the run: fmpy has no error class of its own
        print(f"check_reference: {options.fmu}: {str(failed).splitlines()[0]}", file=sys.stderr)
        return 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
