"""Which pushes are found without a touch sensor, where on the finger, and is a failing sensor told from a push?

On the product's own virtual hand (hand.py), and on fingers in MuJoCo (evidence/families), which share no code with it.
"""

from __future__ import annotations

import itertools
import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np

from evidence import table
from evidence.cases import INDEX_RIG, run_cases, tendonfmu, write
from evidence.contact import hand
from evidence.contact.sensor_faults import fault_table, judged_faults
from evidence.part import Figures, Part
from evidence.table import Row
from tendonfmu.arrays import Flags, Numbers
from tendonfmu.detect import score_detection
from tendonfmu.model.native import run_recording
from tendonfmu.recordings import run_parts

# --- the virtual hand -------------------------------------------------------------------------------------------------

# Of a push: the largest ratio of its torque in a joint to the rms of that joint's free residual.
SIZES = {"3–4": (3.0, 4.0), "4–6": (4.0, 6.0), "≥ 6": (6.0, np.inf)}


def scored(folder: Path, take: hand.Take, alarm: Flags) -> Row:
    """Which pushes an alarm finds in a recording, their torques, and what it does while nothing touches."""
    recording = hand.recording(folder, take)
    label = np.zeros(len(recording), dtype=bool) if recording.contact is None else recording.contact
    score = score_detection(recording.time, label, alarm)
    torques = []
    if score.events:
        torque = np.abs(hand.truth(folder, take, "external_torque"))
        starts = np.flatnonzero(label & ~np.r_[False, label[:-1]])
        ends = np.flatnonzero(label & ~np.r_[label[1:], False])
        torques = [torque[start : end + 1].max(axis=0) for start, end in zip(starts, ends, strict=True)]
    return {
        "kind": take.kind,
        "pretension": take.pretension,
        "found": [event.found for event in score.events],
        "delay": [event.delay_s for event in score.events],
        "torque": torques,
        "seconds": score.free_seconds,
        "alarms": len(score.false_alarms),
    }


def free_rms(folder: Path) -> dict[float, Numbers]:
    """[n] N·m by pretension, of the calibrated finger's residual before the bias update, without any detection."""
    finger = hand.calibrated()
    squares: dict[float, list[Numbers]] = {}
    for take in hand.takes("free"):
        inputs = hand.recording(folder, take).arrays()
        every = np.ones(len(inputs["time"]), dtype=bool)
        residual = np.nan_to_num(run_parts(finger, inputs, [slice(0, len(every))], every, 1).residual)
        squares.setdefault(take.pretension, []).append(np.mean(residual**2, axis=0))
    return {pretension: np.sqrt(np.mean(values, axis=0)) for pretension, values in squares.items()}


def summary(rows: Sequence[Row], rms: Mapping[float, Numbers]) -> Figures:
    """Pushes found by size, the largest by pretension; false alarms in 10 min; median delay of the largest, ms."""
    pushes = [
        {
            "size": max(np.array(torque) / rms[row["pretension"]]),
            "found": found,
            "delay": delay,
            "at": row["pretension"],
        }
        for row in rows
        for torque, found, delay in zip(row["torque"], row["found"], row["delay"], strict=True)
    ]

    def of(size: str, pretensions: Iterable[float] = hand.PRETENSIONS) -> list[Row]:
        low, high = SIZES[size]
        return [push for push in pushes if low <= push["size"] < high and push["at"] in pretensions]

    largest = of("≥ 6")
    counted = {f"≥ 6, {pretension:g} N": of("≥ 6", [pretension]) for pretension in hand.PRETENSIONS}
    counted |= {"4–6": of("4–6"), "3–4": of("3–4")}
    alarms = {}
    for name, free in (("free", True), ("between pushes", False)):
        chosen = [row for row in rows if (row["kind"] == "free") == free]
        alarms[name] = sum(row["alarms"] for row in chosen) / (sum(row["seconds"] for row in chosen) / 600.0)
    return {
        "found_share": float(np.mean([push["found"] for push in largest])),
        "found": {name: [sum(push["found"] for push in group), len(group)] for name, group in counted.items()},
        "false_alarms": alarms,
        "delay": 1e3 * float(np.median([push["delay"] for push in largest if push["found"]])),
    }


