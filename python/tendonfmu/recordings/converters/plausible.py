"""Which sizes the columns of a recording have in fingers, and which unit a map should rather have."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tendonfmu.recordings.converters import units
from tendonfmu.recordings.converters.column_map import ColumnMap

# Largest magnitude that is believed, SI. A hand's tendon carries up to some hundred newtons and moves by centimetres;
# joints turn by less than one and a half turns.
LARGEST = {
    "tendon_force": 3000.0,
    "tendon_position": 1.0,
    "joint_position": 9.0,
    "joint_velocity": 200.0,
    "external_torque": 300.0,
}
# Smallest span that is believed to be motion; a smaller one is likely in too large a unit.
SMALLEST = {"tendon_position": 1e-5, "joint_position": 1e-3}
STEPS = (2e-6, 2.0)  # s; usual time from sample to sample


class Ranges:
    """Follows the ranges of columns, block by block."""

    def __init__(self, file: Path, wanted: ColumnMap) -> None:
        self._file, self._map = file, wanted
        self._ranges: dict[str, tuple[float, float]] = {}
        self._step = 0.0

    def add(self, columns: Mapping[str, NDArray[np.float64]]) -> None:
        """Take columns [N] in SI."""
        for key, values in columns.items():
            if len(values):
                low, high = self._ranges.get(key, (np.inf, -np.inf))
                self._ranges[key] = (min(low, float(values.min())), max(high, float(values.max())))
        if not self._step and len(columns["time"]) > 1:
            self._step = float(np.median(np.diff(columns["time"])))

    def notes(self) -> list[str]:
        """Return a sentence for each column whose unit is doubtful. A machine of any size may have one joint."""
        found = []
        if self._step and not STEPS[0] <= self._step <= STEPS[1]:
            found.append(
                f"{self._file}: warning: {self._map.columns['time'].path}: {self._step:.3g} s from sample to "
                "sample; is its unit right?"
            )
        if self._map.joint is not None:
            return found
        for key, (low, high) in self._ranges.items():
            group = key.split("[")[0]
            largest, span = max(abs(low), abs(high)), high - low
            too_large = largest > LARGEST.get(group, np.inf)
            too_small = 0.0 < span < SMALLEST.get(group, 0.0)
            if too_large or too_small:
                what = "more than a finger has" if too_large else "hardly a motion"
                found.append(
                    f"{self._file}: warning: {self._map.columns[key].path}: {low:.4g} to {high:.4g} {_si(group)}, "
                    f"{what}; is its unit right?"
                )
        return found


def _si(group: str) -> str:
    return next(unit for unit, value in units.OF_COLUMN[group].items() if value == 1.0)
