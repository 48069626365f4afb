"""Which training motion a finger or a rig gets, and what it excites (command `tendonfmu excite`).

This module computes and does not print.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from tendonfmu import estimate
from tendonfmu.arrays import Data, Numbers
from tendonfmu.errors import InputError
from tendonfmu.excite import balanced_forces, pretension_vector
from tendonfmu.excite.excitation import SLOW, Excitation, Plan, Stroke, Variation, plan_excitation
from tendonfmu.model import Finger, friction_numbers, read_finger
from tendonfmu.options import ExciteOptions
from tendonfmu.simulate import finger_with_limits, is_rig

DEFAULT_PRETENSION = 10.0  # N
STRONGEST = 1e6  # N
MARGIN = 0.05  # of a rig's range between limits, left out at either end
UNKNOWN_RANGE = 0.5  # rad, either side of the rest angle
ANALYSIS_RATE = 25.0  # 1/s; 100 gives the same count for the index finger, and standard errors within 1 %


@dataclass(frozen=True)
class Range:
    """Range of one joint."""

    name: str  # name of the joint
    low: float  # lowest and highest angle (rad)
    high: float
    source: str  # where the range comes from, in words
    guessed: bool = False  # whether nothing was known about it


@dataclass(frozen=True)
class Subject:
    """The finger that is moved."""

    finger: Finger  # its description
    limits: list[tuple[float, float]] | None  # lowest and highest angle of each joint [n] (rad), if a rig gives them


@dataclass(frozen=True)
class JointCoverage:
    """How one joint moves."""

    lowest: float  # angles (rad)
    highest: float
    fastest: float  # greatest speed (rad/s)
    strokes: int  # their numbers
    reversals: int
    slow_reversals: int  # number of reversals between two strokes of at most `SLOW` of the greatest speed
    rests: int  # number of rests between strokes
    resting: float  # time at rest between strokes (s)


@dataclass(frozen=True)
class ExciteResult:
    """A motion and what it excites."""

    subject: Subject  # what was asked for
    plan: Plan
    ranges: list[Range]
    motion: Excitation  # the motion
    joints: list[JointCoverage]  # how each joint moves and each friction effect slides
    effects: list[estimate.EffectCoverage]
    noise: estimate.Noise  # the assumed noise
    slack: list[float]  # time during which each tendon would have to push [m] (s)
    judgement: estimate.Judgement  # how well the motion identifies each number


def read_subject(path: Path) -> Subject:
    """Read a finger description or a rig."""
    if not is_rig(path):
        return Subject(read_finger(path), None)
    finger, joints = finger_with_limits(path)
    limits = list(zip(joints.lower, joints.upper, strict=True))
    return Subject(finger, limits if np.isfinite(limits).all() else None)  # limits are optional in a rig


# --- ranges -----------------------------------------------------------------------------------------------------------


def find_ranges(subject: Subject, given: Sequence[str]) -> list[Range]:
    """Return the range of each joint."""
    # given: (rad); returns [n]
    names = subject.finger.joint_names
    asked = dict(_parse_range(text, names) for text in given)
    ranges = []
    for j, name in enumerate(names):
        limits = subject.limits[j] if subject.limits is not None else None
        if j not in asked:
            ranges.append(_default_range(subject.finger.data, j, name, limits))
            continue
        low, high = asked[j]
        if limits is not None and not limits[0] <= low <= high <= limits[1]:
            raise InputError(
                f"--range {name}={low:g}:{high:g}: beyond the joint; expected within its limits "
                f"{limits[0]:g} to {limits[1]:g} rad"
            )
        ranges.append(Range(name, low, high, "given"))
    return ranges


def find_pretensions(subject: Subject, given: Sequence[float]) -> list[float]:
    """Return the pretensions of the motion."""
    # given: (N)
    if pretension_vector(subject.finger.data).any():
        return list(given) or [DEFAULT_PRETENSION]
    if any(given):
        raise InputError(f"--pretension {max(given):g}: the finger has only cable loops and holds none; expected 0")
    return [0.0] * max(len(given), 1)


def find_variation(
    given: str | None, every: float, pretension: Sequence[float] | None = None, alternate: float | None = None
) -> Variation | None:
    """Return how the tensions change."""
    # given: (N); every: (s)
    if given is None:
        return None
    for option, value in (("--pretension", pretension), ("--alternate", alternate)):
        if value:
            raise InputError(f"--vary-tension {given}: with {option}; expected one of the two")
    low, high = _span(given)
    if not 0.0 < low < high <= STRONGEST:
        raise InputError(f"--vary-tension {given}: expected LOW:HIGH in N, 0 < LOW < HIGH, at most {STRONGEST:g}")
    return Variation(low, high, every)


def as_array(ranges: Sequence[Range]) -> Numbers:
    """Return low and high of the ranges [n, 2] (rad)."""
    return np.array([[span.low, span.high] for span in ranges])


def _span(text: str) -> tuple[float, float]:
    """Read LOW:HIGH; NaN if it is none."""
    low, _, high = text.partition(":")
    try:
        return float(low), float(high)
    except ValueError:
        return math.nan, math.nan


def _parse_range(text: str, names: list[str]) -> tuple[int, tuple[float, float]]:
    joint, _, span = text.rpartition("=")
    low, high = _span(span)
    if not -1e3 <= low <= high <= 1e3:
        raise InputError(f"--range {text}: expected JOINT=LOW:HIGH in rad, LOW <= HIGH")
    if joint in names:
        return names.index(joint), (low, high)
    if joint.isdecimal() and 1 <= int(joint) <= len(names):
        return int(joint) - 1, (low, high)
    raise InputError(f"--range {text}: no joint {joint!r}; expected 1 to {len(names)} or one of {', '.join(names)}")


def _default_range(data: Data, j: int, name: str, limits: tuple[float, float] | None) -> Range:
    edges = [(tendon.get("edge_friction") or [])[j + 1 : j + 2] for tendon in data["tendons"]]
    angles = [angle for edge in edges for law in edge if law is not None for angle in law.get("angles") or []]
    if limits is not None:
        margin = MARGIN * (limits[1] - limits[0])
        inside = (limits[0] + margin, limits[1] - margin)
        low, high = max(min(angles, default=inside[0]), inside[0]), min(max(angles, default=inside[1]), inside[1])
        if low < high:
            return Range(name, low, high, f"limits of the rig less {MARGIN:.0%} at either end, and working points")
        return Range(name, *inside, f"limits of the rig less {MARGIN:.0%} at either end")
    if len(set(angles)) > 1:
        return Range(name, min(angles), max(angles), "working points of the edges behind it")
    rest = float((data["joints"][j].get("cover") or {}).get("rest_angle") or 0.0)
    source = f"range unknown, moves {UNKNOWN_RANGE:g} rad to either side of the rest angle {rest:.3g} rad"
    return Range(name, rest - UNKNOWN_RANGE, rest + UNKNOWN_RANGE, source, guessed=True)


def plan_for(subject: Subject, ranges: Sequence[Range], options: ExciteOptions) -> Plan:
    """Return what the motion of a finger should be like."""
    vary = find_variation(options.vary_tension, options.vary_every, options.pretension, options.alternate)
    return Plan(
        as_array(ranges),
        options.max_speed,
        options.duration,
        find_pretensions(subject, options.pretension),
        options.alternate,
        options.rate,
        options.seed,
        vary,
        options.max_acceleration,
    )


# --- the whole --------------------------------------------------------------------------------------------------------


def excite(
    subject: Subject, ranges: list[Range], plan: Plan, progress: estimate.Progress | None = None
) -> ExciteResult:
    """Plan the motion and judge it."""
    # ranges: [n]
    finger, data = subject.finger, subject.finger.data
    motion = plan_excitation(data, plan)
    every = max(1, round(plan.rate / ANALYSIS_RATE))
    samples = {
        "time": motion.time[::every],
        "joint_position": motion.joint_position[::every],
        "joint_velocity": motion.joint_velocity[::every],
    }
    force = balanced_forces(finger, samples, motion.tension[::every])
    numbers, noise = friction_numbers(data), estimate.noise_of(data, 1 / plan.rate)
    parts = estimate.sensitivities(finger, numbers, {**samples, "tendon_force": force}, progress)
    known = estimate.information(parts, samples["time"], np.abs(force).mean(axis=1), noise)
    coverage = estimate.coverage_of(data, motion.joint_position, motion.joint_velocity, estimate.durations(motion.time))
    pulls = np.array([not tendon.get("bidirectional") for tendon in data["tendons"]])
    slack = ((force < 0) & pulls).T @ estimate.durations(samples["time"])
    return ExciteResult(
        subject=subject,
        plan=plan,
        ranges=ranges,
        motion=motion,
        joints=joint_coverage(motion, plan.max_speed),
        effects=coverage,
        noise=noise,
        slack=slack.tolist(),
        judgement=estimate.judge(numbers, known, coverage),
    )


def joint_coverage(motion: Excitation, max_speed: float) -> list[JointCoverage]:
    """Return the coverage of every joint. max_speed: rad/s, of the plan."""
    return [
        _joint(strokes, motion.joint_position[:, j], motion.joint_velocity[:, j], max_speed)
        for j, strokes in enumerate(motion.strokes)
    ]


def _joint(strokes: list[Stroke], position: Numbers, velocity: Numbers, max_speed: float) -> JointCoverage:
    turns = [
        (before, after)
        for before, after in pairwise(strokes)
        if (before.target - before.start) * (after.target - after.start) < 0
    ]
    rests = [after.begin - before.end for before, after in pairwise(strokes) if after.begin > before.end]
    return JointCoverage(
        lowest=float(position.min()),
        highest=float(position.max()),
        fastest=float(np.abs(velocity).max()),
        strokes=len(strokes),
        reversals=len(turns),
        slow_reversals=sum(max(before.speed, after.speed) <= SLOW * max_speed for before, after in turns),
        rests=len(rests),
        resting=float(sum(rests)),
    )


def report(result: ExciteResult, command: str) -> dict[str, Any]:
    """Return the whole result for `--report`. command: the command line as called."""
    plan, finger = result.plan, result.subject.finger
    return {
        "format": "tendonfmu-excitation-1",
        "command": command,
        "finger": finger.name,
        "seed": plan.seed,
        "rate": plan.rate,
        "duration": float(result.motion.time[-1]),
        "max_speed": plan.max_speed,
        "max_acceleration": plan.max_acceleration,
        "pretension": list(plan.pretensions) if plan.vary is None else None,
        "vary_tension": None if plan.vary is None else asdict(plan.vary),
        "blocks": [{"begin": a, "end": b, "pretension": level} for a, b, level in result.motion.blocks],
        "joints": [
            {"joint": j, "range": asdict(span), **asdict(cover)}
            for j, (span, cover) in enumerate(zip(result.ranges, result.joints, strict=True), start=1)
        ],
        "effects": [_effect_entry(cover) for cover in result.effects],
        "slack": result.slack,
        "assumed_noise": asdict(result.noise),
        "biases": len(finger.joint_names),
        **estimate.identifiability.as_json(result.judgement),
    }


def _effect_entry(cover: estimate.EffectCoverage) -> dict[str, Any]:
    effect = cover.effect
    entry = {
        "path": effect.path,
        "kind": effect.kind,
        "joint": effect.joint,
        "tendon": effect.tendon or None,
        "velocity_threshold": cover.threshold,
        "time": asdict(cover.times),
        "slowest": cover.slowest,
        "fastest": cover.fastest,
    }
    if effect.angles:
        entry["working_points"] = [
            {"angle": angle, "time": asdict(times)} for angle, times in zip(effect.angles, cover.points, strict=True)
        ]
    return entry
