"""The commands that make and use descriptions: `describe`, and `import` and `export` for MuJoCo models."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tendonfmu import files, mjcf, model
from tendonfmu import recordings as recorded
from tendonfmu.commands.command import command, output_option
from tendonfmu.commands.console import print_json, say, warn
from tendonfmu.errors import InputError
from tendonfmu.model import description_text

if TYPE_CHECKING:
    from collections.abc import Sequence


# --- a description to begin with, of a machine with one joint or of a finger ------------------------------------------


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


# --- a finger from a MuJoCo model, and fitted numbers back into one ---------------------------------------------------


MJCF = "mjcf"
Format = Annotated[str, typer.Argument(metavar="mjcf", help="format of the model: MuJoCo's")]
ModelFile = Annotated[Path, typer.Argument(metavar="MODEL.xml", help="MuJoCo model")]
NAMES = "NAMES"  # separated by commas; the option may also be repeated


@command("import")
def import_model(
    kind: Format,
    model: ModelFile,
    output: Annotated[Path, output_option("FINGER.json", "description to write")],
    joints: Annotated[
        list[str] | None,
        typer.Option(metavar=NAMES, help="joints, base first: mcp,pip [default: the one chain that tendons move]"),
    ] = None,
    tendons: Annotated[
        list[str] | None,
        typer.Option(metavar=NAMES, help="tendons of the finger [default: all driven ones that move it]"),
    ] = None,
    bidirectional: Annotated[
        list[str] | None, typer.Option(metavar=NAMES, help="tendons that are cable loops, which pull either way")
    ] = None,
    range_: Annotated[
        list[str] | None,
        typer.Option("--range", metavar="JOINT=LOW:HIGH", help="rad; joint range, in place of the model's limits"),
    ] = None,
    tip: Annotated[
        str | None, typer.Option(metavar="NAME", help="site, geom or body at the fingertip; writes links and tip")
    ] = None,
    gravity: Annotated[bool, typer.Option("--gravity", help="write the weight of the links as known load")] = False,
    stiffness: Annotated[
        float | None,
        typer.Option(min=1e-3, max=1e12, metavar="N/m", help="N/m; of tendons whose stiffness the model does not have"),
    ] = None,
    arm_tolerance: Annotated[
        float, typer.Option(min=0.0, max=1.0, metavar="SHARE", help="a moment arm that varies less is constant")
    ] = 0.02,
    threshold: Annotated[
        float,
        typer.Option(min=1e-9, max=1e6, metavar="N.m", help="N.m; contact threshold to begin with, of all joints"),
    ] = 0.03,
    name: Annotated[str | None, typer.Option(metavar="NAME", help="of the finger [default: the model's]")] = None,
) -> None:
    """Make a finger description from joints and tendons of a MuJoCo model.

    What the description does not have of the model is listed on standard
    error. Needs the package mujoco: pip install mujoco.
    """
    _check_kind("import", kind)
    files.check_output(output, model)
    settings = mjcf.ImportSettings(
        joints=_names(joints or []),
        tendons=None if tendons is None else _names(tendons),
        ranges=dict(_range(text) for text in range_ or []),
        bidirectional=_names(bidirectional or []),
        tip=tip,
        gravity=gravity,
        stiffness=stiffness,
        tolerance=arm_tolerance,
        threshold=threshold,
        name=name,
    )
    finger = mjcf.import_finger(model, settings)
    files.write_text(output, description_text(finger.data))
    _say_rows(model, "", finger.notes)
    for sentence in finger.warnings:
        warn(sentence)
    _say_rows(model, "left out: ", finger.left_out)
    say(f"{output}: {', '.join(files.counted(len(finger.data[f'{part}s']), part) for part in ('joint', 'tendon'))}")
    print_json(lambda: finger.report(model, output))


@command("export")
def export_model(
    kind: Format,
    finger: Annotated[Path, typer.Argument(metavar="FITTED.json", help="fitted finger description")],
    model: ModelFile,
    output: Annotated[Path, output_option("OUT.xml", "model to write")],
    report: Annotated[
        Path | None, typer.Option(metavar="R.json", help="report of the fit: numbers it does not identify stay")
    ] = None,
    replay: Annotated[
        list[Path] | None, typer.Option(metavar="FREE...", help="free motion to judge the numbers by, in MuJoCo")
    ] = None,
) -> None:
    """Write friction, damping, springs and armature of a description into a MuJoCo model.

    Joints and tendons are found by their names; the rest of the model stays
    as it is. What MJCF cannot express is listed on standard error. With
    --replay, numbers that make the model worse are not written. Needs the
    package mujoco: pip install mujoco.
    """
    _check_kind("export", kind)
    files.check_output(output, finger, model, *([] if report is None else [report]), *(replay or []))
    written = mjcf.export_numbers(finger, model, output, report, replay or [])
    _say_rows(output, "", [change.line() for change in written.changes])
    _say_rows(output, "", [row.line() for row in written.replay])
    _say_rows(output, "left out: ", written.left_out)
    say(f"{output}: {files.counted(len(written.changes), 'number')} changed")
    print_json(lambda: written.report(finger, model, output))


def _check_kind(command: str, kind: str) -> None:
    if kind != MJCF:
        raise InputError(f"{command}: {kind!r}: unknown format; expected {MJCF}")


def _say_rows(file: Path, what: str, rows: Sequence[str]) -> None:
    for row in rows:
        say(f"{file}: {what}{row}")


def _names(texts: Sequence[str]) -> list[str]:
    """Return the names of an option that may be repeated and may hold several names."""
    return [name.strip() for text in texts for name in text.split(",") if name.strip()]


def _range(text: str) -> tuple[str, tuple[float, float]]:
    joint, _, limits = text.rpartition("=")
    low, _, high = limits.partition(":")
    try:
        span = float(low), float(high)
    except ValueError:
        raise InputError(f"--range {text}: expected JOINT=LOW:HIGH in rad, such as mcp=-0.3:1.4") from None
    if not joint or not -1e6 < span[0] < span[1] < 1e6:
        raise InputError(f"--range {text}: expected JOINT=LOW:HIGH with LOW below HIGH, in rad")
    return joint, span
