"""The command as a user calls it: exit status and both streams."""

from __future__ import annotations

import io
import runpy
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple
from unittest import mock


@dataclass(frozen=True)
class Answer:
    status: int
    out: str
    err: str


Call = Callable[..., Answer]


class DemoRun(NamedTuple):
    """The folder that `tendonfmu demo` leaves, for reading, and its answer."""

    folder: Path
    answer: Answer


def run_script(script: Path, *arguments: str | Path) -> Answer:
    """Runs a script of Python as the main program, but in this process."""
    out, err = io.StringIO(), io.StringIO()
    with mock.patch("sys.argv", [str(script), *map(str, arguments)]), redirect_stdout(out), redirect_stderr(err):
        try:
            runpy.run_path(str(script), run_name="__main__")
            status = 0
        except SystemExit as ended:
            status = ended.code if isinstance(ended.code, int) else int(ended.code is not None)
            if isinstance(ended.code, str):
                err.write(f"{ended.code}\n")
    return Answer(status, out.getvalue(), err.getvalue())
