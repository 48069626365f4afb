"""How well contact is detected on the simulated hand (docs/evidence/contact.md).

300 pushes of 0.1 to 2 N in 30 min at 10, 20 and 40 N of pretension (hand.py), a fit on free motion at low pretension,
simpler models with the best thresholds each (rivals.py), and the best that could be done with the residual
(matched.py).

    python -m evidence.detection.contact -o FOLDER [--finger NAME=FILE ...]

Everything is kept in the folder. Writes detection.md, and detection.csv with a row for each push.
"""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from evidence import tables
from evidence.detection.hand import (
    PARTS,
    PRETENSIONS,
    TWINS,
    Take,
    fitted_file,
    pushes_of,
    recording,
    recording_file,
    takes,
    training_file,
)
from evidence.detection.matched import KINDS, WINDOWS, matched_findings, name_of
from evidence.detection.rivals import Detector, best_thresholds, from_json, make_rivals, to_json
from evidence.runner import INDEX_FINGER, named_finger, parser, publish, run_cases, say, write
from tendonfmu.recordings import read_recording

Row = Mapping[str, Any]
Rows = Sequence[Row]
Run = Callable[..., list[dict[str, Any]]]  # run_cases with workers

# of a push: the largest ratio of its torque in a joint to the rms of that joint's free residual
SIZES = {"< 1": 0.0, "1–2": 1.0, "2–3": 2.0, "3–4": 3.0, "4–6": 4.0, "≥ 6": 6.0}
POSTURES = ("rest", "motion", "reversal")
MINUTES = 10.0  # false alarms are given per this


# --- running ----------------------------------------------------------------------------------------------------------


def made(folder: Path, take: Take) -> dict[str, Any]:
    return {"file": str(recording_file(folder, take))}


def scored(folder: Path, take: Take, detector: Detector) -> dict[str, Any]:
    """Which pushes a detector finds in a recording, and what it does while nothing touches."""
    score = detector.score(recording(folder, take))
    return {
        "detector": detector.name,
        "kind": take.kind,
        "pretension": take.pretension,
        "part": take.part,
        "found": [float(event.found) for event in score.events],
        "delay": [event.delay for event in score.events],
        "seconds": score.free_seconds,
        "alarms": len(score.false_alarms),
        "alarm_seconds": score.free_alarm_share * score.free_seconds,
    }


def tuned_rivals(folder: Path, product: dict[str, Any], parts: int) -> list[Detector]:
    """Rivals with the best thresholds each, kept as they are found."""
    file = folder / "rivals.json"
    tuned = from_json(file) if file.exists() else []
    free = [[recording(folder, take) for take in takes("free", parts=parts, pretensions=(p,))] for p in PRETENSIONS]
    rivals = make_rivals(product, read_recording(training_file(folder)), list(itertools.chain(*free)))
    for detector in rivals[len(tuned) :]:
        tuned.append(best_thresholds(detector, free))
        write(file, to_json(tuned))
        say(f"{detector.name}: {tuned[-1].description['contact']}")
    return tuned


def free_rms(folder: Path, reference: Detector, parts: int) -> dict[float, list[float]]:
    """[n] N·m by pretension, before the bias update and without any detection."""
    rms = {}
    for pretension in PRETENSIONS:
        free = [recording(folder, take) for take in takes("free", parts=parts, pretensions=(pretension,))]
        squares = [np.mean(reference.residual(reference.inputs(one)) ** 2, axis=0) for one in free]
        rms[pretension] = np.sqrt(np.mean(squares, axis=0)).tolist()
    return rms


