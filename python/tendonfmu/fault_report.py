"""What a user sends after an internal fault (its imports would take time of every command)."""

from __future__ import annotations

import itertools
import sys
from collections.abc import Sequence
from pathlib import Path

from tendonfmu.errors import InputError

_PACKAGES = ("numpy", "scipy", "scikit-learn", "pyarrow", "fmpy", "typer", "rich")  # their versions are reported


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
