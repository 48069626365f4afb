"""What is learned of measured machines: a fit and a diagnosis on one part of the recordings, errors on another.

Descriptions and maps are in evidence/machine_data; the recordings are those of ../shared/data.
"""

from __future__ import annotations

import json
import math
import tempfile
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy import signal

import tendonfmu as tf
from evidence import table
from evidence.cases import DATA, run_cases
from evidence.part import Figures, Part
from tendonfmu.arrays import Numbers
from tendonfmu.recordings import describe_recorded_joint
from tendonfmu.recordings.converters.machines import convert_file

HERE = Path(__file__).parent / "machine_data"
ENCODER = 3  # kinematics: angle and velocity are measured


@dataclass(frozen=True)
class Machine:
    """A description, the recordings it is learned on, and those it is judged on."""

    finger: Any  # description or its file
    learned: Sequence[tf.Recording]
    judged: Mapping[str, Sequence[tf.Recording]]  # the first is the test of `diagnose`; none: parts that it leaves out
    units: tuple[str, ...]  # of the error at each joint, N or N·m in parts of 1000 if it begins with m
    kinematics: int = ENCODER


def of_columns(file: Path, columns: Mapping[str, Numbers]) -> tf.Recording:
    """A recording of one joint."""
    groups = {name.removesuffix("[1]"): values[:, None] for name, values in columns.items() if name != "time"}
    return tf.Recording(file, columns["time"], groups)


def errors(finger: Any, recordings: Sequence[tf.Recording], kinematics: int, output: str) -> Numbers:
    """[n] rms of an output minus the known load, over all samples of all recordings [N·m]."""
    missed = []
    for recording in recordings:
        outputs = tf.run(finger, recording, kinematics=kinematics).outputs
        missed.append(outputs[output] - recording.groups.get("external_torque", 0.0))
    return np.asarray(np.sqrt(np.mean(np.concatenate(missed) ** 2, axis=0)))


# --- the da Vinci jaw -------------------------------------------------------------------------------------------------

EVEN, ODD = ("00", "02", "04", "06", "08"), ("01", "03", "05", "07", "09")  # loads of 10 % to 100 %, 0.1 Hz
FAST = ("40", "42", "44", "46", "48")  # 0.5 Hz
JAM = {"07": 16.5}  # s; the instrument jams soon afterwards
PRETENSION = 13.0  # N, the least whole number at which the closing cable always pulls


def jaw_run(name: str) -> tf.Recording:
    """A run of the jaw, up to its jam."""
    file = DATA / "davinci_tool" / "Tool_4_Maryland_L_4" / f"{name}.TXT"
    recording = of_columns(file.with_name(name), convert_file("davinci", file, pretension=PRETENSION))
    return recording[: JAM[name]] if name in JAM else recording


def jaw() -> Machine:
    even, odd, fast = ([jaw_run(name) for name in names] for names in (EVEN, ODD, FAST))
    judged = {"odd loads": odd, "0.5 Hz": fast}
    return Machine(HERE / "davinci" / "nominal.json", even, judged, ("mN·m",), kinematics=1)


# --- the EMPS carriage ------------------------------------------------------------------------------------------------

PLAIN, PULSES = "DATA_EMPS", "DATA_EMPS_PULSES"
# Janot, Gautier, Brunot 2019: N/(m/s), N, N; % of the force that is missed
PUBLISHED = {"viscous": 203.5034, "coulomb": 20.3935, "offset": -3.1648}
PUBLISHED_ERRORS = {"symmetric": ("4.08", "5.98"), "asymmetric": ("3.11", "")}
DECIMATION = 10  # from 1 kHz, as the authors decimate


def emps_run(name: str) -> tf.Recording:
    """A file of the carriage at 1 kHz: one of its causes is a delay of less than a sample at 100 Hz."""
    file = DATA / "emps" / f"{name}.mat"
    return of_columns(file, convert_file("emps", file, decimation=1))


def emps() -> Machine:
    return Machine(HERE / "emps" / "symmetric.json", [emps_run(PLAIN)], {"178 N pulses": [emps_run(PULSES)]}, ("N",))


