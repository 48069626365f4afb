"""What the page of a diagnosis, `diagnosis.html`, shows."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

from tendonfmu.diagnosis import (
    Cause,
    DetectionGain,
    Diagnosis,
    Names,
    at_place,
    reported_causes,
    size_at,
    title_of,
)
from tendonfmu.files import counted
from tendonfmu.report import diagnosis_text as texts
from tendonfmu.report.diagnosis_figures import diagnosis_sheets
from tendonfmu.report.finger_figures import finger_figure
from tendonfmu.report.kit import (
    Row,
    Tile,
    capital,
    decimals,
    magnitude,
    percent,
    percent_interval,
    probability,
    render,
    rounded,
    together,
    words_of,
)

PAGE = "diagnosis.html"
_MOST = 4  # pairs listed at most
_LONG = 90  # characters; a longer size is set as a sentence
_TONES = {"adequate": "good", "explained": "good", "partly explained": "", "unexplained": "bad"}


def diagnosis_page(diagnosis: Diagnosis) -> str:
    """Return the HTML text of the page of a diagnosis."""
    names, (factor, unit) = texts.names_of(diagnosis), texts.unit_of(diagnosis)
    return render(
        "diagnosis.html.jinja",
        diagnosis_sheets(diagnosis),
        diagnosis=diagnosis,
        words=words_of(diagnosis.kind),
        unit=unit,
        first=_first_screen(diagnosis, names),
        finger=finger_figure(diagnosis),
        fall=waterfall_of(diagnosis, names),
        cards=[_card(diagnosis, cause, names) for cause in reported_causes(diagnosis)],
        too_small=_too_small(diagnosis, names),
        uncertain=[
            (capital(cause.title), names.places(cause), percent_interval(cause.gain), capital(cause.experiment))
            for cause in diagnosis.undecided
        ],
        errors=_errors(diagnosis, names, factor),
        events=_events(diagnosis, names, factor),
        detection=None if diagnosis.detection is None else _detection(diagnosis.detection, factor, unit),
        method=list(_method(diagnosis)),
        invisible=[
            (
                effect.title,
                effect.places or "everywhere",
                percent(effect.share),
                "" if effect.gain is None else percent(effect.gain),
                effect.experiment,
            )
            for effect in texts.hidden(diagnosis, names)
        ],
        recordings=list(_recordings(diagnosis)),
    )


# --- the first screen -------------------------------------------------------------------------------------------------


def _first_screen(diagnosis: Diagnosis, names: Names) -> dict[str, Any]:
    is_open = any(map(texts.has_rivals, diagnosis.causes)) or texts.mostly_left(diagnosis)
    return {
        "tone": "" if is_open else _TONES[diagnosis.verdict],
        "headline": texts.headline(diagnosis),
        "error": texts.error_sentence(diagnosis),
        "left": texts.left_sentence(diagnosis),
        "tiles": list(_tiles(diagnosis)),
        "untold": list(_untold(diagnosis, names)),
        "next": texts.next_sentence(diagnosis),
        "experiment": list(_experiment(diagnosis, names)),
    }


def _tiles(diagnosis: Diagnosis) -> Iterator[Tile]:
    words, (factor, unit) = words_of(diagnosis.kind), texts.unit_of(diagnosis)
    before, after = (rounded(factor * together(model.test_rms)) for model in (diagnosis.nominal, diagnosis.extended))
    if diagnosis.torque_causes:
        yield Tile(
            f"{before} → {after}",
            unit,
            f"error on test data, all joints, with the {words.nominal} and the {words.extended}",
        )
        low, high = percent(diagnosis.gain.low).split("\u00a0")[0], percent(diagnosis.gain.high)
        yield Tile(percent(diagnosis.gain.value), "", f"less error, 95 % interval {low} to {high}")
    else:
        yield Tile(before, unit, "error on test data, all joints")
    if left := texts.left_of(diagnosis):
        known = f": what remains, without the part that {words.no_name}" if left.predictable > 0.0 else ""
        noise = "" if left.memory else "noise, "
        yield Tile(left.text(left.noise), unit, f"{noise}that no recorded signal predicts{known}")


def _untold(diagnosis: Diagnosis, names: Names) -> Iterator[str]:
    for k, cause in enumerate(diagnosis.causes, start=1):
        if text := texts.confusion_sentence(cause, names):
            yield f"Cause {k}, {at_place(cause.title, cause.where, names)}: {text[0].lower()}{text[1:]}"
    yield from texts.hidden_sentences(diagnosis, names)


def _experiment(diagnosis: Diagnosis, names: Names) -> Iterator[str]:
    plan = diagnosis.experiment
    for one, other in plan.separates[:_MOST]:
        first, second = (at_place(title_of(each.effect), each, names) for each in (one, other))
        yield f"It distinguishes: {first}; and {second}."
    if len(plan.separates) > _MOST:
        yield f"And {counted(len(plan.separates) - _MOST, 'more pair')}."
    if plan.makes_visible:
        titles = dict.fromkeys(title_of(where.effect) for where in plan.makes_visible)
        yield f"It shows: {'; '.join(titles)}."
    if plan.distance > 0:
        yield f"Each is expected to be at least {plan.distance:.2g} times as large as the noise."


# --- tables -----------------------------------------------------------------------------------------------------------


def _card(diagnosis: Diagnosis, cause: Cause, names: Names) -> dict[str, Any]:
    """Return what a page shows of one cause."""
    certainty = f"p = {probability(cause.p_value)}".replace("= <", "<")
    # the tiles and the waterfall show r itself
    sizes = [size_at(cause.where.effect, place.parameters, diagnosis.extended_data) for place in cause.places]
    return {
        "title": capital(cause.title),
        "full": at_place(capital(cause.title), cause.where, names),
        "place": capital(names.places(cause)),
        "size": cause.size,
        "long": len(cause.size) > _LONG,
        "gain": texts.gain_text(diagnosis, cause),
        "certainty": certainty,
        "explanation": cause.explanation,
        "confusion": texts.confusion_sentence(cause, names),
        "places": texts.place_rows(cause, names, sizes) if cause.parameters and not cause.sensors else [],
        "sensors": [sensor.words for sensor in cause.sensors],
        "parameters": [(path, magnitude(*number)) for path, number in cause.parameters.items()],
        "sizes": texts.change_rows(cause, diagnosis.recordings),
    }


def _too_small(diagnosis: Diagnosis, names: Names) -> dict[str, Any]:
    return {
        "sentence": texts.too_small_sentence(diagnosis),
        "rows": [
            (capital(cause.title), names.places(cause), percent_interval(cause.gain), probability(cause.p_value))
            for cause in diagnosis.too_small
        ],
    }


def _errors(diagnosis: Diagnosis, names: Names, factor: float) -> list[dict[str, Any]]:
    """List the errors: a row per joint, then one for all joints; rms values first, then the lag-one correlations."""
    rows = []
    for j, row in enumerate(texts.error_rows(diagnosis, names, factor)):
        total = j == len(diagnosis.nominal.train_rms)
        known = j < len(diagnosis.whiteness) and not total
        white = [rounded(value, 2) for value in diagnosis.whiteness[j]] if known else ["", ""]
        rows.append({"total": total, "cells": [*row, *white]})
    return rows


def _events(diagnosis: Diagnosis, names: Names, factor: float) -> list[Row]:
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
        for event in diagnosis.events
    ]


def _detection(gain: DetectionGain, factor: float, unit: str) -> dict[str, Any]:
    def seconds(value: float | None) -> str:
        return "–" if value is None else f"{1e3 * value:.0f} ms"

    def levels(values: Sequence[float]) -> str:
        return ", ".join(rounded(factor * value) for value in values)

    return {
        "events": gain.events,
        "rows": [
            ("found", gain.found_before, gain.found_after),
            ("false alarms", gain.false_alarms_before, gain.false_alarms_after),
            ("median delay", seconds(gain.median_delay_before), seconds(gain.median_delay_after)),
            (
                f"pushes found, 9 of 10, from ({unit})",
                levels(gain.smallest_push_before),
                levels(gain.smallest_push_after),
            ),
        ],
    }


def _recordings(diagnosis: Diagnosis) -> Iterator[tuple[str, str]]:
    """List the recordings as (name, what it was used for)."""
    now = "now, " if diagnosis.kind == "change" else ""
    training = "training, and parts of it for testing" if diagnosis.held_out else "training"
    yield from ((name, "reference") for name in diagnosis.references)
    yield from ((name, now + training) for name in diagnosis.recordings)
    yield from ((name, "test") for name in diagnosis.tests)


def _method(diagnosis: Diagnosis) -> Iterator[str]:
    """Describe the method and its main numbers in sentences."""
    yield words_of(diagnosis.kind).method.format(least=percent(diagnosis.least_gain))
    yield "Errors and gains are of means of 10 ms, less one constant a joint and recording: no bias learns."
    if text := texts.tested_sentence(diagnosis):
        yield text
    if diagnosis.repeated:
        yield f"{counted(diagnosis.repeated, 'motion')} of the reference, made again, were compared sample by sample."
    yield f"The gain was measured on {texts.unseen(diagnosis)}, by running both models there. Seed {diagnosis.seed}."


# --- how much error each cause takes away -----------------------------------------------------------------------------


class Part(NamedTuple):
    """Part of a bar."""

    tone: str  # "nominal", "cause", "more", "noise" or "predictable"
    start: float  # per cent of the widest bar
    width: float


class Step(NamedTuple):
    """Row of a waterfall."""

    label: str  # what the row shows, in plain words, with its place
    value: str  # length of the bar as text, with a sign where it is taken away
    parts: tuple[Part, ...]  # parts of the bar


class Waterfall(NamedTuple):
    """What each cause takes away from the error."""

    unit: str  # unit of the values
    rows: list[Step]  # from the error of the nominal model to what is left
    floor: float | None  # position of the noise floor, per cent of the widest bar; None if unknown
    predictable: str  # legend of the parts with the tone "predictable"
    taken: str  # legend of the parts with the tone "cause"


def waterfall_of(diagnosis: Diagnosis, names: Names) -> Waterfall:
    """Return the waterfall of a diagnosis."""
    (factor, unit), words, left = texts.unit_of(diagnosis), words_of(diagnosis.kind), texts.left_of(diagnosis)
    steps = [factor * step for step in diagnosis.steps]
    widest = max([step for step in steps if math.isfinite(step)], default=0.0) or 1.0
    digits = decimals(widest)
    shown = [round(step, digits) for step in steps]

    def part(tone: str, *ends: float) -> Part:
        low, high = sorted(100.0 * end / widest for end in ends)
        return Part(tone, round(low, 2), round(high - low, 2))

    rows = []
    if diagnosis.torque_causes:
        rows.append(Step(f"error of the {words.nominal}", f"{shown[0]:.{digits}f}", (part("nominal", 0.0, steps[0]),)))
    numbers = [k for k, cause in enumerate(diagnosis.causes, start=1) if cause.has_step]
    for k, (number, cause) in enumerate(zip(numbers, diagnosis.torque_causes, strict=True)):
        change = shown[k + 1] - shown[k]
        tone, sign = ("cause", "−") if change <= 0 else ("more", "+")
        label = f"{number}. {at_place(cause.title, cause.where, names)}"
        rows.append(Step(label, f"{sign}{abs(change):.{digits}f}", (part(tone, steps[k], steps[k + 1]),)))
    label = "what remains" if diagnosis.torque_causes else "error of the model"
    rest, floor = [part("nominal", 0.0, steps[-1])], None
    if left is not None:  # all of it is noise where the rest would round to 0
        noise = min(left.noise, steps[-1]) if left.predictable > 0.0 else steps[-1]
        rest, floor = [part("noise", 0.0, noise), part("predictable", noise, steps[-1])], 100.0 * noise / widest
    rows.append(Step(label, f"{shown[-1]:.{digits}f}", tuple(rest)))
    return Waterfall(unit, rows, floor, words.left, words.taken)
