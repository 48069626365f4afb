"""What each command writes and what each command takes, as tables, so that a test can try every pair of them.

A finger of two joints and four tendons, a servo, and a simulated finger, with short recordings of each.
A description is written by the product's own commands, in a folder that is made once.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

import tendonfmu
from command import Answer, run_script
from fit_cases import lasting_finger
from fit_data import recorded
from plant_fmu_rig import fmu_rig
from tendonfmu.files.tables import write_table

Columns = dict[str, NDArray[Any]]
Command = list[str | Path]

SECONDS, RATE = 12.0, 50.0
KINEMATICS = (1, 2, 3)


def call(*arguments: str | Path) -> Answer:
    """`tendonfmu ARGUMENTS` in the present folder."""
    return run_script(Path(tendonfmu.__file__).with_name("__main__.py"), *arguments)


@contextmanager
def inside(folder: Path) -> Iterator[None]:
    before = Path.cwd()
    folder.mkdir(parents=True, exist_ok=True)
    os.chdir(folder)
    try:
        yield
    finally:
        os.chdir(before)


# --- recordings -------------------------------------------------------------------------------------------------------


def hidden_finger() -> dict[str, Any]:
    """What the recordings of the first finger are made of: its description lacks the weight."""
    return lasting_finger() | {"extensions": [{"effect": "gravity", "joint": 2, "sine": 0.15, "cosine": 0.1}]}


def made(seed: int, seconds: float = SECONDS, rate: float = RATE) -> Columns:
    recording = recorded(hidden_finger(), seed, seconds, rate, noise_in_forces=True)
    columns: Columns = {"time": recording.pop("time")}
    for name, values in recording.items():
        columns |= {f"{name}[{k + 1}]": values[:, k] for k in range(values.shape[1])}
    return columns


def servo_log(seed: int) -> Columns:
    """A geared servo with dry friction: s, N·m, rad."""
    rng = np.random.default_rng(seed)
    time = np.arange(round(SECONDS * 100.0)) / 100.0
    frequency, phase = rng.uniform(0.2, 0.9, 3), rng.uniform(0.0, 6.0, 3)
    rate = 2.0 * np.pi * frequency
    angle = 0.3 * np.sin(rate * time[:, None] + phase).sum(axis=1)
    speed = (0.3 * rate * np.cos(rate * time[:, None] + phase)).sum(axis=1)
    torque = 0.15 * np.tanh(speed / 0.02) + 0.05 * speed + rng.normal(0.0, 0.003, len(time))
    return {"t": time, "torque": torque, "encoder": angle}


SERVO_MAP = {
    "format": "tendonfmu-map-1",
    "joint": {
        "name": "servo",
        "time": {"column": "t", "unit": "s"},
        "torque": {"column": "torque", "unit": "N.m"},
        "angle": {"column": "encoder", "unit": "rad"},
    },
}


def simulated(seed: int) -> dict[str, Any]:
    columns = ["joint_position", "joint_velocity"]
    rig = fmu_rig(seed=seed, pushes=[], recording={"duration": SECONDS, "columns": columns})
    rig["sensors"]["rate"] = 100
    return rig | {"motion": rig["motion"] | {"seed": seed, "duration": SECONDS}}


def write_recordings(folder: Path) -> None:
    """KIND_SEED.parquet of every kind: made by numpy, `convert table` and `simulate`."""
    with inside(folder):
        Path("map.json").write_text(json.dumps(SERVO_MAP))
        write_table(Path("made_long.parquet"), made(1, 20.0, 100.0))
        for seed in (1, 2):
            write_table(Path(f"made_{seed}.parquet"), made(seed))
            write_table(Path(f"log_{seed}.csv"), servo_log(seed))
            Path(f"rig_{seed}.json").write_text(json.dumps(simulated(seed)))
            more = ["--finger", "converted.json"] if seed == 1 else []
            written = [
                call("convert", "table", f"log_{seed}.csv", "--map", "map.json", "-o", f"servo_{seed}.parquet", *more),
                call("simulate", f"rig_{seed}.json", "-o", f"simulated_{seed}.parquet"),
            ]
            for answer in written:
                assert not answer.status, answer.err


# --- what becomes of a recording --------------------------------------------------------------------------------------


def with_gaps(columns: Columns) -> Columns:
    """Two gaps of some seconds."""
    share = np.linspace(0.0, 1.0, len(columns["time"]))
    kept = ~((share > 0.4) & (share < 0.5)) & ~((share > 0.8) & (share < 0.85))
    return {name: values[kept] for name, values in columns.items()}


def with_labels(columns: Columns) -> Columns:
    """Contact twice, once at the beginning."""
    share = np.linspace(0.0, 1.0, len(columns["time"]))
    return columns | {"contact": (((share > 0.6) & (share < 0.65)) | (share < 0.02)).astype(float)}


def with_load(columns: Columns) -> Columns:
    joints = sum(name.startswith("joint_position[") for name in columns)
    load = 0.01 * np.sin(columns["time"])
    return columns | {f"external_torque[{j + 1}]": load for j in range(joints)}


VARIATIONS: dict[str, tuple[Callable[[Columns], Columns], ...]] = {
    "plain": (),
    "gaps": (with_gaps,),
    "load": (with_load,),
    "labels": (with_labels,),
    "all": (with_labels, with_load, with_gaps),
}


def columns_of(file: Path) -> Columns:
    return {str(name): np.asarray(values) for name, values in pd.read_parquet(file).items()}


def varied(source: Path, variation: str, target: Path) -> Path:
    columns = columns_of(source)
    for change in VARIATIONS[variation]:
        columns = change(columns)
    write_table(target, columns)
    return target


# --- what writes a description ----------------------------------------------------------------------------------------

ARMS = [tendon["moment_arms"] for tendon in lasting_finger()["tendons"]]
NAMES = [tendon["name"] for tendon in lasting_finger()["tendons"]]
MODEL = f"""<mujoco model="small">
  <compiler angle="radian"/>
  <worldbody><body>
    <joint name="base" axis="0 1 0" frictionloss="0.005" damping="0.001"/>
    <geom type="capsule" size="0.005" fromto="0.01 0 0 0.04 0 0"/>
    <body pos="0.05 0 0">
      <joint name="tip" axis="0 1 0" frictionloss="0.005"/>
      <geom type="capsule" size="0.005" fromto="0.01 0 0 0.03 0 0"/>
    </body>
  </body></worldbody>
  <tendon>{
    "".join(
        f'<fixed name="{name}"><joint joint="base" coef="{a}"/><joint joint="tip" coef="{b}"/></fixed>'
        for name, (a, b) in zip(NAMES, ARMS, strict=True)
    )
}</tendon>
  <actuator>{"".join(f'<position name="{name}" tendon="{name}" kp="4000"/>' for name in NAMES)}</actuator>
