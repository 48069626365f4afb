"""What the findings about recordings say: the observation, its probable cause and what to write into the map."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from tendonfmu.arrays import Numbers
from tendonfmu.files import are, counted, percent
from tendonfmu.model import Finding, Finger
from tendonfmu.recordings.converters import units
from tendonfmu.recordings.entry_types import LearnedNumber, RoutingEntry
from tendonfmu.recordings.faults import JITTER, LOST_SHARE, Clipped, Clock, Coarse, Held
from tendonfmu.recordings.kinematics import Balance, Correction, Repair
from tendonfmu.recordings.recording import GROUP_PER, GROUPS, Recording
from tendonfmu.recordings.routing import Learned, TendonRouting, routed

FORMAT = "tendonfmu-check-1"
SAME = 1e-6  # relative difference of two factors of one unit
EQUATION = "position − force/stiffness = moment arms × joint angles"
_REASONS = {
    "tendon_force": "the force falls where its spring stretches",
    "tendon_position": "the position runs against the other tendons and the joints",
    "joint_position": "the measured angle runs against the angle computed from the tendons",
    "joint_velocity": "the velocity runs against the angle",
    "external_torque": "it has to be the load that the tendons hold",
}


Entry = Mapping[str, float | str]  # what a column gets in the map: its sign, scale or another column


def element(column: str) -> tuple[str, int]:
    """Return the group and the index, from 0, of a column's name."""
    group, index = column.rstrip("]").split("[")
    return group, int(index) - 1


# --- signs, order, units ----------------------------------------------------------------------------------------------


def repair(path: Path, fitting: Repair) -> Finding:
    """Describe a correction that makes the equations fit."""
    correction = fitting.correction
    before, after = percent(fitting.misfit), percent(fitting.left)
    seen = f"{EQUATION} leaves {before} of the variance unexplained, and {after} once corrected"
    probably = _cause(correction)
    if fitting.alternatives:
        others = [_in_words(other) for other in fitting.alternatives[:3]]
        more = len(fitting.alternatives) - len(others)
        probably += f", or equally likely {'; or '.join(others)}{f'; or {more} more' if more else ''}"
    return _of_correction(path, correction, seen, probably)


def rests(path: Path, share: float) -> Finding:
    """Describe a log with much rest."""
    why = "a motor that holds with any torque up to friction", "fit and diagnose learn from motion alone"
    return Finding("warning", "rests", path, ("joint_velocity",), f"{percent(share)} at rest", *why)


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
        write = _new_keys(correction)
    else:
        entries = {column: {correction.kind: correction.factor} for column in correction.columns}
        write = _what_to_set(correction.columns, {correction.kind: correction.factor})
    if not path.suffix:  # a DataFrame, or arrays: there is no map
        words = _in_words(correction).replace("scale ", "times ").replace("sign -1", "times -1")
        write = f"correct it in memory: {words}"
    return Finding("error", correction.kind, path, correction.columns, seen, probably, write, entries)


def _swaps(correction: Correction) -> list[tuple[str, str]]:
    """Return the pairs of an exchange that only swaps columns, each once; otherwise none."""
    sources = dict(correction.pairs)
    is_swap = all(sources[source] == column for column, source in correction.pairs)
    return [pair for pair in correction.pairs if pair[0] < pair[1]] if is_swap else []


def _in_words(correction: Correction) -> str:
    if correction.kind == "exchange":
        swaps = _swaps(correction)
        if swaps:
            return " and ".join(f"{column} exchanged with {source}" for column, source in swaps)
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
    springs = (
        ", or stiffness of all tendons off by as much" if group == "tendon_force" and correction.factor < 1.0 else ""
    )
    return f"{group} in {correction.unit}, expected {GROUPS[group][0]}{springs}"


def _columns(columns: Sequence[str]) -> str:
    """Return `tendon_force[1..4]` for a whole group in order, else the names."""
    group, first = element(columns[0])
    if len(columns) > 1 and list(columns) == [f"{group}[{first + 1 + k}]" for k in range(len(columns))]:
        return f"{group}[{first + 1}..{first + len(columns)}]"
    return ", ".join(columns)


# --- what fits nowhere ------------------------------------------------------------------------------------------------


def columns(path: Path, group: str, given: int, counts: Mapping[str, int]) -> Finding:
    """Describe a group with too many or too few columns. counts: tendons and joints of the finger."""
    per = GROUP_PER[group]
    has = f"{counted(counts['joint'], 'joint')} and {counted(counts['tendon'], 'tendon')}"
    seen = f"{counted(given, 'column')} {group}[...], expected {counts[per]}: the finger has {has}"
    write = f"give one {group}[...] for each {per}"
    return Finding("error", "columns", path, (group,), seen, "a recording of another finger", write)


