"""The page of a hand: a drawing, and a row for each finger, the worst first, with a link to its own page.

Rows are of a calibration, a diagnosis, a history or a score; the terminal shows the same.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from markupsafe import Markup

from tendonfmu import report as reporting
from tendonfmu.calibration import text
from tendonfmu.commands.hand.description import Hand, HandPart
from tendonfmu.commands.hand.hand_types import WRIST
from tendonfmu.commands.score import ScoreResult
from tendonfmu.diagnosis import History, Names
from tendonfmu.files import counted, html_template, listed, percent, write_text

PAGE = "hand.html"
COLOURS = {"fine": "#7fc9b3", "doubt": "#e69f00", "bad": "#d55e00", "failed": "#b4bcc4"}  # of the tones

# lengths of the drawing in CSS pixels, y downward; a page shrinks it to its width
SPACING, THICK = 82.0, 24.0  # between fingers, and of one
LONGEST, PER_JOINT = 136.0, 36.0  # a finger, and each of its joints
PALM, HEAD = 96.0, 60.0  # heights of the palm and of the room above it for two lines of text
SPREAD = math.radians(5.0)  # between neighbours
FAR = 2.0  # times the median error of the fingers from which on a finger stands out
MUCH = 0.25  # share of an error beyond noise from which on a finger is bad
Report = Mapping[str, Any]


@dataclass(frozen=True)
class PartResult:
    """What became of a part."""

    part: HandPart
    report: Mapping[str, Any] | None  # as its own command writes it; None if it failed
    reason: str = ""  # why it failed
    history: History | None = None


def names_of(part: HandPart) -> Names:
    """Return the names of joints and tendons."""
    return Names(tuple(part.finger.joint_names), tuple(part.finger.tendon_names))


class PartRow(NamedTuple):
    """A finger on the page and on the terminal."""

    name: str
    tone: str  # fine, doubt, bad or failed
    badness: float  # the larger, the worse
    value: str  # what it is judged by, short
    sentence: str  # the same in words
    cells: tuple[str, ...]
    page: str = ""  # its own page in its folder, if it has one
    reason: str = ""  # why it failed


class Kind(NamedTuple):
    """What a page of a hand is about."""

    name: str
    rows: Callable[[Hand, Sequence[PartResult]], list[PartRow]]
    headings: tuple[str, ...]
    meanings: tuple[str, str, str]  # of the tones fine, doubt and bad
    caption: str

    @property
    def format(self) -> str:
        """Format of what `--json` prints."""
        return f"tendonfmu-hand-{self.name}-1"


def calibration_rows(hand: Hand, results: Sequence[PartResult]) -> list[PartRow]:
    """Return a row for each finger: errors before and after, causes built in, false alarms, pushes."""

    def error(result: PartResult, report: Report, name: str = "calibrated") -> float:
        return _own(hand, result, report["error"][name])

    errors = sorted(error(result, result.report) for result in results if result.report)

    def row(result: PartResult, report: Report) -> PartRow:
        left = error(result, report)
        poor = text.verdict(report)[0] == "bad"
        tone = "bad" if poor else "doubt" if left > FAR * errors[len(errors) // 2] else "fine"
        before = error(result, report, "previous" if "previous" in report["error"] else "as_given")
        alarms, pushes = report["alarms"], report["pushes"]
        cells = (
            f"{_mnm(before)} → {_mnm(left)} mN·m",
            ", ".join(cause["title"] for cause in report["structure"]["causes"]) or "nothing",
            f"{alarms['alarms']} in {alarms['minutes']:.2g} min",
            "–" if pushes is None else f"{pushes['found']} of {pushes['events']}",
        )
        value = f"{_mnm(left)} mN·m"
        sentence = f"{value} are left on unseen motion"
        return PartRow(result.part.name, tone, left, value, sentence, cells, "calibration.html")

    return _rows(results, row)


def diagnosis_rows(hand: Hand, results: Sequence[PartResult]) -> list[PartRow]:
    """Return a row for each finger: verdict, causes, error, and how much of it is beyond noise."""

    def row(result: PartResult, report: reporting.DiagnosisReport) -> PartRow:
        adequate = report["verdict"] == "adequate"
        wrong = share_that_is_wrong(report)
        causes = [" ".join(filter(None, (cause["title"], _place(result, cause)))) for cause in report["causes"]]
        more = f", and {len(causes) - 2} more" if len(causes) > 2 else ""
        nominal = f"{_mnm(_own(hand, result, report['nominal']['test_rms']))} mN·m"
        cells = (report["verdict"], ("; ".join(causes[:2]) + more) or "–", nominal, percent(wrong))
        tone = "fine" if adequate else "bad" if wrong >= MUCH else "doubt"
        value, sentence = (
            "adequate" if adequate else percent(wrong),
            f"{percent(wrong)} of its error is more than noise",
        )
        badness = 0.0 if adequate else wrong
        return PartRow(result.part.name, tone, badness, value, sentence, cells, "diagnosis.html")

    return _rows(results, row)


def history_rows(hand: Hand, results: Sequence[PartResult]) -> list[PartRow]:
    """Return a row for each finger: how many changes, the first of them, and recordings that were left out."""

    def row(result: PartResult, report: Report) -> PartRow:
        history = result.history
        assert history is not None
        names = names_of(result.part)
        worst = max((size.gain for line in history.lines for size in line.sizes), default=0.0)
        count = len(history.lines)
        cells = (
            reporting.headline(history).rstrip("."),
            reporting.capital(reporting.trend_sentence(history.lines[0], history, names)) if count else "–",
            percent(worst) if count else "–",
            ", ".join(f"{name.rsplit('/', 1)[-1]}: {why}" for name, why in history.failed) or "none",
        )
        tone = "fine" if not count and not history.different else "bad" if worst >= MUCH else "doubt"
        value = counted(count, "change")
        return PartRow(result.part.name, tone, worst, value, value, cells, "history.html")

    return _rows(results, row)


CALIBRATION = Kind(
    "calibration",
    calibration_rows,
    ("error on unseen motion", "added to the model", "false alarms", "pushes found"),
    ("calibrated", "its error is more than twice that of the hand's median finger", "no better than before"),
    "Above each finger: rms of what the model leaves of the torques of its joints on unseen motion.",
)
DIAGNOSIS = Kind(
    "diagnosis",
    diagnosis_rows,
    ("verdict", "causes", "error", "more than noise"),
    (
        "adequate",
        f"more than noise: below {percent(MUCH)} of its error",
        f"more than noise: {percent(MUCH)} of its error and above",
    ),
    "Above each finger: the share of its error that is more than noise, explained by causes or not.",
)
HISTORY = Kind(
    "history",
    history_rows,
    ("changes", "the first", "largest share of the error", "left out"),
    (
        "nothing has changed",
        f"a change makes less than {percent(MUCH)} of the error",
        f"a change makes {percent(MUCH)} or more",
    ),
    "Above each finger: the number of changes.",
)
SCORE_HEADINGS = ("found", "false alarms", "median delay", "free rms, mN·m")


def score_rows(scores: Mapping[str, ScoreResult], failed: Mapping[str, str]) -> list[PartRow]:
    """Return a row for each finger: events found, false alarms, delay, torque in free motion."""
    rows = []
    for name, score in scores.items():
        minutes = float(score.report["free_minutes"] or 0.0)
        missed = 1.0 - score.found / score.events if score.events else 0.0
        badness = missed + 1e-3 * score.false_alarms / max(minutes, 1e-9)
        cells = (
            f"{score.found} of {score.events}" if score.events else "–",
            f"{score.false_alarms} in {minutes:.2g} min",
            "–" if math.isnan(score.median_delay) else f"{1e3 * score.median_delay:.0f} ms",
            ", ".join(_mnm(value) for value in score.report["free_rms"]),
        )
        rows.append(PartRow(name, "fine", badness, "", "", cells))
    rows += [PartRow(name, "failed", -1.0, "", "", ("–",) * 4, reason=why) for name, why in failed.items()]
    return sorted(rows, key=lambda row: -row.badness)


def share_that_is_wrong(report: reporting.DiagnosisReport) -> float:
    """Return the share of a finger's error that is more than noise: what causes explain, and what nothing does."""
    gain, unexplained = report["gain"]["value"] or 0.0, report["unexplained"]["share"] or 0.0
    return 1.0 - (1.0 - gain) * math.sqrt(max(1.0 - unexplained, 0.0))


