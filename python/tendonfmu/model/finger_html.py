"""How a finger shows itself in a notebook: its properties, and a small picture of its routing."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from tendonfmu.files import html_template
from tendonfmu.model.routing_geometry import FingerDrawing, Points

# px per unit of the drawing, and the colours of the tendons in their order
_SCALE = 26.0
_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#5A5A5A", "#332288", "#999933")


def finger_html(lines: Sequence[str], drawing: FingerDrawing) -> str:
    """Return a finger as an HTML element."""
    rows = [(name.rstrip(), value) for name, _, value in (line.partition("  ") for line in lines[1:])]
    tendons = [
        {
            "name": tendon.name,
            "colour": _COLOURS[i % len(_COLOURS)],
            "line": _path(drawing, (*tendon.spring[:1], *tendon.line)),
            "dashed": tendon.bidirectional,
            "marks": [*_marks(drawing, tendon.pulleys, "white"), *_marks(drawing, tendon.edges, "#CC1F1A")],
        }
        for i, tendon in enumerate(drawing.tendons)
    ]
    joints = [(*_at(drawing, (joint.x, 0.0)), _SCALE * joint.radius, joint.name) for joint in drawing.joints]
    outline = [(x, low) for x, low, _ in drawing.outline] + [(x, high) for x, _, high in drawing.outline[::-1]]
    return html_template("finger.html.jinja").render(
        title=lines[0],
        rows=[(name, value.strip()) for name, value in rows],
        width=round(_SCALE * (drawing.right - drawing.left)),
        height=round(2 * _SCALE * drawing.height),
        outline=_path(drawing, outline),
        joints=joints,
        tendons=tendons,
    )


def _at(drawing: FingerDrawing, point: Sequence[float]) -> tuple[float, float]:
    """Return a point in px from the top left."""
    return round(_SCALE * (point[0] - drawing.left), 1), round(_SCALE * (drawing.height - point[1]), 1)


def _path(drawing: FingerDrawing, points: Iterable[Sequence[float]]) -> str:
    return " ".join("{:g},{:g}".format(*_at(drawing, point)) for point in points if np.isfinite(point).all())


def _marks(drawing: FingerDrawing, points: Points, colour: str) -> list[tuple[float, float, str]]:
    return [(*_at(drawing, point), colour) for point in points]
