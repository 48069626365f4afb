"""Signals without noise and without phase lag, for what needs derivatives of positions."""

from __future__ import annotations

import numpy as np
from scipy.signal import butter, sosfiltfilt

from tendonfmu.arrays import Numbers

ORDER = 2  # of the Butterworth filter, run both ways (Gustafsson, 1996)


def zero_phase(values: Numbers, cutoff: float, rate: float) -> Numbers:
    """Low-pass signals forwards and backwards."""
    # values: [N, ...]; cutoff, rate: (Hz); returns [N, ...], without phase lag
    sections = butter(ORDER, min(cutoff, 0.45 * rate), fs=rate, output="sos")
    return np.asarray(sosfiltfilt(sections, values, axis=0, padlen=min(len(values) - 1, int(3 * rate / cutoff))))
