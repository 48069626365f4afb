"""What each key against latch-up gains and costs, alone, on a finger of one joint of which everything is known.

    python -m evidence.detection.keys

Prints the tables of docs/evidence/detection_keys.md: means over seeds with their 95 % intervals (bootstrap over the
seeds). key_cases.py has the finger and its simulations; takes two minutes.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from evidence import tables
from evidence.detection import key_cases as cases
from evidence.detection.key_cases import Keys
from tendonfmu.arrays import Numbers
from tendonfmu.statistics.intervals import of_sums

SECOND, SHARE, MILLI, TIMES = ("s", 1.0), ("%", 100.0), ("mN·m", 1e3), ("F", 1.0)
PAPER = "as in the paper"


@dataclass
class Trial:
    """One key's table."""

    title: str
    units: Mapping[str, tuple[str, float]]  # of each measure: name and factor
    settings: Mapping[str, Any]
    measure: Callable[[int, Any], Sequence[float]]  # of a seed and a setting: a value for each of the units
    seeds: int = 10

    def run(self, seeds: Sequence[int]) -> dict[str, Numbers]:
        """[seed, measure] by setting."""
        return {
            name: np.array([self.measure(seed, setting) for seed in seeds], dtype=float)
            for name, setting in self.settings.items()
        }

    def markdown(self) -> str:
        values = self.run(range(self.seeds))
        lines = [
            [f"{measure}, {unit}", *(_cell(of_setting[:, k], factor) for of_setting in values.values())]
            for k, (measure, (unit, factor)) in enumerate(self.units.items())
        ]
        return f"{self.title} ({self.seeds} seeds)\n\n{tables.table(['', *self.settings], lines)}\n"


def _cell(values: Numbers, factor: float) -> str:
    """Mean, and its interval where the seeds differ."""
    sums = np.column_stack([values, np.ones(len(values))])
    mean = of_sums(sums, lambda drawn: np.asarray(drawn[:, :1] / drawn[:, 1:]), 0)[0]
    value, low, high = (_short(factor * x) for x in (mean.value, mean.low, mean.high))
    return value if low == high or not math.isfinite(mean.low) else f"{value} ({low} to {high})"


def _short(value: float) -> str:
    return "0" if abs(value) < 0.05 else f"{value:.2g}" if abs(value) < 10 else f"{value:.0f}"


# --- alarms that do not end -------------------------------------------------------------------------------------------


def release_time(duration: float = 60.0) -> Trial:
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

    def measure(seed: int, keys: Keys) -> Sequence[float]:
        wrong = cases.stuck(cases.wrong_friction(seed, duration).run(keys)["contact"])
        step = cases.stuck(cases.sensor_step(seed, duration).run(keys)["contact"])
        push = cases.lost(cases.held_push(seed).run(keys)["contact"])
        return *wrong, step[0], *push

    return Trial("`contact.release_time`", units, settings, measure)


def release_ratio() -> Trial:
    units = {
        "push of 1.2 thresholds, threshold 6σ: seen, of the first second": SHARE,
        "… noise correlated over 20 ms": SHARE,
        "cost: nothing touches, threshold only 3σ: longest alarm of 60 s": SECOND,
        "… time in alarm": SHARE,
        "… noise correlated over 20 ms: longest alarm": SECOND,
    }
    settings: dict[str, Keys] = {
        PAPER: {},
        "ratio 0.7": {"contact.release_ratio": 0.7},
        "ratio 0.5": {"contact.release_ratio": 0.5},
        "hold 50 ms": {"contact.hold_time": 0.05},
        "ratio 0.5 and hold 50 ms": {"contact.release_ratio": 0.5, "contact.hold_time": 0.05},
    }

    def measure(seed: int, keys: Keys) -> Sequence[float]:
        pushed = [cases.weak_push(seed, correlated).run(keys)["contact"] for correlated in (0.0, 0.02)]
        false = [cases.free_noise(seed, correlated).run(keys)["contact"] for correlated in (0.0, 0.02)]
        seen = (contact[5000:6000].mean() for contact in pushed)  # in the push's first second
        return *seen, cases.longest(false[0]), false[0].mean(), cases.longest(false[1])

    return Trial("`contact.release_ratio`, `contact.hold_time`", units, settings, measure)


# --- friction that jumps ----------------------------------------------------------------------------------------------

