"""The matched rig against the model: with the true numbers the runtime leaves nothing of its recordings."""

from __future__ import annotations

import copy
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from evidence.diagnosis.hidden_effects import BUILDERS, UNKNOWN, hide, placed, scaled
from evidence.fingers.matched_physics import contacts_of, motion_of, read_finger, torque_of, values_of, velocity_seen
from evidence.fingers.matched_rig import Hand, Made, Noise, coloured, random_hand, record
from evidence.fingers.matched_strength import group, kinematics, look, residual, shown_strength, surviving
from repetitions import repeated
from tendonfmu.model import native

Array = NDArray[Any]


def left_by_the_core(data: dict[str, Any], hand: Hand, made: Made) -> Array:
    """[N, n] measured torque minus the model's, whose bias moves by its jumps alone."""
    bias = data["bias"] | {
        "drift_variance": 0.0,
        "initial_variance": 0.0,
        "initial_torque": [0.0] * len(data["joints"]),
    }
    finger = native.Instance.from_description({**data, "bias": bias}, hand.source)
    names = ["tendon_force", "tendon_position"]
    names += ["joint_position"] * (hand.source >= 2) + ["joint_velocity"] * (hand.source == 3)
    inputs = {"time": made.columns["time"]} | {name: group(made.columns, name) for name in names}
    return np.asarray(finger.run(inputs)["compensated_torque"])


@pytest.mark.parametrize("presliding", [False, True])
@pytest.mark.parametrize(("joints", "source"), [(1, 1), (2, 2), (2, 3), (4, 1)])
def test_core_leaves_nothing_where_nothing_is_hidden(joints: int, source: int, presliding: bool) -> None:
    hand = random_hand(10 * joints + source, joints, presliding=presliding, source=source, rate=500.0)
    made = record(hand, seed=1, seconds=8.0, quiet=True)
    left = left_by_the_core(hand.truth, hand, made)
    assert np.abs(made.force @ np.array([t["moment_arms"] for t in hand.truth["tendons"]])).max() > 0.01
    assert np.abs(left).max() < 1e-8  # N·m; the balance is iterated to 1e-9 N


def test_core_leaves_the_noise() -> None:
    """With everything on, what is left beyond slow wander is the noise that was put in."""
    hand = random_hand(5, 2, presliding=True, rate=500.0)
    hand = replace(hand, noise=replace(hand.noise, wander=0.0))
    made = record(hand, seed=2, seconds=20.0)
    left = left_by_the_core(hand.truth, hand, made)
    rest = (left - left[0]) - (made.noise - made.noise[0])
    assert made.noise.std() > 1e-3
    assert rest.std() < 0.05 * made.noise.std()  # encoders and force sensors


# extension rows that make the nominal the truth; the loosest ones: friction there goes by measured forces, here by true
ROWS = {
    "preload_friction": ("coulomb", 1e-6),
    "load_friction": ("coulomb", 1e-6),
    "cover_hardening": ("stiffness", 1e-6),
    "inertia": ("inertia", 1e-6),
    "joint_coupling": ("stiffness", 1e-6),
    "force_offset": ("correction", 0.1),
    "force_gain": ("correction", 0.1),
    "moment_arm": ("correction", 1e-6),
    "moment_arm_variation": ("slope", 1e-6),
}


@pytest.mark.parametrize("effect", ROWS)
def test_the_row_of_the_extension_explains_the_effect(effect: str) -> None:
    """docs/reference/semantics.md#extensions and the rig's physics agree: the row takes the hidden torque away."""
    number, rest = ROWS[effect]
    hand = replace(random_hand(21, 2, rate=500.0), source=3)  # velocities as they are: no sample between two decisions
    hand, label = hide(hand, effect, None, seed=3, motion=4, seconds=10.0)
    made = record(hand, seed=4, seconds=10.0, quiet=True)
    before = left_by_the_core(hand.truth, hand, made)
    data = copy.deepcopy(hand.truth)
    place = {key: label[key] for key in ("joint", "tendon") if label[key] is not None}
    power = []
    for sign in (1.0, -1.0):
        row = {"effect": effect, **place, number: sign * label["magnitude"]}
        power.append(np.sum(left_by_the_core(data | {"extensions": [row]}, hand, made) ** 2))
    assert np.abs(before).max() > 1e-4
    assert min(power) < rest**2 * np.sum(before**2)


@pytest.mark.parametrize("presliding", [False, True])
def test_friction_takes_energy(presliding: bool) -> None:
    hand = random_hand(8, 2, presliding=presliding, rate=500.0)
    made = record(hand, seed=3, seconds=20.0, quiet=True)
    finger = read_finger(hand.truth)
    for effect in finger.effects:
        v = velocity_seen(effect, made.motion)
        power = values_of(effect, made.motion, finger).F * v
        assert presliding or power.min() >= 0.0, effect
        assert power.sum() > 0.0, effect  # hysteresis gives some back, never more than it took
        assert np.all(np.minimum.accumulate(np.cumsum(power)[::-1])[::-1] >= -1e-12), effect


