"""How a finger, given as a description or as an FMU, is run over a recording, and such a run as reference results.

By FMI's layered standard for related files (fmi-ls-ref) the folder FOLDER of an FMU contains a manifest, an experiment
(format ma-hs-experiments) with the files that it names, and the options of the FMI cross-check, which alone has a place
for the tolerance of a comparison:

    fmi-ls-manifest.xml     lists the other files with their roles
    NAME.exp                start, stop, step; names NAME_in.csv and NAME_ref.csv
    NAME_in.csv             time and inputs
    NAME_ref.csv            time and all outputs
    NAME_ref.opt            StartTime, StopTime, StepSize, RelTol, AbsTol
"""

from __future__ import annotations

import os
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from lxml import etree
from numpy.typing import NDArray

from tendonfmu import model as models
from tendonfmu.errors import InputError
from tendonfmu.files import FORMATS, counted, path_of
from tendonfmu.fmu.fmpy_client import Progress, run_fmu
from tendonfmu.fmu.packaging import Related, model_identifier
from tendonfmu.model import Finger, inputs_used
from tendonfmu.recordings import Recording

Outputs = dict[str, NDArray[Any]]


def check_model(model: Path) -> None:
    """Check that a file exists and may be a description or an FMU."""
    if model.suffix.lower() in FORMATS:
        raise InputError(f"{model}: a recording; expected FINGER.json or FINGER.fmu here, and the recording after it")
    if not model.is_file():
        raise InputError(f"{model}: no such file; expected FINGER.json or FINGER.fmu")


def finger_of(model: Path) -> models.Finger | None:
    """Return the description of a model."""
    if model.suffix.lower() == ".json":
        return models.read_finger(model)
    try:
        with zipfile.ZipFile(model) as archive:
            text = archive.read("resources/finger.json")
    except KeyError:
        return None
    except (OSError, zipfile.BadZipFile) as wrong:
        raise InputError(f"{model}: not an FMU ({wrong}); expected FINGER.json or FINGER.fmu") from None
    return models.finger_from_text(model, text)


def columns_of(outputs: Mapping[str, NDArray[Any]]) -> Outputs:
    """Return outputs as columns of a table."""
    # outputs: [N]; returns columns [N], such as `joint_torque[2]`, in the same order
    columns: Outputs = {}
    for name, values in outputs.items():
        if values.ndim == 1:
            columns[name] = values
        else:
            columns |= {f"{name}[{i + 1}]": values[:, i] for i in range(values.shape[1])}
    return columns


def outputs_of(columns: Mapping[str, NDArray[Any]]) -> Outputs:
    """Join the columns name[1], name[2], ... to [N, k]; columns without an index stay as they are."""
    # columns: [N]; returns outputs by name, [N] or [N, k]
    groups: dict[str, list[NDArray[Any]]] = {}
    for name, column in columns.items():
        groups.setdefault(name.partition("[")[0], []).append(column)
    return {name: parts[0] if name in columns else np.column_stack(parts) for name, parts in groups.items()}


def summary(outputs: Mapping[str, NDArray[Any]]) -> str:
    """Describe the outputs in a line whose figures reveal a wrong unit."""
    time, angles = outputs["time"], outputs["joint_angle"]
    return (
        f"{counted(len(time), 'sample')} in {time[-1] - time[0]:.6g} s, "
        f"joint angles {angles.min():.3g} to {angles.max():.3g} rad, "
        f"{counted(int(outputs['contact'].sum()), 'sample')} in contact"
    )


def run_model(
    model: models.FingerSource, recording: Recording, *, kinematics_source: int = 1, progress: Progress | None = None
) -> Outputs:
    """Run a finger or an FMU over a recording."""
    # returns `time` [N], then the FMU's outputs by name, [N] or [N, k]
    if isinstance(model, str | os.PathLike):
        file = path_of(model)
        check_model(file)
        if file.suffix.lower() != ".json":
            columns = run_fmu(file, recording, kinematics_source=kinematics_source, progress=progress)
            return outputs_of(columns)
    outputs = _run_native(models.read_finger(model), recording, kinematics_source)
    if progress is not None:
        progress(len(recording))
    return outputs


