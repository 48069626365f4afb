"""Runs a co-simulation FMU over reference results. Exit 0: it agrees, 1: it does not, 2: bad usage or files.

    python check_reference.py MODEL.fmu [options]                  # the results that the FMU carries (fmi-ls-ref)
    python check_reference.py MODEL.fmu FOLDER/NAME [options]      # a trace of the FMI cross-check:

    FOLDER/NAME_in.csv    time and inputs (may be absent when the FMU takes none)
    FOLDER/NAME_ref.csv   time and the outputs that `fmpy.simulate_fmu` must yield
    FOLDER/NAME_ref.opt   StartTime, StopTime, StepSize, RelTol, AbsTol, one `name,value` a line

A variable agrees when each of its rows lies within RelTol · (largest magnitude of its reference) + AbsTol. FMI 2.0 and
3.0. Needs the Python packages fmpy and numpy only.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import math
import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

try:
    import fmpy
    import numpy as np
    from numpy.typing import NDArray
except ModuleNotFoundError as missing:
    print(f"check_reference: no {missing.name} in {sys.executable}; expected fmpy and numpy there", file=sys.stderr)
    sys.exit(2)
from reference_files import SAME_TIME, BadFile, Trace, carried_traces, cross_check_trace, expect_whole, number

Array = NDArray[Any]
FMI_TYPES: dict[str, Any] = {
    **{"Real": np.float64, "Integer": np.int32, "Enumeration": np.int32, "Boolean": np.bool_},  # FMI 2.0
    **{f"Float{bits}": np.dtype(f"float{bits}").type for bits in (32, 64)},
    **{f"{sign}Int{bits}": np.dtype(f"{sign.lower()}int{bits}").type for sign in ("", "U") for bits in (8, 16, 32, 64)},
}


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


# --- the FMU ---------------------------------------------------------------------------------------------------------


def read_model(path: Path) -> Any:
    """fmpy's description of the FMU. Raises BadFile."""
    try:
        model = fmpy.read_model_description(str(path), validate=False)
    except Exception as failed:  # fmpy has no error class of its own
        raise BadFile(f"{path}: {str(failed).splitlines()[0]}; expected an FMU") from None
    if model.fmiVersion.split(".")[0] not in ("2", "3") or model.coSimulation is None:
        raise BadFile(f"{path}: FMI {model.fmiVersion}; expected an FMU of FMI 2.0 or 3.0 for co-simulation")
    expect_whole(path)
    platforms = fmpy.supported_platforms(str(path))
    if fmpy.platform not in platforms and fmpy.platform_tuple not in platforms:
        raise BadFile(f"{path}: binaries for {', '.join(platforms) or 'no platform'}; expected {fmpy.platform}")
    return model


def is_numeric(variable: Any) -> bool:
    """A number, or an array of one dimension."""
    return variable.type in FMI_TYPES and len(variable.dimensions) <= 1


def size(variable: Any) -> int:
    return int(np.prod(variable.shape)) if variable.shape else 1


def expect_variables(model: Any, names: Iterable[str], where: object, causality: str | None = None) -> None:
    """Raises BadFile for a name that the FMU does not have, or has in another role."""
    known = {variable.name: variable for variable in model.modelVariables}
    for name in names:
        if name not in known or not is_numeric(known[name]):
            raise BadFile(f"{where}: {name} is not a numeric variable of the FMU")
        if causality and known[name].causality != causality:
            raise BadFile(f"{where}: {name} is of causality {known[name].causality}; expected {causality}")


def expect_values(model: Any, settings: Mapping[str, str]) -> None:
    """Raises BadFile for a value of --set that its variable cannot have."""
    expect_variables(model, settings, "--set")
    types = {variable.name: FMI_TYPES[variable.type] for variable in model.modelVariables if is_numeric(variable)}
    for name, text in settings.items():
        for each in text.split() or [text]:
            value = number(each, f"--set {name}")
            if not issubclass(types[name], np.floating) and not value.is_integer():
                raise BadFile(f"--set {name}: {each!r}; expected a whole number")


