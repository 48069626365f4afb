"""What the findings about recordings say: the observation, its probable cause and what to write."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from tendonfmu.arrays import Numbers
from tendonfmu.files import are, counted
from tendonfmu.model import Finding
from tendonfmu.recordings.channels import JITTER, LOST_SHARE, Clipped, Clock, Coarse, Held
from tendonfmu.recordings.kinematics import Balance, Correction, Repair
from tendonfmu.recordings.match_map import what_to_set, what_to_write
from tendonfmu.recordings.recording import GROUP_PER, GROUPS, Recording

EQUATION = "position − force/stiffness = moment arms × joint angles"
_REASONS = {
    "tendon_force": "the force falls where its spring stretches",
    "tendon_position": "the position runs against the other tendons and the joints",
    "joint_position": "the measured angle runs against the angle computed from the tendons",
    "joint_velocity": "the velocity runs against the angle",
    "external_torque": "it has to be the load that the tendons hold",
}


def element(column: str) -> tuple[str, int]:
    """Return the group and the index, from 0, of a column's name."""
    group, index = column.rstrip("]").split("[")
    return group, int(index) - 1


def verdict(recording: Recording, findings: Sequence[Finding]) -> str:
    """Say in one line whether a recording belongs to the finger."""
    severities = [finding.severity for finding in findings]
    errors, warnings = severities.count("error"), severities.count("warning")
    words = "does not belong to this finger as it is" if errors else "belongs to this finger"
    counts = f"{counted(errors, 'error')}, {counted(warnings, 'warning')}" if findings else "nothing found"
    length = recording.time[-1] - recording.time[0]
    return f"{recording.path}: {words}: {counted(len(recording), 'sample')}, {length:.4g} s; {counts}"


# --- signs, order, units ----------------------------------------------------------------------------------------------


def repair(path: Path, found: Repair) -> Finding:
    """Describe a correction that makes the equations fit."""
    correction = found.correction
    seen = (
        f"{EQUATION} leaves {_percent(found.misfit)} of the variance unexplained, and {_percent(found.left)} once "
        "corrected"
    )
    probably = _cause(correction)
    if found.alternatives:
        others = [_in_words(other) for other in found.alternatives[:3]]
        more = len(found.alternatives) - len(others)
        probably += f", or equally likely {'; or '.join(others)}{f'; or {more} more' if more else ''}"
    return _of_correction(path, correction, seen, probably)


def velocity(path: Path, correction: Correction, slope: float) -> Finding:
    """Describe a joint velocity that does not belong to its angle."""
    seen = f"the angle changes by {slope:.4g} times the integral of the velocity; expected 1"
    if correction.kind == "exchange":
        seen = "the angle of each joint changes with the velocity of the other joint"
    return _of_correction(path, correction, seen, _cause(correction))


def turns(path: Path, turn: Numbers, joints: Sequence[str], correction: Correction | None) -> Finding:
    """Describe angles that no finger reaches. turn: [n] rad, range of each joint."""
    j = int(np.argmax(turn))
    seen = f"tendon positions, forces and moment arms turn joint {joints[j]} by up to {turn[j]:.4g} rad"
    if correction is None:
        return Finding("error", "scale", path, ("tendon_position",), seen, "a wrong unit", "check the units of the map")
    probably = _cause(correction)
    if correction.columns[0].startswith("tendon_force"):
        probably += ", or tendons[...].stiffness is in another unit than N/m"
    return _of_correction(path, correction, seen, probably)


def _of_correction(path: Path, correction: Correction, seen: str, probably: str) -> Finding:
    entries: dict[str, dict[str, float | str]] = {}
    if correction.kind == "exchange":
        entries = {column: {"exchange": source} for column, source in correction.pairs}
    else:
        entries = {column: {correction.kind: correction.factor} for column in correction.columns}
    write = what_to_write(correction)
    return Finding("error", correction.kind, path, correction.columns, seen, probably, write, entries)


