"""A prototype in numpy: slow pushes found by a drift test beside the innovation, on the fingers of mujoco_pushes.py.

The rule. e_j = τ_j − (T_eff,j − b_eff,j), which is `compensated_torque` + `bias_torque`: what the modelled friction
leaves, the bias apart. Two means of it, each over its own time, m ← m + (1 − exp(−dt/T))·(e − m): a quick one (T_q) and
a slow one (T_s), which stands still while the rule holds. From the first sample on both are plain means until their
time has passed. Joint j drifts if |quick − slow| > D_j + D'_j·mean|f0|. The bounds are chosen on free motion by what
chooses those of the innovation, for the same rate of false alarms; no share of stiction or jumps.

    python bench/slow_pushes.py -o FOLDER --fingers 3 4       # FOLDER: of detection_mujoco.py

Every pair of times is shown; none is chosen.
"""

from __future__ import annotations

import argparse
import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from detection_mujoco import calibrated
from mujoco_pushes import FREE, PRETENSIONS, make, place, pushes_of
from numpy.typing import NDArray

from tendonfmu.alarm_level import allowed_alarms, cells_of, rate_limit
from tendonfmu.description import FingerDescription, read_finger
from tendonfmu.detection_bounds import Bound, search_for
from tendonfmu.detection_run import Subject, run_track
from tendonfmu.detection_score import score_detection
from tendonfmu.free_motion import FreePart, FreeRun, free_parts
from tendonfmu.recording import Recording, read_recording
from tendonfmu.tuning_level import given_line, level_of

Numbers = NDArray[np.float64]
Flags = NDArray[np.bool_]
RATE, CONFIDENCE = 6.0, 0.9  # 1/h
TIMES = ((0.3, 5.0), (0.3, 10.0), (1.0, 10.0), (1.0, 30.0))  # s, T_q and T_s
STEP = 0.02  # s between the samples that the rule looks at


@dataclass(frozen=True)
class Seen:
    """A recording every STEP: time [k] s, force [k] N, left: e [k, n] N·m, alarm [k] of the tuned finger."""

    time: Numbers
    force: Numbers
    left: Numbers
    alarm: Flags


def seen(finger: FingerDescription, recording: Recording) -> Seen:
    track = run_track(Subject(Path("finger"), finger, packed=False), recording, 1, None)
    left = track.outputs["compensated_torque"] + track.outputs["bias_torque"]
    every = max(1, round(STEP / float(np.median(np.diff(recording.time)))))
    size = len(left) // every
    force = np.abs(recording.groups["tendon_force"]).mean(axis=1)
    alarm = np.asarray(track.outputs["contact"]).ravel().astype(bool)

    def mean(values: Numbers) -> Numbers:
        return np.asarray(values[: size * every].reshape(size, every, -1).mean(axis=1))

    flags = alarm[: size * every].reshape(size, every).any(axis=1)
    return Seen(recording.time[every - 1 :: every][:size], mean(force)[:, 0], mean(left), flags)


def drift(each: Seen, times: tuple[float, float], bound: Bound | None) -> tuple[Numbers, Flags]:
    """quick − slow [k, n] N·m, and where the rule holds [k]; without a bound nowhere."""
    quick, slow = each.left[0].copy(), each.left[0].copy()
    found, holds = np.zeros_like(each.left), np.zeros(len(each.time), dtype=bool)
    whole = None if bound is None else bound.own(each.force)
    for k in range(1, len(each.time)):
        since = each.time[k] - each.time[0]
        dt = each.time[k] - each.time[k - 1]
        quick += (1.0 - math.exp(-dt / min(times[0], since))) * (each.left[k] - quick)
        if not holds[k - 1]:
            slow += (1.0 - math.exp(-dt / min(times[1], since))) * (each.left[k] - slow)
        found[k] = quick - slow
        holds[k] = whole is not None and bool((np.abs(found[k]) > whole[k]).any())
    return found, holds


