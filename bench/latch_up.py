"""What each key against latch-up gains and costs, alone, on a finger of one joint of which everything is known.

    python bench/latch_up.py

Prints the tables of docs/evidence/detection_keys.md: means over seeds with their 95 % intervals (bootstrap
over the seeds). latch_up_finger.py has the finger, latch_up_contact.py and latch_up_bias.py the simulations; takes two
minutes.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

import latch_up_bias as bias
import latch_up_contact as contact
from latch_up_finger import Numbers, longest
from tendonfmu.statistics.intervals import of_sums

Keys = Mapping[str, Any]
Measures = Mapping[str, float]
SEEDS = range(10)

SECOND, SHARE, MILLI, TIMES = ("s", 1.0), ("%", 100.0), ("mN·m", 1e3), ("F", 1.0)
PAPER = "as in the paper"


@dataclass
class Trial:
    """One key's table. units: of each measure, (name, factor). values: of each (measure, setting), one of each seed."""

    title: str
    units: Mapping[str, tuple[str, float]]
    settings: list[str] = field(default_factory=list)
    values: dict[tuple[str, str], list[float]] = field(default_factory=dict)

    def add(self, setting: str, measures: Measures) -> None:
        if setting not in self.settings:
            self.settings.append(setting)
        for name, value in measures.items():
            self.values.setdefault((name, setting), []).append(value)

    def mean(self, measure: str, setting: str) -> float:
        return float(np.mean(self.values[measure, setting]))


def _trial(
    title: str,
    units: Mapping[str, tuple[str, float]],
    settings: Mapping[str, Any],
    measure: Callable[[int, Any], Measures],
    seeds: Iterable[int],
) -> Trial:
    made = Trial(title, units)
    for seed in seeds:
        for name, setting in settings.items():
            made.add(name, measure(seed, setting))
    return made


# --- alarms that do not end -------------------------------------------------------------------------------------------


def release_time(seeds: Iterable[int] = SEEDS, duration: float = 60.0) -> Trial:
    units = {
        "friction 50 % wrong, then stiffer: longest alarm of 50 s": SECOND,
        "… time in alarm": SHARE,
        "sensor step of 2 thresholds: longest alarm of 50 s": SECOND,
        "cost: a push of 3 thresholds held 10 s is lost after": SECOND,
        "… and after its end there is a false alarm of": SECOND,
    }
    settings: dict[str, Keys] = {PAPER: {}}
    settings |= {f"{seconds} s": {"contact.release_time": float(seconds)} for seconds in (1, 2, 5)}
    settings["2 s, release_ratio 0.5"] = {"contact.release_time": 2.0, "contact.release_ratio": 0.5}
    settings["2 s, hold_time 50 ms"] = {"contact.release_time": 2.0, "contact.hold_time": 0.05}

    def measure(seed: int, keys: Keys) -> Measures:
        wrong = contact.stuck(contact.wrong_friction(seed, duration).run(keys)["contact"])
        step = contact.stuck(contact.sensor_step(seed, duration).run(keys)["contact"])
        push = contact.lost(contact.held_push(seed).run(keys)["contact"])
        return dict(zip(units, (*wrong, step[0], *push), strict=True))

    return _trial("`contact.release_time`", units, settings, measure, seeds)


RELEASES: dict[str, Keys] = {
    PAPER: {},
    "ratio 0.7": {"contact.release_ratio": 0.7},
    "ratio 0.5": {"contact.release_ratio": 0.5},
    "hold 50 ms": {"contact.hold_time": 0.05},
    "ratio 0.5 and hold 50 ms": {"contact.release_ratio": 0.5, "contact.hold_time": 0.05},
}


def release_ratio(seeds: Iterable[int] = SEEDS) -> Trial:
    units = {
        "push of 1.2 thresholds, threshold 6σ: seen, of the first second": SHARE,
        "… noise correlated over 20 ms": SHARE,
        "cost: nothing touches, threshold only 3σ: longest alarm of 60 s": SECOND,
        "… time in alarm": SHARE,
        "… noise correlated over 20 ms: longest alarm": SECOND,
    }

    def measure(seed: int, keys: Keys) -> Measures:
        seen = [
            contact.share_of_first_second(contact.weak_push(seed, 6.0, correlated).run(keys)["contact"])
            for correlated in (0.0, 0.02)
        ]
        false = [contact.free_noise(seed, 3.0, correlated).run(keys)["contact"] for correlated in (0.0, 0.02)]
        return dict(zip(units, (*seen, longest(false[0]), false[0].mean(), longest(false[1])), strict=True))

    return _trial("`contact.release_ratio`, `contact.hold_time`", units, RELEASES, measure, seeds)


