"""Recordings of the simulated index finger (examples/rigs) that moves and rests, pushed and left alone, with the truth.

*Light* pushes are of 0.1 to 2 N, uniform in the logarithm, anywhere on the finger; *firm* ones uniform in the force;
*strong* ones 1 to 2 N on the fingertip, since at high pretension few others reach several times the residual. Every
pushed recording has a *twin*: the same motion and sensor noise without the pushes. What is there is not made again.
"""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from evidence.runner import EXAMPLES, INDEX_FINGER, INDEX_RIG, write
from tendonfmu.arrays import Indices, Numbers
from tendonfmu.estimate import FrictionFit
from tendonfmu.files import Node, read_table, write_table
from tendonfmu.model import moment_arms
from tendonfmu.recordings import Recording, read_recording
from tendonfmu.simulate import read_rig, simulate
from tendonfmu.simulate.motion_plan import Joints, expand_motion
from tendonfmu.statistics import Draws
from tendonfmu.statistics.quintic import evaluate

sys.path.insert(0, str(EXAMPLES / "rigs"))
from virtual_hand import TRAINING, record

Arrays = dict[str, Numbers]

PRETENSIONS = (10.0, 20.0, 40.0)  # N: trained at the first, on average
PARTS = 3  # recordings of each kind and pretension
FEWER = {"firm": 2, "strong": 2}  # but no more of these, and of their twins
DURATION = 600.0  # s, of one
PUSHES = 100  # in one
TRAINING_DURATION = 400.0  # s

STRETCH, STILL = (6.0, 13.0), (0.7, 2.0)  # s: strokes with the rest at both ends; that rest
FORCE = {"light": (0.1, 2.0), "firm": (0.1, 2.0), "strong": (1.0, 2.0)}  # N
RISE, HOLD = (0.01, 0.05), (0.3, 1.0)  # s; a fall is drawn like a rise
EARLIEST, LATEST = 0.5, 4.4  # s into a push's slot that it begins
LEAST_FORCE = 0.01  # N, from which the label says contact: a push is labelled within its first 5 ms
NEAR = 0.15  # s between the onset and a joint's turning round,
LONGEST_TURN = 0.5  # s, which begins and ends with motion and takes no longer than this
SETTLED = 0.3  # s after a joint has set off
LOOK_BACK = 0.05  # s before the push in which a finger at rest does not move
TWINS = {"light": "twin", "firm": "firm_twin", "strong": "strong_twin"}
TRUE = ("external_torque", "joint_torque", "joint_position", "joint_velocity")
_MOTION, _PUSH, _NOISE, _FORCES = range(4)  # what a seed is of


@dataclass(frozen=True)
class Take:
    """One recording."""

    kind: str  # of pushes, a key of `TWINS`; one of their twins, or "free"
    pretension: float  # N
    part: int  # from 1

    @property
    def name(self) -> str:
        return f"{self.kind}_{self.pretension:g}_{self.part}"

    @property
    def twin(self) -> Take:
        return replace(self, kind=TWINS[self.kind])

    def seed(self, what: int) -> int:
        """A twin has the seeds of its pushes."""
        kind = {"free": 1, "firm": 2, "strong": 3}.get(self.kind.removesuffix("_twin"), 0)
        return 100_000 + 1000 * round(self.pretension) + 100 * kind + 10 * self.part + what


def takes(*kinds: str, parts: int = PARTS, pretensions: tuple[float, ...] = PRETENSIONS) -> list[Take]:
    """All recordings of these kinds, by kind, pretension and part."""
    return [
        Take(kind, pretension, part)
        for kind in kinds
        for pretension in pretensions
        for part in range(1, min(parts, FEWER.get(kind.removesuffix("_twin"), parts)) + 1)
    ]


# --- rigs -------------------------------------------------------------------------------------------------------------


def motion_columns(time: Numbers, knots: Sequence[Numbers]) -> Arrays:
    """A motion file from the knots [K, 4] of each joint: time, position, velocity, acceleration."""
    table: Arrays = {"time": time}
    for j, knots_of_joint in enumerate(knots, start=1):
        curve = evaluate(knots_of_joint, time)
        for name, values in zip(("position", "velocity", "acceleration"), curve, strict=True):
            table[f"joint_{name}[{j}]"] = values
    return table


