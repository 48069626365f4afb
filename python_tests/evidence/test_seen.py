"""The cases of seen.py: simulators that are what they say, effects of the size asked for, and what answers count."""

from __future__ import annotations

from importlib import import_module
from typing import Any

import numpy as np
import pandas as pd
import pytest

from evidence.diagnosis import seen
from evidence.fingers import numpy_dahl, numpy_lugre
from evidence.fingers.common_finger import Hidden, Motion, lost, random_finger
from evidence.fingers.foreign import Array
from evidence.judge import Truth
from optional_parts import needs

pytestmark = pytest.mark.long  # they test cases of evidence

FAMILIES = ["dahl", "lugre", pytest.param("pulleys", marks=needs("mujoco"))]
THERE_AND_BACK = np.concatenate([np.linspace(0.0, 0.01, 2000), np.linspace(0.01, 0.0, 2000)])[:, None]  # m


def test_dahl_builds_up_over_its_distance_and_saturates() -> None:
    z = numpy_dahl.built_up(THERE_AND_BACK, np.array([5e-4]), 1.0)
    assert z[1999, 0] == pytest.approx(1.0, abs=1e-6) and z[-1, 0] == pytest.approx(-1.0, abs=1e-6)
    near = int(np.searchsorted(THERE_AND_BACK[:2000, 0], 5e-4))
    assert z[near, 0] == pytest.approx(1.0 - np.exp(-1.0), abs=0.01)  # of exponent 1
    assert np.trapezoid(z[:, 0], THERE_AND_BACK[:, 0]) == pytest.approx(0.02 - 3 * 5e-4, rel=0.05)  # loses energy


def test_lugre_is_dahl_of_exponent_1_with_damping_in_its_bristles() -> None:
    velocity = np.gradient(THERE_AND_BACK, 1.0 / numpy_lugre.RATE, axis=0)
    friction = numpy_lugre.bristles(velocity, np.array([5e-4]))
    z = numpy_dahl.built_up(THERE_AND_BACK, np.array([5e-4]), 1.0)
    assert friction[1990, 0] == pytest.approx(1.0, abs=1e-3)
    assert friction[10, 0] > z[10, 0] + 0.005 and np.abs(friction).max() < 1.2


@pytest.mark.parametrize("family", FAMILIES)
def test_torques_balance_and_friction_takes_energy(family: str) -> None:
    simulator = import_module(f"evidence.fingers.{seen.FAMILIES[family]}")
    finger = random_finger(simulator.JOINTS, np.random.default_rng(4))
    sound, drifting = (
        simulator.simulate(finger, hidden, 4.0, np.random.default_rng(5), 6)
        for hidden in (Hidden(), Hidden("friction_drift", size=1.0, seconds=4.0))
    )
    velocity = np.gradient(sound["angle"], sound["time"], axis=0)
    spring = finger.cover * (sound["angle"] - finger.rest)
    torque = sound["force"] @ finger.arms - spring
    assert np.mean(torque * velocity, axis=0).min() > 2e-4  # W
    assert sound["force"].min() > 5.0 and np.ptp(sound["angle"], axis=0).min() > 0.2
    assert float(sound["seen"]) == 0.0 and 0.001 < float(drifting["seen"]) < 0.02
    last = len(sound["time"]) // 4
    early, late = (np.abs(drifting["hidden"][rows]).mean() for rows in (slice(0, last), slice(-last, None)))
    assert late > 3.0 * early


def test_hidden_friction_is_what_the_sound_finger_does_not_lose() -> None:
    finger = random_finger(2, np.random.default_rng(1))
    ones = np.ones((3, 4, 2))
    motion = Motion(np.arange(3.0), np.zeros((3, 2)), np.zeros((3, 2)), 0.0 * ones, ones, np.ones((3, 2)))
    force = 20.0 * np.ones((3, 4))

    def edges(hidden: Hidden) -> Array:
        return lost(finger, hidden, motion, force)[0]

    assert np.allclose(edges(Hidden())[:, :, 0], finger.arms[:, 0] * finger.share[:, 0] * 20.0)
    sheath = edges(Hidden("preload_friction", size=1.5)) - edges(Hidden())
    assert np.allclose(sheath[:, :, 0], 1.5 * finger.arms[:, 0])
    grown = edges(Hidden("friction_drift", size=0.4, seconds=2.0)) / np.where(finger.arms, edges(Hidden()), 1.0)
    assert np.allclose(grown[:, 0, 0], [1.0, 1.2, 1.4])


