"""Numbers with their noun, for messages."""

from __future__ import annotations


def counted(number: int, noun: str) -> str:
    """Write a number with its noun.

    Parameters
    ----------
    number
        How many.
    noun
        In the singular; an "s" makes the plural.

    Returns
    -------
    str
        Such as `1 joint` or `2 joints`.
    """
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"
