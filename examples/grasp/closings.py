"""What detectors of contact need and do, seen on closings that never stop. Until a detector answers, a grasp does not
depend on it: such a closing shows for each when it would have stopped, and at which force.

Every detector gets the smallest thresholds per joint that no free closing at the same pretension passes, times 1.25.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from controller import JOINTS, STEP, Array, Loop, Task, numbered

COMPENSATED = "compensated"
TIMES = (0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0)  # s, of the mean that a joint torque is compared with
MARGIN = 1.25


def columns(table: Mapping[str, Array], name: str) -> Array:
    return np.stack([table[each] for each in numbered(name, JOINTS)], axis=1)


def change(torque: Array, seconds: float) -> Array:
    """[N, joints] N·m from torques [N, joints], as the controller has it."""
    found, mean, keep = np.empty_like(torque), torque[0], np.exp(-STEP / seconds)
    for k, now in enumerate(torque):
        found[k] = now - mean
        mean = now - found[k] * keep
    return np.abs(found)


@dataclass
class Closing:
    """While a contact counts: true force [N] N, and of each detector the signal [N, joints] N·m.

    The signal of `compensated` is in shares of the description's thresholds.
    """

    force: Array
    signals: dict[str, Array]

    @classmethod
    def of(cls, table: Mapping[str, Array], task: Task, thresholds: Array) -> Closing:
        """thresholds: [8] Loop.THRESHOLDS of the friction FMU, taken at the pretension."""
        limits = thresholds[: len(JOINTS)] + task.pretension * thresholds[len(JOINTS) :]
        counts = (table["time"] > 2.0 * Loop.WARM_UP / task.speed) & (table["c"] > Loop.ARMED + task.speed * STEP)
        signals = {COMPENSATED: np.abs(columns(table, "compensated_torque")) / limits}
        raw = columns(table, "joint_torque")
        signals |= {f"raw, {seconds:g} s": change(raw, seconds) for seconds in TIMES}
        return cls(table["force"][counts], {name: signal[counts] for name, signal in signals.items()})

    def stop(self, detector: str, thresholds: Array) -> tuple[float, float]:
        """Delay from the touch s (negative: a false stop) and force N there; infinite where it never stops."""
        hits = np.flatnonzero(np.any(self.signals[detector] > thresholds, axis=1))
        if not hits.size:
            return np.inf, np.inf
        touch = int(np.flatnonzero(self.force > 0.0)[0]) if self.force.any() else len(self.force)
        return STEP * float(hits[0] - touch), float(self.force[hits[0]])


def thresholds_of(closings: Sequence[Closing], detector: str) -> Array:
    """[joints], none of which any of these free closings passes."""
    top: Array = np.max([closing.signals[detector].max(axis=0) for closing in closings], axis=0)
    return MARGIN * top


def best_raw(free: Sequence[Closing], touching: Sequence[Closing]) -> tuple[float, Array]:
    """Time of the mean s and thresholds [joints] N·m that stop at the smallest forces; first of all those that stop."""

    def cost(seconds: float) -> tuple[int, float]:
        name = f"raw, {seconds:g} s"
        forces = [closing.stop(name, thresholds_of(free, name))[1] for closing in touching]
        return int(np.isinf(forces).sum()), float(sum(force for force in forces if np.isfinite(force)))

    seconds = min(TIMES, key=cost)
    return seconds, thresholds_of(free, f"raw, {seconds:g} s")
