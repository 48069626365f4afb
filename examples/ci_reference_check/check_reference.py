"""Runs an FMI 2.0 co-simulation FMU over a reference trace. Exit 0: it agrees, 1: it does not, 2: bad usage or files.

    python check_reference.py MODEL.fmu FOLDER/NAME [--set VARIABLE=VALUE ...]

    FOLDER/NAME_in.csv    time and inputs (may be absent when the FMU takes none)
    FOLDER/NAME_ref.csv   time and the outputs that `fmpy.simulate_fmu` must yield
    FOLDER/NAME_ref.opt   StartTime, StopTime, StepSize, RelTol, AbsTol, one `name,value` a line

The form is that of the FMI cross-check. A variable agrees when each of its rows lies within
RelTol · (largest magnitude of its reference) + AbsTol. Needs the Python packages fmpy and numpy only.
"""

from __future__ import annotations

import argparse
import contextlib
import csv
import io
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]
OPTIONS = ("StartTime", "StopTime", "StepSize", "RelTol", "AbsTol")
FMI_TYPES: dict[str, Any] = {"Real": np.float64, "Integer": np.int32, "Enumeration": np.int32, "Boolean": np.bool_}
SAME_TIME = 1e-9  # share of a step: reference and result rows closer than this are the same moment


class BadFile(Exception):
    """One line: where, what, what was expected."""


class RunFailed(Exception):
    """The FMU did not get through the run."""


@dataclass(frozen=True)
class Verdict:
    """Of one variable, in its own unit."""

    variable: str
    deviation: float
    tolerance: float

    @property
    def agrees(self) -> bool:
        return self.deviation <= self.tolerance  # a deviation that is no number agrees with nothing


# --- files -----------------------------------------------------------------------------------------------------------


def read_table(path: Path) -> dict[str, Array]:
    """Columns by name, `time` first and increasing. Raises BadFile."""
    try:
        with path.open(newline="", encoding="utf-8") as file:
            header, *rows = csv.reader(file, skipinitialspace=True)
    except (OSError, ValueError):
        raise BadFile(f"{path}: cannot be read; expected a CSV file with a header") from None
    if header[0] != "time" or len(set(header)) < len(header):
        raise BadFile(f"{path}, header: expected `time` first and no name twice")
    values = np.empty((len(rows), len(header)))
    for k, row in enumerate(rows):
        if len(row) != len(header):
            raise BadFile(f"{path}, line {k + 2}: {len(row)} columns; expected {len(header)}")
        for j, cell in enumerate(row):
            values[k, j] = number(cell, f"{path}, line {k + 2}, column {header[j]}")
    if len(rows) < 2 or not (np.diff(values[:, 0]) > 0).all():
        raise BadFile(f"{path}, column time: expected two rows or more, each later than the one before")
    return {name: values[:, j] for j, name in enumerate(header)}


def read_options(path: Path) -> dict[str, float]:
    """The numbers of NAME_ref.opt; tolerances that are left out are 0. Raises BadFile."""
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, ValueError):
        raise BadFile(f"{path}: cannot be read; expected lines `name,value`: {', '.join(OPTIONS)}") from None
    found = {}
    for line in filter(str.strip, lines):
        name, _, value = (part.strip() for part in line.partition(","))
        if name in OPTIONS:
            found[name] = number(value, f"{path}, {name}")
    missing = [name for name in OPTIONS[:3] if name not in found]
    if missing:
        raise BadFile(f"{path}: {', '.join(missing)} missing; expected lines `name,value`")
    if not found["StopTime"] > found["StartTime"] or not found["StepSize"] > 0.0:
        raise BadFile(f"{path}: expected StopTime after StartTime and StepSize above 0")
    return {"RelTol": 0.0, "AbsTol": 0.0} | found


