"""How well contact is detected: the campaign on the virtual hand (docs/evidence/fit.md).

300 pushes of 0.1 to 2 N in 30 min at 10, 20 and 40 N of pretension (detection_cases.py), a fit on free motion at low
pretension, simpler models with the best thresholds each (detection_rivals.py), and the best that could be done with the
residual (matched_detector.py).

    python bench/detection.py -o FOLDER [--finger NAME=FILE ...]

Recordings, the fit, the rivals with their thresholds and what they found are kept in the folder; fingers are run every
time. Writes detection.md, and detection.csv with a row for each push.
"""

from __future__ import annotations

import argparse
import csv
import json
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import matched_detector as matched
from detection_cases import (
    FINGER,
    PARTS,
    PRETENSIONS,
    TWINS,
    Numbers,
    Push,
    Take,
    fitted_file,
    pushes_of,
    read_truth,
    recording_file,
    states,
    takes,
    training_file,
)
from detection_rivals import Detector, HighPass, best_thresholds, from_json, make_rivals, to_json
from detection_table import Campaign, Free, Outcome, report
from tendonfmu.files.writing import whole_file
from tendonfmu.recordings.recording import Recording, read_recording

WINDOWS = (0.04, 0.3)  # s from the onset until the matched detector decides; every push is held for 0.3 s
STATES = ("rest", "motion", "setting off")  # as `states` counts them
KINDS = ("theory", "torque_known", "effect_known")
Row = dict[str, Any]  # of a detector on a recording


class Hand:
    """Recordings and truth in a folder, made where they are missing. parts: recordings of each kind and pretension."""

    def __init__(self, folder: Path, parts: int) -> None:
        self.folder, self.parts = folder, parts

    def takes(self, kind: str) -> Iterator[Take]:
        for pretension in PRETENSIONS:
            yield from takes(kind, pretension, self.parts)

    def recording(self, take: Take) -> Recording:
        return read_recording(recording_file(self.folder, take))

    def make(self) -> None:
        for kind in (*TWINS, *TWINS.values(), "free"):
            for take in self.takes(kind):
                say(f"{recording_file(self.folder, take)}")

    def pushes(self) -> list[Push]:
        """Of all pretensions and parts, in order."""
        return [push for kind in TWINS for take in self.takes(kind) for push in pushes_of(self.folder, take)]


def say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


def _kept(file: Path, text: str) -> None:
    with whole_file(file) as temporary:
        temporary.write_text(text, encoding="utf-8")


# --- detectors --------------------------------------------------------------------------------------------------------


def rivals(hand: Hand, product: dict[str, Any]) -> list[Detector]:
    """With the best thresholds each."""
    file = hand.folder / "rivals.json"
    tuned = from_json(file) if file.exists() else []
    free = [[hand.recording(take) for take in takes("free", pretension, hand.parts)] for pretension in PRETENSIONS]
    flat = [each for group in free for each in group]
    for detector in make_rivals(product, read_recording(training_file(hand.folder)), flat)[len(tuned) :]:
        tuned.append(best_thresholds(detector, free))
        _kept(file, to_json(tuned))
        say(f"{detector.name}: {tuned[-1].description['contact']}")
    return tuned


def run(hand: Hand, detectors: Sequence[Detector], kept: Path | None = None) -> list[Outcome]:
    """Every detector over every recording with pushes and without. kept: file with what has been run before."""
    rows: dict[str, list[Row]] = {}
    if kept is not None and kept.exists():
        rows = json.loads(kept.read_text(encoding="utf-8"))
    outcomes = [Outcome(detector.name) for detector in detectors]
    for take in (take for kind in (*TWINS, "free") for take in hand.takes(kind)):
        if take.name not in rows:
            recording = hand.recording(take)
            rows[take.name] = [_row(detector, recording) for detector in detectors]
            if kept is not None:
                _kept(kept, json.dumps(rows))
            say(f"{take.name}: {', '.join(detector.name for detector in detectors)}")
        for outcome, row in zip(outcomes, rows[take.name], strict=True):
            _add(outcome, take, row)
    return outcomes


