"""Which arguments and options do several commands share? Type, range and help of each.

Every command takes `Quiet`, every command with a result `AsJson`, every command that shows progress `Progress`, and
every command that shares its work among processor cores `Jobs`. python_tests/cli/test_habits.py holds them to it.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from tendonfmu.cli.console import PRINTED

# --- files ------------------------------------------------------------------------------------------------------------

FingerFile = Annotated[
    Path,
    typer.Argument(metavar="FINGER.json", help="finger description; its structure is kept"),
]
ExtendedFinger = Annotated[
    Path,
    typer.Argument(metavar="FINGER.json", help="finger description; it is kept, and extended by the causes found"),
]
Model = Annotated[
    Path,
    typer.Argument(metavar="FINGER.json|FINGER.fmu", help="finger description, or its FMU"),
]
FreeRecordings = Annotated[
    list[Path],
    typer.Argument(metavar="RECORDING", help="free motion, .csv or .parquet"),
]
FreeAtPretensions = Annotated[
    list[Path],
    typer.Argument(metavar="FREE", help="free motion at several pretensions, .csv or .parquet"),
]
Subject = Annotated[
    Path,
    typer.Argument(metavar="FINGER.json|RIG.json", help="finger description, or rig"),
]
Figures = Annotated[Path | None, typer.Option(metavar="DIR", help="folder for figures")]
Report = Annotated[Path | None, typer.Option(metavar="R.json", help="report with all results, as JSON")]

# --- how it is computed -----------------------------------------------------------------------------------------------

Kinematics = Annotated[
    int,
    typer.Option(
        min=1,
        max=3,
        metavar="1|2|3",
        help="1: tendon positions, 2: measured joint positions, 3: joint positions and velocities",
    ),
]
FalseAlarms = Annotated[
    float, typer.Option(min=1e-3, max=3600.0, metavar="RATE", help="highest rate accepted in free motion like yours")
]
Confidence = Annotated[
    float, typer.Option(min=0.5, max=0.9999, metavar="P", help="probability that RATE is not exceeded")
]
LeastGain = Annotated[
    float, typer.Option(min=0.0, max=0.5, metavar="SHARE", help="least drop of the rms on unseen data for a cause")
]
Seed = Annotated[int, typer.Option(min=0, max=2**53, metavar="N", help="seed of the random numbers")]
Jobs = Annotated[
    int, typer.Option(min=1, max=1024, metavar="N", help="processor cores to use; no effect on the result")
]

# --- what is printed --------------------------------------------------------------------------------------------------


def _set_quiet(wanted: bool) -> bool:
    PRINTED.quiet = wanted
    return wanted


def _set_json(wanted: bool) -> bool:
    PRINTED.json = wanted
    return wanted


Progress = Annotated[
    bool | None, typer.Option("--progress/--no-progress", help="show progress [default: on a terminal]")
]
Quiet = Annotated[bool, typer.Option("-q", "--quiet", callback=_set_quiet, help="print errors only")]
AsJson = Annotated[bool, typer.Option("--json", callback=_set_json, help="print the result as one JSON object")]
