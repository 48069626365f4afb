"""Hidden effects that are not in docs/reference/semantics.md#names-of-effects: the right answer is `unknown`."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from friction_physics import Finger, Motion, last_true
from matched_rig import Hand, Hidden, Unreachable

Array = NDArray[Any]
Random = np.random.Generator


def rubbing(hand: Hand, rng: Random) -> tuple[Hand, Hidden]:
    """Two neighbouring tendons rub on each other before a joint: friction by their relative velocity."""
    m, n = len(hand.truth["tendons"]), len(hand.truth["joints"])
    i, j = int(rng.integers(m)), int(rng.integers(n))
    other = (i + 1) % m

    def change(finger: Finger, motion: Motion, magnitude: float) -> None:
        relative = motion.tendon[:, i, j] - motion.tendon[:, other, j]
        last = last_true(np.abs(relative) > finger.tendon_threshold)
        sign = np.where(last >= 0, np.sign(relative[last]), 0.0)

        def torque(motion: Motion, force: Array) -> Array:
            found = np.zeros_like(motion.angle)
            drag = magnitude * np.sqrt(np.abs(force[:, i] * force[:, other])) * sign
            found[:, j:] = drag[:, None] * (finger.arms[i, j:] - finger.arms[other, j:])
            return found

        finger.extras.append(torque)

    note = f"tendons {i + 1} and {other + 1} before joint {j + 1}"
    return hand, Hidden("rubbing", joint=j + 1, tendon=i + 1, magnitude=0.02, note=note, finger=change)


def periodic(hand: Hand, rng: Random) -> tuple[Hand, Hidden]:
    """A torque that comes and goes in time alone, such as the cogging of a motor that turns by itself; half beat."""
    j = int(rng.integers(len(hand.truth["joints"])))
    frequency, phase = float(np.exp(rng.uniform(np.log(0.6), np.log(3.0)))), float(rng.uniform(0.0, 2.0 * np.pi))
    beat = float(rng.uniform(0.05, 0.2)) if rng.random() < 0.5 else 0.0

    def change(finger: Finger, motion: Motion, magnitude: float) -> None:
        def torque(motion: Motion, force: Array) -> Array:
            found = np.zeros_like(motion.angle)
            envelope = np.cos(2.0 * np.pi * beat * motion.time)
            found[:, j] = magnitude * envelope * np.sin(2.0 * np.pi * frequency * motion.time + phase)
            return found

        finger.extras.append(torque)

    return hand, Hidden("periodic", joint=j + 1, magnitude=0.002, note=f"{frequency:.2f} Hz", finger=change)


def ageing(hand: Hand, rng: Random) -> tuple[Hand, Hidden]:
    """Friction of a tendon that remembers for seconds how much it slid: it falls while it slides and heals at rest."""
    rubbing = [i for i, each in enumerate(hand.truth["tendons"]) if any(law for law in each["edge_friction"])]
    if not rubbing:
        raise Unreachable("ageing: no tendon has an edge that rubs")
    i = rubbing[int(rng.integers(len(rubbing)))]
    memory = float(rng.uniform(2.0, 5.0))

    def change(finger: Finger, motion: Motion, magnitude: float) -> None:
        share = 1.0 - np.exp(-(motion.time[1] - motion.time[0]) / memory)
        slides = np.minimum(np.abs(motion.tendon[:, i, 0]) / 0.005, 1.0)
        level = lfilter([share], [1.0, share - 1.0], slides)
        factor = 1.0 - magnitude * (level - level.mean())
        if factor.min() < 0.02:
            raise Unreachable("ageing: friction would turn round")
        for effect in finger.effects:
            if effect.kind in ("edge", "pulley") and effect.at[0] == i:
                effect.factor = factor

    return hand, Hidden("ageing", tendon=i + 1, magnitude=0.5, note=f"memory {memory:.1f} s", finger=change)


UNKNOWN: dict[str, Callable[..., tuple[Hand, Hidden]]] = {"rubbing": rubbing, "periodic": periodic, "ageing": ageing}