def _row(detector: Detector, recording: Recording) -> Row:
    score = detector.score(recording)
    return {
        "found": [float(event.found) for event in score.events],
        "delay": [event.delay for event in score.events],
        "seconds": score.free_seconds,
        "alarms": len(score.false_alarms),
        "alarm_seconds": score.free_alarm_share * score.free_seconds,
    }


def _add(outcome: Outcome, take: Take, row: Row) -> None:
    outcome.found += row["found"]
    outcome.delay += row["delay"]
    place = outcome.between if take.kind in TWINS else outcome.free
    free = place.setdefault(take.pretension, Free())
    free.seconds += row["seconds"]
    free.alarms += row["alarms"]
    free.alarm_seconds += row["alarm_seconds"]


# --- the reference ----------------------------------------------------------------------------------------------------


def free_rms(hand: Hand, reference: Detector) -> dict[float, list[float]]:
    """[n] N·m by pretension, before the bias update and without any detection."""
    found = {}
    for pretension in PRETENSIONS:
        squares = [
            np.mean(reference.residual(reference.inputs(hand.recording(take))) ** 2, axis=0)
            for take in takes("free", pretension, hand.parts)
        ]
        found[pretension] = [float(value) for value in np.sqrt(np.mean(squares, axis=0))]
    return found


def run_matched(hand: Hand, reference: Detector, pushes: Sequence[Push]) -> list[Outcome]:
    """One outcome for each window and kind of knowledge."""
    file = hand.folder / f"matched_{reference.name}.json"
    if not file.exists():
        found = {_matched_name(kind, after): np.zeros(len(pushes)) for after in WINDOWS for kind in KINDS}
        for pretension in PRETENSIONS:
            free = [_free_means(hand, reference, take) for take in takes("free", pretension, hand.parts)]
            pushed = [take for kind in TWINS for take in takes(kind, pretension, hand.parts)]
            asked = [each for take in pushed for each in _asked(hand, reference, take, pushes)]
            mine = np.flatnonzero([push.pretension == pretension for push in pushes])
            for after in WINDOWS:
                quiet = [_states(hand, reference, take, after) for take in takes("free", pretension, hand.parts)]
                busy = np.concatenate([_states_at(hand, reference, take, pushes, after) for take in pushed])
                for state, says in enumerate(STATES):
                    own = np.flatnonzero(busy == state)
                    if not len(own):
                        continue
                    known = [matched.Quiet(each, still == state) for each, still in zip(free, quiet, strict=True)]
                    answer = matched.answer(known, [asked[k] for k in own], after)
                    for kind in KINDS:
                        found[_matched_name(kind, after)][mine[own]] = getattr(answer, kind)
                    what = f"{pretension:g} N, {1e3 * after:.0f} ms, {says}, {len(own)} pushes"
                    say(f"matched detector, {what}: limit of {answer.limit:.1f} standard deviations")
        _kept(file, json.dumps({name: values.tolist() for name, values in found.items()}))
    return [Outcome(name, values) for name, values in json.loads(file.read_text(encoding="utf-8")).items()]


def _matched_name(kind: str, after: float) -> str:
    return f"matched, {kind.replace('_', ' ')}, {1e3 * after:.0f} ms"


def _of(push: Push, take: Take) -> bool:
    return (push.kind, push.pretension, push.part) == (take.kind, take.pretension, take.part)


def _rate(time: Numbers) -> float:
    return 1.0 / float(np.median(np.diff(time)))


def _free_means(hand: Hand, reference: Detector, take: Take) -> Numbers:
    recording = hand.recording(take)
    return matched.means(reference.residual(reference.inputs(recording)), _rate(recording.time))