</mujoco>"""


@dataclass(frozen=True)
class Writer:
    """recordings: their kind. commands: of two of them. file: the description that they write."""

    recordings: str
    commands: Callable[[Path, Path], list[Command]]
    file: str
    after: str = ""  # whose description is before.json


def _described(joints: list[str], arms: list[list[float]], names: list[str]) -> Command:
    tendons = [
        " ".join([name, *(f"{joint}{'+' if arm > 0 else '-'}" for joint, arm in zip(joints, row, strict=True) if arm)])
        for name, row in zip(names, arms, strict=True)
    ]
    options = [part for each in tendons for part in ("--tendon", each)]
    return ["describe", "finger", "--name", "small", "--joints", ",".join(joints), *options, "-o", "described.json"]


def _hand_calibrated(first: Path, second: Path) -> list[Command]:
    Path("hand.json").write_text(json.dumps(hand_of("before.json")))
    write_hand_recording(first, Path("hand.parquet"))
    return [["calibrate", "hand.json", "hand.parquet", "-o", "out"]]


FIRST: dict[str, Writer] = {
    "given": Writer("made", lambda *_: [], "before.json"),
    "describe finger": Writer("made", lambda *_: [_described(["base", "tip"], ARMS, NAMES)], "described.json"),
    "import mjcf": Writer("made", lambda *_: [["import", "mjcf", "model.xml", "-o", "out.json"]], "out.json"),
    "describe joint": Writer(
        "servo",
        lambda first, _: [["describe", "joint", "--name", "servo", "--recording", first, "-o", "out.json"]],
        "out.json",
    ),
    "convert --finger": Writer("servo", lambda *_: [], "before.json"),
    "simulate": Writer("simulated", lambda *_: [], "before.json"),
}
LATER: dict[str, Writer] = {
    "fit": Writer("made", lambda a, b: [["fit", "before.json", a, b, "-o", "out.json"]], "out.json", "given"),
    "fit ekf": Writer(
        "made", lambda a, b: [["fit", "before.json", a, "--method", "ekf", "-o", "out.json"]], "out.json", "given"
    ),
    "fit --routing": Writer(
        "made",
        lambda a, b: [["fit", "before.json", a, b, "--routing", "-o", "out.json"]],
        "out.json",
        "describe finger",
    ),
    "calibrate": Writer(
        "made", lambda a, b: [["calibrate", "before.json", a, "-o", "out"]], "out/finger.json", "given"
    ),
    "calibrate --from": Writer(
        "made",
        lambda a, b: [["calibrate", "before.json", b, "--from", "before.json", "-o", "out"]],
        "out/finger.json",
        "calibrate",
    ),
    "tune": Writer("made", lambda a, b: [["tune", "before.json", a, b, "-o", "out.json"]], "out.json", "fit"),
    "diagnose, extended": Writer(
        "made",
        lambda a, b: [["diagnose", "before.json", a.with_stem("made_long"), "-o", "out"]],
        "out/extended.json",
        "given",
    ),
    "diagnose, nominal": Writer(
        "servo",
        lambda a, b: [["diagnose", "before.json", a, b, "-o", "out"]],
        "out/nominal.json",
        "convert --finger",
    ),
    "diagnose --reference": Writer(
        "made",
        lambda a, b: [["diagnose", "before.json", b, "--reference", a, "-o", "out"]],
        "out/extended.json",
        "calibrate",
    ),
    "hand": Writer("made", _hand_calibrated, "out/index/finger.json", "given"),
}
WRITERS = FIRST | LATER


def write_description(folder: Path, name: str, recordings: Path, before: Path | None) -> Path:
    """Run a writer in a folder of its own; returns its description."""
    writer = WRITERS[name]
    first, second = (recordings / f"{writer.recordings}_{seed}.parquet" for seed in (1, 2))
    with inside(folder):
        if name == "given":
            Path("before.json").write_text(json.dumps(lasting_finger()))
        if name == "simulate":
            Path("before.json").write_text(json.dumps(simulated(1)["finger"]))
        if name == "convert --finger":
            Path("before.json").write_text((recordings / "converted.json").read_text())
        if before is not None:
            Path("before.json").write_text(before.read_text())
        Path("model.xml").write_text(MODEL)
        for command in writer.commands(first, second):
            answer = call(*command)
            assert not answer.status, f"{name}: {command}: {answer.err}"
    return folder / writer.file


# --- what takes a description -----------------------------------------------------------------------------------------


def hand_of(description: str | Path) -> dict[str, Any]:
    finger = {"name": "index", "description": str(description), "columns": "index_"}
    return {"format": "tendonfmu-hand-1", "name": "hand", "fingers": [finger]}


def write_hand_recording(source: Path, target: Path) -> Path:
    columns = columns_of(source).items()
    write_table(target, {name if name == "time" else f"index_{name}": values for name, values in columns})
    return target


def _in_hand(*commands: list[str]) -> Callable[..., list[Command]]:
    """HAND and RECORDING stand for the files."""

    def make(finger: Path, first: Path, second: Path, options: list[str]) -> list[Command]:
        Path("hand.json").write_text(json.dumps(hand_of(finger)))
        files = {"HAND": Path("hand.json"), "RECORDING": write_hand_recording(first, Path("hand.parquet"))}
        own = {"OPTIONS": options}
        return [[part for word in command for part in own.get(word, [files.get(word, word)])] for command in commands]

    return make


Reader = Callable[[Path, Path, Path, list[str]], list[Command]]  # finger, two recordings, --kinematics
READERS: dict[str, Reader] = {
    "check": lambda f, a, b, k: [["check", f], ["check", f, a, b]],
    "build": lambda f, a, b, k: [
        ["build", f, "-o", "out.fmu"],
        ["run", "out.fmu", a, "-o", "out.csv", *k],
        ["score", "out.fmu", a, b, "-o", "score.json", *k],
    ],
    "build --fmi 3": lambda f, a, b, k: [["build", f, "--fmi", "3", "--reference", a, "-o", "out.fmu"]],
    "run": lambda f, a, b, k: [["run", f, a, "-o", "out.parquet", "--report", "run.html", *k]],
    "fit": lambda f, a, b, k: [
        ["fit", f, a, "--holdout", "0.2", "-o", "out.json", "--report", "report.json", *k],
        ["fit", f, b, "--from", "report.json", "-o", "again.json", *k],
        ["fit", "out.json", b, "--from", "out.json", "-o", "again.json", *k],
    ],
    "fit --method ekf": lambda f, a, b, k: [["fit", f, a, "--method", "ekf", "-o", "out.json", *k]],
    "fit --routing": lambda f, a, b, k: [["fit", f, a, b, "--routing", "-o", "out.json", *k]],
    "tune": lambda f, a, b, k: [["tune", f, a, b, "-o", "out.json", "--report", "report.json", *k]],
    "score": lambda f, a, b, k: [["score", f, a, b, "-o", "score.json", *k]],
    "diagnose": lambda f, a, b, k: [
        ["diagnose", f, a, "-o", "out", *k],
        ["excite", f, "--discriminate", "out", "-o", "motion.csv"],
    ],
    "diagnose --test": lambda f, a, b, k: [["diagnose", f, a, "--test", b, "-o", "out", *k]],
    "diagnose --reference": lambda f, a, b, k: [["diagnose", f, b, "--reference", a, "-o", "out", *k]],
    "diagnose --history": lambda f, a, b, k: [["diagnose", f, a, b, "--history", "-o", "out", *k]],
    "calibrate": lambda f, a, b, k: [["calibrate", f, a, "-o", "out", *k]],
    "calibrate --test --pushes": lambda f, a, b, k: [["calibrate", f, a, "--test", b, "--pushes", b, "-o", "out", *k]],
    "calibrate --from": lambda f, a, b, k: [["calibrate", f, b, "--from", f, "-o", "out", *k]],
    "excite": lambda f, a, b, k: [["excite", f, "--duration", "20", "-o", "motion.csv", "--report", "report.json"]],
    "export mjcf": lambda f, a, b, k: [["export", "mjcf", f, "model.xml", "-o", "out.xml"]],
    "hand, run": _in_hand(
        ["check", "HAND", "RECORDING"],
        ["run", "HAND", "RECORDING", "-o", "out.csv", "OPTIONS"],
        ["score", "HAND", "RECORDING", "-o", "score.json", "OPTIONS"],
    ),
    "hand, diagnose": _in_hand(["diagnose", "HAND", "RECORDING", "-o", "out", "OPTIONS"]),
    "hand, calibrate": _in_hand(["calibrate", "HAND", "RECORDING", "-o", "out", "OPTIONS"]),
}
