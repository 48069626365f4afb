"""Which forces push a simulated finger: the rig's `pushes`, a list or a recipe of random ones, expanded to a list."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from tendonfmu.files import Node
from tendonfmu.statistics import LARGEST_SEED, Draws

Vector = Sequence[float]

LONGEST = 1e6  # s
MOST = 100_000
STRONGEST = 1e4  # N


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
            count=node.member("count").integer(0, MOST),
            seed=node.member("seed").integer(0, LARGEST_SEED, default=seed),
            first=node.member("first").number(0.0, LONGEST, "s", default=2.0),
            force=node.member("force").span(0.0, STRONGEST, "N", default=(0.8, 2.5)),
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
        across = _unit(_cross(segment.axis, segment.end)) if kind == "pad" else _unit(segment.axis)
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


def _cross(a: Vector, b: Vector) -> Vector:
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def _unit(vector: Vector) -> Vector | None:
    length = math.sqrt(sum(part * part for part in vector))
    return None if length < 1e-12 else [part / length for part in vector]
