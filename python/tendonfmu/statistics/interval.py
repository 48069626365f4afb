"""What an interval is: a value with its bounds."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Interval:
    """A value with its 95 % interval.

    Attributes
    ----------
    value
        The value.
    low, high
        Ends of the interval.
    """

    value: float
    low: float
    high: float
