"""The numbers that a fit was given: whether they were estimated before, whether to keep them, what became of them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from tendonfmu.arrays import Data
from tendonfmu.estimate.core_runs import CoreRuns
from tendonfmu.estimate.evaluation import Evaluation, residual_entry
from tendonfmu.estimate.slow_drift import SlowDrift
from tendonfmu.estimate.verdicts import CAUSES, Fitted
from tendonfmu.files import counted
from tendonfmu.recordings import FitRecording

FAR, MOST_NAMED = 2.0, 4  # a factor by which a number moves far, and such numbers named at most


def unseen_square(data: Data, recordings: Sequence[FitRecording]) -> float:
    """Return Σ r² over the samples held out and all joints, (N·m)², without a learning bias; 0 without any."""
    unseen = [replace(recording, train=recording.held_out) for recording in recordings if recording.held_out.any()]
    if not unseen:
        return 0.0
    runs = CoreRuns(data, unseen)
    return float(np.sum(SlowDrift(runs.time, runs.stretch, runs.used).without(runs.residual()) ** 2))


def is_worse(training: Sequence[Evaluation]) -> bool:
    """Return whether fitted numbers leave more of the samples held out than the given ones."""
    held = residual_entry(training, "held_out")
    return held is not None and float(np.sum(np.square(held["rms"]))) > float(np.sum(np.square(held["start_rms"])))


def movement(numbers: Sequence[Fitted], estimated: bool, kept: bool) -> dict[str, Any]:
    """Return how many numbers moved, which stayed, and why, for the report."""
    moved = [number for number in numbers if abs(number.value - number.start) > number.standard_error]
    stayed = [number for number in numbers if abs(number.value - number.start) <= number.standard_error]
    return {
        "start": "estimated" if estimated else "guessed",
        "kept": kept,
        "moved": len(moved),
        "stayed": [number.number.path for number in stayed],
        "paragraph": " ".join([*_sentences(len(moved), stayed, estimated, kept), *_far(moved)]),
    }


def _far(moved: Sequence[Fitted]) -> list[str]:
    """Name the numbers that moved by more than a factor, the farthest first."""
    ratios = [
        (max(number.value / number.start, number.start / number.value), number)
        for number in moved
        if number.start > 0.0 and number.value > 0.0 and abs(number.value - number.start) > 3.0 * number.standard_error
    ]
    far = sorted((each for each in ratios if each[0] > FAR), key=lambda each: -each[0])
    if not far:
        return []
    named = [f"{each.number.path} {each.start:.3g} → {each.value:.3g}" for _, each in far[:MOST_NAMED]]
    more = f" and {len(far) - MOST_NAMED} more" if len(far) > MOST_NAMED else ""
    return [f"Moved by more than a factor of {FAR:g}: {'; '.join(named)}{more}."]


def _sentences(moved: int, stayed: Sequence[Fitted], estimated: bool, kept: bool) -> list[str]:
    if kept:
        return ["The given numbers are kept: fitted ones leave a larger error on the held-out samples."]
    sentences = ["The given numbers were estimated before."] if estimated else []
    sentences.append(f"{counted(moved, 'number')} moved by more than their standard errors")
    reasons = Counter(number.cause for number in stayed)
    why = [f"{count}: {CAUSES[cause]}" for cause, count in reasons.most_common() if cause]
    if reasons[""]:
        why.append(f"{reasons['']}: the data agree with the given value{'s' * (reasons[''] > 1)}")
    sentences[-1] += f"; {len(stayed)} stayed ({'; '.join(why)})." if stayed else "."
    return sentences
