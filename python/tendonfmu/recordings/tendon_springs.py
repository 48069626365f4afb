"""Tendon positions without what a described spring or drive bends: play, and a stretch that is not proportional."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tendonfmu.model import Finger, extension_rows, native, without_detection
from tendonfmu.recordings.recording import Recording

BENDING = ("backlash", "tendon_nonlinearity")


def with_linear_springs(finger: Finger, recording: Recording) -> Recording:
    """Return what tendons without play, on linear springs of the described stiffness, would have recorded.

    x0 = zero + R q + f0/k holds for it where the described `backlash` and `tendon_nonlinearity` are right.
    """
    rows = [row for row in extension_rows(finger.data) if row["effect"] in BENDING and row.get("tendon")]
    if not rows:
        return recording
    position, force = recording.groups["tendon_position"].copy(), recording.groups["tendon_force"]
    for i in sorted({row["tendon"] - 1 for row in rows}):
        own, stiffness = [i], finger.data["tendons"][i]["stiffness"]
        # by the core's own law: a joint that this tendon alone turns, with an arm of 1 m, is at x0 less the stretch
        alone = {
            "format": finger.data["format"],
            "name": "spring",
            "joints": [{}],
            "tendons": [{"stiffness": stiffness, "moment_arms": [1.0], "bidirectional": True}],
            "extensions": [{**row, "tendon": 1} for row in rows if row["tendon"] == i + 1],
        }
        given = {"time": recording.time, "tendon_force": force[:, own], "tendon_position": position[:, own]}
        outputs = native.run_recording(without_detection(alone), given)
        position[:, i] = outputs["joint_angle"][:, 0] + force[:, i] / stiffness
    return replace(recording, groups={**recording.groups, "tendon_position": np.asarray(position)})
