"""Whether what is left of a residual is unknown: it can be predicted, and correcting it would be material."""

from __future__ import annotations

import numpy as np

from tendonfmu.arrays import Numbers
from tendonfmu.diagnosis.remainder import Remainder
from tendonfmu.diagnosis.result import Unexplained
from tendonfmu.diagnosis.selection import CERTAIN
from tendonfmu.statistics import Interval, standard_error


def unexplained_of(left: Remainder, looked_at: Numbers, everything: Numbers, least_gain: float) -> Unexplained:
    """Return the share of the remaining variance that unseen stretches show to be no noise."""
    # looked_at, everything: [n] (N·m)
    part = np.divide(looked_at, everything, out=np.zeros_like(looked_at), where=everything > 0.0)
    shares = np.clip(np.array(left.share), 0.0, 1.0) * part
    whole = float(everything.sum())
    share = float(shares @ everything) / whole if whole > 0.0 else 0.0
    square = float(left.square.sum()) * (whole / float(looked_at.sum()) if looked_at.any() else 1.0)
    half = CERTAIN * standard_error(left.gain.sum(axis=1)) / square if square > 0.0 else 0.0
    gain = Interval(*(1.0 - float(np.sqrt(1.0 - min(end, 1.0))) for end in (share, share - half, share + half)))
    unknown = left.unknown and gain.value >= least_gain and gain.low > 0.0
    description = left.description if unknown else ""
    return Unexplained(share, description, tuple(shares.tolist()), left.p_value, bool(unknown), gain)
