"""What the demo shows: its page, one HTML file with all chapters, its tables and lines, and `tendonfmu demo --json`."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
from markupsafe import Markup

from tendonfmu.calibration import DIAGNOSIS
from tendonfmu.calibration import PAGE as CALIBRATION_PAGE
from tendonfmu.calibration import text as calibration_text
from tendonfmu.demo.demo import CALIBRATION, FIT, TRAINING, TWO_JOINTS, UNSEEN, Story
from tendonfmu.demo.figures import calibration_sheet, fit_sheets, push_sheet, run_sheet
from tendonfmu.demo.run import FLEXION, FREE, FREE_X4, MINUTES, PUSHES, RecordingResult
from tendonfmu.detect import DetectionScore
from tendonfmu.diagnosis import Diagnosis, at_place
from tendonfmu.files import write_text
from tendonfmu.report import (
    ResidualTable,
    Row,
    Table,
    Tile,
    cards_of,
    confusion_sentence,
    diagnosis_page,
    diagnosis_sheets,
    diagnosis_text,
    drawn,
    error_sentence,
    fit_page,
    left_sentence,
    names_of,
    percent,
    render,
    residual_tables,
    rounded,
    together,
    unit_of,
    waterfall_of,
)

FORMAT = "tendonfmu-demo-1"
PAGE = "story.html"


def write_story(story: Story) -> None:
    """Write the page with all chapters of a finished story; the file appears whole or not at all."""
    file = story.folder / PAGE
    write_text(file, story_page(story))
    story.add_page(file)


def story_page(story: Story) -> str:
    """Return the HTML text of the page."""
    sheets = [push_sheet(story.finger), run_sheet(story.finger)]
    if not story.missing:
        evidence = (sheet for sheet in diagnosis_sheets(story.diagnosis) if sheet.section != "views")
        sheets += [calibration_sheet(story.calibration.report), *fit_sheets(story.fit.picture()), *evidence]
    names = [chapter.name for chapter in story.chapters]
    return render(
        "story.html.jinja",
        drawn(sheets),
        chapters=story.chapters,
        tiles=[(name, _tile(story, name)) for name in names],
        tables={name: [_readable(table) for table in chapter_tables(story, name)] for name in names},
        calibrate=None if story.missing else _calibrate(story),
        detect=_detect(story),
        diagnosis=None if story.missing else _diagnosis(story.diagnosis),
        fit=None if story.missing else {"sentence": fit_sentence(story), "page": f"{FIT}/{fit_page.PAGE}"},
        run=_run(story),
        missing=story.missing,
        files=[(_link(path.relative_to(story.folder).as_posix()), what) for path, what in story.files.items()],
    )


def story_report(story: Story) -> dict[str, Any]:
    """Return the results of a demo that has run."""
    return {
        "format": FORMAT,
        "folder": str(story.folder),
        "chapters": [{"name": chapter.name, "title": chapter.title} for chapter in story.chapters],
        "left_out": story.missing or None,
        "recordings": [_recording(result) for result in story.finger.results.values()],
        "files": {str(path): what for path, what in story.files.items()},
    }


def _recording(result: RecordingResult) -> dict[str, Any]:
    events = result.score.events
    return {
        "name": result.name,
        "seconds": result.seconds,
        "mean_force": result.mean_force,
        "events": len(events),
        "found": sum(event.found for event in events),
        "false_alarms": len(result.score.false_alarms),
        "joints": [asdict(joint) for joint in result.joints],
    }


def _readable(table: Table) -> Table:
    """Names without underscores."""
    title, headings, rows = table

    def spaced(cells: Sequence[str]) -> tuple[str, ...]:
        return tuple(cell.replace("_", " ") for cell in cells)

    return title.replace("_", " "), spaced(headings), [spaced(row) for row in rows]


def _link(name: str) -> Markup:
    return Markup('<a href="{0}">{0}</a>').format(name)


def _tile(story: Story, chapter: str) -> Tile:
    """Return the most important figure of a chapter."""
    results = story.finger.results
    if chapter == "calibrate":
        return Tile(*next(calibration_text.tiles(story.calibration.report)))
    if chapter == "run":
        joint = next(joint for joint in results[FREE].joints if joint.name == FLEXION)
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
    diagnosis = story.diagnosis
    factor, unit = unit_of(diagnosis)
    before, after = (rounded(factor * together(model.test_rms)) for model in (diagnosis.nominal, diagnosis.extended))
    if not diagnosis.causes:
        return Tile(before, unit, "error on held-out parts; no cause was found")
    cause = at_place(diagnosis.causes[0].title, diagnosis.causes[0].where, names_of(diagnosis))
    meaning = f"error on held-out parts: {percent(diagnosis.gain.value)} less with {cause}, found and built in"
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


def _diagnosis(diagnosis: Diagnosis) -> dict[str, Any]:
    names = names_of(diagnosis)
    return {
        "headline": diagnosis_text.headline(diagnosis),
        "error": error_sentence(diagnosis),
        "left": left_sentence(diagnosis),
        "fall": waterfall_of(diagnosis, names),
        "cards": cards_of(diagnosis, names),
        "tested": diagnosis.tested,
        "page": f"{CALIBRATION}/{DIAGNOSIS}/{diagnosis_page.PAGE}",
    }


# --- tables and lines -------------------------------------------------------------------------------------------------


def chapter_tables(story: Story, chapter: str) -> list[Table]:
    """Return the tables of a chapter that has run."""
    results = story.finger.results
    if chapter == "calibrate":
        return list(calibration_text.tables(story.calibration.report))
    if chapter == "run":
        return [_left(story.finger.description.name, [results[FREE], results[FREE_X4]])]
    if chapter == "detect":
        return [_pushed(results[PUSHES])]
    return [_fitted(list(residual_tables(story.fit.picture())))] if chapter == "fit" else []


def chapter_lines(story: Story, chapter: str) -> Iterator[str]:
    """Yield the lines of a chapter that has run, which follow its tables."""
    results = story.finger.results
    if chapter == "calibrate":
        report = story.calibration.report
        yield from (f"warning: {sentence}" for sentence in report["warnings"])
        yield from calibration_text.lines(report)
    if chapter == "run":
        for name in (FREE, FREE_X4):
            yield f"{_motion(results[name])}: alarms without a push: {alarms(results[name].score)}"
    if chapter == "fit":
        yield fit_sentence(story)
    if chapter == "detect":
        yield f"calibrated: {detection_sentence(results[PUSHES].score)}"
        yield f"as given:   {detection_sentence(story.finger.as_given)}"
    if chapter == "diagnose":
        names = names_of(story.diagnosis)
        yield diagnosis_text.headline(story.diagnosis)
        for cause in story.diagnosis.causes:
            yield f"  {cause.where.effect} at {names.place(cause.where) or 'the whole finger'}: {cause.size}"
            if confusion := confusion_sentence(cause, names):
                yield f"  {confusion}"
        yield error_sentence(story.diagnosis)


def file_lines(story: Story) -> Iterator[str]:
    """Yield a line for each file that the demo wrote, with its content."""
    yield from (f"  {path}  {what}" for path, what in story.files.items())


def _motion(result: RecordingResult) -> str:
    what = "the same motion" if result.name == FREE_X4 else "free motion"
    return f"{what}, {result.mean_force:.0f} N"


def _left(finger: str, results: Sequence[RecordingResult]) -> Table:
    rows = [
        (joints[0].name, *(_pair(joint.measured, joint.left) for joint in joints))
        for joints in zip(*(result.joints for result in results), strict=True)
    ]
    return f"{finger}: joint torque → left after compensation, rms in mN·m", ("", *map(_motion, results)), rows


def _pushed(result: RecordingResult) -> Table:
    rows: list[Row] = [
        (joint.name, _pair(joint.measured, joint.left), _pair(joint.load, joint.error)) for joint in result.joints
    ]
    headings = ("", "nobody pushes\ntorque → left", "while pushed\nexternal → error")
    return f"pushes on the fingertip, {result.mean_force:.0f} N, rms in mN·m", headings, rows


def _pair(before: float, after: float) -> str:
    return f"{1e3 * before:.1f} → {1e3 * after:.1f}"


def _fitted(tables: Sequence[ResidualTable]) -> Table:
    rows: list[Row] = []
    for table, name in zip(tables, ("training", "unseen"), strict=True):
        for row in [*table.rows[:-1], table.all]:
            cells = (row.torque, row.bias_only, row.start, row.fitted)
            rows.append((f"{name}, {row.name.replace('_', ' ')}", *map(rounded, cells)))
    headings = ("", "torque", "no friction model", "before the fit", "fitted")
    return f"two-joint finger: torque and what the model leaves of it, rms in {tables[0].unit}", headings, rows


# --- sentences --------------------------------------------------------------------------------------------------------


def fit_sentence(story: Story) -> str:
    """Say how many numbers were fitted to how much motion, and the effect on a recording that was not trained on."""
    report = story.fit.report_
    unseen = list(residual_tables(story.fit.picture()))[-1]
    seconds = sum(recording["duration"] for recording in report["recordings"])
    return (
        f"{report['identified']['of']} numbers from {seconds:.0f} s of motion in {report['seconds']:.1f} s; on a "
        f"recording that it has not seen the error falls from {rounded(unseen.all.start)} to "
        f"{rounded(unseen.all.fitted)} {unseen.unit} rms"
    )


def detection_sentence(score: DetectionScore) -> str:
    """Say how many pushes were found, how soon, and how many alarms there were without one."""
    soon = f", half of them within {1e3 * np.median(score.delays):.0f} ms" if score.found else ""
    return f"{score.found} of {len(score.events)} pushes found{soon}; alarms without a push: {alarms(score)}"


def alarms(score: DetectionScore) -> str:
    """Say how many alarms there were without a push."""
    if not score.false_alarms:
        return "none"
    begin, end = max(score.false_alarms, key=lambda alarm: alarm[1] - alarm[0])
    many = f"{len(score.false_alarms)}, {100 * score.free_alarm_share:.1f} % of the time;"
    feeds = " (the bias is frozen in contact, so an alarm can keep itself on)" if end - begin > 1.0 else ""
    return f"{many} the longest lasts {end - begin:.1f} s, from {begin:.1f} s on{feeds}"
