"""The report of a fault of tendonfmu itself: a text file that the user can send."""

from __future__ import annotations

import platform
import shlex
import sys
import tempfile
import traceback
from collections.abc import Iterator, Sequence
from datetime import datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from tendonfmu.errors import InputError
from tendonfmu.files import whole_file

_PACKAGES = ("numpy", "scipy", "scikit-learn", "pyarrow", "fmpy", "typer", "rich")


def write_fault_report(error: BaseException, arguments: Sequence[str]) -> Path | None:
    """Writes `tendonfmu-error-YYYYMMDD-HHMMSS.txt` and returns its path, or None where no folder takes it.

    The file goes into the current folder, or into the folder for temporary files. It is written whole or not at all,
    and takes the place of no other file. arguments: those of the command.
    """
    text = _report(error, arguments)
    for folder in _folders():
        try:
            return _written(folder, text)
        except (OSError, InputError):
            continue
    return None


def is_own_file(path: object) -> bool:
    """Whether a path of an OSError lies within the installed package."""
    return isinstance(path, str) and Path(path).is_absolute() and Path(__file__).parent.parent in Path(path).parents


def _folders() -> Iterator[Path]:
    yield Path()
    try:
        yield Path(tempfile.gettempdir())
    except OSError:
        return


def _written(folder: Path, text: str) -> Path:
    """Under the first name of this second that is free. Raises OSError or InputError."""
    stem = datetime.now().strftime("tendonfmu-error-%Y%m%d-%H%M%S")
    file = folder / f"{stem}.txt"
    number = 1
    while not _taken(file):
        number += 1
        file = folder / f"{stem}-{number}.txt"
    try:
        with whole_file(file) as temporary:
            temporary.write_bytes(text.encode("utf-8", "backslashreplace"))
    except BaseException:
        file.unlink(missing_ok=True)
        raise
    return file


def _taken(file: Path) -> bool:
    """Takes a name that no file has. False where one has it. Raises OSError."""
    try:
        file.touch(exist_ok=False)
    except FileExistsError:
        return False
    return True


def _report(error: BaseException, arguments: Sequence[str]) -> str:
    lines = [
        "A fault of tendonfmu. Please send this file to its developers; it holds no measured data.",
        "",
        f"command:  {shlex.join(['tendonfmu', *arguments])}",
        f"time:     {datetime.now().astimezone().isoformat(timespec='seconds')}",
        f"platform: {platform.platform()}, {platform.machine()}",
        f"python:   {sys.version.split()[0]} ({platform.python_implementation()})",
        *(f"{name}: {_version(name)}" for name in ("tendonfmu", *_PACKAGES)),
        "",
    ]
    return "\n".join(lines) + "\n" + "".join(traceback.format_exception(error))


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"