def _in_words(correction: Correction) -> str:
    if correction.kind == "exchange":
        sources = dict(correction.pairs)
        if all(sources[source] == column for column, source in correction.pairs):
            return " and ".join(
                f"{column} exchanged with {source}" for column, source in correction.pairs if column < source
            )
        return ", ".join(f"{column} read from the column of {source}" for column, source in correction.pairs)
    word = "sign -1" if correction.kind == "sign" else f"scale {correction.factor:.6g}"
    return f"{_columns(correction.columns)}: {word}"


def _cause(correction: Correction) -> str:
    group = element(correction.columns[0])[0]
    if correction.kind == "exchange":
        groups = {element(column)[0] for column in correction.columns}
        return "tendons in another order" if len(groups) > 1 else f"columns of {group} in another order"
    if correction.kind == "sign":
        return f"a wrong sign: {_REASONS[group]}"
    return f"{group} in {correction.unit}, expected {GROUPS[group][0]}"


def _columns(columns: Sequence[str]) -> str:
    """Return `tendon_force[1..4]` for a whole group in order, else the names."""
    group, first = element(columns[0])
    if len(columns) > 1 and list(columns) == [f"{group}[{first + 1 + k}]" for k in range(len(columns))]:
        return f"{group}[{first + 1}..{first + len(columns)}]"
    return ", ".join(columns)


# --- what fits nowhere ------------------------------------------------------------------------------------------------


def columns(path: Path, group: str, found: int, counts: Mapping[str, int]) -> Finding:
    """Describe a group with too many or too few columns. counts: tendons and joints of the finger."""
    return Finding(
        "error",
        "columns",
        path,
        (group,),
        f"{counted(found, 'column')} {group}[...], expected {counts[GROUP_PER[group]]}: the finger has "
        f"{counted(counts['joint'], 'joint')} and {counted(counts['tendon'], 'tendon')}",
        "a recording of another finger",
        f"give one {group}[...] for each {GROUP_PER[group]}",
    )


def unfit(path: Path, left: float, severity: str, balance: Balance) -> Finding:
    """Describe equations that no correction makes fit."""
    worst = balance.worst_tendon()
    return Finding(
        severity,
        "unfit",
        path,
        (f"tendon_position[{worst + 1}]",),
        f"{EQUATION} leaves {_percent(left)} of the variance unexplained, most at tendon {worst + 1}; no sign, order "
        "or unit of columns corrects it",
        "moment_arms or stiffness of another finger, or positions in turns of a motor",
        "compare moment_arms, stiffness and the order of the tendons with the finger; for a motor's angle in rad write "
        'into the map "unit": "m" and "scale", the radius of its pulley in m',
    )


def against(path: Path, share: Numbers, joints: Sequence[str], turning: Sequence[Correction]) -> Finding:
    """Describe joints that move against the pull of their tendons."""
    names = " and ".join(name for name, part in zip(joints, share, strict=True) if part < 0.0)
    seen = f"{names} moves against the pull of its tendons ({_percent(-float(share.min()))} of its power)"
    by_hand = "a finger that was moved by hand"
    if not turning:
        write = 'write "sign": -1 into the map at the reversed columns, or record without touching the finger'
        return Finding("warning", "against", path, ("tendon_force", "tendon_position"), seen, by_hand, write)
    others = "".join(f", or equally likely {_in_words(other)}" for other in turning[1:4])
    return _of_correction(path, turning[0], seen, f"{_cause(turning[0])}{others}, or {by_hand}")


def reference(path: Path, column: str, left: float, opposed: float) -> Finding:
    """Describe an external torque with the wrong sign."""
    correction = Correction("sign", (column,), -1.0)
    seen = f"joint torque minus this column leaves {left:.4g} N.m rms, and {opposed:.4g} N.m with sign -1"
    return _of_correction(path, correction, seen, _cause(correction))


def pushing(path: Path, column: str, name: str, share: float, least: float, is_zero: bool) -> Finding:
    """Describe a tendon that pushes. is_zero: the sensor's zero is wrong rather than its sign."""
    seen = f"negative in {_percent(share)} of the samples, down to {least:.4g} N, but tendon {name} can only pull"
    if is_zero:
        severity = "error" if share > 0.5 else "warning"
        write = (
            f'write into the map of columns, at "{column}": "offset", the reading of the sensor at zero force: minus '
            "the force at which it was zeroed"
        )
        return Finding(severity, "pushing", path, (column,), seen, "a sensor zeroed under load, or slack", write)
    return Finding(
        "error",
        "sign",
        path,
        (column,),
        seen,
        'a wrong sign, or a cable loop ("bidirectional": true)',
        what_to_set((column,), {"sign": -1.0}),
        {column: {"sign": -1.0}},
    )


