"""Numbers with their noun and verb, for messages."""

from __future__ import annotations


def counted(number: int, noun: str, plural: str = "") -> str:
    """Write a number with its noun."""
    return f"{number} {noun if number == 1 else plural or f'{noun}s'}"


def are(number: int) -> str:
    """Return the verb for a number of things: "is" for one, else "are"."""
    return "is" if number == 1 else "are"
