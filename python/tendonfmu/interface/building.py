"""Packs an FMU (`tendonfmu build`)."""

from __future__ import annotations

import os
from pathlib import Path

from tendonfmu.files import check_output
from tendonfmu.fmu import build_fmu
from tendonfmu.interface.options import with_checked_options
from tendonfmu.model import FingerSource, finger_file, read_finger
from tendonfmu.simulate import build_plant_fmu, is_rig, read_rig


@with_checked_options
def build(
    finger: FingerSource, output: str | os.PathLike[str], *, binaries: str | os.PathLike[str] | None = None
) -> Path:
    """Pack an FMI 2.0 co-simulation FMU. Needs no compiler; the same input gives the same bytes.

    Parameters
    ----------
    finger
        A finger, its description, or the file of it; or the file of a rig, for the FMU of the simulated finger.
    output
        The FMU to write.
    binaries
        Folder of binaries by FMI platform. None: those installed.

    Returns
    -------
    Path
        `output`.

    Raises
    ------
    InputError
        The description is refused, binaries are missing, or the output cannot be written.
    """
    target = Path(output)
    folder = None if binaries is None else Path(binaries)
    if isinstance(finger, str | os.PathLike):
        file = finger_file(finger)
        rig = is_rig(file)
        check_output(target, *(read_rig(file).files if rig else [file]))
        if rig:
            return build_plant_fmu(file, target, binaries=folder)
    else:
        check_output(target)
    return build_fmu(read_finger(finger), target, binaries=folder)
