"""What a rig file (`tendonfmu-rig-1`) says: a finger description with physics, sensors, motion, pushes and a seed.

A rig file is short: the finger by its path, the motion by a recipe, another rig as its `base`. Reading it gives the
*expanded* rig that the plant takes: the finger inline, the motion as knots, the pushes as a list. The plant alone
checks the parts that are the same in both (physics, sensors, integration). `schema/rig.schema.json` defines all keys
for editors.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu.errors import InputError
from tendonfmu.files import Node, Refusal, format_of, read_json
from tendonfmu.model import Finger, native, read_finger
from tendonfmu.simulate.motion_plan import LARGEST_SEED, Joints, Motion, Segment, expand_motion, expand_pushes
from tendonfmu.simulate.plant import Plant, refused_by

FORMAT = "tendonfmu-rig-1"
WHAT = "a rig"
LONGEST = 1e6  # s
MOST_SAMPLES = 50_000_000
LONGEST_BASE_CHAIN = 16

# columns that a recording may have in addition to tendon forces and positions
COLUMNS = ("joint_position", "joint_velocity", "external_torque", "contact")

TOP = (
    "format", "base", "name", "version", "seed", "finger", "physics", "sensors", "motion", "pushes", "settle",
    "integration", "recording",
)  # fmt: skip
PATHS = (("finger",), ("motion", "file"))  # keys that hold a path, relative to their file


@dataclass(frozen=True)
class Rig:
    """A rig that has been read and expanded, but not yet checked by the plant (see `Plant`)."""

    path: Path  # the file that it was read from
    files: list[Path]  # all files that it was made from, its own first
    data: Mapping[str, Any]  # its keys, merged with those of its bases
    finger: Finger
    motion: Motion  # with knots
    expanded: Mapping[str, Any]  # the rig as the plant takes it
    rate: float  # samples per second
    duration: float | None  # of the recording (s)
    columns: list[str]  # columns that the recording has in addition to the tendons' columns

    @property
    def name(self) -> str:
        """Name of the rig."""
        return str(self.data["name"])

    @property
    def version(self) -> int:
        """Version of the rig."""
        return int(self.data["version"])

    @property
    def joints(self) -> int:
        """Number of joints n."""
        return len(self.finger.joint_names)

    @property
    def tendons(self) -> int:
        """Number of tendons m."""
        return len(self.finger.tendon_names)

    def json(self) -> str:
        """Return the expanded rig as the plant reads it, as JSON: the same text for the same rig."""
        return json.dumps(self.expanded, allow_nan=False)

    def times(self) -> NDArray[np.float64]:
        """Return [N] (s) the times of the recording's samples: 0, 1/rate, ... below the duration."""
        if self.duration is None:
            raise InputError(f"{self.path}: recording: missing; expected an object with duration, s")
        samples = _sample_count(self.duration, self.rate)
        return np.asarray(np.arange(samples) / self.rate)


def is_rig(path: Path) -> bool:
    """Return whether a file claims to be a rig, even an invalid one."""
    return format_of(path).startswith("tendonfmu-rig-")


def description_files(path: Path) -> list[Path]:
    """Return the files that describe a rig: itself, its bases and its finger."""
    # A motion file is not included, since it is a result that may be made again.
    files: list[Path] = []
    finger = _with_base(path, files, []).get("finger")
    return [*files, Path(finger)] if isinstance(finger, str) else files


def read_rig(path: Path) -> Rig:
    """Read and expand a rig.

    This checks only what the plant does not see. `Plant(rig.json())` checks the rest.

    Parameters
    ----------
    path
        The rig file.

    Returns
    -------
    Rig
        The expanded rig.

    Raises
    ------
    InputError
        File, key path, value and what was expected.
    """
    files: list[Path] = []
    data = _with_base(path, files, [])
    try:
        return _expand(path, files, data)
    except Refusal as refused:
        raise InputError(f"{path}: {refused}") from None


