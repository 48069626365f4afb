"""How an experiment of the menu moves, sample by sample.

The motion is for the table that a robot or a rig runs, and for the recording that the model expects of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tendonfmu.arrays import Data, Numbers
from tendonfmu.diagnosis.experiments.menu import Entry, Section, own_tension
from tendonfmu.excite import Excitation, Plan, plan_excitation
from tendonfmu.model import balanced_forces, moment_arms
from tendonfmu.recordings import FitRecording, Recording, model_alone
from tendonfmu.statistics import quintic

_SPREAD = (0.75, 1.35)  # times the frequency of the swing, of the first and last independent change of tensions
_CLOSE = 1e-9  # of the largest singular value: smaller ones mean dependent moment arms
_CHANGE = 2.0  # s; least time from one section to the next
_PEAK_OVER_MEAN = 1.875  # of the speed of a quintic stroke from rest to rest


@dataclass(frozen=True)
class Performed:
    """The motion of an entry."""

    time: Numbers  # s [N]
    position: Numbers  # rad, rad/s, rad/s² [N, n]
    velocity: Numbers
    acceleration: Numbers
    tension: Numbers  # tendon forces in balance with each other, N [N, m]
    load: Numbers  # known load, N·m [N, n]
    tendon_position: Numbers  # on the motor side, without friction and load, m [N, m]

    def columns(self) -> dict[str, Numbers]:
        """Return name -> values [N], as `tendonfmu excite` writes them."""
        table = {"time": self.time}
        groups = {
            "joint_position": self.position,
            "joint_velocity": self.velocity,
            "joint_acceleration": self.acceleration,
            "tendon_position": self.tendon_position,
        }
        for name, values in groups.items():
            table |= {f"{name}[{k}]": column for k, column in enumerate(values.T, start=1)}
        return table | {"pretension": self.tension.mean(axis=1)}


def perform(data: Data, entry: Entry, rate: float, seed: int = 0) -> Performed:
    """Return an entry's sections one after the other, at rest between them."""
    pieces: list[Performed] = []
    for number, section in enumerate(entry.sections):
        piece = _section(data, section, rate, seed + number)
        if pieces:
            pieces.append(_passage(pieces[-1], piece, section.max_speed, rate))
        pieces.append(piece)
    return _joined(data, pieces, rate)


def expected_recording(data: Data, performed: Performed, kinematics: int) -> FitRecording:
    """Return the recording that the model expects, with the forces that carry its friction and the load."""
    spread = np.linalg.pinv(moment_arms(data))
    motion = {
        "time": performed.time,
        "joint_position": performed.position,
        "joint_velocity": performed.velocity,
    }
    force = balanced_forces(data, motion, performed.tension + performed.load @ spread)
    groups = {
        "tendon_force": force,
        "tendon_position": performed.position @ moment_arms(data).T + force / _stiffness(data),
        "joint_position": performed.position,
        "joint_velocity": performed.velocity,
        "external_torque": performed.load,
    }
    samples, whole = len(performed.time), [slice(0, len(performed.time))]
    recording = Recording(Path("experiment"), performed.time, groups)
    none = np.zeros(samples, dtype=bool)
    return FitRecording(
        recording=recording,
        kinematics=kinematics,
        target=np.asarray(force @ moment_arms(data) - performed.load),
        train=~none,
        held_out=none,
        contact_out=none,
        faulty=none,
        parts=whole,
        model=model_alone(data, [recording.arrays()], whole, samples, kinematics),
        warnings=[],
    )


# --- parts ------------------------------------------------------------------------------------------------------------


def _section(data: Data, section: Section, rate: float, seed: int) -> Performed:
    plan = Plan(
        ranges=np.array(section.ranges, dtype=float),
        max_speed=section.max_speed,
        duration=section.seconds,
        pretensions=(section.pretension if own_tension(data).any() else 0.0,),
        rate=rate,
        seed=seed,
        max_acceleration=section.max_acceleration,
    )
    motion: Excitation = plan_excitation(_plannable(data), plan)
    load = np.array(section.load or [0.0] * len(section.ranges), dtype=float)
    return Performed(
        time=motion.time,
        position=motion.joint_position,
        velocity=motion.joint_velocity,
        acceleration=motion.joint_acceleration,
        tension=_tension(data, section, motion),
        load=np.tile(load, (len(motion.time), 1)),
        tendon_position=motion.tendon_position,
    )


