"""Where detection ends and how it recovers: slow pushes, pushes in stiction, disturbances (docs/evidence/contact.md).

    python -m evidence.detection.limits -o FOLDER --finger paper=fitted.json --finger recommended=tuned.json

Recordings (slots.py) are kept in the folder. Writes detection_limits.md.
"""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from evidence import tables
from evidence.detection.hand import LEAST_FORCE, Arrays, Take
from evidence.detection.slots import (
    AFTER,
    DISTURBED,
    FALL,
    FORCES,
    LONGEST,
    PUSH_TIME,
    RATE,
    WARM,
    Slot,
    cut,
    made,
    slots,
    twin_of,
)
from evidence.runner import digest, named_finger, parser, publish, run_cases
from evidence.tables import Row
from tendonfmu.arrays import Numbers
from tendonfmu.detect import Event, score_detection
from tendonfmu.detect.counting import stretches
from tendonfmu.model import moment_arms
from tendonfmu.model.native import run_recording

Rows = Sequence[Row]

PRESLIDING = 0.004  # rad, of the rig's joints
SETTLED = 0.5  # s of a sound state without a break, from which it counts as sound again
FORCE_STEP, POSITION_STEP, DROPPED, SHIFT = 0.5, 1e-4, 0.5, 1e-3  # N, m, s, m
SIZES = (0.02, 0.05, 0.1, 0.2, 0.5, 1.0)  # N, of pushes in stiction


Subject = tuple[str, Mapping[str, Any]]  # a description under a name


# --- pushes: computing ------------------------------------------------------------------------------------------------


def pushed_rows(folder: Path, take: Take, subjects: Sequence[Subject]) -> Row:
    """Every push of a recording under every description, a fresh finger for each."""
    rows: list[Row] = []
    whole = made(folder, take)
    twin = None if take.kind == "stuck" else made(folder, twin_of(take))
    for slot in slots(take):
        arrays = cut(whole, slot.begin, slot.end)
        alone = None if twin is None else cut(twin, slot.begin, slot.end)
        common = {"kind": take.kind, "pretension": take.pretension, "force": slot.force, "rise": slot.rise}
        common |= _stuck(arrays, slot, subjects[0][1]) if alone is None else {}
        rows += [common | {"finger": name} | _pushed(data, arrays, alone, slot) for name, data in subjects]
    return {"rows": rows}


def _pushed(data: Mapping[str, Any], arrays: Arrays, twin: Arrays | None, slot: Slot) -> Row:
    """What a description makes of a push; twin: the same slot without it."""
    # by_chance: found there; released: an alarm begins as the push goes
    out, time = run_recording(data, arrays), arrays["time"]
    # a load that goes is a change too: an alarm of the release has not found the push
    label = (arrays["contact_force"] >= LEAST_FORCE) & (time <= slot.top + 1e-9)
    event = score_detection(time, label, out["contact"].ravel()).events[0]
    begins = [float(time[begin]) for begin, _ in stretches(time, out["contact"].ravel())]
    row: Row = {"released": any(slot.top + 1e-9 < begin <= slot.top + FALL + 0.1 for begin in begins)}
    row["found"] = event.found
    if twin is None:
        return row
    alone = run_recording(data, twin)
    chance = score_detection(twin["time"], label, alone["contact"].ravel()).events[0].found
    return row | {"by_chance": chance} | _at_alarm(event, (arrays, twin), (out, alone), slot)


def _at_alarm(event: Event, inputs: tuple[Arrays, Arrays], outputs: tuple[Arrays, Arrays], slot: Slot) -> Row:
    """Load at the alarm, or at the end of the hold where there is none, and where it went, as shares of it."""
    # reach: to the springs; absorbed: by the bias since the push began; left: in the output; each by the difference
    # from the twin
    arrays = inputs[0]
    time = arrays["time"]
    before = int(np.searchsorted(time, slot.push)) - 1
    at = int(np.searchsorted(time, (event.alarm if event.found else slot.top) - 1e-9))
    load = arrays["true_external_torque"][at]
    tension = inputs[0]["true_joint_torque"][at] - inputs[1]["true_joint_torque"][at]
    learned = [(out["residual"] - out["compensated_torque"])[before + 1 : at + 1].sum(axis=0) for out in outputs]
    left = outputs[0]["compensated_torque"][at] - outputs[1]["compensated_torque"][at]
    parts = {"reach": tension, "absorbed": learned[0] - learned[1], "left": left}
    return {
        "force_at": float(arrays["contact_force"][at]),
        "torque_at": float(np.abs(load).max()),
        "held": event.held_share if event.found else math.nan,
        **{name: float(torque @ load / (load @ load)) for name, torque in parts.items()},
    }


