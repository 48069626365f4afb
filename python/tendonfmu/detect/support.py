"""Which rate of false alarms the recordings are long enough for, and what to record for the wished rate."""

from __future__ import annotations

from dataclasses import dataclass

from tendonfmu.detect.alarm_level import Cells, allowed_alarms, least_hours, rate_limit
from tendonfmu.errors import InputError


class NotEnough(InputError):
    """There is too little free motion: for the wished rate, or any at all."""

    def __init__(self, message: str, more: float) -> None:
        super().__init__(message)
        self.more = more


@dataclass(frozen=True)
class Support:
    """The rate that a tuning is for."""

    rate: float
    allowed: int
    more: float
    sentence: str


def supported(cells: Cells, hours: float, wished: float, confidence: float, strict: bool) -> Support:
    """Find the rate that the recordings support, for a wished rate (1/h)."""
    allowed = allowed_alarms(hours, wished, confidence)
    if allowed >= 0:
        return Support(wished, allowed, 0.0, "")
    needed = least_hours(wished, confidence)
    share = needed / cells.groups
    thin = [(force, there) for force, there in hours_by_pretension(cells) if there < share]
    evenly = ", ".join(f"{60 * (share - there):.1f} min at {force:.3g} N" for force, there in thin)
    more, rate = 60 * (needed - hours), rate_limit(0, hours, confidence)
    if strict:
        raise NotEnough(
            f"{60 * hours:.1f} min of free motion: even without any alarm the rate may be {rate:.3g} per hour "
            f"at confidence {confidence:g}; expected {60 * needed:.1f} min for {wished:g} per hour, {more:.1f} min "
            f"more (evenly: {evenly})",
            more,
        )
    sentence = (
        f"{60 * hours:.1f} min of free motion: at most {rate:.3g} false alarms an hour with {100 * confidence:g} % "
        f"confidence; {more:.1f} min more for {wished:g} (evenly: {evenly})"
    )
    return Support(rate, 0, more, sentence)


def hours_by_pretension(cells: Cells) -> list[tuple[float, float]]:
    """Return the mean force (N) and the time (h) of each pretension."""
    return [
        (float(cells.force[cells.group == g].mean()), float(cells.hours[cells.group == g].sum()))
        for g in range(cells.groups)
    ]
