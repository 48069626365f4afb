"""Fingers, choices of unknowns and what connects the estimation with its naive twin, for its tests."""

from __future__ import annotations

import copy
import json
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

import oracle_fit
from random_fingers import Description, Recording, random_case
from tendonfmu.model import native

Array = NDArray[Any]


def law(size: float, velocity: float, viscous: float = 0.0) -> Description:
    found = {"static": 1.5 * size, "coulomb": size, "stribeck_velocity": velocity}
    return found | ({"viscous": viscous * size / velocity} if viscous else {})


def plain(size: float, velocity: float, viscous: float = 0.0) -> Description:
    """A law without Stribeck effect."""
    return law(size, velocity, viscous) | {"static": size}


def small_finger() -> Description:
    """2 joints, 4 tendons; pulleys, edges with and without working points, both joint frictions, covers."""
    arms = [[0.009, 0.006], [0.009, -0.006], [-0.008, 0.005], [-0.008, -0.005]]
    pulley = law(0.02, 0.004, 0.1)
    points = {"angles": [-0.4, 0.4], "laws": [law(0.02, 0.004), law(0.04, 0.004, 0.1)]}
    tendons = [
        {"name": f"tendon_{i}", "stiffness": 4000.0, "moment_arms": row, "pulley_friction": [pulley, None],
         "edge_friction": [law(0.03, 0.004, 0.1), points]}
        for i, row in enumerate(arms, start=1)
    ]  # fmt: skip
    return {
        "format": "tendonfmu-finger-1",
        "name": "small",
        "joints": [
            {"name": "base", "cover": {"stiffness": 0.03}, "friction": law(0.006, 0.08, 0.2)},
            {"name": "tip", "cover": {"stiffness": 0.02, "rest_angle": 0.1}, "load_friction": law(1e-4, 0.08, 0.2)},
        ],
        "tendons": tendons,
        "bias": {"drift_variance": 1e-5, "noise_std": 0.003, "forget_rate": 3.0},
        "contact": {"threshold": [0.03, 0.03]},
    }


def lasting_finger(**bias: float) -> Description:
    """The small finger, whose jumps of the bias mostly cancel: made data stay in reach for a minute and more."""
    description = small_finger()
    description["bias"] |= {"forget_rate": 0.1, **bias}
    return description


def few_unknowns(path: str) -> str | None:
    """All tendons of the small finger alike: 19 unknowns that half a minute of motion identifies."""
    before, name = oracle_fit.family(path)
    if name == "stiffness" and before.startswith("joints"):
        return path
    if name not in ("static", "coulomb", "stribeck_velocity", "viscous"):
        return None
    return path if before.startswith("joints") else path[path.index("].") :]


def parameters_of(description: Description) -> tuple[list[str], Array]:
    """Paths and values of all parameters, in canonical order."""
    found = native.Instance.from_description(description).parameters()
    return [each.path for each in found], np.array([each.start for each in found])


def image_of(description: Description) -> bytes:
    return native.image_from_json(json.dumps(description))


def groups(description: Description, key: Callable[[str], str | None] = lambda path: path) -> NDArray[np.int32]:
    """[p] what is present and has a key; equal keys share one value."""
    paths, values = parameters_of(description)
    free = oracle_fit.free_groups(paths, values)
    numbers: dict[str, int] = {}
    found = np.full(len(paths), -1, dtype=np.int32)
    for k, path in enumerate(paths):
        name = key(path) if free[k] >= 0 else None
        if name is not None:
            found[k] = numbers.setdefault(name, len(numbers))
    return found


def twin_of(description: Description, group: Sequence[int] | Array, unknowns: Sequence[Any]) -> oracle_fit.Unknowns:
    """The twin's unknowns in the order of the estimator's."""
    return oracle_fit.Unknowns(*parameters_of(description), [int(g) for g in group]).in_order_of(unknowns)


def shared_key(seed: int) -> Callable[[str], str | None]:
    """A choice of what to fix and to share: directions tied, Stribeck velocities of a table one, a tenth fixed."""
    rng = np.random.default_rng([seed, 5])
    fixed: dict[str, bool] = {}

    def key(path: str) -> str | None:
        if fixed.setdefault(path, bool(rng.random() < 0.1)):
            return None
        before, name = oracle_fit.family(path)
        if name == "stribeck_velocity":
            return before.split(".laws")[0] + name
        return path.replace(".positive.", ".").replace(".negative.", ".")

    return key


def jam(description: Description) -> None:
    """The first law of each tendon takes more than the whole force: slack by friction."""
    for tendon in description["tendons"]:
        for effect in [*tendon.get("edge_friction", []), *tendon.get("pulley_friction", [])]:
            if effect is not None:
                for each in effect.get("laws", [effect]):
                    for side in (each["positive"], each["negative"]) if "positive" in each else (each,):
                        side["static"], side["coulomb"] = side["static"] + 1.1, side["coulomb"] + 1.1
                break


def random_fit_case(seed: int, samples: int) -> tuple[Description, Recording, int]:
    """A random finger, at times with jammed tendons; its recording and kinematics source."""
    description, recording = random_case(seed, samples)
    description = copy.deepcopy(description)
    if seed % 8 == 3:
        jam(description)
    # without noise there is no likelihood
    rng = np.random.default_rng([seed, 10])
    noise = {"drift_variance": 10.0 ** rng.uniform(-6, -3), "noise_std": 10.0 ** rng.uniform(-3, -1.5)}
    description["bias"] = dict(description.get("bias") or {}) | noise
    return description, recording, 1 + seed % 3


def off_start(unknowns: Sequence[Any], seed: int) -> Array:
    """[U] the start, each number up to a fifth off, within its bounds."""
    rng = np.random.default_rng([seed, 6])
    start = np.array([each.start for each in unknowns])
    moved = start * rng.uniform(0.8, 1.2, len(start))
    return np.clip(moved, [each.lower for each in unknowns], [each.upper for each in unknowns])


# Settings of the bias that the filters of the estimation treat each in its own way.
BIASES: dict[str, Description] = {
    "as given": {},
    "initial_variance": {"initial_variance": 4e-3},
    "noise_per_force": {"noise_std_per_force": 4e-4},
    "noise_time": {"noise_time": 0.02},
    "known initial_torque": {"initial_torque": [0.02, -0.01], "initial_variance": 0.0},
    "initial_torque of default variance": {"initial_torque": [0.02, -0.01]},
    "no wandering": {"drift_variance": 0.0},
    "known start": {"initial_variance": 0.0},
    "forgets at once": {"forget_rate": 1e3},
    "never forgets": {"forget_rate": 0.0},
    "all": {"initial_torque": [0.01, 0.0], "noise_time": 0.01, "noise_std_per_force": 1e-4, "initial_variance": 1e-4},
}


def leave_out(seed: int, samples: int) -> Array:
    """[N] bool: a few stretches and single samples not used, at times the first ones."""
    rng = np.random.default_rng([seed, 11])
    use = rng.random(samples) > 0.05
    for start in rng.integers(0, samples, 3):
        use[start : start + int(rng.integers(1, 30))] = False
    if seed % 3 == 0:
        use[: 1 + seed % 7] = False
    return np.asarray(use)
