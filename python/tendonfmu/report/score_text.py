"""How a score reads in the terminal: a table by joint and a few lines that `cli/detect.py` prints."""

from __future__ import annotations

import math
from collections.abc import Iterator

from tendonfmu.detect import Scored, Summary
from tendonfmu.report.numbers import Table
from tendonfmu.statistics import Estimate

SHOWN = (0.5, 1.0, 2.0)  # factors of the ROC that are printed


def tables(scored: Scored) -> Iterator[Table]:
    """List the tables to print: torque by joint, with 95 % intervals in brackets."""
    found = scored.summary
    headings = ["joint", "free residual\nrms, mN·m"]
    columns = [[_estimate(value, 1e3) for value in found.free_rms]]
    if found.contact is not None:
        headings += ["in contact: error\nrms, mN·m", "correlation", "slope"]
        columns += [
            [_estimate(value, 1e3) for value in found.contact.rms],
            [_estimate(value) for value in found.contact.correlation],
            [_estimate(value) for value in found.contact.slope],
        ]
        if found.contact.within is not None:
            headings.append("within\n2 std, %")
            columns.append([_estimate(value, 100.0) for value in found.contact.within])
    if found.external_at_alarm is not None:
        headings.append("at the alarm: median\n|external|, mN·m")
        columns.append([_estimate(value, 1e3) for value in found.external_at_alarm])
    names = scored.subject.finger.joint_names
    yield (
        f"{scored.subject.finger.name}: torque, with 95 % intervals",
        tuple(headings),
        list(zip(names, *columns, strict=True)),
    )


def lines(scored: Scored) -> Iterator[str]:
    """List the lines to print: false alarms, events, delays, other thresholds."""
    found = scored.summary
    if found.events:
        yield from _event_lines(found)
    yield (
        f"false alarms: {found.false_alarms} in {found.free_minutes:.3g} min of free time, "
        f"{_estimate(found.false_alarms_per_minute)} per minute; in alarm {_estimate(found.free_alarm_share, 100.0)} % "
        "of it"
    )
    shown = [point for point in scored.roc or [] if any(math.isclose(point.factor, factor) for factor in SHOWN)]
    if shown and found.free_minutes:
        factors = ", ".join(f"{point.factor:g}" for point in shown)
        some = ", ".join(f"{point.found}" for point in shown)
        per_hour = ", ".join(_rate(point.false_alarms_per_hour.value) for point in shown)
        hit = f"{some} of {found.events} found, " if found.events else ""
        yield f"thresholds × {factors}: {hit}{per_hour} false alarms per hour"
    if scored.no_roc:
        yield f"no ROC: {scored.no_roc}"


def _event_lines(found: Summary) -> Iterator[str]:
    missed = found.events - found.found
    why = f", {found.masked} of them in an alarm from before" if found.masked else ""
    share = _estimate(found.found_share, 100.0)
    yield f"events: {found.found} of {found.events} found, {share} %; {missed} missed{why}"
    if not found.found:
        return
    delay = found.delay
    yield (
        f"delay: median {_estimate(delay['median'], 1e3)} ms, quartiles {_number(delay['lower_quartile'].value, 1e3)} "
        f"and {_number(delay['upper_quartile'].value, 1e3)}, 90 % within {_number(delay['ninety_percent'].value, 1e3)}"
    )
    force = found.force_at_alarm
    felt = "" if force is None else f"; force at the alarm: median {_estimate(force)} N"
    yield (
        f"held to their end: {found.held} of {found.found}; alarms that outlast an event: {found.overhang_events}, "
        f"{found.overhang_seconds:.3g} s, the longest {found.longest_overhang:.3g} s{felt}"
    )


def _estimate(estimate: Estimate, factor: float = 1.0) -> str:
    """Format an estimate with its interval, such as `12 (8.1 to 19)`."""
    value = _number(estimate.value, factor)
    if math.isnan(estimate.low) or math.isnan(estimate.high):
        return value
    return f"{value} ({_number(estimate.low, factor)} to {_number(estimate.high, factor)})"


def _number(value: float, factor: float) -> str:
    """Format with three digits, and at most two decimals where that is enough."""
    scaled = factor * value
    if math.isnan(scaled):
        return "-"
    if abs(scaled) >= 99.95:
        return f"{scaled:.0f}"
    return f"{scaled:.1f}" if abs(scaled) >= 9.995 else f"{scaled:.2f}"


def _rate(value: float) -> str:
    return f"{value:.0f}" if value >= 100 else f"{value:.3g}"
