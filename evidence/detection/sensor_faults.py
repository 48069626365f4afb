"""Failing sensors: reported as faults or as contact, and faults reported where every sensor is sound.

    python -m evidence.detection.sensor_faults -o FOLDER [--foreign FOLDER]

--foreign: a folder with case_NN.json, case_NN_train.parquet, case_NN_test.parquet. Everything is kept in the folder;
writes sensor_faults.md.
"""

from __future__ import annotations

import json
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from evidence import tables
from evidence.fingers import numpy_cases
from evidence.runner import INDEX_FINGER, INDEX_RIG, parser, publish, run_cases, say, write
from evidence.tables import Row
from tendonfmu.arrays import Flags, Numbers
from tendonfmu.detect import ContactTuning, TuneWarning
from tendonfmu.detect.free_motion import FreePart
from tendonfmu.detect.sensor_faults import learn_sensors
from tendonfmu.files import write_table
from tendonfmu.model import read_finger
from tendonfmu.model.native import run_recording
from tendonfmu.recordings import read_recording
from tendonfmu.simulate import read_rig, simulate

Arrays = dict[str, Numbers]

FINGERS = (1, 3, 4, 6)  # numbers of evidence/fingers
OFF = (0.05, 0.1)  # standard deviation of factors on springs; half of it on moment arms
NUMPY, NUMPY_SECONDS = range(1, 23), (60.0, 120.0)
PRETENSIONS = (10.0, 20.0)  # N, of the simulated finger
SECONDS = {"train": 60.0, "free": 300.0, "push": 240.0}
PUSH_EVERY = 6.0  # s
KINDS = ("zero", "frozen", "jump", "position")
SLOT, EARLIEST, LATEST, LASTS = 8.0, 1.0, 2.5, 3.0  # s
JUMP = (2.0, 10.0)  # N
LEAST_WRONG = 1.0  # N; a reading that is nowhere wrong by more needs no report
AROUND = 0.5  # s around contact of the sound recording that is not counted, and after a fault that is
SETTLING = 2.0  # s
INPUTS = ("tendon_force", "tendon_position")


# --- fingers ----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Subject:
    """A tuned finger."""

    name: str
    data: Mapping[str, Any]
    sound: Mapping[str, Sequence[Arrays]]  # recordings by kind of motion
    described: bool = True  # its springs and arms are as described


def learned(data: Mapping[str, Any], recordings: Sequence[Arrays]) -> dict[str, Any]:
    """The description with sensor_fault from these recordings."""
    parts = []
    for arrays in recordings:
        settled = arrays["time"] - arrays["time"][0] >= SETTLING
        force = np.abs(arrays["tendon_force"]).mean(axis=1)
        parts.append(FreePart("training", arrays, force, settled, np.gradient(arrays["time"])))
    rule = learn_sensors(data, parts)
    say(f"  sensor_fault: {rule}")
    return {**data, "sensor_fault": rule.keys}


def subject(folder: Path, name: str, start: Path, files: Mapping[str, Sequence[Path]]) -> tuple[Subject, list[Arrays]]:
    """A finger tuned on free motion (kept), and its training recordings."""
    say(name)
    file = folder / f"sensors_{name.replace(' ', '_')}.json"
    if not file.exists():
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", TuneWarning)
            write(file, ContactTuning(read_finger(start)).tune(files["free"]).description_text())
    arrays = {kind: [arrays_of(path) for path in paths] for kind, paths in files.items()}
    train = arrays.pop("train")
    return Subject(name, learned(json.loads(file.read_text(encoding="utf-8")), train), arrays), train


