"""Which motion and which pushes a simulated finger gets: the rig's `motion` as knots, its `pushes` as a list.

Between knots a joint follows the quintic of the knots' positions, velocities and accelerations. Before the first and
after the last knot it stands still. The pretension changes from knot to knot by a smooth step.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu.errors import InputError
from tendonfmu.files import Node, Table, counted, read_table

Array = NDArray[np.float64]

LARGEST_SEED = 2**53
LONGEST = 1e6  # s
# A stroke between resting points is a quintic; its peak speed is this times its mean speed (minimum jerk: Flash, Hogan,
# "The coordination of arm movements", J. Neuroscience 5(7), 1985).
PEAK_OVER_MEAN = 1.875
SHORTEST_STROKE = 0.4  # s; short strokes are slow, so that accelerations stay small
MARGIN = 0.05  # of a joint's range; strokes leave this out at either end by default
FASTEST = 100.0  # rad/s
STRONGEST = 1e5  # N
MOST_PUSHES, STRONGEST_PUSH = 100_000, 1e4  # N
# Allowed values of the columns of a motion file: lowest, highest, unit.
RANGES = {
    "time": (0.0, 1e9, "s"),
    "pretension": (1e-9, STRONGEST, "N"),
    "position": (-100.0, 100.0, "rad"),
    "velocity": (-1e4, 1e4, "rad/s"),
    "acceleration": (-1e7, 1e7, "rad/s2"),
}
STILL = 1e-9  # rad/s, rad/s2; a joint with less stands still at the ends of a motion file


class Draws:
    """A separate stream of random numbers for every (seed, names); PCG64's raw numbers are the same in all versions."""

    def __init__(self, seed: int, *stream: int) -> None:
        self._generator = np.random.Generator(np.random.PCG64(np.random.SeedSequence([seed, *stream])))

    def share(self) -> float:
        """Draw a number."""
        return float(self._generator.random())

    def between(self, low: float, high: float) -> float:
        """Draw a number between bounds."""
        return low + (high - low) * self.share()

    def sign(self) -> float:
        """Draw a sign."""
        return 1.0 if self.share() < 0.5 else -1.0

    def direction(self) -> list[float]:
        """Draw a direction (Marsaglia, Ann. Math. Statist. 43(2), 1972)."""
        # returns unit vector [3], uniform on the sphere
        while True:
            x, y = self.between(-1.0, 1.0), self.between(-1.0, 1.0)
            square = x * x + y * y
            if square < 1.0:
                root = 2.0 * math.sqrt(1.0 - square)
                return [x * root, y * root, 1.0 - 2.0 * square]


@dataclass(frozen=True)
class Motion:
    """An expanded motion."""

    # knots of each joint: time (s), position (rad), velocity (rad/s), acceleration (rad/s2)
    joints: list[dict[str, list[float]]]
    pretension: dict[str, list[float]]  # knots: time (s), value (N)
    says: str  # the motion in words
    file: Path | None = None  # the file that was read for it, or None

    def expanded(self) -> dict[str, Any]:
        """Return the motion as the C++ reader takes it."""
        return {"joints": self.joints, "pretension": self.pretension}


@dataclass(frozen=True)
class Joints:
    """Limits of the joints [n] (rad), infinite where a joint has none."""

    lower: Sequence[float]
    upper: Sequence[float]

    def __len__(self) -> int:
        return len(self.lower)


def expand_motion(motion: Node, joints: Joints, seed: int, duration: float | None) -> Motion:
    """Return the rig's `motion` as knots. Raise Refusal with the key path, or InputError with the file."""
    # seed: used if the motion has none. duration: of the recording (s), used if the motion has none; or None.
    if not isinstance(motion.value, dict):
        motion.refuse('an object with the key kind: "still", "strokes" or "file"')
    kind = motion.member("kind").choice("still", "strokes", "file")
    if kind == "still":
        return _still(motion, joints)
    if kind == "file":
        return _from_file(motion, joints)
    return _strokes(motion, joints, seed, duration)


# --- kinds ------------------------------------------------------------------------------------------------------------


def _still(motion: Node, joints: Joints) -> Motion:
    motion.keys(("kind", "duration", "position", "pretension"))
    motion.member("duration").number(0.0, LONGEST, "s", default=LONGEST, above=True)
    position = _posture(motion.member("position"), joints.lower, joints.upper)
    knots = [{"time": [0.0], "position": [angle], "velocity": [0.0], "acceleration": [0.0]} for angle in position]
    return Motion(knots, _pretension(motion), "still")


