"""The page of the demo: its chapters with their figures, in one self-contained HTML file."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from markupsafe import Markup

from tendonfmu.calibrate import DIAGNOSIS
from tendonfmu.calibrate import PAGE as CALIBRATION_PAGE
from tendonfmu.calibrate import text as calibration_text
from tendonfmu.demo.demo import CALIBRATION, FIT, TRAINING, TWO_JOINTS, UNSEEN, Story
from tendonfmu.demo.figures import story_sheets
from tendonfmu.demo.run import FLEXION, FREE, FREE_X4, MINUTES, PUSHES
from tendonfmu.demo.text import Table, alarms, chapter_tables, detection_sentence, fit_sentence
from tendonfmu.diagnosis import Diagnosis
from tendonfmu.files import whole_file
from tendonfmu.report import (
    Tile,
    at_place,
    cards_of,
    diagnosis_numbers,
    diagnosis_page,
    diagnosis_sheets,
    diagnosis_text,
    error_sentence,
    fit_page,
    left_sentence,
    names_of,
    render,
    residual_tables,
    rounded,
    unit_of,
    waterfall_of,
)

PAGE = "story.html"


def write_story(story: Story) -> None:
    """Write the page with all chapters of a finished story; the file appears whole or not at all."""
    file = story.folder / PAGE
    text = story_page(story)
    with whole_file(file) as partial:
        partial.write_text(text, encoding="utf-8")
    story.add_page(file)


def story_page(story: Story) -> str:
    """Return the HTML text of the page."""
    evidence = [] if story.missing else [each for each in diagnosis_sheets(story.diagnosis) if each.section != "views"]
    return render(
        "story.html.jinja",
        [*story_sheets(story), *evidence],
        chapters=story.chapters,
        tiles=[(each.name, _tile(story, each.name)) for each in story.chapters],
        tables={each.name: [_readable(table) for table in chapter_tables(story, each.name)] for each in story.chapters},
        calibrate=None if story.missing else _calibrate(story),
        detect=_detect(story),
        diagnosis=None if story.missing else _diagnosis(story),
        fit=None if story.missing else {"sentence": fit_sentence(story), "page": f"{FIT}/{fit_page.PAGE}"},
        run=_run(story),
        missing=story.missing,
        files=[(_link(path.relative_to(story.folder).as_posix()), what) for path, what in story.files.items()],
    )


def _readable(table: Table) -> Table:
    """Names without underscores."""
    title, headings, rows = table

    def spaced(cells: Sequence[str]) -> tuple[str, ...]:
        return tuple(each.replace("_", " ") for each in cells)

    return title.replace("_", " "), spaced(headings), [spaced(row) for row in rows]


def _link(name: str) -> Markup:
    return Markup('<a href="{0}">{0}</a>').format(name)


def _tile(story: Story, chapter: str) -> Tile:
    """Return the most important figure of a chapter."""
    results = story.finger.results
    if chapter == "calibrate":
        return Tile(*next(calibration_text.tiles(story.calibration.report)))
    if chapter == "run":
        joint = next(each for each in results[FREE].joints if each.name == FLEXION)
        left = f"{1e3 * joint.measured:.0f} → {1e3 * joint.left:.1f}"
        return Tile(left, "mN·m", "torque at the base of the finger, before and after its friction is subtracted")
    if chapter == "fit":
        unseen = list(residual_tables(story.fit.picture()))[-1]
        fitted = f"{rounded(unseen.all.start)} → {rounded(unseen.all.fitted)}"
        return Tile(fitted, unseen.unit, "error on an unseen recording, before and after friction is learned")
    if chapter == "detect":
        score = results[PUSHES].score
        found = f"{score.found} of {len(score.events)}"
        return Tile(
            found, "", f"pushes found, without a touch sensor, by a finger calibrated on {MINUTES} min of motion"
        )
    return _tile_of_cause(story.diagnosis)


def _tile_of_cause(found: Diagnosis) -> Tile:
    factor, unit = unit_of(found)
    before, after = (
        rounded(factor * diagnosis_numbers.together(each.test_rms)) for each in (found.nominal, found.extended)
    )
    if not found.causes:
        return Tile(before, unit, "error on an unseen recording; no cause was found")
    first = found.causes[0]
    cause = f"{at_place(first.title, first.where, names_of(found))}, found and built in"
    meaning = f"error on an unseen recording: {diagnosis_numbers.percent(found.gain.value)} less with {cause}"
    return Tile(f"{before} → {after}", unit, meaning)


def _calibrate(story: Story) -> dict[str, Any]:
    report = story.calibration.report
    tone, sentence = calibration_text.verdict(report)
    return {
        "command": f"tendonfmu calibrate {TWO_JOINTS} {TRAINING} --test {UNSEEN} -o {CALIBRATION}",
        "seconds": f"{report['seconds']:.0f}",
        "tone": tone,
        "verdict": sentence,
        "warnings": report["warnings"],
        "next": report["next"],
        "page": f"{CALIBRATION}/{CALIBRATION_PAGE}",
    }


def _run(story: Story) -> dict[str, Any]:
    results = story.finger.results
    return {
        "finger": story.finger.description.name.replace("_", " "),
        "joint": FLEXION.replace("_", " "),
        "force": f"{results[FREE].mean_force:.0f}",
        "more": f"{results[FREE_X4].mean_force:.0f}",
        "alarms": alarms(results[FREE].score),
        "more_alarms": alarms(results[FREE_X4].score),
    }


def _detect(story: Story) -> dict[str, Any]:
    result = story.finger.results[PUSHES]
    return {
        "sentence": detection_sentence(result.score),
        "as_given": detection_sentence(story.finger.as_given),
        "minutes": MINUTES,
        "seconds": f"{result.seconds:.0f}",
    }


def _diagnosis(story: Story) -> dict[str, Any]:
    found = story.diagnosis
    names = names_of(found)
    return {
        "headline": diagnosis_text.headline(found),
        "error": error_sentence(found),
        "left": left_sentence(found),
        "fall": waterfall_of(found, names),
        "cards": cards_of(found, names),
        "tested": found.tested,
        "page": f"{CALIBRATION}/{DIAGNOSIS}/{diagnosis_page.PAGE}",
    }
