"""The numbers that a fit was given: whether they were estimated before, whether to keep them, what became of them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np

from tendonfmu.estimate.evaluation import Evaluation, residual_entry
from tendonfmu.estimate.verdicts import CAUSES, Fitted
from tendonfmu.files import counted
from tendonfmu.model import Finger

FAR, MOST_NAMED = 2.0, 4  # a factor by which a number moves far, and such numbers named at most
ONE_LOAD = 1.5  # times the least load: a law whose friction grows with the load is not told from one that does not


def were_estimated(finger: Finger, said: str) -> bool:
    """Return whether the numbers of a description were estimated: `said` is "estimated", "guessed" or "auto".

    "auto" believes a description that says how uncertain its friction is: a fit wrote it.
    """
    return said == "estimated" or (said == "auto" and bool((finger.data["contact"] or {}).get("uncertainty")))


def is_worse(training: Sequence[Evaluation]) -> bool:
    """Return whether fitted numbers leave more of the samples held out than the given ones."""
    held = residual_entry(training, "held_out")
    return held is not None and float(np.sum(np.square(held["rms"]))) > float(np.sum(np.square(held["start_rms"])))


def one_load(training: Sequence[Evaluation]) -> tuple[float, float] | None:
    """Return the least and largest sum of tendon forces, N, if they are too alike to tell what depends on the load."""
    sums = [each.recording.recording.groups["tendon_force"][each.recording.train].sum(axis=1) for each in training]
    low, high = np.quantile(np.concatenate(sums), (0.05, 0.95)).tolist()
    return (low, high) if high < ONE_LOAD * low else None


def movement(
    numbers: Sequence[Fitted], change: float | None, kept: bool, load: tuple[float, float] | None
) -> dict[str, Any]:
    """Return how many numbers moved, which stayed, and why, for the report.

    `change` is by how much the given numbers may have changed if they are the prior; `load` is that of all samples.
    """
    moved = [number for number in numbers if abs(number.value - number.start) > number.standard_error]
    stayed = [number for number in numbers if abs(number.value - number.start) <= number.standard_error]
    return {
        "start": "guessed" if change is None else "estimated",
        "kept": kept,
        "moved": len(moved),
        "stayed": [number.number.path for number in stayed],
        "paragraph": " ".join([*_sentences(len(moved), stayed, change, kept, load), *_far(moved)]),
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


def _sentences(
    moved: int, stayed: Sequence[Fitted], change: float | None, kept: bool, load: tuple[float, float] | None
) -> list[str]:
    if kept:
        return ["The given numbers are kept: fitted ones leave more of the samples that were held out."]
    sentences = []
    if change is not None:
        sentences.append(
            f"The given numbers were estimated before: each may have changed by {100 * change:g} % (--change); "
            "--start guessed lets the data alone decide."
        )
    sentences.append(f"{counted(moved, 'number')} moved by more than the standard error")
    reasons = Counter(number.cause for number in stayed)
    why = [f"{count} {CAUSES[cause]}" for cause, count in reasons.most_common() if cause]
    if reasons[""]:
        why.append(f"{reasons['']} agrees with the data" if reasons[""] == 1 else f"{reasons['']} agree with the data")
    sentences[-1] += f"; {len(stayed)} stayed ({'; '.join(why)})." if stayed else "."
    if load and change is None:
        sentences.append(
            f"All samples have nearly the same load ({load[0]:.3g} to {load[1]:.3g} N in all tendons together): under "
            "another load the fitted numbers may be worse than the given ones; add recordings with more and less "
            "pretension, or say --start estimated."
        )
    return sentences
