"""Runs a finger, given as a description or as an FMU, over a recording."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu.errors import InputError
from tendonfmu.files import FORMATS
from tendonfmu.fmu.fmpy_client import Progress, run_fmu
from tendonfmu.recordings import Recording


def check_model(model: Path) -> None:
    """Raises InputError unless the file is there and may be a description or an FMU."""
    if model.suffix.lower() in FORMATS:
        raise InputError(f"{model}: a recording; expected FINGER.json or FINGER.fmu here, and the recording after it")
    if not model.is_file():
        raise InputError(f"{model}: no such file; expected FINGER.json or FINGER.fmu")


def summary(table: Mapping[str, NDArray[Any]]) -> str:
    """The outputs in a line whose figures show a wrong unit: how long, which angles, how much contact."""
    time = table["time"]
    angles = np.concatenate([column for name, column in table.items() if name.startswith("joint_angle[")])
    return (
        f"{len(time)} samples in {time[-1] - time[0]:.6g} s, "
        f"joint angles {angles.min():.3g} to {angles.max():.3g} rad, {int(table['contact'].sum())} samples in contact"
    )


def run_model(
    model: Path, recording: Recording, *, kinematics_source: int = 1, progress: Progress | None = None
) -> dict[str, NDArray[Any]]:
    """Outputs by column, `time` first; a description is packed into a temporary FMU. See `fmu.run_fmu`."""
    check_model(model)
    if model.suffix.lower() != ".json":
        return run_fmu(model, recording, kinematics_source=kinematics_source, progress=progress)
    from tendonfmu.fmu.packaging import build_fmu

    with tempfile.TemporaryDirectory(prefix="tendonfmu-") as folder:
        fmu = Path(folder) / "finger.fmu"
        build_fmu(model, fmu)
        return run_fmu(fmu, recording, kinematics_source=kinematics_source, progress=progress)