def number(text: str, where: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = np.nan
    if not np.isfinite(value):
        raise BadFile(f"{where}: {text!r}; expected a finite number")
    return value


def read_model(path: Path) -> Any:
    """fmpy's description of the FMU. Raises BadFile."""
    try:
        model = fmpy.read_model_description(str(path), validate=False)
    except Exception as failed:  # fmpy has no error class of its own
        raise BadFile(f"{path}: {str(failed).splitlines()[0]}; expected an FMU") from None
    if model.fmiVersion != "2.0" or model.coSimulation is None:
        raise BadFile(f"{path}: FMI {model.fmiVersion}; expected an FMU of FMI 2.0 for co-simulation")
    platforms = fmpy.supported_platforms(str(path))
    if fmpy.platform not in platforms:
        raise BadFile(f"{path}: binaries for {', '.join(platforms) or 'no platform'}; expected {fmpy.platform}")
    return model


def expect_variables(model: Any, names: Sequence[str], where: object, causality: str | None = None) -> None:
    """Raises BadFile for a name that the FMU does not have, or has in another role."""
    known = {variable.name: variable for variable in model.modelVariables}
    for name in names:
        if name not in known or known[name].type not in FMI_TYPES:
            raise BadFile(f"{where}: {name} is not a numeric variable of the FMU")
        if causality and known[name].causality != causality:
            raise BadFile(f"{where}: {name} is of causality {known[name].causality}; expected {causality}")


# --- run and comparison ----------------------------------------------------------------------------------------------


def run(path: Path, model: Any, inputs: dict[str, Array] | None, options: dict[str, float], **more: Any) -> Array:
    """What simulate_fmu yields, a structured array. more: output, start_values. Raises RunFailed."""
    messages: list[str] = []

    def log(_environment: Any, _name: bytes, status: int, _category: bytes, text: bytes) -> None:
        if status > 0:
            messages.append(text.decode(errors="replace"))

    signals = None
    if inputs is not None:
        types = {
            variable.name: FMI_TYPES[variable.type] for variable in model.modelVariables if variable.name in inputs
        }
        columns = [("time", np.float64)] + [(name, types[name]) for name in inputs if name != "time"]
        signals = np.zeros(len(inputs["time"]), dtype=columns)
        for name, values in inputs.items():
            signals[name] = values
    try:
        with contextlib.redirect_stdout(io.StringIO()):  # fmpy prints a warning for each input without a column
            result: Array = fmpy.simulate_fmu(
                str(path),
                validate=False,
                fmi_type="CoSimulation",
                start_time=options["StartTime"],
                stop_time=options["StopTime"],
                output_interval=options["StepSize"],
                input=signals,
                logger=log,
                debug_logging=True,
                **more,
            )
    except Exception as failed:  # fmpy has no error class of its own
        raise RunFailed("; ".join([str(failed).splitlines()[0].rstrip("."), *messages])) from None
    return result


def at_times(time: Array, result: Array, name: str) -> Array:
    """A result column at the times of the reference: between rows a Real is a line, anything else holds."""
    values, own = result[name], result["time"]
    if len(own) == len(time) and np.abs(own - time).max() <= SAME_TIME * np.diff(time).min():
        return values.astype(np.float64)
    if values.dtype.kind == "f":
        inside: Array = np.interp(time, own, values)
        return inside
    held: Array = values[np.maximum(np.searchsorted(own, time, side="right") - 1, 0)]
    return held.astype(np.float64)


def compare(reference: dict[str, Array], result: Array, options: dict[str, float]) -> list[Verdict]:
    """A verdict for each column of the reference but `time`."""
    verdicts = []
    for name, expected in reference.items():
        if name != "time":
            deviation = np.abs(at_times(reference["time"], result, name) - expected).max()
            tolerance = options["RelTol"] * np.abs(expected).max() + options["AbsTol"]
            verdicts.append(Verdict(name, float(deviation), float(tolerance)))
    return verdicts


def check(path: Path, trace: str, start_values: dict[str, str]) -> list[Verdict]:
    """The verdicts on an FMU. Raises BadFile, RunFailed."""
    model = read_model(path)
    input_file, reference_file = Path(f"{trace}_in.csv"), Path(f"{trace}_ref.csv")
    options, reference = read_options(Path(f"{trace}_ref.opt")), read_table(reference_file)
    inputs = None
    if input_file.exists() or any(variable.causality == "input" for variable in model.modelVariables):
        inputs = read_table(input_file)
        expect_variables(model, list(inputs)[1:], input_file, "input")
    expect_variables(model, list(reference)[1:], reference_file)
    missing = [v.name for v in model.modelVariables if v.causality == "output" and v.name not in reference]
    if missing:
        raise BadFile(f"{reference_file}: no column {', '.join(missing)}; expected one for each output of the FMU")
    expect_variables(model, list(start_values), "--set")
    output = list(reference)[1:]
    return compare(reference, run(path, model, inputs, options, output=output, start_values=start_values), options)


# --- command ---------------------------------------------------------------------------------------------------------


def print_verdicts(verdicts: Sequence[Verdict]) -> None:
    width = max(len(each.variable) for each in verdicts)
    print(f"{'variable':<{width}}  largest deviation  tolerance  verdict")
    for each in verdicts:
        verdict = "agrees" if each.agrees else "DIFFERS"
        print(f"{each.variable:<{width}}  {each.deviation:17.3e}  {each.tolerance:9.3e}  {verdict}")


def setting(text: str) -> tuple[str, str]:
    name, equals, value = text.rpartition("=")
    if not (name and equals and value):
        raise argparse.ArgumentTypeError(f"{text!r}; expected VARIABLE=VALUE")
    return name, value


def main(arguments: Sequence[str]) -> int:
    parser = argparse.ArgumentParser(description="Compares an FMI 2.0 co-simulation FMU with a reference trace.")
    parser.add_argument("fmu", type=Path, metavar="MODEL.fmu")
    parser.add_argument("trace", metavar="FOLDER/NAME", help="of NAME_in.csv, NAME_ref.csv and NAME_ref.opt")
    parser.add_argument("--set", type=setting, action="append", default=[], metavar="VARIABLE=VALUE", dest="settings")
    options = parser.parse_args(arguments)
    try:
        verdicts = check(options.fmu, options.trace, dict(options.settings))
    except BadFile as bad:
        print(f"check_reference: {bad}", file=sys.stderr)
        return 2
    except RunFailed as failed:
        print(f"check_reference: {options.fmu}: {failed}", file=sys.stderr)
        return 1
    print_verdicts(verdicts)
    differing = sum(not each.agrees for each in verdicts)
    print(f"{options.fmu.name}: {differing} of {len(verdicts)} variables differ from {Path(options.trace).name}")
    return 1 if differing else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
