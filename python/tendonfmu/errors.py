"""Which errors tendonfmu raises: the user's input is wrong, or tendonfmu itself has a fault, which it reports."""

from __future__ import annotations

import errno
import itertools
import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

_PACKAGES = ("numpy", "scipy", "scikit-learn", "pyarrow", "fmpy", "typer", "rich")  # their versions are reported
_NO_MEMORY = ("failed to map segment", "Cannot allocate", "can't start new thread", "Failed to launch worker thread")


class InputError(ValueError):
    """Input from the user is refused. The message is one line that starts with the file."""


class OutputError(InputError):
    """A file cannot be written or unpacked: for the disk or a right, whatever the input. The message is one line."""


class NothingLeftError(InputError):
    """Recordings are sound, but of a part of them nothing is left to learn from. The message is one line."""


class TooLargeError(InputError):
    """Sound input needs more memory than there is. The message is one line."""


class InputWarning(UserWarning):
    """Input from the user is accepted, but not all of it is used. The message is one line that starts with the file."""


class InternalError(Exception):
    """A fault of tendonfmu: one part of it gave another an invalid value. Never caused by a file or an option."""


@contextmanager
def own_fault(what: str) -> Iterator[None]:
    """Turn an InputError inside the block into an InternalError, since all input has been checked before."""
    try:
        yield
    except (OutputError, NothingLeftError, TooLargeError):
        raise
    except InputError as refused:
        raise InternalError(f"{what}: {refused}") from refused


def refusal(error: BaseException) -> str | None:
    """Return the line of an error that is no fault of tendonfmu, else None."""
    if is_without_memory(error):
        return "not enough memory"
    if not isinstance(error, InputError | OSError):
        return None
    is_own = isinstance(error, OSError) and (error.errno is None or _is_own_file(error.filename))
    return None if is_own else " ".join(line_of(error).split())


def is_without_memory(error: BaseException) -> bool:
    """Tell whether memory ran out; loaders of libraries and threads say so in words alone."""
    return (
        isinstance(error, MemoryError)
        or (isinstance(error, OSError) and error.errno == errno.ENOMEM)
        or (
            isinstance(error, ImportError | RuntimeError | OSError) and any(words in str(error) for words in _NO_MEMORY)
        )
    )


def _is_own_file(path: object) -> bool:
    """Tell whether a path lies within the installed package."""
    return isinstance(path, str) and Path(path).is_absolute() and Path(__file__).parent in Path(path).parents


def line_of(error: InputError | OSError) -> str:
    """Return the line that a user reads. An OSError is shown without its number."""
    if not isinstance(error, OSError):
        return str(error)
    reason = error.strerror or str(error)
    return reason if error.filename is None else f"{os.fsdecode(error.filename)}: {reason}"


# --- what a user sends after an internal fault ------------------------------------------------------------------------


def write_fault_report(error: BaseException, arguments: Sequence[str]) -> Path | None:
    """Write `tendonfmu-error-YYYYMMDD-HHMMSS.txt` and return its path, or None if no folder is writable."""
    # It is written whole or not at all, and never replaces another file.
    import tempfile

    text = fault_report(error, arguments)
    for folder in (".", None):
        try:
            return _written(Path(folder or tempfile.gettempdir()), text)
        except (OSError, InputError):
            continue
    return None


def _written(folder: Path, text: str) -> Path:
    """Write the text under the first free name of this second. Raises OSError or InputError."""
    from datetime import datetime

    from tendonfmu.files import whole_file

    stem = datetime.now().strftime("tendonfmu-error-%Y%m%d-%H%M%S")
    for number in itertools.count(1):
        file = folder / (f"{stem}.txt" if number == 1 else f"{stem}-{number}.txt")
        try:
            file.touch(exist_ok=False)  # reserves the name
            break
        except FileExistsError:
            continue
    try:
        with whole_file(file) as temporary:
            temporary.write_bytes(text.encode("utf-8", "backslashreplace"))
    except BaseException:
        file.unlink(missing_ok=True)
        raise
    return file


def fault_report(error: BaseException, arguments: Sequence[str]) -> str:
    """Return what a report says. arguments: of the command."""
    import platform
    import shlex
    import traceback
    from datetime import datetime

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