def motion_table(base: Mapping[str, Any], seed: int, duration: float) -> Arrays:
    """A motion file: stretches of the base rig's strokes, all joints at rest between them."""
    links = base["physics"]["links"]
    limits = Joints(*([link["limits"][end] for link in links] for end in ("lower", "upper")))
    recipe = {key: value for key, value in base["motion"].items() if key not in ("duration", "seed")}
    draws, begin, stretch = Draws(seed, 0), 0.0, 0
    knots = [[[0.0, angle, 0.0, 0.0]] for angle in recipe["position"]]
    while begin + STRETCH[1] <= duration:
        changed = recipe | {
            "position": [knots_of_joint[-1][1] for knots_of_joint in knots],
            "duration": draws.between(*STRETCH),
            "still": draws.between(*STILL),
        }
        part = expand_motion(Node(changed), limits, seed + 1_000_000 * (stretch + 1), None)
        for knots_of_joint, joint in zip(knots, part.joints, strict=True):
            moves = zip(joint["time"][1:], joint["position"][1:], strict=True)
            knots_of_joint.extend([begin + time, angle, 0.0, 0.0] for time, angle in moves)
        begin, stretch = begin + changed["duration"], stretch + 1
    time = np.unique(np.concatenate([[duration], *(np.array(knots_of_joint)[:, 0] for knots_of_joint in knots)]))
    # between the knots of other joints it is the same polynomial again
    return motion_columns(time, [np.array(knots_of_joint) for knots_of_joint in knots])


def _placed(pushes: list[dict[str, Any]], take: Take) -> list[dict[str, Any]]:
    """Pushes of the rig's recipe, each in its slot and with a force of its own."""
    draws, slot = Draws(take.seed(_FORCES), 3), DURATION / PUSHES
    low, high = FORCE[take.kind]
    placed = []
    for k, push in enumerate(pushes):
        start = k * slot + draws.between(EARLIEST, LATEST)
        if take.kind == "light":
            force = math.exp(draws.between(math.log(low), math.log(high)))
        else:
            force = draws.between(low, high)
        placed.append(push | {"start": start, "force": force})
    return placed


def rig_of(name: str, seed: int, motion: Mapping[str, Any], duration: float) -> dict[str, Any]:
    """A rig of the index finger without pushes."""
    return {
        "format": "tendonfmu-rig-1",
        "base": str(INDEX_RIG),
        "name": name,
        "seed": seed,
        "physics": {"contact_force": LEAST_FORCE},
        "motion": dict(motion),
        "recording": {"duration": duration, "columns": ["joint_position", "external_torque", "contact"]},
    }


def write_rig(folder: Path, take: Take) -> Path:
    """The rig of a recording and its motion file."""
    base = json.loads(INDEX_RIG.read_text(encoding="utf-8"))
    of = take.kind.removesuffix("twin").removesuffix("_") or "light"
    motion = folder / f"motion_{of}_{take.pretension:g}_{take.part}.parquet"
    if not motion.exists():
        write_table(motion, motion_table(base, take.seed(_MOTION), DURATION))
    moves = {"kind": "file", "file": motion.name, "pretension": take.pretension}
    rig = rig_of(take.name, take.seed(_NOISE), moves, DURATION)
    file = folder / f"{take.name}.json"
    if take.kind in TWINS:
        where = "tip" if take.kind == "strong" else "anywhere"
        recipe = {"count": PUSHES, "seed": take.seed(_PUSH), "rise": RISE, "hold": HOLD, "where": where}
        write(file, rig | {"pushes": recipe | {"gap": [0.0, 0.0]}})
        rig["pushes"] = _placed(list(read_rig(file).expanded["pushes"]), take)
    write(file, rig)
    return file


# --- recordings -------------------------------------------------------------------------------------------------------


def simulated(rig: Path, names: Collection[str]) -> tuple[Arrays, Arrays]:
    """Columns of a rig's recording, and of its truth: these signals and the contact force, N."""
    made = simulate(read_rig(rig), truth=True)
    assert made.truth is not None
    true = {name: values for name, values in made.truth.items() if name.split("[")[0] in names}
    true["contact_force"] = np.sqrt(np.sum([made.truth[f"contact_force[{axis}]"] ** 2 for axis in (1, 2, 3)], axis=0))
    return dict(made.recording), true


def recording_file(folder: Path, take: Take) -> Path:
    """Made if it is not there; beside it NAME_truth.parquet."""
    file, truth = folder / f"{take.name}.parquet", folder / f"{take.name}_truth.parquet"
    if not (file.exists() and truth.exists()):
        recorded, true = simulated(write_rig(folder, take), ("time", *TRUE))
        write_table(truth, true)
        write_table(file, recorded)
    return file


def recording(folder: Path, take: Take) -> Recording:
    return read_recording(recording_file(folder, take))


def read_truth(folder: Path, take: Take) -> Arrays:
    """Time, contact_force [N] and the groups of `TRUE` [N, n]."""
    return grouped(read_table(folder / f"{take.name}_truth.parquet", lambda _path, _names: None))


def grouped(table: Mapping[str, Numbers]) -> Arrays:
    """Columns `name[1]`, `name[2]` ... as one array under `name`."""
    groups: dict[str, list[Numbers]] = {}
    for name, values in table.items():
        groups.setdefault(name.split("[")[0], []).append(values)
    return {name: np.column_stack(group) if f"{name}[1]" in table else group[0] for name, group in groups.items()}


