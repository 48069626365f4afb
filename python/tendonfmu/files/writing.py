"""How files are written so that they appear whole or not at all, and how temporary files are named in messages."""

from __future__ import annotations

import glob
import os
import re
import shutil
import tempfile
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path, PosixPath, WindowsPath
from typing import TYPE_CHECKING

from tendonfmu.errors import InputError, OutputError

try:
    import fcntl
except ImportError:  # on Windows, where an open file could not be replaced anyway
    fcntl = None  # type: ignore[assignment]

_YOUNG = 60.0  # s; a younger file may not have its lock yet


if TYPE_CHECKING:
    SystemPath = Path
else:
    SystemPath = PosixPath if os.name == "posix" else WindowsPath


class StandIn(SystemPath):
    """A file whose text is the name of what it stands for, so that messages name that."""

    shown: str

    @classmethod
    def of(cls, file: Path, shown: str) -> StandIn:
        """Return a file that is shown by another name."""
        path = cls(file)
        path.shown = shown
        return path

    def __str__(self) -> str:
        return getattr(self, "shown", None) or super().__str__()  # a path made from this one is an ordinary one

    def __fspath__(self) -> str:
        return super().__str__()

    def __reduce__(self) -> tuple[object, ...]:
        return StandIn.of, (Path(os.fspath(self)), str(self))


def path_of(file: str | os.PathLike[str]) -> Path:
    """Return a path; one that stands for something still does."""
    return file if isinstance(file, Path) else Path(file)


def check_output(output: Path, *inputs: Path) -> None:
    """Check that an output can be written and replaces none of its inputs."""
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


def check_output_folder(folder: Path, names: Iterable[str] = (), inputs: Sequence[Path] = ()) -> None:
    """Check that a folder can be made, if it does not exist, and be written to, and that files in it are no inputs."""
    if folder.name == "-":
        raise InputError("-: standard output takes tables only; expected the name of a folder")
    there = next(each for each in (folder, *folder.absolute().parents) if each.exists())
    if not there.is_dir():
        what = "a file" if there == folder else f"{there} is a file"
        raise InputError(f"{folder}: {what}; expected a folder, or a name for one")
    _check_writable(folder, there)
    if folder.is_dir():
        for name in names:
            check_output(folder / name, *inputs)


def _check_writable(output: Path, folder: Path) -> None:
    """Check by writing, since permissions do not show read-only disks. Call this before a long computation."""
    try:
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise OutputError(f"{output}: cannot be written ({error.strerror})") from None


@contextmanager
def whole_file(file: Path) -> Iterator[Path]:
    """Write a file whole or not at all."""
    _check_place(file)
    remove_left_behind(file)
    try:
        handle, name = tempfile.mkstemp(dir=file.parent, prefix=f".{file.name}-", suffix=file.suffix)
    except OSError as error:
        raise OutputError(f"{file}: cannot be written ({error.strerror})") from None
    os.close(handle)
    temporary = Path(name)
    try:
        with in_use(temporary):
            yield temporary
        # mkstemp's files are private; a result gets the permissions of any other new file
        mask = os.umask(0)
        os.umask(mask)
        temporary.chmod(0o666 & ~mask)
        os.replace(temporary, file)
    except OSError as error:
        if not is_about(error, file.parent):
            raise
        raise OutputError(f"{file}: cannot be written ({error.strerror or error})") from None
    finally:
        temporary.unlink(missing_ok=True)


@contextmanager
def in_use(temporary: Path) -> Iterator[None]:
    """Hold a lock on a temporary file or folder, which ends with the process; `remove_left_behind` then spares it."""
    handle = _locked(temporary)
    try:
        yield
    finally:
        if handle is not None:
            os.close(handle)


def remove_left_behind(target: Path) -> None:
    """Remove temporary files and folders of an earlier try to write a target, as `kill -9` leaves them."""
    pattern = re.compile(rf"\.{re.escape(target.name)}-[a-z0-9_]{{8}}({re.escape(target.suffix)})?")  # of mkstemp
    for path in target.absolute().parent.glob(f".{glob.escape(target.name)}-*"):
        with suppress(OSError):
            if not pattern.fullmatch(path.name) or time.time() - path.stat().st_mtime < _YOUNG:
                continue
            handle = _locked(path)
            if handle is None:
                continue
            os.close(handle)
            if path.is_dir():
                shutil.rmtree(path)
            else:
                path.unlink()


def _locked(path: Path) -> int | None:
    """Return a descriptor that holds a lock; None if another one holds it, or without locks."""
    if fcntl is None:
        return None
    handle = os.open(path, os.O_RDONLY)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(handle)
        return None
    return handle


def is_about(error: OSError, folder: Path) -> bool:
    """Return whether an error in writing concerns a folder."""
    if error.errno is None:  # not an error of the operating system
        return False
    if not isinstance(error.filename, str | bytes):
        return True
    return folder.absolute() in Path(os.fsdecode(error.filename)).absolute().parents


def write_text(path: Path, text: str) -> None:
    """Write a text file whole or not at all."""
    with whole_file(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
