"""What the demo shows, in words: rows and lines that `cli.py` prints."""

from __future__ import annotations

from collections.abc import Iterator

from tendonfmu.demo import DemoResult
from tendonfmu.detection_score import DetectionScore

Row = tuple[str, ...]


def demo_tables(result: DemoResult) -> Iterator[tuple[str, Row, list[Row]]]:
    """(title, headings, rows): what is left of each joint's torque."""
    free, more, pushed = result.recordings
    named = (("a", "free", free), ("b", "the same", more), ("c", "no push", pushed))
    motions = [f"({letter}) {motion}\n{recording.mean_force:.0f} N" for letter, motion, recording in named]
    rows = []
    for joints in zip(*(recording.joints for recording in result.recordings), strict=True):
        cells = [f"{1e3 * joint.measured:.1f} → {1e3 * joint.left:.1f}" for joint in joints]
        rows.append((joints[0].name, *cells, f"{1e3 * joints[2].load:.1f} → {1e3 * joints[2].error:.1f}"))
    title = f"{result.finger}: joint torque → left after compensation, rms in mN·m"
    yield title, ("", *motions, "(c) pushed\nexternal → error"), rows


def demo_lines(result: DemoResult) -> Iterator[str]:
    """What of the pushes was found, what was said without one, and the files."""
    score = result.recordings[2].score
    yield f"(c) {score.found} of {len(score.events)} pushes found"
    for letter, recording in zip("abc", result.recordings, strict=True):
        yield f"({letter}) alarms without a push: {_alarms(recording.score)}"
    for path, what in result.files.items():
        yield f"  {path}  {what}"


def _alarms(score: DetectionScore) -> str:
    if not score.false_alarms:
        return "none"
    begin, end = max(score.false_alarms, key=lambda alarm: alarm[1] - alarm[0])
    many = f"{len(score.false_alarms)}, {100 * score.free_alarm_share:.1f} % of the time"
    feeds = " (in contact the bias is frozen: an alarm can feed itself)" if end - begin > 1.0 else ""
    return f"{many}, the longest {end - begin:.1f} s from {begin:.1f} s on{feeds}"
