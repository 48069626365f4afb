"""How well a motion identifies a finger's friction parameters: the Fisher information of the innovations.

The innovations are those of the model's own bias filter. Assumed: the joint torques τ carry independent white noise of
the description's `bias.noise_std` (plus a part per force), and the bias is a random walk of `bias.drift_variance`, so
slow changes carry little information. The derivatives of T_eff by the parameters are differences between runs of the
C core, with the jumps of fig. 5.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tendonfmu.arrays import Numbers
from tendonfmu.model import (
    DEFAULTS,
    Finger,
    Number,
    native,
    number_of,
)

Progress = Callable[[int, int], None]

STEP = 1e-4  # of a value: T is linear in three of the four numbers of a law, and nearly so in the fourth over this
_ELEMENTS = 4_000_000  # sensitivities in memory at a time


# --- sensitivities ----------------------------------------------------------------------------------------------------


def friction_probe(finger: Finger) -> native.Instance:
    """Make a finger that computes the friction model only."""
    probe = finger.steady.instance(3)
    probe.set({"bias.forget_rate": number_of(finger.data, "bias.forget_rate")})
    return probe


def _sign(number: Number) -> int:
    """Return the direction of the step: coulomb friction and delays step down, since both have an upper limit."""
    down = number.key == "delay" or (number.key == "coulomb" and number.with_path is None)
    return -1 if down and number.value > 0 else 1


class _Run:
    """A finger with a number changed, advanced over a motion part by part."""

    def __init__(self, finger: native.Instance, number: Number | None = None) -> None:
        self.step = STEP if number is None else _sign(number) * STEP  # relative
        plain = {} if number is None else {path: finger.get(path) for path in number.paths}
        step = 0.0 if number is None else self.step * number.reference
        finger.set({path: value + step for path, value in plain.items()})
        self._state = finger.save_state()
        finger.set(plain)
        self._bias = np.zeros((1, finger.joints))

    def advance(self, finger: native.Instance, part: Mapping[str, Numbers]) -> tuple[Numbers, Numbers]:
        """Return [N, n] T of eq. (10) and the bias increments Δb over the part (N·m)."""
        finger.restore_state(self._state)
        outputs = finger.run(part)
        self._state = finger.save_state()
        bias = outputs["bias_torque"]
        jump = np.diff(bias, axis=0, prepend=self._bias)
        self._bias = bias[-1:]
        return outputs["friction_torque"] - bias, jump


def sensitivities(
    described: Finger, numbers: Sequence[Number], motion: Mapping[str, Numbers], progress: Progress | None = None
) -> Iterator[Numbers]:
    """Compute the change of T_eff per relative change of each number; only fig. 5 moves the bias."""
    # motion: [N] (s); returns [S, n, p] of successive parts of the motion (N·m)
    finger = friction_probe(described)
    samples, joints = motion["joint_position"].shape
    base, runs = _Run(finger), [_Run(finger, number) for number in numbers]
    held = np.zeros((joints, len(numbers)))  # by the bias, from the parts before
    length = max(200, _ELEMENTS // (joints * max(len(numbers), 1)))
    starts = range(0, samples, length)
    for number, begin in enumerate(starts):
        part = {name: values[begin : begin + length] for name, values in motion.items()}
        plain = base.advance(finger, part)
        changes = np.zeros((len(part["time"]), joints, len(numbers)))
        for k, run in enumerate(runs):
            torque, jump = ((new - old) / run.step for new, old in zip(run.advance(finger, part), plain, strict=True))
            bias = held[:, k] + np.cumsum(jump, axis=0)
            changes[:, :, k] = torque + bias
            held[:, k] = bias[-1]
            if progress is not None:
                progress(number * len(runs) + k + 1, len(starts) * len(runs))
        yield changes


# --- information ------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Noise:
    """Assumed noise of the measured torque."""

    std: float  # standard deviation of a sample that stands for `time` (N·m)
    per_force: float  # standard deviation per mean tendon force (N·m/N)
    time: float  # time that a sample stands for (s)
    drift: float  # drift of the bias ((N·m)²/s)
    initial: float | None  # initial variance of the bias ((N·m)²); None: that of one sample


def noise_of(data: Mapping[str, Any], sample_time: float) -> Noise:
    """Return the noise of a description's `bias`, with its defaults."""
    # A finger without noise gets the default noise_std; otherwise every number would be identifiable.
    bias = data.get("bias") or {}
    std, per_force = (number_of(data, f"bias.{key}") for key in ("noise_std", "noise_std_per_force"))
    initial = bias.get("initial_variance")
    return Noise(
        std=std if std or per_force else DEFAULTS["bias.noise_std"],
        per_force=per_force,
        time=float(bias.get("noise_time") or sample_time),
        drift=number_of(data, "bias.drift_variance"),
        initial=None if initial is None else float(initial),
    )


def information(parts: Iterable[Numbers], time: Numbers, mean_force: Numbers, noise: Noise) -> Numbers:
    """Compute the Fisher information of the innovations about relative changes of the numbers."""
    # time: [N] (s); mean_force: [N] (N); returns [p, p]
    step = np.diff(time, prepend=time[0])
    per_sample = (noise.std + noise.per_force * mean_force) ** 2
    variance = float(per_sample[0]) if noise.initial is None else noise.initial
    spread = per_sample * noise.time / np.maximum(step, 1e-12)
    k, total, bias = 0, np.zeros((0, 0)), np.zeros((0, 0))
    for part in parts:
        if k == 0:
            bias, total = part[0].copy(), np.zeros((part.shape[2], part.shape[2]))
        for row in part:
            row -= bias
            if k > 0:
                variance += noise.drift * step[k]
                gain = variance / (variance + spread[k])
                bias += gain * row
                row /= np.sqrt(variance + spread[k])
                variance *= 1 - gain
            k += 1
        rows = part.reshape(-1, part.shape[2])
        total += rows.T @ rows
    return total
