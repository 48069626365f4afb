"""Files that appear whole or not at all."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tendonfmu.errors import InputError


def check_output(output: Path, *inputs: Path) -> None:
    """Raises InputError where no file can be, and where a result would take the place of what it is made from."""
    _check_place(output)
    _check_writable(output, output.parent)
    for file in inputs:
        if output.exists() and file.exists() and output.samefile(file):
            raise InputError(f"{output}: the same file as the input {file}; expected another name for the output")


def _check_place(file: Path) -> None:
    if not file.parent.is_dir():
        raise InputError(f"{file}: no folder {file.parent}; expected one that exists")
    if file.is_dir():
        raise InputError(f"{file}: a folder; expected the name of a file to write")
    # a result takes the place of what is there: that must be a file, and one that may be written
    if file.exists() and not file.is_file():
        raise InputError(f"{file}: a device or pipe; expected the name of a file to write")
    if file.exists() and not file.stat().st_mode & 0o222:
        raise InputError(f"{file}: read-only; expected another name, or a file that may be written")


def check_output_folder(folder: Path) -> None:
    """Raises InputError where a folder that need not exist yet could not be made, or not be written into."""
    there = next(each for each in (folder, *folder.absolute().parents) if each.exists())
    if not there.is_dir():
        what = "a file" if there == folder else f"{there} is a file"
        raise InputError(f"{folder}: {what}; expected a folder, or a name for one")
    _check_writable(folder, there)


def _check_writable(output: Path, folder: Path) -> None:
    """By writing: permissions alone do not tell of read-only disks. What takes minutes is not computed in vain."""
    try:
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise InputError(f"{output}: cannot be written ({error.strerror})") from None


@contextmanager
def whole_file(file: Path) -> Iterator[Path]:
    """A temporary file beside `file` that takes its place at the end, or vanishes when an error ends it."""
    _check_place(file)
    try:
        handle, name = tempfile.mkstemp(dir=file.parent, prefix=f".{file.name}-", suffix=file.suffix)
    except OSError as error:
        raise InputError(f"{file}: cannot be written ({error.strerror})") from None
    os.close(handle)
    temporary = Path(name)
    try:
        yield temporary
        # mkstemp's files are private; a result is as readable as any other file
        mask = os.umask(0)
        os.umask(mask)
        temporary.chmod(0o666 & ~mask)
        os.replace(temporary, file)
    except OSError as error:
        if not is_about(error, file.parent):
            raise
        raise InputError(f"{file}: cannot be written ({error.strerror or error})") from None
    finally:
        temporary.unlink(missing_ok=True)


def is_about(error: OSError, folder: Path) -> bool:
    """Whether an error in writing concerns a folder: it names no file, such as that of a full disk, or one in there."""
    if error.errno is None:  # not of the operating system
        return False
    if not isinstance(error.filename, str | bytes):
        return True
    return folder.absolute() in Path(os.fsdecode(error.filename)).absolute().parents


def write_text(path: Path, text: str) -> None:
    """Whole or not at all."""
    with whole_file(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
