"""The report of a tuning, "tendonfmu-tune-1": the chosen values, the motion they rest on, and the alarms they give."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from tendonfmu.detect.alarm_level import rate_limit
from tendonfmu.detect.free_motion import LoopAlarms
from tendonfmu.detect.tuning import ContactTuning
from tendonfmu.files import finite
from tendonfmu.statistics import intervals

FORMAT = "tendonfmu-tune-1"
FACTORS = np.round(np.geomspace(0.5, 2.0, 25), 6)  # on the chosen bases, for the tail of the alarms


def build_report(tuning: ContactTuning) -> dict[str, Any]:
    """Build the report of a tuning, in SI units with None for what is not known."""
    report = {
        "format": FORMAT,
        "finger": tuning.description_.name,
        "joints": tuning.description_.joint_names,
        "kinematics": tuning.options.kinematics,
        "method": tuning.method,
        "false_alarms_per_hour": tuning.options.false_alarms_per_hour,
        "confidence": tuning.confidence,
        "tuned_for_per_hour": tuning.rate_,
        "more_minutes": tuning.more_minutes_,
        "holds_for": _holds_for(tuning),
        "minutes": 60.0 * tuning.hours_,
        "allowed_alarms": tuning.allowed_,
        "warnings": list(tuning.warnings_),
        "bias": {**tuning.bias_.keys(), "time_constant": tuning.bias_.time_constant, "mean_force": tuning.bias_.force},
        "contact": tuning.description_.data["contact"],
        "levels": {name: _level(tuning, name) for name in tuning.lines_},
        "level_raised": tuning.level_raised_,
        "in_sample": _counted(tuning, tuning.tail(np.ones(1))[0][1]),
        "held_out": _counted(tuning, tuning.held_out_[0]),
        "closed_loop": _loop(tuning),
        "rest": _rest(tuning),
        "sensor_fault": _sensors(tuning),
        "pretensions": [_pretension(tuning, g) for g in range(len(tuning.pretensions_))],
        "tail": [_point(tuning, *each) for each in tuning.tail(FACTORS)],
        "tried": _tried(tuning),
        "seconds": tuning.seconds_,
    }
    return {key: finite(value) for key, value in report.items()}


def _holds_for(tuning: ContactTuning) -> dict[str, Any]:
    """Return the mean tendon forces (N) that the thresholds were chosen on, and the number of pretensions."""
    low, high = tuning.forces_
    return {"lowest_force": low, "highest_force": high, "pretensions": len(tuning.pretensions_)}


def _counted(tuning: ContactTuning, alarms: int, hours: float | None = None) -> dict[str, Any]:
    """Return alarms, their rate (1/h) with its two-sided 95 % interval, and its limit at the confidence asked for."""
    span = tuning.hours_ if hours is None else hours
    rate = intervals.rate(alarms, span)
    return {
        "alarms": alarms,
        "minutes": 60.0 * span,
        "per_hour": rate.value,
        "interval": [rate.low, rate.high],
        "limit": rate_limit(alarms, span, tuning.confidence),
    }


def _rest(tuning: ContactTuning) -> dict[str, Any] | None:
    """Return the rests that contact.rest was learned from, and its alarms; None without rests."""
    rule = tuning.rest_
    if rule is None:
        return None
    counted = {"alarms": rule.alarms, "held_out": rule.held_out, "limit": rule.limit}
    return {"rests": rule.rests, "minutes": 60.0 * rule.hours, **counted}


def _sensors(tuning: ContactTuning) -> dict[str, Any]:
    """Return the keys of sensor_fault, or why there are none, and the largest difference of force and spring (N)."""
    rule = tuning.sensors_
    keys = None if rule.keys is None else dict(rule.keys)
    return {"keys": keys, "largest_difference": rule.largest, "left_out": rule.why}


def _level(tuning: ContactTuning, name: str) -> dict[str, Any]:
    level, line = tuning.levels_[name], tuning.lines_[name]
    return {
        "in_sample": level.in_sample,
        "held_out": level.held_out,
        "compared": {"base": line.bound.base.tolist(), "per_force": line.bound.per_force.tolist()},
    }


def _loop(tuning: ContactTuning) -> dict[str, Any]:
    alarms = sum(loop.alarms for loop in tuning.loop_)
    seconds = sum(loop.seconds for loop in tuning.loop_)
    return {
        **_counted(tuning, alarms),
        "longest_s": max(loop.longest for loop in tuning.loop_),
        "share_in_alarm": sum(loop.alarm_seconds for loop in tuning.loop_) / seconds,
        "at_start": sum(loop.at_start for loop in tuning.loop_),
        "parts": [_part(loop) for loop in tuning.loop_],
    }


def _part(loop: LoopAlarms) -> dict[str, Any]:
    return {
        "path": loop.source,
        "minutes": 60.0 * loop.hours,
        "alarms": loop.alarms,
        "at_start": loop.at_start,
        "longest_s": loop.longest,
        "share_in_alarm": loop.alarm_seconds / loop.seconds,
        "begins": loop.begins,
        "ends": loop.ends,
    }


def _pretension(tuning: ContactTuning, g: int) -> dict[str, Any]:
    pretension = tuning.pretensions_[g]
    return {
        "mean_force": pretension.force,
        "free_rms": pretension.rms,
        **_counted(tuning, pretension.alarms, pretension.hours),
        "torque_std_mean_square": tuning.deviation_.square[g].tolist(),
    }


def _point(tuning: ContactTuning, factor: float, in_sample: int, held_out: int) -> dict[str, Any]:
    return {"factor": factor, "in_sample": _counted(tuning, in_sample), "held_out": _counted(tuning, held_out)}


def _tried(tuning: ContactTuning) -> list[dict[str, Any]]:
    line = tuning.lines_.get("innovation")
    if line is None:
        return []
    bound = line.bound
    return [{"stuck_share": bound.stuck_share, "jump_share": bound.jump_share, "least_load": math.exp(line.mean_log)}]
