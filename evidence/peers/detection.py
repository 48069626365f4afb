"""Pushes that each tool finds on a finger of evidence/contact, at as many false alarms in free motion as TendonFMU has.

All learn on FREE. Thresholds of the others are the lowest with that number on MORE; pushes judge and chose nothing.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy import optimize, signal

import tendonfmu as tf
from evidence.cases import write
from evidence.contact import pushed_fingers
from evidence.contact.pushed_fingers import PRETENSIONS
from evidence.peers import mjcf, tools
from evidence.peers.signals import SEED, Case, Signals, recording_of, signals_of
from evidence.table import Row
from tendonfmu.arrays import Flags, Numbers
from tendonfmu.detect import score_detection

FREE, MORE, PUSHED = "free", "more", "push"
RATE = 125.0  # Hz, of the observers
GAIN = 50.0  # 1/s, of the momentum observer: usual, and 20 ms
SCALES = np.geomspace(100.0, 1.0, 70)  # of thresholds, in multiples of the free residual
Alarm = Callable[[str, float, float], tuple[Numbers, Flags]]  # kind of recording, pretension, scale -> times, alarm


def frame_of(folder: Path, kind: str, pretension: float) -> pd.DataFrame:
    return pd.read_parquet(pushed_fingers.place(folder, SEED, kind, pretension))


def case_of(folder: Path) -> Case:
    pushed_fingers.make(folder, SEED)
    finger = json.loads(pushed_fingers.description_file(folder, SEED).read_text(encoding="utf-8"))
    learned = [recording_of(frame_of(folder, FREE, pretension), FREE) for pretension in PRETENSIONS]
    return Case(finger, learned, [])


# --- tools ------------------------------------------------------------------------------------------------------------


def own_detector(folder: Path, case: Case, data: Mapping[str, Any]) -> Alarm:
    """The detector that the finger has."""

    def alarm(kind: str, pretension: float, scale: float) -> tuple[Numbers, Flags]:
        recording = recording_of(frame_of(folder, kind, pretension), kind)
        outputs = tf.run(data, recording, kinematics=case.kinematics).outputs
        return recording.time, np.asarray(outputs["contact"]).ravel() > 0

    return alarm


def paper_rule(folder: Path, case: Case, data: Mapping[str, Any]) -> Alarm:
    """The same friction model, with a threshold on its residual that grows with the pretension."""
    forces, sizes = [], []
    for recording in case.learned:
        outputs = tf.run({**data, "contact": never(case)}, recording, kinematics=case.kinematics).outputs
        forces.append([1.0, float(np.abs(recording.groups["tendon_force"]).mean())])
        sizes.append(outputs["compensated_torque"].std(axis=0))
    numbers = np.array([optimize.nnls(np.array(forces), size)[0] for size in np.array(sizes).T])

    def alarm(kind: str, pretension: float, scale: float) -> tuple[Numbers, Flags]:
        threshold, growth = (scale * numbers).T.tolist()
        contact = {"threshold": threshold, "threshold_per_force": growth}
        return own_detector(folder, case, {**data, "contact": contact})(kind, pretension, scale)

    return alarm


def never(case: Case) -> dict[str, Any]:
    return {"threshold": [1e3] * case.arms.shape[1]}


def observer(folder: Path, case: Case, predict: tools.Predict) -> Alarm:
    """A momentum observer on what a model leaves, r' = GAIN · (torque − prediction − r); a threshold a joint."""
    learned = [observed(case, predict, recording) for recording in case.learned]
    middle, size = (getattr(np, key)(np.concatenate([r for _, r in learned]), axis=0) for key in ("mean", "std"))
    seen: dict[tuple[str, float], tuple[Numbers, Numbers]] = {}

    def alarm(kind: str, pretension: float, scale: float) -> tuple[Numbers, Flags]:
        if (kind, pretension) not in seen:
            seen[kind, pretension] = observed(case, predict, recording_of(frame_of(folder, kind, pretension), kind))
        times, left = seen[kind, pretension]
        return times, np.any(np.abs(left - middle) > scale * size, axis=1)

    return alarm


