"""What an interval is: a value with its bounds."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Interval:
    """A value with its 95 % interval."""

    value: float  # the value
    low: float  # ends of the interval
    high: float