def shared_warnings(warnings: Mapping[str, Sequence[str]]) -> list[str]:
    """Return each warning once, with the names of all parts that it is about before it."""
    names: dict[str, list[str]] = {}
    for name, sentences in warnings.items():
        for sentence in sentences:
            names.setdefault(sentence, []).append(name)
    return [f"{', '.join(of_sentence)}: {sentence}" for sentence, of_sentence in names.items()]


# --- parts ------------------------------------------------------------------------------------------------------------


def _rows(results: Sequence[PartResult], row: Callable[[PartResult, Any], PartRow]) -> list[PartRow]:
    """Return the rows, worst first; those of failed parts come last."""
    done = [row(result, result.report) for result in results if result.report is not None]
    done.sort(key=lambda each: -each.badness)
    empty = ("–",) * len(done[0].cells)
    return done + [
        PartRow(result.part.name, "failed", -1.0, "left out", "left out", empty, reason=result.reason)
        for result in results
        if result.report is None
    ]


def _own(hand: Hand, result: PartResult, values: Sequence[float | None]) -> float:
    """Return the rms of all joints of a finger together; a shared wrist is no joint of the finger."""
    return reporting.together(reporting.column(values[hand.shared_joints(result.part) :]))


def _mnm(value: float | None) -> str:
    return "–" if value is None else reporting.rounded(1e3 * value)