def finger_with_limits(path: Path) -> tuple[Finger, Joints]:
    """Return the finger of a rig, and the limits of its joints, whatever else the rig has. Raises InputError."""
    files: list[Path] = []
    root = Node(_with_base(path, files, []))
    try:
        finger = _finger(root.member("finger"), path, files)
        return finger, _links(root.member("physics"), finger.joints)[1]
    except Refusal as refused:
        raise InputError(f"{path}: {refused}") from None


# --- base -------------------------------------------------------------------------------------------------------------


def _with_base(path: Path, files: list[Path], chain: list[Path]) -> dict[str, Any]:
    """Return the keys of a rig file; missing keys come from its base. The files read are appended to `files`."""
    if path.resolve() in [earlier.resolve() for earlier in chain]:
        loop = " -> ".join(str(earlier) for earlier in (*chain, path))
        raise InputError(f"{chain[-1]}: base: {loop}; expected no rig that is its own base")
    if len(chain) >= LONGEST_BASE_CHAIN:
        raise InputError(f"{chain[-1]}: base: {path}; expected at most {LONGEST_BASE_CHAIN - 1} bases in a row")
    data = read_json(path, WHAT)
    files.append(path)
    try:
        if isinstance(data, dict):
            Node(data).member("format").choice(FORMAT)  # before the other keys: the file may be a finger description
        root = Node(data).keys(TOP)
        base = root.member("base")
        keys = {key: value for key, value in data.items() if key != "base"}
        _place_paths(keys, path.parent)
        if base.absent:
            return keys
        other = path.parent / base.text("path of another rig, relative to this file")
    except Refusal as refused:
        raise InputError(f"{path}: {refused}") from None
    return _merged(_with_base(other, files, [*chain, path]), keys)


def _place_paths(data: dict[str, Any], folder: Path) -> None:
    """Resolve paths, which are relative to the file that contains them."""
    for *way, key in PATHS:
        place: Any = data
        for step in way:
            place = place.get(step) if isinstance(place, dict) else None
        if isinstance(place, dict) and isinstance(place.get(key), str) and place[key]:
            place[key] = str(folder / place[key])


def _merged(base: dict[str, Any], changes: dict[str, Any]) -> dict[str, Any]:
    """Merge the keys of `own` into those of `base`: objects key by key, all other values whole."""
    # A motion of another kind replaces the base's, since kinds have different keys; one of the same kind changes it.
    result = dict(base)
    for key, value in changes.items():
        before = base.get(key)
        if value is None:
            result.pop(key, None)
        elif (
            isinstance(value, dict)
            and isinstance(before, dict)
            and value.get("kind", before.get("kind")) == before.get("kind")
        ):
            result[key] = _merged(before, value)
        else:
            result[key] = value
    return result


# --- expansion --------------------------------------------------------------------------------------------------------


def _expand(path: Path, files: list[Path], data: dict[str, Any]) -> Rig:
    root = Node(data).keys(TOP)
    root.member("name").text("the rig's name")
    root.member("version").integer(1, LARGEST_SEED)
    seed = root.member("seed").integer(0, LARGEST_SEED, default=0)
    finger = _finger(root.member("finger"), path, files)
    segments, limits = _links(root.member("physics"), len(finger.joint_names))
    rate = root.member("sensors").member("rate").number(1.0, 1e5, "Hz", default=1000.0)
    duration, columns = _recording(root.member("recording"), rate)
    motion = expand_motion(root.member("motion"), limits, seed, duration)
    if motion.file is not None:
        files.append(motion.file)
    pushes = expand_pushes(root.member("pushes"), segments, seed, math.inf if duration is None else duration)
    expanded = data | {"finger": finger.data, "seed": seed, "motion": motion.expanded(), "pushes": pushes}
    return Rig(path, files, data, finger, motion, expanded, rate, duration, columns)


def _finger(node: Node, path: Path, files: list[Path]) -> Finger:
    """Return the finger, given by its path or inline."""
    if isinstance(node.value, str):
        file = Path(node.text("path of a finger description, relative to this file"))
        files.append(file)
        return read_finger(file)
    if not isinstance(node.value, dict):
        node.refuse("a finger description, or the path of one relative to this file")
    try:
        native.image_from_json(json.dumps(node.value).encode())
    except native.NativeError as refused:
        raise Refusal(f"finger: {refused}") from None
    return Finger(path, node.value)


