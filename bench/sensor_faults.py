"""Failing sensors: reported as faults or as contact, and faults that are reported where every sensor is sound.

Fingers in MuJoCo (mujoco_pushes.py, diagnosed as in detection_mujoco.py) and the simulated index finger are tuned on
free motion; the keys of sensor_fault are learned from their training recordings alone. Faults
(sensor_fault_cases.py) are put into free motion and into recordings with pushes. Sound recordings, those of fingers in
numpy and, with --foreign, of a folder with case_NN.json, case_NN_train.parquet, case_NN_test.parquet among them, must
show none.

    python bench/sensor_faults.py -o FOLDER [--fingers 1 3 4 6] [--foreign FOLDER]

Everything is kept in the folder; writes sensor_faults.md and, with a row for each fault, sensor_faults.csv.
"""

from __future__ import annotations

import argparse
import csv
import json
import sys
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from detection_mujoco import calibrated
from mujoco_pushes import PRETENSIONS, make, place
from sensor_fault_cases import (
    FINGER,
    KINDS,
    LASTS,
    SIMULATED_PRETENSIONS,
    Fault,
    arrays_of,
    of_files,
    of_numpy,
    simulated,
    with_faults,
)
from tendonfmu.detect.free_motion import FreePart
from tendonfmu.detect.sensor_faults import learn_sensors
from tendonfmu.detect.tuning import ContactTuning, TuneWarning
from tendonfmu.model.description import read_finger
from tendonfmu.model.native import Instance
from tendonfmu.recordings.recording import read_recording

Numbers = NDArray[np.float64]
Flags = NDArray[np.bool_]

FINGERS = (1, 3, 4, 6)
OFF = (0.05, 0.1)  # standard deviation of factors on springs; half of it on moment arms
NUMPY, NUMPY_SECONDS = range(1, 23), (60.0, 120.0)
LEAST_WRONG = 1.0  # N; a reading that is nowhere wrong by more needs no report
AROUND = 0.5  # s around contact of the sound recording that is not counted, and after a fault that is
SETTLING = 2.0  # s


@dataclass(frozen=True)
class Subject:
    """A tuned finger. sound: recordings by kind of motion, with arrays."""

    name: str
    data: Mapping[str, Any]
    sound: Mapping[str, Sequence[dict[str, Numbers]]]


@dataclass(frozen=True)
class Judged:
    """A fault. delay: s to its report, NaN: none. contact: reported as such while it lasts. other: at another tendon.
    unwatched: contact without the key."""

    finger: str
    motion: str
    fault: Fault
    delay: float
    contact: bool
    other: bool
    unwatched: bool


def say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


# --- fingers ----------------------------------------------------------------------------------------------------------


def learned(data: Mapping[str, Any], arrays: Sequence[Mapping[str, Numbers]]) -> dict[str, Any]:
    """The description with sensor_fault from these recordings."""
    parts = []
    for each in arrays:
        settled = each["time"] - each["time"][0] >= SETTLING
        force = np.abs(each["tendon_force"]).mean(axis=1)
        parts.append(FreePart("training", each, force, settled, np.gradient(each["time"])))
    rule = learn_sensors(data, parts)
    say(f"  sensor_fault: {rule}")
    return {**data, "sensor_fault": rule.keys}


def tuned(folder: Path, name: str, start: Path, free: Sequence[Path]) -> dict[str, Any]:
    """Tuned on free motion; kept."""
    file = folder / f"sensors_{name}.json"
    if not file.exists():
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", TuneWarning)
            tuning = ContactTuning(read_finger(start)).tune(free)
        file.write_text(tuning.description_text(), encoding="utf-8")
    return dict(json.loads(file.read_text(encoding="utf-8")))


def subjects(folder: Path, numbers: Sequence[int]) -> Iterator[Subject]:
    """Fingers in MuJoCo, and the simulated one."""
    for number in numbers:
        make(folder, number)
        files = {
            kind: [place(folder, number, kind, each) for each in PRETENSIONS] for kind in ("train", "free", "push")
        }
        data = tuned(folder, f"mujoco_{number:02d}", calibrated(folder, number, "extended"), files["free"])
        found = _subject(f"MuJoCo {number}", data, files)
        yield found
        train = [arrays_of(read_recording(file)) for file in files["train"]]
        yield from (each for spread in OFF if (each := off(found, spread, train)) is not None)
    kinds = ("train", "free", "push")
    files = {kind: [simulated(folder, kind, each) for each in SIMULATED_PRETENSIONS] for kind in kinds}
    yield _subject("simulated", tuned(folder, "simulated", FINGER, files["free"]), files)