def share_missed(finger: Any, recording: tf.Recording) -> float:
    """% of the drive's force that a model misses, the published way: both are decimated by a Chebyshev filter."""
    outputs = tf.run(finger, recording, kinematics=ENCODER).outputs
    missed = outputs["compensated_torque"] - recording.groups["external_torque"]
    inside = slice(50, -50)  # filters swing in at both ends
    missed, force = (
        signal.decimate(series[inside, 0], DECIMATION) for series in (missed, recording.groups["tendon_force"])
    )
    return float(100 * np.linalg.norm(missed) / np.linalg.norm(force))


# --- joints of the PSM ------------------------------------------------------------------------------------------------

FIRST = ("stribeck_3dof_svd__fourier_test", "stribeck_3dof_svd__fourier_test2")
SECOND = ("stribeck_3dof_svd__fourier_test3", "stribeck_3dof_svd__fourier_test4")
ANOTHER = ("latest_3dof_inaxis_svd__fourier_test1", "latest_3dof_inaxis_svd__fourier_test2")


def psm_run(name: str, joints: Sequence[int]) -> tf.Recording:
    """Joints as one finger: the rows from the first in which all move."""
    parts = [tf.convert(DATA / "psm" / f"{name}.parquet", HERE / "psm" / f"joint_{joint}.json") for joint in joints]
    rows = min(len(part) for part in parts)
    groups = {group: np.hstack([part.groups[group][-rows:] for part in parts]) for group in parts[0].groups}
    return tf.Recording(Path(name), parts[0].time[-rows:], groups)


def psm_finger(joints: Sequence[int]) -> dict[str, Any]:
    """Joints as `describe joint` describes each from the first recording, with a drive of its own."""
    fingers = [describe_recorded_joint(f"joint_{joint}", psm_run(FIRST[0], [joint]), 1.0) for joint in joints]
    whole: dict[str, Any] = json.loads(json.dumps(dict(fingers[0]))) | {"name": "psm"}
    for key in ("joints", "tendons", "extensions"):
        whole[key] = [dict(row) for finger in fingers for row in finger[key]]
    for k, (drive, extension) in enumerate(zip(whole["tendons"], whole["extensions"], strict=True)):
        drive |= {"name": f"drive_{k + 1}", "moment_arms": [float(j == k) for j in range(len(fingers))]}
        extension["joint"] = k + 1
    whole["bias"]["initial_torque"] = [finger["bias"]["initial_torque"][0] for finger in fingers]
    whole["contact"]["threshold"] = [finger["contact"]["threshold"][0] for finger in fingers]
    return whole


def psm(*joints: int) -> Machine:
    first, second, another = ([psm_run(name, joints) for name in names] for names in (FIRST, SECOND, ANOTHER))
    judged = {"other excitations": second, "another identification": another}
    units = tuple("N" if joint == 3 else "mN·m" for joint in joints)
    return Machine(psm_finger(joints), first, judged, units)


# --- the manipulator pulled by two wires ------------------------------------------------------------------------------

# In order of time; every second one chooses the threshold, the others are counted.
CONDITIONS = ("left_90", "left_60", "left_30", "zero", "right_30", "right_60", "right_90")
THRESHOLDS = (0.015, 0.02, 0.025, 0.03, 0.035, 0.04)  # N·m
ARM = 3.63  # mm of wire per radian of bending
TOUCH = 100.0  # least bending force of a contact, in the sensor's units
SMEAR, WIRE_RATE = 1.0, 30  # s by which the sensor's filter moves a contact; Hz


def wire_run(name: str) -> tf.Recording:
    """Motors and load cells, and a label from the sensor's force that bends the arm."""
    log: Any = pd.read_parquet(next((DATA / "wire").glob(f"*_{name}.parquet")))
    bend = (log["wire length #0"] - log["wire length #1"]).to_numpy() / (2 * ARM)
    q = np.where(np.abs(bend) < 1e-3, 1e-3, bend)
    # how far the tip of an arc moves along x and y per radian, over half the length of the arc
    levers = 2 / q[:, None] ** 2 * np.column_stack([q * np.sin(q) - 1 + np.cos(q), q * np.cos(q) - np.sin(q)])
    force = log[["fx", "fy"]].to_numpy()
    zero = force.mean(axis=0) if name == "no-payload" else 0.0  # the sensor was zeroed only after the free motion
    touches = np.abs((levers * (force - zero)).sum(axis=1)) > TOUCH
    log["touch"] = (np.convolve(touches, np.ones(2 * round(SMEAR * WIRE_RATE) + 1), "same") > 0.5).astype(float)
    with tempfile.TemporaryDirectory() as scratch:
        log.to_parquet(file := Path(scratch) / f"{name}.parquet")
        return tf.convert(file, HERE / "wire" / "map.json")