def unfit(path: Path, left: float, severity: str, balance: Balance) -> Finding:
    """Describe equations that no correction makes fit."""
    worst = balance.worst_tendon() + 1
    seen = (
        f"{EQUATION} leaves {percent(left)} of the variance unexplained, most at tendon {worst}; no sign, order "
        "or unit of columns corrects it"
    )
    probably = "moment_arms or stiffness of another finger, or positions in turns of a motor"
    write = (
        "compare moment_arms, stiffness and the order of the tendons with the finger; for a motor's angle in rad write "
        'into the map "unit": "m" and "scale", the radius of its pulley in m'
    )
    return Finding(severity, "unfit", path, (f"tendon_position[{worst}]",), seen, probably, write)


def routing(path: Path, finger: Finger, learned: TendonRouting, severity: str) -> Finding:
    """Describe numbers of a tendon that the joint positions contradict."""
    seen = _of_tendon(finger, learned)
    write = "tendonfmu calibrate learns them"
    if not learned.differs:
        write = "nothing to change in the map; the FMU's angle and friction there have part of this error"
    return Finding(
        severity,
        "routing",
        path,
        (f"tendon_position[{learned.tendon + 1}]",),
        seen,
        "numbers of the description that nobody measured, or that have changed"
        if learned.differs
        else "a pulley that is out of round, or a tendon that lifts off it",
        write,
    )


def _of_tendon(finger: Finger, learned: TendonRouting) -> str:
    said = "; ".join(routing_sentences(finger, learned))
    others = ", ".join(finger.tendon_names[j] for j in learned.seen_from)
    name = finger.tendon_names[learned.tendon].removeprefix("tendon ")
    return f"tendon {name}: {said}" + f" (seen from {others})" * bool(others)


def routing_sentences(finger: Finger, learned: TendonRouting) -> Iterator[str]:
    """Yield what is off at a tendon: arms and stiffness in per cent of the described ones, the zero in mm."""
    for j, arm in learned.arms.items():
        if arm.differs:
            yield f"moment arm at joint {finger.joint_names[j]} is {_off(arm)} than described"
        if j in learned.varying:
            share = percent(learned.varying[j])
            yield f"moment arm at joint {finger.joint_names[j]} changes by {share} with its angle"
    if learned.stiffness.differs:
        found = f"{learned.stiffness.value:.4g} N/m"
        yield f"stiffness is {_off(learned.stiffness)} than described ({found}), or the gain of its force sensor is off"
    if (zero := learned.zero).differs:
        off = zero.value - zero.described
        force = -off * learned.stiffness.value
        yield f"zero is off by {1e3 * off:.4g} ± {1e3 * zero.half:.2g} mm, or that of its force by {force:.3g} N"


def varying_sentences(finger: Finger, learned: Sequence[TendonRouting]) -> Iterator[str]:
    """Yield which moment arms change with the angle."""
    for each in learned:
        if each.varying:
            yield f"routing: {_of_tendon(finger, each.as_described)}"


def routing_entry(finger: Finger, learned: Sequence[TendonRouting]) -> RoutingEntry:
    """Report what was learned of the routing: every number, and sentences on what is off and what is not known."""
    changed = {number.path for number in routed(finger, learned)[1]}
    sentences = [f"routing: {_of_tendon(finger, each)}" for each in learned if each.differs or each.varying]
    if any(each.seen_from for each in learned):
        shown = "the stiffness of every tendon" + ", and arms and zeros of one against the other" * (finger.joints == 1)
        sentences.append(f"routing: without joint positions, redundant tendons show {shown}; the others stay")
    elif unknown := [path for each in learned for path in each.unknown]:
        sentences.append(f"routing: this motion does not determine {', '.join(unknown)}; the described values stay")
    numbers: list[LearnedNumber] = [
        {
            "path": number.path,
            "described": number.described,
            "value": number.value if number.is_known else None,
            "half_width": number.half if number.is_known else None,
            "known": number.is_known,
            "changed": number.path in changed,
        }
        for each in learned
        for number in each.numbers
    ]
    return {"numbers": numbers, "sentences": sentences or ["routing: as described"]}


def _off(number: Learned) -> str:
    """Say by how much a number is larger or smaller: "9.1 to 11 % larger"."""
    ends = [100.0 * (number.value + side * number.half) / number.described - 100.0 for side in (-1.0, 1.0)]
    low, high = (f"{value:.3g}" for value in sorted(map(abs, ends)))
    return f"{low if low == high else f'{low} to {high}'} % {'larger' if sum(ends) > 0 else 'smaller'}"