def found_table(figures: Figures) -> str:
    counts = [f"{found}/{count}" for found, count in figures["found"].values()]
    alarms = [f"{rate:.1f}" for rate in figures["false_alarms"].values()]
    head = [*figures["found"], "false alarms in 10 min: free", "between pushes", "median delay of ≥ 6, ms"]
    return table.table(head, [[*counts, *alarms, f"{figures['delay']:.0f}"]], 0)


def hand_case(folder: Path, take: hand.Take) -> Row:
    outputs = run_recording(hand.tuned(folder).data, hand.recording(folder, take).arrays())
    return scored(folder, take, outputs["contact"].ravel().astype(bool))


# --- where the finger is touched --------------------------------------------------------------------------------------

STRENGTHS = {"0.5 to 1 N": (0.5, 1.0), "1 to 2 N": (1.0, 2.0)}
NEAR_TIP = 0.8  # share of the last link's length from which a push is near the tip
LAST = 4  # link


def place_case(folder: Path, take: hand.Take) -> Row:
    """All pushes of a recording, each in the middle of its hold, by a description that has the rig's links."""
    physics = json.loads(INDEX_RIG.read_text(encoding="utf-8"))["physics"]
    links = [{key: link[key] for key in ("axis", "offset") if key in link} for link in physics["links"]]
    finger = {**hand.tuned(folder).data, "links": links, "tip": physics["tip"]}
    recording, force = hand.recording(folder, take), hand.truth(folder, take, "contact_force")
    outputs = run_recording(finger, recording.arrays())
    rows = []
    for push in hand.pushes_of(folder, take):
        k = int(np.searchsorted(recording.time, push["start"] + push["rise"] + push["hold"] / 2))
        tip, point = np.array(physics["tip"]), np.array(push["point"])
        rows.append(
            {
                "pretension": take.pretension,
                "strength": float(np.linalg.norm(force[k])),
                "link": push["link"],
                "near_tip": push["link"] == LAST and float(point @ tip / (tip @ tip)) >= NEAR_TIP,
                "contact": bool(outputs["contact"].ravel()[k]),
                "named": int(outputs["contact_link"][k]),
                "error": float(np.linalg.norm(outputs["fingertip_force"][k] - force[k])),
                "std": float(np.linalg.norm(outputs["fingertip_force_std"][k])),
                "observable": bool(outputs["fingertip_force_observable"][k]),
            }
        )
    return {"rows": rows}


def _links(rows: Sequence[Row]) -> list[str]:
    seen = [row for row in rows if row["contact"]]
    named = [row for row in seen if row["named"] > 0]
    last = [row for row in named if row["named"] == LAST]
    return [
        f"{len(seen)} of {len(rows)}",
        table.percent(row["named"] < 0 for row in seen),
        table.percent(row["link"] >= row["named"] for row in named),
        table.percent(row["link"] == row["named"] for row in named),
        f"{sum(row['link'] == LAST for row in last)} of {len(last)}",
    ]


def _forces(rows: Sequence[Row]) -> list[str]:
    near = [row for row in rows if row["contact"] and row["near_tip"]]
    known = [row for row in near if row["observable"]]
    error, strength, std = (table.rms(table.column(known, key)) for key in ("error", "strength", "std"))
    shares = [table.number(error / strength, ".0f", 100), table.number(error / std, ".1f")]
    return [str(len(near)), str(len(known)), table.number(error), *shares]


def places(rows: Sequence[Row]) -> Figures:
    classed = [
        row | {"class": name}
        for name, (low, high) in STRENGTHS.items()
        for row in rows
        if low <= row["strength"] < high
    ]
    strong = [row for row in classed if row["class"] == "1 to 2 N"]
    return {
        "links": table.by(classed, ["pretension", "class"], _links),
        "forces": table.by(strong, ["pretension"], _forces),
    }


def virtual_hand(folder: Path, workers: int) -> Figures:
    every, pushed = hand.takes("free", *hand.PUSHED), hand.takes(*hand.PUSHED)
    run_cases(hand.made, {f"made_{take.name}": (folder, take) for take in every}, folder, workers)
    hand.tuned(folder)
    rows = run_cases(hand_case, {take.name: (folder, take) for take in every}, folder, workers)
    touched = run_cases(place_case, {f"place_{take.name}": (folder, take) for take in pushed}, folder, workers)
    return summary(rows, free_rms(folder)) | places([row for case in touched for row in case["rows"]])