def _run_native(finger: models.Finger, recording: Recording, source: int) -> Outputs:
    """Run a finger in the C library. Raises InputError."""
    if source not in (1, 2, 3):
        raise InputError(f"kinematics = {source!r}: expected 1, 2 or 3")
    recording.require(finger.joints, finger.tendons, models.inputs_used(source, models.watches_motors(finger.data)))
    with models.native.refusals_of(recording.path):
        results = models.native.Instance(finger.image, source).run(recording.arrays())
    names = (*models.NUMBERS, *models.OPTIONAL_NUMBERS, *models.FLAGS, *models.PLACE, *models.SENSORS)
    outputs = {name: results[name] for name in names if name in results}
    return {"time": recording.time, **outputs}


# --- reference results inside an FMU ----------------------------------------------------------------------------------


FOLDER = "extra/org.fmi-standard.fmi-ls-ref"
NOTE = "documentation/fmi-ls-ref.txt"
EXPERIMENTS = "application/x-ma-hs-experiments"
DESCRIPTIONS = {
    ".exp": "The run that gave the reference results",
    "_in.csv": "Inputs of the reference results",
    "_ref.csv": "Reference results: all outputs",
    "_ref.opt": "Step and tolerance of the comparison, in the form of the FMI cross-check",
}
VERSION = "1.0.0-beta.1"  # of fmi-ls-ref

# The agreement that the semantics ask of two implementations (docs/reference/semantics/README.md).
RELATIVE, ABSOLUTE = 1e-9, 1e-12
UNEVEN = 1e-6  # share of a step by which a sample may be off the grid before it is interpolated
GAP = 1.5  # median steps; in a longer step samples were lost
DIGITS = 12  # of the step: 0.002 s rather than 0.0020000000000000005 s

_TIMES = {"start": "Time", "stop": "Time", "step": "Size"}  # how FMI names them: startTime, stopTime, stepSize
_SPACE = "http://fmi-standard.org/fmi-ls-manifest"
_ROOT_ATTRIBUTES = {
    "fmi-ls-name": "org.fmi-standard.fmi-ls-ref",
    "fmi-ls-version": VERSION,
    "fmi-ls-description": "Layered Standard providing information on related files included in an FMU.",
}

Table = dict[str, NDArray[Any]]


@dataclass(frozen=True)
class ReferenceRun:
    """The run of a finger over a recording, as an FMU carries it."""

    files: list[Related]  # experiment, inputs, outputs and options
    experiment: dict[str, float]  # `start`, `stop` and `step` (s), for the DefaultExperiment of the FMU


def reference_run(finger: Finger, recording: Recording, *, arrays: bool = False, at_end: bool = False) -> ReferenceRun:
    """Run a finger over a recording; inputs, outputs and tolerance become files."""
    # arrays: as FMI 3.0 has them, the elements of a signal in one column; at_end: a step takes the sample at its end
    grid, step = _on_grid(finger, recording)
    # A client sets the inputs of t, calls fmi2DoStep(t, h) and reads under the time t + h. What it reads belongs to the
    # sample at t; or these inputs are the sample at t + h. The first sample is taken by the initialisation.
    rows = np.maximum(np.arange(len(grid)) - 1, 0)
    if at_end:
        held = Recording(grid.path, grid.time, {name: values[rows] for name, values in grid.groups.items()})
        reference = run_model(finger, held)
    else:
        outputs = run_model(finger, grid)
        reference = {name: values if name == "time" else values[rows] for name, values in outputs.items()}
    name = model_identifier(finger.name)
    experiment = {"start": 0.0, "stop": float(grid.time[-1]), "step": step}
    inputs: Table = {"time": grid.time, **grid.groups}
    of_end = "; a step takes the sample at its end" * at_end
    made = (
        (".exp", _experiments(name, experiment, recording.path.name), "experiment/smoke-test", EXPERIMENTS),
        ("_in.csv", _csv(inputs if arrays else columns_of(inputs)), "testcase", "text/csv"),
        ("_ref.csv", _csv(reference if arrays else columns_of(reference)), "result", "text/csv"),
        ("_ref.opt", _options(experiment), "configuration", "text/csv"),
    )
    files = [
        Related(f"{name}{end}", content, role, kind, DESCRIPTIONS[end] + of_end * (role == "result"))
        for end, content, role, kind in made
    ]
    return ReferenceRun(files, experiment)


def bridged_rows(recording: Recording) -> tuple[int, int]:
    """Count the rows that `reference_run` interpolates over gaps."""
    steps = np.diff(recording.time)
    median = float(np.median(steps))
    lost = np.rint(steps[steps > GAP * median] / median) - 1
    return int(steps.sum() / median + UNEVEN) + 1, int(lost.sum())


