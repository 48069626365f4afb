"""The matched rig against the model: with the true numbers the runtime leaves nothing of its recordings."""

from __future__ import annotations

import copy
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from hidden_effects import hide
from matched_rig import Hand, Made, random_hand, record
from matched_strength import group
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
