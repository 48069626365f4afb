"""Two kinds of error: what the user gave is wrong, or tendonfmu itself is."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager


class InputError(ValueError):
    """Something the user gave is refused. The message is one line that begins with the file."""


class InternalError(Exception):
    """A fault of tendonfmu: what one part of it gave another is refused. Never the fault of a file or an option."""


@contextmanager
def own_fault(what: str) -> Iterator[None]:
    """Inside, everything that came from the user has been checked: an InputError is then an InternalError.

    what: the computation or the result that fails, in a few words.
    """
    try:
        yield
    except InputError as refused:
        raise InternalError(f"{what}: {refused}") from refused


def line_of(error: InputError | OSError) -> str:
    """What a user reads of it: an OSError without its number."""
    if not isinstance(error, OSError):
        return str(error)
    reason = error.strerror or str(error)
    return reason if error.filename is None else f"{os.fsdecode(error.filename)}: {reason}"
