"""The results of all fingers in rows, the worst first: of a calibration, a diagnosis, a history, a score."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from tendonfmu.calibration import text as calibration_text
from tendonfmu.commands.hand.description import Hand
from tendonfmu.commands.hand.parts import PartResult
from tendonfmu.commands.score import ScoreResult
from tendonfmu.diagnosis import Names
from tendonfmu.files import counted, percent
from tendonfmu.report import capital, headline, rounded, together, trend_sentence

FAR = 2.0  # times the median error of the fingers from which on a finger stands out
MUCH = 0.25  # share of an error beyond noise from which on a finger is bad
Report = Mapping[str, Any]


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
        poor = calibration_text.verdict(report)[0] == "bad"
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

    def row(result: PartResult, report: Report) -> PartRow:
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
        names = Names(tuple(result.part.finger.joint_names), tuple(result.part.finger.tendon_names))
        worst = max((size.gain for line in history.lines for size in line.sizes), default=0.0)
        count = len(history.lines)
        cells = (
            headline(history).rstrip("."),
            capital(trend_sentence(history.lines[0], history, names)) if count else "–",
            percent(worst) if count else "–",
            ", ".join(f"{name.rsplit('/', 1)[-1]}: {why}" for name, why in history.failed) or "none",
        )
        tone = "fine" if not count else "bad" if worst >= MUCH else "doubt"
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


def share_that_is_wrong(report: Report) -> float:
    """Return the share of a finger's error that is more than noise: what causes explain, and what nothing does."""
    gain, unexplained = report["gain"]["value"], report["unexplained"]["share"]
    return float(1.0 - (1.0 - gain) * math.sqrt(max(1.0 - unexplained, 0.0)))


def shared_warnings(warnings: Mapping[str, Sequence[str]]) -> list[str]:
    """Return each warning once, with the names of all parts that it is about before it."""
    names: dict[str, list[str]] = {}
    for name, sentences in warnings.items():
        for sentence in sentences:
            names.setdefault(sentence, []).append(name)
    return [f"{', '.join(of_sentence)}: {sentence}" for sentence, of_sentence in names.items()]


# --- parts ------------------------------------------------------------------------------------------------------------


def _rows(results: Sequence[PartResult], row: Callable[[PartResult, Report], PartRow]) -> list[PartRow]:
    """Return the rows, worst first; those of failed parts come last."""
    done = [row(result, result.report) for result in results if result.report is not None]
    done.sort(key=lambda each: -each.badness)
    empty = ("–",) * len(done[0].cells)
    return done + [
        PartRow(result.part.name, "failed", -1.0, "left out", "left out", empty, reason=result.reason)
        for result in results
        if result.report is None
    ]


def _own(hand: Hand, result: PartResult, values: Sequence[float]) -> float:
    """Return the rms of all joints of a finger together; a shared wrist is no joint of the finger."""
    return together(values[hand.shared_joints(result.part) :])


def _mnm(value: float | None) -> str:
    return "–" if value is None else rounded(1e3 * value)


def _place(result: PartResult, cause: Mapping[str, Any]) -> str:
    """Return where a cause is, by the names of joint and tendon."""
    finger = result.part.finger
    words = [f"at {finger.joint_names[cause['joint'] - 1]}"] if cause["joint"] else []
    words += [f"on {finger.tendon_names[cause['tendon'] - 1]}"] if cause["tendon"] else []
    return f"({' '.join(words)})" if words else ""