def _plannable(data: Data) -> Data:
    """Return the finger for planning: tendons held only by a known load count as loops, which need no pretension."""
    if own_tension(data).any():
        return data
    return {**data, "tendons": [{**tendon, "bidirectional": True} for tendon in data["tendons"]]}


def _tension(data: Data, section: Section, motion: Excitation) -> Numbers:
    """Return tendon forces in balance with each other, N [N, m]."""
    # If they swing, each independent change of the tensions that turns no joint has its own frequency, so that no two
    # tendons swing alike.
    if section.swing is None:
        return motion.tension
    arms, time = moment_arms(data), motion.time
    left, sizes, _ = np.linalg.svd(arms)
    ways = left[:, int(np.sum(sizes > _CLOSE * sizes[0])) :]
    shares = own_tension(data)
    pulls = np.array([not tendon.get("bidirectional") for tendon in data["tendons"]])
    low, high = np.where(pulls, section.lowest, -section.highest), np.full(len(arms), section.highest)
    even = shares * float(np.clip(section.pretension, _fit(low, shares, np.max), _fit(high, shares, np.min)))
    reach = np.abs(ways).sum(axis=1)
    room = np.minimum(np.maximum(even - low, 0.0), np.maximum(high - even, 0.0))
    size = float(np.min(room[reach > _CLOSE] / reach[reach > _CLOSE]))
    rates = section.swing * np.geomspace(*_SPREAD, ways.shape[1]) if ways.shape[1] > 1 else np.array([section.swing])
    # at rest at both ends
    grow, _, _ = quintic.evaluate(np.array([[0.0, 0, 0, 0], [_CHANGE, 1, 0, 0]]), np.minimum(time, time[-1] - time))
    waves = np.sin(2 * np.pi * time[:, None] * rates + np.arange(len(rates)))
    return np.asarray(even + size * (grow[:, None] * waves) @ ways.T)


def _fit(limit: Numbers, shares: Numbers, worst: Any) -> float:
    """Return the pretension at which every tendon's share keeps its limit."""
    used = shares > _CLOSE
    return float(worst(limit[used] / shares[used]))


def _passage(before: Performed, after: Performed, speed: float, rate: float) -> Performed:
    """Return the motion from the end of one section to the beginning of the next, without its first and last sample."""
    way = float(np.abs(after.position[0] - before.position[-1]).max())
    rows = int(np.ceil(max(_CHANGE, _PEAK_OVER_MEAN * way / (0.5 * speed)) * rate))
    time = np.arange(1, rows) / rate
    position, velocity, acceleration = _stroke(before.position[-1], after.position[0], rows / rate, time)
    return Performed(
        time=time,
        position=position,
        velocity=velocity,
        acceleration=acceleration,
        tension=_stroke(before.tension[-1], after.tension[0], rows / rate, time)[0],
        load=_stroke(before.load[-1], after.load[0], rows / rate, time)[0],
        tendon_position=np.zeros((len(time), before.tension.shape[1])),
    )


def _stroke(start: Numbers, end: Numbers, seconds: float, time: Numbers) -> tuple[Numbers, Numbers, Numbers]:
    """Return quintics from rest to rest with their first and second derivatives [K, n]."""
    share, slope, bend = quintic.evaluate(np.array([[0.0, 0.0, 0.0, 0.0], [seconds, 1.0, 0.0, 0.0]]), time)
    way = (end - start)[None]
    return start[None] + share[:, None] * way, slope[:, None] * way, bend[:, None] * way


def _joined(data: Data, pieces: Sequence[Performed], rate: float) -> Performed:
    position, velocity, acceleration, tension, load = (
        np.concatenate([getattr(piece, name) for piece in pieces])
        for name in ("position", "velocity", "acceleration", "tension", "load")
    )
    return Performed(
        time=np.arange(len(position)) / rate,
        position=position,
        velocity=velocity,
        acceleration=acceleration,
        tension=tension,
        load=load,
        tendon_position=position @ moment_arms(data).T + tension / _stiffness(data),
    )


def _stiffness(data: Data) -> Numbers:
    return np.array([tendon["stiffness"] for tendon in data["tendons"]], dtype=float)
