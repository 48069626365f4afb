"""What the detection campaign found, as Markdown: by size of the push, by pretension, posture and stiction."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from detection_cases import TWINS, Push
from tendonfmu.statistics.intervals import Estimate, quantile, rate, share

Numbers = NDArray[np.float64]

# of a push: the largest ratio of its torque in a joint to the rms of that joint's free residual
SIZES = ((0.0, 1.0), (1.0, 2.0), (2.0, 3.0), (3.0, 4.0), (4.0, 6.0), (6.0, math.inf))
POSTURES = ("rest", "motion", "reversal")
MINUTES = 10.0  # false alarms are given per this
SEED = 0  # of the resampling


@dataclass
class Free:
    """Without contact, of one pretension. seconds: of free time. alarms: false ones. alarm_seconds: in alarm."""

    seconds: float = 0.0
    alarms: int = 0
    alarm_seconds: float = 0.0


@dataclass
class Outcome:
    """Of one detector. found: of every push 1 or 0, or a probability. delay: s, NaN unless found.

    free, between: by pretension, on free recordings and between pushes; empty where it does not apply.
    """

    name: str
    found: list[float] = field(default_factory=list)
    delay: list[float] = field(default_factory=list)
    free: dict[float, Free] = field(default_factory=dict)
    between: dict[float, Free] = field(default_factory=dict)


@dataclass(frozen=True)
class Campaign:
    """pushes: all, in the order of every outcome. free_rms: [n] N·m by pretension, of the reference finger.

    detailed: names of the outcomes that are shown by posture, too.
    """

    pushes: Sequence[Push]
    free_rms: Mapping[float, Sequence[float]]
    outcomes: Sequence[Outcome]
    reference: str
    detailed: Sequence[str]

    @property
    def sizes(self) -> Numbers:
        return np.array([size_of(push, self.free_rms[push.pretension]) for push in self.pushes])

    @property
    def pretensions(self) -> list[float]:
        return sorted(self.free_rms)


def size_of(push: Push, free_rms: Sequence[float]) -> float:
    return max(abs(torque) / rms for torque, rms in zip(push.torque, free_rms, strict=True))


# --- the report -------------------------------------------------------------------------------------------------------


def report(campaign: Campaign) -> str:
    """All tables."""
    parts = [_cases(campaign), "**In short**\n\n" + _summary(campaign)]
    for pretension in campaign.pretensions:
        parts.append(f"**{pretension:g} N: found, by size of the push**\n\n" + _by_size(campaign, pretension))
    parts.append("**False alarms in 10 min, part of the free time in alarm**\n\n" + _false_alarms(campaign))
    parts.append("**Delay, ms: median, and 90 % of the found pushes within**\n\n" + _delays(campaign))
    for outcome in (each for each in campaign.outcomes if each.name in campaign.detailed):
        parts.append(
            f"**{outcome.name}: by posture and stiction, all pretensions**\n\n" + _by_posture(campaign, outcome)
        )
    return "\n\n".join(parts) + "\n"


def _cases(campaign: Campaign) -> str:
    """Pushes and residuals by pretension."""
    rows = []
    for pretension in campaign.pretensions:
        chosen = [push for push in campaign.pushes if push.pretension == pretension]
        postures = [sum(push.posture == posture for push in chosen) for posture in POSTURES]
        rms = ", ".join(f"{1e3 * value:.2g}" for value in campaign.free_rms[pretension])
        stuck, stays = sum(push.stuck for push in chosen), sum(push.stays for push in chosen)
        kinds = " + ".join(str(sum(push.kind == kind for push in chosen)) for kind in TWINS)
        rows.append([f"{pretension:g} N", kinds, *map(str, (*postures, stuck, stays)), rms])
    head = [
        "pretension",
        "pushes, " + " + ".join(TWINS),
        *POSTURES,
        "all stuck",
        "below break-away",
        "free residual's rms, mN·m",
    ]
    return f"Sizes in multiples of the free residual's rms of {campaign.reference}.\n\n" + _table(head, rows)


def _summary(campaign: Campaign) -> str:
    """The largest pushes by pretension, the next sizes and the false alarms of all pretensions together."""
    sizes = campaign.sizes
    everywhere = np.ones(len(sizes), dtype=bool)
    rows = []
    for outcome in campaign.outcomes:
        cells = [outcome.name]
        for pretension in campaign.pretensions:
            chosen = np.array([push.pretension == pretension for push in campaign.pushes])
            cells.append(_shares(campaign, outcome, chosen)[-1])
        cells += _shares(campaign, outcome, everywhere)[-2:-4:-1]
        for where in (outcome.free, outcome.between):
            alarms, seconds = sum(free.alarms for free in where.values()), sum(free.seconds for free in where.values())
            cells.append(_interval(rate(alarms, seconds / 60.0 / MINUTES), 1, 1) if seconds else "–")
        known = (np.array(outcome.found) == 1) & (sizes >= SIZES[-1][0])
        delay = np.array(outcome.delay)[known] if outcome.delay else np.zeros(0)
        cells.append(_interval(quantile(delay, 0.5, SEED), 1e3, 0) if len(delay) else "–")
        rows.append(cells)
    head = [f"{_size_name(SIZES[-1])}, {pretension:g} N" for pretension in campaign.pretensions]
    head += [_size_name(SIZES[-2]), _size_name(SIZES[-3])]
    head += ["false alarms in 10 min, free", "between pushes", f"median delay of {_size_name(SIZES[-1])}, ms"]
    return _table(["", *head], rows)


def _by_size(campaign: Campaign, pretension: float) -> str:
    chosen = np.array([push.pretension == pretension for push in campaign.pushes])
    rows = [[outcome.name, *_shares(campaign, outcome, chosen)] for outcome in campaign.outcomes]
    return _table(["", *map(_size_name, SIZES)], rows)


def _by_posture(campaign: Campaign, outcome: Outcome) -> str:
    kinds: list[tuple[str, Callable[[Push], bool]]] = [
        *((posture, lambda push, posture=posture: push.posture == posture) for posture in POSTURES),
        ("all stuck, break-away", lambda push: push.stuck and not push.stays),
        ("all stuck, below break-away", lambda push: push.stays),
    ]
    rows = [
        [name, *_shares(campaign, outcome, np.array([chosen(push) for push in campaign.pushes]))]
        for name, chosen in kinds
    ]
    return _table(["", *map(_size_name, SIZES)], rows)


def _shares(campaign: Campaign, outcome: Outcome, chosen: NDArray[np.bool_]) -> list[str]:
    sizes, found = campaign.sizes, np.array(outcome.found)
    return [_share(found[chosen & (sizes >= low) & (sizes < high)]) for low, high in SIZES]


def _share(found: Numbers) -> str:
    """Found of all and the 95 % interval of the share; of probabilities their mean."""
    if not len(found):
        return "–"
    if np.all((found == 0) | (found == 1)):
        known = share(int(found.sum()), len(found))
        return f"{int(found.sum())}/{len(found)} ({100 * known.low:.0f}–{100 * known.high:.0f} %)"
    return f"{100 * found.mean():.0f} %"


def _false_alarms(campaign: Campaign) -> str:
    rows = []
    for outcome in campaign.outcomes:
        if not outcome.free:
            continue
        cells = [outcome.name]
        for where in (outcome.free, outcome.between):
            for pretension in campaign.pretensions:
                free = where[pretension]
                known = rate(free.alarms, free.seconds / 60.0 / MINUTES)
                cells.append(f"{_interval(known, 1, 1)}; {100 * free.alarm_seconds / free.seconds:.2g} %")
        rows.append(cells)
    head = [f"{where}, {pretension:g} N" for where in ("free", "between pushes") for pretension in campaign.pretensions]
    return _table(["", *head], rows)


def _delays(campaign: Campaign) -> str:
    rows = []
    sizes = campaign.sizes
    for outcome in campaign.outcomes:
        if not outcome.free:
            continue
        cells = [outcome.name]
        for low in (3.0, 6.0):
            for pretension in campaign.pretensions:
                chosen = np.array([push.pretension == pretension for push in campaign.pushes]) & (sizes >= low)
                delay = np.array(outcome.delay)[chosen & (np.array(outcome.found) == 1)]
                if not len(delay):
                    cells.append("–")
                    continue
                middle, late = quantile(delay, 0.5, SEED), float(np.quantile(delay, 0.9))
                cells.append(f"{_interval(middle, 1e3, 0)}; {1e3 * late:.0f}")
        rows.append(cells)
    head = [f"size ≥ {low}, {pretension:g} N" for low in (3, 6) for pretension in campaign.pretensions]
    return _table(["", *head], rows)


# --- text -------------------------------------------------------------------------------------------------------------


def _size_name(size: tuple[float, float]) -> str:
    low, high = size
    return f"≥ {low:g}" if math.isinf(high) else f"< {high:g}" if low == 0 else f"{low:g}–{high:g}"


def _interval(known: Estimate, scale: float, digits: int) -> str:
    value, low, high = (f"{scale * each:.{digits}f}" for each in (known.value, known.low, known.high))
    return value if math.isnan(known.low) else f"{value} ({low}–{high})"


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [head, ["---", *["---:"] * (len(head) - 1)], *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)
