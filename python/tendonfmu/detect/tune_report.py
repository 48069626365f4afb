"""The report of a tuning, "tendonfmu-tune-2": what was learned, and what it does on motion that was kept out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Final, Literal, TypedDict

import numpy as np

from tendonfmu.detect.tuning import SURE, WITHIN, ContactTuning
from tendonfmu.files import finite
from tendonfmu.json_types import Count, Kinematics, Schema, Share, Size, Sizes
from tendonfmu.statistics import intervals

FORMAT: Final = "tendonfmu-tune-2"


class Rates(TypedDict):
    alarms: Count
    minutes: Size
    per_hour: Size
    interval: Annotated[list[Size], Schema(minItems=2, maxItems=2)]


class TunedRecording(TypedDict):
    path: str
    alarms: Count
    minutes: Size


class KeptOut(Rates):
    longest_s: Size  # Longest alarm.
    share_in_alarm: Share  # Share of the time.
    at_start: Count  # Alarms before 2 s of motion, which do not count.
    recordings: Annotated[list[TunedRecording], Schema(minItems=1)]


class FoundPushes(TypedDict):
    within_s: Size
    share: Share
    torque: Sizes


class HoldsFor(TypedDict):
    lowest_force: Size
    highest_force: Size


class TunedBias(TypedDict):
    drift_variance: Size
    noise_std: Size
    noise_std_per_force: Size
    time_constant: Size
    mean_force: Size


class AtFactor(Rates):
    factor: Size


class AtPretension(TypedDict):
    mean_force: Size
    minutes: Size
    free_rms: list[Size]  # N·m by joint, rms of the residual in free motion.


class TunedSensors(TypedDict):
    keys: Mapping[str, Any] | None
    largest_difference: Size | None
    left_out: str


class TuneReport(TypedDict):
    """Report of `tendonfmu tune --report`. SI units; null stands for an unknown value.

    `interval` is a two-sided 95 % interval of a Poisson rate.
    """

    format: Literal["tendonfmu-tune-2"]
    finger: str  # Name of the finger.
    # Names of the joints, base first; all lists by joint have this order.
    joints: Annotated[list[str], Schema(minItems=1)]
    kinematics: Kinematics
    method: Annotated[str, Schema(enum=["bands", "paper"])]
    false_alarms_per_hour: Annotated[float, Schema(exclusiveMinimum=0)]  # The rate asked for.
    minutes: Size  # Counted minutes of free motion.
    more_minutes: Size  # Minutes of free motion missing for 3 expected alarms at that rate; 0 if none.
    # The finger as it runs over each recording (of one or two recordings: each quarter of their time) with numbers that
    # were learned from the others.
    kept_out: KeptOut
    # By joint, the sudden torque (N·m) of which a `share` is found within `within_s`: pushes of random sizes are added
    # to the recordings. null: none of up to 40 times the rms of the residual.
    pushes: FoundPushes
    # Mean tendon forces (N) of the recordings. Outside this range the bounds are extrapolated.
    holds_for: HoldsFor
    warnings: list[str]
    # Keys as written into the description, and the time constant (s) at the recordings' mean force (N).
    bias: TunedBias
    contact: Mapping[str, Any]  # Keys as written into the description.
    factor: Size  # Factor on all bounds at which the runs of the finger show the rate.
    tail: list[AtFactor]  # Alarms in the motion that was kept out, with all bounds times a factor.
    pretensions: Annotated[list[AtPretension], Schema(minItems=1)]
    # Keys as written into the description (null: none, with the reason in left_out), and the largest difference between
    # a tendon force and its spring in free motion (N).
    sensor_fault: TunedSensors
    seconds: Size  # Time of the computation.
    sentence: str  # What was asked for and found, in words.


def build_report(tuning: ContactTuning) -> TuneReport:
    """Build the report of a tuning, in SI units with None for what is not known."""
    force, bias = tuning.residuals_.force, tuning.bias_.keys()
    report: TuneReport = {
        "format": FORMAT,
        "finger": tuning.description_.name,
        "joints": tuning.description_.joint_names,
        "kinematics": tuning.options.kinematics,
        "method": tuning.options.method,
        "false_alarms_per_hour": tuning.options.false_alarms_per_hour,
        "minutes": 60.0 * tuning.hours_,
        "more_minutes": tuning.more_minutes_,
        "kept_out": _kept_out(tuning),
        "pushes": {"within_s": WITHIN, "share": SURE, "torque": tuning.push_.tolist()},
        "holds_for": {"lowest_force": float(force.min()), "highest_force": float(force.max())},
        "warnings": list(tuning.warnings_),
        "bias": {
            "drift_variance": bias["drift_variance"],
            "noise_std": bias["noise_std"],
            "noise_std_per_force": bias["noise_std_per_force"],
            "time_constant": tuning.bias_.time_constant,
            "mean_force": tuning.bias_.force,
        },
        "contact": tuning.description_.data["contact"],
        "factor": tuning.loop_.factor,
        "tail": _tail(tuning),
        "pretensions": _pretensions(tuning),
        "sensor_fault": _sensors(tuning),
        "seconds": tuning.seconds_,
        "sentence": "",
    }
    report = finite(report)
    report["sentence"] = sentence(report)
    return report


def sentence(report: TuneReport) -> str:
    """Say how many false alarms were asked for and found, and which pushes are found at the least sensitive joint."""
    found, pushes = report["kept_out"], report["pushes"]
    minutes = found["minutes"]
    long = f"{minutes / 60.0:.1f} h" if minutes >= 60.0 else f"{minutes:.2g} min"
    alarms = "none" if found["alarms"] == 0 else f"{found['alarms']}"
    asked, least = report["false_alarms_per_hour"], found["interval"][0]
    more = f", with 95 % confidence more than {least:.0f} an hour" if least is not None and least > asked else ""
    pushed, joint = least_sensitive(report["joints"], pushes["torque"])
    ending = f"{joint} are found within {1e3 * pushes['within_s']:.0f} ms, nine of ten."
    sized = "No pushes at" if pushed is None else f"Pushes of more than {1e3 * pushed:.3g} mN·m at"
    return (
        f"At most {asked:g} alarms an hour were asked for; {alarms} in {long} of motion that was kept out{more}. "
        f"{sized} {ending}"
    )


def least_sensitive(joints: Sequence[str], torques: Sizes) -> tuple[float | None, str]:
    """Return the largest of the torques that are found, None if at a joint none is, and its joint."""
    known = [torque for torque in torques if torque is not None]
    worst = torques.index(max(known) if len(known) == len(torques) else None)
    return torques[worst], joints[worst]


def _rate(alarms: int, hours: float) -> Rates:
    """Return alarms and their rate (1/h) with its 95 % interval."""
    rate = intervals.rate(alarms, hours)
    return {"alarms": alarms, "minutes": 60.0 * hours, "per_hour": rate.value, "interval": [rate.low, rate.high]}


def _kept_out(tuning: ContactTuning) -> KeptOut:
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


def _tail(tuning: ContactTuning) -> list[AtFactor]:
    """Return the alarms in motion that was kept out, over factors on the bounds; that of the finger is 1."""
    loop = tuning.loop_
    return [
        {"factor": float(factor / loop.factor), **_rate(int(alarms), tuning.hours_)}
        for factor, alarms in zip(loop.tried, loop.alarms.sum(axis=1), strict=True)
    ]


def _pretensions(tuning: ContactTuning) -> list[AtPretension]:
    residuals = tuning.residuals_
    force, rms = residuals.of_pretensions(residuals.force), residuals.rms()
    minutes = 60.0 * np.bincount(residuals.group, residuals.hours)
    columns = zip(force.tolist(), minutes.tolist(), rms.tolist(), strict=True)
    return [{"mean_force": mean, "minutes": long, "free_rms": spread} for mean, long, spread in columns]


def _sensors(tuning: ContactTuning) -> TunedSensors:
    """Return the keys of sensor_fault, or why there are none, and the largest difference of force and spring (N)."""
    rule = tuning.sensors_
    keys = None if rule.keys is None else dict(rule.keys)
    return {"keys": keys, "largest_difference": rule.largest, "left_out": rule.why}
