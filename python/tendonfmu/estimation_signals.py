"""The signals that friction is estimated from: zero-phase smoothed, so that what is estimated is not the filter.

Noise of the measured forces is noise of the joint angles, often as large as the distance over which friction builds
up; a filter that runs online lags. Filtered forwards and backwards (Gustafsson, 1996) both go away. The models that
come of it run on raw samples, with the velocity filter that their description asks for.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, sosfiltfilt, welch

from tendonfmu.balance import moment_arms
from tendonfmu.description_numbers import number_of
from tendonfmu.recording import Recording
from tendonfmu.recording_faults import gaps

Numbers = NDArray[np.float64]

ORDER = 2  # of the Butterworth filter, run both ways
OF_CROSSING = 0.6  # of the frequency at which the torque's spectrum meets its noise
LOWEST, HIGHEST = 5.0, 60.0  # Hz
OF_RATE = 0.2  # of the sample rate, at most
NOISE_BAND = 0.7  # of half the sample rate: above it the spectrum is taken for noise
ABOVE_NOISE = 3.0  # times the noise's spectrum
SAMPLES_PER_PERIOD = 10.0  # of the cutoff, that a smoothed recording keeps,
FAST = (5.0, 250.0)  # or as many samples of it and a second, where that is fewer
FEWEST = 64  # samples of a piece that can be smoothed


@dataclass(frozen=True)
class Signals:
    """cutoff: Hz of the smoothing, None: raw signals. every: of so many samples one is kept."""

    cutoff: float | None = None
    every: int = 1

    @property
    def words(self) -> str:
        return "raw signals" if self.cutoff is None else f"signals smoothed at {self.cutoff:.3g} Hz, without lag"

    def recording(self, recording: Recording) -> Recording:
        """The recording as it is estimated from."""
        if self.cutoff is None:
            return recording
        groups = {name: self._smoothed(recording.time, values) for name, values in recording.groups.items()}
        kept = _kept(recording.time, self.every)
        contact = None if recording.contact is None else _any_around(recording.contact, self.every)[kept]
        return replace(
            recording,
            time=recording.time[kept],
            groups={name: values[kept] for name, values in groups.items()},
            contact=contact,
        )

    def _smoothed(self, time: Numbers, values: Numbers) -> Numbers:
        found = np.array(values, dtype=np.float64)
        for begin, end in pairwise([0, *gaps(time), len(time)]):
            if end - begin >= FEWEST:
                rate = 1.0 / float(np.median(np.diff(time[begin:end])))
                found[begin:end] = zero_phase(found[begin:end], self.cutoff or 0.0, rate)
        return found

    def description(self, data: Mapping[str, Any]) -> dict[str, Any]:
        """The description for estimating: no velocity filter, whose lag would be estimated as friction, and a bias that
        wanders as fast in time as at the recording's own rate."""
        if self.cutoff is None:
            return dict(data)
        bias = dict(data.get("bias") or {})
        if bias.get("noise_time") is None:
            for key in ("noise_std", "noise_std_per_force"):
                bias[key] = number_of(data, f"bias.{key}") / np.sqrt(self.every)
        kept = {key: value for key, value in data.items() if key != "position_filter"}
        return {**kept, "velocity_filter_cutoff": 0.0, "bias": bias}

    def restored(self, data: Mapping[str, Any], given: Mapping[str, Any]) -> dict[str, Any]:
        """An estimated description with the settings of the given one, as it runs online."""
        found = dict(data)
        for key in ("velocity_filter_cutoff", "position_filter", "bias"):
            found.pop(key, None)
            if key in given:
                found[key] = given[key]
        start = (data.get("bias") or {}).get("initial_torque")
        if start is not None:
            found["bias"] = {**(found.get("bias") or {}), "initial_torque": start}
        return found


def smoothing_of(recordings: Sequence[Recording], data: Mapping[str, Any]) -> Signals | None:
    """Smoothing at a share of the frequency at which the joint torque's spectrum meets its noise, over all recordings;
    None where the recordings are too short for it."""
    arms = moment_arms(data)
    found, rates = [], []
    for recording in recordings:
        for begin, end in pairwise([0, *gaps(recording.time), len(recording.time)]):
            if end - begin >= 4 * FEWEST:
                rate = 1.0 / float(np.median(np.diff(recording.time[begin:end])))
                found.append(_crossing(recording.groups["tendon_force"][begin:end] @ arms, rate))
                rates.append(rate)
    if not found:
        return None
    rate = min(rates)
    if OF_RATE * rate < LOWEST:
        return None
    cutoff = float(np.clip(OF_CROSSING * np.median(found), LOWEST, min(HIGHEST, OF_RATE * rate)))
    return Signals(cutoff, max(1, int(rate / min(SAMPLES_PER_PERIOD * cutoff, max(FAST[0] * cutoff, FAST[1])))))


def _crossing(torque: Numbers, rate: float) -> float:
    """Hz, median over joints: the first frequency at which the spectrum is near that of the noise."""
    frequency, power = welch(torque, fs=rate, nperseg=min(1024, len(torque)), axis=0, detrend="linear")
    noise = np.median(power[frequency > NOISE_BAND * rate / 2], axis=0)
    below = power < ABOVE_NOISE * np.maximum(noise, 1e-30)
    first = np.where(below.any(axis=0), below.argmax(axis=0), len(frequency) - 1)
    return float(np.median(frequency[first]))


def zero_phase(values: Numbers, cutoff: float, rate: float) -> Numbers:
    """[N, ...] low-passed forwards and backwards. cutoff, rate: Hz."""
    sections = butter(ORDER, min(cutoff, 0.45 * rate), fs=rate, output="sos")
    return np.asarray(sosfiltfilt(sections, values, axis=0, padlen=min(len(values) - 1, int(3 * rate / cutoff))))


def _kept(time: Numbers, every: int) -> NDArray[np.intp]:
    """One of so many samples, counted anew after each gap."""
    parts = pairwise([0, *gaps(time), len(time)])
    return np.concatenate([np.arange(begin, end, every) for begin, end in parts])


def _any_around(flags: NDArray[np.bool_], every: int) -> NDArray[np.bool_]:
    """[N] whether any of the samples that one stands for is set."""
    found = flags.copy()
    for shift in range(1, every):
        found[:-shift] |= flags[shift:]
    return np.asarray(found)
