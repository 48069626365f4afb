"""The command `build`: a description, or a rig, packed as an FMU."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from tendonfmu.cli.console import print_json, say
from tendonfmu.cli.options import AsJson, Quiet, Subject
from tendonfmu.cli.standard_streams import reads


def register(app: typer.Typer) -> None:
    """Add the command to the program."""
    app.command()(build)


@reads("file")
def build(
    file: Subject,
    output: Annotated[Path, typer.Option("-o", "--output", metavar="FINGER.fmu", help="FMU to write")],
    reference: Annotated[
        Path | None,
        typer.Option(metavar="REC", help="recording; the FMU carries its inputs and outputs for checks"),
    ] = None,
    ssv: Annotated[
        list[Path] | None,
        typer.Option(metavar="SET.ssv", help="parameter set that the FMU carries; may be repeated"),
    ] = None,
    binaries: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="folder of binaries by FMI platform [default: those installed]"),
    ] = None,
    fmi: Annotated[
        int, typer.Option(min=2, max=3, metavar="2|3", help="version of FMI; 3: forces and torques as arrays")
    ] = 2,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Pack a co-simulation FMU: the friction of a finger, or the simulated finger of a rig.

    Needs no compiler. The same input gives the same bytes.
    """
    from tendonfmu.fmu import fmu_report
    from tendonfmu.interface import build as build_fmu

    build_fmu(file, output, reference=reference, ssv=ssv or [], binaries=binaries, fmi=fmi)
    say(f"{output}: {output.stat().st_size / 1024:.0f} KiB")
    print_json(lambda: fmu_report(file, output))
