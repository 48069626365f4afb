"""Simulations of bench/latch_up.py about jumps of the modelled friction and what they leave in the bias."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from typing import Any

import numpy as np

from latch_up_finger import (
    ASLEEP,
    NOISE,
    RATE,
    STEP,
    THRESHOLD,
    V_MIN,
    Numbers,
    Take,
    direction,
    friction,
    noise,
    times,
)

Keys = Mapping[str, Any]
PULL = 60.0  # N, both tendon forces together: friction of 16 mN·m
SILENT: Keys = {"contact.threshold": [1e6]}  # N·m: nothing is contact

# --- a reversal, and a velocity that is not clean ------------------------------------------------------------------

SLOWING = 1.0  # rad/s²
TURNING = 0.5  # s, when the finger reverses


def reversal(seed: int, blip: tuple[float, float, float, float] | None = None) -> Take:
    """The finger slows down, reverses after 0.5 s and speeds up; its velocity is measured with error.

    blip: (from, to, least, most): for 5 ms, beginning `from` to `to` s before the reversal, it reads `least` to `most`
    times v_min the other way. Without: noise all along, a third of v_min, as of a derivative behind a filter of 20 Hz.
    """
    random = np.random.default_rng([seed, 5])
    time = times(2.0 * TURNING)
    velocity = SLOWING * (TURNING - time)
    torque = friction(np.full(len(time), PULL)) * direction(velocity)
    if blip:
        start = round((TURNING - random.uniform(blip[0], blip[1])) * RATE)
        velocity[start : start + 5] = -random.uniform(blip[2], blip[3]) * V_MIN
    else:
        velocity += V_MIN / 3.0 * noise(random, len(time), 1.0 / (2.0 * np.pi * 20.0))
    return Take(time, np.cumsum(velocity) * STEP, velocity, np.full(len(time), PULL), torque)


def turn(take: Take, keys: Keys) -> tuple[float, float]:
    """Largest jump of T_eff before the reversal, in F; delay of its last turn, s."""
    total = take.run({**ASLEEP, **SILENT, **keys})["friction_torque"] / friction(PULL)
    early = float(np.abs(total[: round(TURNING * RATE)] - total[0]).max())
    turns = np.flatnonzero(np.diff(total < 0.0))
    return early, float((turns[-1] + 1) * STEP - TURNING) if len(turns) else np.nan


# --- co-contraction noise ------------------------------------------------------------------------------------------


def flicker(seed: int, push: float, duration: float = 100.0) -> Take:
    """The velocity flickers about v_min (by half of it, within 50 ms) while both tendons pull 10 % more and less.

    push: N·m, from 10 ms on. The finger begins in motion, as its friction is known then.
    """
    random = np.random.default_rng([seed, 6])
    time = times(duration)
    velocity = V_MIN * (1.0 + 0.5 * noise(random, len(time), 0.05))
    velocity[:50] = 1.5 * V_MIN
    pull = PULL * (1.0 + 0.1 * noise(random, len(time), 0.05))
    torque = friction(pull) + NOISE * noise(random, len(time)) + push * (time >= 0.01)
    return Take(time, np.cumsum(velocity) * STEP, velocity, pull, torque)


def pumped(take: Take, keys: Keys) -> float:
    """N·m, what the bias gained from 50 ms until the last moment of motion, without sign: nothing, if all went well."""
    bias = take.run({"bias.forget_rate": 5.0, **keys})["bias_torque"]
    return float(abs(bias[np.flatnonzero(np.abs(take.velocity) > V_MIN)[-1]] - bias[50 - 1]))


def residual_rms(take: Take, keys: Keys) -> float:
    """N·m, with nothing taken for contact, after the first second."""
    residual = take.run({**SILENT, "bias.forget_rate": 5.0, **keys})["residual"][round(RATE) :]
    return float(np.sqrt(np.mean(residual**2)))


def stiffened(seed: int, follows: bool, rest: float = 0.2, count: int = 20) -> tuple[Take, Numbers]:
    """Strokes of 0.5 s, always the same way; in the middle of the rests between the pull changes between 20 and 60 N.

    follows: the torque of friction at rest does so at once, and the bias filter sees it; else as the finger moves off.
    """
    random = np.random.default_rng([seed, 10])
    moved, rested = round(0.5 * RATE), round(rest * RATE)
    stroke = np.arange(count * (moved + rested)) // (moved + rested)
    phase = np.arange(len(stroke)) % (moved + rested) - moved  # from 0 on: at rest
    later = (stroke + (phase >= rested // 2)) % 2
    pull = np.where(later, PULL, 20.0)
    held = pull if follows else np.where(phase >= 0, np.where(stroke % 2, PULL, 20.0), pull)
    velocity, time = np.where(phase >= 0, 0.0, 0.3), times(len(stroke) * STEP)
    torque = friction(held) + NOISE * random.standard_normal(len(time))
    return Take(time, np.cumsum(velocity) * STEP, velocity, pull, torque), np.arange(1, count) * (moved + rested)


# --- a load just after the start, and a wrong start ----------------------------------------------------------------


def load_at_start(seed: int, size: float) -> Take:
    """At rest; 5 ms after the start a load of `size` thresholds comes within 10 ms and stays."""
    random = np.random.default_rng([seed, 7])
    time = times(0.5)
    still = np.zeros(len(time))
    torque = NOISE * noise(random, len(time)) + size * THRESHOLD * np.clip((time - 0.005) / 0.01, 0.0, 1.0)
    return Take(time, still, still, np.full(len(time), PULL), torque)


def absorbed(seed: int, size: float, keys: Keys, at: float = 0.1) -> float:
    """Share of the load that the bias has taken up `at` s, the same noise without the load taken off."""
    bias = [load_at_start(seed, load).run(keys)["bias_torque"][round(at * RATE)] for load in (size, 0.0)]
    return float((bias[0] - bias[1]) / (size * THRESHOLD))


def wrong_start(seed: int) -> Take:
    """At rest, nothing touches; the first sample is off by half a threshold (a spike, a motor just switched on)."""
    random = np.random.default_rng([seed, 8])
    time = times(3.0)
    still = np.zeros(len(time))
    torque = NOISE * noise(random, len(time)) + 0.5 * THRESHOLD * (time < 0.5 * STEP)
    return Take(time, still, still, np.full(len(time), PULL), torque)


def half_life(take: Take, keys: Keys) -> float:
    """s until the bias has lost half of a wrong start."""
    bias = np.abs(take.run(keys)["bias_torque"])
    return float(np.argmax(bias < 0.25 * THRESHOLD) * STEP)


# --- what is left of the friction before a rest --------------------------------------------------------------------

RESTS = (0.05, 0.2, 1.0, 5.0)  # s
DRIFTS = (1e-8, 1e-6, 1e-4)  # (N·m)²/s: with noise_std 0.01 at 1 kHz the filter takes up 0.3, 3, 32 per second
WINDOW = 0.2  # s after a rest


def rests(seed: int, rest: float, drift: float, absorbable: bool, count: int = 12) -> tuple[Take, Numbers]:
    """Strokes of 0.5 s either way, rests between; and the first samples after the rests.

    True bias: a random walk of variance `drift` per s. A finger that goes on the other way needs the friction of that
    way. absorbable: the drive has put it on at some moment of the rest (any is as likely), so that a bias filter may
    have taken it up; else as the finger moves off.
    """
    random = np.random.default_rng([seed, 9, round(1e3 * rest), absorbable])
    moved, rested = round(0.5 * RATE), round(rest * RATE)
    sides = random.choice([-1.0, 1.0], count + 1)
    velocity, held, exits = [np.full(moved, 0.3 * sides[0])], [np.full(moved, sides[0])], []
    for before, side in pairwise(sides):
        at = random.integers(0, rested) if absorbable else rested
        velocity += [np.zeros(rested), np.full(moved, 0.3 * side)]
        held += [np.where(np.arange(rested) < at, before, side), np.full(moved, side)]
        exits.append(moved + len(exits) * (moved + rested) + rested)
    speed, time = np.concatenate(velocity), times(moved * STEP + count * (moved + rested) * STEP)
    bias = np.cumsum(np.sqrt(drift * STEP) * random.standard_normal(len(time)))
    torque = friction(PULL) * np.concatenate(held) + bias + NOISE * random.standard_normal(len(time))
    return Take(time, np.cumsum(speed) * STEP, speed, np.full(len(time), PULL), torque), np.array(exits)


def after_rests(made: tuple[Take, Numbers], keys: Keys) -> float:
    """N·m, rms of the residual in the WINDOW after the rests."""
    take, exits = made
    residual = take.run({**SILENT, **keys})["residual"]
    chosen = (exits[:, None] + np.arange(round(WINDOW * RATE))).astype(int)
    return float(np.sqrt(np.mean(residual[chosen] ** 2)))
