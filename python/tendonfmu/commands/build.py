"""The commands `build` and `simulate`: FMUs, and recordings of simulated fingers."""

from __future__ import annotations

import os
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tendonfmu import files, fmu, model, simulate
from tendonfmu.commands.command import Progress, Subject, command, output_option
from tendonfmu.commands.console import (
    check_second_file,
    check_table,
    name_of,
    print_json,
    progress_bar,
    say,
    write_table,
)
from tendonfmu.errors import InputError, InputWarning
from tendonfmu.files import are, check_output, counted
from tendonfmu.options import BuildOptions, keywords

if TYPE_CHECKING:
    from tendonfmu.model import Finger, FingerSource
    from tendonfmu.recordings import RecordingSource


@keywords(BuildOptions)
def build(finger: FingerSource, output: str | os.PathLike[str], options: BuildOptions) -> Path:
    """Pack a co-simulation FMU, of FMI 2.0 or 3.0: the friction of a finger, or the simulated finger of a rig.

    Needs no compiler. The same input gives the same bytes. With a reference
    the FMU carries the tolerance of a comparison, too, and its default
    experiment has the span and step of the recording, else 10 s in steps of
    1 ms.

    Parameters
    ----------
    finger
        A finger, its description, or the file of it; or the file of a rig, for the FMU of the simulated finger.
    output
        The FMU to write, with a name that ends in .fmu; with `c_array` a C source, .c or .h.

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
    target, reference = Path(output), options.reference
    folder = None if options.binaries is None else Path(options.binaries)
    sets = [Path(file) for file in options.ssv]
    others = [*sets, *([Path(reference)] if isinstance(reference, str | os.PathLike) else [])]
    if isinstance(finger, str | os.PathLike):
        file = model.finger_file(finger)
        if simulate.is_rig(file) and not options.c_array:
            return _build_plant(file, target, folder, others, options, alone=reference is None and not sets)
        others.insert(0, file)
    check_output(target, *others)
    if options.c_array:
        return _write_c_array(finger, target, options, alone=reference is None and not sets and folder is None)
    _check_suffix(target)
    described = model.read_finger(finger)
    files: dict[str, bytes] = {}
    experiment = None
    if reference is not None or sets:
        files, experiment, doubts = _related(described, reference, sets, options)
        for sentence in doubts:
            warnings.warn(sentence, InputWarning, stacklevel=3)  # at the call of tendonfmu.build
    at_end = options.sample_at == "end"
    return fmu.build_fmu(
        described, target, binaries=folder, extra=files, fmi=options.fmi, at_end=at_end, experiment=experiment
    )


def _build_plant(
    rig: Path, target: Path, binaries: Path | None, others: Sequence[Path], options: BuildOptions, *, alone: bool
) -> Path:
    check_output(target, *simulate.read_rig(rig).files, *others)
    if options.fmi != 2:
        raise InputError(f"fmi = {options.fmi}: the simulated finger of a rig is an FMI 2.0 FMU; expected 2")
    if options.sample_at != "begin":
        raise InputError(f"{rig}: a rig, whose outputs are those of a step's end; expected sample_at = 'begin'")
    if not alone:
        raise InputError(f"{rig}: a rig; expected a finger description with a reference or parameter sets")
    _check_suffix(target)
    return simulate.build_plant_fmu(rig, target, binaries=binaries)


def _write_c_array(finger: FingerSource, output: Path, options: BuildOptions, *, alone: bool) -> Path:
    if not alone or options.fmi != 2 or options.sample_at != "begin":
        raise InputError("c_array: a C source has no FMU's options; expected none of them")
    if output.suffix.lower() not in (".c", ".h"):
        raise InputError(f"{output}: expected a name that ends in .c or .h")
    return fmu.write_c_array(model.read_finger(finger), output)


def _check_suffix(output: Path) -> None:
    if output.suffix.lower() != ".fmu":
        raise InputError(f"{output}: expected a name that ends in .fmu, which importing tools need")


def _related(
    finger: Finger, reference: RecordingSource | None, sets: Sequence[Path], options: BuildOptions
) -> tuple[dict[str, bytes], dict[str, float] | None, list[str]]:
    """Return files and experiment of a recording and parameter sets, and a sentence for each doubt about them."""
    from tendonfmu import recordings as recorded  # here: most FMUs are packed without one

    files = fmu.parameter_sets(sets, finger)
    if reference is None:
        return fmu.related_members(files), None, []
    recording = recorded.read_recording(reference)
    run = fmu.reference_run(finger, recording, arrays=options.fmi == 3, at_end=options.sample_at == "end")
    doubts = [finding.line() for finding in recorded.belongs(finger, [recording]) if finding.severity == "error"]
    rows, invented = fmu.bridged_rows(recording)
    if invented:
        doubts.append(
            f"{recording.path}: gaps, over which {invented} of {counted(rows, 'row')} of the reference "
            f"{are(invented)} interpolated; expected "
            "a recording without gaps, such as a part of this one"
        )
    return fmu.related_members([*run.files, *files]), run.experiment, doubts


@command("build", BuildOptions, of=build, reads=("file",))
def build_files(
    file: Subject,
    output: Annotated[Path, output_option("FINGER.fmu", "FMU, or C source, to write")],
    options: BuildOptions,
) -> None:
    build(file, output, **vars(options))
    say(f"{output}: {output.stat().st_size / 1024:.0f} KiB")
    if options.c_array:
        print_json(lambda: fmu.c_array_report(file, model.read_finger(file), output))
    else:
        print_json(lambda: fmu.fmu_report(file, output))


# --- a recording of a simulated finger --------------------------------------------------------------------------------


@command("simulate", reads=("rig",))
def simulate_files(
    rig: Annotated[Path, typer.Argument(metavar="RIG.json", help="rig of a simulated finger")],
    output: Annotated[Path, output_option("REC.parquet", "recording, .csv or .parquet")],
    truth: Annotated[
        Path | None, typer.Option(metavar="TRUTH.parquet", help="true signals to write, .csv or .parquet")
    ] = None,
    progress: Progress = None,
) -> None:
    """Simulate a finger and write the recording. The same rig gives the same numbers."""
    read = simulate.read_rig(rig)
    check_table(output, *read.files)
    if truth is not None:
        files.check_format(truth)
        check_second_file(truth, output, "recording and truth", *read.files)
    with progress_bar("samples", progress) as show:
        result = simulate.simulate(read, truth=truth is not None, progress=show)
    if truth is not None and result.truth is not None:
        write_table(truth, result.truth)
    write_table(output, result.recording)
    written = {"output": output} if truth is None else {"output": output, "truth": truth}
    print_json(lambda: result.report(read, written))
    for line in result.summary(read):
        say(f"{name_of(output)}: {line}")
