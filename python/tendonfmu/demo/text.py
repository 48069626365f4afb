"""The results of the demo in words: the rows and lines that `cli/demo.py` prints, and the sentences of its page."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from tendonfmu.calibrate import text as calibration_text
from tendonfmu.demo.demo import Story
from tendonfmu.demo.run import FREE, FREE_X4, PUSHES, RecordingResult
from tendonfmu.detect import DetectionScore
from tendonfmu.report import (
    ResidualTable,
    Row,
    Table,
    confusion_sentence,
    diagnosis_text,
    error_sentence,
    names_of,
    residual_tables,
    rounded,
)


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
    many = f"{len(score.false_alarms)}, {100 * score.free_alarm_share:.1f} % of the time"
    feeds = " (in contact the bias is frozen: an alarm can feed itself)" if end - begin > 1.0 else ""
    return f"{many}, the longest {end - begin:.1f} s from {begin:.1f} s on{feeds}"
