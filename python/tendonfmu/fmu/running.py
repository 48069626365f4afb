"""How a finger, given as a description or as an FMU, is run over a recording."""

from __future__ import annotations

import tempfile
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu.errors import InputError
from tendonfmu.files import FORMATS
from tendonfmu.fmu.fmpy_client import Progress, run_fmu
from tendonfmu.model import FingerDescription, finger_from_text, read_finger
from tendonfmu.recordings import Recording


def check_model(model: Path) -> None:
    """Check that a file exists and may be a description or an FMU.

    Parameters
    ----------
    model
        FINGER.json or FINGER.fmu.

    Raises
    ------
    InputError
        The file is missing, or is a recording.
    """
    if model.suffix.lower() in FORMATS:
        raise InputError(f"{model}: a recording; expected FINGER.json or FINGER.fmu here, and the recording after it")
    if not model.is_file():
        raise InputError(f"{model}: no such file; expected FINGER.json or FINGER.fmu")


def finger_of(model: Path) -> FingerDescription | None:
    """Return the description of a model.

    Parameters
    ----------
    model
        FINGER.json, or FINGER.fmu, which contains the description.

    Returns
    -------
    FingerDescription or None
        None for an FMU without a description.

    Raises
    ------
    InputError
        The description is refused.
    """
    if model.suffix.lower() == ".json":
        return read_finger(model)
    try:
        with zipfile.ZipFile(model) as archive:
            text = archive.read("resources/finger.json")
    except KeyError:
        return None
    except (OSError, zipfile.BadZipFile) as wrong:
        raise InputError(f"{model}: cannot be read ({wrong}); expected an FMU") from None
    return finger_from_text(model, text)


def summary(table: Mapping[str, NDArray[Any]]) -> str:
    """Describe the outputs in a line whose figures reveal a wrong unit.

    Parameters
    ----------
    table
        Outputs by column, from `run_model`.

    Returns
    -------
    str
        Number of samples, duration, range of the joint angles, and samples in contact.
    """
    time = table["time"]
    angles = np.concatenate([column for name, column in table.items() if name.startswith("joint_angle[")])
    return (
        f"{len(time)} samples in {time[-1] - time[0]:.6g} s, "
        f"joint angles {angles.min():.3g} to {angles.max():.3g} rad, {int(table['contact'].sum())} samples in contact"
    )


def run_model(
    model: Path, recording: Recording, *, kinematics_source: int = 1, progress: Progress | None = None
) -> dict[str, NDArray[Any]]:
    """Run a description or an FMU over a recording.

    A description is packaged into a temporary FMU.

    Parameters
    ----------
    model
        FINGER.json or FINGER.fmu.
    recording
        Signals of the same finger.
    kinematics_source
        1, 2 or 3.
    progress
        Called with the number of samples done.

    Returns
    -------
    dict of arrays
        Outputs by column [N], `time` first. See `run_fmu`.

    Raises
    ------
    InputError
        As `check_model` and `run_fmu`; or the description is refused.
    """
    check_model(model)
    if model.suffix.lower() != ".json":
        return run_fmu(model, recording, kinematics_source=kinematics_source, progress=progress)
    from tendonfmu.fmu.packaging import build_fmu

    with tempfile.TemporaryDirectory(prefix="tendonfmu-") as folder:
        fmu = Path(folder) / "finger.fmu"
        build_fmu(model, fmu, illustrated=False)  # nobody sees its pictures
        return run_fmu(fmu, recording, kinematics_source=kinematics_source, progress=progress)
