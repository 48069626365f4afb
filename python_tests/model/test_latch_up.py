"""Each key against latch-up gains and costs what docs/evidence/detection_keys.md says (evidence/detection/keys.py).

A few seeds and short recordings; the margins are several times the spread over the seeds.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from evidence.detection import key_cases, keys
from evidence.detection.keys import ABSORPTION, FORGETTING, PAPER, Trial


def means(trial: Trial, seeds: Sequence[int]) -> list[dict[str, float]]:
    """Of each measure in its order, by setting."""
    values = trial.run(seeds)
    return [{setting: own[:, k].mean() for setting, own in values.items()} for k in range(len(trial.units))]


def test_release_time_ends_a_stuck_alarm_and_loses_a_held_push() -> None:
    wrong, share, step, push, after = means(keys.release_time(duration=40.0), (0,))
    both = "2 s, release_ratio 0.5"
    assert wrong[PAPER] > 20.0 and share[PAPER] > 0.8 and step[PAPER] == pytest.approx(30.0)
    assert wrong[both] < 10.0 and share[both] < 0.75
    assert (1.0 < step["1 s"] < 3.5) and (2.0 < step[both] < 3.0) and (5.0 < step["5 s"] < 9.0)
    assert push[PAPER] == pytest.approx(10.0) and after[PAPER] < 0.01
    assert (2.0 < push[both] < 3.0) and (2.0 < after[both] < 3.0)


def test_a_weak_push_is_held_and_low_thresholds_with_both_keys_alarm_for_ever() -> None:
    seen, correlated, longest, share, _ = means(keys.release_ratio(), (0, 1))
    for setting in ("ratio 0.5", "hold 50 ms"):
        assert seen[setting] > 0.97 and correlated[setting] > 0.9
        assert longest[setting] < 1.0
    assert seen[PAPER] < 0.4 and correlated[PAPER] < 0.6
    assert longest["ratio 0.5 and hold 50 ms"] > 5.0 and share["ratio 0.5 and hold 50 ms"] > 0.8
    assert share["ratio 0.5"] < 0.01 < share["hold 50 ms"] < 0.3


def test_hysteresis_ignores_a_blip_at_rest_and_turns_later() -> None:
    blip, _, delay, early = means(keys.hysteresis(), range(6))
    assert blip[PAPER] == pytest.approx(2.0) and blip["0.5"] == pytest.approx(0.0, abs=1e-9)
    assert delay[PAPER] + 0.015 < delay["0.5"] < delay[PAPER] + 0.06
    assert early[PAPER] == pytest.approx(0.0, abs=1e-9) and early["0.5"] == pytest.approx(2.0)


def test_entry_load_stops_co_contraction_from_pumping_the_bias() -> None:
    gained, rms, later, at_once = means(keys.entry_load(duration=20.0), range(3))
    assert max(gained["`entry_load`"], gained["`entry_load`, absorption"]) < 1e-9
    assert min(gained[PAPER], gained["forgetting by absorption"]) > 3e-3
    for free in (rms, later, at_once):
        assert free["`entry_load`"] < 0.85 * free[PAPER]


def test_a_small_initial_variance_keeps_an_early_load_and_a_wrong_start() -> None:
    weak, firm, half = means(keys.initial_variance(), range(4))
    assert weak["default (1e-4)"] > 0.85 and 0.3 < weak["1e-6"] < 0.6 and weak["1e-8"] < 0.1
    assert firm["default (1e-4)"] > 0.1 > abs(firm["1e-8"])
    assert half["default (1e-4)"] < 0.01 and half["1e-6"] > 0.03 and half["1e-8"] > 0.2


def test_absorption_suits_every_speed_of_the_bias_and_a_forget_rate_one() -> None:
    """If friction turned round while the filter could see it; if not, nothing must be forgotten."""
    made = means(keys.forgetting(True, lengths=(0.2, 1.0)), range(3))
    best = [min(value for name, value in of.items() if name.startswith("time")) for of in made]
    assert all(of["absorption"] < 1.5 * least for of, least in zip(made, best, strict=True))
    for name in FORGETTING:
        if name.startswith("time"):
            assert max(of[name] / least for of, least in zip(made, best, strict=True)) > 1.5
    unseen = means(keys.forgetting(False, lengths=(0.2, 1.0)), (0,))
    assert all(of["time, 0 (never)"] < 0.5 * of["absorption"] for of in unseen)
    take = key_cases.rests(0, 0.2, 1e-6, True)[0]
    assert not np.allclose(*(take.run(changed)["bias_torque"] for changed in (ABSORPTION, {})), rtol=0, atol=1e-6)
