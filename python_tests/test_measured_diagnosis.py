"""What is hidden in measured recordings is what it says, and the diagnosed models of EMPS and the da Vinci jaw hold.

The latter needs the recordings in ../shared/data or $TENDONFMU_DATA.
"""

from __future__ import annotations

import copy
import os
import sys
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("tendonfmu._estimation", reason="SKIPPED: tendonfmu is not installed with its estimation")

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "python_tests" / "hidden_effects"))

from measured import EFFECTS, FORCE, Columns, Description, Machine, hide, put, residuals  # noqa: E402

from tendonfmu.fitting import FitWarning, FrictionFit  # noqa: E402
from tendonfmu.recording import Recording  # noqa: E402

DATA = Path(os.environ.get("TENDONFMU_DATA") or ROOT.parent / "shared" / "data")

RATE, ARM, COULOMB, VISCOUS, NOISE = 500.0, 0.01, 0.04, 0.02, 0.004
LAW = {"static": COULOMB, "coulomb": COULOMB, "stribeck_velocity": 0.1, "viscous": VISCOUS}


def machine(seed: int, seconds: float = 40.0, noise: float = NOISE) -> Machine:
    """A joint that swings under a load that comes and goes, exact by its model but for white noise of the torque."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, seconds, 1.0 / RATE)
    phase = 2 * np.pi * (0.5 * time + 0.2 * np.sin(0.6 * time))
    angle = 0.5 * np.sin(phase)
    speed = np.gradient(angle, time)
    load = 0.2 + 0.1 * np.sin(0.9 * time)
    torque = load + COULOMB * np.sign(speed) + VISCOUS * speed + noise * rng.standard_normal(len(time))
    columns: Columns = {
        "time": time,
        FORCE: torque / ARM,
        "tendon_position[1]": ARM * angle,
        "joint_position[1]": angle,
        "joint_velocity[1]": speed,
        "external_torque[1]": load,
    }
    model: Description = {
        "format": "tendonfmu-finger-1",
        "name": "joint",
        "joints": [{"name": "a", "friction": dict(LAW)}],
        "tendons": [{"name": "t", "stiffness": 1e6, "moment_arms": [ARM]}],
        "velocity_threshold": {"tendon": 0.0, "joint": 0.0},
        "bias": {
            "drift_variance": 0.0,
            "initial_variance": 0.0,
            "forget_rate": 0.0,
            "noise_std": NOISE,
            "initial_torque": [0.0],
        },
        "contact": {"threshold": [1.0]},
    }
    return Machine("joint", model, {"one": columns}, kinematics=3)


def told(model: Description, effect: str, magnitude: float) -> Description:
    """The model with the effect's own term."""
    model = copy.deepcopy(model)
    rows = {
        "gain": {"effect": "force_gain", "tendon": 1, "correction": magnitude},
        "delay": {"effect": "time_delay", "delay": -magnitude},
        "growing": {"effect": "load_friction", "joint": 1, "tendon": 1, "coulomb": magnitude},
    }
    if effect in rows:
        model["extensions"] = [rows[effect]]
    elif effect == "spring":
        model["joints"][0]["cover"] = {"stiffness": magnitude, "rest_angle": 0.0}
    else:
        for key in ("static", "coulomb"):
            model["joints"][0]["friction"][key] += magnitude
    return model


@pytest.mark.parametrize(
    ("effect", "magnitude"), [("coulomb", 0.02), ("gain", 0.05), ("delay", 0.004), ("spring", 0.05), ("growing", 5e-4)]
)
def test_an_effect_is_the_core_s_term_of_its_name(effect: str, magnitude: float) -> None:
    """Physics written apart: with the core's term nothing is left. Blocks that meet a reversal are left out, one in
    ten: there the side of a motion below a hundredth of the usual speed is a matter of choice."""
    start = machine(1, noise=0.0)
    altered = put(start, EFFECTS[effect], magnitude)
    added = residuals(altered) - residuals(start)
    left = residuals(replace(altered, model=told(start.model, effect, magnitude))) - residuals(start)
    added, left = (np.abs(each - np.median(each)) for each in (added, left))  # a spring's rest angle is of no concern
    assert np.percentile(added, 90) > 5e-4
    assert np.percentile(left, 90) < 1e-3 * np.percentile(added, 90)


@pytest.mark.parametrize("effect", ["gain", "spring", "growing"])
def test_strength_is_what_refitting_leaves(effect: str) -> None:
    """Refitted by `fit`, the model misses so much more of the altered recording."""
    hidden = hide(machine(2), EFFECTS[effect], 1.0)
    assert hidden.strength == pytest.approx(1.0, rel=0.03)
    variances = []
    for each in (machine(2), hidden.machine):
        columns = each.recordings["one"]
        groups = {key.removesuffix("[1]"): value[:, None] for key, value in columns.items() if key != "time"}
        fit = FrictionFit(each.model, kinematics=3, uncertainty=False)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", FitWarning)  # of what is hidden
            fitted = fit.fit([Recording(Path("one"), columns["time"], groups)]).description_.data
        variances.append(float(np.var(residuals(replace(each, model=fitted)))))
    assert variances[1] / variances[0] - 1.0 == pytest.approx(1.0, abs=0.15)


def test_a_strength_that_no_sound_magnitude_has_is_refused() -> None:
    with pytest.raises(ValueError, match="no sound magnitude"):
        hide(machine(3, 10.0), EFFECTS["gain"], 1e6)
