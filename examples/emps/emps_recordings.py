"""The two EMPS files as recordings of the carriage, and the error by which the benchmark judges a model."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from tendonfmu.errors import InputError
from tendonfmu.model.native import run_recording
from tendonfmu.recordings.converters import convert_file
from tendonfmu.recordings.converters.emps import DECIMATION, MASS
from tendonfmu.recordings.recording import Recording

Array = NDArray[np.float64]

TRAINING, PULSES = "DATA_EMPS", "DATA_EMPS_PULSES"
KINEMATICS = 3  # angle and velocity as measured
# Janot, Gautier, Brunot 2019: M in kg, Fv in N/(m/s), Fc and offset in N
PUBLISHED = {"M": 95.1089, "Fv": 203.5034, "Fc": 20.3935, "offset": -3.1648}
PUBLISHED_ASYMMETRIC = {"M": 95.15, "Fv+": 166.7, "Fc+": 20.14, "Fv−": 240.4, "Fc−": 20.63}


def data_folder() -> Path:
    """Folder of the .mat files, in $TENDONFMU_DATA or in ../shared/data beside the repository.

    Raises InputError if it is absent.
    """
    root = Path(__file__).resolve().parents[2]
    folder = Path(os.environ.get("TENDONFMU_DATA") or root.parent / "shared" / "data") / "emps"
    if not folder.is_dir():
        raise InputError(f"{folder}: no such folder; expected the EMPS files there (see docs/evidence/fit.md)")
    return folder


def read_emps(file: Path, mass: float = MASS, decimation: int = DECIMATION) -> Recording:
    """What `tendonfmu convert emps --mass M --decimation N` writes, without a file in between. mass in kg."""
    columns = convert_file("emps", file, {"mass": mass, "decimation": decimation})
    groups = {name.removesuffix("[1]"): values[:, None] for name, values in columns.items() if name != "time"}
    return Recording(file, columns["time"], groups)


def force_and_error(finger: Mapping[str, Any], recording: Recording) -> tuple[Array, Array]:
    """[N] N: the drive's force, and what the model misses of it: compensated minus known inertial force."""
    outputs = run_recording(finger, recording.arrays(), KINEMATICS)
    missed = outputs["compensated_torque"] - recording.groups["external_torque"]
    return recording.groups["tendon_force"][:, 0], np.asarray(missed[:, 0])


def relative(error: Array, force: Array) -> float:
    """100·||y − ŷ||/||y||, %."""
    return 100 * float(np.linalg.norm(error) / np.linalg.norm(force))


def relative_as_published(finger: Mapping[str, Any], recording: Recording) -> float:
    """%; the model at the recording's full rate, then force and what is missed of it decimated alike.

    The published way: the columns of the regression, the velocity's sign among them, are decimated by a Chebyshev
    filter. 50 ms at each end, where filters swing in, are left out.
    """
    force, missed = force_and_error(finger, recording)
    inside = slice(50, -50)
    return relative(*(np.asarray(signal.decimate(series[inside], DECIMATION)) for series in (missed, force)))
