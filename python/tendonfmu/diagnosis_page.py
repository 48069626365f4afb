"""The page of a diagnosis: its figures as PNG files, and one HTML file with all of them in it that needs nothing else.

Without scripts and without anything from elsewhere; every text is escaped.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tendonfmu.diagnosis_figures import diagnosis_sheets
from tendonfmu.diagnosis_result import Cause, DetectionGain, Diagnosis
from tendonfmu.diagnosis_text import (
    Names,
    at_place,
    by_source,
    confusion_sentence,
    count_of,
    error_rows,
    error_sentence,
    headline,
    hidden_sentences,
    names_of,
    next_sentence,
    parameter_rows,
    percent,
    percent_interval,
    probability,
    tested_sentence,
    title_of,
    together,
    unexplained_sentence,
    unit_of,
    unseen,
)
from tendonfmu.fit_page import PageFigure, draw_sheet, render
from tendonfmu.fit_summary import rounded
from tendonfmu.whole_file import whole_file

PAGE = "diagnosis.html"
_MOST = 4  # pairs that are listed
_TONES = {"adequate": "good", "explained": "good", "partly explained": "", "unexplained": "bad"}


@dataclass(frozen=True)
class Tile:
    """A figure that matters, and what it is."""

    value: str
    unit: str
    meaning: str


def write_diagnosis_page(found: Diagnosis, folder: Path) -> dict[Path, str]:
    """Writes one PNG per sheet and `diagnosis.html` into a folder that exists.

    Returns file -> what is in it. Files appear whole or not at all. Raises InputError where they cannot be written.
    """
    figures, written = [], {}
    for sheet in diagnosis_sheets(found):
        file = folder / f"{sheet.name}.png"
        figures.append(draw_sheet(sheet, file))
        written[file] = sheet.title
    page = folder / PAGE
    text = diagnosis_page(found, figures)
    with whole_file(page) as partial:
        partial.write_text(text, encoding="utf-8")
    return {page: "all of it, to be read in a browser"} | written


def diagnosis_page(found: Diagnosis, figures: Sequence[PageFigure]) -> str:
    """HTML text of the page."""
    names, (factor, unit) = names_of(found), unit_of(found)
    by_section: dict[str, list[PageFigure]] = {}
    for figure in figures:
        by_section.setdefault(figure.sheet.section, []).append(figure)
    return render(
        "diagnosis.html.jinja",
        found=found,
        unit=unit,
        first=_first_screen(found, names),
        cards=cards_of(found, names),
        errors=_errors(found, names, factor),
        events=_events(found, names, factor),
        detection=None if found.detection is None else _detection(found.detection, factor, unit),
        method=list(_method(found)),
        invisible=[
            (each.title, names.place(each.where) or "everywhere", percent(each.surviving_share), each.experiment)
            for each in found.invisible
        ],
        figures=by_section,
    )


# --- the first screen -------------------------------------------------------------------------------------------------


def _first_screen(found: Diagnosis, names: Names) -> dict[str, Any]:
    return {
        "tone": _TONES[found.verdict],
        "headline": headline(found),
        "error": error_sentence(found),
        "tiles": list(_tiles(found)),
        "untold": list(_untold(found, names)),
        "next": next_sentence(found),
        "experiment": list(_experiment(found, names)),
        "floor": by_source(found.floor_source),
    }


def _tiles(found: Diagnosis) -> Iterator[Tile]:
    factor, unit = unit_of(found)
    before, after = (rounded(factor * together(each.test_rms)) for each in (found.nominal, found.extended))
    data = "held-out parts" if found.held_out else "unseen data"
    if found.causes:
        yield Tile(f"{before} → {after}", unit, f"error on {data}, all joints, with the nominal and the extended model")
        low, high = percent(found.gain.low).split("\u00a0")[0], percent(found.gain.high)
        yield Tile(percent(found.gain.value), "", f"less error, 95 % interval {low} to {high}")
    else:
        yield Tile(before, unit, f"error on {data}, all joints")
    floor = together(found.noise_floor)
    if math.isfinite(floor):
        yield Tile(rounded(factor * floor), unit, f"noise floor, by {by_source(found.floor_source)}")
    if math.isfinite(found.unexplained.share):
        meaning = "of the residual's variance above the noise is explained by nothing"
        yield Tile(percent(found.unexplained.share), "", meaning)


def _untold(found: Diagnosis, names: Names) -> Iterator[str]:
    for k, cause in enumerate(found.causes, start=1):
        if text := confusion_sentence(cause, names):
            yield f"Cause {k}, {at_place(cause.title, cause.where, names)}: {text[0].lower()}{text[1:]}"
    if text := unexplained_sentence(found):
        yield text
    yield from hidden_sentences(found, names)


def _experiment(found: Diagnosis, names: Names) -> Iterator[str]:
    plan = found.experiment
    for one, other in plan.separates[:_MOST]:
        first, second = (at_place(title_of(each.effect), each, names) for each in (one, other))
        yield f"Tells apart: {first}; and {second}."
    if len(plan.separates) > _MOST:
        yield f"And {count_of(len(plan.separates) - _MOST, 'more pair')}."
    if plan.makes_visible:
        titles = dict.fromkeys(title_of(where.effect) for where in plan.makes_visible)
        yield f"Makes visible: {'; '.join(titles)}."
    if plan.distance > 0:
        yield f"Each of them then stands out by {plan.distance:.2g} times the noise or more."


# --- tables -----------------------------------------------------------------------------------------------------------


def cards_of(found: Diagnosis, names: Names) -> list[dict[str, Any]]:
    """What a page tells of each cause."""
    return [_card(cause, names) for cause in found.causes]


def _card(cause: Cause, names: Names) -> dict[str, Any]:
    rows = [
        ("less error on unseen data by this cause, the others kept", percent_interval(cause.gain)),
        ("part of the nominal residual's variance", percent(cause.share)),
        ("p-value, over all effects and places", probability(cause.p_value)),
    ]
    if cause.first_gain is not None:
        rows.insert(1, ("the same alone, against the nominal model", percent_interval(cause.first_gain)))
    certainty = f"p = {probability(cause.p_value)}".replace("= <", "<")
    if cause.confusable_with:
        certainty += f"; {count_of(len(cause.confusable_with), 'other')} would look the same in these data"
    return {
        "title": _capital(cause.title),
        "full": at_place(_capital(cause.title), cause.where, names),
        "place": _capital(names.place(cause.where) or "the whole finger"),
        "size": cause.size,
        "gain": f"{percent_interval(cause.gain)} less error on unseen data",
        "certainty": certainty,
        "explanation": cause.explanation,
        "confusion": confusion_sentence(cause, names),
        "rows": rows,
        "parameters": parameter_rows(cause.parameters),
    }


def _errors(found: Diagnosis, names: Names, factor: float) -> list[dict[str, Any]]:
    """A row per joint, and one of all together: rms, then the predictable share and the whiteness."""
    rows = []
    for j, row in enumerate(error_rows(found, names, factor)):
        total = j == len(found.nominal.train_rms)
        ceiling = percent(max(found.ceiling[j], 0.0)) if j < len(found.ceiling) and not total else ""
        white = (
            [rounded(value, 2) for value in found.whiteness[j]] if j < len(found.whiteness) and not total else ["", ""]
        )
        rows.append({"total": total, "cells": [*row, ceiling, *white]})
    return rows


def _events(found: Diagnosis, names: Names, factor: float) -> list[dict[str, str]]:
    return [
        {
            "recording": event.recording,
            "start": f"{event.start:.2f}",
            "end": f"{event.end:.2f}",
            "joints": ", ".join(names.joint(joint) for joint in event.joints),
            "peak": rounded(factor * event.peak),
            "description": event.description,
        }
        for event in found.events
    ]


def _detection(found: DetectionGain, factor: float, unit: str) -> dict[str, Any]:
    def seconds(value: float | None) -> str:
        return "–" if value is None else f"{1e3 * value:.0f} ms"

    def levels(values: Sequence[float]) -> str:
        return ", ".join(rounded(factor * value) for value in values)

    return {
        "events": found.events,
        "rows": [
            ("found", found.found_before, found.found_after),
            ("false alarms", found.false_alarms_before, found.false_alarms_after),
            ("median delay", seconds(found.median_delay_before), seconds(found.median_delay_after)),
            (f"thresholds ({unit})", levels(found.thresholds_before), levels(found.thresholds_after)),
        ],
    }


def _method(found: Diagnosis) -> Iterator[str]:
    """In sentences, with the numbers that count."""
    yield (
        "The given model was fitted first; a cause is what that cannot mend. Every effect, at every place where the "
        "model lacks it, was then tested on the whitened residual, and named by what it gains on held-out data."
    )
    if text := tested_sentence(found):
        yield text
    yield f"The gain was measured on {unseen(found)}, by running both models. Seed {found.seed}."


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
