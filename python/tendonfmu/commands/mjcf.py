"""The commands `import` and `export`: a finger from a MuJoCo model, and fitted numbers back into one."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tendonfmu import files, mjcf
from tendonfmu.commands.command import command, output_option
from tendonfmu.commands.console import print_json, say, warn
from tendonfmu.errors import InputError
from tendonfmu.model import description_text

if TYPE_CHECKING:
    from collections.abc import Sequence

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
