"""`bias.start_share` and `contact.drift` where their effect can be written on paper.

One joint, one tendon of arm 0.01 m: τ = 0.01 m · f0. Speeds come as given (source 3). On the oracle and on the C core.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from test_detection_semantics import DT, FREE, contact_of, run

from analytic_cases import ARM, NO_UPDATE, close, finger
from runners import Runner

# --- step 4a: how friction stood at the start


DRY_JOINT = {"name": "j", "friction": {"static": 0.1, "coulomb": 0.1, "stribeck_velocity": 0.01}}  # 0.1 N·m
SMOOTH = [{"effect": "presliding", "joint": 1, "displacement": 0.01}]


def at_start(share: float | None, smooth: bool, **contact: Any) -> Any:
    """A joint with 0.1 N·m of friction whose bias does not move by itself, and hears 1e-4 N·m of noise."""
    bias = NO_UPDATE | {"noise_std": 1e-4} | ({} if share is None else {"start_share": share})
    return finger([FREE], [DRY_JOINT], bias=bias, contact={"threshold": [0.02]} | contact,
                  extensions=SMOOTH if smooth else [])  # fmt: skip


@pytest.mark.parametrize("smooth", [True, False], ids=["presliding", "sticks"])
def test_the_first_stroke_shows_how_friction_stood(runner: Runner, smooth: bool) -> None:
    """Friction stood against the first motion: τ changes by 2F. The model, which took it as 0, or as standing with the
    motion where it sticks, is wrong by F or 2F; that is not contact, and the bias has it at once."""
    wrong = 0.1 if smooth else 0.2
    force = [10.0, 10.0, 10.0 - 20.0, 10.0 - 20.0, 10.0 - 20.0]
    speed = [0.0, 0.0, -4.0, -4.0, -4.0]  # 0.5 rad a sample: nothing is left of where it was
    paper = run(runner, at_start(None, smooth), force, speed)
    assert contact_of(paper) == [0, 0, 1, 1, 1]
    close(paper["residual"][2:, 0], -wrong)
    told = run(runner, at_start(1.0, smooth), force, speed)
    assert contact_of(told) == [0, 0, 0, 0, 0]
    close(told["residual"][2, 0], -wrong)
    gain = wrong**2 / 3.0 / (wrong**2 / 3.0 + 1e-8)
    close(told["bias_torque"][2, 0] - told["bias_torque"][1, 0], -gain * wrong + (0.0 if smooth else 0.1))
    left = (1.0 - gain) * wrong  # of V after the update
    close(told["compensated_torque_std"][2, 0], left / math.sqrt(3.0))


def test_the_start_is_turned_over_once(runner: Runner) -> None:
    """A push in the second stroke is contact, and one in the first is not."""
    speed = [0.0, 4.0, -4.0, 4.0]
    model = np.array([0.0, 0.1, -0.1, 0.1]) / ARM  # N that friction takes, from 0 at the start
    for at, contact in ((1, [0, 0, 0, 0]), (3, [0, 0, 0, 1])):
        force = 50.0 + model + 5.0 * (np.arange(4) >= at)
        assert contact_of(run(runner, at_start(1.0, True), force, speed)) == contact


# --- steps 5 and 6: slow loads


STEP = 1.0 - math.exp(-1.0)  # of a mean over the time of one sample; u, over a tenth of that, has all of it


def drifting(bias: Any = NO_UPDATE, **contact: Any) -> Any:
    """No friction: e = 0.01·(f0 − f0 of the first sample) whatever the bias learns."""
    drift = {"quick_time": DT, "slow_time": 8 * DT, "threshold": [0.05]}
    return finger([FREE], bias=bias, contact={"threshold": [1e6], "drift": drift} | contact)


def test_a_slow_load_is_found_though_the_bias_has_it(runner: Runner) -> None:
    """0.01 N·m a sample, of which the bias takes nearly all: |r| stays below 0.02, the drift passes 0.05."""
    quick_bias = {"drift_variance": 1.0, "noise_std": 0.1, "initial_variance": 0.1}
    out = run(runner, drifting(quick_bias), 10.0 + np.arange(20.0))
    load = 0.01 * np.arange(20.0)
    quick, slow, expected = 0.0, 0.0, [0.0]
    for k in range(1, 20):
        quick += STEP * (load[k] - quick)
        expected.append(quick - slow)
        if abs(expected[-1]) > 0.05:
            break
        slow += (1.0 - math.exp(-DT / min(8 * DT, k * DT))) * (load[k] - slow)
    found = len(expected) - 1
    assert 4 < found < 19
    close(out["drift"][: found + 1, 0], expected)
    assert contact_of(out)[: found + 1] == [0] * found + [1]
    assert np.abs(out["residual"][: found + 1]).max() < 0.02


def test_a_contact_that_lasts_too_long_begins_anew(runner: Runner) -> None:
    out = run(runner, drifting(release_time=3 * DT), [10.0] * 12 + [20.0] * 8)
    assert contact_of(out) == [0] * 12 + [1] * 4 + [0] * 4
    close(out["drift"][16, 0], 0.1 * (math.exp(-4.0) - math.exp(-5.0)))  # p − s, s = p of the sample before