def _strokes(motion: Node, joints: Joints, seed: int, duration: float | None) -> Motion:
    motion.keys(
        (
            "kind", "seed", "duration", "position", "still", "speed", "rest", "rest_share", "lower", "upper",
            "pretension",
        )
    )  # fmt: skip
    lower, upper = _range_of_strokes(motion, joints)
    plan = _Strokes(
        seed=motion.member("seed").integer(0, LARGEST_SEED, default=seed),
        duration=motion.member("duration").number(0.0, LONGEST, "s", default=duration, above=True),
        still=motion.member("still").number(0.0, LONGEST, "s", default=1.0),
        speed=motion.member("speed").span(0.0, FASTEST, "rad/s", default=(0.15, 0.9), above=True),
        rest=motion.member("rest").span(0.0, LONGEST, "s", default=(0.3, 1.5)),
        rest_share=motion.member("rest_share").number(0.0, 1.0, "", default=0.25),
    )
    start = _posture(motion.member("position"), lower, upper)
    return Motion(
        [plan.of_joint(j, start[j], lower[j], upper[j]) for j in range(len(joints))],
        _pretension(motion),
        f"strokes of {plan.speed[0]:g} to {plan.speed[1]:g} rad/s for {plan.duration:g} s, seed {plan.seed}",
    )


@dataclass(frozen=True)
class _Strokes:
    """Strokes of each joint on its own: between random targets, with a rest after some of them."""

    seed: int
    duration: float
    still: float
    speed: tuple[float, float]
    rest: tuple[float, float]
    rest_share: float

    def of_joint(self, joint: int, start: float, lower: float, upper: float) -> dict[str, list[float]]:
        """Return the knots of one joint, which stands still for `still` seconds at both ends."""
        draws = Draws(self.seed, 1, joint)
        angle, now, end = start, self.still, self.duration - self.still
        times, angles = [0.0], [start]
        while now + SHORTEST_STROKE <= end:
            way = draws.between(lower, upper) - angle
            seconds = max(SHORTEST_STROKE, PEAK_OVER_MEAN * abs(way) / draws.between(*self.speed))
            if now + seconds > end:  # the last stroke is cut to the remaining time, at the speed that was drawn
                way, seconds = way * (end - now) / seconds, end - now
            if now > times[-1]:
                times.append(now)
                angles.append(angle)
            angle, now = angle + way, now + seconds
            times.append(now)
            angles.append(angle)
            if draws.share() < self.rest_share:
                now += draws.between(*self.rest)
        zeros = [0.0] * len(times)
        return {"time": times, "position": angles, "velocity": zeros, "acceleration": list(zeros)}


def _from_file(motion: Node, joints: Joints) -> Motion:
    motion.keys(("kind", "file", "pretension"))
    file = Path(motion.member("file").text("path of a table (.csv or .parquet), relative to the rig file"))
    table = read_table(file, lambda path, names: _check_columns(path, names, len(joints)))
    _check_motion(file, table, joints)
    time = table["time"].tolist()
    kinds = ("position", "velocity", "acceleration")
    knots = [
        {"time": time} | {kind: table[f"joint_{kind}[{j}]"].tolist() for kind in kinds}
        for j in range(1, len(joints) + 1)
    ]
    has_column = "pretension" in table
    if has_column and not motion.member("pretension").absent:
        motion.member("pretension").refuse(f"nothing, since {file} has a column pretension")
    pretension = _plateaus(table) if has_column else _pretension(motion)
    return Motion(knots, pretension, f"{counted(len(time), 'row')} of {file.name}, {time[0]:g} to {time[-1]:g} s", file)


# --- parts ------------------------------------------------------------------------------------------------------------


def _posture(node: Node, lower: Sequence[float], upper: Sequence[float]) -> list[float]:
    """Return the first posture [n] (rad), within the limits."""
    if node.absent:
        middle = [0.5 * (low + high) for low, high in zip(lower, upper, strict=True)]
        return [angle if math.isfinite(angle) else 0.0 for angle in middle]
    angles = node.list_of(len(lower), "one angle per joint in rad", lambda angle: angle.number(-1e6, 1e6, "rad"))
    for angle, element, low, high in zip(angles, node.elements(), lower, upper, strict=True):
        if not low <= angle <= high:
            element.refuse(f"an angle within the joint's range, {low:g} to {high:g} rad")
    return angles


