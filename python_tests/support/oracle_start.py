"""The oracle's friction as it stood before the first sample: docs/reference/semantics/bias.md#unlearned-start.

Part of the oracle (see oracle.py): naive, for tests alone, sharing no code with the runtime.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from oracle_finger import Effect, Places, Step

Array = NDArray[Any]

LEAST_UNLEARNED = 1e-12  # N·m of V: less counts as none
LEAST_LEFT = 1e-12  # of how an effect stood at the start: less counts as none


def gain_of(P: float, noise: float) -> float:
    """K of the Kalman step of step 6; 0 where nothing is uncertain."""
    return P / (P + noise) if P + noise != 0.0 else 0.0


class StartFriction:
    """V [n], step 4a. `remembers` or `sticks` for every effect of a sample, then `turn`; `learn` with each update."""

    def __init__(self, share: float | None, n: int, branches: Counter[str]) -> None:
        self.share, self.branches = share, branches
        self.unlearned = np.zeros(n)  # V

    def remembers(self, effect: Effect, kept: float, first: bool) -> None:
        """With `presliding`. kept: the share left of what was held before this sample."""
        if first:
            effect.start_left, kept = kept, 1.0
        effect.turned = effect.start_left * (1.0 - kept)

    def sticks(self, effect: Effect, F: float, first: bool) -> None:
        """Without. F: of the sample; b of a first exit takes it as standing that way already."""
        if first:
            effect.start_left = 1.0 if effect.stuck else 0.0
        effect.turned, effect.whole = (0.0 if effect.stuck else effect.start_left), 2.0 * abs(F)

    def turn(
        self, places: Iterable[tuple[str, Any, Effect]], turned: Places, f: Places,
        at_joints: Callable[[Places], Array], out: Step,
    ) -> None:  # fmt: skip
        """turned: zeros to fill. f: what multiplies an F. Derivatives hold V: a decision."""
        if self.share is None:
            return
        for kind, at, effect in places:
            getattr(turned, kind)[at] = effect.turned * effect.whole
            effect.start_left -= effect.turned
            if effect.start_left <= LEAST_LEFT:
                effect.start_left = 0.0
            self.branches["start_turned" if effect.turned > 0.0 else "start_stands"] += 1
        self.unlearned = out.decide(("unlearned",), self.unlearned + self.share * at_joints(turned * f))

    def forget(self, unwatched: Array) -> None:
        """Joints whose sensors fail."""
        self.unlearned = np.where(unwatched, 0.0, self.unlearned)

    def variance(self) -> Array:
        """[n] (N·m)², of an even distribution within ±V."""
        return np.asarray(self.unlearned**2 / 3.0)

    def learn(self, K: Array) -> None:
        self.unlearned = (1.0 - K) * self.unlearned
        self.unlearned[self.unlearned <= LEAST_UNLEARNED] = 0.0
