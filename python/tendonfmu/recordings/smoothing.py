"""Which signals friction is estimated from: smoothed without phase lag, so that no filter is mistaken for friction.

Noise of the measured forces becomes noise of the joint angles, often as large as the distance over which friction
builds up. A filter that runs online lags. Filtering forwards and backwards (Gustafsson, 1996) removes both. The
estimated models run on raw samples, with the velocity filter of their description.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, sosfiltfilt, welch

from tendonfmu.arrays import Numbers
from tendonfmu.model import moment_arms, number_of
from tendonfmu.recordings.faults import gaps
from tendonfmu.recordings.recording import Recording

ORDER = 2  # of the Butterworth filter, run both ways
OF_CROSSING = 0.6  # of the frequency at which the torque's spectrum falls to its noise; the cut-off
LOWEST, HIGHEST = 5.0, 60.0  # Hz
OF_RATE = 0.2  # of the sample rate, at most
NOISE_BAND = 0.7  # of half the sample rate; above it the spectrum is assumed to be noise
ABOVE_NOISE = 3.0  # times the noise's spectrum; below it the torque is noise
SAMPLES_PER_PERIOD = 10.0  # of the cut-off, that a smoothed recording keeps,
FAST = (5.0, 250.0)  # or, if fewer, the larger of this many per period of the cut-off and per second
SLOW = 125.0  # samples a second that even a long recording keeps
FEWEST = 64  # samples of a piece that can be smoothed


@dataclass(frozen=True)
class Signals:
    """Which signals are estimated from."""

    cutoff: float | None = None  # cut-off of the smoothing (Hz)
    every: int = 1  # one of this many samples is kept

    @property
    def words(self) -> str:
        """The signals in words, for a report."""
        return "raw signals" if self.cutoff is None else f"signals smoothed at {self.cutoff:.3g} Hz, without delay"

    def recording(self, recording: Recording) -> Recording:
        """Return the recording from which is estimated."""
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
        smoothed = np.array(values, dtype=np.float64)
        for begin, end in pairwise([0, *gaps(time), len(time)]):
            if end - begin >= FEWEST:
                rate = 1.0 / float(np.median(np.diff(time[begin:end])))
                smoothed[begin:end] = zero_phase(smoothed[begin:end], self.cutoff or 0.0, rate)
        return smoothed

    def description(self, data: Mapping[str, Any]) -> dict[str, Any]:
        """Return the description for estimating."""
        if self.cutoff is None:
            return dict(data)
        bias = dict(data.get("bias") or {})
        if bias.get("noise_time") is None:
            for key in ("noise_std", "noise_std_per_force"):
                bias[key] = number_of(data, f"bias.{key}") / np.sqrt(self.every)
        return {**data, "velocity_filter_cutoff": 0.0, "bias": bias}

    def restored(self, data: Mapping[str, Any], given: Mapping[str, Any]) -> dict[str, Any]:
        """Return an estimated description with the filter and bias settings of the given one, as it runs online."""
        restored = dict(data)
        for key in ("velocity_filter_cutoff", "bias"):
            restored.pop(key, None)
            if key in given:
                restored[key] = given[key]
        start = (data.get("bias") or {}).get("initial_torque")
        if start is not None:
            restored["bias"] = {**(restored.get("bias") or {}), "initial_torque": start}
        return restored


def smoothing_of(recordings: Sequence[Recording], data: Mapping[str, Any], most: float = np.inf) -> Signals | None:
    """Choose the smoothing of recordings; of more than `most` samples fewer are kept, SLOW a second at least."""
    duration = sum(float(recording.time[-1] - recording.time[0]) for recording in recordings)
    fewest = float(np.clip(most / max(duration, 1e-300), SLOW, FAST[1]))
    arms = moment_arms(data)
    crossings, rates = [], []
    for recording in recordings:
        for begin, end in pairwise([0, *gaps(recording.time), len(recording.time)]):
            if end - begin >= 4 * FEWEST:
                rate = 1.0 / float(np.median(np.diff(recording.time[begin:end])))
                crossings.append(_crossing(recording.groups["tendon_force"][begin:end] @ arms, rate))
                rates.append(rate)
    if not crossings:
        return None
    rate = min(rates)
    if OF_RATE * rate < LOWEST:
        return None
    cutoff = float(np.clip(OF_CROSSING * np.median(crossings), LOWEST, min(HIGHEST, OF_RATE * rate)))
    return Signals(cutoff, max(1, int(rate / min(SAMPLES_PER_PERIOD * cutoff, max(FAST[0] * cutoff, fewest)))))


def _crossing(torque: Numbers, rate: float) -> float:
    """Return the first frequency (Hz, median over joints) at which the spectrum is near that of the noise."""
    frequency, power = welch(torque, fs=rate, nperseg=min(1024, len(torque)), axis=0, detrend="linear")
    noise = np.median(power[frequency > NOISE_BAND * rate / 2], axis=0)
    below = power < ABOVE_NOISE * np.maximum(noise, 1e-30)
    first = np.where(below.any(axis=0), below.argmax(axis=0), len(frequency) - 1)
    return float(np.median(frequency[first]))


def zero_phase(values: Numbers, cutoff: float, rate: float) -> Numbers:
    """Low-pass signals forwards and backwards."""
    # values: [N, ...]; cutoff, rate: (Hz); returns [N, ...], without phase lag
    sections = butter(ORDER, min(cutoff, 0.45 * rate), fs=rate, output="sos")
    return np.asarray(sosfiltfilt(sections, values, axis=0, padlen=min(len(values) - 1, int(3 * rate / cutoff))))


def _kept(time: Numbers, every: int) -> NDArray[np.intp]:
    """Return the indices of one of every so many samples, counted anew after each gap."""
    parts = pairwise([0, *gaps(time), len(time)])
    return np.concatenate([np.arange(begin, end, every) for begin, end in parts])


def _any_around(flags: NDArray[np.bool_], every: int) -> NDArray[np.bool_]:
    """Return whether [N] any of the samples that a kept sample stands for is set."""
    around = flags.copy()
    for shift in range(1, every):
        around[:-shift] |= flags[shift:]
    return np.asarray(around)