def _states(hand: Hand, reference: Detector, take: Take, after: float) -> NDArray[np.int64]:
    """[N] of every mean: the state at its middle."""
    truth = read_truth(hand.folder, take)
    rate, threshold = _rate(truth["time"]), float(reference.description["velocity_threshold"]["joint"])
    size = round(matched.STEP * rate)
    return states(truth["joint_velocity"], rate, threshold, after)[size // 2 :: size]


def _states_at(hand: Hand, reference: Detector, take: Take, pushes: Sequence[Push], after: float) -> NDArray[np.int64]:
    """[k] at the onsets of a recording's pushes, had there been none."""
    found = _states(hand, reference, take.twin, after)
    return found[[int(push.onset / matched.STEP) for push in pushes if _of(push, take)]]


def _asked(hand: Hand, reference: Detector, take: Take, pushes: Sequence[Push]) -> list[matched.Asked]:
    pushed, twin = (hand.recording(each) for each in (take, take.twin))
    with_push, without = (reference.residual(reference.inputs(each)) for each in (pushed, twin))
    passed = HighPass.of(reference.description, pushed.time, pushed.groups["tendon_force"])
    torque = read_truth(hand.folder, take)["external_torque"]

    def cut(signals: Numbers, push: Push) -> Numbers:
        return matched.cut(signals, pushed.time, push.onset, max(WINDOWS))

    asked = []
    for push in (push for push in pushes if _of(push, take)):
        begin = np.searchsorted(pushed.time, push.onset - 0.5)
        own = np.where((pushed.time >= push.onset - 0.1)[:, None], torque, 0.0)  # nothing of the push before
        filtered = np.zeros_like(torque)
        part = slice(int(begin), int(begin) + round(1.5 * _rate(pushed.time)))
        filtered[part] = passed(own[part])
        asked.append(matched.Asked(cut(filtered, push), cut(with_push - without, push), cut(with_push, push)))
    return asked


# --- the campaign -----------------------------------------------------------------------------------------------------


def campaign(folder: Path, fingers: Sequence[Detector], parts: int = PARTS, alone: bool = False) -> Campaign:
    """fingers: run beside the example's description and the fitted one, with the thresholds that they have.

    alone: without rivals and matched detectors.
    """
    hand = Hand(folder, parts)
    hand.make()
    fitted = Detector("fitted", json.loads(fitted_file(folder).read_text(encoding="utf-8")))
    described = Detector("description", json.loads(FINGER.read_text(encoding="utf-8")))
    pushes = hand.pushes()
    if alone:
        products = run(hand, [described, fitted, *fingers])
        names = [each.name for each in products]
        return Campaign(pushes, free_rms(hand, fitted), products, fitted.name, names)
    others = run(hand, rivals(hand, fitted.description), folder / "rival_outcomes.json")
    best = run_matched(hand, fitted, pushes)
    products = run(hand, [described, fitted, *fingers])
    detailed = [*(each.name for each in (*products, others[-1])), _matched_name("effect_known", max(WINDOWS))]
    return Campaign(pushes, free_rms(hand, fitted), [*products, *others, *best], fitted.name, detailed)


def write_pushes(file: Path, found: Campaign) -> None:
    """A row for each push: what was true of it, its size, and of every detector whether it was found, and the delay."""
    with whole_file(file) as temporary, temporary.open("w", newline="", encoding="utf-8") as stream:
        rows = []
        for k, (push, size) in enumerate(zip(found.pushes, found.sizes, strict=True)):
            row: dict[str, Any] = asdict(push) | {"size": float(size)}
            for name in ("torque", "excursion"):
                row |= {f"{name}[{j}]": value for j, value in enumerate(row.pop(name), start=1)}
            for outcome in found.outcomes:
                row[f"found: {outcome.name}"] = outcome.found[k]
                if outcome.delay:
                    row[f"delay: {outcome.name}"] = outcome.delay[k]
            rows.append(row)
        writer = csv.DictWriter(stream, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, help="folder of everything; default: a temporary one")
    parser.add_argument("--finger", action="append", default=[], metavar="NAME=FILE", help="run beside the others")
    parser.add_argument("--parts", type=int, default=PARTS, help="of 10 min and 100 pushes, by pretension")
    parser.add_argument("--alone", action="store_true", help="fingers alone, without rivals: a quarter of an hour")
    given = parser.parse_args()
    folder = given.output or Path(tempfile.mkdtemp())
    folder.mkdir(parents=True, exist_ok=True)
    fingers = []
    for each in given.finger:
        name, separator, file = each.partition("=")
        if not separator or not Path(file).is_file():
            parser.error(f"--finger {each}: expected NAME=FILE with a finger description that exists")
        fingers.append(Detector(name, json.loads(Path(file).read_text(encoding="utf-8"))))
    found = campaign(folder, fingers, given.parts, given.alone)
    write_pushes(folder / "detection.csv", found)
    text = report(found)
    _kept(folder / "detection.md", text)
    print(text)


if __name__ == "__main__":
    main()
