"""How files are written so that they appear whole or not at all."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tendonfmu.errors import InputError


def check_output(output: Path, *inputs: Path) -> None:
    """Check that an output can be written and replaces none of its inputs.

    Parameters
    ----------
    output
        The file that will be written.
    *inputs
        Files from which it is made.

    Raises
    ------
    InputError
        The output cannot be written, or is one of the inputs.
    """
    _check_place(output)
    _check_writable(output, output.parent)
    for file in inputs:
        if output.exists() and file.exists() and output.samefile(file):
            raise InputError(f"{output}: the same file as the input {file}; expected another name for the output")


def _check_place(file: Path) -> None:
    if file.name == "-":
        raise InputError("-: standard output takes tables only; expected the name of a file to write")
    if not file.parent.is_dir():
        raise InputError(f"{file}: no folder {file.parent}; expected one that exists")
    if file.is_dir():
        raise InputError(f"{file}: a folder; expected the name of a file to write")
    # a result replaces an existing file, which must therefore be a regular and writable one
    if file.exists() and not file.is_file():
        raise InputError(f"{file}: a device or pipe; expected the name of a file to write")
    if file.exists() and not file.stat().st_mode & 0o222:
        raise InputError(f"{file}: read-only; expected another name, or a file that may be written")


def check_output_folder(folder: Path) -> None:
    """Check that a folder can be made, if it does not exist, and be written to.

    Parameters
    ----------
    folder
        The folder.

    Raises
    ------
    InputError
        It is a file, lies in a file, or cannot be written to.
    """
    if folder.name == "-":
        raise InputError("-: standard output takes tables only; expected the name of a folder")
    there = next(each for each in (folder, *folder.absolute().parents) if each.exists())
    if not there.is_dir():
        what = "a file" if there == folder else f"{there} is a file"
        raise InputError(f"{folder}: {what}; expected a folder, or a name for one")
    _check_writable(folder, there)


def _check_writable(output: Path, folder: Path) -> None:
    """Check by writing, since permissions do not show read-only disks. Call this before a long computation."""
    try:
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise InputError(f"{output}: cannot be written ({error.strerror})") from None


@contextmanager
def whole_file(file: Path) -> Iterator[Path]:
    """Write a file whole or not at all.

    Parameters
    ----------
    file
        The file.

    Yields
    ------
    Path
        A temporary file in the same folder. It replaces `file` at the end, and is deleted after an error.

    Raises
    ------
    InputError
        The file cannot be written.
    """
    _check_place(file)
    try:
        handle, name = tempfile.mkstemp(dir=file.parent, prefix=f".{file.name}-", suffix=file.suffix)
    except OSError as error:
        raise InputError(f"{file}: cannot be written ({error.strerror})") from None
    os.close(handle)
    temporary = Path(name)
    try:
        yield temporary
        # mkstemp's files are private; a result gets the permissions of any other new file
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
    """Return whether an error in writing concerns a folder.

    Parameters
    ----------
    error
        The error.
    folder
        The folder.

    Returns
    -------
    bool
        True if the error names a file in the folder, or no file, such as that of a full disk.
    """
    if error.errno is None:  # not an error of the operating system
        return False
    if not isinstance(error.filename, str | bytes):
        return True
    return folder.absolute() in Path(os.fsdecode(error.filename)).absolute().parents


def write_text(path: Path, text: str) -> None:
    """Write a text file whole or not at all.

    Parameters
    ----------
    path
        The file.
    text
        Its content, written as UTF-8.

    Raises
    ------
    InputError
        The file cannot be written.
    """
    with whole_file(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
