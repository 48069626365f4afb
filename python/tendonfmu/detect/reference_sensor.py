"""Contact that a reference sensor shows: labels from `external_torque`, and the check that motion is free."""

from __future__ import annotations

import numpy as np

from tendonfmu.arrays import Flags, Numbers
from tendonfmu.errors import InputError
from tendonfmu.files import counted
from tendonfmu.recordings import Recording

BEYOND_NOISE = 6.0  # times the noise of the sensor: a larger mean over `SMOOTHED` is contact
SMOOTHED = 0.05  # s
LEAST_SHARE = 0.05  # of a joint's largest torque: less in a recording with contact is the sensor's own error
AROUND = 0.1  # s, on both sides of a contact that is left out: a touch begins below any threshold


def sensed_contact(recording: Recording) -> tuple[Flags, Numbers] | None:
    """Return [N] whether a reference sensor shows contact, and [n] the torque from which on (N·m); None without one."""
    reference = recording.groups.get("external_torque")
    if reference is None:
        return None
    off = _off(reference, recording.time)
    threshold = np.maximum(_noise_limit(reference), LEAST_SHARE * off.max(axis=0))
    return np.asarray((off > threshold).any(axis=1)), threshold


def touched(recording: Recording) -> Flags:
    """Return [N] whether a label or a reference sensor shows contact, with `AROUND` on both sides."""
    sensed = sensed_contact(recording)
    flags = np.zeros(len(recording), dtype=bool) if recording.contact is None else recording.contact.astype(bool)
    time = recording.time[flags | sensed[0] if sensed else flags]
    if not len(time):
        return np.zeros(len(recording), dtype=bool)
    after = np.searchsorted(time, recording.time + AROUND, side="right")
    return np.asarray(after > np.searchsorted(time, recording.time - AROUND, side="left"))


def require_no_contact(recording: Recording) -> None:
    """Check that neither a label nor a reference sensor shows contact."""
    label = recording.contact
    if label is not None and label.any():
        first = int(np.flatnonzero(label)[0])
        raise InputError(
            f"{recording.path}: column contact, row {first + 1}: 1 at {recording.time[first]:.6g} s, and in "
            f"{counted(int(label.sum()), 'sample')}; expected 0 throughout: false alarms are counted in free motion"
        )
    reference = recording.groups.get("external_torque")
    if reference is None:
        return
    most = _noise_limit(reference)
    wrong = np.argwhere(_off(reference, recording.time) > most)
    if len(wrong):
        row, j = wrong[0]
        raise InputError(
            f"{recording.path}: column external_torque[{j + 1}], row {row + 1}: {reference[row, j]:.4g} N.m at "
            f"{recording.time[row]:.6g} s; expected at most {most[j]:.2g} N.m from its median "
            f"({BEYOND_NOISE:g} times its noise), as in free motion"
        )


def _off(reference: Numbers, time: Numbers) -> Numbers:
    """Return [N, n] how far the running mean over about `SMOOTHED` is from the median."""
    values = reference - np.median(reference, axis=0)
    width = 1 if len(time) < 2 else max(1, min(len(time), round(SMOOTHED / float(np.median(np.diff(time))))))
    total = np.cumsum(np.vstack([np.zeros((1, values.shape[1])), values]), axis=0)
    begin = np.clip(np.arange(len(values)) - width // 2, 0, len(values) - width)
    return np.asarray(np.abs(total[begin + width] - total[begin]) / width)


def _noise_limit(reference: Numbers) -> Numbers:
    """Return [n] the largest torque that may be noise."""
    # from differences, so that contact does not count as noise; 90 % of a normal distribution lies within 1.645 σ
    step = np.diff(reference, axis=0) if len(reference) > 1 else np.zeros((1, reference.shape[1]))
    return np.asarray(BEYOND_NOISE * np.quantile(np.abs(step), 0.9, axis=0) / (1.645 * np.sqrt(2.0)) + 1e-9)
