"""The commands that make and use descriptions: `describe`, and `import` and `export` for MuJoCo models."""

# ruff: noqa: RUF009 (`option` makes a field)

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from tendonfmu import files, mjcf, model
from tendonfmu import recordings as recorded
from tendonfmu.commands.command import command, output_option
from tendonfmu.commands.console import print_json, say, warn
from tendonfmu.errors import InputError
from tendonfmu.model import description_text
from tendonfmu.options import File, ImportOptions, Options, option

# --- a description to begin with, of a machine with one joint or of a finger ------------------------------------------


JOINT, FINGER = "joint", "finger"  # what is described
LARGEST = 1e6  # of torques, speeds and inertias of a described machine


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class DescribeOptions(Options):
    """Options of `describe`."""

    joints: str | None = option(None, "finger: its joints, base first", "NAME,NAME")
    tendon: Sequence[str] = option((), "finger: a tendon and the joints that its pull turns", '"NAME JOINT+ JOINT-"')
    table: File | None = option(None, "finger: a line for each tendon, in place of --tendon", "TABLE.txt")
    recording: File | None = option(None, "recording from which its numbers are taken, .csv or .parquet", "REC")
    torque: float | None = option(None, "N.m; largest torque of the drive [default: 1]", None, 1e-9, LARGEST)
    speed: float | None = option(None, "rad/s; largest speed of the joint [default: 5]", None, 1e-9, LARGEST)
    coulomb: float | None = option(None, "N.m; Coulomb friction [default: 5 % of the torque]", None, 0.0, LARGEST)
    viscous: float | None = option(
        None, "N.m.s/rad; viscous friction [default: 2 % of torque/speed]", None, 0.0, LARGEST
    )
    inertia: float | None = option(None, "kg.m2; moved inertia [default: 1 % of torque/speed]", None, 1e-12, LARGEST)
    moment_arm: float = option(1.0, "m; 1 if the recording has torque as tendon force", None, 1e-4, 10.0)


@command("describe", DescribeOptions)
def describe_files(
    what: Annotated[
        str, typer.Argument(metavar="joint|finger", help="a servo, an axis of an arm, a linear drive; or a finger")
    ],
    output: Annotated[Path, output_option("FINGER.json", "description to write")],
    name: Annotated[str, typer.Option(help="name of the machine, or of the finger")],
    options: DescribeOptions,
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
        _describe_finger(output, name, options)
        return
    keys = ("torque", "speed", "coulomb", "viscous", "inertia")
    numbers = {key: getattr(options, key) for key in keys if getattr(options, key) is not None}
    if options.recording is None:
        files.check_output(output)
        document = recorded.joint_description(name, **numbers, moment_arm=options.moment_arm)
    else:
        for key in numbers:
            raise InputError(f"describe {JOINT}: --{key}: not an option beside --recording, which holds the number")
        recording = Path(options.recording)
        files.check_format(recording)
        files.check_output(output, recording)
        document = recorded.describe_recorded_joint(name, recorded.read_recording(recording), options.moment_arm)
    files.write_text(output, model.description_text(document))
    law = document["joints"][0]["friction"]
    say(
        f"{output}: {name}, coulomb {law['coulomb']:g} N.m, viscous {law['viscous']:g} N.m.s/rad to start from; "
        "`tendonfmu fit` estimates them"
    )
    print_json(lambda: document)


def _describe_finger(output: Path, name: str, options: DescribeOptions) -> None:
    """Write the description of a finger whose numbers nobody knows yet."""
    joints, tables = options.joints, options.files("table")
    if not joints or bool(tables) == bool(options.tendon):
        raise InputError(f"describe {FINGER}: expected --joints, and either --tendon for each tendon or --table")
    files.check_output(output, *tables)
    lines = [*options.tendon]
    for table in tables:
        lines = [line for line in table.read_text(encoding="utf-8").splitlines() if line.strip()]
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


@command("import", ImportOptions)
def import_model(
    kind: Format,
    model: ModelFile,
    output: Annotated[Path, output_option("FINGER.json", "description to write")],
    options: ImportOptions,
) -> None:
    """Make a finger description from joints and tendons of a MuJoCo model.

    What the description does not have of the model is listed on standard
    error. Needs the package mujoco: pip install mujoco.
    """
    _check_kind("import", kind)
    files.check_output(output, model)
    finger = mjcf.import_finger(model, options)
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