# --- clock ------------------------------------------------------------------------------------------------------------


def senseless_rate(path: Path, clock: Clock, samples: int) -> Finding:
    """Describe a sample rate that no control loop has."""
    seen = f"{counted(samples, 'sample')} {clock.step:.4g} s apart, {1 / clock.step:.4g} per second"
    if clock.unit is None:
        return Finding("error", "clock", path, ("time",), seen, "a wrong unit", "give time in s")
    factor, unit = clock.unit
    count = ", or the number of the sample" if abs(clock.step - 1.0) < 1e-9 else ""
    return Finding(
        "error",
        "clock",
        path,
        ("time",),
        seen,
        f"time in {unit}{count}",
        what_to_set(("time",), {"scale": factor}),
        {"time": {"scale": factor}},
    )


def clock_warnings(path: Path, clock: Clock, time: Numbers) -> Iterator[Finding]:
    """Describe gaps, lost samples and uneven steps."""
    if clock.gaps:
        first = clock.gaps[0]
        yield Finding(
            "warning",
            "gaps",
            path,
            ("time",),
            f"{counted(len(clock.gaps), 'gap')}, the first of {time[first] - time[first - 1]:.4g} s after row {first}",
            "an interrupted log, or several put together",
            "split it there if the finger was touched meanwhile",
        )
    share = clock.lost / (len(time) + clock.lost)
    if share > LOST_SHARE:
        yield Finding(
            "warning",
            "lost",
            path,
            ("time",),
            f"{clock.lost} of {len(time) + clock.lost} samples {are(clock.lost)} missing ({_percent(share)}), steps of "
            f"{clock.step:.4g} s",
            "a log that drops samples",
            "record with a larger buffer, or fewer channels",
        )
    if clock.jitter > JITTER:
        yield Finding(
            "warning",
            "jitter",
            path,
            ("time",),
            f"steps of {clock.step:.4g} s vary by {_percent(clock.jitter)} (standard deviation)",
            "the time at which a sample was written, not taken",
            "log the time of the controller's own clock; velocities are wrong by the same share",
        )


# --- channels ---------------------------------------------------------------------------------------------------------


def held(path: Path, found: Held, severity: str) -> Finding:
    """Describe a channel that holds a value."""
    first, last = found.first
    return Finding(
        severity,
        "held",
        path,
        (found.column,),
        f"holds {found.value:.6g} in {_percent(found.share)} of the samples, first from {first:.4g} to "
        f"{last:.4g} s, while other channels change",
        "a stuck sensor, or a cable that is not plugged in",
        "replace the sensor's log, or cut these times out",
    )


def clipped(path: Path, found: Clipped, severity: str) -> Finding:
    """Describe a channel that saturates."""
    end, value = ("above", "largest") if found.is_top else ("below", "smallest")
    return Finding(
        severity,
        "clipped",
        path,
        (found.column,),
        f"repeats its {value} value {found.value:.6g} in {_percent(found.share)} of the samples, and reaches it fast",
        f"a sensor or amplifier that saturates {end} it",
        "record with a larger range, or less force or travel",
    )


def coarse(path: Path, found: Coarse) -> Finding:
    """Describe a channel with few steps."""
    unit = GROUPS[element(found.column)[0]][0]
    return Finding(
        "warning",
        "coarse",
        path,
        (found.column,),
        f"moves by {found.range:.4g} {unit} in {counted(round(found.range / found.step), 'step')} of "
        f"{found.step:.4g} {unit}",
        "a log rounded to few digits, or a coarse sensor",
        "log more digits, or record a larger motion",
    )


def _percent(share: float) -> str:
    return f"{100 * share:.2g} %" if share < 0.995 else f"{100 * share:.0f} %"
