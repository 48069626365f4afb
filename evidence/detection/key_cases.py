"""Simulations for keys.py: one joint between two tendons whose friction is a share of their force.

Everything is known: its true friction (which may be more than the model's), load, sensor noise.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.signal import lfilter

from evidence import tables
from tendonfmu.arrays import Flags, Numbers
from tendonfmu.detect.counting import stretches
from tendonfmu.model import native

Keys = Mapping[str, Any]

RATE = 1000.0  # 1/s
STEP = 1.0 / RATE
ARM = 0.009  # m, of both tendons, against each other
SHARE = 0.03  # friction force over tendon force
V_MIN = 0.0005 / ARM  # rad/s, the default threshold of the tendon, at the joint
NOISE = 1e-3  # N·m in the joint torque, white: 0.08 N in each tendon
THRESHOLD = 8e-3  # N·m, 8 times the noise

ASLEEP = {"bias.drift_variance": 0.0, "bias.initial_variance": 0.0}  # the filter takes nothing up, as in contact


def finger(keys: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """Its description. keys: `bias.forget_rate` and the like, beyond the defaults."""
    law = {"static": SHARE, "coulomb": SHARE, "stribeck_velocity": 0.005}
    description: dict[str, Any] = {
        "format": "tendonfmu-finger-1",
        "name": "one_joint",
        "joints": [{"name": "joint"}],
        "tendons": [{"stiffness": 4000.0, "moment_arms": [arm], "edge_friction": [law]} for arm in (ARM, -ARM)],
        "velocity_threshold": {},
        # true friction here turns round as the finger moves off, and so nothing is forgotten at rest
        "bias": {"forget_rate": 0.0},
        "contact": {"threshold": [THRESHOLD]},
    }
    for key, value in (keys or {}).items():
        group, name = key.split(".")
        description[group][name] = value
    return description


def friction(pull: Numbers | float) -> Numbers:
    """N·m, that the model has for motion in the positive direction. pull: N, the sum of both tendon forces."""
    return np.asarray(ARM * SHARE * pull)


@dataclass(frozen=True)
class Take:
    """time s, angle rad, velocity rad/s, pull N (both forces together), torque N·m (of the tendons): [N] each."""

    time: Numbers
    angle: Numbers
    velocity: Numbers
    pull: Numbers
    torque: Numbers

    def run(self, keys: Mapping[str, Any] | None = None) -> dict[str, Any]:
        """The core's outputs [N], with measured angle and velocity (kinematics source 3)."""
        difference = self.torque / ARM
        force = 0.5 * np.column_stack([self.pull + difference, self.pull - difference])
        recording = {
            "time": self.time,
            "tendon_force": force,
            "joint_position": self.angle[:, None],
            "joint_velocity": self.velocity[:, None],
        }
        made = native.run_recording(finger(keys), recording, 3)
        return {name: value[:, 0] if value.ndim == 2 else value for name, value in made.items() if name != "slack"}


def times(duration: float) -> Numbers:
    return np.asarray(np.arange(round(duration * RATE)) * STEP)


def noise(random: np.random.Generator, count: int, time: float = 0.0) -> Numbers:
    """Of unit standard deviation; time: s, of its correlation (first order), 0 is white."""
    white = random.standard_normal(count)
    if not time:
        return white
    keep = np.exp(-STEP / time)
    driven = np.sqrt(1.0 - keep**2) * white
    driven[0] = white[0]
    return np.asarray(lfilter([1.0], [1.0, -keep], driven))


def strokes(random: np.random.Generator, duration: float) -> tuple[Numbers, Numbers]:
    """Angle and velocity [N] of minimum-jerk strokes of 0.5 to 1.5 s between random angles, rests of 0.2 to 2 s."""
    time = times(duration)
    angle, velocity = np.zeros(len(time)), np.zeros(len(time))
    now, here = 0.0, 0.0
    while now < duration:
        there, stroke = random.uniform(-0.5, 0.5), random.uniform(0.5, 1.5)
        s = np.clip((time - now) / stroke, 0.0, 1.0)
        later = time >= now
        angle[later] = (here + (there - here) * (10 * s**3 - 15 * s**4 + 6 * s**5))[later]
        velocity[later] = ((there - here) / stroke * 30 * (s**2 - 2 * s**3 + s**4))[later]
        now, here = now + stroke + random.uniform(0.2, 2.0), there
    return angle, velocity


def direction(velocity: Numbers) -> Numbers:
    """Side of true friction [N], -1 or 1: that of the last motion above V_MIN, of the first one before it."""
    index = np.where(np.abs(velocity) > V_MIN, np.arange(len(velocity)), -1)
    last = np.maximum.accumulate(index)
    moving = index[index >= 0]
    first = moving[0] if len(moving) else 0
    return np.where(velocity[np.where(last < 0, first, last)] < 0, -1.0, 1.0)


def resting(torque: Numbers, pull: float) -> Take:
    """A finger at rest with this joint torque."""
    still = np.zeros(len(torque))
    return Take(times(len(torque) * STEP), still, still, np.full(len(torque), pull), torque)


def alarms(contact: Flags) -> list[list[int]]:
    """First and last sample of each alarm, as `tendonfmu score` counts them."""
    spans: list[list[int]] = stretches(times(len(contact) * STEP), contact).tolist()
    return spans


def longest(contact: Flags) -> float:
    """s, of the longest alarm."""
    return max((last - first + 1 for first, last in alarms(contact)), default=0) * STEP


# --- alarms that do not end, and pushes that are lost -----------------------------------------------------------------