RULES: dict[str, contact.Rule] = {
    PAPER: contact.by_time(math.inf),
    "`release_time` 1 s": contact.by_time(1.0),
    "`release_time` 0.3 s": contact.by_time(0.3),
    "residual swings with motion": contact.by_motion,
    "anew after 0.3 s of rest": contact.at_rest,
}


def rules_without_a_key(seeds: Iterable[int] = SEEDS) -> Trial:
    units = {
        "friction 50 % wrong, then stiffer: longest alarm of 50 s": SECOND,
        "… time in alarm": SHARE,
        "sensor step of 2 thresholds: longest alarm of 50 s": SECOND,
        "cost: a push of 3 thresholds held 10 s, friction right, is lost after": SECOND,
        "… friction 50 % wrong": SECOND,
    }

    def measure(seed: int, rule: contact.Rule) -> Measures:
        wrong = contact.stuck(contact.follow(contact.wrong_friction(seed), rule))
        step = contact.stuck(contact.follow(contact.sensor_step(seed), rule))
        push = [contact.lost(contact.follow(contact.held_push(seed, wrong=w), rule))[0] for w in (1.0, contact.WRONG)]
        return dict(zip(units, (*wrong, step[0], *push), strict=True))

    return _trial("Two rules that have no key, tried outside the core", units, RULES, measure, seeds)


# --- friction that jumps ----------------------------------------------------------------------------------------------

NEAR, FAR = (0.01, 0.025), (0.032, 0.04)  # s before the reversal: at rest with every h below; in motion with h = 0.5


def hysteresis(seeds: Iterable[int] = range(20)) -> Trial:
    units = {
        "blip of 1.05 to 1.45 v_min, 10 to 25 ms before a reversal: jump of T_eff": TIMES,
        "velocity noise of v_min/3: jump before the reversal": TIMES,
        "cost: friction turns round after the reversal by": ("ms", 1e3),
        "cost: blip of 0.6 to 0.95 v_min, 32 to 40 ms before: jump": TIMES,
    }
    settings = {PAPER: 0.0, "0.25": 0.25, "0.5": 0.5}

    def measure(seed: int, h: float) -> Measures:
        keys = {"velocity_threshold.hysteresis": h}
        takes = (
            bias.reversal(seed, (*NEAR, 1.05, 1.45)),
            bias.reversal(seed),
            bias.reversal(seed, (*FAR, 0.6, 0.95)),
        )
        large, noisy, small = (bias.turn(take, keys) for take in takes)
        return dict(zip(units, (large[0], noisy[0], noisy[1], small[0]), strict=True))

    return _trial("`velocity_threshold.hysteresis`", units, settings, measure, seeds)


ABSORPTION: Keys = {"bias.forgetting": "absorption"}


def entry_load(seeds: Iterable[int] = SEEDS, duration: float = 100.0) -> Trial:
    units = {
        "in contact, co-contraction noise for 100 s: what the bias gains": MILLI,
        "free, the same noise: rms of the residual": MILLI,
        "pull changes in rests of 0.2 s, friction with it as the finger moves off: rms in 0.2 s after": MILLI,
        "… friction with it at once": MILLI,
    }
    entry: Keys = {"bias.entry_load": True}
    settings = {
        PAPER: {},
        "forgetting by absorption": ABSORPTION,
        "`entry_load`": entry,
        "`entry_load`, absorption": entry | ABSORPTION,
    }

    def measure(seed: int, keys: Keys) -> Measures:
        held, free = bias.flicker(seed, 0.3, duration), bias.flicker(seed, 0.0, duration)
        rates = {"bias.forget_rate": 5.0} | keys
        rests = [bias.after_rests(bias.stiffened(seed, follows), rates) for follows in (False, True)]
        return dict(zip(units, (bias.pumped(held, keys), bias.residual_rms(free, keys), *rests), strict=True))

    return _trial("`bias.entry_load`", units, settings, measure, seeds)