def _range_of_strokes(motion: Node, joints: Joints) -> tuple[list[float], list[float]]:
    """Return the lowest and highest targets [n]: as given, or the limits less a margin."""
    margin = [MARGIN * (high - low) for low, high in zip(joints.lower, joints.upper, strict=True)]
    targets = {
        "lower": [low + part for low, part in zip(joints.lower, margin, strict=True)],
        "upper": [high - part for high, part in zip(joints.upper, margin, strict=True)],
    }
    for key in targets:
        node = motion.member(key)
        for j, angle in enumerate(targets[key], start=1):
            if node.absent and not math.isfinite(angle):
                node.refuse(f"one angle per joint in rad, since physics.links[{j}] has no limits")
        if not node.absent:
            targets[key] = _posture(node, joints.lower, joints.upper)
    for element, low, high in zip(motion.member("upper").elements(), targets["lower"], targets["upper"], strict=False):
        if high < low:
            element.refuse(f"an angle not below motion.lower, {low:g} rad")
    for element, low, high in zip(motion.member("lower").elements(), targets["lower"], targets["upper"], strict=False):
        if high < low:
            element.refuse(f"an angle not above motion.upper, {high:g} rad")
    return targets["lower"], targets["upper"]


def _pretension(motion: Node) -> dict[str, list[float]]:
    force = motion.member("pretension").number(0.0, STRONGEST, "N, the mean tendon force", above=True)
    return {"time": [0.0], "value": [force]}


def _check_columns(file: Path, names: list[str], joints: int) -> None:
    wanted = ["time"]
    for j in range(1, joints + 1):
        wanted += [f"joint_position[{j}]", f"joint_velocity[{j}]", f"joint_acceleration[{j}]"]
    for name in wanted:
        if name not in names:
            raise InputError(f"{file}: no column {name}; expected {', '.join(wanted)} and at most pretension")
    for name in names:
        # excite's motor positions are for a robot: the rig commands its own motors
        if name not in wanted and name != "pretension" and not name.startswith("tendon_position["):
            raise InputError(f"{file}: unknown column {name!r}; expected {', '.join(wanted)} and at most pretension")


def _check_motion(file: Path, table: Table, joints: Joints) -> None:
    """Check values, increasing times, a start within the limits, and joints that stand still at both ends."""
    for name, column in table.items():
        if name.startswith("tendon_position["):
            continue
        low, high, unit = RANGES[name.split("[")[0].removeprefix("joint_")]
        _check_column(file, name, column, (column >= low) & (column <= high), f"{low:g} to {high:g} {unit}")
    time = table["time"]
    later = np.concatenate([[True], np.diff(time) > 0.0])
    _check_column(file, "time", time, later, "a time after the row before, s")
    for j, (lower, upper) in enumerate(zip(joints.lower, joints.upper, strict=True), start=1):
        start = table[f"joint_position[{j}]"][:1]
        reached = (start >= lower) & (start <= upper)
        _check_column(
            file,
            f"joint_position[{j}]",
            start,
            reached,
            f"a start within the joint's limits, {lower:g} to {upper:g} rad",
        )
        for kind in ("velocity", "acceleration"):
            name = f"joint_{kind}[{j}]"
            stands = np.abs(table[name]) <= STILL
            stands[1:-1] = True
            what = "0 in the first and the last row, before and after which the joints stand"
            _check_column(file, name, table[name], stands, what)


def _check_column(file: Path, name: str, column: Array, good: NDArray[np.bool_], expected: str) -> None:
    """Refuse the first row that is not good."""
    bad = np.flatnonzero(~good)
    if bad.size:
        row = int(bad[0]) + 1
        raise InputError(f"{file}: column {name}, row {row}: {column[row - 1]:g}; expected {expected}")


def _plateaus(table: Table) -> dict[str, list[float]]:
    """Return the knots of a sampled pretension: the rows on either side of every change."""
    time, value = table["time"], table["pretension"]
    changes = np.diff(value) != 0.0
    keep = np.concatenate([[True], changes]) | np.concatenate([changes, [False]])
    return {"time": time[keep].tolist(), "value": value[keep].tolist()}


# --- pushes -----------------------------------------------------------------------------------------------------------


Vector = Sequence[float]


@dataclass(frozen=True)
class Segment:
    """The part of a link that can be pushed: from its joint to the next joint, or to the tip."""

    link: int  # number of the link, from 1
    end: Vector  # end [3] (m) in the link's frame; the part starts at the origin
    axis: Vector  # the link's joint axis [3]

    @property
    def length(self) -> float:
        """Length (m)."""
        return math.sqrt(sum(part * part for part in self.end))


