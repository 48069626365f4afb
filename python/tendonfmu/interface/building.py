"""Packs an FMU (`tendonfmu build`)."""

from __future__ import annotations

import os
from pathlib import Path

from tendonfmu.errors import InputError
from tendonfmu.files import check_output
from tendonfmu.fmu import build_fmu, reference_files, related_members
from tendonfmu.interface.options import with_checked_options
from tendonfmu.model import FingerSource, finger_file, read_finger
from tendonfmu.recordings import RecordingSource, read_recording
from tendonfmu.simulate import build_plant_fmu, is_rig, read_rig


@with_checked_options
def build(
    finger: FingerSource,
    output: str | os.PathLike[str],
    *,
    reference: RecordingSource | None = None,
    binaries: str | os.PathLike[str] | None = None,
) -> Path:
    """Pack an FMI 2.0 co-simulation FMU. Needs no compiler; the same input gives the same bytes.

    Parameters
    ----------
    finger
        A finger, its description, or the file of it; or the file of a rig, for the FMU of the simulated finger.
    output
        The FMU to write.
    reference
        A recording of the finger: the FMU then carries its inputs, the outputs over it, and the tolerance of a
        comparison. None: the FMU carries no reference results.
    binaries
        Folder of binaries by FMI platform. None: those installed.

    Returns
    -------
    Path
        `output`.

    Raises
    ------
    InputError
        The description or the recording is refused, binaries are missing, or the output cannot be written.
    """
    target = Path(output)
    folder = None if binaries is None else Path(binaries)
    others = [Path(reference)] if isinstance(reference, str | os.PathLike) else []
    if isinstance(finger, str | os.PathLike):
        file = finger_file(finger)
        rig = is_rig(file)
        check_output(target, *(read_rig(file).files if rig else [file]), *others)
        if rig:
            if reference is not None:
                raise InputError(f"{file}: a rig; expected a finger description with a reference recording")
            return build_plant_fmu(file, target, binaries=folder)
    else:
        check_output(target, *others)
    model = read_finger(finger)
    related = [] if reference is None else reference_files(model, read_recording(reference))
    return build_fmu(model, target, binaries=folder, extra=related_members(related))