def force_unit(path: Path, columns: Sequence[str], factor: float, unit: str) -> Finding:
    """Describe forces whose unit the stretch of the springs contradicts."""
    correction = Correction("scale", tuple(columns), factor, unit)
    seen = "the springs stretch as if all were stiffer or softer than described by the same factor"
    return _of_correction(path, correction, seen, f"{_cause(correction)}, or stiffness in another unit than N/m")


def against(path: Path, share: Numbers, joints: Sequence[str], turning: Sequence[Correction]) -> Finding:
    """Describe joints that move against the pull of their tendons."""
    names = " and ".join(name for name, part in zip(joints, share, strict=True) if part < 0.0)
    seen = f"{names} moves against the pull of its tendons ({percent(-float(share.min()))} of its power)"
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
    seen = f"negative in {percent(share)} of the samples, down to {least:.4g} N, but tendon {name} can only pull"
    if is_zero:
        severity = "error" if share > 0.5 else "warning"
        write = (
            f'write into the map of columns, at "{column}": "offset", the reading of the sensor at zero force: minus '
            "the force at which it was zeroed"
        )
        return Finding(severity, "pushing", path, (column,), seen, "a sensor zeroed under load, or slack", write)
    probably = 'a wrong sign, or a cable loop ("bidirectional": true)'
    entry = {"sign": -1.0}
    write = _what_to_set((column,), entry)
    return Finding("error", "sign", path, (column,), seen, probably, write, {column: entry})


# --- clock ------------------------------------------------------------------------------------------------------------


def senseless_rate(path: Path, clock: Clock, samples: int) -> Finding:
    """Describe a sample rate that no control loop has."""
    seen = f"{counted(samples, 'sample')} {clock.step:.4g} s apart, {1 / clock.step:.4g} per second"
    if clock.unit is None:
        return Finding("error", "clock", path, ("time",), seen, "a wrong unit", "give time in s")
    factor, unit = clock.unit
    probably = f"time in {unit}" + (", or the number of the sample" if abs(clock.step - 1.0) < 1e-9 else "")
    entry = {"scale": factor}
    write = _what_to_set(("time",), entry)
    return Finding("error", "clock", path, ("time",), seen, probably, write, {"time": entry})


def clock_warnings(path: Path, clock: Clock, time: Numbers) -> Iterator[Finding]:
    """Describe gaps, lost samples and uneven steps."""
    if clock.gaps:
        first = clock.gaps[0]
        longest = f"the first of {time[first] - time[first - 1]:.4g} s after row {first}"
        yield _of_clock(
            path,
            "gaps",
            f"{counted(len(clock.gaps), 'gap')}, {longest}",
            "an interrupted log, or several put together",
            "split it there if the finger was touched meanwhile",
        )
    count = len(time) + clock.lost
    if clock.lost / count > LOST_SHARE:
        missing = f"{clock.lost} of {count} samples {are(clock.lost)} missing ({percent(clock.lost / count)})"
        yield _of_clock(
            path,
            "lost",
            f"{missing}, steps of {clock.step:.4g} s",
            "a log that drops samples",
            "record with a larger buffer, or fewer channels",
        )
    if clock.jitter > JITTER:
        yield _of_clock(
            path,
            "jitter",
            f"steps of {clock.step:.4g} s vary by {percent(clock.jitter)} (standard deviation)",
            "the time at which a sample was written, not taken",
            "log the time of the controller's own clock; velocities are wrong by the same share",
        )


def _of_clock(path: Path, kind: str, seen: str, probably: str, write: str) -> Finding:
    return Finding("warning", kind, path, ("time",), seen, probably, write)


# --- channels ---------------------------------------------------------------------------------------------------------


def held(path: Path, channel: Held, severity: str) -> Finding:
    """Describe a channel that holds a value."""
    first, last = channel.first
    seen = (
        f"holds {channel.value:.6g} in {percent(channel.share)} of the samples, first from {first:.4g} to "
        f"{last:.4g} s, while other channels change"
    )
    probably = "a stuck sensor, or a cable that is not plugged in"
    write = "replace the sensor's log, or cut these times out"
    return Finding(severity, "held", path, (channel.column,), seen, probably, write)


def clipped(path: Path, channel: Clipped, severity: str) -> Finding:
    """Describe a channel that saturates."""
    end, extreme = ("above", "largest") if channel.is_top else ("below", "smallest")
    value, share = f"{channel.value:.6g}", percent(channel.share)
    seen = f"repeats its {extreme} value {value} in {share} of the samples, and reaches it fast"
    probably = f"a sensor or amplifier that saturates {end} it"
    write = "record with a larger range, or less force or travel"
    return Finding(severity, "clipped", path, (channel.column,), seen, probably, write)


