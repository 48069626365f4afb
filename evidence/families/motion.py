"""Motions of all families: sines of every joint, with rests, under a pretension that breathes."""

from __future__ import annotations

import dataclasses

import numpy as np

from evidence.families.finger import Array

STRETCH, STILL, RAMP = (4.0, 10.0), (0.4, 1.6), 0.3  # s of motion, of rest, and from one to the other


@dataclasses.dataclass(frozen=True)
class Motion:
    """Random sines of the joints, and a pretension."""

    amplitude: Array  # [n, sines] rad
    frequency: Array  # [n, sines] Hz
    phase: Array  # [n, sines]
    pretension: float  # N
    breathing: tuple[float, float]  # share of the pretension, Hz
    rests: int  # seed of when the finger stands still

    def angles(self, time: Array) -> Array:
        """[N, n] rad that are aimed at; uneven times."""
        turn = 2 * np.pi * self.frequency * own_time(time, self.rests)[:, None, None] + self.phase
        return np.asarray((self.amplitude * np.sin(turn)).sum(axis=2))

    def pull(self, time: Array) -> Array:
        """[N] N, the pretension."""
        share, frequency = self.breathing
        return np.asarray(self.pretension * (1 + share * np.sin(2 * np.pi * frequency * time)))


def random_motion(joints: int, pretension: float, rng: np.random.Generator) -> Motion:
    """Four sines a joint of 0.08 to 0.6 Hz, 0.36 rad rms; the pretension varies by 30 %."""
    frequency = rng.uniform(0.08, 0.6, (joints, 4))
    amplitude = rng.uniform(0.6, 1.4, (joints, 4)) / np.sqrt(frequency)
    amplitude *= 0.36 / np.sqrt((amplitude**2 / 2).sum(axis=1, keepdims=True))
    phase = rng.uniform(0, 2 * np.pi, (joints, 4))
    breathing = (0.3, float(rng.uniform(0.04, 0.09)))
    return Motion(amplitude, frequency, phase, pretension, breathing, int(rng.integers(2**31)))


def own_time(time: Array, seed: int) -> Array:
    """[N] s of the motion at every time: it goes on during stretches and stands still between them."""
    rng = np.random.default_rng(seed)
    speed, at = np.ones_like(time), float(time[0])
    while at < time[-1]:
        at += rng.uniform(*STRETCH)
        until = at + rng.uniform(*STILL)
        speed = np.minimum(speed, np.clip(np.maximum(at - time, time - until) / RAMP, 0.0, 1.0))
    smooth = speed * speed * (3.0 - 2.0 * speed)
    return np.asarray(time[0] + np.cumsum(smooth) * (time[1] - time[0]))
