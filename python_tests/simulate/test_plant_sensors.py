"""Every number of the simulated finger's sensors changes the measured signals as its equation says."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from oracle_plant_parts import sense
from plant_rigs import calm, grid, needs_plant, run, small_rig
from plant_rigs import strokes as legs_of

Array = NDArray[Any]
pytestmark = needs_plant

MEASURED = ("tendon_force", "tendon_position", "joint_position", "joint_velocity", "external_torque")
LEGS = [[0.2, 0.5], [0.2, -0.6], [0.1, 0.3]]


def sensed(step: float = 1e-3, **sensors: Any) -> tuple[Array, dict[str, Array]]:
    """A stroke with a push, seen by the sensors, one row per sample of 1 kHz unless step says otherwise."""
    push = {"start": 0.3, "rise": 0.1, "hold": 0.3, "fall": 0.1, "force": 1.0, "direction": [0.0, 0.0, 1.0]}
    rig = calm(small_rig(motion=legs_of(LEGS, [0.0]), pushes=[push], sensors=sensors, seed=3))
    time = grid(0.8, step)
    return time, run(rig, time)


def test_perfect_sensors() -> None:
    _, found = sensed()
    for name in MEASURED:
        np.testing.assert_allclose(found[f"measured_{name}"], found[name], rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize("name", MEASURED)
def test_sensor_gain_and_offset(name: str) -> None:
    """A number for all channels, or a list of one each."""
    many = [1.1, 0.9] if name.startswith("tendon") else [1.1]
    shift = [0.01, -0.02] if name.startswith("tendon") else [0.01]
    for gain, offset in ((1.05, 0.003), (many, shift)):
        _, found = sensed(**{name: {"gain": gain, "offset": offset}})
        expected = np.array(gain) * found[name] + np.array(offset)
        np.testing.assert_allclose(found[f"measured_{name}"], expected, rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize("name", MEASURED)
def test_sensor_noise(name: str) -> None:
    """Gaussian and independent from sample to sample, with the standard deviation asked for."""
    _, found = sensed(**{name: {"noise": 0.02}})
    error = (found[f"measured_{name}"] - found[name]).ravel(order="F")
    count = len(error)
    assert error.std() == pytest.approx(0.02, rel=5.0 / np.sqrt(2.0 * count))
    assert abs(error.mean()) < 5.0 * 0.02 / np.sqrt(count)
    assert abs(np.corrcoef(error[1:], error[:-1])[0, 1]) < 5.0 / np.sqrt(count)
    kurtosis = np.mean((error / error.std()) ** 4)
    assert abs(kurtosis - 3.0) < 5.0 * np.sqrt(24.0 / count)


@pytest.mark.parametrize("name", MEASURED)
def test_sensor_resolution(name: str) -> None:
    resolution = {"tendon_force": 0.05, "tendon_position": 1e-5, "external_torque": 1e-3}.get(name, 2e-3)
    _, found = sensed(**{name: {"resolution": resolution}})
    counts = found[f"measured_{name}"] / resolution
    np.testing.assert_allclose(counts, np.round(counts), atol=1e-6)
    error = np.abs(found[f"measured_{name}"] - found[name])
    assert error.max() <= 0.5 * resolution * (1.0 + 1e-9) and error.max() > 0.2 * resolution


@pytest.mark.parametrize("name", MEASURED)
@pytest.mark.parametrize("delay", [0.007, 0.0125])
def test_sensor_delay(name: str, delay: float) -> None:
    """The true signal of `delay` earlier, also where that is no whole number of samples."""
    time, found = sensed(**{name: {"delay": delay}})
    late = time > delay + 0.002
    for column in range(found[name].shape[1]):
        truth = found[name][:, column]
        expected = np.interp(time - delay, time, truth)
        # between samples the truth is taken as linear: its bend within a sample is the error allowed
        bend = np.abs(np.diff(truth, 2)).max()
        np.testing.assert_allclose(found[f"measured_{name}"][late, column], expected[late], atol=0.3 * bend + 1e-12)


def test_sensor_backlash() -> None:
    """Play of the given width between tendon and motor: the sensor stays while the motor crosses it."""
    play = 5e-4
    _, found = sensed(tendon_position={"backlash": play})
    for column in (0, 1):
        truth, seen = found["tendon_position"][:, column], found["measured_tendon_position"][:, column]
        lag = truth - seen
        assert lag.max() - lag.min() == pytest.approx(play, rel=1e-6)
        held = np.diff(seen) == 0.0
        assert held.sum() > 50  # at the reversals
        moving = ~held & (np.abs(np.diff(truth)) > 1e-9)
        np.testing.assert_allclose(np.diff(lag)[moving & np.roll(moving, 1)], 0.0, atol=1e-6)


def test_sensor_chain() -> None:
    """All of it together, in the order play, delay, gain, offset, resolution."""
    sensor = {"backlash": 2e-4, "delay": 0.0062, "gain": [1.1, 0.95], "offset": [1e-3, -2e-3], "resolution": 7e-6}
    time, found = sensed(tendon_position=sensor)
    for column in (0, 1):
        expected = sense(time, found["tendon_position"][:, column], time, sensor, column)
        np.testing.assert_allclose(found["measured_tendon_position"][:, column], expected, atol=1e-12)


def test_sensor_seed() -> None:
    """One seed, one series; another seed, sensor or channel, another series."""
    noise = {name: {"noise": 0.02} for name in MEASURED}
    push = {"start": 0.3, "rise": 0.1, "hold": 0.3, "fall": 0.1, "force": 1.0, "direction": [0.0, 0.0, 1.0]}
    rig = calm(small_rig(motion=legs_of(LEGS, [0.0]), pushes=[push], sensors=noise))
    time = grid(0.8, 1e-3)
    first, again, other = run(rig, time, seed=5), run(rig, time, seed=5), run(rig, time, seed=6)
    errors = []
    for name in MEASURED:
        assert np.array_equal(first[f"measured_{name}"], again[f"measured_{name}"])
        errors += [first[f"measured_{name}"] - first[name], other[f"measured_{name}"] - other[name]]
    together = np.corrcoef(np.hstack(errors).T)
    assert np.abs(together - np.eye(len(together))).max() < 5.0 / np.sqrt(len(time))


def test_sensor_rate() -> None:
    """New samples every 1/rate, held between."""
    time, found = sensed(step=1e-3, rate=100)
    every = 10
    for name in MEASURED:
        held = found[f"measured_{name}"]
        samples = held[: every * (len(held) // every)].reshape(-1, every, held.shape[1])
        assert np.all(samples == samples[:, :1])
        np.testing.assert_allclose(samples[:, 0], found[name][: len(samples) * every : every], rtol=1e-12, atol=1e-15)
    assert len(np.unique(found["measured_joint_position"])) > 60 and len(time) == 801
