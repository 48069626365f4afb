"""Effects hidden in the virtual hand of `tendonfmu simulate`: LuGre friction, rigid bodies, sensors of its own.

Nothing is matched here: the nominal description has presliding everywhere, but in its own form, and a first-order
velocity filter; what the rig has beyond that counts as found, too. The strength of an effect is not scaled.
"""

from __future__ import annotations

import copy
import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from matched_rig import off_start
from tendonfmu.files.tables import write_table
from tendonfmu.simulate.rig import read_rig
from tendonfmu.simulate.simulation import simulate

sys.path.append(str(Path(__file__).resolve().parent.parent / "support"))  # also where a campaign's worker is the caller
from random_rigs import random_rig

Rig = dict[str, Any]

# what is added to the physics, at a size that an ordinary hand may have
HIDDEN: dict[str, Callable[[Rig], None]] = {
    "cover_hardening": lambda physics: physics["links"][1].update(cover_hardening=0.05),
    "joint_coupling": lambda physics: physics.update(joint_coupling=[0.01]),
    "asymmetric_friction": lambda physics: physics["friction"].update(asymmetry=0.2),
    "preload_friction": lambda physics: physics["friction"].update(preload=2.0),
    "friction_drift": lambda physics: physics["friction"].update(drift={"amplitude": 0.3, "time_constant": 15.0}),
}
PLACE = {"cover_hardening": {"joint": 2}, "joint_coupling": {"joint": 1}}  # the others are everywhere


def nominal_of(finger: Rig, physics: Rig) -> Rig:
    """The rig's finger as a description for the tool, presliding and bias added."""
    found = copy.deepcopy(finger)
    distances = physics["friction"]["presliding"]
    rows: list[Rig] = [
        {"effect": "presliding", "tendon": i + 1, "displacement": distances["edge"]}
        for i in range(len(found["tendons"]))
    ]
    rows += [
        {"effect": "presliding", "joint": j + 1, "displacement": distances["joint"]}
        for j in range(len(found["joints"]))
    ]
    found["extensions"] = rows
    found["velocity_threshold"] = {"tendon": 5e-4, "joint": 0.05}
    found["velocity_filter_cutoff"] = 20.0
    found["bias"] = {"drift_variance": 1e-6, "noise_std": 0.002, "initial_variance": 1e-4, "forget_rate": 0.0}
    found["contact"] = {"threshold": [1.0] * len(found["joints"])}
    return found


def lugre(folder: Path, effect: str, seed: int, seconds: float = 60.0) -> dict[str, Any]:
    """A random rig of two joints, one effect of `HIDDEN` in it, or none for effect "null"; a maker for campaigns."""
    rig = random_rig(seed, joints=2, duration=seconds)
    for tendon in rig["finger"]["tendons"]:  # one law each: an angle's tables would be another case
        tendon["edge_friction"] = [each["laws"][0] if "laws" in each else each for each in tendon["edge_friction"]]
    rig["recording"]["columns"] = ["joint_position"]
    rig["physics"]["gravity"] = [0.0, 0.0, 0.0]
    if effect != "null":
        HIDDEN[effect](rig["physics"])
    (folder / "rig.json").write_text(json.dumps(rig), encoding="utf-8")
    write_table(folder / "recording.parquet", simulate(read_rig(folder / "rig.json")).recording)
    data = off_start(np.random.default_rng([seed, 67]), nominal_of(rig["finger"], rig["physics"]))
    (folder / "nominal.json").write_text(json.dumps(data), encoding="utf-8")
    truth = [] if effect == "null" else [{"effect": effect, **PLACE.get(effect, {})}]
    return {
        "finger": "nominal.json", "recordings": ["recording.parquet"], "kinematics": 1, "rig": "full LuGre",
        "truth": truth, "facts": {"hidden": effect},
    }  # fmt: skip
