"""How a tuning and a score read in the terminal and in a notebook: tables, and lines that `cli/detect.py` prints."""

from __future__ import annotations

import math
from collections.abc import Iterator

from tendonfmu.detect import ContactTuning, Scored, Summary, tune_report
from tendonfmu.report.numbers import Table
from tendonfmu.statistics import Interval

SHOWN = (0.5, 1.0, 2.0)  # factors of the ROC that are printed


# --- score ------------------------------------------------------------------------------------------------------------


def score_tables(scored: Scored) -> Iterator[Table]:
    """List the tables to print: torque by joint, with 95 % intervals in brackets."""
    summary = scored.summary
    headings = ["joint", "free residual\nrms, mN·m"]
    columns = [[_estimate(value, 1e3) for value in summary.free_rms]]
    if summary.contact is not None:
        headings += ["in contact: error\nrms, mN·m", "correlation", "slope"]
        columns += [
            [_estimate(value, 1e3) for value in summary.contact.rms],
            [_estimate(value) for value in summary.contact.correlation],
            [_estimate(value) for value in summary.contact.slope],
        ]
        if summary.contact.within is not None:
            headings.append("within\n2 std, %")
            columns.append([_estimate(value, 100.0) for value in summary.contact.within])
    if summary.external_at_alarm is not None:
        headings.append("at the alarm: median\n|external|, mN·m")
        columns.append([_estimate(value, 1e3) for value in summary.external_at_alarm])
    names = scored.finger.joint_names
    yield (
        f"{scored.finger.name}: torque, with 95 % intervals",
        tuple(headings),
        list(zip(names, *columns, strict=True)),
    )


def score_lines(scored: Scored) -> Iterator[str]:
    """List the lines to print: false alarms, events, delays, other thresholds."""
    summary = scored.summary
    if summary.events:
        yield from _event_lines(summary)
    soon = f" ({summary.alarms_after_events} of them within 2 s after an event)" if summary.alarms_after_events else ""
    yield (
        f"false alarms: {summary.false_alarms}{soon} in {summary.free_minutes:.3g} min of free time, "
        f"{_estimate(summary.false_alarms_per_minute)} per minute; "
        f"in alarm {_estimate(summary.free_alarm_share, 100.0)} % of the free time"
    )
    shown = [point for point in scored.roc or [] if any(math.isclose(point.factor, factor) for factor in SHOWN)]
    if shown and summary.free_minutes:
        factors = ", ".join(f"{point.factor:g}" for point in shown)
        some = ", ".join(f"{point.found}" for point in shown)
        per_hour = ", ".join(_rate(point.false_alarms_per_hour.value) for point in shown)
        hit = f"{some} of {summary.events} found; " if summary.events else ""
        yield f"thresholds × {factors}: {hit}{per_hour} false alarms per hour"
    if scored.no_roc:
        yield f"no ROC: {scored.no_roc}"


def _event_lines(summary: Summary) -> Iterator[str]:
    missed = summary.events - summary.found
    why = f", {summary.masked} of them in an alarm that had begun before" if summary.masked else ""
    share = _estimate(summary.found_share, 100.0)
    late = f", {summary.released} of them only as the load ends" if summary.released else ""
    yield f"events: {summary.found} of {summary.events} found{late}, {share} %; {missed} missed{why}"
    if not summary.found:
        return
    delay = summary.delay
    yield (
        f"delay: median {_estimate(delay['median'], 1e3)} ms, quartiles {_number(delay['lower_quartile'].value, 1e3)} "
        f"and {_number(delay['upper_quartile'].value, 1e3)}, 90 % within {_number(delay['ninety_percent'].value, 1e3)}"
    )
    force = summary.force_at_alarm
    felt = "" if force is None else f"; force at the alarm: median {_estimate(force)} N"
    yield (
        f"held to their end: {summary.held} of {summary.found}; "
        f"alarms that outlast an event: {summary.overhang_events}, "
        f"{summary.overhang_seconds:.3g} s in all, the longest {summary.longest_overhang:.3g} s{felt}"
    )


def _estimate(estimate: Interval, factor: float = 1.0) -> str:
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


# --- tune -------------------------------------------------------------------------------------------------------------


def tune_tables(tuning: ContactTuning) -> Iterator[Table]:
    """List the tables to print: what is found, by joint, then results by pretension."""
    report = tune_report.build_report(tuning)
    pushes, deviation = report["pushes"], tuning.deviation_
    by_joint = zip(report["joints"], pushes["torque"], deviation.base, deviation.per_force, strict=True)
    yield (
        f"{report['finger']}: {report['method']}",
        (
            "joint",
            f"found within {1e3 * pushes['within_s']:.0f} ms,\n9 of 10: from mN·m",
            "deviation\nmN·m",
            "+ per N\nmN·m/N",
        ),
        [(joint, *("–" if value is None else f"{1e3 * value:.3g}" for value in each)) for joint, *each in by_joint],
    )
    yield (
        "free motion",
        ("mean force, N", "minutes", "residual rms\nmN·m"),
        [
            (
                f"{each['mean_force']:.3g}",
                f"{each['minutes']:.1f}",
                ", ".join(f"{1e3 * value:.2g}" for value in each["free_rms"]),
            )
            for each in report["pretensions"]
        ],
    )


def tune_lines(tuning: ContactTuning) -> Iterator[str]:
    """List the lines to print: what was asked for and found, and the noise of bias and sensors."""
    report = tune_report.build_report(tuning)
    yield report["sentence"]
    kept_out, bias, sensors = report["kept_out"], report["bias"], report["sensor_fault"]
    low, high = kept_out["interval"]
    if kept_out["alarms"]:
        where = ", ".join(f"{each['alarms']} in {each['path']}" for each in kept_out["recordings"] if each["alarms"])
        yield (
            f"kept out: {where}; the longest {kept_out['longest_s']:.3g} s, "
            f"{100 * kept_out['share_in_alarm']:.2g} % of the time in alarm"
        )
    yield f"with 95 % confidence between {low:.3g} and {high:.3g} false alarms an hour"
    forces = report["holds_for"]
    yield (
        f"learned at mean tendon forces of {forces['lowest_force']:.3g} to {forces['highest_force']:.3g} N; beyond "
        "them bounds are extrapolated"
    )
    yield (
        f"bias: noise {1e3 * bias['noise_std']:.3g} mN·m + {1e3 * bias['noise_std_per_force']:.3g} mN·m per N, "
        f"time constant {bias['time_constant']:.3g} s at {bias['mean_force']:.3g} N"
    )
    if sensors["keys"] is None:
        yield f"sensor faults are not watched: {sensors['left_out']}"
    else:
        yield (
            f"sensor faults: forces differ from those of their springs by up to {sensors['largest_difference']:.2g} N "
            f"in free motion, {sensors['keys']['spring_margin']:.3g} N are allowed"
        )