def _stuck(arrays: Arrays, slot: Slot, data: Mapping[str, Any]) -> Row:
    """What is true of a push at rest."""
    # slides: a joint moves farther than its presliding distance; reach, lost: share of the external torque that springs
    # and friction take in the end; springs, bristles: N·m/rad along the motion; tension: N, largest change of a
    # tendon's force; visible: until the hold begins, the torque of the measured forces leaves what it was in the half
    # second before by more than twice its range there
    windows = ((slot.push, slot.top), (slot.top - 0.1, slot.top), (slot.push - 0.1, slot.push))
    inside, settled, before = (cut(arrays, *window) for window in windows)
    moved = np.abs(inside["true_joint_position"] - before["true_joint_position"].mean(axis=0)).max()
    change = {
        name: settled[name].mean(axis=0) - before[name].mean(axis=0) for name in arrays if np.ndim(arrays[name]) > 1
    }
    load, springs, friction = (change[f"true_{name}_torque"] for name in ("external", "joint", "friction"))
    turn = change["true_joint_position"]
    torque, start = arrays["tendon_force"] @ moment_arms(data), slot.push - arrays["time"][0]
    first, last = (round(start * RATE) + offset for offset in (-round(0.5 * RATE), round((slot.rise + 0.05) * RATE)))
    quiet, pushed = torque[first : first + round(0.5 * RATE)], torque[first + round(0.5 * RATE) : last]
    return {
        "visible": bool(np.any(np.abs(pushed - quiet.mean(axis=0)).max(axis=0) > 2.0 * np.ptp(quiet, axis=0))),
        "slides": bool(moved > PRESLIDING),
        "load": float(np.abs(load).max()),
        "reach": float(springs @ load / (load @ load)),
        "lost": float(-friction @ load / (load @ load)),
        "springs": float(-springs @ turn / (turn @ turn)),
        "bristles": float(friction @ turn / (turn @ turn)),
        "tension": float(np.abs(change["tendon_force"]).max()),
    }


# --- disturbances: computing ------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Disturbance:
    """What is done to a recording."""

    name: str
    begin: float = DISTURBED  # s
    end: float = DISTURBED
    change: Callable[[Numbers, Numbers, int], None] = lambda time, signals, tendon: None  # writes into the signals
    signals: str = "tendon_force"
    step: float = 0.0  # N in the force of the tendon for good, which the bias must take
    kind: str = "still"  # of the recording

    def applied(self, arrays: Arrays, tendon: int) -> Arrays:
        signals = arrays[self.signals].copy()
        self.change(arrays["time"], signals, tendon)
        return arrays | {self.signals: signals}


def _step(size: float, time: Numbers, signals: Numbers, tendon: int) -> None:
    signals[time >= DISTURBED, tendon] += size


def _gone(held: bool, time: Numbers, signals: Numbers, tendon: int) -> None:
    gone = (time >= DISTURBED) & (time < DISTURBED + DROPPED)
    signals[gone, tendon] = signals[np.argmax(gone), tendon] if held else 0.0


def _shift(time: Numbers, signals: Numbers, _tendon: int) -> None:
    phase = np.clip((time - DISTURBED) / LONGEST, 0.0, 1.0)
    signals += (SHIFT * np.sin(np.pi * phase) ** 2)[:, None]


_RETURNED = DISTURBED + DROPPED
_STEP = functools.partial(_step, POSITION_STEP)
DISTURBANCES = (
    Disturbance("none"),
    Disturbance("in contact at t = 0", 0.0, PUSH_TIME + 0.1, kind="pushed"),
    Disturbance("force + 0.5 N", change=functools.partial(_step, FORCE_STEP), step=FORCE_STEP),
    Disturbance("position + 0.1 mm", change=_STEP, signals="tendon_position"),
    Disturbance("force reads 0 for 0.5 s", end=_RETURNED, change=functools.partial(_gone, False)),
    Disturbance(
        "position stands for 0.5 s", end=_RETURNED, change=functools.partial(_gone, True), signals="tendon_position"
    ),
    Disturbance(
        "all positions 1 mm and back in 10 s", end=DISTURBED + LONGEST, change=_shift, signals="tendon_position"
    ),
    Disturbance("wrist turns throughout", 0.0, 0.0, kind="wrist"),
)


