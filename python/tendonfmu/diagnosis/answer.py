"""The answer to both questions, what a description lacks and what has changed: what their reports share."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from tendonfmu.arrays import Numbers
from tendonfmu.diagnosis.cause import Cause, CausePlace
from tendonfmu.diagnosis.effects import Place
from tendonfmu.diagnosis.extension_fit import FitSettings
from tendonfmu.diagnosis.gain import Gain
from tendonfmu.diagnosis.inputs import Input
from tendonfmu.diagnosis.pictures import Compared, evidence, residual_views, whiteness
from tendonfmu.diagnosis.result import Diagnosis, Unexplained
from tendonfmu.diagnosis.series import Series
from tendonfmu.diagnosis.signal_choice import Estimation
from tendonfmu.tasks import Phases


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
    chosen: Estimation,
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
        signals=chosen.words,
        smoothing=chosen.signals,
        least_gain=asked.least_gain,
        nominal=gain.nominal,
        extended=gain.extended,
        bias_only_rms=gain.bias_only_rms,
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


def too_small(cause: Cause) -> Cause:
    """Return a cause that is certain but not material, or not confirmed on unseen data."""
    return replace(cause, places=_places(cause), confusable_with=tuple(other.where for other in cause.alike))


def _places(cause: Cause) -> tuple[CausePlace, ...]:
    """Return the places of the terms of a cause, without numbers; a change is free at all of its places together."""
    if cause.changed is not None or not cause.terms:
        return (CausePlace(cause.joint, cause.tendon, {}),)
    return tuple(CausePlace(term.place.joint, term.place.tendon, {}) for term in cause.terms)