def traces_of(path: Path, model: Any, prefix: str | None) -> list[Trace]:
    """What to check: FOLDER/NAME, or what the FMU carries. Raises BadFile."""
    if prefix is not None:
        return [cross_check_trace(prefix, any(each.causality == "input" for each in model.modelVariables))]
    step = model.defaultExperiment.stepSize if model.defaultExperiment else None
    not_numeric = [each.name for each in model.modelVariables if not is_numeric(each)]
    return carried_traces(path, None if step is None else float(step), not_numeric)


def check_names(model: Any, trace: Trace) -> None:
    """Raises BadFile where the FMU lacks a variable of the trace, or a complete trace lacks an output of the FMU."""
    expect_variables(model, columns(trace.inputs or {}), trace.inputs_source, "input")
    expect_variables(model, columns(trace.reference), trace.source)
    sizes = {each.name: size(each) for each in model.modelVariables}
    for where, table in ((trace.inputs_source, trace.inputs or {}), (trace.source, trace.reference)):
        for name in columns(table):
            if table[name][0].size != sizes[name]:
                raise BadFile(f"{where}: {name}: {table[name][0].size} numbers in a cell; expected {sizes[name]}")
    outputs = [each.name for each in model.modelVariables if each.causality == "output"]
    missing = [name for name in outputs if name not in trace.reference]
    if trace.complete and missing:
        raise BadFile(f"{trace.source}: no column {', '.join(missing)}; expected one for each output of the FMU")


def columns(table: Mapping[str, Array]) -> list[str]:
    return [name for name in table if name != "time"]


# --- run and comparison ----------------------------------------------------------------------------------------------


def run(path: Path, model: Any, trace: Trace, start_values: Mapping[str, str]) -> Array:
    """What simulate_fmu yields, a structured array. Raises RunFailed."""
    messages: list[str] = []

    def log(*arguments: Any) -> None:  # FMI 2.0: environment, instance, status, category, text; 3.0 has no instance
        status, _category, text = arguments[-3:]
        if status > 0:
            messages.append(text.decode(errors="replace"))

    try:
        with contextlib.redirect_stdout(io.StringIO()):  # fmpy prints a warning for each input without a column
            result: Array = fmpy.simulate_fmu(
                str(path),
                validate=False,
                fmi_type="CoSimulation",
                start_time=trace.options["StartTime"],
                stop_time=trace.options["StopTime"],
                output_interval=trace.options["StepSize"],
                relative_tolerance=trace.solver_tolerance,
                input=signals(model, trace.inputs),
                output=columns(trace.reference),
                start_values=dict(start_values),
                logger=log,
                debug_logging=True,
            )
    except Exception as failed:  # fmpy has no error class of its own
        raise RunFailed("; ".join([str(failed).splitlines()[0].rstrip("."), *messages])) from None
    return result


def signals(model: Any, inputs: Mapping[str, Array] | None) -> Array | None:
    """The inputs as fmpy takes them."""
    if inputs is None:
        return None
    variables = {each.name: each for each in model.modelVariables}
    types: list[Any] = [("time", np.float64)]
    types += [(name, FMI_TYPES[variables[name].type], inputs[name].shape[1:]) for name in columns(inputs)]
    found = np.zeros(len(inputs["time"]), dtype=types)
    for name, values in inputs.items():
        found[name] = values
    return found


def at_times(time: Array, own: Array, values: Array) -> Array:
    """Results of the times `own` at the times of the reference: between rows a Real is a line, anything else holds."""
    if len(own) == len(time) and np.abs(own - time).max() <= SAME_TIME * np.diff(time).min():
        return values.astype(np.float64)
    if values.dtype.kind == "f":
        inside: Array = np.interp(time, own, values)
        return inside
    nearly = SAME_TIME * np.diff(time).min()
    held: Array = values[np.maximum(np.searchsorted(own, time + nearly, side="right") - 1, 0)]
    return held.astype(np.float64)


