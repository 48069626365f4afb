"""How an experiment of the menu moves, sample by sample.

The motion is for the table that a robot or a rig runs, and for the recording that the model expects of it.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from tendonfmu.arrays import Data, Numbers
from tendonfmu.diagnosis.menu import Entry, Section, entry_from_json, own_tension
from tendonfmu.errors import InputError
from tendonfmu.excite import Excitation, Plan, balanced_forces, evaluate_quintic, plan_excitation
from tendonfmu.model import finger_of, moment_arms, tendon_positions
from tendonfmu.recordings import FitRecording, Recording, run_parts

_SAMPLED = (
    *("joint_position", "joint_velocity", "joint_acceleration"),
    *("tension", "pretension", "tendon_position", "load"),
)
_CHANGE = 2.0  # s; least time from one section to the next
_PEAK_OVER_MEAN = 1.875  # of the speed of a quintic stroke from rest to rest


def perform(data: Data, entry: Entry, rate: float, seed: int = 0) -> Excitation:
    """Return an entry's sections one after the other, at rest between them."""
    pieces: list[Excitation] = []
    for number, section in enumerate(entry.sections):
        piece = _section(data, section, rate, seed + number)
        if pieces:
            pieces.append(_passage(data, pieces[-1], piece, section.max_speed, rate))
        pieces.append(piece)
    sampled: dict[str, Any] = {name: np.concatenate([getattr(piece, name) for piece in pieces]) for name in _SAMPLED}
    return Excitation(time=np.arange(len(sampled["load"])) / rate, **sampled)


def expected_recording(data: Data, performed: Excitation, kinematics: int) -> FitRecording:
    """Return the recording that the model expects, with the forces that carry its friction and the load."""
    spread = np.linalg.pinv(moment_arms(data))
    motion = {
        "time": performed.time,
        "joint_position": performed.joint_position,
        "joint_velocity": performed.joint_velocity,
    }
    force = balanced_forces(finger_of(data), motion, performed.tension + performed.load @ spread)
    groups = {
        "tendon_force": force,
        "tendon_position": tendon_positions(data, performed.joint_position, force),
        "joint_position": performed.joint_position,
        "joint_velocity": performed.joint_velocity,
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
        silent=np.zeros((samples, len(data["joints"])), dtype=bool),
        parts=whole,
        model=run_parts(finger_of(data), recording.arrays(), whole, ~none, kinematics),
        warnings=[],
    )


# --- parts ------------------------------------------------------------------------------------------------------------


def _section(data: Data, section: Section, rate: float, seed: int) -> Excitation:
    plan = Plan(
        ranges=np.array(section.ranges, dtype=float),
        max_speed=section.max_speed,
        duration=section.seconds,
        pretensions=(section.pretension if own_tension(data).any() else 0.0,),
        rate=rate,
        seed=seed,
        vary=section.vary,
        max_acceleration=section.max_acceleration,
    )
    motion = plan_excitation(_plannable(data), plan)
    load = np.array(section.load or [0.0] * len(section.ranges), dtype=float)
    return replace(motion, load=np.tile(load, (len(motion.time), 1)))


def _plannable(data: Data) -> Data:
    """Return the finger for planning: tendons held only by a known load count as loops, which need no pretension."""
    if own_tension(data).any():
        return data
    return {**data, "tendons": [{**tendon, "bidirectional": True} for tendon in data["tendons"]]}


def _passage(data: Data, before: Excitation, after: Excitation, speed: float, rate: float) -> Excitation:
    """Return the motion from the end of one section to the beginning of the next, without its first and last sample."""
    way = float(np.abs(after.joint_position[0] - before.joint_position[-1]).max())
    rows = int(np.ceil(max(_CHANGE, _PEAK_OVER_MEAN * way / (0.5 * speed)) * rate))
    time = np.arange(1, rows) / rate
    stroke = {
        name: _stroke(getattr(before, name)[-1], getattr(after, name)[0], rows / rate, time)
        for name in ("joint_position", "tension", "pretension", "load")
    }
    position, velocity, acceleration = stroke.pop("joint_position")
    tension, pretension, load = (values for values, _, _ in stroke.values())
    return Excitation(
        time=time,
        joint_position=position,
        joint_velocity=velocity,
        joint_acceleration=acceleration,
        tension=tension,
        pretension=pretension,
        load=load,
        tendon_position=tendon_positions(data, position, tension),
    )


