"""Where each line and mark of a finger's routing drawing is, after the paper's fig. 3.

Lengths are in units of the drawing. `finger_svg` draws it for pages, `drawing/finger_picture.py` as an icon. The
finger lies along x, with its base on the left. A tendon passes above a joint if its moment arm is positive, and below
if it is negative. Tendons that end early run inside, so that they do not cross those that continue.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from tendonfmu.arrays import Data
from tendonfmu.files import html_template

JOINT_SPACING = 2.5
HUB_RADIUS = 0.32  # of the disc that stands for a joint
LANE = 0.17  # between tendons on one side of a joint
FLAT_BEFORE = 0.75  # how far before and behind a joint a tendon runs straight
FLAT_BEHIND = 0.3
EDGE_BEFORE = 0.6  # how far before a joint its edge is drawn
MARGIN = 0.2  # of the finger's outline around its tendons
SPRING_LENGTH = 0.9
BASE = 1.9  # from the springs to the first joint
LABEL_SPACING = 0.3
EDGE_RED = "#CC1F1A"
TENDON_COLOURS = ("#0072B2", "#E69F00", "#009E73", "#CC79A7", "#56B4E9", "#5A5A5A", "#332288", "#999933")

Points = NDArray[np.float64]


@dataclass(frozen=True)
class DrawnJoint:
    """A joint at (x, 0) with its disc."""

    name: str
    x: float
    radius: float


@dataclass(frozen=True)
class DrawnTendon:
    """A tendon from its spring to its end."""

    name: str  # name of the tendon
    line: Points  # points [k, 2]
    spring: Points
    pulleys: Points  # points [k, 2] with pulley friction
    edges: Points  # points [k, 2] with friction before a joint, without and with working points
    varying_edges: Points
    bidirectional: bool  # whether it is a cable loop


@dataclass(frozen=True)
class FingerDrawing:
    """Geometry of a whole finger."""

    joints: list[DrawnJoint]  # what is drawn of them
    links: Points  # [n, 2] x of begin and end of the link behind each joint
    outline: Points  # [k, 3] x, lower and upper side of the finger around its tendons
    tendons: list[DrawnTendon]
    left: float  # bounds; y reaches from −height to height
    right: float
    height: float


def finger_drawing(data: Data) -> FingerDrawing:
    """Compute the geometry of a finger from its description."""
    R = np.array([tendon["moment_arms"] for tendon in data["tendons"]], dtype=float)
    joint_names, tendon_names = (_names(data[f"{kind}s"], kind) for kind in ("joint", "tendon"))
    heights = _heights(R)
    x: Points = JOINT_SPACING * np.arange(float(R.shape[1]))
    starts = _starts(heights)
    tip = float(x[-1] + 0.75 * JOINT_SPACING)
    outline = _outline(x, heights, tip)
    joints = [DrawnJoint(name, float(x[j]), HUB_RADIUS) for j, name in enumerate(joint_names)]
    tendons = [
        _tendon(tendon, name, x, R[i], heights[i], float(starts[i]))
        for i, (tendon, name) in enumerate(zip(data["tendons"], tendon_names, strict=True))
    ]
    return FingerDrawing(
        joints=joints,
        links=np.column_stack([x, np.append(x[1:], tip - 2.0 * MARGIN)]),
        outline=outline,
        tendons=tendons,
        left=-BASE - SPRING_LENGTH,
        right=tip + MARGIN,
        height=float(max(np.abs(outline[:, 1:]).max(), np.abs(starts).max() + LABEL_SPACING)),
    )


def _names(parts: Sequence[Data], kind: str) -> list[str]:
    return [str(part.get("name") or f"{kind} {k}") for k, part in enumerate(parts, start=1)]


def _outline(x: Points, heights: Points, tip: float) -> Points:
    """Return x, lower and upper side [k, 3] around the tendons: smooth between the joints, round at the tip."""
    upper = np.maximum(heights.max(axis=0), HUB_RADIUS) + MARGIN
    lower = np.minimum(heights.min(axis=0), -HUB_RADIUS) - MARGIN
    at = np.linspace(x[0] - FLAT_BEFORE - 0.1, tip, 40 * len(x) + 40)
    sides = [at]
    for side in (lower, upper):
        line = _smooth_line(x, side, float(side[0]))
        bend = np.clip(1.0 - 2.0 * (tip - at) / (tip - x[-1]), 0.0, 1.0)
        sides.append(np.interp(at, line[:, 0], line[:, 1]) * np.sqrt(1.0 - bend * bend))
    return np.column_stack(sides)


def _last_joints(R: Points) -> NDArray[np.intp]:
    """Return the index [m] of the last joint that each tendon passes."""
    n = R.shape[1]
    reached = np.where(R != 0.0, np.arange(n), 0)
    return np.asarray(reached.max(axis=1))


def _heights(R: Points) -> Points:
    """Return the height [m, n] at which each tendon passes each joint; near 0 where it has no moment arm."""
    last = _last_joints(R)
    heights = np.zeros(R.shape)
    for j in range(R.shape[1]):
        for side in (1.0, -1.0):
            here = [i for i in np.lexsort((np.abs(R[:, j]), last)) if R[i, j] * side > 0.0]
            heights[here, j] = side * (HUB_RADIUS + LANE * np.arange(len(here)))
        through = np.flatnonzero((R[:, j] == 0.0) & (last > j))
        heights[through, j] = 0.3 * LANE * (np.arange(len(through)) - 0.5 * (len(through) - 1))
    return heights


def _starts(heights: Points) -> Points:
    """Return the height [m] of each spring, evenly spread, in the order in which the tendons reach the first joint."""
    m = len(heights)
    order = np.lexsort(heights.T[::-1])
    starts = np.empty(m)
    starts[order] = LABEL_SPACING * (np.arange(m) - 0.5 * (m - 1))
    return starts


def _tendon(tendon: dict[str, object], name: str, x: Points, arms: Points, y: Points, start: float) -> DrawnTendon:
    last = int(_last_joints(arms[None, :])[0])
    line = _smooth_line(x[: last + 1], y[: last + 1], start)
    pulleys = [(x[j], y[j]) for j in _present(tendon, "pulley_friction") if j <= last]
    edges: dict[bool, list[tuple[float, float]]] = {False: [], True: []}
    for j, edge in _present(tendon, "edge_friction").items():
        if j <= last:
            at = float(x[j]) - EDGE_BEFORE
            varying = isinstance(edge, dict) and len(edge.get("angles") or []) > 1
            edges[varying].append((at, float(np.interp(at, line[:, 0], line[:, 1]))))
    return DrawnTendon(
        name=name,
        line=line,
        spring=_spring(start),
        pulleys=_points(pulleys),
        edges=_points(edges[False]),
        varying_edges=_points(edges[True]),
        bidirectional=tendon.get("bidirectional") is True,
    )


def _present(tendon: dict[str, object], key: str) -> dict[int, object]:
    """Return the entries by joint, 0-based."""
    entries = tendon.get(key)
    return {j: entry for j, entry in enumerate(entries) if entry is not None} if isinstance(entries, list) else {}


def _points(pairs: list[tuple[float, float]]) -> Points:
    return np.array(pairs, dtype=float).reshape(-1, 2)


def _smooth_line(x: Points, y: Points, start: float) -> Points:
    """Return points [k, 2] from the spring over all joints: straight at each joint, smooth between."""
    knots_x = np.concatenate([[-BASE], np.column_stack([x - FLAT_BEFORE, x + FLAT_BEHIND]).ravel()])
    knots_y = np.concatenate([[start], np.repeat(y, 2)])
    share = np.linspace(0.0, 1.0, 24)
    ease = share * share * (3.0 - 2.0 * share)
    pieces = [
        np.column_stack([a + (b - a) * share, c + (d - c) * ease])
        for a, b, c, d in zip(knots_x, knots_x[1:], knots_y, knots_y[1:], strict=False)
    ]
    return np.concatenate(pieces)


def _spring(height: float) -> Points:
    """Return points [k, 2] of a zigzag that ends where the tendon begins."""
    share = np.linspace(0.0, 1.0, 12)
    swing = np.array([0.0, 0.0, *[0.07, -0.07] * 4, 0.0, 0.0])
    return np.column_stack([-BASE - SPRING_LENGTH * (1.0 - share), height + swing])


# --- as SVG -----------------------------------------------------------------------------------------------------------
# Lengths are CSS pixels. A page sets the colours of its paper and ink; without them the drawing is for light paper.


ALONG, ACROSS = 32.0, 46.0  # per unit of the drawing
ROW = 14.0  # of names of joints
LETTER = 7.0  # width of a letter of a name
GREY = "#8A8A8A"
LONGEST = 14  # letters of a name that are shown
SHOWN = 1.25  # times as large on a page
MARK = 8.0  # radius of a mark
_STEPS = (0, 1, -1, 2, -2, 3, -3)  # where a mark may be beside its place, in diameters along its tendon or link

Point = tuple[float, float]


@dataclass(frozen=True)
class Mark:
    """A text at a place."""

    text: str
    joint: int | None  # numbers from 1; without a tendon it is at the joint, without a joint at the tendon's motor
    tendon: int | None
    edge: bool = False  # whether it is at the tendon's edge before the joint


def finger_svg(drawing: FingerDrawing, marks: Iterable[Mark] = ()) -> Markup:
    """Return a finger as an SVG element."""
    place = _Places(drawing)
    outline = [(x, low) for x, low, _ in drawing.outline] + [(x, high) for x, _, high in drawing.outline[::-1]]
    text = html_template("finger_svg.html.jinja").render(
        width=round(place.width),
        height=round(place.height),
        shown=(round(SHOWN * place.width), round(SHOWN * place.height)),
        outline=place.path(outline),
        links=[(*place.at((begin, 0.0)), *place.at((end, 0.0))) for begin, end in drawing.links],
        joints=[
            (*place.at((joint.x, 0.0)), ACROSS * joint.radius, place.row(k), _short(joint.name), joint.name)
            for k, joint in enumerate(drawing.joints)
        ],
        tendons=[_tendon_marks(place, tendon, i) for i, tendon in enumerate(drawing.tendons)],
        names_end=place.left - 6.0,
        marks=list(place.marks(marks)),
        radius=MARK,
        red=EDGE_RED,
    )
    return Markup(text)


def keys_of(drawing: FingerDrawing) -> Iterator[tuple[str, str, str]]:
    """Yield the marks of a finger: CSS class, colour, meaning."""
    tendons = drawing.tendons
    yield "square", GREY, "end of a tendon"
    if any(len(tendon.pulleys) for tendon in tendons):
        yield "ring", GREY, "pulley with friction"
    if any(len(tendon.edges) for tendon in tendons):
        yield "ring", EDGE_RED, "edge with friction"
    if any(len(tendon.varying_edges) for tendon in tendons):
        yield "dot", EDGE_RED, "edge whose friction varies with the angle"
    if any(tendon.bidirectional for tendon in tendons):
        yield "dashed", GREY, "cable loop"


def finger_html(lines: Sequence[str], data: Data) -> str:
    """Return a finger and its properties as an HTML element."""
    rows = [(name.rstrip(), value.strip()) for name, _, value in (line.partition("  ") for line in lines[1:])]
    return html_template("finger.html.jinja").render(
        title=lines[0], rows=rows, drawing=finger_svg(finger_drawing(data))
    )


def _short(name: str) -> str:
    name = name.replace("_", " ")
    return name if len(name) <= LONGEST else f"{name[: LONGEST - 1]}…"


def _colour(tendon: int) -> str:
    return TENDON_COLOURS[tendon % len(TENDON_COLOURS)]


def _tendon_marks(place: _Places, tendon: DrawnTendon, index: int) -> dict[str, object]:
    return {
        "name": tendon.name,
        "short": _short(tendon.name),
        "y": place.at(tendon.spring[0])[1],
        "colour": _colour(index),
        "spring": place.path(tendon.spring),
        "line": place.path(tendon.line),
        "end": place.at(tendon.line[-1]),
        "dashed": tendon.bidirectional,
        "pulleys": [place.at(point) for point in tendon.pulleys],
        "edges": [(*place.at(point), "none") for point in tendon.edges]
        + [(*place.at(point), EDGE_RED) for point in tendon.varying_edges],
    }


class _Places:
    """Places of a drawing in pixels from the top left."""

    def __init__(self, drawing: FingerDrawing) -> None:
        self._drawing = drawing
        longest = max(len(_short(tendon.name)) for tendon in drawing.tendons)
        self.left = LETTER * longest + 12.0
        self.width = self.left + ALONG * (drawing.right - drawing.left) + 2.0
        names = sorted(LETTER * len(_short(joint.name)) for joint in drawing.joints)
        spacing = ALONG * float(drawing.links[0, 1] - drawing.links[0, 0])
        self._rows = 2 if len(names) > 1 and sum(names[-2:]) / 2.0 > spacing else 1  # of the names of joints
        self.height = ROW * self._rows + 6.0 + 2.0 * ACROSS * drawing.height

    def row(self, joint: int) -> float:
        """Return the line of a joint's name: every other name stands higher where one row is too narrow."""
        return ROW * (1 + (self._rows - 1) * (joint % 2)) - 2.0

    def at(self, point: Sequence[float]) -> Point:
        x, y = (float(value) for value in point)
        drawing = self._drawing
        return (round(self.left + ALONG * (x - drawing.left), 1), round(self.height - ACROSS * (drawing.height + y), 1))

    def path(self, points: Iterable[Sequence[float]]) -> str:
        return " ".join("{:g},{:g}".format(*self.at(point)) for point in points if np.isfinite(point).all())

    def marks(self, marks: Iterable[Mark]) -> Iterator[tuple[float, float, str, str]]:
        """Yield (x, y, text, colour): all texts of a place in one mark, and none over another where there is room."""
        texts: dict[tuple[int | None, int | None, bool], list[str]] = {}
        for mark in marks:
            texts.setdefault((mark.joint, mark.tendon, mark.edge), []).append(mark.text)
        taken: list[Point] = []
        for (joint, tendon, edge), shown in texts.items():
            beside = [self._beside(joint, tendon, edge, step) for step in _STEPS]
            taken.append(
                max(beside, key=lambda point: min([2.1 * MARK, *(math.dist(point, other) for other in taken)]))
            )
            colour = "" if tendon is None else _colour(tendon - 1)
            yield (*taken[-1], ", ".join(dict.fromkeys(shown)), colour)

    def _beside(self, joint: int | None, tendon: int | None, edge: bool, step: int) -> Point:
        """Return where a mark is that is moved by `step` diameters along its tendon or link."""
        drawing, away = self._drawing, 2.1 * MARK / ALONG * step
        x = drawing.tendons[0].line[0, 0] if joint is None else drawing.joints[joint - 1].x
        if tendon is None:
            return self.at((x + 0.8 + away, 0.0))
        line = drawing.tendons[tendon - 1].line
        x += away - (EDGE_BEFORE if edge else 0.0) + (abs(away) - away if joint is None else 0.0)
        return self.at((x, float(np.interp(x, line[:, 0], line[:, 1]))))
