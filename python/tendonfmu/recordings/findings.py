"""What the findings about recordings say: the observation, its probable cause and what to write into the map."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from tendonfmu.files import counted, percent
from tendonfmu.model import Finding, Finger
from tendonfmu.recordings.columns import LearnedNumber, RoutingEntry
from tendonfmu.recordings.converters import units
from tendonfmu.recordings.faults import Fault
from tendonfmu.recordings.kinematics import Correction
from tendonfmu.recordings.recording import GROUPS, Recording
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
# kind, and with a comma its variant: severity, what is seen, its probable cause, what to do
_TEXTS = {
    "columns": (
        "error",
        "{given} {group}[...], expected {expected}: the finger has {joints} and {tendons}",
        "a recording of another finger",
        "give one {group}[...] for each {per}",
    ),
    "unfit": (
        "error",
        f"{EQUATION} leaves {{left}} of the variance unexplained, most at tendon {{worst}}; no sign, order or unit of "
        "columns corrects it",
        "moment_arms or stiffness of another finger, or positions in turns of a motor",
        "compare moment_arms, stiffness and the order of the tendons with the finger; for a motor's angle in rad write "
        'into the map "unit": "m" and "scale", the radius of its pulley in m',
    ),
    "routing": (
        "error",
        "{seen}",
        "numbers of the description that nobody measured, or that have changed",
        "tendonfmu calibrate learns them",
    ),
    "routing, varying": (
        "error",
        "{seen}",
        "a pulley that is out of round, or a tendon that lifts off it",
        "nothing to change in the map; the FMU's angle and friction there have part of this error",
    ),
    "scale": ("error", "{seen}", "a wrong unit", "check the units of the map"),
    "against": (
        "warning",
        "{seen}",
        "a finger that was moved by hand",
        'write "sign": -1 into the map at the reversed columns, or record without touching the finger',
    ),
    "pushing": (
        "warning",
        "negative in {share} of the samples, down to {least:.4g} N, but tendon {name} can only pull",
        "a sensor zeroed under load, or slack",
        'write into the map of columns, at "{column}": "offset", the reading of the sensor at zero force: minus the '
        "force at which it was zeroed",
    ),
    "sign": (
        "error",
        "negative in {share} of the samples, down to {least:.4g} N, but tendon {name} can only pull",
        'a wrong sign, or a cable loop ("bidirectional": true)',
        "{set}",
    ),
    "rests": (
        "warning",
        "{share} at rest",
        "a motor that holds by friction",
        "fit and diagnose learn from motion alone",
    ),
    "clock": ("error", "{samples} {step:.4g} s apart, {rate:.4g} per second", "time in {unit}", "{set}"),
    "clock, unknown": (
        "error",
        "{samples} {step:.4g} s apart, {rate:.4g} per second",
        "a wrong unit",
        "give time in s",
    ),
    "gaps": (
        "warning",
        "{count}, the first of {longest:.4g} s after row {row}",
        "an interrupted log, or several put together",
        "split it there if the finger was touched meanwhile",
    ),
    "lost": (
        "warning",
        "{missing} ({share}), steps of {step:.4g} s",
        "a log that drops samples",
        "record with a larger buffer, or fewer channels",
    ),
    "jitter": (
        "warning",
        "steps of {step:.4g} s vary by {share} (standard deviation)",
        "the time at which a sample was written, not taken",
        "log the time of the controller's own clock; velocities are wrong by the same share",
    ),
    "held": (
        "warning",
        "holds {value:.6g} in {percent} of the samples, first from {first:.4g} to {last:.4g} s, while others change",
        "a stuck sensor, or a cable that is not plugged in",
        "replace the sensor's log, or cut these times out",
    ),
    "clipped": (
        "warning",
        "repeats its {extreme} value {value:.6g} in {percent} of the samples, and reaches it fast",
        "a sensor or amplifier that saturates {end} it",
        "record with a larger range, or less force or travel",
    ),
    "coarse": (
        "warning",
        "moves by {range:.4g} {unit} in {steps} of {step:.4g} {unit}",
        "a log rounded to few digits, or a coarse sensor",
        "log more digits, or record a larger motion",
    ),
    "magnitude": (
        "error",
        "never negative while {joint} moves both ways: a magnitude",
        "a current or load without its sign",
        "log the signed number; friction cannot be learned from a magnitude",
    ),
    "wrapped": (
        "error",
        "jumps by {steps:.0f} steps",
        "signed numbers stored as unsigned, an encoder of many turns, or a counter that overflows",
        'write into the map of columns, at this column: "wrap": {steps:.0f} if its unit is a step',
    ),
    "filled": (
        "warning",
        "straight lines in all channels for {duration:.3g} s from {at:.4g} s",
        "a gap that was filled by interpolation",
        "cut this time out, or leave the gap in the log",
    ),
    "slow": (
        "warning",
        "changes only once in {samples:.3g} samples, of {rate:.4g} a second",
        "a log resampled from a slower sensor",
        "log at the sensor's own rate, or let convert table interpolate with the sensor's own time",
    ),
    "repeated": (
        "warning",
        "{share:.2g} % of the samples repeat the one before in the middle of a motion",
        "written by another clock than the sensor's: velocities jump there",
        "log each sample with the sensor's own time, or smooth the velocity (velocity_cutoff)",
    ),
    "switched": (
        "error",
        "moves {factor:.4g} times as much after {at:.4g} s as before, and no other signal does",
        "another unit from there on ({unit})",
        "convert both parts by themselves, each with its unit",
    ),
    "drift": (
        "warning",
        "the joint positions run {ppm:+.3g} ± {half:.2g} ppm against the tendons, {apart:.2g} ms over this recording",
        "two clocks",
        "log all signals with one clock, or let convert table bring both onto one",
    ),
}

Entry = Mapping[str, float | str]  # what a column gets in the map: its sign, scale or another column


def finding_of(
    path: Path, kind: str, *columns: str, severity: str = "", entry: Entry | None = None, **of: Any
) -> Finding:
    """Return the finding of a kind. entry: what each of the columns gets in the map; of: what the texts name."""
    usual, *texts = _TEXTS[kind]
    words = {**of, "set": _what_to_set(columns, entry)} if entry else of
    entries = dict.fromkeys(columns, entry) if entry else {}
    name = kind.partition(",")[0]
    seen, probably, write = (text.format(**words) for text in texts)
    return Finding(severity or usual, name, path, columns, seen, probably, write, entries)


def fault_finding(path: Path, fault: Fault, severity: str = "") -> Finding:
    """Describe a fault that columns show by themselves."""
    return finding_of(path, fault.kind, *fault.columns, severity=severity, **fault.numbers)


def element(column: str) -> tuple[str, int]:
    """Return the group and the index, from 0, of a column's name."""
    group, index = column.rstrip("]").split("[")
    return group, int(index) - 1


