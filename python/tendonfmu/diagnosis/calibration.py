"""Whether several sensors are a little off at once: a joint look at gains and zeros of forces, moment arms and delay.

Each alone removes little of the error. Together they are a ridge regression: every correction is expected to be as
large as a bench usually has it, and how strongly this counts is chosen by the error on unseen stretches. They are one
cause, named if it is certainly better than the best single effect, so that one sensor that is off has its own name.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from tendonfmu.arrays import Numbers
from tendonfmu.diagnosis.candidate_columns import Proposal
from tendonfmu.diagnosis.effects import BY_NAME, CALIBRATED, CALIBRATION, Place, Term, Where
from tendonfmu.diagnosis.result import ABSORBED, EVERYWHERE, Cause, CausePlace, Direction, Sensor, with_error
from tendonfmu.diagnosis.selection import CERTAIN, Selection, rms_gain, step_p_value
from tendonfmu.diagnosis.view import View
from tendonfmu.model import moment_arms
from tendonfmu.statistics import Interval

STRENGTHS = (0.03, 0.1, 0.3, 1.0, 3.0)  # of the prior knowledge; 1 takes the usual sizes at their word
# Root mean square of all corrections, in usual sizes. Larger ones imitate something else that is missing.
PLAUSIBLE = 1.5
LARGEST = 5.0  # times the usual size
_SHOWN = 3  # sensors named in the size
# Standard deviations on a bench that was set up with ordinary care; of a moment arm as a share of the described one.
USUAL = {"force_gain": 0.03, "force_offset": 0.3, "moment_arm": 0.03, "time_delay": 0.002}


@dataclass(frozen=True)
class _Part:
    """A correction that may be needed."""

    proposal: Proposal
    usual: float  # size in the unit of the magnitude
    unit: float  # what a magnitude of 1 is, in the unit of the number


def calibration(view: View, selection: Selection, tried: Collection[str], least_gain: float) -> Cause | None:
    """Return all corrections together, if they are material and certain; `tried` are effects that were refused."""
    if CALIBRATION in tried:
        return None
    parts = _parts(view, tried)
    best = _estimated(view, selection, parts)
    if best is not None and not _late_enough(view, best, parts):
        parts = [part for part in parts if part.proposal.candidate.name != "time_delay"]
        best = _estimated(view, selection, parts)
    if best is None:
        return None
    gain, error = selection.gain(best)
    if gain < least_gain or gain <= CERTAIN * error:
        return None
    p_value = min(1.0, len(STRENGTHS) * step_p_value(selection.base, best.unseen))
    terms = tuple(_term(part, value) for part, value in zip(parts, best.magnitudes.tolist(), strict=True))
    return replace(
        best, gain=with_error(gain, error), p_value=p_value, terms=terms, sensors=_sensors(view, best, parts)
    )


def is_better(together: Cause, single: Cause | None, least_gain: float) -> bool:
    """Return whether all corrections together are materially and certainly better than the best single effect."""
    if single is None:
        return True
    gain, error = rms_gain(single.unseen, together.unseen)
    return gain >= least_gain and gain > CERTAIN * error


def _parts(view: View, tried: Collection[str]) -> list[_Part]:
    """Return the corrections that the description lacks and that refitting leaves visible."""
    arms, count = moment_arms(view.data), view.columns.values.shape[2]
    parts: dict[Where, _Part] = {}
    for proposal in view.columns.proposals:
        name, place = proposal.candidate.name, proposal.place
        if name not in CALIBRATED or name in tried:
            continue
        usual, unit = USUAL[name], 1.0
        if name == "moment_arm" and place.joint is not None and place.tendon is not None:
            usual *= abs(float(arms[place.tendon - 1, place.joint - 1]))
        if name == "time_delay":
            unit = float(proposal.variant.shape["delay"])
            usual /= abs(unit)
        mix = np.zeros((count, 1))
        mix[proposal.columns] = 1.0
        if usual > 0.0 and unit > 0.0 and view.grams.surviving(mix) >= ABSORBED:
            parts.setdefault(Where(name, *place), _Part(proposal, usual, unit))
    return list(parts.values())


def _estimated(view: View, selection: Selection, parts: Sequence[_Part]) -> Cause | None:
    """Return the corrections with the strength of the prior knowledge that leaves least on unseen stretches."""
    if not parts:
        return None
    usual = np.array([part.usual for part in parts])
    mix = np.zeros((view.columns.values.shape[2], len(parts)))
    mix[[part.proposal.columns.start for part in parts], np.arange(len(parts))] = 1.0
    row = BY_NAME[CALIBRATION]
    direction = Direction(mix, -LARGEST * usual, LARGEST * usual, EVERYWHERE, usual)
    cause = Cause(Where(CALIBRATION), row.title, row.explanation, direction=direction)
    fits = [selection.regularised(cause, view.grams.ridge(usual, strength)) for strength in STRENGTHS]
    plausible = [fit for fit in fits if np.mean((fit.magnitudes / usual) ** 2) <= PLAUSIBLE**2]
    return min(plausible, key=lambda fit: float(fit.unseen.sum()), default=None)


def _late_enough(view: View, cause: Cause, parts: Sequence[_Part]) -> bool:
    """Return whether the sensors can show the delay."""
    return all(
        abs(part.unit * magnitude) >= view.least.least(Where("time_delay"))
        for part, magnitude in zip(parts, cause.magnitudes.tolist(), strict=True)
        if part.proposal.candidate.name == "time_delay"
    )


def _term(part: _Part, magnitude: float) -> Term:
    """Return a term of that size; a fit leaves it as it is, except for a delay, which is not linear."""
    proposal = part.proposal
    if proposal.candidate.name == "time_delay":
        return Term(proposal.candidate, proposal.place, {"delay": part.unit * magnitude}, (1.0,))
    return Term(proposal.candidate, proposal.place, proposal.variant.shape, (magnitude,), fixed=True)


# --- by how much each is off ------------------------------------------------------------------------------------------


def _sensors(view: View, cause: Cause, parts: Sequence[_Part]) -> tuple[Sensor, ...]:
    """Return each correction, and gain and arm of a tendon together where only these can be determined."""
    arms = moment_arms(view.data)
    index = {(part.proposal.candidate.name, part.proposal.place): k for k, part in enumerate(parts)}
    rows: list[tuple[Where, str, Numbers]] = []
    for (name, place), k in index.items():
        unit = {"force_gain": "1", "force_offset": "N", "moment_arm": "m", "time_delay": "s"}[name]
        alone = np.zeros(len(parts))
        alone[k] = parts[k].unit
        rows.append((Where(name, *place), unit, alone))
        gain = index.get(("force_gain", Place(tendon=place.tendon)))
        if name == "moment_arm" and gain is not None and place.joint is not None and place.tendon is not None:
            both = alone / float(arms[place.tendon - 1, place.joint - 1])
            both[gain] = 1.0
            rows.append((Where(CALIBRATION, *place), "1", both))
    return tuple(
        Sensor(where, with_error(float(mix @ cause.magnitudes), float(np.sqrt(mix @ cause.covariance @ mix))), unit)
        for where, unit, mix in rows
    )


def calibrated(cause: Cause) -> Cause:
    """Return a calibration of the fitted model: its sensors, one place for all numbers there, and its size."""
    known, intervals = {sensor.where: sensor for sensor in cause.sensors}, dict(cause.intervals)
    merged: dict[tuple[int | None, int | None], dict[str, tuple[float, str]]] = {}
    for term, place in zip(cause.terms, cause.places, strict=True):
        merged.setdefault((place.joint, place.tendon), {}).update(place.parameters)
        ((value, unit),) = place.parameters.values()
        where = term.where
        before = known.get(where, Sensor(where, Interval(value), unit)).correction
        moved = value - before.value  # a delay was fitted again
        known[where] = Sensor(where, Interval(value, before.low + moved, before.high + moved), unit)
        intervals |= dict.fromkeys(place.parameters, known[where].correction)
    sensors = tuple(known.values())
    places = tuple(CausePlace(*place, numbers) for place, numbers in merged.items())
    return replace(cause, sensors=sensors, places=places, intervals=intervals, size=_size(sensors))


def _size(sensors: Sequence[Sensor]) -> str:
    """Name the sensors that are most certainly off."""
    certain = sorted((s for s in sensors if s.is_off), key=_distance)
    shown = [" ".join(s.words) for s in (certain or sensors)[:_SHOWN]]
    more = len(certain) - len(shown)
    return "; ".join(shown) + (f"; {more} more" if more > 0 else "")


def _distance(sensor: Sensor) -> float:
    """Return how far 0 is from the interval, negative, in halves of the interval."""
    size = sensor.correction
    return -abs(size.value) / max(size.high - size.low, 1e-300) if np.isfinite(size.high) else 0.0
