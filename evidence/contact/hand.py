"""Recordings of the simulated index finger (examples/rigs) that moves and rests, pushed and left alone, with the truth.

What is there is not made again.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import tendonfmu as tf
from evidence.cases import EXAMPLES, INDEX_RIG, write
from tendonfmu.arrays import Numbers
from tendonfmu.files import read_table, write_table
from tendonfmu.model import finger_from_data
from tendonfmu.recordings import read_recording
from tendonfmu.simulate import read_rig, simulate

CALIBRATED = EXAMPLES / "demo_recording" / "index_finger_calibrated.json"
PRETENSIONS = (10.0, 20.0, 40.0)  # N: calibrated at 6 to 20
PARTS = {"free": 3, "light": 2, "strong": 1}  # recordings of each kind and pretension
PUSHED = ("light", "strong")
DURATION = 600.0  # s, of one
REST = {"rest": [0.7, 3.0], "rest_share": 0.6}  # s; share of a joint's strokes that a rest follows
PUSHES: dict[str, dict[str, Any]] = {
    "light": {"force": [0.1, 2.0], "where": "anywhere"},  # N
    "strong": {"force": [1.0, 2.0], "where": "tip"},  # few others reach several times the residual at high pretension
}
EACH = {"count": 100, "first": 10.0, "rise": [0.01, 0.05], "hold": [0.3, 1.0], "gap": [3.0, 5.5]}  # s
LEAST_FORCE = 0.01  # N, from which the label says contact: a push is labelled within its first 5 ms


@dataclass(frozen=True)
class Take:
    """One recording."""

    kind: str
    pretension: float  # N
    part: int  # from 1

    @property
    def name(self) -> str:
        return f"{self.kind}_{self.pretension:g}_{self.part}"

    @property
    def seed(self) -> int:
        return 100_000 + 1000 * round(self.pretension) + 100 * list(PARTS).index(self.kind) + self.part


def takes(*kinds: str) -> list[Take]:
    """All recordings of these kinds, by kind, pretension and part."""
    return [Take(kind, p, part) for kind in kinds for p in PRETENSIONS for part in range(1, PARTS[kind] + 1)]


def recording_file(folder: Path, take: Take) -> Path:
    """Made if it is not there; beside it NAME_truth.parquet, the torques and forces of the pushes."""
    file, rig = folder / f"{take.name}.parquet", folder / f"{take.name}.json"
    if not file.exists():
        pushes = {"pushes": EACH | PUSHES[take.kind] | {"seed": take.seed}} if take.kind in PUSHED else {}
        write(
            rig,
            {
                "format": "tendonfmu-rig-1",
                "base": str(INDEX_RIG),
                "name": take.name,
                "seed": take.seed,
                "physics": {"contact_force": LEAST_FORCE},
                "motion": REST | {"pretension": take.pretension, "seed": take.seed, "duration": None},
                "recording": {"duration": DURATION, "columns": ["joint_position", "external_torque", "contact"]},
                **pushes,
            },
        )
        made = simulate(read_rig(rig), truth=True)
        assert made.truth is not None
        kept = ("time", "external_torque", "contact_force")
        true = {name: values for name, values in made.truth.items() if name.split("[")[0] in kept}
        write_table(folder / f"{take.name}_truth.parquet", true)
        write_table(file, made.recording)
    return file


def made(folder: Path, take: Take) -> dict[str, Any]:
    return {"file": recording_file(folder, take).name}


def recording(folder: Path, take: Take) -> tf.Recording:
    return read_recording(recording_file(folder, take))


def truth(folder: Path, take: Take, name: str) -> Numbers:
    """[N, k] true values of a group."""
    columns = read_table(folder / f"{take.name}_truth.parquet", lambda _path, _names: None)
    return np.column_stack([values for column, values in columns.items() if column.startswith(f"{name}[")])


def pushes_of(folder: Path, take: Take) -> list[dict[str, Any]]:
    """Pushes as the rig has them, in order of time."""
    return list(read_rig(folder / f"{take.name}.json").expanded["pushes"])


def calibrated() -> tf.Finger:
    """The demo's finger as `calibrate` made it of 27 min of other motion, without its detector."""
    data = dict(tf.read_finger(CALIBRATED).data)
    data["contact"] = {"threshold": data["contact"]["threshold"]}
    data.pop("sensor_fault", None)
    return finger_from_data(data, CALIBRATED)


def tuned(folder: Path) -> tf.Finger:
    """The calibrated finger, tuned on all free recordings."""
    file = folder / "tuned.json"
    if not file.exists():
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            free = [recording_file(folder, take) for take in takes("free")]
            tf.tune(calibrated(), free).finger.write(file)
    return tf.read_finger(file)
