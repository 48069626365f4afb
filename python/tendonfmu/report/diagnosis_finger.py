"""Where the causes of a diagnosis sit: marks on a drawing of the finger, its keys and its caption."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from markupsafe import Markup

from tendonfmu.diagnosis import Cause, Diagnosis, reported_causes
from tendonfmu.drawing import GREY
from tendonfmu.files import are, counted, listed
from tendonfmu.model import EDGE_RED, FingerDrawing, Mark, finger_drawing, finger_svg
from tendonfmu.report.diagnosis_words import words_of
from tendonfmu.report.numbers import capital

MOST_MARKS = 8  # of one cause; one at more places is only in the caption


@dataclass(frozen=True)
class FingerFigure:
    """The finger with its causes."""

    drawing: Markup  # SVG
    keys: list[tuple[str, str, str]]  # (CSS class, colour, meaning) of the marks that are in the drawing
    caption: str


def finger_figure(diagnosis: Diagnosis) -> FingerFigure:
    """Draw the finger of a diagnosis; the numbers are those of the list of causes."""
    causes = list(enumerate(reported_causes(diagnosis), start=1))
    marks = [mark for number, cause in causes for mark in _marks(number, cause)]
    drawing = finger_drawing(diagnosis.nominal_data)
    return FingerFigure(finger_svg(drawing, marks), list(_keys(drawing)), " ".join(_sentences(diagnosis, causes)))


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


def _keys(drawing: FingerDrawing) -> Iterator[tuple[str, str, str]]:
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