# --- signs, order, units ----------------------------------------------------------------------------------------------


def correction_finding(
    path: Path, correction: Correction, seen: str, others: Sequence[Correction] = (), besides: str = ""
) -> Finding:
    """Describe a correction that columns need, and others that fit as well. besides: another probable cause."""
    alike = [in_words(other) for other in others[:3]]
    more = len(others) - len(alike)
    probably = _cause(correction) + (f", or equally likely {'; or '.join(alike)}" if alike else "")
    probably += f"; or {more} more" * (more > 0) + besides
    entries: dict[str, dict[str, float | str]] = {}
    if correction.kind == "exchange":
        entries = {column: {"exchange": source} for column, source in correction.pairs}
        write = _new_keys(correction)
    else:
        entries = {column: {correction.kind: correction.factor} for column in correction.columns}
        write = _what_to_set(correction.columns, {correction.kind: correction.factor})
    if not path.suffix:  # a DataFrame, or arrays: there is no map
        words = in_words(correction).replace("scale ", "times ").replace("sign -1", "times -1")
        write = f"correct it in memory: {words}"
    return Finding("error", correction.kind, path, correction.columns, seen, probably, write, entries)


def _swaps(correction: Correction) -> list[tuple[str, str]]:
    """Return the pairs of an exchange that only swaps columns, each once; otherwise none."""
    sources = dict(correction.pairs)
    is_swap = all(sources[source] == column for column, source in correction.pairs)
    return [pair for pair in correction.pairs if pair[0] < pair[1]] if is_swap else []


def in_words(correction: Correction) -> str:
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
    if len(columns) > 1 and _is_row(columns):
        return f"{columns[0][:-1]}..{columns[-1].partition('[')[2]}"
    return ", ".join(columns)


def _is_row(columns: Sequence[str]) -> bool:
    """Return whether columns are elements of a group in a row."""
    group, _, first = columns[0].rstrip("]").partition("[")
    return bool(first) and list(columns) == [f"{group}[{int(first) + k}]" for k in range(len(columns))]


# --- moment arms, stiffness and zeros ---------------------------------------------------------------------------------


def routing_finding(path: Path, finger: Finger, learned: TendonRouting, severity: str) -> Finding:
    """Describe numbers of a tendon that the joint positions contradict."""
    kind = "routing" if learned.differs else "routing, varying"
    column = f"tendon_position[{learned.tendon + 1}]"
    return finding_of(path, kind, column, severity=severity, seen=_of_tendon(finger, learned))


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
        found = f"stiffness is {learned.stiffness.value:.4g} N/m, {_off(learned.stiffness)} than described"
        yield f"{found}, or the gain of its force sensor is off"
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
        shown = "stiffness" if finger.joints > 1 else "stiffness, and arms and zeros of one against the other"
        sentences.append(f"routing: without joint positions, redundant tendons show their {shown}; the rest stays")
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
    if len(columns) > 2 and _is_row(columns):
        return f'each of "{columns[0]}" to "{columns[-1]}"'
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