def training_file(folder: Path) -> Path:
    """`excite` at low, varied pretension, without contact."""
    file = folder / "training.parquet"
    return file if file.exists() else record(folder, "training", TRAINING_DURATION, TRAINING["varied"])


def fitted_file(folder: Path) -> Path:
    """The description fitted to the training recording, with the default settings of a fit."""
    file = folder / "fitted.json"
    if not file.exists():
        write(file, FrictionFit(INDEX_FINGER).fit(training_file(folder)).description_text())
    return file


# --- what is true of a push -------------------------------------------------------------------------------------------


def pushes_of(folder: Path, take: Take) -> list[dict[str, Any]]:
    """What was true of all pushes of a recording; without the push, a joint moves as in the twin."""
    # onset: s, of the label; torque: [n] N·m of the largest magnitude; posture: "rest", "motion", "reversal";
    # stuck: nothing moved faster than the description's thresholds; stays: stuck, and no joint moved farther than the
    # rig's presliding distance
    rig = read_rig(write_rig(folder, take))
    truth, twin = read_truth(folder, take), read_truth(folder, take.twin)
    label = recording(folder, take).contact
    assert label is not None
    thresholds = rig.finger.data["velocity_threshold"]
    arms = moment_arms(rig.finger.data)
    presliding = float(rig.data["physics"]["friction"]["presliding"]["joint"])
    rows = []
    for push in rig.expanded["pushes"]:
        over = push["start"] + push["rise"] + push["hold"] + push["fall"]
        inside = np.flatnonzero(label & (truth["time"] >= push["start"]) & (truth["time"] <= over))
        during = slice(int(inside[0]), int(inside[-1]) + 1)
        start = int(np.searchsorted(truth["time"], push["start"]))  # before the label: joints yield at once
        velocity = truth["joint_velocity"][int(start - LOOK_BACK * rig.rate) : start]
        torque, position = truth["external_torque"][during], truth["joint_position"][start : during.stop]
        excursion = np.abs(position - position[0]).max(axis=0)
        stuck = bool(
            np.all(np.abs(velocity) <= thresholds["joint"])
            and np.all(np.abs(tendon_velocity(arms, velocity)) <= thresholds["tendon"])
        )
        rows.append(
            {
                "kind": take.kind,
                "pretension": take.pretension,
                "part": take.part,
                "onset": float(truth["time"][during.start]),
                "torque": torque[np.abs(torque).argmax(axis=0), np.arange(torque.shape[1])].tolist(),
                "posture": _posture(
                    truth["joint_velocity"], twin["joint_velocity"], start, rig.rate, thresholds["joint"]
                ),
                "stuck": stuck,
                "stays": stuck and bool(np.all(excursion <= presliding)),
            }
        )
    return rows


def tendon_velocity(arms: Numbers, joint_velocity: Numbers) -> Numbers:
    """[..., m, n] relative tendon velocities ẋ_ij = Σ_{j'≥j} r_ij' q̇_j', m/s, where a tendon has a moment arm."""
    parts = arms * joint_velocity[..., None, :]
    return np.asarray(np.flip(np.cumsum(np.flip(parts, axis=-1), axis=-1), axis=-1))


def states(joint_velocity: Numbers, rate: float, threshold: float, after: float) -> Indices:
    """[N] 0: at rest, 1: in motion, 2: a joint sets off from `SETTLED` s before until `after` s later."""
    # joint_velocity: [N, n] rad/s without any push
    moving = np.abs(joint_velocity) > threshold
    begins = np.any(moving[1:] & ~moving[:-1], axis=1)
    count = np.concatenate([[0], np.cumsum(np.concatenate([[False], begins]))])  # set off before each sample
    index = np.arange(len(moving))
    first = np.maximum(index - round(SETTLED * rate), 0)
    last = np.minimum(index + round(after * rate), len(moving) - 1)
    setting_off = count[last + 1] > count[first]
    return np.where(setting_off, 2, np.where(moving.any(axis=1), 1, 0))


def _posture(pushed: Numbers, free: Numbers, start: int, rate: float, threshold: float) -> str:
    """By the joint velocities [N, n]: as they were before the push, as they would have gone on without it."""
    if np.all(np.abs(pushed[int(start - LOOK_BACK * rate) : start]) <= threshold):
        return "rest"
    around = int((NEAR + LONGEST_TURN) * rate)
    velocity = np.concatenate([pushed[max(0, start - around) : start], free[start : start + around]])
    onset = min(around, start)
    for joint in velocity.T:
        moves = np.flatnonzero(np.abs(joint) > threshold)
        turns = np.flatnonzero(np.diff(np.sign(joint[moves])))
        for last, first in zip(moves[turns], moves[turns + 1], strict=True):
            if first - last <= LONGEST_TURN * rate and last - NEAR * rate <= onset <= first + NEAR * rate:
                return "reversal"
    return "motion"
