"""A drawing of the finger with marks, its keys and its caption: causes of a diagnosis, or friction by place."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup

from tendonfmu.arrays import Data
from tendonfmu.diagnosis import Cause, Diagnosis, reported_causes
from tendonfmu.drawing import GREY
from tendonfmu.files import are, counted, listed
from tendonfmu.model import EDGE_RED, Effect, FingerDrawing, Mark, effects, finger_drawing, finger_svg
from tendonfmu.report.diagnosis_words import words_of
from tendonfmu.report.numbers import capital, rounded

MOST_MARKS = 8  # of one cause; one at more places is only in the caption
MOST_PLACES = 12  # whose friction is written on the drawing


@dataclass(frozen=True)
class FingerFigure:
    """A finger with marks."""

    drawing: Markup  # SVG
    keys: list[tuple[str, str, str]]  # (CSS class, colour, meaning) of the marks that are in the drawing
    caption: str


def finger_figure(diagnosis: Diagnosis) -> FingerFigure:
    """Draw the finger of a diagnosis; the numbers are those of the list of causes."""
    causes = list(enumerate(reported_causes(diagnosis), start=1))
    marks = [mark for number, cause in causes for mark in _marks(number, cause)]
    drawing = finger_drawing(diagnosis.nominal_data)
    return FingerFigure(finger_svg(drawing, marks), list(keys_of(drawing)), " ".join(_sentences(diagnosis, causes)))


def _sentences(diagnosis: Diagnosis, causes: Sequence[tuple[int, Cause]]) -> Iterator[str]:
    """Yield the caption: what the numbers are, and where the causes are that have no mark."""
    one = words_of(diagnosis.kind).one
    yield "The base is on the left."
    if any(_is_marked(cause) for _, cause in causes):
        yield f"Each filled number is a {one} in the list below."
    elsewhere: dict[str, list[str]] = {}
    for number, cause in causes:
        if not _is_marked(cause):
            elsewhere.setdefault(_elsewhere(cause), []).append(str(number))
    for place, numbers in elsewhere.items():
        several = "s" if len(numbers) > 1 else ""
        yield f"{capital(one)}{several} {listed(numbers)} {are(len(numbers))} {place}."


def _places(cause: Cause) -> list[tuple[int | None, int | None]]:
    places = [(place.joint, place.tendon) for place in cause.places] or [(cause.where.joint, cause.where.tendon)]
    return [place for place in places if place != (None, None)]


def _is_marked(cause: Cause) -> bool:
    return 0 < len(_places(cause)) <= MOST_MARKS


def _marks(number: int, cause: Cause) -> Iterator[Mark]:
    if _is_marked(cause):
        edge = cause.where.effect == "edge_friction"
        yield from (Mark(str(number), joint, tendon, edge) for joint, tendon in _places(cause))


def _elsewhere(cause: Cause) -> str:
    count = len(_places(cause))
    return f"at {counted(count, 'place')}, which the list names" if count else "everywhere"


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


def friction_figure(data: Data) -> FingerFigure:
    """Draw the finger with its largest friction by place."""
    places: list[tuple[float, Mark]] = []
    for effect in effects(data):
        size = max(_level(law) for law in effect.laws)
        if effect.kind == "friction":
            places.append((np.inf, Mark(rounded(1e3 * size, 2), effect.joint, None)))
        elif effect.tendon:
            places.append((size, _mark(effect, size)))
    drawing = finger_drawing(data)
    largest = sorted((place for place in places if place[0] > 0.0), key=lambda place: -place[0])[:MOST_PLACES]
    fewer = " Only the largest are shown." if len(places) > MOST_PLACES else ""
    caption = (
        "Coulomb friction: of a joint in mN·m, of a pulley or an edge in % of the tendon force. The base is on the "
        f"left.{fewer}"
    )
    return FingerFigure(finger_svg(drawing, [mark for _, mark in largest]), list(keys_of(drawing)), caption)


def _mark(effect: Effect, size: float) -> Mark:
    return Mark(f"{rounded(100.0 * size, 2)} %", effect.joint, effect.tendon, effect.kind == "edge_friction")


def _level(law: Data) -> float:
    """Return the Coulomb friction of a law, the larger of its two sides."""
    sides = [law[side] for side in ("positive", "negative") if side in law] or [law]
    return max(float(side.get("coulomb", 0.0)) for side in sides)
