"""Arguments and options that several commands share, each with its type, range and help: one place for one text."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

# --- files ------------------------------------------------------------------------------------------------------------

FingerFile = Annotated[Path, typer.Argument(metavar="FINGER.json", help="finger description, its structure as given")]
Model = Annotated[Path, typer.Argument(metavar="FINGER.json|FINGER.fmu", help="description, or FMU of one")]
FreeRecordings = Annotated[list[Path], typer.Argument(metavar="RECORDING", help="free motion, .csv or .parquet")]
FreeAtPretensions = Annotated[
    list[Path], typer.Argument(metavar="FREE", help="free motion at several pretensions, .csv or .parquet")
]
Subject = Annotated[Path, typer.Argument(metavar="FINGER.json|RIG.json", help="finger description, or rig")]
Figures = Annotated[Path | None, typer.Option(metavar="DIR", help="folder for figures")]
Report = Annotated[Path | None, typer.Option(metavar="R.json", help="everything that is known of it")]

# --- how it is computed -----------------------------------------------------------------------------------------------

Kinematics = Annotated[
    int,
    typer.Option(
        min=1, max=3, help="1: tendon positions, 2: measured joint positions, 3: joint positions and velocities"
    ),
]
FalseAlarms = Annotated[
    float, typer.Option(min=1e-3, max=3600.0, metavar="RATE", help="at most, in free motion like the recorded one")
]
Confidence = Annotated[float, typer.Option(min=0.5, max=0.9999, help="that the rate is at most that")]
LeastGain = Annotated[
    float, typer.Option(min=0.0, max=0.5, metavar="SHARE", help="by which a cause has to lower the rms on unseen data")
]
Seed = Annotated[int, typer.Option(min=0, max=2**53, help="of all that is drawn at random")]
Jobs = Annotated[int, typer.Option(min=1, max=64, help="processor cores to use; the result is the same")]
Progress = Annotated[
    bool | None, typer.Option("--progress/--no-progress", help="progress bar; by default on a terminal")
]
