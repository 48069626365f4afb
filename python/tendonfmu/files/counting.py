"""Numbers with their noun and verb, for messages."""

from __future__ import annotations


def counted(number: int, noun: str, plural: str = "") -> str:
    """Write a number with its noun."""
    return f"{number} {noun if number == 1 else plural or f'{noun}s'}"


def are(number: int) -> str:
    """Return the verb for a number of things: "is" for one, else "are"."""
    return "is" if number == 1 else "are"


def percent(share: float) -> str:
    """Write a share in percent with two digits, near 100 without decimals."""
    return f"{100 * share:.2g} %" if share < 0.995 else f"{100 * share:.0f} %"
