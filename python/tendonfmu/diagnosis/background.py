"""What a model gets wrong in both recordings alike: functions of the motion that no change may be credited with.

The background is a ridge regression on simple functions of angle, velocity, force, acceleration and travel, separate
for each joint, and on the columns of all candidates. Where a motion is repeated exactly, samples are subtracted instead
(`repeated_motion`), and almost nothing of these columns is left.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu.arrays import Array, Numbers
from tendonfmu.diagnosis.candidate_columns import CandidateColumns
from tendonfmu.diagnosis.remainder_features import Features, features
from tendonfmu.diagnosis.series import Series
from tendonfmu.model import moment_arms

GROUPS = (
    "angle",
    "friction over angle",
    "velocity",
    "force",
    "friction over force",
    "acceleration",
    "travel",
    "memory of direction",
    "interaction",
)
SHARE = 0.3  # of the residual's standard deviation: expected size of one function
MISSING = 3.0  # times the residual's standard deviation: expected size of an effect that is missing in both


def background_columns(
    data: Mapping[str, Any], series: Series, force: Numbers, columns: CandidateColumns, residual: Numbers, seed: int
) -> tuple[Array, Numbers]:
    """Return the columns [B, n, d], and the expected size of each weight [d]."""
    seen = features(series, force=force, seed=seed)
    arms = moment_arms(data)
    spread = residual[series.used].std(axis=0)
    parts, scales = [], []
    for joint in range(series.target.shape[1]):
        own = _of_joint(seen, joint, arms)
        block = np.zeros((*series.target.shape, len(own)), dtype=np.float32)
        block[:, joint] = seen.values[:, own]
        parts.append(block)
        scales.append(np.full(len(own), SHARE * max(float(spread[joint]), 1e-300)))
    parts.append(columns.values)
    scales.append(MISSING * float(spread.max()) / _sizes(columns, series))
    return np.concatenate(parts, axis=2), np.concatenate(scales)


def _of_joint(seen: Features, joint: int, arms: Numbers) -> NDArray[np.int64]:
    """Return the functions of this joint, or of a tendon that turns it."""
    tendons = [f"tendon {i + 1}" for i in np.flatnonzero(arms[:, joint])]
    names = {f"joint {joint + 1}", *tendons, *(f"{tendon} at joint {joint + 1}" for tendon in tendons)}
    names.add("")  # several states together
    chosen = np.isin(seen.group, GROUPS) & np.isin(seen.subject, sorted(names))
    return np.asarray(np.flatnonzero(chosen), dtype=np.int64)


def _sizes(columns: CandidateColumns, series: Series) -> Numbers:
    """Return the standard deviation of each column at the joint where it is largest [c]."""
    values = columns.values[series.used].astype(np.float64)
    return np.asarray(np.maximum(values.std(axis=0).max(axis=0, initial=0.0), 1e-300))
