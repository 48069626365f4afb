"""Adds what MJCF has no numbers for to an imported finger: python add_edges.py finger.json -o start.json.

Each tendon rubs where it enters a joint that it turns, by a share of its force: 2 % is a guess, and `tendonfmu fit`
finds the numbers. `--capstan MODEL.xml 0.1 0.05` takes friction at geoms and at sites times the wrap angles on the link
before, over the range of its joint. Friction builds up over a distance (`presliding`), in the joints over next to none.
The bias learns slowly, since a fast one would follow much of the friction that is to be fitted.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from capstan import Capstan, path_of, touched

from tendonfmu.files import write_text

EDGE = {"static": 0.02, "coulomb": 0.02, "stribeck_velocity": 0.005}
PRESLIDING = [
    {"effect": "presliding", "displacement": 0.3},
    *({"effect": "presliding", "joint": j, "displacement": 1e-4} for j in (1, 2)),
]
BIAS = {"drift_variance": 1e-8, "noise_std": 0.002, "noise_time": 0.01}


def with_edges(description: dict[str, Any]) -> dict[str, Any]:
    """The description with friction before each joint that a tendon turns."""
    tendons = [
        {**tendon, "edge_friction": [EDGE if arm else None for arm in tendon["moment_arms"]]}
        for tendon in description["tendons"]
    ]
    rows = [*description.get("extensions", []), *PRESLIDING]
    return {**description, "tendons": tendons, "bias": BIAS, "extensions": rows}


def capstan_edges(joints: Any, tendon: int, model: mujoco.MjModel, capstan: Capstan) -> list[Any]:
    """Friction of a tendon before each joint: what it loses on the link before, the other joints in the middle."""
    joints, data, links = [model.joint(row["name"]) for row in joints], mujoco.MjData(model), np.zeros(model.nbody)
    for body in range(1, model.nbody):
        links[body] = links[model.body_parentid[body]] + sum(joint.bodyid[0] == body for joint in joints)
    ranges, edges = [joint.range if joint.range[0] < joint.range[1] else np.array([-1.0, 1.0]) for joint in joints], []
    for link in range(len(joints)):
        angles, laws = np.linspace(ranges[link - 1][0], ranges[link - 1][1], 9) if link else np.zeros(1), []
        for angle in angles:
            for j, joint in enumerate(joints, start=1):
                data.qpos[joint.qposadr] = angle if j == link else ranges[j - 1].mean()
            mujoco.mj_fwdPosition(model, data)
            losses = capstan.friction[tendon] * path_of(model, data, tendon)[0]
            share = sum(losses[touch.place] for touch in touched(model, data, tendon) if links[touch.body] == link)
            sizes = {"positive": -np.expm1(-share), "negative": np.expm1(share)}
            laws.append({side: {**EDGE, "static": size, "coulomb": size} for side, size in sizes.items()})
        edges.append({"angles": angles.tolist(), "laws": laws})
    return edges


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("finger", type=Path)
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--capstan", nargs=3, metavar=("MODEL.xml", "GEOMS", "SITES"))
    given = parser.parse_args()
    description = with_edges(json.loads(given.finger.read_text(encoding="utf-8")))
    if given.capstan:
        model = mujoco.MjModel.from_xml_path(given.capstan[0])
        capstan = Capstan(model, *map(float, given.capstan[1:]))
        for row in description["tendons"]:
            edges = capstan_edges(description["joints"], model.tendon(row["name"]).id, model, capstan)
            row["edge_friction"] = [edge if any(row["moment_arms"][j:]) else None for j, edge in enumerate(edges)]
    write_text(given.output, json.dumps(description, indent=2) + "\n")


if __name__ == "__main__":
    main()
