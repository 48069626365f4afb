"""Packs an FMU (`tendonfmu build`)."""

from __future__ import annotations

import os
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from tendonfmu.errors import InputError, InputWarning
from tendonfmu.files import are, check_output, counted
from tendonfmu.fmu import build_fmu
from tendonfmu.model import Finger, FingerSource, finger_file, read_finger
from tendonfmu.options import BuildOptions

if TYPE_CHECKING:
    from tendonfmu.recordings import RecordingSource


def build(
    finger: FingerSource,
    output: str | os.PathLike[str],
    *,
    reference: RecordingSource | None = None,
    ssv: str | os.PathLike[str] | Sequence[str | os.PathLike[str]] = (),
    binaries: str | os.PathLike[str] | None = None,
    fmi: int = 2,
    sample_at: str = "begin",
    c_array: bool = False,
) -> Path:
    """Pack a co-simulation FMU, of FMI 2.0 or 3.0. Needs no compiler; the same input gives the same bytes.

    Parameters
    ----------
    finger
        A finger, its description, or the file of it; or the file of a rig, for the FMU of the simulated finger.
    output
        The FMU to write, with a name that ends in .fmu; with `c_array` a C source, .c or .h.
    reference
        A recording of the finger: the FMU then carries its inputs, the outputs over it, and the tolerance of a
        comparison, and its default experiment has the span and step of the recording. None: the FMU carries no
        reference results, and its default experiment is 10 s in steps of 1 ms.
    ssv
        Parameter sets of SSP that the FMU shall carry, with names of its parameters, such as those of
        `FitResult.write`. One alone needs no list.
    binaries
        Folder of binaries by FMI platform. None: those installed.
    fmi
        Version of FMI: 2, or 3 for a finger. With 3, forces, positions and torques are arrays.
    sample_at
        Time of the sample that a step of the FMU takes of the inputs as they stand: its "begin", or its "end", for
        masters that hand over the inputs of a step's end. A rig has "begin" alone.
    c_array
        Write the finger as a C array for a microcontroller, in place of an FMU. It takes no other option.

    Returns
    -------
    Path
        `output`.

    Raises
    ------
    InputError
        The description, the recording or a parameter set is refused, binaries are missing, the output cannot be
        written or has another suffix, or `fmi` is 3 or `sample_at` "end" with a rig.

    Warns
    -----
    InputWarning
        The recording does not belong to the finger, as `tendonfmu check` finds it, or has gaps.
    """
    options = BuildOptions.of(locals())
    target = Path(output)
    folder = None if options.binaries is None else Path(options.binaries)
    sets = [Path(file) for file in options.ssv]
    others = [*sets, *([Path(reference)] if isinstance(reference, str | os.PathLike) else [])]
    if isinstance(finger, str | os.PathLike):
        from tendonfmu.simulate import is_rig

        file = finger_file(finger)
        if is_rig(file) and not options.c_array:
            return _build_plant(file, target, folder, others, options, alone=reference is None and not sets)
        others.insert(0, file)
    check_output(target, *others)
    if options.c_array:
        return _write_c_array(finger, target, options, alone=reference is None and not sets and folder is None)
    _check_suffix(target)
    model = read_finger(finger)
    files: dict[str, bytes] = {}
    experiment = None
    if reference is not None or sets:
        files, experiment, doubts = _related(model, reference, sets, options)
        for sentence in doubts:
            warnings.warn(sentence, InputWarning, stacklevel=2)  # at the call of tendonfmu.build
    at_end = options.sample_at == "end"
    return build_fmu(model, target, binaries=folder, extra=files, fmi=options.fmi, at_end=at_end, experiment=experiment)


def _build_plant(
    rig: Path, target: Path, binaries: Path | None, others: Sequence[Path], options: BuildOptions, *, alone: bool
) -> Path:
    from tendonfmu.simulate import build_plant_fmu, read_rig

    check_output(target, *read_rig(rig).files, *others)
    if options.fmi != 2:
        raise InputError(f"fmi = {options.fmi}: the simulated finger of a rig is an FMI 2.0 FMU; expected 2")
    if options.sample_at != "begin":
        raise InputError(f"{rig}: a rig, whose outputs are those of a step's end; expected sample_at = 'begin'")
    if not alone:
        raise InputError(f"{rig}: a rig; expected a finger description with a reference or parameter sets")
    _check_suffix(target)
    return build_plant_fmu(rig, target, binaries=binaries)


def _write_c_array(finger: FingerSource, output: Path, options: BuildOptions, *, alone: bool) -> Path:
    from tendonfmu.fmu import write_c_array

    if not alone or options.fmi != 2 or options.sample_at != "begin":
        raise InputError("c_array: a C source has no FMU's options; expected none of them")
    if output.suffix.lower() not in (".c", ".h"):
        raise InputError(f"{output}: expected a name that ends in .c or .h")
    return write_c_array(read_finger(finger), output)


def _check_suffix(output: Path) -> None:
    if output.suffix.lower() != ".fmu":
        raise InputError(f"{output}: expected a name that ends in .fmu, which importing tools need")


def _related(
    finger: Finger, reference: RecordingSource | None, sets: Sequence[Path], options: BuildOptions
) -> tuple[dict[str, bytes], dict[str, float] | None, list[str]]:
    """Return files and experiment of a recording and parameter sets, and a sentence for each doubt about them."""
    # what reads recordings is imported here: most FMUs are packed without one
    from tendonfmu.fmu import bridged_rows, parameter_sets, reference_run, related_members
    from tendonfmu.recordings import belongs, read_recording

    files = parameter_sets(sets, finger)
    if reference is None:
        return related_members(files), None, []
    recording = read_recording(reference)
    run = reference_run(finger, recording, arrays=options.fmi == 3, at_end=options.sample_at == "end")
    doubts = [finding.line() for finding in belongs(finger, [recording]) if finding.severity == "error"]
    rows, invented = bridged_rows(recording)
    if invented:
        doubts.append(
            f"{recording.path}: gaps, over which {invented} of {counted(rows, 'row')} of the reference "
            f"{are(invented)} interpolated; expected "
            "a recording without gaps, such as a part of this one"
        )
    return related_members([*run.files, *files]), run.experiment, doubts