def coarse(path: Path, channel: Coarse) -> Finding:
    """Describe a channel with few steps."""
    unit = GROUPS[element(channel.column)[0]][0]
    steps = counted(round(channel.range / channel.step), "step")
    seen = f"moves by {channel.range:.4g} {unit} in {steps} of {channel.step:.4g} {unit}"
    probably = "a log rounded to few digits, or a coarse sensor"
    return Finding(
        "warning", "coarse", path, (channel.column,), seen, probably, "log more digits, or record a larger motion"
    )


# --- what to write into the map ---------------------------------------------------------------------------------------


def _keys(group: str, entry: Entry) -> dict[str, float | str]:
    keys: dict[str, float | str] = {}
    for key, value in entry.items():
        if isinstance(value, str):
            keys["column"] = value
        elif key == "sign":
            keys["sign"] = int(value)
        else:
            known = units.OF_COLUMN[group].items()
            unit = next((unit for unit, factor in known if abs(value / factor - 1.0) < SAME), "")
            keys |= {"unit": unit} if unit else {"scale": value}
    return keys


def _what_to_set(columns: Sequence[str], entry: Entry) -> str:
    """Say what the entries of columns get in the map. entry: `sign` or `scale`."""
    group = columns[0].split("[")[0]
    keys = _keys(group, entry)
    words = ", ".join(f'"{key}": {json.dumps(value)}' for key, value in keys.items())
    if "unit" in keys:
        words += f' in place of "{units.si_of(units.OF_COLUMN[group])}"'
    if "sign" in keys:
        words += " (1 where it is -1 now)"
    return f"write into the map of columns, at {_named(columns)}: {words}"


def _named(columns: Sequence[str]) -> str:
    """Return the names of columns; of three and more in a row, the first and last."""
    group, _, first = columns[0].rstrip("]").partition("[")
    row = [f"{group}[{int(first) + k}]" for k in range(len(columns))] if first else []
    if len(columns) > 2 and list(columns) == row:
        return f'each of "{row[0]}" to "{row[-1]}"'
    return ("each of " if len(columns) > 1 else "") + ", ".join(f'"{column}"' for column in columns)


def _new_keys(correction: Correction) -> str:
    """Say which keys of the map change places: its entries, with their units, belong to other columns."""
    swaps = _swaps(correction)
    if swaps:
        listed = ", ".join(f'"{column}" and "{source}"' for column, source in swaps)
        return f"exchange in the map of columns the keys {listed}"
    names = ", ".join(f'"{source}" to "{column}"' for column, source in correction.pairs)
    return f"rename in the map of columns the keys {names}"


# --- reports ----------------------------------------------------------------------------------------------------------


def check_report(
    file: Path, kind: str, lines: Sequence[str], findings: Sequence[Finding], recordings: Sequence[dict[str, Any]]
) -> dict[str, Any]:
    """Return the report of `check --json` on a sound finger description or rig."""
    return {
        "format": FORMAT,
        "file": str(file),
        "sound": True,
        "kind": kind,
        "summary": list(lines),
        "findings": [_entry(finding) for finding in findings],
        "recordings": list(recordings),
    }


def refusal_report(file: Path, reason: str) -> dict[str, Any]:
    """Return the report of `check --json` on a refused description or rig. reason: one line."""
    return {"format": FORMAT, "file": str(file), "sound": False, "reason": reason}


def recording_report(recording: Recording, findings: Sequence[Finding]) -> dict[str, Any]:
    """Return the report on a recording. findings: from `belongs`."""
    return {
        "file": str(recording.path),
        "belongs": not any(finding.severity == "error" for finding in findings),
        "samples": len(recording),
        "duration": float(recording.time[-1] - recording.time[0]),
        "verdict": verdict(recording, findings),
        "findings": [_entry(finding) for finding in findings],
    }


def _entry(finding: Finding) -> dict[str, Any]:
    # keys of a map whose log is the recording itself, with its columns in SI
    keys = {column: _keys(column.split("[")[0], entry) for column, entry in finding.entries.items()}
    return {**asdict(finding), "path": str(finding.path), "map": keys, "line": finding.line()}


def verdict(recording: Recording, findings: Sequence[Finding]) -> str:
    """Say in one line whether a recording belongs to the finger."""
    severities = [finding.severity for finding in findings]
    errors, warnings = severities.count("error"), severities.count("warning")
    words = "does not belong to this finger as it is" if errors else "belongs to this finger"
    counts = f"{counted(errors, 'error')}, {counted(warnings, 'warning')}" if findings else "no problem found"
    length = recording.time[-1] - recording.time[0]
    return f"{recording.path}: {words}: {counted(len(recording), 'sample')}, {length:.4g} s; {counts}"
