"""Numbers of a description written into a MuJoCo model, and what MJCF cannot express of it."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from tendonfmu.arrays import Numbers
from tendonfmu.errors import InputError, InternalError, own_fault
from tendonfmu.estimate import FIT_REPORT
from tendonfmu.files import counted, read_json, whole_file
from tendonfmu.mjcf.compiled_model import CompiledModel, Joint, XmlSource
from tendonfmu.mjcf.finger_import import links_inertia
from tendonfmu.mjcf.finger_parts import motors_of
from tendonfmu.model import Finger, Law, effects, extension_rows, read_finger, sides
from tendonfmu.recordings import FEWEST, Recording, admit, gaps, read_recordings, tendon_angles, zero_phase

# --- replay -----------------------------------------------------------------------------------------------------------


CUTOFF = 10.0  # Hz; motion beyond it is noise
SAMPLES = 4000  # of each recording


def replay_errors(file: Path, finger: Finger, recordings: Sequence[Recording]) -> Numbers:
    """Return the rms (N·m) [n] of what MuJoCo's inverse dynamics leave of the torque in recordings of free motion."""
    model = CompiledModel(file)
    joints = [model.joint_named(str(name)) for name in finger.joint_names]
    tendons = [model.tendon_named(str(name)) for name in finger.tendon_names]
    model.leave_alone(tendons)
    squares: list[Numbers] = []
    for recording in recordings:
        time, groups = recording.time, recording.groups
        angles = groups.get("joint_position", tendon_angles(recording, finger))
        every = max(1, len(time) // SAMPLES)
        for begin, end in pairwise([0, *gaps(time), len(time)]):
            if end - begin < FEWEST:
                continue
            rate = 1.0 / float(np.median(np.diff(time[begin:end])))
            angle, force = (zero_phase(each[begin:end], CUTOFF, rate) for each in (angles, groups["tendon_force"]))
            speed = np.gradient(angle, time[begin:end], axis=0)
            rows = zip(angle, speed, np.gradient(speed, time[begin:end], axis=0), force, strict=True)
            for row in list(rows)[every::every]:
                needed, arms = model.needed_torque(joints, tendons, *row[:3])
                squares.append((needed - row[3] @ arms) ** 2)
    if not squares:
        raise InputError(f"{recordings[0].path}: too short to be replayed; expected {FEWEST} samples without a gap")
    return np.asarray(np.sqrt(np.mean(squares, axis=0)))


SAME = 1e-9  # relative; a number that differs by less is not written again
WRITTEN = ("inertia", "preload_friction")  # extensions that MJCF may express
UNITS = {
    ("joint", "frictionloss"): "N·m",
    ("joint", "damping"): "N·m·s/rad",
    ("joint", "stiffness"): "N·m/rad",
    ("joint", "springref"): "rad",
    ("joint", "armature"): "kg·m²",
    ("tendon", "frictionloss"): "N",
}


@dataclass(frozen=True)
class Change:
    """A number of the model that differs."""

    kind: str  # "joint" or "tendon", and its name
    name: str
    attribute: str  # attribute of MJCF
    before: float  # in SI units
    after: float
    path: str  # of the number in the description; of a law by direction that of its first side

    def line(self) -> str:
        """Describe it in a line."""
        unit = UNITS[self.kind, self.attribute]
        return f"{self.kind} {self.name}: {self.attribute} {self.before:.4g} → {self.after:.4g} {unit}"


@dataclass(frozen=True)
class Replayed:
    """What a replay leaves at a joint, in N·m: with the model's numbers, and with those that were written."""

    joint: str
    before: float
    after: float

    def line(self) -> str:
        """Describe it in a line."""
        return f"replay, joint {self.joint}: {1e3 * self.before:.4g} → {1e3 * self.after:.4g} mN·m are left"


@dataclass(frozen=True)
class Export:
    """What was written."""

    changes: list[Change]  # numbers that differ from the model's
    left_out: list[str]  # what MJCF cannot express of the description, and numbers that the description does not have
    replay: list[Replayed]  # a row a joint; empty without recordings

    def report(self, finger: Path, model: Path, output: Path) -> dict[str, Any]:
        """Return what was done, for `--json`. finger, model, output: files of the description, and of both models."""
        return {
            "format": "tendonfmu-export-1",
            "finger": str(finger),
            "model": str(model),
            "output": str(output),
            "changes": [asdict(change) for change in self.changes],
            "left_out": self.left_out,
            "replay": [asdict(row) for row in self.replay],
        }


def export_numbers(
    finger: Path, path: Path, output: Path, report: Path | None = None, replay: Sequence[Path] = ()
) -> Export:
    """Write the numbers of a description into a model.

    Those that a fit's report does not identify stay the model's, and those of a joint that the replay of recordings
    finds worse with them.
    """
    read = read_finger(finger)
    data, recordings = read.data, read_recordings(replay)
    admit(read, recordings)
    model = CompiledModel(path)
    joints = [model.joint_named(name) for name in _names(finger, data, "joints")]
    for name in _names(finger, data, "tendons"):
        model.tendon_named(name)
    left_out: list[str] = []
    wanted = [*_of_joints(data, model, joints, left_out), *_of_tendons(data, model, left_out)]
    unsure = {} if report is None else _unsure(report)
    wanted = [change for change in wanted if _is_sound(change, unsure, left_out)]
    changes = [change for change in wanted if not math.isclose(change.before, change.after, rel_tol=SAME)]
    with whole_file(output) as temporary:
        _write(path, changes, temporary, output)
        rows: list[Replayed] = []
        if recordings:
            before = replay_errors(path, read, recordings)
            worse = _worse(read, before, replay_errors(temporary, read, recordings))
            for change in [each for each in changes if each.name in worse]:
                left_out.append(f"{change.line()}: the replay {worse[change.name]}; the model's number stays")
                changes.remove(change)
            if worse:
                _write(path, changes, temporary, output)
            after = replay_errors(temporary, read, recordings)
            rows = [Replayed(*row) for row in zip(read.joint_names, before.tolist(), after.tolist(), strict=True)]
    return Export(changes, [*left_out, *_inexpressible(data)], rows)


def _write(path: Path, changes: Sequence[Change], file: Path, output: Path) -> None:
    source = XmlSource(path)
    for change in changes:
        unit = source.angle_unit() if change.attribute == "springref" else 1.0
        source.set_number(change.kind, change.name, change.attribute, change.after / unit)
    text = source.text()
    beside = source.first_file()
    if beside is not None and output.resolve().parent != path.resolve().parent:
        expected = f"an output in the folder of {path.name}"
        raise InputError(f"{output}: the model refers to {beside} beside it; expected {expected}")
    file.write_bytes(text)
    _check_written(file, changes)


def _worse(finger: Finger, before: Numbers, after: Numbers) -> dict[str, str]:
    """Return the joints that a replay finds worse than they were, the tendons that move them, and by how much."""
    found: dict[str, str] = {}
    for j in np.flatnonzero(after > before * (1.0 + SAME)):
        names = [name for name, arms in zip(finger.tendon_names, finger.moment_arms, strict=True) if arms[j] != 0.0]
        leaves = f"leaves {1e3 * after[j]:.4g} for {1e3 * before[j]:.4g} mN·m at {finger.joint_names[j]}"
        found |= dict.fromkeys([finger.joint_names[j], *names], leaves)
    return found


def _unsure(report: Path) -> dict[str, str]:
    """Return the paths of a fit's report whose numbers are not to be trusted, and why."""
    content = read_json(report, "the report of a fit")
    rows = content.get("parameters") if isinstance(content, dict) and content.get("format") == FIT_REPORT else None
    if not isinstance(rows, list):
        raise InputError(f"{report}: expected a report of tendonfmu fit --report")
    why = {True: "at a bound of the fit", False: "not identified by the fit"}
    return {
        row["path"]: why[row["at_bound"]]
        for row in rows
        if row["at_bound"] or not (row["identified"] or row.get("reason") == "kept")
    }


def _is_sound(change: Change, unsure: Mapping[str, str], left_out: list[str]) -> bool:
    """Return whether a number may be written; else say why the model's stays."""
    reason = unsure.get(change.path)
    if change.attribute != "springref" and change.after < 0.0:
        reason = "below 0"
    elif change.attribute in ("frictionloss", "damping", "stiffness") and change.after == 0.0 < change.before:
        reason = "at its bound 0"
    if reason is not None:
        left_out.append(f"{change.line()}: {reason}; the model's number stays")
    return reason is None


def _names(file: Path, data: Mapping[str, Any], key: str) -> list[str]:
    """Return the names of joints or tendons, by which the model's are found."""
    kind = key.removesuffix("s")
    for k, row in enumerate(data[key], start=1):
        if row.get("name") is None:
            raise InputError(f"{file}: {key}[{k}].name: missing; expected the name of a {kind} of the model")
    return [str(row["name"]) for row in data[key]]


def _check_written(file: Path, changes: Sequence[Change]) -> None:
    """Compile the text that was written: its numbers must be those wanted."""
    with own_fault("the model that was written"):
        model = CompiledModel(file)
        for change in changes:
            found = _value(model, change.kind, change.name, change.attribute)
            if not math.isclose(found, change.after, rel_tol=SAME, abs_tol=1e-15):
                raise InternalError(f"{change.line()}: MuJoCo reads {found:g}")


def _value(model: CompiledModel, kind: str, name: str, attribute: str) -> float:
    row = model.joint_named(name) if kind == "joint" else model.tendon_named(name)
    return float(getattr(row, "rest" if attribute == "springref" else attribute))


# --- what MJCF expresses ----------------------------------------------------------------------------------------------


def _of_joints(
    data: Mapping[str, Any], model: CompiledModel, joints: Sequence[Joint], left_out: list[str]
) -> Iterator[Change]:
    rows = list(enumerate(extension_rows(data), start=1))
    inertia = {row["joint"]: float(row["inertia"]) for _, row in rows if row["effect"] == "inertia"}
    number = {row["joint"]: f"extensions[{k}].inertia" for k, row in rows if row["effect"] == "inertia"}
    links = links_inertia(model, joints)
    for j, (joint, row) in enumerate(zip(joints, data["joints"], strict=True)):
        wanted: dict[str, float] = {}
        at = f"joints[{j + 1}]"
        side = "positive." if "positive" in (row.get("friction") or {}) else ""
        paths = {
            "frictionloss": f"{at}.friction.{side}coulomb",
            "damping": f"{at}.friction.{side}viscous",
            "stiffness": f"{at}.cover.stiffness",
            "springref": f"{at}.cover.rest_angle",
            "armature": number.get(j + 1, ""),
        }
        law, cover = row.get("friction"), row.get("cover")
        if law is not None:
            wanted |= {"frictionloss": _mean(law, "coulomb"), "damping": _mean(law, "viscous")}
            left_out += _beyond_coulomb(joint.name, law)
        elif joint.frictionloss or joint.damping:
            left_out.append(f"joint {joint.name}: no friction law in the description; the model's numbers stay")
        if cover is not None:
            wanted |= {"stiffness": float(cover["stiffness"]), "springref": float(cover.get("rest_angle") or 0.0)}
        if j + 1 in inertia:
            rotor = inertia[j + 1] - links[j]
            # to rounding, links and armature may add up to the links alone
            wanted["armature"] = max(rotor, 0.0)
            if rotor < -SAME * links[j]:
                left_out.append(
                    f"joint {joint.name}: inertia {inertia[j + 1]:.3g} kg·m², less than the {links[j]:.3g} of its "
                    "links in the model; armature 0"
                )
        for attribute, value in wanted.items():
            before = _value(model, "joint", joint.name, attribute)
            yield Change("joint", joint.name, attribute, before, value, paths[attribute])


def _of_tendons(data: Mapping[str, Any], model: CompiledModel, left_out: list[str]) -> Iterator[Change]:
    for k, row in enumerate(extension_rows(data), start=1):
        if row["effect"] != "preload_friction":
            continue
        tendon = data["tendons"][row["tendon"] - 1]
        first = next((j for j, arm in enumerate(tendon["moment_arms"], start=1) if arm != 0.0), None)
        reason = None
        if row.get("joint") != first:
            reason = "not before the tendon's first joint alone"
        elif row.get("beyond") not in (None, 1, 1.0):
            reason = "joints beyond feel another share"
        elif motors_of(model, model.tendon_named(tendon["name"])):
            reason = "the model's tendon includes its motor"
        if reason is not None:
            left_out.append(f"extensions[{k}], preload_friction of tendon {tendon['name']}: {reason}")
            continue
        before = _value(model, "tendon", tendon["name"], "frictionloss")
        path = f"extensions[{k}].coulomb"
        yield Change("tendon", tendon["name"], "frictionloss", before, float(row["coulomb"]), path)


def _mean(law: Law, number: str) -> float:
    """Return a number of a law, of both sides of an asymmetric one the mean."""
    return sum(float(side.get(number) or 0.0) for side in sides(law)) / len(sides(law))


# --- what it cannot express -------------------------------------------------------------------------------------------


def _beyond_coulomb(name: str, law: Law) -> Iterator[str]:
    both = sides(law)
    if len(both) == 2:
        values = " and ".join(f"{side['coulomb']:.3g}" for side in both)
        yield f"joint {name}: friction by direction, coulomb {values} N·m; the mean is written"
    static = sum(side["static"] for side in both) / len(both)
    if any(side["static"] != side["coulomb"] for side in both):
        yield f"joint {name}: static friction {static:.3g} N·m, above coulomb (Stribeck effect)"


def _inexpressible(data: Mapping[str, Any]) -> Iterator[str]:
    names = {
        "edge_friction": "friction before joints, a share of the tendon force",
        "pulley_friction": "friction at pulleys, a share of the tendon force",
        "load_friction": "friction in joints, by the sum of the tendon forces",
    }
    for kind, words in names.items():
        rows = [effect for effect in effects(data) if effect.kind == kind]
        sizes = [side["coulomb"] for effect in rows for law in effect.laws for side in sides(law)]
        if rows:
            yield f"{kind} at {counted(len(rows), 'place')}: {words}; coulomb {min(sizes):.3g} to {max(sizes):.3g}"
    others = Counter(row["effect"] for row in extension_rows(data) if row["effect"] not in WRITTEN)
    if others:
        yield "extensions: " + ", ".join(f"{count} {effect}" for effect, count in others.items())
    yield "moment arms and stiffness of tendons stay the model's; bias and contact have no counterpart"
