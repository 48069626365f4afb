"""The answer to both questions, what a description lacks and what has changed: what their reports share."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from tendonfmu.arrays import Numbers
from tendonfmu.diagnosis.cause import Cause, CausePlace, Key
from tendonfmu.diagnosis.effects import Place
from tendonfmu.diagnosis.extension_fit import FitSettings
from tendonfmu.diagnosis.gain import Gain
from tendonfmu.diagnosis.inputs import Input
from tendonfmu.diagnosis.pictures import Compared, evidence, residual_views, whiteness
from tendonfmu.diagnosis.result import Diagnosis, Unexplained
from tendonfmu.diagnosis.selection import SIGNIFICANCE
from tendonfmu.diagnosis.series import Series
from tendonfmu.statistics import Interval
from tendonfmu.tasks import Phases

MOST_LONGER = 10.0  # times the duration: beyond, another motion is the better advice
MARGIN = 1.2  # times the duration at which the interval would just end at 0
OTHER_MOTION = "repeat the test with another motion, at two pretensions"


@dataclass(frozen=True)
class Asked:
    """What is asked of a diagnosis."""

    given: Input
    least_gain: float  # share of the rms that a cause must remove
    seed: int
    settings: FitSettings
    phases: Phases


def answered(
    asked: Asked,
    gain: Gain,
    compared: tuple[Series, Numbers, Numbers],  # the series, and what is left without and with the causes [B, n]
    *,
    causes: Sequence[Cause],
    unexplained: Unexplained,
    warnings: Sequence[str],
    load_at_joints: Numbers | None = None,  # torque to be explained, N·m [B, n]
    **others: Any,  # fields of `Diagnosis`
) -> Diagnosis:
    """Return the diagnosis; its duration is still 0."""
    given = asked.given
    explained = bool(causes) or others.get("load") is not None
    return Diagnosis(
        finger=given.finger.name,
        verdict=_verdict(explained, unexplained.unknown),
        recordings=tuple(str(recording.path) for recording in given.training),
        tests=tuple(str(recording.path) for recording in given.tests),
        references=tuple(str(recording.path) for recording in given.reference),
        held_out=gain.held_out,
        seconds=0.0,
        seed=asked.seed,
        least_gain=asked.least_gain,
        nominal=gain.nominal,
        extended=gain.extended,
        bias_only_rms=gain.bias_only_rms,
        delivered=gain.delivered,
        gain=gain.value,
        steps=gain.steps,
        causes=tuple(causes),
        unexplained=unexplained,
        views=residual_views(*compared, load=load_at_joints),
        whiteness=whiteness(*compared),
        warnings=(*given.warnings, *warnings),
        **others,
    )


def _verdict(explained: bool, unknown: bool) -> str:
    if explained:
        return "partly explained" if unknown else "explained"
    return "unexplained" if unknown else "adequate"


def reported(cause: Cause, compared: Compared) -> Cause:
    """Return a cause with all its numbers, its rivals and its picture."""
    return replace(
        cause,
        parameters={path: number for place in cause.places for path, number in place.parameters.items()},
        confusable_with=tuple(other.where for other in cause.alike),
        evidence=evidence(cause.effect, [Place(place.joint, place.tendon) for place in _places(cause)], compared),
    )


def not_taken(causes: Iterable[Cause], experiments: Mapping[Key, str], seconds: float) -> dict[str, Any]:
    """Divide causes that are significant but were not taken into those that are too small and the uncertain ones."""
    # `experiments` names those planned; `seconds` of unseen motion were judged
    small, uncertain = list[Cause](), list[Cause]()
    for cause in causes:
        cause = replace(cause, places=_places(cause), confusable_with=tuple(other.where for other in cause.alike))
        if cause.gain.low > 0.0 or cause.p_value >= SIGNIFICANCE:
            small.append(cause)
        else:
            settling = _longer(cause.gain, seconds) or experiments.get(cause.key) or OTHER_MOTION
            uncertain.append(replace(cause, experiment=settling))
    return {"too_small": tuple(small), "uncertain": tuple(uncertain)}


def _longer(gain: Interval, seconds: float) -> str:
    """Return how long a recording would settle a gain: its error falls with the root of the duration."""
    factor = ((gain.value - gain.low) / gain.value) ** 2 if gain.value > 0.0 else math.inf
    if not factor <= MOST_LONGER:
        return ""
    needed = 10.0 * math.ceil(MARGIN * factor * seconds / 10.0)
    return f"test on {needed:.0f} s of such motion, in place of {seconds:.0f} s"


def _places(cause: Cause) -> tuple[CausePlace, ...]:
    """Return the places of the terms of a cause, without numbers; a change is free at all of its places together."""
    if cause.changed is not None or not cause.terms:
        return (CausePlace(cause.joint, cause.tendon, {}),)
    return tuple(CausePlace(term.place.joint, term.place.tendon, {}) for term in cause.terms)
