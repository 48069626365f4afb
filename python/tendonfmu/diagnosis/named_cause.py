"""A cause as a search finds it, and whether the sensors can show its size."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from tendonfmu.arrays import Numbers
from tendonfmu.diagnosis.extension_fit import Accepted
from tendonfmu.diagnosis.hypotheses import Hypothesis, Key
from tendonfmu.diagnosis.least_sizes import LeastSizes
from tendonfmu.model import extended_row
from tendonfmu.statistics import Interval


@dataclass(frozen=True)
class NamedCause:
    """A cause as it was found."""

    effect: str  # where it is; None everywhere
    joint: int | None
    tendon: int | None
    accepted: tuple[Accepted, ...]  # its places, in the form that a description takes
    gain: float  # 1 − rms with / rms without on held-out folds, and its standard error
    error: float
    p_value: float
    alike: tuple[Hypothesis, ...]  # what the data cannot distinguish from it
    hypothesis: Hypothesis | None = None  # as it was selected; None if it is part of the start
    measured: Interval | None = None  # gain on unseen data as it runs online

    @property
    def key(self) -> Key:
        return self.effect, self.joint, self.tendon

    @property
    def interval(self) -> Interval:
        """The measured gain; without one, the gain on held-out folds with its 95 % interval."""
        return self.measured or Interval(self.gain, self.gain - 1.96 * self.error, self.gain + 1.96 * self.error)


def accepted_of(hypothesis: Hypothesis, magnitudes: Numbers) -> tuple[Accepted, ...]:
    """Return the places of a hypothesis with its common magnitudes [d], in the form that `extension_fit` takes."""
    return tuple(
        Accepted(
            member.proposal.candidate,
            member.proposal.place,
            dict(member.shape.shape),
            tuple(float(weight * value) for weight, value in zip(member.weights, magnitudes, strict=True)),
        )
        for member in hypothesis.members
    )


def is_shown(cause: NamedCause, data: Mapping[str, Any], least: LeastSizes) -> bool:
    """Return whether the sensors can show the size that a cause has in a fitted description."""
    rows = [extended_row(data, cause.effect, term.place) for term in cause.accepted]
    return all(least.shows(cause.effect, term.place, row) for term, row in zip(cause.accepted, rows, strict=True))
