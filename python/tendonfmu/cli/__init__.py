"""The command `tendonfmu`: one file per command parses, calls and prints; `program.py` puts them together."""

from tendonfmu.cli.program import main

__all__ = ["main"]
