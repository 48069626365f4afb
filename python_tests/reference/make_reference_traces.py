"""Writes the reference traces of three fingers in the form of the FMI cross-check, by the oracle.

    python make_reference_traces.py        (needs numpy only)

NAME_in.csv    inputs, one sample a row, 1/128 s apart (exact in binary, so every client sees the same times)
NAME_ref.csv   what `fmpy.simulate_fmu` yields with an output at each communication point: fmpy records after
               fmi2DoStep(t_{k-1}, h) under the time t_k, and initialisation takes the first sample, so row t_0
               carries the first sample and row t_k the sample at t_{k-1}
NAME_ref.opt   StartTime, StopTime, StepSize (s), RelTol, AbsTol
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "support"))

import agreement  # noqa: E402
import oracle  # noqa: E402
import random_fingers  # noqa: E402

Array = NDArray[Any]

STEP = 1.0 / 128.0
LARGEST_FILE = 300_000  # bytes; the cross-check allows 1 MB
INPUTS = {"tendon_force": 6, "tendon_position": 9}  # name: decimals kept, as a sensor of 1 µN and 1 nm gives them
OUTPUTS = (*agreement.REAL_OUTPUTS, *agreement.BOOLEAN_OUTPUTS, *agreement.DETECTION_OUTPUTS[:3])  # of the FMU

# name: (description, seed of the motion, samples); 2 s in which every branch of the finger's model is taken
TRACES = {
    "index_finger": (HERE.parents[1] / "examples" / "fingers" / "index_finger.json", 28, 256),
    "asymmetric_pair": (HERE / "asymmetric_pair.json", 37, 256),
    "cable_loop": (HERE / "cable_loop.json", 114, 256),
}


def read_description(name: str) -> dict[str, Any]:
    description: dict[str, Any] = json.loads(TRACES[name][0].read_text(encoding="utf-8"))
    return description


def columns(name: str, values: Array) -> dict[str, Array]:
    """One column per variable of the FMU: name[1], name[2], ...; scalars keep their name."""
    if values.ndim == 1:
        return {name: values}
    return {f"{name}[{i + 1}]": values[:, i] for i in range(values.shape[1])}


def reported_by_fmpy(outputs: dict[str, Array]) -> dict[str, Array]:
    """Row t_0 the first sample, row t_k the sample at t_{k-1}; the last sample is not reported."""
    samples = len(outputs["contact"])
    rows = np.maximum(np.arange(samples) - 1, 0)
    return {name: values[rows] for name, values in outputs.items()}


def make_inputs(name: str) -> dict[str, Array]:
    """The recording of a trace: every input rounded to what its sensor resolves."""
    _, seed, samples = TRACES[name]
    time = np.arange(samples) * STEP
    recording = random_fingers.random_recording(read_description(name), seed, time=time)
    rounded = {each: np.round(recording[each], decimals) for each, decimals in INPUTS.items()}
    return {"time": time} | rounded


def csv_text(table: dict[str, Array]) -> str:
    """Quoted names, full-precision numbers, Booleans as 0 and 1."""

    def cell(value: Any) -> str:
        return str(int(value)) if isinstance(value, (bool, np.bool_)) else repr(float(value))

    lines = [",".join(f'"{name}"' for name in table)]
    lines += [",".join(cell(value) for value in row) for row in zip(*table.values(), strict=True)]
    return "\n".join(lines) + "\n"


def make_trace(name: str) -> dict[str, str]:
    """The three files of one finger: name -> text."""
    recording = make_inputs(name)
    result = oracle.run(read_description(name), recording, 1)
    if result.near.any():
        raise RuntimeError(f"{name}: samples {np.flatnonzero(result.near)} lie near a threshold, choose another seed")
    inputs, reference = {"time": recording["time"]}, {"time": recording["time"]}
    for each in INPUTS:
        inputs |= columns(each, recording[each])
    reported = reported_by_fmpy(result.outputs)
    for each in OUTPUTS:
        reference |= columns(each, reported[each])
    options = {
        "StartTime": 0.0,
        "StopTime": float(recording["time"][-1]),
        "StepSize": STEP,
        "RelTol": agreement.RELATIVE,
        "AbsTol": agreement.ABSOLUTE,
    }
    files = {
        f"{name}_in.csv": csv_text(inputs),
        f"{name}_ref.csv": csv_text(reference),
        f"{name}_ref.opt": "".join(f"{option},{value!r}\n" for option, value in options.items()),
    }
    for file, text in files.items():
        if len(text) > LARGEST_FILE:
            raise RuntimeError(f"{file}: {len(text)} bytes, expected at most {LARGEST_FILE}")
    return files


def main() -> None:
    for name in TRACES:
        for file, text in make_trace(name).items():
            unfinished = HERE / f"{file}.part"
            unfinished.write_text(text, encoding="utf-8")
            unfinished.replace(HERE / file)


if __name__ == "__main__":
    main()
