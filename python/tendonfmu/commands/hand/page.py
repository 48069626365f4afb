"""The page of a hand: a row for each finger, the worst first, with a link to its own page. The terminal shows the same.

A row is of a calibration, a diagnosis, a history or a score.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from markupsafe import Markup

from tendonfmu import report as reporting
from tendonfmu.calibration import text
from tendonfmu.commands.hand.description import Hand, HandPart
from tendonfmu.diagnosis import Diagnosis, History, at_place, names_in, reported_causes
from tendonfmu.files import counted, listed, percent, write_text

PAGE = "hand.html"
FAR = 2.0  # times the median error of the fingers from which on a finger stands out
MUCH = 0.25  # share of an error beyond noise from which on a finger is bad
Report = Mapping[str, Any]


class PartRow(NamedTuple):
    """A finger on the page and on the terminal."""

    tone: str  # fine, doubt, bad or failed
    badness: float  # the larger, the worse
    sentence: str  # what it is judged by
    cells: Sequence[str]
    name: str = ""
    reason: str = ""  # why it failed


class Kind(NamedTuple):
    """What a table of fingers is about."""

    name: str
    headings: tuple[str, ...]
    page: str = ""  # the page of a finger
    caption: str = ""


CALIBRATION = Kind(
    "calibration",
    ("error on unseen motion", "added to the model", "false alarms", "pushes found"),
    "calibration.html",
    "Error: rms of what the model leaves of the torques of the finger's joints, before and after.",
)
DIAGNOSIS = Kind(
    "diagnosis",
    ("verdict", "causes", "error", "more than noise"),
    "diagnosis.html",
    "More than noise: the share of the error that causes explain, or that nothing does.",
)
HISTORY = Kind("history", ("changes", "the first", "largest share of the error", "left out"), "history.html")
SCORE = Kind("score", ("found", "false alarms", "median delay", "free rms, mN·m"))


def calibration_row(part: HandPart, report: Report) -> PartRow:
    """Say how large the errors are before and after, which causes are built in, and what is detected."""
    first = "previous" if "previous" in report["error"] else "as_given"
    before, left = (_own(part, report["error"][name]) for name in (first, "calibrated"))
    alarms, pushes = report["alarms"], report["pushes"]
    cells = (
        f"{_mnm(before)} → {_mnm(left)} mN·m",
        ", ".join(cause["title"] for cause in report["structure"]["causes"]) or "nothing",
        f"{alarms['alarms']} in {alarms['minutes']:.2g} min",
        "–" if pushes is None else f"{pushes['found']} of {pushes['events']}",
    )
    tone = "bad" if text.verdict(report)[0] == "bad" else "fine"
    return PartRow(tone, left, f"{_mnm(left)} mN·m are left on unseen motion", cells)


def stand_out(rows: Sequence[PartRow]) -> list[PartRow]:
    """Return rows of calibrations that doubt a finger whose error is far above that of the others."""
    errors = sorted(row.badness for row in rows if row.tone != "failed")
    far = FAR * errors[len(errors) // 2]
    return [row._replace(tone="doubt") if row.tone == "fine" and row.badness > far else row for row in rows]


def diagnosis_row(part: HandPart, found: Diagnosis) -> PartRow:
    """Say verdict, causes, error, and how much of it is beyond noise: what causes explain, and what nothing does."""
    gain, left = (0.0 if math.isnan(share) else share for share in (found.gain.value, found.unexplained.share))
    wrong = 1.0 - (1.0 - gain) * math.sqrt(max(1.0 - left, 0.0))
    causes = [at_place(cause.title, cause.where, names_in(part.finger.data)) for cause in reported_causes(found)]
    more = f"; and {len(causes) - 2} more" if len(causes) > 2 else ""
    error = f"{_mnm(_own(part, found.nominal.test_rms))} mN·m"
    cells = (found.verdict, ("; ".join(causes[:2]) + more) or "–", error, percent(wrong))
    adequate = found.verdict == "adequate"
    tone = "fine" if adequate else "bad" if wrong >= MUCH else "doubt"
    return PartRow(tone, 0.0 if adequate else wrong, f"{percent(wrong)} of its error is more than noise", cells)


def history_row(part: HandPart, history: History) -> PartRow:
    """Say how many changes there are, the first of them, and which recordings were left out."""
    count, names = len(history.lines), names_in(part.finger.data)
    worst = max((size.gain for line in history.lines for size in line.sizes), default=0.0)
    cells = (
        reporting.headline(history).rstrip("."),
        reporting.capital(reporting.trend_sentence(history.lines[0], history, names)) if count else "–",
        percent(worst) if count else "–",
        ", ".join(f"{name.rsplit('/', 1)[-1]}: {why}" for name, why in history.failed) or "none",
    )
    tone = "fine" if not count and not history.different else "bad" if worst >= MUCH else "doubt"
    return PartRow(tone, worst, counted(count, "change"), cells)


def score_row(report: Report) -> PartRow:
    """Say which events were found, false alarms, delay, and the torque in free motion."""
    events, found, alarms, minutes = (report[key] for key in ("events", "found", "false_alarms", "free_minutes"))
    badness = (1.0 - found / events if events else 0.0) + 1e-3 * alarms / max(minutes or 0.0, 1e-9)
    cells = (
        f"{found} of {events}" if events else "–",
        f"{alarms} in {minutes or 0.0:.2g} min",
        "–" if report["median_delay_s"] is None else f"{1e3 * report['median_delay_s']:.0f} ms",
        ", ".join(map(_mnm, report["free_rms"])),
    )
    return PartRow("fine", badness, "", cells)


def shared_warnings(warnings: Mapping[str, Sequence[str]]) -> list[str]:
    """Return each warning once, with the names of all fingers that it is about before it."""
    names: dict[str, list[str]] = {}
    for name, sentences in warnings.items():
        for sentence in sentences:
            names.setdefault(sentence, []).append(name)
    return [f"{', '.join(of_sentence)}: {sentence}" for sentence, of_sentence in names.items()]


def _own(part: HandPart, values: Sequence[float | None]) -> float:
    """Return the rms of all joints of a finger together; a shared wrist is no joint of the finger."""
    return reporting.together(reporting.column(values[part.shared :]))


def _mnm(value: float | None) -> str:
    return "–" if value is None else reporting.rounded(1e3 * value)


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
    page = reporting.render(
        "hand.html.jinja",
        hand=hand.name,
        kicker=f"{kind.name} of a hand",
        verdict=verdict(rows),
        tone="bad" if tones & {"bad", "failed"} else "" if "doubt" in tones else "good",
        caption=kind.caption,
        headings=("finger", *kind.headings),
        rows=[(_linked(row, kind), *row.cells) for row in rows],
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


def _linked(row: PartRow, kind: Kind) -> str:
    return row.name if row.reason else Markup('<a href="{}/{}">{}</a>').format(row.name, kind.page, row.name)