def bounds(free: list[Seen], parts: list[FreePart], times: tuple[float, float]) -> Bound:
    """By free motion alone, as `tune` chooses them."""
    runs = []
    for each, part in zip(free, parts, strict=True):
        value = drift(each, times, None)[0].astype(np.float32)
        none = np.zeros_like(value)
        runs.append(FreeRun(part, value, value, none, none, none, none))
    cells = cells_of(parts)
    hours = sum(part.hours for part in parts)
    allowed = max(0, allowed_alarms(hours, RATE, CONFIDENCE))
    search = search_for(runs, cells, "innovation", max(RATE, rate_limit(0, hours, CONFIDENCE)))
    line = given_line(search, [(0.0, 0.0)] * 3, allowed)
    return line.bound.scaled(level_of(line, cells, allowed).factor)


def coarse(part: FreePart, each: Seen) -> FreePart:
    """The part as the rule samples it; the first 5 s do not count."""
    seconds = np.full(len(each.time), STEP)
    counted = each.time - each.time[0] > 5.0
    return replace(part, arrays={"time": each.time}, mean_force=each.force, counted=counted, seconds=seconds)


def scored(each: Seen, label: Flags, holds: Flags) -> Any:
    return score_detection(each.time, label, each.alarm | holds)


def finger_rows(folder: Path, number: int, pairs: tuple[tuple[float, float], ...]) -> list[str]:
    """A row of the table for each pair of times, and one without the rule."""
    make(folder, number, ("slow",))
    finger = read_finger(calibrated(folder, number) / "finger.json")
    recordings = [read_recording(place(folder, number, kind, each)) for kind in FREE for each in PRETENSIONS]
    free = [seen(finger, each) for each in recordings]
    parts = [
        coarse(part, each)
        for recording, each in zip(recordings, free, strict=True)
        for part in free_parts(finger, recording, 1)[0]
    ]
    slow = [seen(finger, read_recording(place(folder, number, "slow", each))) for each in PRETENSIONS]
    labels = []
    for each, pretension in zip(slow, PRETENSIONS, strict=True):
        spans = [(push.begin, push.end) for push in pushes_of(folder, number, pretension, "slow")]
        labels.append(np.any([(each.time >= begin) & (each.time <= end) for begin, end in spans], axis=0))
    pushes = [push for pretension in PRETENSIONS for push in pushes_of(folder, number, pretension, "slow")]
    force = np.abs([push.force for push in pushes])
    rows = []
    for times in (None, *pairs):
        bound = None if times is None else bounds(free, parts, times)
        scores = []
        for each, label in zip(slow, labels, strict=True):
            holds = np.zeros_like(each.alarm) if times is None else drift(each, times, bound)[1]
            scores.append(scored(each, label, holds))
        found = np.array([event.found for score in scores for event in score.events])
        alarms = sum(len(score.false_alarms) for score in scores)
        minutes = sum(score.free_seconds for score in scores) / 60
        name = "none" if times is None else f"{times[0]:g}, {times[1]:g}"
        own = "" if bound is None else ", ".join(f"{1e3 * value:.0f}" for value in bound.own(np.array(PRETENSIONS))[0])
        strong = force >= 0.5
        share = f"{found.sum()}/{len(found)} | {(found & strong).sum()}/{strong.sum()}"
        rows.append(f"| {number} | {name} | {share} | {alarms} in {minutes:.1f} | {own} |")
        print(rows[-1], flush=True)
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, required=True, help="folder of detection_mujoco.py")
    parser.add_argument("--fingers", type=int, nargs="+", required=True)
    given = parser.parse_args()
    print("| finger | T_q, T_s | found | of 0.5 N and more | false alarms in min | bound at 15 N, mN·m |")
    print("| --- | --- | ---: | ---: | ---: | --- |")
    for number in given.fingers:
        finger_rows(given.output, number, TIMES)


if __name__ == "__main__":
    main()