# --- fingers in MuJoCo ------------------------------------------------------------------------------------------------

FINGERS = (3, 19)  # odd seeds; 3 hides nothing, 19 the weight of a link


def calibrated(folder: Path, number: int) -> Path:
    """Folder of what `tendonfmu calibrate` made of a finger; `cpu.json` in it is the processor time, s."""
    from evidence.contact import pushed_fingers

    into = folder / f"calibrated_{number:02d}"
    if not (into / "cpu.json").exists():
        pushed_fingers.make(folder, number)
        free, pushed = (
            [pushed_fingers.place(folder, number, *one) for one in itertools.product(kinds, pushed_fingers.PRETENSIONS)]
            for kinds in (pushed_fingers.FREE, pushed_fingers.PUSHED)
        )
        description = pushed_fingers.description_file(folder, number)
        seconds = tendonfmu("calibrate", description, *free, "--pushes", *pushed, "-o", into, "--no-progress")
        write(into / "cpu.json", json.dumps(seconds))
    return into


def finger_case(folder: Path, number: int) -> Row:
    """What `calibrate` reports of a finger. Sizes are in multiples of the free residual's rms."""
    into = calibrated(folder, number)
    report = json.loads((into / "calibration.json").read_text(encoding="utf-8"))
    pushes = report["pushes"]
    sizes = {f"{size['from']:g}": [size["found"], size["events"]] for size in pushes["sizes"]}
    return {
        "finger": number,
        "large": sizes.get("6", [0, 0]),
        "small": sizes.get("3", [0, 0]),
        "alarms": pushes["false_alarms"],
        "promised": report["detection"]["kept_out"]["interval"][1] * pushes["free_minutes"] / 60.0,
        "minutes": pushes["free_minutes"],
        "delay": 1e3 * pushes["median_delay_s"],
        "cpu": json.loads((into / "cpu.json").read_text(encoding="utf-8")),
    }


def fingers(folder: Path, workers: int) -> Figures:
    cases = {f"finger_{number:02d}": (folder, number) for number in FINGERS}
    rows = run_cases(finger_case, cases, folder, workers)
    missed = sum(row["large"][1] - row["large"][0] for row in rows)
    return {"missed": missed, "rows": rows, "sensor_faults": judged_faults(folder, workers)}


def fingers_table(figures: Figures) -> str:
    lines = [
        [
            str(row["finger"]),
            *("{}/{}".format(*row[size]) for size in ("large", "small")),
            f"{row['alarms']} in {row['minutes']:.1f}",
            f"{row['promised']:.1f}",
            f"{row['delay']:.0f}",
            f"{row['cpu']:.0f}",
        ]
        for row in figures["rows"]
    ]
    head = ["finger", "≥ 6 × rms", "3 to 6 × rms", "false alarms in min", "promised at most", "median delay, ms"]
    return table.table([*head, "CPU time of `calibrate`, s"], lines)


# --- parts -----------------------------------------------------------------------------------------------------------

LINK_HEAD = ["pretension, N", "push", "in contact", "not named (−1), %", "on `contact_link` or beyond, %"]
LINK_HEAD += ["that very link, %", "`contact_link` 4: right"]
FORCE_HEAD = [
    "pretension, N",
    "in contact near the tip",
    "observable",
    "error, N rms",
    "% of the push",
    "rms / rms of its std",
]

PARTS: dict[str, Part] = {
    "hand": Part(
        virtual_hand,
        minutes=10.0,
        headlines={"found_share": (0.9, 1.0), "false_alarms.free": (0.0, 1.0), "delay": (0.0, 40.0)},
        tables={
            "found": found_table,
            "links": table.of_cells("links", LINK_HEAD, 2),
            "forces": table.of_cells("forces", FORCE_HEAD),
        },
    ),
    "fingers": Part(
        fingers,
        minutes=20.0,
        needs=("mujoco",),
        headlines={
            "missed": (0, 1),
            "sensor_faults.share": (85.0, 100.0),
            "sensor_faults.sound_faults": (0, 0),
        },
        tables={"fingers": fingers_table, "faults": fault_table},
    ),
}
