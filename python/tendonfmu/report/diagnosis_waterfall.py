"""How much error each cause takes away: rows from the error of the nominal model to what is left."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from tendonfmu.diagnosis import Diagnosis
from tendonfmu.report.diagnosis_numbers import left_of, unit_of
from tendonfmu.report.diagnosis_text import Names, at_place
from tendonfmu.report.diagnosis_words import words_of
from tendonfmu.report.fit_summary import rounded


@dataclass(frozen=True)
class Part:
    """Part of a bar."""

    tone: str  # "nominal", "cause", "more", "noise" or "nameless"
    start: float  # per cent of the widest bar
    width: float


@dataclass(frozen=True)
class Row:
    """Row of a waterfall."""

    label: str  # what the row shows, in plain words, with its place
    value: str  # length of the bar as text, with a sign where it is taken away
    parts: tuple[Part, ...]  # parts of the bar


@dataclass(frozen=True)
class Waterfall:
    """What each cause takes away from the error."""

    unit: str  # unit of the values
    rows: tuple[Row, ...]  # from the error of the nominal model to what is left
    floor: float | None  # position of the noise floor, per cent of the widest bar; None if unknown
    nameless: str  # legend of the parts with the tone "nameless"
    taken: str  # legend of the parts with the tone "cause"


def waterfall_of(found: Diagnosis, names: Names) -> Waterfall:
    """Return the waterfall of a diagnosis."""
    factor, unit = unit_of(found)
    steps = [factor * each for each in found.steps]
    widest = max([each for each in steps if math.isfinite(each)], default=0.0) or 1.0
    noise = _noise(found, steps[-1])
    floor = None if noise is None else 100.0 * noise / widest
    words = words_of(found.kind)
    return Waterfall(unit, tuple(_rows(found, names, steps, widest)), floor, words.left, words.taken)


def _rows(found: Diagnosis, names: Names, steps: list[float], widest: float) -> Iterator[Row]:
    digits = len(rounded(widest).partition(".")[2])
    shown = [round(each, digits) for each in steps]

    def part(tone: str, begin: float, end: float) -> Part:
        low, high = sorted((100.0 * begin / widest, 100.0 * end / widest))
        return Part(tone, round(low, 2), round(high - low, 2))

    if found.causes:
        yield Row(
            f"error of the {words_of(found.kind).nominal}", f"{shown[0]:.{digits}f}", (part("nominal", 0.0, steps[0]),)
        )
    for k, cause in enumerate(found.causes):
        change = shown[k + 1] - shown[k]
        tone, sign = ("cause", "−") if change <= 0 else ("more", "+")
        label = f"{k + 1}. {at_place(cause.title, cause.where, names)}"
        yield Row(label, f"{sign}{abs(change):.{digits}f}", (part(tone, steps[k], steps[k + 1]),))
    noise = _noise(found, steps[-1])
    parts: tuple[Part, ...] = (part("nominal", 0.0, steps[-1]),)
    if noise is not None:
        parts = (part("noise", 0.0, noise), part("nameless", noise, steps[-1]))
    label = "what is left" if found.causes else "error of the model"
    yield Row(label, f"{shown[-1]:.{digits}f}", parts)


def _noise(found: Diagnosis, last: float) -> float | None:
    """Return the noise part of the last step; all of it where the remainder would round to 0."""
    left = left_of(found)
    if left is None:
        return None
    return min(left.noise, last) if left.nameless > 0.0 else last
