"""What does a user send after an internal fault of tendonfmu? A text file."""

from __future__ import annotations

import platform
import shlex
import sys
import tempfile
import traceback
from collections.abc import Iterator, Sequence
from datetime import datetime
from pathlib import Path

from tendonfmu.errors import InputError
from tendonfmu.files import whole_file

_PACKAGES = ("numpy", "scipy", "scikit-learn", "pyarrow", "fmpy", "typer", "rich")


def write_fault_report(error: BaseException, arguments: Sequence[str]) -> Path | None:
    """Write `tendonfmu-error-YYYYMMDD-HHMMSS.txt` and return its path, or None if no folder is writable."""
    # It is written whole or not at all, and never replaces another file.
    text = _report(error, arguments)
    for folder in _folders():
        try:
            return _written(folder, text)
        except (OSError, InputError):
            continue
    return None


def is_own_file(path: object) -> bool:
    """Tell whether the path of an OSError lies within the installed package."""
    return isinstance(path, str) and Path(path).is_absolute() and Path(__file__).parent.parent in Path(path).parents


def is_without_memory(error: BaseException) -> bool:
    """Tell whether memory ran out, in Python or as a library was loaded, which the loader reports as text only."""
    return isinstance(error, MemoryError) or (
        isinstance(error, ImportError)
        and any(words in str(error) for words in ("failed to map segment", "Cannot allocate"))
    )


def _folders() -> Iterator[Path]:
    yield Path()
    try:
        yield Path(tempfile.gettempdir())
    except OSError:
        return


def _written(folder: Path, text: str) -> Path:
    """Write the text under the first free name of this second. Raises OSError or InputError."""
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
    """Create the file to reserve its name. Return False if it exists already. Raises OSError."""
    try:
        file.touch(exist_ok=False)
    except FileExistsError:
        return False
    return True


def _report(error: BaseException, arguments: Sequence[str]) -> str:
    lines = [
        "An internal error of tendonfmu. Please send this file to its developers; it holds no measured data.",
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
    from importlib.metadata import PackageNotFoundError, version  # 10 ms of every command

    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"