@pytest.mark.parametrize("effect", seen.EFFECTS)
def test_an_effect_has_the_size_that_was_asked_for(effect: str, monkeypatch: pytest.MonkeyPatch) -> None:
    for name, seconds in {"TRAIN": 12.0, "TEST": 2.0, "PILOT": 12.0}.items():
        monkeypatch.setattr(seen, name, seconds)
    case, again, other = (seen.make("dahl", effect, seed) for seed in (3, 3, 5))
    pd.testing.assert_frame_equal(case.recordings[0], again.recordings[0], check_exact=True)
    assert case.finger == again.finger != other.finger
    visible = case.facts["visible_rms"] / numpy_dahl.LEFT
    assert (visible == 0.0) if effect in (seen.NULL, seen.SENSORS) else 0.3 < visible < 6.0
    assert (case.facts["hidden_rms"] == 0.0) == (effect == seen.NULL)


def test_each_half_of_the_seeds_has_every_effect_and_a_quarter_of_nulls() -> None:
    for first in (1, 2):
        effects = [seen.effect_of(seed) for seed in range(first, first + 38, 2)]
        assert set(effects) == set(seen.EFFECTS) and effects.count(seen.NULL) == 5


# --- rows -------------------------------------------------------------------------------------------------------------


def cause(effect: str, joint: int | None = 1) -> dict[str, Any]:
    return {"effect": effect, "joint": joint, "tendon": None, "gain": {"value": 0.1, "interval": [0.05, 0.15]}}


def row(effect: str, truth: Truth, causes: list[Any], small: list[Any], verdict: str = "explained") -> dict[str, Any]:
    report = {"verdict": verdict, "causes": causes, "too_small": small, "unexplained": {"share": 0.0}}
    report |= {"gain": cause("")["gain"], "extended": {"test_rms": [0.001]}}
    return seen.judged(report, truth, effect)


def test_too_small_counts_after_the_causes() -> None:
    truth = Truth(("gravity",), 1, neutral=("presliding", "unknown"))
    answer = row("gravity", truth, [cause("presliding", None)], [cause("gravity")])
    assert (answer["in_set"], answer["first"], answer["at_place"], answer["in_causes"]) == (True, True, True, False)
    answer = row("gravity", truth, [cause("stribeck")], [cause("gravity", 2), cause("inertia")])
    assert (answer["in_set"], answer["first"], answer["at_place"]) == (True, False, False)
    assert (answer["false"], answer["false_small"]) == (("stribeck",), ("inertia",))


def test_what_is_on_no_list_is_said_to_remain_or_has_a_wrong_name() -> None:
    def answer(*given: Any) -> tuple[Any, Any]:
        answers = row("unknown_hum", Truth(neutral=("presliding", "unknown")), *given)
        return answers["unknown"], answers["wrong_name"]

    assert answer([cause("gravity")], []) == (False, True)
    assert answer([cause("presliding")], []) == (False, False)
    assert answer([cause("gravity")], [], "partly explained") == (True, False)


def test_the_table_has_the_goals() -> None:
    known = {
        "family": "dahl",
        "name": "dahl_gravity_1",
        "answered": True,
        "absorbed": False,
        "seconds": 9.0,
        "peak_megabytes": 300.0,
    }
    known |= {"hidden": cause("gravity"), "hidden_rms": 0.004, "visible_rms": 0.002, "true_gain": 0.2}
    text = seen.markdown([known | row("gravity", Truth(("gravity",), 1), [cause("gravity")], [])])
    assert "| in the set, causes and too small | ≥ 85 % | 100.0 % | 1/1 |" in text
    assert "| the gain's interval covers the true gain | 92-98 % | 0.0 % | 0/1 |" in text
    assert "| dahl_gravity_1 | gravity j1, 4.0, 2.0 | explained | gravity j1 10 % |" in text
