"""Draws the routing of a finger as SVG, with numbered marks at places: for pages and notebooks.

Lengths are CSS pixels. A page sets the colours of its paper and ink; without them the drawing is for light paper.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup

from tendonfmu.arrays import Data
from tendonfmu.files import html_template
from tendonfmu.model.routing_geometry import (
    EDGE_BEFORE,
    EDGE_RED,
    TENDON_COLOURS,
    DrawnTendon,
    FingerDrawing,
    finger_drawing,
)

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
        tendons=[_tendon(place, tendon, i) for i, tendon in enumerate(drawing.tendons)],
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


def _tendon(place: _Places, tendon: DrawnTendon, index: int) -> dict[str, object]:
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
        return (
            round(self.left + ALONG * (x - drawing.left), 1),
            round(self.height - ACROSS * (drawing.height + y), 1),
        )

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