def test_the_torque_stands_still_while_everything_rests() -> None:
    hand = random_hand(4, 1, rate=500.0, source=3)
    made = record(hand, seed=6, seconds=20.0, quiet=True)
    finger = read_finger(hand.truth)
    rests = np.all(np.abs(made.motion.velocity) < 1e-12, axis=1)
    torque = torque_of(finger, made.motion, made.force)
    steps = np.abs(np.diff(torque, axis=0)).max(axis=1)
    assert rests.mean() > 0.05
    assert steps[rests[1:] & rests[:-1]].max() < 1e-12
    found = contacts_of(made.motion.velocity[:, 0], finger.joint_threshold)
    assert len(found.enters) > 3 and len(found.leaves) > 3


def strength_of(hand: Hand, seed: int, seconds: float) -> tuple[float, float]:
    """Strength, and the share that survives, of what this hand hides in the recording of this seed."""
    seen = look(hand, record(hand, seed, seconds, quiet=True))
    return surviving(seen, seen.effect, hand)


@pytest.mark.parametrize(
    "effect", repeated(["gravity", "edge_friction", "inertia", "time_delay", "backlash", "rubbing"], 0, 5)
)
def test_strength_is_what_was_asked_for(effect: str) -> None:
    """Asked of the finished hand, and against a refit: least squares of the whole effect leaves that variance."""
    hand, label = hide(
        random_hand(31, 2, presliding=True, rate=250.0), effect, 0.1, seed=1, motion=2, seconds=20.0
    )  # fmt: skip
    strength, share = strength_of(hand, 2, 20.0)
    assert strength == pytest.approx(0.1, rel=0.06)
    assert (strength, share) == pytest.approx((label["strength"], label["surviving_share"]), rel=0.15)
    assert 0.0 < share <= 1.0
    whole = residual(replace(hand, hidden=hand.hidden), record(hand, 2, 20.0, quiet=True)).var(axis=0).max()
    assert whole > 0.9 * strength * hand.noise.std**2  # what survives is a part of what was there


def test_nothing_hidden_has_no_strength() -> None:
    hand = random_hand(3, 2, rate=250.0)
    assert strength_of(hand, 5, 10.0)[0] < 1e-12


@pytest.mark.parametrize("effect", [*BUILDERS, *UNKNOWN])
def test_every_effect_can_be_hidden(effect: str) -> None:
    source = 1 if effect == "tendon_nonlinearity" else 2
    hand, label = hide(random_hand(1, 2, source=source, rate=250.0), effect, None, seed=2, motion=3, seconds=6.0)
    made = record(hand, seed=3, seconds=6.0, quiet=True)
    finger = read_finger(hand.truth)
    motion, force = kinematics(hand, finger, made.columns)
    assert label["effect"] == effect and label["magnitude"] > 0.0
    assert np.abs(force @ finger.arms - torque_of(finger, motion, force)).max() > 1e-6  # N·m
    assert "extensions" in hand.nominal and not any(row["effect"] == effect for row in hand.nominal["extensions"])


def test_noise_has_the_colour_that_it_says() -> None:
    noise = Noise(std=0.002, time=0.02)
    found = coloured(np.random.default_rng(1), 200_000, 1, 0.002, noise)[:, 0]
    correlation = np.mean(found[1:] * found[:-1]) / np.mean(found**2)
    assert found.std() == pytest.approx(0.002, rel=0.03)
    assert correlation == pytest.approx(np.exp(-0.1), abs=0.01)


def test_relative_tendon_velocity_is_that_of_the_joints_beyond() -> None:
    arms = np.array([[0.01, 0.02], [-0.01, 0.005]])
    motion = motion_of(np.arange(2.0), np.zeros((2, 2)), np.array([[1.0, 2.0], [0.0, 1.0]]), arms)
    assert motion.tendon[0].tolist() == [
        [pytest.approx(0.05), pytest.approx(0.04), 0.0],
        [0.0, pytest.approx(0.01), 0.0],
    ]


def test_what_a_force_sensor_adds_stays_absorbed_and_what_it_scales_shows_at_other_tensions() -> None:
    """An offset is a constant torque at every pretension; a gain grows with it."""
    bare = replace(random_hand(4, 1, rate=250.0), tension_time=8.0)
    strengths = {}
    for effect in ("force_offset", "force_gain"):
        hand, hidden = placed(bare, effect, 1)
        hand, _ = scaled(hand, hidden, None, motion=2, seconds=20.0)
        strengths[effect] = shown_strength(hand, 2, 20.0)
    assert strengths["force_offset"] < 0.01 and strengths["force_gain"] > 1.0
