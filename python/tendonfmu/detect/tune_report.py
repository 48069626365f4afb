"""The report of a tuning, "tendonfmu-tune-2": what was learned, and what it does on motion that was kept out."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from tendonfmu.detect.tuning import SURE, WITHIN, ContactTuning
from tendonfmu.files import finite
from tendonfmu.statistics import intervals

FORMAT = "tendonfmu-tune-2"


def build_report(tuning: ContactTuning) -> dict[str, Any]:
    """Build the report of a tuning, in SI units with None for what is not known."""
    names = tuning.description_.joint_names
    force = tuning.residuals_.force
    report = {
        "format": FORMAT,
        "finger": tuning.description_.name,
        "joints": names,
        "kinematics": tuning.options.kinematics,
        "method": tuning.options.method,
        "false_alarms_per_hour": tuning.options.false_alarms_per_hour,
        "minutes": 60.0 * tuning.hours_,
        "more_minutes": tuning.more_minutes_,
        "kept_out": _kept_out(tuning),
        "pushes": {"within_s": WITHIN, "share": SURE, "torque": tuning.push_.tolist()},
        "holds_for": {"lowest_force": float(force.min()), "highest_force": float(force.max())},
        "warnings": list(tuning.warnings_),
        "bias": {**tuning.bias_.keys(), "time_constant": tuning.bias_.time_constant, "mean_force": tuning.bias_.force},
        "contact": tuning.description_.data["contact"],
        "factor": tuning.loop_.factor,
        "tail": _tail(tuning),
        "pretensions": _pretensions(tuning),
        "sensor_fault": _sensors(tuning),
        "seconds": tuning.seconds_,
    }
    report = {key: finite(value) for key, value in report.items()}
    return {**report, "sentence": sentence(report)}


def sentence(report: Mapping[str, Any]) -> str:
    """Say how many false alarms were asked for and found, and which pushes are found at the least sensitive joint."""
    found, pushes = report["kept_out"], report["pushes"]
    minutes = found["minutes"]
    long = f"{minutes / 60.0:.1f} h" if minutes >= 60.0 else f"{minutes:.2g} min"
    alarms = "none" if found["alarms"] == 0 else f"{found['alarms']}"
    pushed, joint = least_sensitive(report)
    ending = f"{joint} are found within {1e3 * pushes['within_s']:.0f} ms, nine of ten."
    sized = "No pushes at" if pushed is None else f"Pushes of more than {1e3 * pushed:.2g} mN·m at"
    return (
        f"At most {report['false_alarms_per_hour']:g} alarms an hour were asked for; {alarms} in {long} of motion that "
        f"was kept out. {sized} {ending}"
    )


def least_sensitive(report: Mapping[str, Any]) -> tuple[float | None, str]:
    """Return the largest of the torques that are found, None if at a joint none is, and its joint."""
    torques = report["pushes"]["torque"]
    worst = torques.index(None) if None in torques else int(np.argmax(torques))
    return torques[worst], report["joints"][worst]


def _rate(alarms: int, hours: float) -> dict[str, Any]:
    """Return alarms and their rate (1/h) with its 95 % interval."""
    rate = intervals.rate(alarms, hours)
    return {"alarms": alarms, "minutes": 60.0 * hours, "per_hour": rate.value, "interval": [rate.low, rate.high]}


def _kept_out(tuning: ContactTuning) -> dict[str, Any]:
    found = tuning.kept_out_
    return {
        **_rate(found.alarms, found.hours),
        "longest_s": max(part.longest for part in found.parts),
        "share_in_alarm": found.share_in_alarm,
        "at_start": sum(part.at_start for part in found.parts),
        "recordings": [
            {
                "path": source,
                "alarms": sum(len(part.begins) for part in found.parts if part.source == source),
                "minutes": 60.0 * sum(part.hours for part in found.parts if part.source == source),
            }
            for source in dict.fromkeys(part.source for part in found.parts)
        ],
    }


def _tail(tuning: ContactTuning) -> list[dict[str, Any]]:
    """Return the alarms in motion that was kept out, over factors on the bounds; that of the finger is 1."""
    loop = tuning.loop_
    return [
        {"factor": float(factor / loop.factor), **_rate(int(alarms), tuning.hours_)}
        for factor, alarms in zip(loop.tried, loop.alarms.sum(axis=1), strict=True)
    ]


def _pretensions(tuning: ContactTuning) -> list[dict[str, Any]]:
    residuals = tuning.residuals_
    force, rms = residuals.of_pretensions(residuals.force), residuals.rms()
    minutes = 60.0 * np.bincount(residuals.group, residuals.hours)
    columns = zip(force.tolist(), minutes.tolist(), rms.tolist(), strict=True)
    return [{"mean_force": mean, "minutes": long, "free_rms": spread} for mean, long, spread in columns]


def _sensors(tuning: ContactTuning) -> dict[str, Any]:
    """Return the keys of sensor_fault, or why there are none, and the largest difference of force and spring (N)."""
    rule = tuning.sensors_
    keys = None if rule.keys is None else dict(rule.keys)
    return {"keys": keys, "largest_difference": rule.largest, "left_out": rule.why}
