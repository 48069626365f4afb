"""Pushes of 0.02 to 1 N on a finger at rest: how many contact.rest finds with the bounds that `tune` learns for it.

    python -m evidence.detection.at_rest -o FOLDER

Bounds come from rests without pushes (slots.py), alarms are counted in others. Recordings are kept. Prints a table.
"""

from __future__ import annotations

import itertools
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from evidence import tables
from evidence.detection.hand import PRETENSIONS, Arrays, Take
from evidence.detection.limits import PRESLIDING
from evidence.detection.slots import Slot, cut, made, slots
from evidence.runner import INDEX_FINGER, parser, publish, say
from tendonfmu.detect import free_parts
from tendonfmu.detect.contact_at_rest import count_alarms, find_rests, learn_rest
from tendonfmu.model import native, read_finger
from tendonfmu.recordings import Recording

RATE, CONFIDENCE = 6.0, 0.9  # 1/h
PARTS = range(1, 9)
LEAST_FORCE = 0.05  # N
HEAD = ["learned from, min", "other rests, min", "alarms", "below break-away", "of them ≥ 0.05 N", "all ≥ 0.05 N"]
HEAD += ["delay, ms"]


def inputs(arrays: Arrays) -> Arrays:
    return {name: arrays[name] for name in ("time", "tendon_force", "tendon_position")}


def measure(folder: Path, parts: Sequence[int]) -> list[Any]:
    """Learns from every second twin without pushes, counts alarms in the others and pushes found."""
    finger = read_finger(INDEX_FINGER)

    def rests_of(chosen: Sequence[int]) -> list[Any]:
        rests = []
        for part, pretension in itertools.product(chosen, PRETENSIONS):
            groups = inputs(made(folder, Take("stuck_twin", pretension, part)))
            recording = Recording(Path("recording"), groups.pop("time"), groups)
            rests += free_parts(finger, recording, 1)[0]
        return rests

    free, other = rests_of(parts[::2]), rests_of(parts[1::2])
    rule, reasons = learn_rest(finger.data, free, RATE, CONFIDENCE)
    if rule is None:
        raise RuntimeError(f"no rule: {reasons}")
    say(json.dumps(dict(rule.keys)))
    joints = len(finger.data["joints"])
    never = {**rule.keys, "threshold": [1e9] * joints, "creep": None, "innovation": None}
    minutes = sum(float(rest.time[-1]) for rest in find_rests(finger.data, other, never)) / 60.0
    alarms = count_alarms(finger.data, other, rule.keys)
    at_rest = {**finger.data, "contact": {"threshold": [1e9] * joints, "rest": dict(rule.keys)}}
    rows = []
    for part, pretension in itertools.product(parts, PRETENSIONS):
        take = Take("stuck", pretension, part)
        whole = made(folder, take)
        rows += [pushed(at_rest, cut(whole, slot.begin, slot.end), slot) for slot in slots(take)]
    below, forced = ([row for row in rows if row[key]] for key in ("below", "forced"))
    both = [row for row in below if row["forced"]]
    counts = [tables.count(row["found"] for row in chosen) for chosen in (below, both, forced)]
    delay = tables.median((row.get("delay") for row in rows), ".0f", 1e3)
    return [f"{60 * rule.hours:.1f}", f"{minutes:.1f}", alarms, *counts, delay]


def pushed(description: dict[str, Any], arrays: Arrays, slot: Slot) -> dict[str, Any]:
    """What becomes of a push."""
    time, angle = arrays["time"], arrays["true_joint_position"]
    alarm = native.run_recording(description, inputs(arrays))["contact_at_rest"].ravel()
    during = (time >= slot.push) & (time <= slot.top)
    before = angle[(time >= slot.push - 0.1) & (time < slot.push)].mean(axis=0)
    is_found = bool(alarm[during].any())
    return {
        "found": is_found,
        "delay": float(time[during][np.argmax(alarm[during])] - slot.push) if is_found else None,
        "below": float(np.abs(angle[during] - before).max()) <= PRESLIDING,
        "forced": abs(slot.force) >= LEAST_FORCE,
    }


def main() -> None:
    options = parser(__doc__)
    options.add_argument("--parts", type=int, default=len(PARTS), help="recordings of each pretension")
    given = options.parse_args()
    given.output.mkdir(parents=True, exist_ok=True)
    line = measure(given.output, range(1, given.parts + 1))
    publish(given.output / "contact_at_rest.md", tables.table(HEAD, [line], 0) + "\n")


if __name__ == "__main__":
    main()