def off(subject: Subject, spread: float, train: Sequence[Mapping[str, Numbers]]) -> Subject | None:
    """The same finger by springs and moment arms that are off by random factors; None where the key is left out."""
    rng = np.random.default_rng([len(subject.name), round(100 * spread)])
    tendons = []
    for tendon in subject.data["tendons"]:
        arms = [arm * float(np.exp(rng.normal(0.0, spread / 2))) for arm in tendon["moment_arms"]]
        stiffness = tendon["stiffness"] * float(np.exp(rng.normal(0.0, spread)))
        tendons.append({**tendon, "stiffness": stiffness, "moment_arms": arms})
    data = learned({**subject.data, "tendons": tendons}, train)
    name = f"{subject.name}, springs off by {100 * spread:g} %"
    return None if data["sensor_fault"] is None else Subject(name, data, subject.sound)


def _subject(name: str, data: Mapping[str, Any], files: Mapping[str, Sequence[Path]]) -> Subject:
    say(name)
    arrays = {kind: [arrays_of(read_recording(file)) for file in each] for kind, each in files.items()}
    return Subject(name, learned(data, arrays.pop("train")), arrays)


# --- faults -----------------------------------------------------------------------------------------------------------


def run(data: Mapping[str, Any], arrays: Mapping[str, Numbers]) -> dict[str, NDArray[Any]]:
    return Instance.from_description(json.dumps(data), 1).run(arrays)


def widened(flags: Flags, time: Numbers) -> Flags:
    """[N] true within AROUND of a true one."""
    at = time[flags]
    near = np.searchsorted(at, time)
    after = np.abs(time - at[np.maximum(near - 1, 0)]) <= AROUND if len(at) else np.zeros(len(time), dtype=bool)
    before = np.abs(time - at[np.minimum(near, len(at) - 1)]) <= AROUND if len(at) else after
    return np.asarray(after | before)


def judge(subject: Subject, motion: str, arrays: Mapping[str, Numbers], seed: Sequence[int]) -> list[Judged]:
    """Every fault put into a recording. Contact that the sound recording has too is no error."""
    stiffness = np.array([tendon["stiffness"] for tendon in subject.data["tendons"]], dtype=float)
    faulty, faults = with_faults(arrays, stiffness, seed)
    time, unwatched = faulty["time"], {key: value for key, value in subject.data.items() if key != "sensor_fault"}
    known = widened(run(subject.data, arrays)["contact"].ravel().astype(bool), time)
    out, plain = run(subject.data, faulty), run(unwatched, faulty)
    found = []
    for fault in faults:
        during = (time >= fault.begin) & (time < fault.end)
        after = (time >= fault.begin) & (time < fault.end + AROUND)
        reported = np.flatnonzero(during & out["sensor_fault"][:, fault.tendon].astype(bool))
        others = np.delete(out["sensor_fault"], fault.tendon, axis=1).any(axis=1)
        delay = float(time[reported[0]] - fault.begin) if len(reported) else np.nan
        contact, before = ((each["contact"].ravel().astype(bool) & after & ~known).any() for each in (out, plain))
        found.append(Judged(subject.name, motion, fault, delay, contact, bool((others & during).any()), before))
    return found


def sound_faults(data: Mapping[str, Any], arrays: Mapping[str, Numbers]) -> tuple[int, float]:
    """Faults that begin in a sound recording, and its hours."""
    flags = run(data, arrays)["sensor_fault"].astype(int)
    begins = int((np.diff(flags, axis=0, prepend=0) > 0).sum())
    return begins, float(arrays["time"][-1] - arrays["time"][0]) / 3600.0


# --- table ------------------------------------------------------------------------------------------------------------


def is_as_described(name: str) -> bool:
    return "off by" not in name


def rows(judged: Sequence[Judged]) -> Iterator[str]:
    headings = (
        "faults | wrong by ≥ 1 N | reported, no contact | as contact | at another tendon | as contact without the key"
    )
    yield f"| finger | motion | fault | {headings} | median delay, ms |\n| --- | --- | --- |" + " ---: |" * 7
    names = list(dict.fromkeys(each.finger for each in judged))
    for name in names:
        for motion in ("free", "push"):
            yield row((name, motion, "any"), [each for each in judged if (each.finger, each.motion) == (name, motion)])
    described = [each for each in judged if is_as_described(each.finger)]
    for motion in ("free", "push"):
        for kind in (*KINDS, "any"):
            some = [each for each in described if each.motion == motion and kind in (each.fault.kind, "any")]
            yield row(("all as described", motion, kind), some)


