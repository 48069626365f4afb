"""`tendonfmu.Runner` for versions of tendonfmu that lack it: the same call for each sample, more slowly."""

from __future__ import annotations

from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any

import numpy as np

from tendonfmu.model import Finger


class Runner:
    """A finger in a control loop: it takes one sample after the other."""

    def __init__(self, description: Mapping[str, Any], kinematics: int = 1) -> None:
        self._finger = Finger.from_description(description, kinematics)

    def step(self, time: float, **signals: np.ndarray) -> SimpleNamespace:
        """Outputs of the model at a sample: arrays [n]."""
        columns = {name: values[None, :] for name, values in signals.items()}
        outputs = self._finger.run({"time": np.array([time]), **columns})
        return SimpleNamespace(**{name: values[0] for name, values in outputs.items()})
