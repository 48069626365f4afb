"""How `-` stands for standard input and standard output in place of a file."""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Callable, Iterable, Mapping
from functools import wraps
from pathlib import Path, PosixPath, WindowsPath
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar

from tendonfmu.cli.console import PRINTED, print_csv
from tendonfmu.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    OwnPath = Path
else:
    OwnPath = PosixPath if os.name == "posix" else WindowsPath

DASH = Path("-")
# how a file begins -> its suffix; what is none of these is a table in text
_BEGINNINGS = {
    b"PK\x03\x04": ".fmu",
    b"PAR1": ".parquet",
    b"MATLAB": ".mat",
    b"\x89HDF": ".h5",
    b"\x89MCAP": ".mcap",
    b"\x1f\x8b": ".csv.gz",
    b"{": ".json",
    b"[": ".json",
}
P = ParamSpec("P")
R = TypeVar("R")


class StandardInput(OwnPath):
    """A temporary file with what standard input held. As text it is its name alone, such as `standard_input.csv`."""

    def __str__(self) -> str:
        return self.name

    def __fspath__(self) -> str:
        return super().__str__()


# --- in ---------------------------------------------------------------------------------------------------------------


def reads(*names: str) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Decorate a command: `-` stands for standard input in the arguments with these names, one file or several."""

    def decorate(command: Callable[P, R]) -> Callable[P, R]:
        @wraps(command)
        def run(*args: P.args, **kwargs: P.kwargs) -> R:
            uses = [name for name in names for each in _files(kwargs[name]) if each == DASH]
            if not uses:
                return command(*args, **kwargs)
            if len(uses) > 1:
                where = " and ".join(dict.fromkeys(uses))
                raise InputError(f"-: given {len(uses)} times, for {where}; standard input can be read once")
            with tempfile.TemporaryDirectory(prefix="tendonfmu-") as folder:
                file, given = _kept(sys.stdin.buffer.read(), Path(folder)), kwargs[uses[0]]
                several = isinstance(given, list)
                kwargs[uses[0]] = [file if each == DASH else each for each in _files(given)] if several else file
                return command(*args, **kwargs)

        return run

    return decorate


def _files(value: Any) -> list[Path]:
    return value if isinstance(value, list) else [] if value is None else [value]


def _kept(content: bytes, folder: Path) -> Path:
    """Write the content of standard input to a file whose suffix says what it is."""
    if not content.strip():
        raise InputError("-: standard input is empty; expected a finger description (JSON), an FMU or a recording")
    start = content[:100].lstrip(b"\xef\xbb\xbf \t\r\n")
    suffix = next((suffix for begin, suffix in _BEGINNINGS.items() if start.startswith(begin)), ".csv")
    file = StandardInput(folder, f"standard_input{suffix}")
    file.write_bytes(content)
    return file


# --- out --------------------------------------------------------------------------------------------------------------


def check_table(output: Path, *inputs: Path) -> None:
    """Check that a table can be written: a .csv, .parquet or .mcap file that is no input, or `-`."""
    from tendonfmu.files import check_output, check_output_format

    PRINTED.table = output == DASH
    if PRINTED.table and PRINTED.json:
        raise InputError("--output -: given with --json; expected a file, since both print on standard output")
    if not PRINTED.table:
        check_output_format(output)
        check_output(output, *inputs)


def write_table(output: Path, table: Mapping[str, NDArray[Any]]) -> None:
    """Write columns [N] to a .csv, .parquet or .mcap file, or as CSV to standard output."""
    write_blocks(output, [table])


def write_blocks(output: Path, blocks: Iterable[Mapping[str, NDArray[Any]]]) -> None:
    """Write a table that comes in blocks of rows, as `write_table` does; only one block is in memory."""
    from tendonfmu.files import csv_lines
    from tendonfmu.files import write_blocks as write_file

    if output == DASH:
        print_csv(csv_lines(blocks))
    else:
        write_file(output, blocks)


def name_of(output: Path) -> str:
    """Return the name of an output as messages say it."""
    return "standard output" if output == DASH else str(output)