def campaign(folder: Path, fingers: Sequence[Detector], parts: int, alone: bool, run: Run) -> str:
    """Everything that is not there yet, and the page of tables."""
    every = takes(*TWINS, *TWINS.values(), "free", parts=parts)
    run(made, {take.name: (folder, take) for take in every}, folder / "made")
    fitted = Detector.of_file("fitted", fitted_file(folder))
    rms = free_rms(folder, fitted, parts)
    pushes = [push for take in takes(*TWINS, parts=parts) for push in pushes_of(folder, take)]
    for push in pushes:
        push["size"] = max(abs(np.array(push["torque"])) / rms[push["pretension"]])
        push["class"] = [name for name, least in SIZES.items() if push["size"] >= least][-1]
    detectors = [Detector.of_file("description", INDEX_FINGER), fitted, *fingers]
    detailed = [detector.name for detector in detectors]
    findings: dict[str, list[float]] = {}
    if not alone:
        rivals = tuned_rivals(folder, fitted.description, parts)
        detectors += rivals
        findings = matched_findings(folder, fitted, pushes, parts)
        detailed += [rivals[-1].name, name_of(KINDS[-1], max(WINDOWS))]
    cases = {
        f"{take.name}-{detector.digest}": (folder, take, detector)
        for detector in detectors
        for take in takes(*TWINS, "free", parts=parts)
    }
    scores = run(scored, cases, folder / "scores")
    rows = [row for detector in detectors for row in _answers(detector.name, pushes, scores)]
    for name, found in findings.items():
        rows += [{**push, "detector": name, "found": value} for push, value in zip(pushes, found, strict=True)]
    write_pushes(folder / "detection.csv", pushes, rows)
    return report(rms, pushes, rows, scores, detailed)


def _answers(detector: str, pushes: Rows, scores: Rows) -> list[dict[str, Any]]:
    """A row of each push."""
    rows = []
    for score in tables.where(scores, detector=detector):
        own = tables.where(pushes, **{key: score[key] for key in ("kind", "pretension", "part")})
        answers = zip(own, score["found"], score["delay"], strict=True)
        rows += [{**push, "detector": detector, "found": found, "delay": delay} for push, found, delay in answers]
    return rows


def write_pushes(file: Path, pushes: Rows, rows: Rows) -> None:
    """A row for each push: what was true of it, and of every detector whether it found it and the delay."""
    frame = pd.DataFrame(pushes)
    for detector in tables.values_of(rows, "detector"):
        own = tables.where(rows, detector=detector)
        frame[f"found: {detector}"] = tables.column(own, "found")
        frame[f"delay: {detector}"] = tables.column(own, "delay")
    frame.dropna(axis="columns", how="all").to_csv(file, index=False)


# --- the page ---------------------------------------------------------------------------------------------------------


def report(rms: Mapping[float, list[float]], pushes: Rows, rows: Rows, scores: Rows, detailed: Sequence[str]) -> str:
    sizes = {size: tables.equal(**{"class": size}) for size in SIZES}
    detectors = tables.values_of(rows, "detector")
    lines = {name: tables.equal(detector=name) for name in detectors}
    states: dict[str, Callable[[Row], Any]] = {posture: tables.equal(posture=posture) for posture in POSTURES}
    states["all stuck, break-away"] = lambda row: row["stuck"] and not row["stays"]
    states["all stuck, below break-away"] = tables.equal(stays=True)
    sections = {
        "Pushes": _cases(rms, pushes),
        "In short": tables.table(["", *_summary_head()], [[name, *_summary(name, rows, scores)] for name in detectors]),
    }
    for pretension in rms:
        own = tables.where(rows, pretension=pretension)
        sections[f"{pretension:g} N: found, by size of the push"] = tables.crossed(own, lines, sizes, _found)
    sections["False alarms in 10 min, part of the free time in alarm"] = _false_alarms(scores)
    for name in detailed:
        own = tables.where(rows, detector=name)
        sections[f"{name}: by posture and stiction, all pretensions"] = tables.crossed(own, states, sizes, _found)
    return tables.page(sections)


def _found(rows: Rows) -> str:
    return tables.count((row["found"] for row in rows), with_interval=True)


