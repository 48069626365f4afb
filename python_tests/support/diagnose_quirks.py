"""What can be odd about a description and recordings, by name: each quirk changes a pair."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from odd_finger import Columns, Description, Pair, finger, law, moved
from random_extensions import random_extensions

Quirk = Callable[[np.random.Generator, Pair], None]
QUIRKS: dict[str, Quirk] = {}


def quirk(change: Quirk) -> Quirk:
    QUIRKS[change.__name__] = change
    return change


def remade(rng: np.random.Generator, pair: Pair, joints: int, tendons: int, rate: float = 100.0) -> None:
    pair.description = finger(rng, joints, tendons)
    pair.recordings = [moved(rng, pair.description, 10.0, rate)]
    pair.tests = [moved(rng, pair.description, 6.0, rate)] if pair.tests else []


def rows(columns: Columns, chosen: Any) -> Columns:
    return {name: values[chosen] for name, values in columns.items()}


def each_law(pair: Pair) -> list[Description]:
    """Laws of joints and edges that are one side and one point."""
    found = [joint[key] for joint in pair.description["joints"] for key in ("friction",) if joint.get(key)]
    edges = [edge for tendon in pair.description["tendons"] for edge in tendon.get("edge_friction") or [] if edge]
    return [each for each in [*found, *edges] if "coulomb" in each]


def with_rows(pair: Pair, *extensions: Description) -> None:
    pair.description["extensions"] = [*pair.description.get("extensions", []), *extensions]


@quirk
def nothing_odd(rng: np.random.Generator, pair: Pair) -> None: ...


@quirk
def other_joint_count(rng: np.random.Generator, pair: Pair) -> None:
    for columns in pair.all:
        for name in ("joint_position", "joint_velocity"):
            columns[name] = np.hstack([columns[name], columns[name][:, :1]])


@quirk
def other_tendon_count(rng: np.random.Generator, pair: Pair) -> None:
    for columns in pair.all:
        for name in ("tendon_force", "tendon_position"):
            columns[name] = columns[name][:, :-1] if rng.random() < 0.5 else np.hstack([columns[name]] * 2)


@quirk
def one_joint(rng: np.random.Generator, pair: Pair) -> None:
    remade(rng, pair, 1, int(rng.integers(1, 4)))


@quirk
def no_friction_given(rng: np.random.Generator, pair: Pair) -> None:
    pair.description["joints"] = [{"name": joint["name"]} for joint in pair.description["joints"]]
    for tendon in pair.description["tendons"]:
        tendon.pop("edge_friction")


@quirk
def four_joints_eight_tendons(rng: np.random.Generator, pair: Pair) -> None:
    remade(rng, pair, 4, 8)


@quirk
def slack_tendons(rng: np.random.Generator, pair: Pair) -> None:
    for columns in pair.all:
        force = columns["tendon_force"]
        force[:, 0] -= 1.2 * np.median(force[:, 0])
        if rng.random() < 0.5:
            force[:, -1] = 0.0


@quirk
def five_seconds(rng: np.random.Generator, pair: Pair) -> None:
    pair.recordings = [moved(rng, pair.description, 5.0, 100.0)]
    pair.tests = []


@quirk
def twenty_hertz(rng: np.random.Generator, pair: Pair) -> None:
    pair.recordings = [moved(rng, pair.description, 20.0, 20.0)]


@quirk
def huge_noise(rng: np.random.Generator, pair: Pair) -> None:
    for columns in pair.all:
        columns["tendon_force"] += 30.0 * rng.normal(size=columns["tendon_force"].shape)
        columns["tendon_position"] += 5e-3 * rng.normal(size=columns["tendon_position"].shape)


@quirk
def constant_signals(rng: np.random.Generator, pair: Pair) -> None:
    for columns in pair.recordings:
        for name in columns:
            if name != "time":
                columns[name][:] = columns[name][0]


@quirk
def constant_forces(rng: np.random.Generator, pair: Pair) -> None:
    for columns in pair.all:
        columns["tendon_force"][:] = 10.0


@quirk
def degrees_for_radians(rng: np.random.Generator, pair: Pair) -> None:
    pair.kinematics = int(rng.integers(2, 4))
    for columns in pair.all:
        for name in ("joint_position", "joint_velocity"):
            columns[name] *= 180.0 / np.pi


@quirk
def forces_in_millinewtons(rng: np.random.Generator, pair: Pair) -> None:
    for columns in pair.all:
        columns["tendon_force"] *= 1000.0


@quirk
def positions_in_millimetres(rng: np.random.Generator, pair: Pair) -> None:
    for columns in pair.all:
        columns["tendon_position"] *= 1000.0


@quirk
def absurdly_large(rng: np.random.Generator, pair: Pair) -> None:
    name = str(rng.choice(["tendon_force", "tendon_position"]))
    size = float(10.0 ** rng.uniform(6.0, 13.0))
    for columns in pair.all:
        columns[name] *= size


@quirk
def absurdly_small(rng: np.random.Generator, pair: Pair) -> None:
    size = float(10.0 ** rng.uniform(-200.0, -6.0))
    for columns in pair.all:
        columns["tendon_force"] *= size


@quirk
def late_clock(rng: np.random.Generator, pair: Pair) -> None:
    for columns in pair.all:
        columns["time"] += 1e9


@quirk
def jittered_time(rng: np.random.Generator, pair: Pair) -> None:
    for columns in pair.all:
        step = np.median(np.diff(columns["time"]))
        columns["time"] += 0.45 * step * rng.uniform(-1.0, 1.0, len(columns["time"]))


@quirk
def gaps(rng: np.random.Generator, pair: Pair) -> None:
    for columns in pair.all:
        for _ in range(int(rng.integers(1, 6))):
            columns["time"][int(rng.integers(1, len(columns["time"]))) :] += rng.uniform(0.5, 100.0)


@quirk
def many_gaps(rng: np.random.Generator, pair: Pair) -> None:
    """Stretches of a second, and some that are too short to use."""
    for columns in pair.recordings:
        starts = np.unique(rng.integers(1, len(columns["time"]), 12))
        for start in starts:
            columns["time"][start:] += 1.0


@quirk
def two_rates(rng: np.random.Generator, pair: Pair) -> None:
    pair.recordings.append(moved(rng, pair.description, 6.0, 400.0))


@quirk
def labelled_contact(rng: np.random.Generator, pair: Pair) -> None:
    for columns in pair.all:
        touching = (columns["time"] % 3.0 < 0.8).astype(float)
        columns["contact"] = touching
        columns["tendon_force"][:, 0] += 8.0 * touching


@quirk
def unlabelled_contact(rng: np.random.Generator, pair: Pair) -> None:
    for columns in pair.recordings:
        push = np.exp(-(((columns["time"] - rng.uniform(2.0, 8.0)) / 0.3) ** 2))
        columns["tendon_force"][:, 0] += 15.0 * push


@quirk
def nothing_but_contact(rng: np.random.Generator, pair: Pair) -> None:
    for columns in pair.recordings:
        columns["contact"] = np.ones(len(columns["time"]))


@quirk
def hardly_free(rng: np.random.Generator, pair: Pair) -> None:
    """Free motion in moments only."""
    for columns in pair.recordings:
        columns["contact"] = (columns["time"] % 1.0 > 0.07).astype(float)


@quirk
def joints_not_measured(rng: np.random.Generator, pair: Pair) -> None:
    pair.kinematics = int(rng.integers(2, 4))
    for columns in pair.all:
        columns.pop("joint_velocity")
        if pair.kinematics == 2:
            columns.pop("joint_position")


@quirk
def joints_measured(rng: np.random.Generator, pair: Pair) -> None:
    pair.kinematics = int(rng.integers(2, 4))


@quirk
def no_joint_columns(rng: np.random.Generator, pair: Pair) -> None:
    for columns in pair.all:
        columns.pop("joint_velocity")
        columns.pop("joint_position")


@quirk
def known_load(rng: np.random.Generator, pair: Pair) -> None:
    for columns in pair.all:
        shape = columns["joint_position"].shape
        columns["external_torque"] = 0.02 * np.sin(columns["time"])[:, None] * np.ones(shape)


@quirk
def known_load_in_contact(rng: np.random.Generator, pair: Pair) -> None:
    known_load(rng, pair)
    labelled_contact(rng, pair)


@quirk
def own_time_delay(rng: np.random.Generator, pair: Pair) -> None:
    with_rows(pair, {"effect": "time_delay", "delay": float(rng.choice([-1.0, 1.0]) * rng.uniform(0.001, 0.02))})


@quirk
def own_presliding(rng: np.random.Generator, pair: Pair) -> None:
    with_rows(pair, {"effect": "presliding", "joint": 1, "displacement": 0.01})
    with_rows(pair, {"effect": "presliding", "tendon": 1, "displacement": 1e-4})


@quirk
def own_backlash(rng: np.random.Generator, pair: Pair) -> None:
    with_rows(pair, {"effect": "backlash", "joint": 1, "width": 0.02})


@quirk
def own_stribeck(rng: np.random.Generator, pair: Pair) -> None:
    with_rows(pair, {"effect": "stribeck", "joint": 1, "stribeck_velocity": 0.3, "amplitude": 0.4})


@quirk
def own_rows_of_any_kind(rng: np.random.Generator, pair: Pair) -> None:
    pair.description["extensions"] = random_extensions(rng, pair.joints, pair.tendons, pair.kinematics)


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
def cable_loops(rng: np.random.Generator, pair: Pair) -> None:
    for tendon in pair.description["tendons"]:
        tendon["bidirectional"] = True
    for columns in pair.all:
        columns["tendon_force"] -= columns["tendon_force"].mean(axis=0)


@quirk
def pulleys_and_load(rng: np.random.Generator, pair: Pair) -> None:
    for tendon in pair.description["tendons"]:
        tendon["pulley_friction"] = [law(rng, 0.03, 0.005) for _ in range(pair.joints - 1)]
    for joint in pair.description["joints"]:
        joint["load_friction"] = law(rng, 2e-4, 0.1)


@quirk
def threshold_zero(rng: np.random.Generator, pair: Pair) -> None:
    pair.description["velocity_threshold"] = {"tendon": 0.0, "joint": 0.0}


@quirk
def threshold_huge(rng: np.random.Generator, pair: Pair) -> None:
    pair.description["velocity_threshold"] = {"tendon": 10.0, "joint": 1000.0}


@quirk
def drift_zero(rng: np.random.Generator, pair: Pair) -> None:
    pair.description["bias"]["drift_variance"] = 0.0


@quirk
def noise_zero(rng: np.random.Generator, pair: Pair) -> None:
    pair.description["bias"] |= {"noise_std": 0.0, "noise_std_per_force": float(rng.choice([0.0, 1e-3]))}


@quirk
def bias_eager(rng: np.random.Generator, pair: Pair) -> None:
    pair.description["bias"] |= {"drift_variance": 1e3, "forget_rate": 0.0, "noise_time": 0.001}


@quirk
def bias_that_begins_under_load(rng: np.random.Generator, pair: Pair) -> None:
    pair.description["bias"] |= {"initial_torque": [0.05] * pair.joints, "initial_variance": 0.0}


@quirk
def no_bias_given(rng: np.random.Generator, pair: Pair) -> None:
    pair.description.pop("bias")


@quirk
def filter_off(rng: np.random.Generator, pair: Pair) -> None:
    pair.description["velocity_filter_cutoff"] = 0.0


@quirk
def cover_of_nothing(rng: np.random.Generator, pair: Pair) -> None:
    for joint in pair.description["joints"]:
        joint["cover"] = {"stiffness": 0.0}


@quirk
def friction_of_nothing(rng: np.random.Generator, pair: Pair) -> None:
    for each in each_law(pair):
        each |= {"static": 0.0, "coulomb": 0.0}


@quirk
def viscous_alone(rng: np.random.Generator, pair: Pair) -> None:
    for each in each_law(pair):
        each |= {"static": 0.0, "coulomb": 0.0, "viscous": 0.5}


@quirk
def friction_far_too_large(rng: np.random.Generator, pair: Pair) -> None:
    for each in each_law(pair):
        each |= {"static": 50.0, "coulomb": 40.0}


@quirk
def a_joint_that_no_tendon_moves(rng: np.random.Generator, pair: Pair) -> None:
    for tendon in pair.description["tendons"]:
        tendon["moment_arms"][-1] = 0.0


@quirk
def tendons_that_move_nothing(rng: np.random.Generator, pair: Pair) -> None:
    """A tendon beside the others without any moment arm."""
    own = {"name": "spare", "stiffness": 5000.0, "moment_arms": [0.0] * pair.joints}
    pair.description["tendons"].append(own)
    for columns in pair.all:
        for name in ("tendon_force", "tendon_position"):
            columns[name] = np.hstack([columns[name], columns[name][:, :1]])


@quirk
def nearly_the_same_arms(rng: np.random.Generator, pair: Pair) -> None:
    """Two joints that the tendons can hardly tell apart."""
    for tendon in pair.description["tendons"]:
        first = tendon["moment_arms"][0] or 0.008
        tendon["moment_arms"] = [first * (1.0 + 1e-9 * j * rng.random()) for j in range(pair.joints)]


@quirk
def soft_tendons(rng: np.random.Generator, pair: Pair) -> None:
    for tendon in pair.description["tendons"]:
        tendon["stiffness"] = 1e-3


@quirk
def wrong_signs(rng: np.random.Generator, pair: Pair) -> None:
    for columns in pair.all:
        columns["tendon_position"] *= -1.0


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
def test_of_other_length(rng: np.random.Generator, pair: Pair) -> None:
    pair.tests = [moved(rng, pair.description, float(rng.choice([0.3, 1.0, 18.0])), 100.0)]


@quirk
def test_of_another_finger(rng: np.random.Generator, pair: Pair) -> None:
    pair.tests = [moved(rng, finger(rng, pair.joints + 1, pair.tendons + 2), 8.0, 100.0)]


@quirk
def test_that_rests(rng: np.random.Generator, pair: Pair) -> None:
    rest = moved(rng, pair.description, 6.0, 100.0)
    pair.tests = [{name: values if name == "time" else 0 * values + values[:1] for name, values in rest.items()}]


@quirk
def test_in_contact(rng: np.random.Generator, pair: Pair) -> None:
    pair.tests = [moved(rng, pair.description, 6.0, 100.0)]
    pair.tests[0]["contact"] = np.ones(len(pair.tests[0]["time"]))


@quirk
def few_samples(rng: np.random.Generator, pair: Pair) -> None:
    count = int(rng.choice([1, 2, 5, 19, 20, 21, 40, 100]))
    pair.recordings = [rows(pair.recordings[0], slice(0, count))]
    if rng.random() < 0.5:
        pair.tests = []


@quirk
def slow_samples(rng: np.random.Generator, pair: Pair) -> None:
    """One every half second."""
    pair.recordings = [moved(rng, pair.description, 60.0, 2.0)]
    pair.tests = []


@quirk
def time_goes_back(rng: np.random.Generator, pair: Pair) -> None:
    time = pair.recordings[0]["time"]
    time[len(time) // 2] = time[len(time) // 2 - 1] - rng.choice([0.0, 0.5])


@quirk
def the_same_motion_again(rng: np.random.Generator, pair: Pair) -> None:
    first = pair.recordings[0]
    again = {name: values.copy() for name, values in first.items()}
    again["tendon_force"] += 0.02 * rng.normal(size=again["tendon_force"].shape)
    pair.recordings.append(again)


@quirk
def exact_numbers(rng: np.random.Generator, pair: Pair) -> None:
    """Coarse sensors: forces in steps of 0.5 N, positions of 0.1 mm."""
    for columns in pair.all:
        columns["tendon_force"] = np.round(2.0 * columns["tendon_force"]) / 2.0
        columns["tendon_position"] = np.round(columns["tendon_position"], 4)


@quirk
def names_of_any_letters(rng: np.random.Generator, pair: Pair) -> None:
    pair.description["name"] = "Zeigefinger <b>№ 2</b> & 'so weiter'"
    pair.description["joints"][0]["name"] = "↯ ${x} {{y}} %s"
    pair.description["tendons"][0]["name"] = None


ALONE = ("other_joint_count", "other_tendon_count", "test_of_another_finger", "joints_not_measured", "no_joint_columns")
REMAKING = ("one_joint", "four_joints_eight_tendons", "five_seconds", "twenty_hertz", "slow_samples", "few_samples")
