"""A temporary file that stands for something without a file: standard input, a recording or a finger in memory."""

from __future__ import annotations

import os
from pathlib import Path, PosixPath, WindowsPath
from typing import TYPE_CHECKING

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