NEAR, FAR = (0.01, 0.025), (0.032, 0.04)  # s before the reversal: at rest with every h below; in motion with h = 0.5


def hysteresis() -> Trial:
    units = {
        "blip of 1.05 to 1.45 v_min, 10 to 25 ms before a reversal: jump of T_eff": TIMES,
        "velocity noise of v_min/3: jump before the reversal": TIMES,
        "cost: friction turns round after the reversal by": ("ms", 1e3),
        "cost: blip of 0.6 to 0.95 v_min, 32 to 40 ms before: jump": TIMES,
    }

    def measure(seed: int, h: float) -> Sequence[float]:
        keys = {"velocity_threshold.hysteresis": h}
        blips = (*NEAR, 1.05, 1.45), None, (*FAR, 0.6, 0.95)
        large, noisy, small = (cases.turn(cases.reversal(seed, blip), keys) for blip in blips)
        return large[0], noisy[0], noisy[1], small[0]

    settings = {PAPER: 0.0, "0.25": 0.25, "0.5": 0.5}
    return Trial("`velocity_threshold.hysteresis`", units, settings, measure, seeds=20)


ABSORPTION: Keys = {"bias.forgetting": "absorption"}


def entry_load(duration: float = 100.0) -> Trial:
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
        "`entry_load`, absorption": {**entry, **ABSORPTION},
    }

    def measure(seed: int, keys: Keys) -> Sequence[float]:
        held, free = cases.flicker(seed, 0.3, duration), cases.flicker(seed, 0.0, duration)
        rates = {"bias.forget_rate": 5.0, **keys}
        rests = [cases.after_rests(cases.stiffened(seed, follows), rates) for follows in (False, True)]
        return cases.pumped(held, keys), cases.residual_rms(free, keys), *rests

    return Trial("`bias.entry_load`", units, settings, measure)


# --- the bias filter --------------------------------------------------------------------------------------------------


def initial_variance() -> Trial:
    units = {
        "load of 0.9 threshold 5 ms after the start: absorbed at 0.1 s": SHARE,
        "… of 2 thresholds": SHARE,
        "cost: half of a wrong start is gone after": ("ms", 1e3),
    }
    settings: dict[str, Keys] = {"default (1e-4)": {}}
    settings |= {name: {"bias.initial_variance": float(name)} for name in ("1e-6", "1e-8")}

    def measure(seed: int, keys: Keys) -> Sequence[float]:
        loads = [cases.absorbed(seed, size, keys) for size in (0.9, 2.0)]
        return *loads, cases.half_life(cases.wrong_start(seed), keys)

    return Trial("`bias.initial_variance`", units, settings, measure)


FORGETTING: dict[str, Keys] = {
    "time, `forget_rate` 5": {"bias.forget_rate": 5.0},
    "time, 0.5": {"bias.forget_rate": 0.5},
    "time, 0 (never)": {"bias.forget_rate": 0.0},
    "absorption": ABSORPTION,
}


def forgetting(absorbable: bool, lengths: Sequence[float] = cases.RESTS) -> Trial:
    """Rms over rests of all lengths, by the speed of the bias."""
    gains = {drift: math.sqrt(drift * 1e3) / 0.01 for drift in cases.DRIFTS}
    units = {
        f"bias of {1e3 * math.sqrt(drift):g} mN·m in 1 s, filter {gain:.2g}/s": MILLI for drift, gain in gains.items()
    }

    def measure(seed: int, keys: Keys) -> Sequence[float]:
        values = []
        for drift in cases.DRIFTS:
            spread = {"bias.drift_variance": drift, **keys}
            rests = [cases.after_rests(cases.rests(seed, length, drift, absorbable), spread) for length in lengths]
            values.append(tables.rms(rests))
        return values

    when = "during the rest" if absorbable else "as the finger moves off"
    title = f"`bias.forgetting`: residual's rms in 0.2 s after rests of 0.05 to 5 s; friction turns round {when}"
    return Trial(title, units, FORGETTING, measure, seeds=5)


def main() -> None:
    trials = release_time(), release_ratio(), hysteresis(), entry_load(), initial_variance()
    for trial in (*trials, forgetting(True), forgetting(False)):
        print(trial.markdown(), flush=True)


if __name__ == "__main__":
    main()