def subjects(folder: Path, number: int | None) -> Iterator[Subject]:
    """A finger in MuJoCo, as described and by descriptions that are off; None: the simulated one."""
    if number is None:
        files = {kind: [simulated(folder, kind, pretension) for pretension in PRETENSIONS] for kind in SECONDS}
        yield subject(folder, "simulated", INDEX_FINGER, files)[0]
        return
    from evidence.detection import mujoco, mujoco_pushes

    start = mujoco.calibrated(folder, number) / "finger.json"
    mujoco_pushes.make(folder, number, ("free", "more", "push"))
    kinds = {"train": "more", "free": "free", "push": "push"}
    files = {
        kind: [mujoco_pushes.place(folder, number, made, pretension) for pretension in mujoco_pushes.PRETENSIONS]
        for kind, made in kinds.items()
    }
    as_described, train = subject(folder, f"MuJoCo {number}", start, files)
    yield as_described
    for spread in OFF:
        data = learned(off(as_described, spread), train)
        if data["sensor_fault"] is not None:
            name = f"{as_described.name}, springs off by {100 * spread:g} %"
            yield Subject(name, data, as_described.sound, described=False)


def off(of: Subject, spread: float) -> dict[str, Any]:
    """The description with springs and moment arms that are off by random factors."""
    rng = np.random.default_rng([len(of.name), round(100 * spread)])
    tendons = []
    for tendon in of.data["tendons"]:
        arms = [arm * float(np.exp(rng.normal(0.0, spread / 2))) for arm in tendon["moment_arms"]]
        stiffness = tendon["stiffness"] * float(np.exp(rng.normal(0.0, spread)))
        tendons.append({**tendon, "stiffness": stiffness, "moment_arms": arms})
    return {**of.data, "tendons": tendons}


def arrays_of(file: Path) -> Arrays:
    recording = read_recording(file)
    return {"time": recording.time, **{name: recording.groups[name] for name in INPUTS}}


def simulated(folder: Path, kind: str, pretension: float) -> Path:
    """A recording of the simulated finger; made where it is missing."""
    file = folder / f"simulated_{kind}_{pretension:g}.parquet"
    if not file.exists():
        seconds, seed = SECONDS[kind], 8_100_000 + 1000 * list(SECONDS).index(kind)
        rig = {
            "format": "tendonfmu-rig-1",
            "base": str(INDEX_RIG),
            "name": file.stem,
            "seed": seed + round(pretension),
            "motion": {"pretension": pretension, "seed": seed + round(pretension), "duration": None},
            "pushes": list(_pushes(seed, seconds)) if kind == "push" else [],
            "recording": {"columns": ["contact"], "duration": seconds},
        }
        write(file.with_suffix(".json"), rig)
        write_table(file, simulate(read_rig(file.with_suffix(".json"))).recording)
    return file


