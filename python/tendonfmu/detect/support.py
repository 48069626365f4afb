"""Which rate of false alarms the recordings' length supports, and what to record for the wished one."""

from __future__ import annotations

from dataclasses import dataclass

from tendonfmu.detect.alarm_level import Cells, allowed_alarms, least_hours, rate_limit
from tendonfmu.errors import InputError


class NotEnough(InputError):
    """Too little free motion: for the wished rate, where that is refused, or none at all. more: minutes missing."""

    def __init__(self, message: str, more: float) -> None:
        super().__init__(message)
        self.more = more


@dataclass(frozen=True)
class Support:
    """What a tuning is for.

    rate: 1/h, the wished one, or the lowest that so much free motion without any alarm supports if that is higher.
    allowed: most alarms in the recordings for that rate. more: minutes missing for the wished rate, 0 if none are.
    sentence: says so, empty if nothing is missing.
    """

    rate: float
    allowed: int
    more: float
    sentence: str


def supported(cells: Cells, hours: float, wished: float, confidence: float, strict: bool) -> Support:
    """wished: 1/h. Raises NotEnough: the recordings do not support the wished rate, and `strict`."""
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
            f"{60 * hours:.1f} min of free motion: even without any alarm in them the rate may be {rate:.3g} per hour "
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
    """(mean force N, h) of each pretension."""
    return [
        (float(cells.force[cells.group == g].mean()), float(cells.hours[cells.group == g].sum()))
        for g in range(cells.groups)
    ]
