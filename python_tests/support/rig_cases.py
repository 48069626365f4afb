"""Rigs to change and to break, shared by the tests of rig files."""

from __future__ import annotations

import copy
import json
from pathlib import Path
from typing import Any

from plant_fmu_rig import fmu_rig
from repository_paths import ROOT
from tendonfmu.errors import InputError
from tendonfmu.simulate.rig import read_rig
from tendonfmu.simulate.simulation import plant_of

EXAMPLES = ROOT / "examples"
RIGS = EXAMPLES / "rigs"
INDEX_RIGS = ["index_finger.json", "index_finger_x4.json", "index_finger_pushes.json"]
FINGER = json.loads((EXAMPLES / "fingers" / "index_finger.json").read_text(encoding="utf-8"))


def index_rig() -> dict[str, Any]:
    """The index finger's rig with its description inline."""
    data: dict[str, Any] = json.loads((RIGS / "index_finger.json").read_text(encoding="utf-8"))
    data["finger"] = copy.deepcopy(FINGER)
    return data


def with_everything() -> dict[str, Any]:
    """A valid rig of 2 joints and 4 tendons that switches on every effect and uses every key."""
    data = fmu_rig()
    data["motion"]["duration"] = 20.0
    data["recording"] = {"duration": 20.0, "columns": ["joint_position", "external_torque", "contact"]}
    data["sensors"]["tendon_position"] = {"resolution": 2e-6}
    data["settle"] = 1.0
    data["physics"] |= everything_of_physics(data["physics"])
    for name, sensor in data["sensors"].items():
        if name != "rate":
            sensor |= {"gain": 1.01, "offset": 0.0, "delay": 0.002}
    data["sensors"]["joint_velocity"] = {"noise": 0.01}
    data["sensors"]["tendon_position"]["backlash"] = 1e-5
    limits = [link["limits"] for link in data["physics"]["links"]]
    data["motion"] |= {"still": 1.0, "speed": [0.2, 0.8], "rest": [0.2, 1.0], "rest_share": 0.3}
    data["motion"] |= {key: [limit[key] for limit in limits] for key in ("lower", "upper")}
    data["motion"]["position"] = [0.5 * (limit["lower"] + limit["upper"]) for limit in limits]
    push = {"start": 2.0, "rise": 0.1, "hold": 0.5, "fall": 0.1, "force": 1.0, "direction": [0.0, 0.0, 1.0]}
    data["pushes"] = [push | {"frame": "base", "link": 1, "point": [0.01, 0.0, 0.0]}]
    return data


def everything_of_physics(physics: dict[str, Any]) -> dict[str, Any]:
    links = [
        link
        | {"cover_hardening": 0.01, "damping": 1e-4, "limits": link["limits"] | {"stiffness": 4.0, "damping": 0.02}}
        for link in physics["links"]
    ]
    tendon = {"hardening": 1e5, "damping": 0.5, "moment_arm_scale": 1.02, "moment_arm_slope": [1e-3, 0.0]}
    edge = {"tendon": 3, "joint": 2, "shape": "sine", "rest": 0.2, "slope": 0.8, "centre": 0.1, "coefficient": 0.05}
    friction = {
        "preload": 1.0,
        "asymmetry": 0.1,
        "edges": [edge | {"negative_coefficient": 0.04}],
        "drift": {"amplitude": 0.2, "time_constant": 100.0},
        "heat": {"coefficient": 0.01, "time_constant": 50.0},
    }
    law = {"static": 0.03, "coulomb": 0.02, "stribeck_velocity": 0.005, "viscous": 0.0}
    wrist = {"amplitude": 0.1, "period": 30.0, "arms": [0.005] * 4, "friction": law, "presliding": 5e-5}
    obstacle = {"centre": [0.06, 0.0, -0.08], "radius": 0.01, "stiffness": 2000.0, "damping": 0.1}
    return {
        "links": links,
        "gravity": [0.0, 0.0, -9.81],
        "contact_force": 0.1,
        "joint_coupling": [0.01],
        "tendons": [tendon | {"eccentricity": [1e-4, 0.0], "phase": [0.3, 0.0]}, {}],
        "friction": physics["friction"] | friction,
        "wrist": wrist,
        "obstacle": obstacle | {"link": 2, "point": [0.022, 0.0, 0.0]},
    }


def written(folder: Path, data: Any, name: str = "rig.json") -> Path:
    (folder / name).write_text(data if isinstance(data, str) else json.dumps(data), encoding="utf-8")
    return folder / name


def place_of(data: Any, path: tuple[Any, ...]) -> Any:
    for key in path:
        data = data[key]
    return data


def changed(data: dict[str, Any], path: tuple[Any, ...], value: Any) -> dict[str, Any]:
    result = copy.deepcopy(data)
    place_of(result, path[:-1])[path[-1]] = value
    return result


def accepted(folder: Path, data: Any) -> str | None:
    """The line of refusal of reader or plant, None where both accept."""
    try:
        plant_of(read_rig(written(folder, data)))
    except InputError as refused:
        return str(refused)
    return None