def row(cells: Sequence[str], judged: Sequence[Judged]) -> str:
    matter = [each for each in judged if each.fault.wrong >= LEAST_WRONG]
    right = [each for each in matter if np.isfinite(each.delay) and not each.contact]
    delays = [each.delay for each in matter if np.isfinite(each.delay)]
    share = f"{len(right)} ({100 * len(right) / max(len(matter), 1):.1f} %)"
    counts = (sum(getattr(each, name) for each in judged) for name in ("contact", "other", "unwatched"))
    contact, other, unwatched = (str(each) for each in counts)
    late = f"{1e3 * float(np.median(delays)):.0f}" if delays else "–"
    return (
        "| " + " | ".join([*cells, str(len(judged)), str(len(matter)), share, contact, other, unwatched, late]) + " |"
    )


def sound_rows(sound: Sequence[tuple[str, str, int, float]]) -> Iterator[str]:
    yield "| sound recordings | motion | hours | faults reported |\n| --- | --- | ---: | ---: |"
    for name, motion, faults, hours in sound:
        yield f"| {name} | {motion} | {hours:.2f} | {faults} |"
    for motion in ("free", "push"):
        some = [each for each in sound if each[1] == motion and is_as_described(each[0])]
        yield f"| all as described | {motion} | {sum(each[3] for each in some):.2f} | {sum(each[2] for each in some)} |"


def write_faults(file: Path, judged: Sequence[Judged]) -> None:
    with file.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream)
        writer.writerow(
            ["finger", "motion", "kind", "tendon", "begin", "wrong", "delay", "contact", "other", "unwatched"]
        )
        for each in judged:
            fault = each.fault
            cells = [each.finger, each.motion, fault.kind, fault.tendon + 1, f"{fault.begin:.3f}", f"{fault.wrong:.3g}"]
            writer.writerow([*cells, f"{each.delay:.4g}", int(each.contact), int(each.other), int(each.unwatched)])


def others(foreign: Path | None) -> Iterator[tuple[str, Any, dict[str, Numbers], dict[str, Numbers]]]:
    """Fingers of which only sound recordings are judged: family, description, training, test."""
    for number in NUMPY:
        yield f"numpy ({len(NUMPY)} fingers)", *of_numpy(number, *NUMPY_SECONDS)
    files = sorted(foreign.glob("case_??.json")) if foreign else []
    for file in files:
        train, test = (file.with_name(f"{file.stem}_{kind}.parquet") for kind in ("train", "test"))
        yield f"foreign ({len(files)} fingers)", *of_files(file, train, test)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, required=True, help="folder of everything")
    parser.add_argument("--fingers", type=int, nargs="+", default=FINGERS, help="numbers of python_tests/foreign")
    parser.add_argument("--foreign", type=Path, help="folder of further recordings")
    given = parser.parse_args()
    given.output.mkdir(parents=True, exist_ok=True)
    judged: list[Judged] = []
    sound: list[tuple[str, str, int, float]] = []
    for n, subject in enumerate(subjects(given.output, given.fingers)):
        for m, (motion, recordings) in enumerate(subject.sound.items()):
            for k, arrays in enumerate(recordings):
                judged += judge(subject, motion, arrays, [n, m, k])
            counts = [sound_faults(subject.data, arrays) for arrays in recordings]
            sound.append((subject.name, motion, sum(c[0] for c in counts), sum(c[1] for c in counts)))
            say(
                row(
                    (subject.name, motion, "any"), [e for e in judged if (e.finger, e.motion) == (subject.name, motion)]
                )
            )
    for name, data, train, test in others(given.foreign):
        found = sound_faults(learned(data, [train]), test)
        before = sound.pop() if sound and sound[-1][0] == name else (name, "free", 0, 0.0)
        sound.append((name, "free", before[2] + found[0], before[3] + found[1]))
    text = "\n".join([*rows(judged), "", *sound_rows(sound), "", f"A fault lasts {LASTS:g} s.", ""])
    (given.output / "sensor_faults.md").write_text(text, encoding="utf-8")
    write_faults(given.output / "sensor_faults.csv", judged)
    print(text)


if __name__ == "__main__":
    main()
