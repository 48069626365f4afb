"""What `tendonfmu check FINGER.json` warns about: valid descriptions of fingers that cannot be meant."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from repository_paths import ROOT
from tendonfmu.errors import InputError
from tendonfmu.model.description import read_finger
from tendonfmu.model.plausibility import description_findings

EXAMPLES = ROOT / "examples"
LAW = {"static": 0.03, "coulomb": 0.02, "stribeck_velocity": 0.005, "viscous": 0.3}
Description = dict[str, Any]


def two_joints() -> Description:
    """Two joints, each with a flexor and an extensor; the second pair crosses both."""
    arms = [[0.009, 0.0], [-0.009, 0.0], [0.008, 0.007], [-0.008, -0.007]]
    return {
        "format": "tendonfmu-finger-1",
        "name": "two",
        "joints": [{"name": "mcp", "cover": {"stiffness": 0.02}}, {"name": "pip"}],
        "tendons": [{"moment_arms": row, "stiffness": 4000.0, "edge_friction": [LAW, None]} for row in arms],
        "contact": {"threshold": [0.03, 0.03]},
    }


def keys(description: Description, folder: Path) -> list[str]:
    """Keys of the warnings."""
    file = folder / "finger.json"
    file.write_text(json.dumps(description))
    found = description_findings(read_finger(file))
    assert all(finding.severity == "warning" and finding.path == file for finding in found)
    return [finding.columns[0] for finding in found]


def in_mm(finger: Description) -> None:
    for tendon in finger["tendons"]:
        tendon["moment_arms"] = [1e3 * arm for arm in tendon["moment_arms"]]


def of_one_sign(finger: Description) -> None:
    for tendon in finger["tendons"]:
        tendon["moment_arms"][1] = abs(tendon["moment_arms"][1])


def one_tendon_in_place_of_two(finger: Description) -> None:
    finger["tendons"] = [{"moment_arms": [0.009, 0.0], "stiffness": 4000.0}, *finger["tendons"][2:]]


def loop_in_place_of_two(finger: Description) -> None:
    """A cable loop pulls both ways."""
    one_tendon_in_place_of_two(finger)
    finger["tendons"][0]["bidirectional"] = True


def in_n_per_mm(finger: Description) -> None:
    for tendon in finger["tendons"]:
        tendon["stiffness"] = 4.0


def set_to(path: str, value: Any) -> Callable[[Description], None]:
    def change(finger: Description) -> None:
        *parts, last = [int(part) if part.isdigit() else part for part in path.split("/")]
        target: Any = finger
        for part in parts:
            target = target[part] if not isinstance(part, str) or part in target else target.setdefault(part, {})
        target[last] = value

    return change


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (lambda finger: None, []),
        (in_mm, ["tendons[1].moment_arms[1]"]),
        (of_one_sign, ["tendons[*].moment_arms[2]"]),
        (loop_in_place_of_two, []),
        (one_tendon_in_place_of_two, ["tendons[*].moment_arms[1]", "tendons[*].moment_arms[2]"]),
        (in_n_per_mm, [f"tendons[{i}].stiffness" for i in range(1, 5)]),
        (set_to("joints/0/cover/stiffness", 20.0), ["joints[1].cover.stiffness"]),
        (set_to("joints/0/cover/rest_angle", 15.0), ["joints[1].cover.rest_angle"]),
        (set_to("tendons/2/edge_friction/0", LAW | {"static": 3.0, "coulomb": 2.0}), ["tendons[*]"]),
        (
            set_to("tendons/2/edge_friction/0", {"angles": [-30.0, 30.0], "laws": [LAW, LAW]}),
            ["tendons[3].edge_friction[1].angles"],
        ),
        (
            set_to("velocity_threshold", {"tendon": 0.5, "joint": 0.57}),
            ["velocity_threshold.tendon", "velocity_threshold.joint"],
        ),
        (set_to("contact/threshold", [0.03, 30.0]), ["contact.threshold[2]"]),
        (set_to("bias", {"drift_variance": 0.0, "initial_variance": 0.0}), ["bias.forget_rate"]),
        (set_to("bias", {"drift_variance": 0.0, "initial_variance": 0.0, "forget_rate": 0.0}), []),
        (set_to("bias", {"drift_variance": 0.0, "initial_variance": 0.0, "forgetting": "absorption"}), []),
    ],
)
def test_warnings(change: Callable[[Description], None], expected: list[str], tmp_path: Path) -> None:
    finger = two_joints()
    change(finger)
    assert keys(finger, tmp_path) == expected


def test_examples_have_no_warnings() -> None:
    checked = 0
    for file in (*EXAMPLES.glob("*/*.json"), *EXAMPLES.parent.glob("evidence/machine_data/*/*.json")):
        try:
            finger = read_finger(file)
        except InputError:
            continue  # a rig, or a part of one
        assert description_findings(finger) == [], file
        checked += 1
    assert checked >= 8