# --- the bias filter --------------------------------------------------------------------------------------------------


def initial_variance(seeds: Iterable[int] = SEEDS) -> Trial:
    units = {
        "load of 0.9 threshold 5 ms after the start: absorbed at 0.1 s": SHARE,
        "… of 2 thresholds": SHARE,
        "cost: half of a wrong start is gone after": ("ms", 1e3),
    }
    settings: dict[str, Keys] = {"default (1e-4)": {}}
    settings |= {f"{value:.0e}".replace("e-0", "e-"): {"bias.initial_variance": value} for value in (1e-6, 1e-8)}

    def measure(seed: int, keys: Keys) -> Measures:
        loads = [bias.absorbed(seed, size, keys) for size in (0.9, 2.0)]
        return dict(zip(units, (*loads, bias.half_life(bias.wrong_start(seed), keys)), strict=True))

    return _trial("`bias.initial_variance`", units, settings, measure, seeds)


FORGETTING: dict[str, Keys] = {
    "time, `forget_rate` 5": {"bias.forget_rate": 5.0},
    "time, 0.5": {"bias.forget_rate": 0.5},
    "time, 0 (never)": {"bias.forget_rate": 0.0},
    "absorption": ABSORPTION,
}


def forgetting(absorbable: bool, seeds: Iterable[int] = range(5), lengths: Sequence[float] = bias.RESTS) -> Trial:
    """rms over rests of all lengths, by the speed of the bias."""
    rates = [math.sqrt(drift * 1e3) / 0.01 for drift in bias.DRIFTS]
    names = [
        f"bias of {1e3 * math.sqrt(d):g} mN·m in 1 s, filter {k:.2g}/s" for d, k in zip(bias.DRIFTS, rates, strict=True)
    ]

    def measure(seed: int, keys: Keys) -> Measures:
        made = {}
        for name, drift in zip(names, bias.DRIFTS, strict=True):
            spread = {"bias.drift_variance": drift} | keys
            of = [bias.after_rests(bias.rests(seed, length, drift, absorbable), spread) for length in lengths]
            made[name] = float(np.sqrt(np.mean(np.square(of))))
        return made

    when = "during the rest" if absorbable else "as the finger moves off"
    title = f"`bias.forgetting`: residual's rms in 0.2 s after rests of 0.05 to 5 s; friction turns round {when}"
    return _trial(title, dict.fromkeys(names, MILLI), FORGETTING, measure, seeds)


# --- the tables -------------------------------------------------------------------------------------------------------


def cell(values: Sequence[float], factor: float) -> str:
    """Mean, and its interval where the seeds differ."""

    def mean(sums: Numbers) -> Numbers:
        return np.asarray(sums[:, :1] / sums[:, 1:])

    found = of_sums(np.column_stack([values, np.ones(len(values))]), mean, 0)[0]
    value, low, high = (_short(factor * x) for x in (found.value, found.low, found.high))
    return value if low == high or not math.isfinite(found.low) else f"{value} ({low} to {high})"


def _short(value: float) -> str:
    return "0" if abs(value) < 0.05 else f"{value:.2g}" if abs(value) < 10 else f"{value:.0f}"


def markdown(trial: Trial) -> str:
    count = len(trial.values[next(iter(trial.units)), trial.settings[0]])
    lines = [
        f"{trial.title} ({count} seeds)",
        "",
        "| | " + " | ".join(trial.settings) + " |",
        "| --- |" + " --- |" * len(trial.settings),
    ]
    for measure, (unit, factor) in trial.units.items():
        cells = [cell(trial.values[measure, setting], factor) for setting in trial.settings]
        lines.append(f"| {measure}, {unit} | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def main() -> None:
    print(markdown(release_time()))
    print(markdown(release_ratio()))
    print(markdown(hysteresis()))
    print(markdown(entry_load()))
    print(markdown(initial_variance()))
    for absorbable in (True, False):
        print(markdown(forgetting(absorbable)))
    print(markdown(rules_without_a_key()))


if __name__ == "__main__":
    main()