def _stroke(start: Numbers, end: Numbers, seconds: float, time: Numbers) -> tuple[Numbers, Numbers, Numbers]:
    """Return quintics from rest to rest with their first and second derivatives [K, n]."""
    share, slope, bend = evaluate_quintic(np.array([[0.0, 0.0, 0.0, 0.0], [seconds, 1.0, 0.0, 0.0]]), time)
    share, slope, bend = (values if np.ndim(start) == 0 else values[:, None] for values in (share, slope, bend))
    return start + share * (end - start), slope * (end - start), bend * (end - start)


# --- the motion that a diagnosis asked for ----------------------------------------------------------------------------


REPORT = "diagnosis.json"
FORMAT = "tendonfmu-diagnosis-1"
MOTION_FORMAT = "tendonfmu-discriminating-motion-1"
RATE = 100.0  # rows per second


@dataclass(frozen=True)
class Discrimination:
    """What to record next."""

    sentence: str  # what the recording distinguishes
    entry: Entry  # of the menu
    performed: Excitation  # the motion of the entry

    def columns(self) -> dict[str, Numbers]:
        """Return name -> values [N], as `tendonfmu excite` writes a motion."""
        return self.performed.columns()

    def lines(self) -> Iterator[str]:
        """Yield what the recording distinguishes, how long it takes, and which known load applies at which time."""
        time, load = self.performed.time, self.performed.load
        yield self.sentence
        yield f"motion file: {time[-1]:.0f} s of {self.entry.words}"
        if load.any():
            edges = np.flatnonzero(np.any(np.diff(load, axis=0) != 0, axis=1)) + 1
            for begin, end in zip([0, *edges], [*edges, len(time)], strict=True):
                if end - begin > 1:  # constant load, not a transition
                    torques = ", ".join(f"{value:.3g}" for value in load[begin])
                    yield f"known load {torques} N·m from {time[begin]:.1f} to {time[end - 1]:.1f} s"

    def report(self, output: Path) -> dict[str, Any]:
        """Return what `tendonfmu excite --discriminate --json` prints. output: file of the motion."""
        time = self.performed.time
        return {
            "format": MOTION_FORMAT,
            "output": str(output),
            "rows": len(time),
            "duration": float(time[-1]),
            "sentence": self.sentence,
            "experiment": self.entry.words,
            "lines": list(self.lines()),
        }


def discriminating_motion(
    folder: Path, data: Mapping[str, Any], *, limits: Sequence[tuple[float, float]] | None = None, rate: float = RATE
) -> Discrimination:
    """Read the experiment that a diagnosis asked for and compute its motion. limits: [n]."""
    report = _read_report(folder / REPORT)
    experiment = report.get("experiment") or {}
    motion = experiment.get("motion") or {}
    if not motion:
        said = report.get("next_experiment") or "nothing is left to find out"
        raise InputError(f"{folder / REPORT}: no further experiment to plan: {said}")
    try:
        performed = performed_of(data, motion, rate)
    except InputError as wrong:
        raise InputError(f"{folder / REPORT}: {wrong}") from None
    _refuse_beyond(folder / REPORT, performed[1], limits)
    return Discrimination(str(experiment.get("sentence") or report.get("next_experiment") or ""), *performed)


def performed_of(data: Mapping[str, Any], motion: Mapping[str, Any], rate: float = RATE) -> tuple[Entry, Excitation]:
    """Return the entry and its motion for `result.Experiment.motion`; raises InputError if it is not valid."""
    entry = entry_from_json(motion, len(data["joints"]))
    return entry, perform(data, entry, rate, int(motion.get("seed", 0)))


def _read_report(path: Path) -> dict[str, Any]:
    try:
        report = json.loads(path.read_text(encoding="utf-8"))
    except OSError as failed:
        raise InputError(f"{path}: {failed.strerror}; expected the folder of a `tendonfmu diagnose`") from None
    except ValueError as wrong:
        raise InputError(f"{path}: not JSON ({wrong}); expected a report of `tendonfmu diagnose`") from None
    format_ = report.get("format") if isinstance(report, dict) else None
    if format_ != FORMAT:
        raise InputError(f'{path}: format = {json.dumps(format_)}; expected "{FORMAT}"')
    return dict(report)


def _refuse_beyond(path: Path, performed: Excitation, limits: Sequence[tuple[float, float]] | None) -> None:
    for j, (low, high) in enumerate(limits or (), start=1):
        least, most = float(performed.joint_position[:, j - 1].min()), float(performed.joint_position[:, j - 1].max())
        if not low <= least <= most <= high:
            raise InputError(
                f"{path}: experiment.motion: joint {j} moves from {least:.3g} to {most:.3g} rad; expected within its "
                f"limits {low:.3g} to {high:.3g} rad"
            )
