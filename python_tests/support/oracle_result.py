"""What the oracle gives: of one sample, and of a run.

Part of the oracle (see oracle.py): naive, for tests alone, sharing no code with the runtime.
"""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from oracle_detection import NEAR

Array = NDArray[Any]
Key = tuple[Any, ...]


@dataclass
class Result:
    """Outputs of a run and what the agreement rule and the branch counts need.

    outputs: name -> [N, n], [N, m], [N] (`contact`) or [N, n, m + 3] (`friction_parts`).
    velocity_margin, residual_margin, force_margin: [N], smallest distance of the sample to a
        threshold (m/s or rad/s, N.m, N); evidence, in s, counts with the residual.
    alternatives: sample -> {decision key: values the decision may also take within NEAR}.
    branches: how often each branch was taken.
    """

    outputs: dict[str, Array]
    velocity_margin: Array
    residual_margin: Array
    force_margin: Array
    alternatives: dict[int, dict[Key, list[Any]]]
    branches: Counter[str]

    @property
    def near(self) -> Array:
        """[N] bool: samples within NEAR of some threshold."""
        smallest = np.minimum(np.minimum(self.velocity_margin, self.residual_margin), self.force_margin)
        return np.asarray(smallest < NEAR)


@dataclass
class Step:
    """What one sample yields besides the change of the state."""

    values: dict[str, Array] = field(default_factory=dict)
    velocity_margin: float = math.inf
    residual_margin: float = math.inf
    force_margin: float = math.inf
    decisions: dict[Key, Any] = field(default_factory=dict)
    alternatives: dict[Key, list[Any]] = field(default_factory=dict)