def _place(result: PartResult, cause: reporting.CauseEntry) -> str:
    """Return where a cause is, by the names of joint and tendon."""
    finger = result.part.finger
    words = [f"at {finger.joint_names[cause['joint'] - 1]}"] if cause["joint"] else []
    words += [f"on {finger.tendon_names[cause['tendon'] - 1]}"] if cause["tendon"] else []
    return f"({' '.join(words)})" if words else ""


# --- the page ---------------------------------------------------------------------------------------------------------


def write_hand_page(
    hand: Hand,
    rows: Sequence[PartRow],
    kind: Kind,
    folder: Path,
    *,
    recordings: Mapping[str, Sequence[Path]],
    files: Mapping[str, str],
    warnings: Sequence[str] = (),
) -> None:
    """Write the page into the folder in which each finger has its own."""
    tones = {row.tone for row in rows}
    meanings = zip(COLOURS, (*kind.meanings, "left out"), strict=True)
    page = reporting.render(
        "hand.html.jinja",
        hand=hand.name,
        kicker=f"{kind.name} of a hand",
        verdict=verdict(rows),
        tone="bad" if tones & {"bad", "failed"} else "" if "doubt" in tones else "good",
        drawing=hand_svg(hand, rows),
        keys=[(COLOURS[tone], meaning) for tone, meaning in meanings if tone in tones],
        caption=kind.caption,
        headings=("finger", *kind.headings),
        rows=[(_linked(row), *row.cells) for row in rows],
        doubtful=[row.tone in ("bad", "failed") for row in rows],
        failed=[(row.name, row.reason) for row in rows if row.reason],
        recordings=[(role, list(map(str, group))) for role, group in recordings.items()],
        files=files,
        warnings=warnings,
    )
    write_text(folder / PAGE, page)


def verdict(rows: Sequence[PartRow]) -> str:
    """Say in a sentence which fingers stand out."""
    worst = [row for row in rows if row.tone in ("bad", "doubt")]
    failed = [row.name for row in rows if row.tone == "failed"]
    sentences = [f"{worst[0].name} is the worst: {worst[0].sentence}."] if worst else []
    if not worst:
        sentences.append(f"No finger of {len(rows) - len(failed)} stands out.")
    if len(worst) > 1:
        sentences.append(f"{listed([row.name for row in worst[1:]])} stand{'s' * (len(worst) == 2)} out, too.")
    if failed:
        sentences.append(f"{counted(len(failed), 'finger')} left out: {listed(failed)}.")
    return " ".join(sentences)


def _link(row: PartRow) -> str:
    return f"{row.name}/{row.page}" if row.page else ""


def _linked(row: PartRow) -> str:
    return Markup('<a href="{}">{}</a>').format(_link(row), row.name) if row.page else row.name


# --- the drawing ------------------------------------------------------------------------------------------------------


def hand_svg(hand: Hand, rows: Sequence[PartRow]) -> Markup:
    """Draw palm and fingers side by side as SVG, each in the colour of how well it does, with a link to its page."""
    of, count = {row.name: row for row in rows}, len(hand.fingers)
    width, palm = SPACING * max(count, 4) + 12.0, SPACING * max(count, 2) * 0.86
    drawing = html_template("hand_svg.html.jinja").render(
        name=hand.name,
        width=round(width),
        height=round(HEAD + LONGEST + PALM + (64.0 if WRIST in of else 8.0)),
        thick=THICK,
        palm=(round(0.5 * (width - palm), 1), HEAD + LONGEST - 9.0, round(palm, 1), PALM),
        fingers=[
            _drawn(of[part.name])
            | _at(part, part.finger.joints - hand.shared_joints(part), k - 0.5 * (count - 1), width)
            for k, part in enumerate(hand.fingers)
        ],
        wrist=_drawn(of[WRIST]) if WRIST in of else None,
    )
    return Markup(drawing)


def _drawn(row: PartRow) -> dict[str, Any]:
    return {"row": row, "link": _link(row), "colour": COLOURS[row.tone]}


def _at(part: HandPart, joints: int, beside: float, width: float) -> dict[str, Any]:
    """Return root, tip and joints of a finger, `beside` fingers to the right of the middle."""
    root = (round(0.5 * width + 0.82 * SPACING * beside, 1), HEAD + LONGEST)
    length = min(LONGEST, 10.0 + PER_JOINT * joints) * (1.0 - 0.05 * abs(beside))
    length *= 0.8 if "thumb" in part.name.lower() else 1.0
    angle = SPREAD * beside

    def at(share: float) -> tuple[float, float]:
        x, y = root[0] + share * length * math.sin(angle), root[1] - share * length * math.cos(angle)
        return round(x, 1), round(y, 1)

    return {"root": root, "tip": at(1.0), "joints": [at((j + 0.68) / joints) for j in range(joints)]}
