"""How files are written whole or not at all, how temporary files are named, and texts for people."""

from __future__ import annotations

import os
import re
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from functools import cache
from pathlib import Path, PosixPath, WindowsPath
from typing import TYPE_CHECKING

from tendonfmu.errors import InputError, OutputError

if TYPE_CHECKING:
    SystemPath = Path
    import jinja2


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
    try:
        handle, name = tempfile.mkstemp(dir=file.parent, prefix=f".{file.name}-", suffix=file.suffix)
    except OSError as error:
        raise OutputError(f"{file}: cannot be written ({error.strerror})") from None
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
        if not _is_about(error, file.parent):
            raise
        raise OutputError(f"{file}: cannot be written ({error.strerror or error})") from None
    finally:
        temporary.unlink(missing_ok=True)


def _is_about(error: OSError, folder: Path) -> bool:
    """Return whether an error in writing concerns a folder."""
    if error.errno is None:  # not an error of the operating system
        return False
    if not isinstance(error.filename, str | bytes):
        return True
    return folder.absolute() in Path(os.fsdecode(error.filename)).absolute().parents


def write_files(folder: Path, contents: Mapping[str, bytes]) -> None:
    """Write files to a folder, made if missing: all of them or, where the disk is full, none; the first comes last."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"{folder}: cannot be written ({error.strerror or error})") from None
    with ExitStack() as written:
        for name, content in contents.items():
            written.enter_context(whole_file(folder / name)).write_bytes(content)


def write_text(path: Path, text: str) -> None:
    """Write a text file whole or not at all."""
    write_bytes(path, text.encode())


def write_bytes(path: Path, content: bytes) -> Path:
    """Write a file whole or not at all, and return it."""
    with whole_file(path) as temporary:
        temporary.write_bytes(content)
    return path


# --- texts for people -------------------------------------------------------------------------------------------------


def counted(number: int, noun: str, plural: str = "") -> str:
    """Write a number with its noun."""
    return f"{number} {noun if number == 1 else plural or f'{noun}s'}"


def listed(words: Sequence[str]) -> str:
    """Join words as in "1, 2 and 3"."""
    return " and ".join(filter(None, [", ".join(words[:-1]), *words[-1:]]))


def are(number: int) -> str:
    """Return the verb for a number of things: "is" for one, else "are"."""
    return "is" if number == 1 else "are"


def percent(share: float) -> str:
    """Write a share in percent with two digits, near 100 without decimals."""
    return f"{100 * share:.2g} %" if share < 0.995 else f"{100 * share:.0f} %"


def by_kind(sentences: Iterable[str]) -> list[tuple[str, list[str]]]:
    """Return one line for each kind of warnings, with all of the kind: those that differ in file, place and numbers."""
    kinds: dict[str, list[str]] = {}
    for sentence in dict.fromkeys(sentences):
        probably = sentence.partition("; probably ")[2]
        kinds.setdefault(probably or re.sub(r"^\S+: |[-+]?\d[\d.e]*", "", sentence), []).append(sentence)
    return [(_of_kind(probably, alike), alike) for probably, alike in kinds.items()]


def _of_kind(probably: str, alike: Sequence[str]) -> str:
    """Return the line of several warnings of a kind; the only one itself."""
    first = alike[0]
    if len(alike) == 1:
        return first
    if not first.endswith(f"; probably {probably}"):
        return f"{first} (and {len(alike) - 1} more of this kind)"
    files, columns = ({sentence.split(": ", 2)[k] for sentence in alike} for k in (0, 1))
    of = f"{counted(len(columns), 'column')} of {counted(len(files), 'file')}"
    seen = first.split(": ", 2)[2].partition("; probably ")[0]
    return f"{', '.join(sorted(columns)[:4])}: {of}, the first: {seen}; probably {probably}"


def html_template(name: str) -> jinja2.Template:
    """Return a template of python/tendonfmu/templates. It escapes all texts, and refuses a variable it is not given."""
    return _environment().get_template(name)


@cache
def _environment() -> jinja2.Environment:
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("tendonfmu"),
        undefined=jinja2.StrictUndefined,
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["by_kind"] = by_kind
    return environment