def wire() -> Machine:
    return Machine(HERE / "wire" / "wire.json", [wire_run("no-payload")], {}, ("mN·m",), kinematics=1)


def wire_contact(_folder: Path, _workers: int) -> Figures:
    """The threshold with the most contacts found less false alarms on one half of the recordings, counted on the other.

    The extended model of the free motion detects, from motor positions and load cells alone.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of 30 samples a second
        finger = tf.diagnose(HERE / "wire" / "wire.json", wire_run("no-payload")).extended
    names = [[f"{name}_{kind}" for name in CONDITIONS[k::2] for kind in ("un-tight", "tight")] for k in (0, 1)]
    chosen_on, counted = ([wire_run(name) for name in half] for half in (names[0], [*names[1], "testset"]))
    fingers = [finger.replace({"contact.threshold[1]": value}) for value in THRESHOLDS]
    scores = [tf.score(candidate, chosen_on) for candidate in fingers]
    best = int(np.argmax([score.found - score.false_alarms for score in scores]))
    report = tf.score(fingers[best], counted).report
    events = [event for recording in report["recordings"] for event in recording["event_list"] if event["found"]]
    figures = {key: report[key] for key in ("found", "events", "false_alarms")}
    counts = ["{found} of {events}".format(**figures), f"{report['false_alarms']} in {report['free_minutes']:.1f} min"]
    delay = float(np.median([event["delay_s"] for event in events])) - SMEAR
    return figures | {"lines": [[f"{1e3 * THRESHOLDS[best]:g}", *counts, f"{delay:.1f}"]]}


# --- parts ------------------------------------------------------------------------------------------------------------

MACHINES: dict[str, Callable[[], Machine]] = {
    "da Vinci jaw": jaw,
    "EMPS carriage": emps,
    "PSM joint 1": partial(psm, 1),
    "PSM joint 2": partial(psm, 2),
    "PSM joint 3": partial(psm, 3),
    "PSM joints 1 and 2": partial(psm, 1, 2),
    "two wires": wire,
}


def judge(name: str) -> Figures:
    """Errors of the refitted description and of the extended one, and the causes of the diagnosis."""
    machine = MACHINES[name]()
    test = next(iter(machine.judged.values()), ())
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found = tf.diagnose(machine.finger, machine.learned, test=test, kinematics=machine.kinematics)
        measured: dict[str, list[Any]] = {}
        for group, recordings in machine.judged.items():
            measure = partial(errors, recordings=recordings, kinematics=machine.kinematics)
            measured[group] = [measure(found.nominal, output="joint_torque")]
            measured[group] += [
                measure(model, output="compensated_torque") for model in (found.nominal, found.extended)
            ]
    if not measured:
        left = [found.report[model]["test_rms"] for model in ("nominal", "extended")]
        measured["parts left out"] = [[math.nan] * len(machine.units), *left]
    rows = [
        {"group": group, "joint": j + 1, "unit": unit, "errors": [_in(unit, part[j]) for part in parts]}
        for group, parts in measured.items()
        for j, unit in enumerate(machine.units)
    ]
    causes = [
        {"effect": cause.effect, "joint": cause.joint, "size": cause.size, "gain": 100 * cause.gain.value}
        for cause in found.causes
        if cause.effect not in ("contact", "unknown")
    ]
    return {"machine": name, "verdict": found.verdict, "rows": rows, "causes": causes}


def _in(unit: str, value: float) -> float:
    return (1e3 if unit.startswith("m") else 1.0) * value


def models(folder: Path, workers: int) -> Figures:
    rows = run_cases(judge, {name.replace(" ", "_"): (name,) for name in MACHINES}, folder, workers)
    return {row["machine"]: {key: row[key] for key in ("verdict", "rows", "causes")} for row in rows}


def error_table(figures: Figures) -> str:
    lines = []
    for name, found in figures.items():
        several = len({row["joint"] for row in found["rows"]}) > 1
        for row in found["rows"]:
            place = f"{name}, joint {row['joint']}" if several else name
            cells = [table.number(value, ".3g") for value in row["errors"]]
            lines.append([place, row["group"], row["unit"], *cells])
    head = ["machine", "judged on", "unit", "without a model", "as described, fitted", "with its causes"]
    return table.table(head, lines, 3)


def cause_table(figures: Figures) -> str:
    lines = []
    for name, found in figures.items():
        causes = found["causes"] or [{"effect": "none", "size": "", "gain": None}]
        for cause in causes:
            effect = f"`{cause['effect']}`" if found["causes"] else cause["effect"]
            lines.append([name, effect, cause["size"], table.number(cause["gain"], ".0f")])
    return table.table(["machine", "cause", "size", "gain, %"], lines, 3)


def published(_folder: Path, _workers: int) -> Figures:
    """The carriage fitted at 1 kHz: its numbers and its errors beside the published ones."""
    recordings = [emps_run(name) for name in (PLAIN, PULSES)]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        plain, pulled = HERE / "emps" / "symmetric.json", HERE / "emps" / "asymmetric.json"
        symmetric = tf.fit(plain, recordings[0], kinematics=ENCODER).finger
        # with two sides of the law the offset cannot be told from the difference of their Coulomb parts
        asymmetric = tf.fit(pulled, recordings[0], kinematics=ENCODER, fix="bias.initial_torque").finger
    law, bias = symmetric.data["joints"][0]["friction"], symmetric.data["bias"]
    numbers = (law["viscous"], law["coulomb"], bias["initial_torque"][0])
    fingers = {"symmetric": symmetric, "asymmetric": asymmetric, "with its causes": HERE / "emps" / "extended.json"}
    errors = {name: [share_missed(finger, recording) for recording in recordings] for name, finger in fingers.items()}
    return {
        "errors": errors,
        "error_lines": [
            [name, *(f"{error:.2f}" for error in found), *PUBLISHED_ERRORS.get(name, ("", ""))]
            for name, found in errors.items()
        ],
        "number_lines": [
            [name, f"{value:.4g}", f"{known:.4g}", f"{100 * (value / known - 1):+.1f} %"]
            for (name, known), value in zip(PUBLISHED.items(), numbers, strict=True)
        ],
    }


SERVOS = ("rotation", "pitch", "elbow", "wrist_pitch", "wrist_roll", "jaw")


def unsigned(_folder: Path, _workers: int) -> Figures:
    """Joints of a servo arm whose "torques" are currents without a sign, and of how many of them `check` says so."""
    text = (HERE / "so101" / "map.json").read_text(encoding="utf-8")
    named = []
    for log in sorted((DATA / "so101").glob("*/state_motor.csv")):
        for number, name in enumerate(SERVOS, start=1):
            recording = tf.convert(log, json.loads(text.replace("[3]", f"[{number}]").replace("elbow", name)))
            findings = tf.check(describe_recorded_joint(name, recording, 1.0), recording).findings
            named.append(any(finding.severity == "error" and "a magnitude" in finding.seen for finding in findings))
    return {"joints": len(named), "named": sum(named)}


NEEDS = ("../shared/data",)
PARTS = {
    "models": Part(
        models,
        minutes=3.0,
        needs=NEEDS,
        headlines={
            "da Vinci jaw.rows.0.errors.2": (0.0, 8.0),  # mN·m, odd loads
            "EMPS carriage.rows.0.errors.2": (0.0, 1.9),  # N, pulses
            "PSM joints 1 and 2.rows.0.errors.2": (0.0, 150.0),  # mN·m
            "two wires.rows.0.errors.2": (0.0, 1.7),  # mN·m
        },
        tables={"errors": error_table, "causes": cause_table},
    ),
    "published": Part(
        published,
        minutes=0.1,
        needs=NEEDS,
        headlines={"errors.symmetric.0": (4.0, 4.1), "errors.with its causes.1": (0.0, 2.75)},
        tables={
            "errors": table.of_cells("error_lines", ["friction", "found", "pulses", "published", "published, pulses"]),
            "numbers": table.of_cells("number_lines", ["number", "found", "published", "difference"]),
        },
    ),
    "wire_contact": Part(
        wire_contact,
        minutes=0.1,
        needs=NEEDS,
        headlines={"found": (18, 21), "false_alarms": (0, 2)},
        tables={
            "contacts": table.of_cells(
                "lines", ["threshold, mN·m", "contacts found", "false alarms", "median delay, s"], 0
            )
        },
    ),
    "so101": Part(unsigned, minutes=0.1, needs=NEEDS, headlines={"named": (18, 18)}),
}