def related_members(related: Sequence[Related]) -> dict[str, bytes]:
    """Return the members of an FMU for related files."""
    if not related:
        return {}
    files = {f"{FOLDER}/{file.name}": file.content for file in related}
    return files | {f"{FOLDER}/fmi-ls-manifest.xml": _manifest(related), NOTE: _note(related).encode()}


# --- signals ----------------------------------------------------------------------------------------------------------


def _on_grid(finger: Finger, recording: Recording) -> tuple[Recording, float]:
    """Return the inputs of the default kinematics at 0, h, 2 h, ..., and h (s)."""
    used = inputs_used(1, False)
    recording.require(finger.joints, finger.tendons, used)
    if len(recording) < 2:
        raise InputError(f"{recording.path}: one sample; expected two or more as a reference")
    time = recording.time - recording.time[0]
    step = float(f"{time[-1] / (len(time) - 1):.{DIGITS}g}")
    groups = {name: recording.groups[name] for name in used}
    if np.abs(time - step * np.arange(len(time))).max() > UNEVEN * step:
        step = float(f"{np.median(np.diff(time)):.{DIGITS}g}")
        grid = step * np.arange(int(time[-1] / step + UNEVEN) + 1)
        groups = {
            name: np.column_stack([np.interp(grid, time, column) for column in signals.T])
            for name, signals in groups.items()
        }
    # the products that clients compute: what they set is then a sample, not something between two
    times = step * np.arange(len(groups["tendon_force"]), dtype=np.float64)
    return Recording(recording.path, times, groups), step


# --- files ------------------------------------------------------------------------------------------------------------


def _csv(table: Mapping[str, NDArray[Any]]) -> bytes:
    """Return a table as CSV by the rules of fmi-standard.org; of a column [N, k], each cell has k numbers."""
    columns = [map(_cell, values.tolist()) for values in table.values()]
    rows = (",".join(row) + "\n" for row in zip(*columns, strict=True))
    return "".join([",".join(f'"{name}"' for name in table) + "\n", *rows]).encode()


def _cell(value: Any) -> str:
    """Return a number, flag or list of these as text that reads back the same."""
    if isinstance(value, list):
        return " ".join(map(_cell, value))
    return repr(int(value) if isinstance(value, bool) else value)


def _options(experiment: Mapping[str, float]) -> bytes:
    times = {f"{name.capitalize()}{of}": experiment[name] for name, of in _TIMES.items()}
    values = {**times, "RelTol": RELATIVE, "AbsTol": ABSOLUTE}
    return "".join(f"{name},{value!r}\n" for name, value in values.items()).encode()


def _experiments(name: str, experiment: Mapping[str, float], source: str) -> bytes:
    root = etree.Element("Experiments", name=f"{name}: reference results")
    element = etree.SubElement(
        root,
        "Experiment",
        name=name,
        description=f"All outputs over {source}",
        **{f"{time}{of}": repr(experiment[time]) for time, of in _TIMES.items()},
        tolerance=repr(RELATIVE),
    )
    etree.SubElement(element, "Stimuli", source=f"{name}_in.csv", type="text/csv")
    etree.SubElement(element, "References", source=f"{name}_ref.csv", type="text/csv")
    return _xml(root)


def _manifest(related: Sequence[Related]) -> bytes:
    attributes = {f"{{{_SPACE}}}{name}": value for name, value in _ROOT_ATTRIBUTES.items()}
    root = etree.Element("fmiReferences", attributes, nsmap={"fmi-ls": _SPACE})
    for file in related:
        etree.SubElement(
            root,
            "Related",
            type=file.kind,
            source=file.name,
            role=file.role,
            description=file.description,
        )
    return _xml(root)


def _xml(root: Any) -> bytes:
    return bytes(etree.tostring(root, xml_declaration=True, encoding="UTF-8", pretty_print=True))


def _note(related: Sequence[Related]) -> str:
    files = "".join(f"  {file.name}: {file.description}\n" for file in related)
    rows = (
        "The rows of the results are those of a client that calls fmi2DoStep(t, h), reads the outputs, and writes\n"
        "them under the time t + h: the outputs belong to the inputs of t. Those of the first inputs are in the first\n"
        "two rows.\n"
        "An output agrees if |result - reference| <= RelTol * max |reference| + AbsTol in every row.\n"
    )
    return f"Files in {FOLDER}:\n\n{files}\n" + (rows if any(file.role == "result" for file in related) else "")
