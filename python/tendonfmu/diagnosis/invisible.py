"""Which effects a recording cannot show: the refit absorbs them, or an ordinary size is lost beside the rest."""

from __future__ import annotations

from collections.abc import Sequence

from tendonfmu.diagnosis.cause import HERE, Cause, Key
from tendonfmu.diagnosis.result import ABSORBED, Invisible
from tendonfmu.diagnosis.selection import Selection, names_with

SMALLEST_GAIN = 1e-6  # where every gain counts as material


def invisible_effects(
    selection: Selection, causes: Sequence[Cause], known: Sequence[Cause], least_gain: float
) -> list[tuple[Cause, Invisible]]:
    """Return, for each place at which an effect of ordinary size would not become a cause, its best shape."""
    places = {(cause.effect, term.place.joint, term.place.tendon) for cause in known for term in cause.terms}
    names = [cause.effect for cause in causes]
    best: dict[Key, tuple[float, Cause, Invisible]] = {}
    for cause, share in zip(selection.causes, selection.shares, strict=True):
        if cause.direction.level != HERE or cause.key in places:
            continue
        gain = selection.grams.ordinary_gain(cause.direction.mix, cause.direction.ordinary)
        needed = least_gain * names_with(cause.effect, names)
        nearness = min(share / ABSORBED, gain / max(needed, SMALLEST_GAIN))  # from 1 on it is visible
        if cause.key not in best or nearness > best[cause.key][0]:
            hidden = Invisible(cause.where, cause.title, share, "", ordinary_gain=gain, needed_gain=needed)
            best[cause.key] = (nearness, cause, hidden)
    ranked = sorted(best.values(), key=lambda entry: -entry[0])
    return [(cause, hidden) for nearness, cause, hidden in ranked if nearness < 1.0]


def absorbed_effects(selection: Selection, experiment: str) -> list[Invisible]:
    """Return, for each effect and place that refitting and background absorb, the shape that comes nearest."""
    best: dict[Key, Invisible] = {}
    for cause, share in zip(selection.causes, selection.shares, strict=True):
        if cause.direction.level == HERE and (cause.key not in best or share > best[cause.key].surviving_share):
            best[cause.key] = Invisible(cause.where, cause.title, share, experiment)
    ranked = sorted(best.values(), key=lambda hidden: -hidden.surviving_share)
    return [hidden for hidden in ranked if hidden.absorbed]
