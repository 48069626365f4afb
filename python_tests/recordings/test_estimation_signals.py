"""Signals smoothed without lag: what they keep, what they drop, and where they may not reach."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tendonfmu.recordings.recording import Recording
from tendonfmu.recordings.smoothing import FEWEST, HIGHEST, LOWEST, OF_RATE, Signals, smoothing_of

Numbers = NDArray[np.float64]
RATE = 1000.0
DATA: dict[str, Any] = {"tendons": [{"moment_arms": [arm], "stiffness": 1e4} for arm in (0.01, -0.01)]}


def recording(seconds: float = 20.0, noise: float = 0.0, rate: float = RATE) -> Recording:
    """Forces and positions that follow one motion of 0.3 to 2 Hz at the same time."""
    time = np.arange(round(seconds * rate)) / rate
    wave = np.sin(2 * np.pi * 0.3 * time) + 0.5 * np.sin(2 * np.pi * 2.0 * time)
    rng = np.random.default_rng(1)
    force = 10.0 + 3.0 * np.column_stack([wave, -wave]) + noise * rng.standard_normal((len(time), 2))
    position = 0.002 * np.column_stack([wave, -wave])
    return Recording(Path("made"), time, {"tendon_force": force, "tendon_position": position})


def late_by(one: Numbers, other: Numbers, rate: float) -> float:
    """s by which `other` is later than `one`, by the phase of their cross-spectrum at 2 Hz."""
    frequency = np.fft.rfftfreq(len(one), 1.0 / rate)
    at = int(np.argmin(np.abs(frequency - 2.0)))
    window = np.hanning(len(one))
    spectra = [np.fft.rfft((each - each.mean()) * window)[at] for each in (one, other)]
    return float(np.angle(spectra[0] * np.conj(spectra[1]))) / (2 * np.pi * frequency[at])


def test_smoothing_does_not_lag_and_keeps_the_motion() -> None:
    raw = recording(noise=0.05)
    found = Signals(20.0).recording(raw)
    for name in raw.groups:
        assert abs(late_by(raw.groups[name][:, 0], found.groups[name][:, 0], RATE)) < 1e-4
    clean = recording().groups["tendon_force"]
    before, after = (each.groups["tendon_force"] - clean for each in (raw, found))
    assert after.std() < 0.3 * before.std()
    ends = np.abs(after[np.r_[:200, -200:0]])
    assert ends.max() < 5.0 * after.std() + 0.05, "nothing swings in at the ends"


def test_smoothed_samples_are_fewer() -> None:
    raw = recording()
    found = Signals(20.0, 5).recording(raw)
    assert len(found) == len(raw) / 5 and np.allclose(np.diff(found.time), 5.0 / RATE)
    whole = Signals(20.0).recording(raw)
    assert np.array_equal(found.groups["tendon_force"], whole.groups["tendon_force"][::5])


def test_a_gap_is_not_smoothed_over() -> None:
    raw = recording(noise=0.05)
    time = raw.time + 3.0 * (np.arange(len(raw)) >= 7003)
    cut = replace(raw, time=time)
    spoilt = {name: values + 100.0 * (np.arange(len(raw)) >= 7003)[:, None] for name, values in raw.groups.items()}
    one, other = (Signals(20.0, 4).recording(each) for each in (cut, replace(cut, groups=spoilt)))
    first = int(np.flatnonzero(np.diff(one.time) > 1.0)[0]) + 1
    assert one.time[first] == time[7003], "samples are counted anew after a gap"
    assert np.array_equal(one.groups["tendon_force"][:first], other.groups["tendon_force"][:first])


def test_pieces_that_are_too_short_stay_raw() -> None:
    raw = recording(seconds=(FEWEST - 1) / RATE, noise=0.05)
    assert np.array_equal(Signals(20.0).recording(raw).groups["tendon_force"], raw.groups["tendon_force"])


def test_a_touch_is_not_lost_between_kept_samples() -> None:
    contact = np.zeros(20000, dtype=bool)
    contact[[1001, 1002, 5003]] = True
    found = Signals(20.0, 4).recording(replace(recording(), contact=contact))
    assert found.contact is not None
    assert np.flatnonzero(found.contact).tolist() == [250, 1250]


def test_raw_signals_are_the_recording() -> None:
    raw = recording()
    assert Signals().recording(raw) is raw
    assert Signals().description({"velocity_filter_cutoff": 30.0}) == {"velocity_filter_cutoff": 30.0}


def test_descriptions_for_estimating_and_back() -> None:
    given = {
        "name": "x",
        "velocity_filter_cutoff": 30.0,
        "bias": {"drift_variance": 1e-6, "noise_std": 0.004, "initial_torque": [0.0]},
    }
    kept = dict(given)
    estimating = Signals(20.0, 4).description(given)
    assert estimating["velocity_filter_cutoff"] == 0.0
    # as much is learned of the bias in a second as from all samples
    assert estimating["bias"]["noise_std"] == pytest.approx(0.002) and estimating["bias"]["drift_variance"] == 1e-6
    assert given == kept, "what was given is not changed"
    fitted = estimating | {"joints": [1], "bias": estimating["bias"] | {"initial_torque": [0.3]}}
    online = Signals(20.0, 4).restored(fitted, given)
    assert online == given | {"joints": [1], "bias": given["bias"] | {"initial_torque": [0.3]}}
    assert Signals(20.0, 4).restored(Signals(20.0, 4).description({"name": "x"}), {"name": "x"}) == {"name": "x"}


@pytest.mark.parametrize("noise", [0.003, 0.03, 0.3])
def test_the_cutoff_is_where_the_torque_meets_its_noise(noise: float) -> None:
    """A torque that falls with the square of the frequency."""
    rng = np.random.default_rng(2)
    time = np.arange(60000) / RATE
    power = 1.0 / (1.0 + (np.fft.rfftfreq(len(time), 1.0 / RATE) / 2.0) ** 2)
    wave = np.fft.irfft(np.fft.rfft(rng.standard_normal(len(time))) * power, len(time))
    wave = 3.0 * wave / wave.std()
    force = 10.0 + np.column_stack([wave, -wave]) + noise * rng.standard_normal((len(time), 2))
    found = smoothing_of([Recording(Path("made"), time, {"tendon_force": force})], DATA)
    assert found is not None and found.cutoff is not None
    assert LOWEST <= found.cutoff <= HIGHEST
    cutoffs = {0.003: (55.0, HIGHEST), 0.03: (25.0, 60.0), 0.3: (6.0, 20.0)}
    assert cutoffs[noise][0] <= found.cutoff <= cutoffs[noise][1]
    # ten samples a period, or five where that is 250 a second
    least = min(10.0 * found.cutoff, max(5.0 * found.cutoff, 250.0))
    assert RATE / found.every >= least > RATE / (found.every + 1)


def test_slow_or_short_recordings_are_not_smoothed() -> None:
    assert smoothing_of([recording(seconds=0.2)], DATA) is None
    assert smoothing_of([recording(seconds=60.0, rate=20.0)], DATA) is None
    found = smoothing_of([recording(seconds=20.0, rate=50.0)], DATA)
    assert found is not None and found.cutoff is not None
    assert found.cutoff == pytest.approx(OF_RATE * 50.0) and found.every == 1