def _cases(rms: Mapping[float, list[float]], pushes: Rows) -> str:
    head = ["pretension", "pushes, " + " + ".join(TWINS), *POSTURES, "all stuck", "below break-away"]
    lines = []
    for pretension, deviations in rms.items():
        own = tables.where(pushes, pretension=pretension)
        kinds = " + ".join(str(len(tables.where(own, kind=kind))) for kind in TWINS)
        counts = [len(tables.where(own, posture=posture)) for posture in POSTURES]
        counts += [sum(push[key] for push in own) for key in ("stuck", "stays")]
        lines.append([f"{pretension:g} N", kinds, *counts, ", ".join(f"{1e3 * value:.2g}" for value in deviations)])
    return "Sizes in multiples of the free residual's rms of the fitted finger.\n\n" + tables.table(
        [*head, "free residual's rms, mN·m"], lines
    )


def _summary_head() -> list[str]:
    strongest, next_size, third = list(SIZES)[:-4:-1]
    alarms = ["false alarms in 10 min, free", "between pushes"]
    delays = [f"median delay of {strongest}, ms", "90 % within"]
    return [*(f"{strongest}, {pretension:g} N" for pretension in PRETENSIONS), next_size, third, *alarms, *delays]


def _summary(detector: str, rows: Rows, scores: Rows) -> list[str]:
    """The largest pushes by pretension, the next sizes and the false alarms of all pretensions together."""
    own = tables.where(rows, detector=detector)
    strongest, *others = list(SIZES)[:-4:-1]
    strong = tables.where(own, **{"class": strongest})
    cells = [_found(tables.where(strong, pretension=pretension)) for pretension in PRETENSIONS]
    cells += [_found(tables.where(own, **{"class": size})) for size in others]
    for free in _free(tables.where(scores, detector=detector)):
        seconds = sum(row["seconds"] for row in free)
        alarms = sum(row["alarms"] for row in free)
        cells.append(tables.events(alarms, seconds / 60 / MINUTES) if seconds else tables.NOTHING)
    delays = tables.column(tables.where(strong, found=1.0), "delay")
    known = delays[~np.isnan(delays)]
    late = float(np.quantile(known, 0.9)) if len(known) else math.nan
    return [*cells, tables.median(known, ".0f", 1e3, with_interval=True), tables.number(late, ".0f", 1e3)]


def _free(scores: Rows) -> tuple[list[Row], list[Row]]:
    """Scores of free recordings, and of those with pushes."""
    return tables.where(scores, kind="free"), [row for row in scores if row["kind"] in TWINS]


def _false_alarms(scores: Rows) -> str:
    def cell(rows: Rows) -> str:
        alarms, seconds, alarm_seconds = (
            sum(row[key] for row in rows) for key in ("alarms", "seconds", "alarm_seconds")
        )
        return f"{tables.events(alarms, seconds / 60 / MINUTES)}; {100 * alarm_seconds / seconds:.2g} %"

    def in_column(row: Row, pretension: float, free: bool) -> bool:
        return row["pretension"] == pretension and (row["kind"] == "free") == free

    lines = {name: tables.equal(detector=name) for name in tables.values_of(scores, "detector")}
    columns = {
        f"{where}, {pretension:g} N": functools.partial(in_column, pretension=pretension, free=where == "free")
        for where in ("free", "between pushes")
        for pretension in PRETENSIONS
    }
    return tables.crossed(scores, lines, columns, cell)


def main() -> None:
    options = parser(__doc__)
    options.add_argument("--finger", action="append", type=named_finger, default=[], metavar="NAME=FILE")
    options.add_argument("--parts", type=int, default=PARTS, help="of 10 min and 100 pushes, by pretension")
    options.add_argument("--alone", action="store_true", help="fingers alone, without rivals: a quarter of an hour")
    given = options.parse_args()
    given.output.mkdir(parents=True, exist_ok=True)
    run = functools.partial(run_cases, workers=given.workers, scheduler=given.scheduler)
    fingers = [Detector(name, data) for name, data in given.finger]
    publish(given.output / "detection.md", campaign(given.output, fingers, given.parts, given.alone, run))


if __name__ == "__main__":
    main()
