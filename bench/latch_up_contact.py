"""Simulations of bench/latch_up.py about alarms that do not end and pushes that are lost."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from latch_up_finger import (
    ASLEEP,
    NOISE,
    RATE,
    STEP,
    THRESHOLD,
    V_MIN,
    Flags,
    Numbers,
    Take,
    alarms,
    direction,
    friction,
    longest,
    noise,
    strokes,
    times,
)

Keys = Mapping[str, Any]
BEFORE = 10.0  # s, until what goes wrong
WRONG = 1.5  # true friction over the model's
LOW, HIGH = 20.0, 120.0  # N, both tendon forces together


# --- what starts a false alarm, and a push that is none ------------------------------------------------------------


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
    return _pushed(seed, duration, 2.0 * THRESHOLD, duration, moving=True)


def held_push(seed: int, moving: bool = True, wrong: float = 1.0) -> Take:
    """After 10 s a push of 3 thresholds for 10 s, then 10 s without. wrong: true friction over the model's."""
    return _pushed(seed, BEFORE + 20.0, 3.0 * THRESHOLD, 10.0, moving, wrong)


def _pushed(seed: int, duration: float, push: float, held: float, moving: bool, wrong: float = 1.0) -> Take:
    random = np.random.default_rng([seed, 2])
    time = times(duration)
    angle, velocity = strokes(random, duration)
    if not moving:
        angle, velocity = np.zeros(len(time)), np.zeros(len(time))
    pull = np.full(len(time), 0.5 * (LOW + HIGH))
    torque = wrong * friction(pull) * direction(velocity) + NOISE * noise(random, len(time))
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


# --- a push just above the threshold, and thresholds just above the noise ------------------------------------------


def weak_push(seed: int, over_noise: float = 6.0, correlated: float = 0.0) -> Take:
    """At rest; a push of 1.2 thresholds from 5 s to the end. The threshold is `over_noise` times the noise.

    correlated: s, 0 is white.
    """
    random = np.random.default_rng([seed, 3])
    time = times(10.0)
    still = np.zeros(len(time))
    torque = THRESHOLD / over_noise * noise(random, len(time), correlated) + 1.2 * THRESHOLD * (time >= 5.0)
    return Take(time, still, still, np.full(len(time), LOW), torque)


def share_of_first_second(contact: Flags) -> float:
    return float(contact[5000:6000].mean())


def free_noise(seed: int, over_noise: float = 3.0, correlated: float = 0.0, duration: float = 60.0) -> Take:
    """At rest, nothing touches; the threshold is only `over_noise` times the noise."""
    random = np.random.default_rng([seed, 4])
    time = times(duration)
    still = np.zeros(len(time))
    torque = THRESHOLD / over_noise * noise(random, len(time), correlated)
    return Take(time, still, still, np.full(len(time), LOW), torque)


# --- rules that have no key, tried outside the core ----------------------------------------------------------------

Rule = Callable[[Numbers, Numbers], Callable[[int, int, float], str]]
DRIFT, STANDARD = 1e-6, 0.01  # defaults of the bias filter


def follow(take: Take, rule: Rule) -> Flags:
    """Contact [N] by the paper's detector with a rule that may end the freezing of the bias.

    The model's error before the bias filter comes from the core with the filter asleep; the filter and the decision are
    repeated here. rule(error, velocity) gives a function of (sample, first sample of the alarm, residual) that says
    "" (as in the paper), "update" (the filter goes on) or "reset" (the bias takes up the whole residual).
    """
    asleep = take.run({**ASLEEP, "contact.threshold": [1e6]})
    error = asleep["residual"]
    decide = rule(error, take.velocity)
    contact = np.zeros(len(error), dtype=bool)
    bias, variance, began, values = 0.0, STANDARD**2, -1, error.tolist()
    for k in range(1, len(values)):
        residual = values[k] - bias
        touched = abs(residual) > THRESHOLD
        began = (k if began < 0 else began) if touched else -1
        done = decide(k, began, residual) if touched else "update"
        contact[k] = touched
        if done == "reset":
            bias += residual
        elif done:
            variance += DRIFT * STEP
            gain = variance / (variance + STANDARD**2)
            bias += gain * residual
            variance *= 1.0 - gain
    return contact


def by_time(seconds: float) -> Rule:
    """As `contact.release_time`; `math.inf`: the paper's rule."""
    return lambda error, velocity: lambda k, began, residual: "update" if (k - began) * STEP >= seconds - 1e-9 else ""


def by_motion(error: Numbers, velocity: Numbers) -> Callable[[int, int, float], str]:
    """The alarm is the model's fault if its residual swings with the direction of motion by more than a threshold.

    A push does not care for the direction; friction that is modelled too small changes sign with it. Both directions
    must have been seen for 50 ms each within the alarm.
    """
    up, down = (velocity > V_MIN), (velocity < -V_MIN)
    counts = np.cumsum([up, down], axis=1)
    sums = np.cumsum([error * up, error * down], axis=1)

    def decide(k: int, began: int, residual: float) -> str:
        many = counts[:, k] - counts[:, began]
        if min(many) < 50:
            return ""
        means = (sums[:, k] - sums[:, began]) / many
        return "update" if abs(means[0] - means[1]) > THRESHOLD else ""

    return decide


def at_rest(error: Numbers, velocity: Numbers) -> Callable[[int, int, float], str]:
    """The bias starts anew when the finger has rested for 0.3 s within an alarm."""
    index = np.arange(len(velocity))
    moved = np.maximum.accumulate(np.where(np.abs(velocity) > V_MIN, index, 0))
    return lambda k, began, residual: "reset" if k - max(moved[k], began) >= 300 else ""
