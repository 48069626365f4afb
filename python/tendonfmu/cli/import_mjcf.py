"""The commands `import mjcf` and `export mjcf`: a finger from a MuJoCo model, and fitted numbers back into one."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tendonfmu.cli.console import say
from tendonfmu.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Sequence

ModelFile = Annotated[Path, typer.Argument(metavar="MODEL.xml", help="MuJoCo model (MJCF)")]
Names = "NAME[,NAME]..."

importing = typer.Typer(no_args_is_help=True, help="Make a finger description from another program's model.")
exporting = typer.Typer(no_args_is_help=True, help="Write fitted numbers into another program's model.")


def register(app: typer.Typer) -> None:
    """Add the commands to the program."""
    app.add_typer(importing, name="import")
    app.add_typer(exporting, name="export")


# Without a callback, typer would take the only command of a group for the group itself.
@importing.callback()
def _importing() -> None:
    pass


@exporting.callback()
def _exporting() -> None:
    pass


@importing.command("mjcf")
def import_mjcf(
    model: ModelFile,
    joints: Annotated[list[str], typer.Option(metavar=Names, help="joints of the finger, base first")],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="FINGER.json", help="description to write")],
    tendons: Annotated[
        list[str] | None,
        typer.Option(metavar=Names, help="tendons of the finger \\[default: all driven ones that move it]"),
    ] = None,
    bidirectional: Annotated[
        list[str] | None, typer.Option(metavar=Names, help="tendons that are cable loops, which pull either way")
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
        typer.Option(min=1e-3, max=1e12, help="N/m; of tendons whose stiffness the model does not have"),
    ] = None,
    arm_tolerance: Annotated[
        float, typer.Option(min=0.0, max=1.0, metavar="SHARE", help="a moment arm that varies less is constant")
    ] = 0.02,
    threshold: Annotated[
        float, typer.Option(min=1e-9, max=1e6, help="N.m; contact threshold to begin with, of all joints")
    ] = 0.03,
    name: Annotated[str | None, typer.Option(help="name of the finger \\[default: the model's]")] = None,
) -> None:
    r"""Make a finger description from joints and tendons of a MuJoCo model.

    What the description does not have of the model is listed on standard
    error. Needs the package mujoco: pip install 'tendonfmu\[mujoco]'.
    """
    from tendonfmu.files import check_output, write_text
    from tendonfmu.mjcf import ImportSettings, import_finger

    check_output(output, model)
    settings = ImportSettings(
        joints=_names(joints),
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
    finger = import_finger(model, settings)
    write_text(output, finger.text)
    _report(finger.notes, finger.warnings, "left out", finger.left_out)
    say(f"{output}: {len(finger.data['joints'])} joints, {len(finger.data['tendons'])} tendons")


@exporting.command("mjcf")
def export_mjcf(
    finger: Annotated[Path, typer.Argument(metavar="FITTED.json", help="fitted finger description")],
    model: ModelFile,
    output: Annotated[Path, typer.Option("-o", "--output", metavar="OUT.xml", help="model to write")],
) -> None:
    r"""Write friction, damping, springs and armature of a description into a MuJoCo model.

    Joints and tendons are found by their names; the rest of the model stays
    as it is. What MJCF cannot express is listed on standard error. Needs the
    package mujoco: pip install 'tendonfmu\[mujoco]'.
    """
    from tendonfmu.files import check_output
    from tendonfmu.mjcf import export_numbers
    from tendonfmu.model import read_finger

    check_output(output, finger, model)
    written = export_numbers(read_finger(finger), model, output)
    _report([change.line() for change in written.changes], [], "MJCF cannot express", written.left_out)
    say(f"{output}: {len(written.changes)} numbers changed")


def _report(notes: Sequence[str], warnings: Sequence[str], what: str, left_out: Sequence[str]) -> None:
    for note in notes:
        say(f"tendonfmu: {note}")
    for warning in warnings:
        say(f"tendonfmu: warning: {warning}")
    for row in left_out:
        say(f"tendonfmu: {what}: {row}")


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