def disturbed_rows(folder: Path, pretension: float, parts: int, subjects: Sequence[Subject]) -> Row:
    """Every disturbance under every description, one recording for each part."""
    twins = [_started(made(folder, Take("still", pretension, part))) for part in range(1, parts + 1)]
    free = [[_undetecting(data, twin) for twin in twins] for _, data in subjects]
    limit = 2.0 * np.sqrt(np.mean([np.mean(out["residual"][1:] ** 2, axis=0) for out in free[0]], axis=0))
    rows: list[Row] = []
    for number, twin in enumerate(twins):
        recordings = {"still": twin}
        for kind in ("pushed", "wrist"):
            recordings[kind] = _started(made(folder, Take(kind, pretension, number + 1)))
        tendon = 3 * number % twin["tendon_force"].shape[1]
        for disturbance in DISTURBANCES:
            arrays = disturbance.applied(recordings[disturbance.kind], tendon)
            for (name, data), alone in zip(subjects, free, strict=True):
                shift = disturbance.step * moment_arms(data)[tendon]
                late = twin["time"] >= disturbance.begin
                # what a turning wrist does to the torque is the bias's to take
                turns = disturbance.kind == "wrist"
                base = _undetecting(data, recordings["wrist"]) if turns else alone[number]
                reference = base["bias_torque"] + np.where(late[:, None], shift, 0.0)
                span = disturbance.begin, disturbance.end
                row = {"kind": disturbance.name, "pretension": pretension, "finger": name}
                rows.append(row | recovered(arrays["time"], run_recording(data, arrays), reference, limit, span))
    return {"rows": rows}


def _undetecting(data: Mapping[str, Any], arrays: Arrays) -> Arrays:
    """Outputs without detection: the bias always follows."""
    return run_recording({**data, "contact": {"threshold": [1e6] * len(data["joints"])}}, arrays)


def _started(arrays: Arrays) -> Arrays:
    """From `WARM` on, which is then 0 s: what happened before the first sample is not known to the finger."""
    kept = cut(arrays, WARM, math.inf)
    return kept | {"time": kept["time"] - kept["time"][0]}


def recovered(time: Numbers, out: Arrays, reference: Numbers, limit: Numbers, span: tuple[float, float]) -> Row:
    """How the state becomes sound again: bias within the limits [n] of a run that nothing disturbs, no contact."""
    # reference: [N, n]; span: begin and end of what disturbs, s; until: s from the end until it stays sound for
    # `SETTLED`, none if it never does; at_once, after: alarms that begin in it (0.1 s after its end included), in the
    # minute after; longest: s, of an alarm from its begin on
    begin, end = span
    alarm = out["contact"].ravel().astype(bool)
    sound = np.all(np.abs(out["bias_torque"] - reference) < limit, axis=1) & ~alarm
    minute = (time >= end) & (time <= end + AFTER)
    good, step = sound[minute], float(time[1] - time[0])
    enough = round(SETTLED / step)
    runs = np.convolve(good, np.ones(enough), "full")[enough - 1 :] > enough - 0.5  # sound from here for `SETTLED`
    alarms = [(float(time[a]), float(time[b])) for a, b in stretches(time, alarm)]
    seen = [(a, min(b, end + AFTER)) for a, b in alarms if b >= begin and a <= end + AFTER]
    return {
        "until": float(np.argmax(runs)) * step if runs.any() else math.inf,
        "at_once": sum(begin <= a <= end + 0.1 for a, _ in seen),
        "after": sum(a > end + 0.1 for a, _ in seen),
        "longest": max((b - max(a, begin) + step for a, b in seen), default=0.0),
    }


# --- tables -----------------------------------------------------------------------------------------------------------


def _sorted(rows: Rows, *keys: str) -> Rows:
    """By these columns, each in the order of its first appearance."""
    order = {key: tables.values_of(rows, key) for key in keys}
    return sorted(rows, key=lambda row: [order[key].index(row[key]) for key in keys])


def _percents(rows: Rows, *keys: str) -> list[str]:
    return [tables.median((row[key] for row in rows), ".0f", 100) for key in keys]


def ramp_tables(rows: Rows) -> str:
    """Shares found by size; then what the load was at the alarm and where it went, pushes of all sizes together."""
    keys = ["finger", "kind", "pretension", "rise"]
    rows = _sorted(sorted(rows, key=lambda row: row["rise"]), *keys)

    def cells(group: Rows) -> list[str]:
        found, missed = ([row for row in group if row["found"] == wanted] for wanted in (True, False))
        return [
            *(tables.count(row["found"] for row in group if row["force"] == force) for force in FORCES),
            str(sum(row["released"] for row in group)),
            tables.count(row["by_chance"] for row in group),
            tables.median(row["force_at"] for row in found),
            tables.median((row["torque_at"] for row in found), ".1f", 1e3),
            *_percents(found, "held"),
            *_percents(missed, "reach", "absorbed", "left"),
        ]

    head = ["finger", "state", "pretension, N", "rise, s", *(f"{force:g} N" for force in FORCES), "as it goes"]
    head += ["without the push", "at N", "at mN·m", "held %", "missed: reaches %", "in the bias %", "in the output %"]
    return tables.table(head, tables.by(rows, keys, cells), 2)


