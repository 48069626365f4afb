"""What the page of a diagnosis, `diagnosis.html`, shows."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from tendonfmu.diagnosis import (
    Cause,
    DetectionGain,
    Diagnosis,
    reported_causes,
    size_at,
    thresholds,
)
from tendonfmu.files import counted, whole_file
from tendonfmu.report.diagnosis_figures import diagnosis_sheets
from tendonfmu.report.diagnosis_numbers import left_of, percent, percent_interval, probability, together, unit_of
from tendonfmu.report.diagnosis_text import (
    Names,
    at_place,
    change_rows,
    confusion_sentence,
    error_rows,
    error_sentence,
    headline,
    hidden,
    hidden_sentences,
    left_sentence,
    meaning_of_gain,
    names_of,
    next_sentence,
    parameter_rows,
    place_rows,
    tested_sentence,
    title_of,
    too_small_sentence,
    unseen,
)
from tendonfmu.report.diagnosis_waterfall import waterfall_of
from tendonfmu.report.diagnosis_words import words_of
from tendonfmu.report.fit_summary import rounded
from tendonfmu.report.page import Tile, render

PAGE = "diagnosis.html"
_MOST = 4  # pairs listed at most
_LONG = 90  # characters; a longer size is set as a sentence
_TONES = {"adequate": "good", "explained": "good", "partly explained": "", "unexplained": "bad"}


def write_diagnosis_page(found: Diagnosis, folder: Path) -> dict[Path, str]:
    """Write `diagnosis.html` to an existing folder, whole or not at all."""
    page = folder / PAGE
    text = diagnosis_page(found)
    with whole_file(page) as partial:
        partial.write_text(text, encoding="utf-8")
    return {page: "all results, to be read in a browser"}


def diagnosis_page(found: Diagnosis) -> str:
    """Return the HTML text of the page of a diagnosis."""
    names, (factor, unit) = names_of(found), unit_of(found)
    return render(
        "diagnosis.html.jinja",
        diagnosis_sheets(found),
        found=found,
        words=words_of(found.kind),
        unit=unit,
        first=_first_screen(found, names),
        fall=waterfall_of(found, names),
        cards=cards_of(found, names),
        too_small=_too_small(found, names),
        errors=_errors(found, names, factor),
        events=_events(found, names, factor),
        detection=None if found.detection is None else _detection(found.detection, factor, unit),
        method=list(_method(found)),
        invisible=[
            (
                each.title,
                each.places or "everywhere",
                percent(each.share),
                "" if each.gain is None else percent(each.gain),
                each.experiment,
            )
            for each in hidden(found, names)
        ],
        recordings=list(_recordings(found)),
    )


# --- the first screen -------------------------------------------------------------------------------------------------


def _first_screen(found: Diagnosis, names: Names) -> dict[str, Any]:
    return {
        "tone": _TONES[found.verdict],
        "headline": headline(found),
        "error": error_sentence(found),
        "left": left_sentence(found),
        "tiles": list(_tiles(found)),
        "untold": list(_untold(found, names)),
        "next": next_sentence(found),
        "experiment": list(_experiment(found, names)),
    }


def _tiles(found: Diagnosis) -> Iterator[Tile]:
    words, (factor, unit) = words_of(found.kind), unit_of(found)
    before, after = (rounded(factor * together(each.test_rms)) for each in (found.nominal, found.extended))
    data = "held-out parts" if found.held_out else "unseen data"
    if found.causes:
        yield Tile(
            f"{before} → {after}",
            unit,
            f"error on {data}, all joints, with the {words.nominal} and the {words.extended}",
        )
        low, high = percent(found.gain.low).split("\u00a0")[0], percent(found.gain.high)
        yield Tile(percent(found.gain.value), "", f"less error, 95 % interval {low} to {high}")
    else:
        yield Tile(before, unit, f"error on {data}, all joints")
    if left := left_of(found):
        noise = "that nothing recorded predicts" if left.memory else "is noise: nothing recorded predicts it"
        yield Tile(left.told(left.noise), unit, f"of what is left {noise}")
        if left.nameless > 0.0:
            yield Tile(left.told(left.nameless), unit, f"of what is left {words.no_name}")


def _untold(found: Diagnosis, names: Names) -> Iterator[str]:
    for k, cause in enumerate(found.causes, start=1):
        if text := confusion_sentence(cause, names):
            yield f"Cause {k}, {at_place(cause.title, cause.where, names)}: {text[0].lower()}{text[1:]}"
    yield from hidden_sentences(found, names)


def _experiment(found: Diagnosis, names: Names) -> Iterator[str]:
    plan = found.experiment
    for one, other in plan.separates[:_MOST]:
        first, second = (at_place(title_of(each.effect), each, names) for each in (one, other))
        yield f"Distinguishes: {first}; from {second}."
    if len(plan.separates) > _MOST:
        yield f"And {counted(len(plan.separates) - _MOST, 'more pair')}."
    if plan.makes_visible:
        titles = dict.fromkeys(title_of(where.effect) for where in plan.makes_visible)
        yield f"Makes visible: {'; '.join(titles)}."
    if plan.distance > 0:
        yield f"Each of them then stands out by {plan.distance:.2g} times the noise or more."


# --- tables -----------------------------------------------------------------------------------------------------------


def cards_of(found: Diagnosis, names: Names) -> list[dict[str, Any]]:
    """Return what a page shows of each cause."""
    return [_card(found, cause, names) for cause in reported_causes(found)]


def _card(found: Diagnosis, cause: Cause, names: Names) -> dict[str, Any]:
    """Return what a page shows of one cause."""
    certainty = f"p = {probability(cause.p_value)}".replace("= <", "<")
    # the tiles and the waterfall show r itself
    numbers = thresholds(found.extended_data)
    sizes = [size_at(cause.where.effect, each.parameters, numbers) for each in cause.places]
    return {
        "title": _capital(cause.title),
        "full": at_place(_capital(cause.title), cause.where, names),
        "place": _capital(names.places(cause)),
        "size": cause.size,
        "long": len(cause.size) > _LONG,
        "gain": f"{percent_interval(cause.gain)} {meaning_of_gain(found, cause)}",
        "certainty": certainty,
        "explanation": cause.explanation,
        "confusion": confusion_sentence(cause, names),
        "places": place_rows(cause, names, sizes) if cause.parameters else [],
        "parameters": parameter_rows(cause.parameters),
        "sizes": change_rows(cause, found.recordings),
    }


def _too_small(found: Diagnosis, names: Names) -> dict[str, Any]:
    return {
        "sentence": too_small_sentence(found),
        "rows": [
            (_capital(cause.title), names.places(cause), percent_interval(cause.gain), probability(cause.p_value))
            for cause in found.too_small
        ],
    }


def _errors(found: Diagnosis, names: Names, factor: float) -> list[dict[str, Any]]:
    """List the errors: a row per joint, then one for all joints; rms values first, then the lag-one correlations."""
    rows = []
    for j, row in enumerate(error_rows(found, names, factor)):
        total = j == len(found.nominal.train_rms)
        known = j < len(found.whiteness) and not total
        white = [rounded(value, 2) for value in found.whiteness[j]] if known else ["", ""]
        rows.append({"total": total, "cells": [*row, *white]})
    return rows


def _events(found: Diagnosis, names: Names, factor: float) -> list[tuple[str, ...]]:
    """List the events as (recording, from, to, joints, peak, what)."""
    return [
        (
            event.recording,
            f"{event.start:.2f}",
            f"{event.end:.2f}",
            ", ".join(names.joint(joint) for joint in event.joints),
            rounded(factor * event.peak),
            event.description,
        )
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


def _recordings(found: Diagnosis) -> Iterator[tuple[str, str]]:
    """List the recordings as (name, what it was used for)."""
    now = "now, " if found.kind == "change" else ""
    training = "training, parts held out" if found.held_out else "training"
    yield from ((name, "reference") for name in found.references)
    yield from ((name, now + training) for name in found.recordings)
    yield from ((name, "test") for name in found.tests)


def _method(found: Diagnosis) -> Iterator[str]:
    """Describe the method and its main numbers in sentences."""
    yield words_of(found.kind).method.format(least=percent(found.least_gain))
    yield f"The numbers were estimated from {found.signals}; errors and gains are those of the raw signals."
    if text := tested_sentence(found):
        yield text
    if found.repeated:
        yield f"{counted(found.repeated, 'motion')} of the reference, made again, were compared sample by sample."
    yield f"The gain was measured on {unseen(found)}, by running both models. Seed {found.seed}."


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
