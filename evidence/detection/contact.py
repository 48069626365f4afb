"""How well contact is detected on the simulated hand, beside simpler models.

    python -m evidence.detection.contact -o FOLDER [--finger NAME=FILE ...]

Everything is kept in the folder. Writes detection.md.
"""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

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
from evidence.detection.rivals import Detector, best_thresholds, from_json, make_rivals, to_json
from evidence.runner import INDEX_FINGER, named_finger, parser, publish, run_cases, say, write
from evidence.tables import Row
from tendonfmu.recordings import Recording, read_recording

Rows = Sequence[Row]
Run = Callable[..., list[dict[str, Any]]]  # run_cases with workers

# of a push: the largest ratio of its torque in a joint to the rms of that joint's free residual
SIZES = {"< 1": 0.0, "1–2": 1.0, "2–3": 2.0, "3–4": 3.0, "4–6": 4.0, "≥ 6": 6.0}
STATES: dict[str, Callable[[Row], Any]] = {
    "at rest": tables.equal(posture="rest"),
    "in motion": tables.equal(posture="motion"),
    "within 150 ms of a reversal": tables.equal(posture="reversal"),
    "all tendons stuck, pushed past break-away": lambda row: row["stuck"] and not row["stays"],
    "all tendons stuck, below break-away": tables.equal(stays=True),
}


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
    }


def free_recordings(folder: Path, parts: int) -> list[list[Recording]]:
    """By pretension."""
    return [[recording(folder, take) for take in takes("free", parts=parts, pretensions=(p,))] for p in PRETENSIONS]


def tuned_rivals(folder: Path, product: dict[str, Any], free: list[list[Recording]]) -> list[Detector]:
    """Rivals with the best thresholds each, kept as they are found."""
    file = folder / "rivals.json"
    tuned = from_json(file) if file.exists() else []
    rivals = make_rivals(product, read_recording(training_file(folder)), list(itertools.chain(*free)))
    for detector in rivals[len(tuned) :]:
        tuned.append(best_thresholds(detector, free))
        write(file, to_json(tuned))
        say(f"{detector.name}: {tuned[-1].description['contact']}")
    return tuned


def free_rms(reference: Detector, free: list[list[Recording]]) -> dict[float, Any]:
    """[n] N·m by pretension, before the bias update and without any detection."""
    squares = [
        [np.mean(reference.residual(reference.inputs(one)) ** 2, axis=0) for one in recordings] for recordings in free
    ]
    return {p: np.sqrt(np.mean(values, axis=0)) for p, values in zip(PRETENSIONS, squares, strict=True)}


def campaign(folder: Path, fingers: Sequence[Detector], parts: int, alone: bool, run: Run) -> str:
    """Everything that is not there yet, and the page of tables."""
    every = takes(*TWINS, *TWINS.values(), "free", parts=parts)
    run(made, {take.name: (folder, take) for take in every}, folder / "made")
    fitted = Detector.of_file("fitted", fitted_file(folder))
    free = free_recordings(folder, parts)
    rms = free_rms(fitted, free)
    pushes = [push for take in takes(*TWINS, parts=parts) for push in pushes_of(folder, take)]
    for push in pushes:
        size = max(abs(np.array(push["torque"])) / rms[push["pretension"]])
        push["class"] = [name for name, least in SIZES.items() if size >= least][-1]
    detectors = [Detector.of_file("description", INDEX_FINGER), fitted, *fingers]
    if not alone:
        detectors += tuned_rivals(folder, fitted.description, free)
    cases = {
        f"{take.name}-{detector.digest}": (folder, take, detector)
        for detector in detectors
        for take in takes(*TWINS, "free", parts=parts)
    }
    scores = run(scored, cases, folder / "scores")
    rows = [row for score in scores for row in _answers(pushes, score)]
    return report(rows, scores, [finger.name for finger in fingers])


def _answers(pushes: Rows, score: Row) -> list[dict[str, Any]]:
    """A row of each push of a recording."""
    of_recording = tables.where(pushes, **{key: score[key] for key in ("kind", "pretension", "part")})
    answers = zip(of_recording, score["found"], score["delay"], strict=True)
    return [{**push, "detector": score["detector"], "found": found, "delay": delay} for push, found, delay in answers]


# --- the page ---------------------------------------------------------------------------------------------------------


def report(rows: Rows, scores: Rows, detailed: Sequence[str]) -> str:
    strongest, next_size, third = list(SIZES)[:-4:-1]
    head = ["", *(f"{strongest}, {pretension:g} N" for pretension in PRETENSIONS), next_size, third]
    head += ["false alarms in 10 min, free", "between pushes", f"median delay of {strongest}, ms", "90 % within"]
    names = tables.values_of(rows, "detector")
    sections = {"In short": tables.table(head, [[name, *_summary(name, rows, scores)] for name in names])}
    sizes = {size: tables.equal(**{"class": size}) for size in SIZES}
    for name in detailed:
        of_finger = tables.where(rows, detector=name)
        sections[f"{name}: by state, all pretensions"] = tables.crossed(of_finger, STATES, sizes, _found)
    return tables.page(sections)


def _found(rows: Rows) -> str:
    return tables.count((row["found"] for row in rows), with_interval=True)


def _summary(detector: str, rows: Rows, scores: Rows) -> list[str]:
    """The largest pushes by pretension, the next sizes and the false alarms of all pretensions together."""
    rows, scores = tables.where(rows, detector=detector), tables.where(scores, detector=detector)
    strongest, *others = list(SIZES)[:-4:-1]
    strong = tables.where(rows, **{"class": strongest})
    cells = [_found(tables.where(strong, pretension=pretension)) for pretension in PRETENSIONS]
    cells += [_found(tables.where(rows, **{"class": size})) for size in others]
    for free in (True, False):
        counted = [row for row in scores if (row["kind"] == "free") == free]
        alarms, seconds = (sum(row[key] for row in counted) for key in ("alarms", "seconds"))
        cells.append(tables.events(alarms, seconds / 600) if seconds else tables.NOTHING)
    delays = tables.column(tables.where(strong, found=1.0), "delay")
    known = delays[~np.isnan(delays)]
    late = float(np.quantile(known, 0.9)) if len(known) else math.nan
    return [*cells, tables.median(known, ".0f", 1e3, with_interval=True), tables.number(late, ".0f", 1e3)]


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