def _pushes(seed: int, seconds: float) -> Iterator[dict[str, Any]]:
    rng = np.random.default_rng(seed)
    for k in range(1, int(seconds // PUSH_EVERY)):
        force, rise = float(np.exp(rng.uniform(*np.log((0.1, 2.0))))), float(rng.uniform(0.01, 0.05))
        times = {"start": k * PUSH_EVERY + rng.uniform(0.0, 3.0), "rise": rise, "hold": rng.uniform(0.3, 1.0)}
        yield {**times, "fall": rise, "force": force, "direction": [0.0, 0.0, 1.0]}


# --- faults -----------------------------------------------------------------------------------------------------------


def with_faults(arrays: Arrays, stiffness: Numbers, seed: Sequence[int]) -> tuple[Arrays, list[Row]]:
    """The recording with a fault in each slot; wrong: N, the largest error of f0, or k times that of x0."""
    rng = np.random.default_rng(seed)
    force, position = arrays["tendon_force"].copy(), arrays["tendon_position"].copy()
    time, faults = arrays["time"], []
    for k in range(int((time[-1] - time[0]) // SLOT)):
        begin = float(time[0]) + k * SLOT + rng.uniform(EARLIEST, LATEST)
        first, last = np.searchsorted(time, (begin, begin + LASTS))
        i, kind, rows = int(rng.integers(force.shape[1])), KINDS[k % len(KINDS)], slice(int(first), int(last))
        size = float(np.exp(rng.uniform(*np.log(JUMP)))) * (1.0 if rng.random() < 0.5 else -1.0)
        signals = position if kind == "position" else force
        sound = signals[rows, i].copy()
        signals[rows, i] = {"zero": 0.0, "jump": sound + size}.get(kind, signals[rows.start - 1, i])
        wrong = float(np.abs(signals[rows, i] - sound).max()) * (stiffness[i] if kind == "position" else 1.0)
        faults.append({"kind": kind, "tendon": i, "begin": time[first], "end": time[last], "wrong": wrong})
    return {"time": time, "tendon_force": force, "tendon_position": position}, faults


def widened(flags: Flags, time: Numbers) -> Flags:
    """[N] true within AROUND of a true one."""
    at = time[flags]
    near = np.searchsorted(at, time)
    after = np.abs(time - at[np.maximum(near - 1, 0)]) <= AROUND if len(at) else np.zeros(len(time), dtype=bool)
    before = np.abs(time - at[np.minimum(near, len(at) - 1)]) <= AROUND if len(at) else after
    return np.asarray(after | before)


def judged(of: Subject, motion: str, arrays: Arrays, seed: Sequence[int]) -> Iterator[Row]:
    """Every fault put into a recording. Contact that the sound recording has too is no error."""
    # delay: s to its report; contact: reported as such while it lasts; other: at another tendon; unwatched: contact
    # without the key
    stiffness = np.array([tendon["stiffness"] for tendon in of.data["tendons"]], dtype=float)
    faulty, faults = with_faults(arrays, stiffness, seed)
    time, without_key = faulty["time"], {key: value for key, value in of.data.items() if key != "sensor_fault"}
    known = widened(run_recording(of.data, arrays)["contact"].ravel().astype(bool), time)
    out, bare = run_recording(of.data, faulty), run_recording(without_key, faulty)
    for fault in faults:
        during = (time >= fault["begin"]) & (time < fault["end"])
        after = (time >= fault["begin"]) & (time < fault["end"] + AROUND)
        reported = np.flatnonzero(during & out["sensor_fault"][:, fault["tendon"]].astype(bool))
        others = np.delete(out["sensor_fault"], fault["tendon"], axis=1).any(axis=1)
        contact, unwatched = (bool((run["contact"].ravel().astype(bool) & after & ~known).any()) for run in (out, bare))
        yield {
            "finger": of.name,
            "described": of.described,
            "motion": motion,
            **fault,
            "tendon": fault["tendon"] + 1,
            "delay": float(time[reported[0]] - fault["begin"]) if len(reported) else None,
            "contact": contact,
            "other": bool((others & during).any()),
            "unwatched": unwatched,
        }


def sound(name: str, described: bool, motion: str, data: Mapping[str, Any], recordings: Sequence[Arrays]) -> Row:
    """Faults that begin in sound recordings, and their hours."""
    begins, hours = 0, 0.0
    for arrays in recordings:
        flags = run_recording(data, arrays)["sensor_fault"].astype(int)
        begins += int((np.diff(flags, axis=0, prepend=0) > 0).sum())
        hours += float(arrays["time"][-1] - arrays["time"][0]) / 3600.0
    return {"finger": name, "described": described, "motion": motion, "faults": begins, "hours": hours}


# --- cases ------------------------------------------------------------------------------------------------------------


def of_subjects(folder: Path, number: int | None, first: int) -> Row:
    """All that is judged of one finger; first: number of its first description, of which seeds are made."""
    faults: list[Row] = []
    counts: list[Row] = []
    for n, tuned in enumerate(subjects(folder, number), start=first):
        for m, (motion, recordings) in enumerate(tuned.sound.items()):
            for k, arrays in enumerate(recordings):
                faults += judged(tuned, motion, arrays, [n, m, k])
            counts.append(sound(tuned.name, tuned.described, motion, tuned.data, recordings))
    return {"faults": faults, "sound": counts}


def of_numpy(number: int) -> Row:
    """A finger in numpy, of which only sound recordings are judged."""
    case = numpy_cases.make(number, *NUMPY_SECONDS)
    train, test = (
        {"time": frame["time"].to_numpy()} | {name: frame.filter(regex=rf"^{name}\[").to_numpy() for name in INPUTS}
        for frame in (case.train, case.test)
    )
    return sound_alone(f"numpy ({len(NUMPY)} fingers)", case.nominal, train, test)


def of_folder(description: Path, count: int) -> Row:
    """A finger of the folder of further recordings, likewise."""
    data = json.loads(description.read_text(encoding="utf-8"))
    train, test = (arrays_of(description.with_name(f"{description.stem}_{kind}.parquet")) for kind in ("train", "test"))
    return sound_alone(f"foreign ({count} fingers)", data, train, test)


def sound_alone(name: str, data: Mapping[str, Any], train: Arrays, test: Arrays) -> Row:
    return {"faults": [], "sound": [sound(name, True, "free", learned(data, [train]), [test])]}


# --- tables -----------------------------------------------------------------------------------------------------------


def cells(rows: Sequence[Row]) -> list[str]:
    matter = [row for row in rows if row["wrong"] >= LEAST_WRONG]
    right = [row for row in matter if row["delay"] is not None and not row["contact"]]
    share = f"{len(right)} ({100 * len(right) / max(len(matter), 1):.1f} %)"
    counts = [str(sum(row[key] for row in rows)) for key in ("contact", "other", "unwatched")]
    return [str(len(rows)), str(len(matter)), share, *counts, tables.median((r["delay"] for r in matter), ".0f", 1e3)]


def report(faults: Sequence[Row], counts: Sequence[Row]) -> str:
    everything = [row | {"kind": "any"} for row in faults]
    described = [row | {"finger": "all as described"} for row in faults if row["described"]]
    together = sorted([*described, *(row | {"kind": "any"} for row in described)], key=lambda row: row["motion"])
    lines = tables.by([*everything, *together], ["finger", "motion", "kind"], cells)
    head = ["finger", "motion", "fault", "faults", "wrong by ≥ 1 N", "reported, no contact", "as contact"]
    head += ["at another tendon", "as contact without the key", "median delay, ms"]
    all_sound = [row | {"finger": "all as described"} for row in counts if row["described"]]
    sound_lines = tables.by(
        [*counts, *all_sound],
        ["finger", "motion"],
        lambda rows: [f"{sum(row['hours'] for row in rows):.2f}", str(sum(row["faults"] for row in rows))],
    )
    sound_table = tables.table(["sound recordings", "motion", "hours", "faults reported"], sound_lines, 2)
    return f"{tables.table(head, lines, 3)}\n\n{sound_table}\n\nA fault lasts {LASTS:g} s.\n"


def main() -> None:
    options = parser(__doc__)
    options.add_argument("--foreign", type=Path, help="folder of further recordings")
    given = options.parse_args()
    given.output.mkdir(parents=True, exist_ok=True)

    def run(function: Any, cases: Mapping[str, Sequence[Any]]) -> list[Row]:
        return run_cases(function, cases, given.output, given.workers, given.scheduler)

    numbers = [*FINGERS, None]
    cases = {f"finger_{number}": (given.output, number, 3 * k) for k, number in enumerate(numbers)}
    files = sorted(given.foreign.glob("case_??.json")) if given.foreign else []
    rows = run(of_subjects, cases)
    rows += run(of_numpy, {f"numpy_{number:02d}": (number,) for number in NUMPY})
    rows += run(of_folder, {f"foreign_{file.stem}": (file, len(files)) for file in files})
    faults, counts = ([one for row in rows for one in row[key]] for key in ("faults", "sound"))
    publish(given.output / "sensor_faults.md", report(faults, counts))


if __name__ == "__main__":
    main()
