"""The command `describe`: the description of a machine with one joint, without writing JSON by hand."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from tendonfmu.cli.console import print_json, say
from tendonfmu.cli.options import AsJson, Quiet
from tendonfmu.errors import InputError

JOINT = "joint"
LARGEST = 1e6  # of torques, speeds and inertias


def register(app: typer.Typer) -> None:
    """Add the command to the program."""
    app.command()(describe)


def describe(
    what: Annotated[str, typer.Argument(metavar="joint", help="a servo, one axis of an arm, a linear drive")],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="FINGER.json", help="description to write")],
    name: Annotated[str, typer.Option(help="name of the machine and of its joint")],
    recording: Annotated[
        Path | None,
        typer.Option(metavar="REC", help="recording from which its numbers are taken, .csv or .parquet"),
    ] = None,
    torque: Annotated[
        float | None, typer.Option(min=1e-9, max=LARGEST, help="N.m; largest torque of the drive [default: 1]")
    ] = None,
    speed: Annotated[
        float | None, typer.Option(min=1e-9, max=LARGEST, help="rad/s; largest speed of the joint [default: 5]")
    ] = None,
    coulomb: Annotated[
        float | None, typer.Option(min=0.0, max=LARGEST, help="N.m; Coulomb friction [default: 5 % of the torque]")
    ] = None,
    viscous: Annotated[
        float | None,
        typer.Option(min=0.0, max=LARGEST, help="N.m.s/rad; viscous friction [default: 2 % of torque/speed]"),
    ] = None,
    inertia: Annotated[
        float | None, typer.Option(min=1e-12, max=LARGEST, help="kg.m2; moved inertia [default: 1 % of torque/speed]")
    ] = None,
    moment_arm: Annotated[
        float, typer.Option(min=1e-4, max=10.0, help="m; 1 if the recording has torque as tendon force")
    ] = 1.0,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Write the description of a machine with one joint, for logs of torque and angle.

    Its numbers are starting values; fit estimates them. With --recording they
    come from the machine's own motion.
    """
    from tendonfmu.files import check_format, check_output, write_text
    from tendonfmu.recordings import describe_recorded_joint, description_text, joint_description, read_recording

    if what != JOINT:
        raise InputError(f"describe: {what!r}: unknown kind of machine; expected {JOINT}")
    if not name.strip() or any(ord(letter) < 32 for letter in name):
        raise InputError(f"describe {JOINT}: --name = {name!r}: expected a name")
    numbers = {"torque": torque, "speed": speed, "coulomb": coulomb, "viscous": viscous, "inertia": inertia}
    if recording is None:
        check_output(output)
        document = joint_description(
            name,
            1.0 if torque is None else torque,
            5.0 if speed is None else speed,
            coulomb=coulomb,
            viscous=viscous,
            inertia=inertia or 0.0,
            moment_arm=moment_arm,
        )
    else:
        for option, value in numbers.items():
            if value is not None:
                raise InputError(
                    f"describe {JOINT}: --{option}: not an option beside --recording, which holds the number"
                )
        check_format(recording)
        check_output(output, recording)
        document = describe_recorded_joint(name, read_recording(recording), moment_arm)
    write_text(output, description_text(document))
    law = document["joints"][0]["friction"]
    say(
        f"{output}: {name}, coulomb {law['coulomb']:g} N.m, viscous {law['viscous']:g} N.m.s/rad to start from; "
        "`tendonfmu fit` estimates them"
    )
    print_json(lambda: document)