def stuck_tables(rows: Rows) -> str:
    """Medians of the pushes that do not slide, by whether friction holds most of them; then what was found by size."""
    fingers = tables.values_of(rows, "finger")

    def found(group: Rows) -> str:
        return ", ".join(str(sum(row["found"] for row in tables.where(group, finger=name))) for name in fingers)

    def why(group: Rows) -> list[str]:
        first = tables.where(group, finger=fingers[0])
        formats = {"load": (".1f", 1e3), "reach": (".0f", 100), "springs": (".1f", 1), "bristles": (".1f", 1)}
        formats["tension"] = (".0f", 1e3)
        medians = [tables.median((row[key] for row in first), *form) for key, form in formats.items()]
        return [str(len(first)), *medians, found(group), tables.percent(row["visible"] for row in first)]

    lines = []
    for low, high in pairwise(SIZES):
        cells = [f"{low:g} to {high:g}"]
        for slides in (False, True):
            group = [row for row in tables.where(rows, slides=slides) if low <= row["force"] < high]
            first = tables.where(group, finger=fingers[0])
            cells += [str(len(first)), found(group), str(sum(row["visible"] for row in first))]
        lines.append(cells)
    held = [
        row | {"friction": "holds" if row["lost"] > 0.5 else "gives way"} for row in tables.where(rows, slides=False)
    ]
    held.sort(key=lambda row: (row["pretension"], row["friction"] != "holds"))
    causes = ["pretension, N", "friction", "pushes", "torque mN·m", "reaches the springs %", "springs N·m/rad"]
    causes += ["bristles N·m/rad", "a force changes by mN", "found", "visible %"]
    sizes = ["N", "below break-away", "found", "visible", "that slide", "found", "visible"]
    by_friction = tables.by(held, ["pretension", "friction"], why)
    return f"{tables.table(causes, by_friction, 2)}\n\n{tables.table(sizes, lines)}"


def recovery_table(rows: Rows) -> str:
    def cells(group: Rows) -> list[str]:
        until = [row["until"] for row in group if row["until"] is not None]
        return [
            tables.median(until, ".1f", with_interval=True),
            tables.number(max(until, default=math.nan), ".1f"),
            f"{len(group) - len(until)} of {len(group)}",
            str(sum(row["at_once"] for row in group)),
            str(sum(row["after"] for row in group)),
            f"{max(row['longest'] for row in group):.1f}",
        ]

    keys = ["kind", "finger", "pretension"]
    head = ["disturbance", "finger", "pretension", "sound again after s", "at most", "never", "alarms"]
    head += ["in the minute after", "longest s"]
    return tables.table(head, tables.by(_sorted(rows, *keys), keys, cells), 2)


def main() -> None:
    options = parser(__doc__)
    options.add_argument("--finger", action="append", type=named_finger, required=True, metavar="NAME=FILE")
    options.add_argument("--parts", type=int, default=8, help="recordings of each kind and pretension")
    given = options.parse_args()
    folder, numbers = given.output, range(1, given.parts + 1)
    folder.mkdir(parents=True, exist_ok=True)
    version = digest(given.finger)

    def rows_of(function: Callable[..., Row], cases: dict[str, tuple[Any, ...]]) -> Rows:
        named = {f"{name}-{version}": (folder, *arguments, given.finger) for name, arguments in cases.items()}
        rows = run_cases(function, named, folder / "scores", given.workers, given.scheduler)
        return list(itertools.chain(*(row["rows"] for row in rows)))

    ramps = [Take(kind, p, part) for kind in ("rest", "motion") for p in (10.0, 40.0) for part in numbers]
    stuck = [Take("stuck", p, part) for p in (10.0, 20.0, 40.0) for part in numbers]
    parts = {
        "Recovery": rows_of(disturbed_rows, {f"recovery_{p:g}_{given.parts}": (p, given.parts) for p in (10.0, 40.0)}),
        "Pushes in stiction": rows_of(pushed_rows, {take.name: (take,) for take in stuck}),
        "Slow pushes": rows_of(pushed_rows, {take.name: (take,) for take in ramps}),
    }
    shown = zip(parts.items(), (recovery_table, stuck_tables, ramp_tables), strict=True)
    publish(folder / "detection_limits.md", tables.page({name: show(rows) for (name, rows), show in shown}))


if __name__ == "__main__":
    main()
