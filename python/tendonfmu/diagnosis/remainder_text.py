"""How the remainder reads in plain words: which joint, what it follows, at which angles, when, how fast."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np
from scipy.signal import welch

from tendonfmu.arrays import Numbers
from tendonfmu.diagnosis.remainder_features import GROUPS, Finding

if TYPE_CHECKING:
    from tendonfmu.diagnosis.series import Series


CONCENTRATED = 1.6  # times as much of the prediction's power as of the time, to report a concentration


def described(
    series: Series, residual: Numbers, prediction: Numbers, findings: Sequence[Finding], share: Sequence[float]
) -> str:
    """Return one sentence for each joint that has findings, the joint with the greatest share first."""
    joints = sorted({finding.joint for finding in findings}, key=lambda joint: -share[joint - 1])
    sentences = []
    for joint in joints:
        own = [finding for finding in findings if finding.joint == joint]
        what = " and ".join(dict.fromkeys(_what(own[:3])))
        where = _where(series, prediction[:, joint - 1], joint, own)
        sentences.append(f"Joint {joint}: {_part(share[joint - 1])} follows {what}{where}.")
    return " ".join(sentences)


def _part(share: float) -> str:
    if share < 0.01:
        return "a small but certain, fast-changing part of what is left"
    return f"{100.0 * share:.0f} % of the variance of what is left"


def _what(findings: Sequence[Finding]) -> Iterator[str]:
    """Yield what each finding follows; all oscillations are listed together, at the first one."""
    lines = [finding.line for finding in findings if finding.line is not None]
    mentioned = False
    for finding in findings:
        if finding.line is None:
            subject = f", {finding.subject}" if finding.subject else ""
            yield f"{GROUPS[finding.group]}{subject}"
        elif not mentioned:
            mentioned = True
            frequencies, sizes = (
                _listed([f"{value:.{digits}g}" for value in values])
                for values, digits in (
                    ([line.frequency for line in lines], 3),
                    ([1000.0 * line.amplitude for line in lines], 2),
                )
            )
            steady = "a steady oscillation" if len(lines) == 1 else "steady oscillations"
            yield f"{steady} at {frequencies} Hz of {sizes} mN·m, independent of the motion"


def _listed(values: Sequence[str]) -> str:
    """Join values as in "1, 2 and 3"."""
    return " and ".join(filter(None, [", ".join(values[:-1]), values[-1]]))


def _where(series: Series, part: Numbers, joint: int, findings: Sequence[Finding]) -> str:
    """Return where and when most of the prediction is, unless it is everywhere."""
    used = series.used
    power = part[used] ** 2
    if all(finding.line is not None for finding in findings) or not power.sum():
        return ""
    notes = []
    angles = _stretch(series.angle[used, joint - 1], power)
    if angles:
        notes.append(f"mostly at angles of joint {joint} from {angles[0]:.2f} to {angles[1]:.2f} rad")
    times = _stretch(series.time[used], power) if len(np.unique(series.recording)) == 1 else None
    if times:
        notes.append(f"mostly from {times[0]:.0f} to {times[1]:.0f} s")
    frequency, density = welch(np.where(used, part, 0.0), 1.0 / series.step, nperseg=min(len(part), 1024))
    total = np.cumsum(density)
    notes.append(f"half of it below {frequency[np.searchsorted(total, 0.5 * total[-1])]:.2g} Hz")
    return " (" + ", ".join(notes) + ")"


def _stretch(coordinate: Numbers, power: Numbers) -> tuple[float, float] | None:
    """Return the third of the time, sorted by the coordinate, with most of the power; None if it is spread evenly."""
    order = np.argsort(coordinate)
    summed = np.concatenate([[0.0], np.cumsum(power[order])]) / power.sum()
    width = len(order) // 3
    inside = summed[width:] - summed[:-width]
    start = int(np.argmax(inside))
    if inside[start] < CONCENTRATED / 3.0:
        return None
    chosen = coordinate[order[start : start + width]]
    return float(chosen[0]), float(chosen[-1])