def observed(case: Case, predict: tools.Predict, recording: tf.Recording) -> tuple[Numbers, Numbers]:
    """Times and [N, n] N·m; the inertia of the momentum is in the prediction."""
    signals = signals_of(case, recording, RATE)
    left, share = signals.torque - predict(signals), 1.0 - np.exp(-GAIN * float(np.median(np.diff(signals.time))))
    return signals.time, np.asarray(signal.lfilter([share], [1.0, share - 1.0], left, axis=0))


def by_mujoco(case: Case, signals: Signals) -> tools.Predict:
    return mjcf.inverted(case, signals, by_load=True)


LEARNERS: Mapping[str, Callable[[Case, Signals], tools.Predict]] = {
    "observer, Coulomb, viscous, load": tools.regressed,
    "observer, mujoco.sysid, pulleys by load": by_mujoco,
    "observer, boosted trees": tools.grown,
}
DELIVERED, PAPER = "TendonFMU", "its model with the paper's rule"
DETECTORS = (DELIVERED, PAPER, *LEARNERS)


# --- judgement --------------------------------------------------------------------------------------------------------


def false_alarms(alarm: Alarm, scale: float) -> int:
    """Of free motion that chose nothing but the threshold."""
    count = 0
    for pretension in PRETENSIONS:
        times, flags = alarm(MORE, pretension, scale)
        count += len(score_detection(times, np.zeros(len(times), dtype=bool), flags).false_alarms)
    return count


def lowest_scale(count: Callable[[float], int], allowed: int) -> float:
    """The lowest scale from which on upwards there are no more false alarms than allowed."""
    best = float(SCALES[0])
    for scale in SCALES:
        if count(float(scale)) > allowed:
            break
        best = float(scale)
    return best


def judged(folder: Path, alarm: Alarm, scale: float) -> Row:
    """Pushes with their size in mN·m, and what is false between them."""
    pushes, alarms, seconds = [], 0, 0.0
    for pretension in PRETENSIONS:
        frame = frame_of(folder, PUSHED, pretension)
        torque = 1e3 * frame[[f"external_torque[{j + 1}]" for j in range(3)]].abs().max(axis=1).to_numpy()
        times, flags = alarm(PUSHED, pretension, scale)
        label = np.interp(times, frame["time"], frame["contact"]) > 0.5
        score = score_detection(times, label, flags)
        for event in score.events:
            inside = frame["time"].between(event.onset_s - 0.01, event.end_s + 0.01).to_numpy()
            pushes.append({"size": torque[inside].max(), "found": event.found, "delay": event.delay_s})
        alarms, seconds = alarms + len(score.false_alarms), seconds + score.free_seconds
    return {"pushes": pushes, "alarms": alarms, "minutes": seconds / 60.0}


def delivered(folder: Path, case: Case) -> tuple[dict[str, Any], float]:
    """What `tendonfmu calibrate` makes of the finger, and its processor seconds; kept."""
    file = folder / "delivered.json"
    if not file.exists():
        before = time.process_time()
        finger = tf.calibrate(case.finger, list(case.learned), kinematics=case.kinematics).finger
        write(file, {"finger": finger.to_dict(), "cpu": time.process_time() - before})
    kept = json.loads(file.read_text(encoding="utf-8"))
    return kept["finger"], kept["cpu"]


def detected(folder: Path, name: str) -> Row:
    """One tool: as many false alarms as the delivered detector has are allowed."""
    case = case_of(folder)
    data, cpu = delivered(folder, case)
    own = own_detector(folder, case, data)
    alarm, scale = own, 1.0
    if name != DELIVERED:
        alarm, cpu = rival(folder, case, data, name)
        scale = lowest_scale(lambda s: false_alarms(alarm, s), false_alarms(own, 1.0))
    free = false_alarms(alarm, scale)
    return {"detector": name, "free_alarms": free, "scale": scale, "cpu": cpu} | judged(folder, alarm, scale)


def rival(folder: Path, case: Case, data: Mapping[str, Any], name: str) -> tuple[Alarm, float]:
    """Another detector, and the processor seconds of learning it."""
    if name == PAPER:
        return paper_rule(folder, case, data), delivered(folder, case)[1]
    before = time.process_time()
    predict = LEARNERS[name](case, tools.learned_signals(case))
    return observer(folder, case, predict), time.process_time() - before
