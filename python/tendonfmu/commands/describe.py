"""The command `describe`: a description to begin with, of a machine with one joint or of a finger."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from tendonfmu import files, model
from tendonfmu import recordings as recorded
from tendonfmu.commands.command import command, output_option
from tendonfmu.commands.console import print_json, say
from tendonfmu.errors import InputError

JOINT, FINGER = "joint", "finger"  # what is described
LARGEST = 1e6  # of torques, speeds and inertias of a described machine


@command("describe")
def describe_files(
    what: Annotated[
        str, typer.Argument(metavar="joint|finger", help="a servo, an axis of an arm, a linear drive; or a finger")
    ],
    output: Annotated[Path, output_option("FINGER.json", "description to write")],
    name: Annotated[str, typer.Option(help="name of the machine, or of the finger")],
    joints: Annotated[str | None, typer.Option(metavar="NAME,NAME", help="finger: its joints, base first")] = None,
    tendon: Annotated[
        list[str] | None,
        typer.Option(metavar='"NAME JOINT+ JOINT-"', help="finger: a tendon and the joints that its pull turns"),
    ] = None,
    table: Annotated[
        Path | None, typer.Option(metavar="TABLE.txt", help="finger: a line for each tendon, in place of --tendon")
    ] = None,
    recording: Annotated[
        Path | None, typer.Option(metavar="REC", help="recording from which its numbers are taken, .csv or .parquet")
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
) -> None:
    """Write a description to begin with: of a machine with one joint, or of a finger.

    Its numbers are starting values; fit estimates them. With --recording those
    of one joint come from the machine's own motion. The moment arms, stiffness
    and zeros of a finger are learned from joint encoders by calibrate, or by
    fit --routing.
    """
    if what not in (JOINT, FINGER):
        raise InputError(f"describe: {what!r}: unknown kind of machine; expected {JOINT} or {FINGER}")
    if not name.strip() or any(ord(letter) < 32 for letter in name):
        raise InputError(f"describe {what}: --name = {name!r}: expected a name")
    if what == FINGER:
        _describe_finger(output, name, joints, tendon or [], table)
        return
    numbers = {"torque": torque, "speed": speed, "coulomb": coulomb, "viscous": viscous, "inertia": inertia}
    if recording is None:
        files.check_output(output)
        document = recorded.joint_description(
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
        files.check_format(recording)
        files.check_output(output, recording)
        document = recorded.describe_recorded_joint(name, recorded.read_recording(recording), moment_arm)
    files.write_text(output, model.description_text(document))
    law = document["joints"][0]["friction"]
    say(
        f"{output}: {name}, coulomb {law['coulomb']:g} N.m, viscous {law['viscous']:g} N.m.s/rad to start from; "
        "`tendonfmu fit` estimates them"
    )
    print_json(lambda: document)


def _describe_finger(output: Path, name: str, joints: str | None, tendons: list[str], table: Path | None) -> None:
    """Write the description of a finger whose numbers nobody knows yet."""
    if not joints or (table is None) == (not tendons):
        raise InputError(f"describe {FINGER}: expected --joints, and either --tendon for each tendon or --table")
    inputs = [] if table is None else [table]
    files.check_output(output, *inputs)
    text = "" if table is None else table.read_text(encoding="utf-8")
    lines = tendons or [line for line in text.splitlines() if line.strip()]
    document = model.starting_finger(name, [joint.strip() for joint in joints.split(",")], lines)
    files.write_text(output, model.description_text(document))
    say(
        f"{output}: {name}, {files.counted(len(document['joints']), 'joint')}, {files.counted(len(lines), 'tendon')}; "
        "every number is a guess: `tendonfmu calibrate` learns them from motion with joint_position"
    )
    print_json(lambda: document)