BEFORE = 10.0  # s, until what goes wrong
WRONG = 1.5  # true friction over the model's
LOW, HIGH = 20.0, 120.0  # N, both tendon forces together


def wrong_friction(seed: int, duration: float = 60.0) -> Take:
    """Friction 50 % larger than modelled; at the fastest moment of the 4 s after BEFORE the tendons stiffen from 20 to
    120 N within 0.1 s.
    """
    random = np.random.default_rng([seed, 1])
    time = times(duration)
    angle, velocity = strokes(random, duration)
    soon = np.where((time >= BEFORE) & (time < BEFORE + 4.0), np.abs(velocity), 0.0)
    pull = LOW + (HIGH - LOW) * np.clip((time - time[np.argmax(soon)]) / 0.1, 0.0, 1.0)
    torque = WRONG * friction(pull) * direction(velocity) + NOISE * noise(random, len(time))
    return Take(time, angle, velocity, pull, torque)


def sensor_step(seed: int, duration: float = 60.0) -> Take:
    """Friction as modelled; after 10 s the torque steps by twice the threshold and stays there."""
    return _pushed(seed, duration, 2.0 * THRESHOLD, duration)


def held_push(seed: int) -> Take:
    """After 10 s a push of 3 thresholds for 10 s, then 10 s without."""
    return _pushed(seed, BEFORE + 20.0, 3.0 * THRESHOLD, 10.0)


def _pushed(seed: int, duration: float, push: float, held: float) -> Take:
    random = np.random.default_rng([seed, 2])
    time = times(duration)
    angle, velocity = strokes(random, duration)
    pull = np.full(len(time), 0.5 * (LOW + HIGH))
    torque = friction(pull) * direction(velocity) + NOISE * noise(random, len(time))
    torque += push * ((time >= BEFORE) & (time < BEFORE + held))
    return Take(time, angle, velocity, pull, torque)


def stuck(contact: Flags) -> tuple[float, float]:
    """Longest alarm (s) and share of time in alarm, after what went wrong."""
    after = contact[round(BEFORE * RATE) :]
    return longest(after), float(after.mean())


def lost(contact: Flags) -> tuple[float, float]:
    """Of a held push: when its alarm ends (s from the onset), and for how long there is an alarm after its end (s)."""
    first, end = round(BEFORE * RATE), round((BEFORE + 10.0) * RATE)
    ends = [last + 1 for begun, last in alarms(contact) if begun < first + 100 and last >= first]
    return (min(ends[0], end) - first) * STEP if ends else 0.0, float(contact[end:].sum() * STEP)


# --- a push just above the threshold, and thresholds just above the noise ---------------------------------------------


def weak_push(seed: int, correlated: float) -> Take:
    """A push of 1.2 thresholds from 5 s to the end. The threshold is 6 times the noise; correlated: s, 0 is white."""
    time = times(10.0)
    disturbed = noise(np.random.default_rng([seed, 3]), len(time), correlated)
    return resting(THRESHOLD / 6.0 * disturbed + 1.2 * THRESHOLD * (time >= 5.0), LOW)


def free_noise(seed: int, correlated: float) -> Take:
    """Nothing touches; the threshold is only 3 times the noise."""
    return resting(THRESHOLD / 3.0 * noise(np.random.default_rng([seed, 4]), len(times(60.0)), correlated), LOW)


# --- a reversal, and a velocity that is not clean ---------------------------------------------------------------------

PULL = 60.0  # N, both tendon forces together: friction of 16 mN·m
SILENT: Keys = {"contact.threshold": [1e6]}  # N·m: nothing is contact

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


# --- co-contraction noise ---------------------------------------------------------------------------------------------


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
    return tables.rms(take.run({**SILENT, "bias.forget_rate": 5.0, **keys})["residual"][round(RATE) :])


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
    return Take(time, np.cumsum(velocity) * STEP, velocity, pull, torque), np.arange(1.0, count) * (moved + rested)


# --- a load just after the start, and a wrong start -------------------------------------------------------------------


def absorbed(seed: int, size: float, keys: Keys) -> float:
    """Share of a load that the bias has taken up at 0.1 s, the same noise without the load taken off."""
    # 5 ms after the start the load of `size` thresholds comes within 10 ms and stays
    time = times(0.5)
    disturbed = NOISE * noise(np.random.default_rng([seed, 7]), len(time))
    load = size * THRESHOLD * np.clip((time - 0.005) / 0.01, 0.0, 1.0)
    loaded, free = (resting(torque, PULL).run(keys)["bias_torque"][100] for torque in (disturbed + load, disturbed))
    return float((loaded - free) / (size * THRESHOLD))


def wrong_start(seed: int) -> Take:
    """Nothing touches; the first sample is off by half a threshold (a spike, a motor just switched on)."""
    time = times(3.0)
    disturbed = NOISE * noise(np.random.default_rng([seed, 8]), len(time))
    return resting(disturbed + 0.5 * THRESHOLD * (time < 0.5 * STEP), PULL)


def half_life(take: Take, keys: Keys) -> float:
    """s until the bias has lost half of a wrong start."""
    bias = np.abs(take.run(keys)["bias_torque"])
    return float(np.argmax(bias < 0.25 * THRESHOLD) * STEP)


# --- what is left of the friction before a rest -----------------------------------------------------------------------

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
    velocity, held = [np.full(moved, 0.3 * sides[0])], [np.full(moved, sides[0])]
    exits: list[int] = []
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
    return tables.rms(residual[chosen])
