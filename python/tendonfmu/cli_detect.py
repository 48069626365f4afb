"""The commands about contact: `register` adds each to the program of `cli.py`."""

from __future__ import annotations

import typer


def register(app: typer.Typer) -> None:
    """Adds the commands, in the order of the help page."""
