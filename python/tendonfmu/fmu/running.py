"""How a finger, given as a description or as an FMU, is run over a recording."""

from __future__ import annotations

import os
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu import model as models
from tendonfmu.errors import InputError
from tendonfmu.files import FORMATS, counted, path_of
from tendonfmu.fmu.fmpy_client import Progress, run_fmu
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