def compare(trace: Trace, result: Array) -> list[Verdict]:
    """A verdict for each column of the reference but `time`, of an array for each element."""
    verdicts = []
    for name in columns(trace.reference):
        reference = trace.reference[name].reshape(len(trace.reference["time"]), -1)
        found = result[name].reshape(len(result), -1)
        for i, (expected, values) in enumerate(zip(reference.T, found.T, strict=True), start=1):
            deviation = np.abs(at_times(trace.reference["time"], result["time"], values) - expected).max()
            tolerance = trace.options["RelTol"] * np.abs(expected).max() + trace.options["AbsTol"]
            element = f"{name}[{i}]" if found.shape[1] > 1 else name
            verdicts.append(Verdict(element, float(deviation), float(tolerance)))
    return verdicts


def check(
    path: Path, prefix: str | None, settings: Mapping[str, str], tolerance: float | None
) -> list[tuple[str, list[Verdict]]]:
    """The verdicts on an FMU, by trace. Raises BadFile, RunFailed."""
    model = read_model(path)
    expect_values(model, settings)
    found = []
    for trace in traces_of(path, model, prefix):
        check_names(model, trace)
        if tolerance is not None:
            trace = replace(trace, options={**trace.options, "RelTol": tolerance})
        known = {each.name for each in model.modelVariables}
        start_values = {name: value for name, value in trace.start_values.items() if name in known} | dict(settings)
        found.append((trace.name, compare(trace, run(path, model, trace, start_values))))
    return found


# --- command ---------------------------------------------------------------------------------------------------------


def print_verdicts(verdicts: Sequence[Verdict]) -> None:
    width = max([len(each.variable) for each in verdicts] + [len("variable")])
    print(f"{'variable':<{width}}  largest deviation  tolerance  verdict")
    for each in verdicts:
        verdict = "agrees" if each.agrees else "DIFFERS"
        print(f"{each.variable:<{width}}  {each.deviation:17.3e}  {each.tolerance:9.3e}  {verdict}")


def setting(text: str) -> tuple[str, str]:
    name, equals, value = text.rpartition("=")
    if not (name and equals and value):
        raise argparse.ArgumentTypeError(f"{text!r}; expected VARIABLE=VALUE")
    return name, value


def relative_tolerance(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0.0 <= value < math.inf:
        raise argparse.ArgumentTypeError(f"{text!r}; expected a number, 0 or more")
    return value


def main(arguments: Sequence[str]) -> int:
    parser = argparse.ArgumentParser(description="Compares a co-simulation FMU with reference results.")
    parser.add_argument("fmu", type=Path, metavar="MODEL.fmu")
    parser.add_argument(
        "trace",
        nargs="?",
        metavar="FOLDER/NAME",
        help="of NAME_in.csv, NAME_ref.csv and NAME_ref.opt; without it, the results that the FMU carries",
    )
    parser.add_argument("--set", type=setting, action="append", default=[], metavar="VARIABLE=VALUE", dest="settings")
    parser.add_argument(
        "--tolerance", type=relative_tolerance, metavar="RELTOL", help="in place of the one of the trace"
    )
    options = parser.parse_args(arguments)
    try:
        found = check(options.fmu, options.trace, dict(options.settings), options.tolerance)
    except BadFile as bad:
        print(f"check_reference: {bad}", file=sys.stderr)
        return 2
    except RunFailed as failed:
        print(f"check_reference: {options.fmu}: {failed}", file=sys.stderr)
        return 1
    differing = 0
    for name, verdicts in found:
        print_verdicts(verdicts)
        count = sum(not each.agrees for each in verdicts)
        print(f"{options.fmu.name}: {count} of {len(verdicts)} variables differ from {name}")
        differing += count
    return 1 if differing else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