def _links(physics: Node, joints: int) -> tuple[list[Segment], Joints]:
    """Return the links' shape and the joints' limits, which motion and pushes need. The plant checks the rest."""
    if not isinstance(physics.value, dict):
        physics.refuse("an object with links")
    links = physics.member("links")
    if not isinstance(links.value, list) or len(links.value) != joints:
        links.refuse(f"a list of {joints}, one link per joint of the finger")
    elements = links.elements()
    ends = [_vector(link.member("offset"), "m") for link in elements[1:]] + [_vector(physics.member("tip"), "m")]
    lower, upper = [], []
    for link in elements:
        limits = link.member("limits")
        lower.append(-math.inf if limits.absent else limits.member("lower").number(-1e6, 1e6, "rad"))
        upper.append(math.inf if limits.absent else limits.member("upper").number(-1e6, 1e6, "rad"))
        if not lower[-1] < upper[-1]:
            limits.member("upper").refuse(f"an angle above limits.lower, {lower[-1]:g} rad")
    segments = [
        Segment(j, end, _vector(link.member("axis"), "", required=True))
        for j, (link, end) in enumerate(zip(elements, ends, strict=True), start=1)
    ]
    return segments, Joints(lower, upper)


def _vector(node: Node, unit: str, required: bool = False) -> list[float]:
    if node.absent and not required:
        return [0.0, 0.0, 0.0]
    meaning = f"x, y and z in {unit}" if unit else "x, y and z"
    return node.list_of(3, meaning, lambda part: part.number(-1e6, 1e6, unit))


def _recording(recording: Node, rate: float) -> tuple[float | None, list[str]]:
    if recording.absent:
        return None, []
    recording.keys(("duration", "columns"))
    duration = recording.member("duration").number(0.0, LONGEST, "s", above=True)
    if _sample_count(duration, rate) > MOST_SAMPLES:
        recording.member("duration").refuse(f"at most {MOST_SAMPLES} samples at {rate:g} Hz")
    columns = recording.member("columns")
    if columns.absent:
        return duration, []
    if not isinstance(columns.value, list):
        columns.refuse(f"a list of {', '.join(COLUMNS)}")
    wanted = [element.choice(*COLUMNS) for element in columns.elements()]
    for element in columns.elements():
        if wanted.count(element.value) > 1:
            element.refuse("each column once")
    return duration, [column for column in COLUMNS if column in wanted]


def _sample_count(duration: float, rate: float) -> int:
    """Count the samples 0, 1/rate, ... below the duration, independent of rounding of the product."""
    return max(1, math.ceil(duration * rate - 1e-6))


# --- what a rig has, in lines of text for `tendonfmu check` -----------------------------------------------------------


def plant_of(rig: Rig) -> Plant:
    """Return the plant of a rig. Raise InputError with the rig's file and the key path."""
    with refused_by(rig.path):
        return Plant(rig.json())


def describe_rig(path: Path) -> list[str]:
    """Read a rig, let the plant check it, and describe it."""
    rig = read_rig(path)
    plant = plant_of(rig)
    values = rig.motion.pretension["value"]
    low, high = min(values), max(values)
    pretension = f"{low:g} N" if low == high else f"{low:g} to {high:g} N"
    beside = "".join(f", {column}" for column in rig.columns)
    lines = {
        "joints": f"{rig.joints}: {', '.join(rig.finger.joint_names)}",
        "tendons": f"{rig.tendons}: {', '.join(rig.finger.tendon_names)}",
        "physics": f"{plant.order} continuous states; {', '.join(rig.data['physics'])}",
        "motion": f"{rig.motion.says}; pretension {pretension}",
        "pushes": str(len(rig.expanded["pushes"])),
        "recording": "none"
        if rig.duration is None
        else f"{rig.duration:g} s at {rig.rate:g} Hz: tendon_force, tendon_position{beside}",
    }
    head = f"{rig.name}, version {rig.version}: a valid rig of {rig.finger.name}, seed {rig.expanded['seed']}"
    return [head, *(f"{key:<18} {text}" for key, text in lines.items())]
