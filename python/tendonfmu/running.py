"""Runs a finger, given as a description or as an FMU, over a recording."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from tendonfmu.errors import InputError
from tendonfmu.fmu import Progress, run_fmu
from tendonfmu.recording import Recording


def run_model(
    model: Path, recording: Recording, *, kinematics_source: int = 1, progress: Progress | None = None
) -> dict[str, NDArray[Any]]:
    """Outputs by column, `time` first; a description is packed into a temporary FMU. See `fmu.run_fmu`."""
    if not model.is_file():
        raise InputError(f"{model}: no such file")
    if model.suffix.lower() != ".json":
        return run_fmu(model, recording, kinematics_source=kinematics_source, progress=progress)
    from tendonfmu.packaging import build_fmu

    with tempfile.TemporaryDirectory(prefix="tendonfmu-") as folder:
        fmu = Path(folder) / "finger.fmu"
        build_fmu(model, fmu)
        return run_fmu(fmu, recording, kinematics_source=kinematics_source, progress=progress)
