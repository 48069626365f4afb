"""The simulated finger's right-hand side against the numpy twin."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from oracle_plant import PlantTwin
from plant_rigs import needs_plant
from random_plants import random_plant, random_state
from repetitions import repeated
from tendonfmu.simulate.plant import Plant

Array = NDArray[Any]

SEEDS = range(60)
STATES = 4
TOLERANCE = 1e-9  # of the block's largest value


def blocks(twin: PlantTwin) -> dict[str, slice]:
    sizes = {"q": twin.n, "v": twin.n, "x": twin.m, "x_rate": twin.m, "bristles": len(twin.places)}
    sizes |= {"heat": 1, "motor work": 1, "friction work": 1, "damping work": 1, "push work": 1}
    found, start = {}, 0
    for name, size in sizes.items():
        found[name] = slice(start, start + size)
        start += size
    return found


def scales(twin: PlantTwin, t: float, y: Array, expected: Array) -> dict[str, float]:
    """What rounding is relative to: a block's largest value, or the terms that cancel in it."""
    found = {name: float(np.abs(expected[part]).max(initial=0.0)) for name, part in blocks(twin).items()}
    parts = twin.parts(t, y)
    torque = np.abs(parts["arms"]).T @ parts["tension"] + np.abs(parts["stop"]) + np.abs(parts["cover"])
    found["v"] = max(found["v"], float((np.abs(np.linalg.inv(parts["mass"])) @ torque).max()))
    tension, slid = parts["tension"], np.abs(parts["slid"][:, 0])
    found["friction work"] = max(found["friction work"], float(tension @ slid))
    stretch = slid + np.abs(twin.split(y)["x_rate"])
    found["damping work"] = max(found["damping work"], float(tension @ stretch))
    found["heat"] = max(found["heat"], found["friction work"])
    found["x_rate"] = max(found["x_rate"], twin.servo_rate**2 * float(np.abs(twin.split(y)["x"]).max()))
    return found


@needs_plant
@pytest.mark.parametrize("seed", repeated(SEEDS, *range(0, len(SEEDS), 12)))
def test_derivative_agrees_with_twin(seed: int) -> None:
    rig = random_plant(seed)
    twin, plant = PlantTwin(rig), Plant(json.dumps(rig))
    assert plant.order == twin.order
    rng = np.random.default_rng([seed, 5])
    for _ in range(STATES):
        t, y = rng.uniform(0.0, 4.0), random_state(rng, twin)
        expected, got = twin.derivative(t, y), plant.derivative(t, y)
        allowed = scales(twin, t, y, expected)
        for name, part in blocks(twin).items():
            difference = np.abs(got[part] - expected[part]).max(initial=0.0)
            assert difference <= TOLERANCE * allowed[name], (
                f"seed {seed}, {name}: expected {expected[part]}, got {got[part]}, {twin.places}"
            )
