"""The error that a user sees: one line that says what, where, and what was expected."""

from __future__ import annotations


class InputError(ValueError):
    """Something the user gave is refused. The message is one line that begins with the file."""