def expand_pushes(pushes: Node, segments: Sequence[Segment], seed: int, duration: float) -> list[Any]:
    """Return the rig's `pushes` as a list in order of time. Raise Refusal."""
    if pushes.absent:
        return []
    if isinstance(pushes.value, list):
        for push in pushes.elements():
            if not isinstance(push.value, dict):
                push.refuse("an object with start, rise, hold, fall, force and direction")
        return pushes.value
    if not isinstance(pushes.value, dict):
        pushes.refuse("a list of pushes, or an object with count")
    return _Recipe.read(pushes, segments, seed).draw(duration)


@dataclass(frozen=True)
class _Recipe:
    """Random pushes."""

    node: Node
    segments: Sequence[Segment]
    count: int
    seed: int
    first: float
    force: tuple[float, float]
    hold: tuple[float, float]
    rise: tuple[float, float]
    gap: tuple[float, float]
    directions: list[str]

    @classmethod
    def read(cls, node: Node, segments: Sequence[Segment], seed: int) -> _Recipe:
        node.keys(("count", "seed", "first", "force", "hold", "rise", "gap", "where", "direction"))
        where = node.member("where")
        anywhere = (where.choice("tip", "anywhere") if not where.absent else "tip") == "anywhere"
        recipe = cls(
            node=node,
            segments=[s for s in segments if s.length > 0.0] if anywhere else segments[-1:],
            count=node.member("count").integer(0, MOST_PUSHES),
            seed=node.member("seed").integer(0, LARGEST_SEED, default=seed),
            first=node.member("first").number(0.0, LONGEST, "s", default=2.0),
            force=node.member("force").span(0.0, STRONGEST_PUSH, "N", default=(0.8, 2.5)),
            hold=node.member("hold").span(0.0, LONGEST, "s", default=(0.3, 1.0)),
            rise=node.member("rise").span(0.0, LONGEST, "s", default=(0.1, 0.25), above=True),
            gap=node.member("gap").span(0.0, LONGEST, "s", default=(2.0, 4.0)),
            directions=_directions(node.member("direction")),
        )
        if not recipe.segments:
            where.refuse('"tip", since no link of this finger has a length')
        return recipe

    def draw(self, duration: float) -> list[dict[str, Any]]:
        draws = Draws(self.seed, 2)
        start = self.first
        pushes: list[dict[str, Any]] = []
        for k in range(self.count):
            segment, point = self._place(draws)
            rise, hold, fall = draws.between(*self.rise), draws.between(*self.hold), draws.between(*self.rise)
            push = {
                "start": start,
                "rise": rise,
                "hold": hold,
                "fall": fall,
                "force": draws.between(*self.force),
                "direction": self._direction(self.directions[k % len(self.directions)], segment, draws),
                "frame": "link",
                "link": segment.link,
                "point": point,
            }
            end = start + rise + hold + fall
            if end > duration:
                self.node.member("count").refuse(
                    f"at most {k}: the next one would end at {end:.2f} s, after the recording's {duration:g} s"
                )
            pushes.append(push)
            start = end + draws.between(*self.gap)
        return pushes

    def _place(self, draws: Draws) -> tuple[Segment, list[float]]:
        """Return the tip, or a point drawn uniformly along all links."""
        if self.node.member("where").value != "anywhere":
            return self.segments[-1], [float(part) for part in self.segments[-1].end]
        along = draws.between(0.0, sum(segment.length for segment in self.segments))
        for segment in self.segments:
            if along <= segment.length:
                break
            along -= segment.length
        share = min(1.0, along / segment.length)
        return segment, [share * part for part in segment.end]

    def _direction(self, kind: str, segment: Segment, draws: Draws) -> list[float]:
        """Return a unit vector [3] in the link's frame: any, along the joint's axis, or normal to axis and link."""
        if kind == "any":
            return draws.direction()
        sign = draws.sign()
        across = _unit(np.cross(segment.axis, segment.end).tolist()) if kind == "pad" else _unit(segment.axis)
        if across is None:
            what = "physics.tip" if segment.link == self.segments[-1].link else "a link's length"
            self.node.member("direction").refuse(f'"any" or "side": no pad, since {what} is zero or along the axis')
        return [sign * part for part in across]


def _directions(node: Node) -> list[str]:
    """Return the kinds of direction that the pushes use in turn."""
    if node.absent:
        return ["any"]
    kinds = node.elements() if isinstance(node.value, list) and node.value else [node]
    return [kind.choice("any", "pad", "side") for kind in kinds]


def _unit(vector: Vector) -> Vector | None:
    length = math.sqrt(sum(part * part for part in vector))
    return None if length < 1e-12 else [part / length for part in vector]
