"""Pairs of a finger description and recordings that do not belong together well, by seed.

Made by a few lines of numpy that share nothing with the package: antagonistic tendons, friction of their own, noise.
`QUIRKS` spoil them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from random_extensions import random_extensions

Array = NDArray[np.float64]
Columns = dict[str, Array]  # `time` [N], groups [N, k], `contact` [N]
Description = dict[str, Any]


@dataclass
class Pair:
    """description, recordings and tests of one diagnosis. quirks: what is odd about them, the main one first."""

    seed: int
    description: Description
    recordings: list[Columns]
    tests: list[Columns]
    kinematics: int = 1
    quirks: list[str] = field(default_factory=list)

    @property
    def all(self) -> list[Columns]:
        return [*self.recordings, *self.tests]

    @property
    def joints(self) -> int:
        return len(self.description["joints"])

    @property
    def tendons(self) -> int:
        return len(self.description["tendons"])


Quirk = Callable[[np.random.Generator, Pair], Any]


# --- the finger -------------------------------------------------------------------------------------------------------


def law(rng: np.random.Generator, scale: float, velocity: float) -> Description:
    coulomb = scale * rng.uniform(0.3, 1.0)
    found = {"static": coulomb * rng.uniform(1.0, 1.6), "coulomb": coulomb, "stribeck_velocity": velocity}
    return found | ({"viscous": scale / velocity * rng.uniform(0.01, 0.1)} if rng.random() < 0.5 else {})


def routing(rng: np.random.Generator, joints: int, tendons: int) -> Array:
    """[m, n] m: pairs of tendons that pull either way; those that go further pass the joints before."""
    arms = np.zeros((tendons, joints))
    for i in range(tendons):
        last = i * joints // tendons
        arms[i, last] = (1.0 if i % 2 == 0 else -1.0) * rng.uniform(0.006, 0.012)
        arms[i, :last] = rng.choice([-1.0, 1.0]) * rng.uniform(0.003, 0.008, last)
    return arms


def finger(rng: np.random.Generator, joints: int, tendons: int) -> Description:
    arms = routing(rng, joints, tendons)
    return {
        "format": "tendonfmu-finger-1",
        "name": "odd_finger",
        "joints": [
            {"name": f"joint_{j + 1}", "friction": law(rng, 0.008, 0.1)}
            | ({"cover": {"stiffness": rng.uniform(0.005, 0.03)}} if rng.random() < 0.5 else {})
            for j in range(joints)
        ],
        "tendons": [
            {
                "name": f"tendon_{i + 1}",
                "stiffness": rng.uniform(2e3, 2e4),
                "moment_arms": arms[i].tolist(),
                "edge_friction": [
                    law(rng, 0.04, 0.005) if arm and rng.random() < 0.7 else None for arm in arms[i].tolist()
                ],
            }
            for i in range(tendons)
        ],
        "bias": {"drift_variance": 1e-6, "noise_std": 0.005},
        "contact": {"threshold": [0.05] * joints},
    }


def arms_of(description: Description) -> Array:
    return np.array([tendon["moment_arms"] for tendon in description["tendons"]], dtype=float)


def moved(rng: np.random.Generator, description: Description, seconds: float, rate: float) -> Columns:
    """A recording of free motion: sines of several speeds, pretension in steps, friction that grows with the force."""
    arms = arms_of(description)
    joints = arms.shape[1]
    time = np.arange(round(seconds * rate)) / rate
    angle = np.zeros((len(time), joints))
    for j in range(joints):
        for part in range(3):
            speed = rng.uniform(0.3, 1.5) * (part + 1)
            angle[:, j] += rng.uniform(0.1, 0.4) * np.sin(speed * time + rng.uniform(0.0, 6.0))
    velocity = np.gradient(angle, time, axis=0) if len(time) > 1 else np.zeros_like(angle)
    level = rng.uniform(5.0, 20.0, 4)[np.minimum((4 * time / max(seconds, 1e-9)).astype(int), 3)]
    size = rng.uniform(0.002, 0.02, joints) + rng.uniform(0.0, 5e-4, joints) * level[:, None]
    torque = size * np.tanh(velocity / rng.uniform(0.01, 0.05)) + rng.uniform(0.0, 0.03, joints) * angle
    torque += rng.uniform(0.0, 3e-3, joints) * velocity
    stiffness = np.array([tendon["stiffness"] for tendon in description["tendons"]])
    force = np.maximum(level[:, None] + torque @ np.linalg.pinv(arms), 0.0)
    force = force + 0.02 * rng.normal(size=force.shape)
    position = angle @ arms.T + force / np.where(stiffness > 0, stiffness, 1.0) + 1e-6 * rng.normal(size=force.shape)
    return {"time": time, "tendon_force": force, "tendon_position": position} | (
        {"joint_position": angle + 1e-4 * rng.normal(size=angle.shape), "joint_velocity": velocity}
    )


# --- what can be odd, by name -----------------------------------------------------------------------------------------

QUIRKS: dict[str, Quirk] = {}
SENSORS = ("tendon_force", "tendon_position")
ENCODERS = ("joint_position", "joint_velocity")


def quirk(change: Quirk) -> Quirk:
    QUIRKS[change.__name__] = change
    return change


def in_columns(change: Callable[[np.random.Generator, Columns], None]) -> Quirk:
    """A quirk of every recording and test."""

    def spoil(rng: np.random.Generator, pair: Pair) -> None:
        for columns in pair.all:
            change(rng, columns)

    return spoil


def scaled(*names: str, by: float, kinematics: int = 0) -> Quirk:
    """Columns in another unit, or with the other sign."""

    def spoil(rng: np.random.Generator, pair: Pair) -> None:
        pair.kinematics = kinematics or pair.kinematics
        for columns, name in product(pair.all, names):
            columns[name] *= by

    return spoil


def described(**keys: Any) -> Quirk:
    """Keys of the description; None: left out. `extensions` are added to those that are there."""

    def spoil(rng: np.random.Generator, pair: Pair) -> None:
        rows = [*pair.description.get("extensions", []), *keys.get("extensions", [])]
        changed = pair.description | keys | ({"extensions": rows} if rows else {})
        pair.description = {key: value for key, value in changed.items() if value is not None}

    return spoil


def with_bias(**numbers: Any) -> Quirk:
    return lambda rng, pair: pair.description.setdefault("bias", {}).update(numbers)


def with_laws(**numbers: float) -> Quirk:
    """Of all joints and edges whose law is one side and one point."""

    def spoil(rng: np.random.Generator, pair: Pair) -> None:
        edges = [edge for tendon in pair.description["tendons"] for edge in tendon.get("edge_friction") or []]
        for place in [*(joint.get("friction") for joint in pair.description["joints"]), *edges]:
            if place and "coulomb" in place:
                place |= numbers

    return spoil


def of_tendons(**keys: Any) -> Quirk:
    def spoil(rng: np.random.Generator, pair: Pair) -> None:
        for tendon in pair.description["tendons"]:
            tendon |= keys

    return spoil


def remade(joints: int, tendons: int) -> Quirk:
    """Another finger, and recordings of it."""

    def spoil(rng: np.random.Generator, pair: Pair) -> None:
        pair.description = finger(rng, joints, tendons)
        pair.recordings = [moved(rng, pair.description, 10.0, 100.0)]
        pair.tests = [moved(rng, pair.description, 6.0, 100.0)] if pair.tests else []

    return spoil


def recorded(seconds: float, rate: float) -> Quirk:
    """One recording of another length and rate."""

    def spoil(rng: np.random.Generator, pair: Pair) -> None:
        pair.recordings, pair.tests = [moved(rng, pair.description, seconds, rate)], []

    return spoil


QUIRKS |= {
    "nothing_odd": lambda rng, pair: None,
    "one_joint": remade(1, 2),
    "four_joints_eight_tendons": remade(4, 8),
    "five_seconds": recorded(5.0, 100.0),
    "twenty_hertz": recorded(20.0, 20.0),
    "a_sample_every_half_second": recorded(60.0, 2.0),
    "degrees_for_radians": scaled(*ENCODERS, by=180.0 / np.pi, kinematics=3),
    "forces_in_millinewtons": scaled("tendon_force", by=1e3),
    "absurdly_large": scaled(*SENSORS, by=1e12),
    "absurdly_small": scaled("tendon_force", by=1e-200),
    "wrong_signs": scaled("tendon_position", by=-1.0),
    "no_friction_given": lambda rng, pair: [
        part.pop(key, None)
        for part in (*pair.description["joints"], *pair.description["tendons"])
        for key in ("friction", "edge_friction")
    ],
    "friction_of_nothing": with_laws(static=0.0, coulomb=0.0),
    "viscous_alone": with_laws(static=0.0, coulomb=0.0, viscous=0.5),
    "friction_far_too_large": with_laws(static=50.0, coulomb=40.0),
    "soft_tendons": of_tendons(stiffness=1e-3),
    "names_of_any_letters": of_tendons(name="Zeigefinger <b>№ 2</b> & ↯ ${x} {{y}} %s"),
    "threshold_zero": described(velocity_threshold={"tendon": 0.0, "joint": 0.0}),
    "threshold_huge": described(velocity_threshold={"tendon": 10.0, "joint": 1000.0}),
    "filter_off": described(velocity_filter_cutoff=0.0),
    "no_bias_given": described(bias=None),
    "noise_zero": with_bias(noise_std=0.0, noise_std_per_force=0.0),
    "bias_eager": with_bias(drift_variance=1e3, forget_rate=0.0, noise_time=0.001),
    "bias_that_begins_under_load": lambda rng, pair: with_bias(
        initial_torque=[0.05] * pair.joints, initial_variance=0.0
    )(rng, pair),
    "delayed_forces": described(extensions=[{"effect": "time_delay", "delay": -0.01}]),
    "presliding_is_there": described(
        extensions=[
            {"effect": "presliding", "joint": 1, "displacement": 0.01},
            {"effect": "presliding", "tendon": 1, "displacement": 1e-4},
        ]
    ),
}


@quirk
def extensions_of_any_kind(rng: np.random.Generator, pair: Pair) -> None:
    pair.description["extensions"] = random_extensions(rng, pair.joints, pair.tendons, pair.kinematics)


@quirk
def other_joint_count(rng: np.random.Generator, pair: Pair) -> None:
    for columns, name in product(pair.all, ENCODERS):
        columns[name] = np.hstack([columns[name], columns[name][:, :1]])


@quirk
def other_tendon_count(rng: np.random.Generator, pair: Pair) -> None:
    for columns, name in product(pair.all, SENSORS):
        columns[name] = columns[name][:, :-1] if pair.seed % 2 else np.hstack([columns[name]] * 2)


@quirk
def joints_not_measured(rng: np.random.Generator, pair: Pair) -> None:
    pair.kinematics = int(rng.integers(1, 4))
    for columns, name in product(pair.all, ENCODERS):
        columns.pop(name)


# --- signals


@quirk
@in_columns
def slack_tendons(rng: np.random.Generator, columns: Columns) -> None:
    force = columns["tendon_force"]
    force[:, 0] -= 1.2 * np.median(force[:, 0])
    force[:, -1] *= rng.integers(0, 2)


@quirk
@in_columns
def huge_noise(rng: np.random.Generator, columns: Columns) -> None:
    columns["tendon_force"] += 30.0 * rng.normal(size=columns["tendon_force"].shape)
    columns["tendon_position"] += 5e-3 * rng.normal(size=columns["tendon_position"].shape)


@quirk
def constant_signals(rng: np.random.Generator, pair: Pair) -> None:
    for columns, name in product(pair.recordings, (*SENSORS, *ENCODERS)):
        columns[name][:] = columns[name][0]


@quirk
def stuck_sensor(rng: np.random.Generator, pair: Pair) -> None:
    name = str(rng.choice(["tendon_force", "tendon_position", "joint_position"]))
    for columns in pair.recordings:
        part = slice(len(columns["time"]) // 4, int(len(columns["time"]) * rng.uniform(0.4, 0.95)))
        columns[name][part, 0] = columns[name][part.start, 0]


@quirk
def a_joint_that_rests(rng: np.random.Generator, pair: Pair) -> None:
    pair.kinematics = 3
    for columns in pair.all:
        columns["joint_position"][:, -1] = 0.1 + 1e-6 * rng.normal(size=len(columns["time"]))
        columns["joint_velocity"][:, -1] = 0.0


@quirk
@in_columns
def known_load(rng: np.random.Generator, columns: Columns) -> None:
    columns["external_torque"] = 0.02 * np.sin(columns["time"])[:, None] * np.ones(columns["joint_position"].shape)


# --- contact


@quirk
@in_columns
def labelled_contact(rng: np.random.Generator, columns: Columns) -> None:
    columns["contact"] = (columns["time"] % 3.0 < 0.8).astype(float)
    columns["tendon_force"][:, 0] += 8.0 * columns["contact"]


@quirk
def unlabelled_contact(rng: np.random.Generator, pair: Pair) -> None:
    for columns in pair.recordings:
        columns["tendon_force"][:, 0] += 15.0 * np.exp(-(((columns["time"] - rng.uniform(2.0, 8.0)) / 0.3) ** 2))


@quirk
def hardly_free(rng: np.random.Generator, pair: Pair) -> None:
    """Free motion in moments only, or never."""
    for columns in pair.recordings:
        columns["contact"] = (columns["time"] % 1.0 > rng.choice([0.07, -1.0])).astype(float)


# --- time


@quirk
@in_columns
def late_clock(rng: np.random.Generator, columns: Columns) -> None:
    columns["time"] += 1e9


@quirk
@in_columns
def gaps(rng: np.random.Generator, columns: Columns) -> None:
    """A few of up to 100 s, or so many that some parts between them are too short to use."""
    for start in np.unique(rng.integers(1, len(columns["time"]), rng.choice([3, 12]))):
        columns["time"][start:] += rng.choice([1.0, 100.0])


@quirk
def time_goes_back(rng: np.random.Generator, pair: Pair) -> None:
    time = pair.recordings[0]["time"]
    time[len(time) // 2] = time[len(time) // 2 - 1] - rng.choice([0.0, 0.5])


@quirk
def few_samples(rng: np.random.Generator, pair: Pair) -> None:
    count = int(rng.choice([1, 2, 5, 19, 20, 21, 40, 100]))
    pair.recordings = [{name: values[:count] for name, values in pair.recordings[0].items()}]


# --- several recordings, and tests


@quirk
def two_rates(rng: np.random.Generator, pair: Pair) -> None:
    pair.recordings.append(moved(rng, pair.description, 6.0, 400.0))


@quirk
def the_same_motion_again(rng: np.random.Generator, pair: Pair) -> None:
    again = {name: values.copy() for name, values in pair.recordings[0].items()}
    again["tendon_force"] += 0.02 * rng.normal(size=again["tendon_force"].shape)
    pair.recordings.append(again)


@quirk
def another_length_of_test(rng: np.random.Generator, pair: Pair) -> None:
    pair.tests = [moved(rng, pair.description, float(rng.choice([0.3, 1.0, 18.0])), 100.0)]


@quirk
def another_finger_in_the_test(rng: np.random.Generator, pair: Pair) -> None:
    pair.tests = [moved(rng, finger(rng, pair.joints + 1, pair.tendons + 2), 8.0, 100.0)]


@quirk
def contact_in_the_test(rng: np.random.Generator, pair: Pair) -> None:
    pair.tests = [moved(rng, pair.description, 6.0, 100.0)]
    pair.tests[0]["contact"] = np.ones(len(pair.tests[0]["time"]))


# --- laws and arms


@quirk
def asymmetric_laws(rng: np.random.Generator, pair: Pair) -> None:
    for joint in pair.description["joints"]:
        joint["friction"] = {"positive": law(rng, 0.008, 0.1), "negative": law(rng, 0.02, 0.1)}


@quirk
def laws_at_angles(rng: np.random.Generator, pair: Pair) -> None:
    for tendon in pair.description["tendons"]:
        points = sorted(rng.uniform(-1.0, 1.0, int(rng.integers(1, 6))).tolist())
        edge = {"angles": points, "laws": [law(rng, 0.04, 0.005) for _ in points]}
        tendon["edge_friction"] = [edge if arm else None for arm in tendon["moment_arms"]]


@quirk
def pulleys_and_load(rng: np.random.Generator, pair: Pair) -> None:
    for tendon in pair.description["tendons"]:
        tendon["pulley_friction"] = [law(rng, 0.03, 0.005) for _ in range(pair.joints - 1)]
    for joint in pair.description["joints"]:
        joint |= {"load_friction": law(rng, 2e-4, 0.1), "cover": {"stiffness": 0.0}}


@quirk
def cable_loops(rng: np.random.Generator, pair: Pair) -> None:
    of_tendons(bidirectional=True)(rng, pair)
    for columns in pair.all:
        columns["tendon_force"] -= columns["tendon_force"].mean(axis=0)


@quirk
def a_joint_that_no_tendon_moves(rng: np.random.Generator, pair: Pair) -> None:
    for tendon in pair.description["tendons"]:
        tendon["moment_arms"][-1] = 0.0


@quirk
def a_tendon_that_moves_nothing(rng: np.random.Generator, pair: Pair) -> None:
    pair.description["tendons"].append({"name": "spare", "stiffness": 5000.0, "moment_arms": [0.0] * pair.joints})
    for columns, name in product(pair.all, SENSORS):
        columns[name] = np.hstack([columns[name], columns[name][:, :1]])


@quirk
def nearly_the_same_arms(rng: np.random.Generator, pair: Pair) -> None:
    """Two joints that the tendons can hardly tell apart."""
    for tendon in pair.description["tendons"]:
        first = tendon["moment_arms"][0] or 0.008
        tendon["moment_arms"] = [first * (1.0 + 1e-9 * j * rng.random()) for j in range(pair.joints)]


# --- pairs ------------------------------------------------------------------------------------------------------------

SEVERAL = 0.35  # of the pairs have a further quirk
ALONE = ("other_joint_count", "other_tendon_count", "another_finger_in_the_test", "joints_not_measured")
REMAKING = (
    *("one_joint", "four_joints_eight_tendons", "five_seconds", "twenty_hertz", "a_sample_every_half_second"),
    "few_samples",
)


def make_pair(seed: int) -> Pair:
    """The pair of a seed, always the same: it has the quirks in turn, and some have more."""
    rng = np.random.default_rng([seed, 20])
    names = list(QUIRKS)
    chosen = [names[seed % len(names)]]
    while rng.random() < SEVERAL and len(chosen) < 3:
        chosen.append(str(rng.choice([name for name in names if name not in (*chosen, *ALONE)])))
    joints = int(rng.choice([1, 2, 2, 3]))
    tendons = int(rng.choice([2 * joints, joints + 1]))
    description = finger(rng, joints, tendons)
    rate = float(rng.choice([100.0, 100.0, 200.0, 500.0]))
    recordings = [moved(rng, description, rng.uniform(6.0, 20.0) if rate < 500.0 else 8.0, rate)]
    tests = [moved(rng, description, rng.uniform(5.0, 10.0), rate)] if rng.random() < 0.5 else []
    pair = Pair(seed, description, recordings, tests)
    # what makes recordings anew comes first, what takes columns away last
    for name in sorted(chosen, key=lambda name: (name not in REMAKING, name in ALONE)):
        QUIRKS[name](rng, pair)
    pair.quirks = chosen
    return pair
