"""Which effects a recording cannot show: the refit absorbs them, or an ordinary size is lost beside the rest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tendonfmu.diagnosis.cause_selection import Selection, names_with
from tendonfmu.diagnosis.hypotheses import HERE, Hypothesis, Key
from tendonfmu.diagnosis.named_cause import NamedCause
from tendonfmu.diagnosis.result import ABSORBED

SMALLEST_GAIN = 1e-6  # where every gain counts as material


@dataclass(frozen=True)
class Unseen:
    """An effect at a place, and what keeps it from being seen."""

    hypothesis: Hypothesis
    share: float  # share of its variance that survives the refit
    gain: float  # 1 − rms ratio that an ordinary size would bring, and that a cause has to bring
    needed: float

    @property
    def nearness(self) -> float:
        """How near it is to being visible; from 1 on it is."""
        return min(self.share / ABSORBED, self.gain / max(self.needed, SMALLEST_GAIN))


def unseen_effects(
    selection: Selection, causes: Sequence[NamedCause], known: Sequence[NamedCause], least_gain: float
) -> list[Unseen]:
    """Return, for each place at which an effect of ordinary size would not become a cause, its best shape."""
    places = {(cause.effect, term.place.joint, term.place.tendon) for cause in known for term in cause.accepted}
    names = [cause.effect for cause in causes]
    best: dict[Key, Unseen] = {}
    for hypothesis, share in zip(selection.hypotheses, selection.shares, strict=True):
        if hypothesis.level != HERE or hypothesis.key in places:
            continue
        gain = selection.grams.ordinary_gain(hypothesis.mix, np.array(hypothesis.members[0].shape.expected))
        own = Unseen(hypothesis, share, gain, least_gain * names_with(hypothesis.effect, names))
        if hypothesis.key not in best or own.nearness > best[hypothesis.key].nearness:
            best[hypothesis.key] = own
    hidden = [effect for effect in best.values() if effect.nearness < 1.0]
    return sorted(hidden, key=lambda effect: -effect.nearness)
