"""Packs an FMU (`tendonfmu build`)."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from tendonfmu.errors import InputError
from tendonfmu.files import check_output
from tendonfmu.fmu import build_fmu, parameter_sets, reference_files, related_members
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
    ssv: str | os.PathLike[str] | Sequence[str | os.PathLike[str]] = (),
    binaries: str | os.PathLike[str] | None = None,
    fmi: int = 2,
) -> Path:
    """Pack a co-simulation FMU, of FMI 2.0 or 3.0. Needs no compiler; the same input gives the same bytes.

    Parameters
    ----------
    finger
        A finger, its description, or the file of it; or the file of a rig, for the FMU of the simulated finger.
    output
        The FMU to write.
    reference
        A recording of the finger: the FMU then carries its inputs, the outputs over it, and the tolerance of a
        comparison. None: the FMU carries no reference results.
    ssv
        Parameter sets of SSP that the FMU shall carry, with names of its parameters, such as those of
        `FitResult.write`. One alone needs no list.
    binaries
        Folder of binaries by FMI platform. None: those installed.
    fmi
        Version of FMI: 2, or 3 for a finger. With 3, forces, positions and torques are arrays.

    Returns
    -------
    Path
        `output`.

    Raises
    ------
    InputError
        The description, the recording or a parameter set is refused, binaries are missing, the output cannot be
        written, or `fmi` is 3 with a rig.
    """
    target = Path(output)
    folder = None if binaries is None else Path(binaries)
    sets = [Path(each) for each in (ssv if isinstance(ssv, Sequence) and not isinstance(ssv, str) else [ssv])]
    others = [*sets, *([Path(reference)] if isinstance(reference, str | os.PathLike) else [])]
    if isinstance(finger, str | os.PathLike):
        file = finger_file(finger)
        rig = is_rig(file)
        check_output(target, *(read_rig(file).files if rig else [file]), *others)
        if rig and fmi != 2:
            raise InputError(f"fmi = {fmi}: the simulated finger of a rig is an FMI 2.0 FMU; expected 2")
        if rig:
            if reference is not None or sets:
                raise InputError(f"{file}: a rig; expected a finger description with a reference or parameter sets")
            return build_plant_fmu(file, target, binaries=folder)
    else:
        check_output(target, *others)
    model = read_finger(finger)
    related = [] if reference is None else reference_files(model, read_recording(reference), arrays=fmi == 3)
    related += parameter_sets(sets, model)
    return build_fmu(model, target, binaries=folder, extra=related_members(related), fmi=fmi)
