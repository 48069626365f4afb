"""Tip force and link in contact (docs/reference/semantics/contact_place.md#link-geometry), against a numpy twin.

The twin turns vectors about axes from the tip to the base and solves by singular values; it shares no formula with the
C core, which goes from the base to the tip and diagonalises the normal equations.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from random_fingers import random_case
from tendonfmu.files.tables import write_table
from tendonfmu.fmu.fmpy_client import run_fmu
from tendonfmu.fmu.model_variables import read_table
from tendonfmu.fmu.packaging import build_fmu, package_file
from tendonfmu.model.description import read_finger
from tendonfmu.model.native import Instance
from tendonfmu.model.output_names import PLACE
from tendonfmu.recordings.recording import read_recording

Array = NDArray[Any]
SPREAD = (0.002, 0.0001)  # contact.deviation, N·m, and its growth with the mean force


def with_links(description: dict[str, Any], seed: int) -> dict[str, Any]:
    """Random axes, places and tip; every third offset is left out."""
    rng, n = np.random.default_rng([seed, 17]), len(description["joints"])
    links = [{"axis": rng.normal(size=3).tolist(), "offset": (0.03 * rng.normal(size=3)).tolist()} for _ in range(n)]
    for link in links[::3]:
        del link["offset"]
    contact = description["contact"] | {"deviation": [SPREAD[0]] * n, "deviation_per_force": [SPREAD[1]] * n}
    return description | {"links": links, "tip": (0.03 * rng.normal(size=3)).tolist(), "contact": contact}


def turned(vector: Array, axis: Array, angle: float) -> Array:
    along = (vector @ axis) * axis
    return np.asarray(along + np.cos(angle) * (vector - along) + np.sin(angle) * np.cross(axis, vector))


def levers(description: dict[str, Any], angle: Array) -> Array:
    """[n, 3] dp/dq of the tip in the base frame: from the tip down, all that is beyond a joint turns with it."""
    arm, found = np.array(description["tip"]), []
    for link, q in zip(reversed(description["links"]), angle[::-1], strict=True):
        axis = np.array(link["axis"]) / np.linalg.norm(link["axis"])
        offset = np.array(link.get("offset", [0.0, 0.0, 0.0]))
        arm = turned(arm, axis, q)
        found = [np.cross(axis, arm), *(turned(each, axis, q) for each in found)]
        arm = arm + offset
    return np.array(found)


def twin(description: dict[str, Any], outputs: dict[str, Array], k: int) -> dict[str, Any]:
    """PLACE of sample k from the other outputs."""
    torque, std = outputs["compensated_torque"][k], outputs["compensated_torque_std"][k]
    known = bool(np.all(std > 0.0)) and "deviation" in description["contact"]
    weight = 1.0 / std if known else np.ones_like(std)
    lever = levers(description, outputs["joint_angle"][k])
    u, s, v = np.linalg.svd(-lever * weight[:, None], full_matrices=True)
    s = np.append(s, np.zeros(3 - len(s)))
    told, turning = (s > 0.0) & (s >= s[0] / 10.0), (s > 0.0) & (s >= 1e-4 * s[0])
    along = np.array([u[:, i] @ (weight * torque) / s[i] if turning[i] else 0.0 for i in range(3)])
    left = weight * (torque + lever @ (v.T @ along))
    free = len(torque) - int(turning.sum())
    ends = [*(link.get("offset", [0.0] * 3) for link in description["links"][1:]), description["tip"]]
    out = np.flatnonzero(np.abs(torque) > 5.0 * std) if known else []
    reached = [j + 1 for j, end in enumerate(ends) if np.any(np.asarray(end) != 0.0)]
    named = min([j for j in reached if j >= out[-1] + 1], default=len(ends)) if len(out) else -1
    return {
        "fingertip_force": v.T @ np.where(told, along, 0.0),
        "fingertip_force_std": np.sqrt(sum(v[i] ** 2 / s[i] ** 2 for i in range(3) if told[i]))
        if known
        else np.zeros(3),
        "fingertip_force_observable": bool(told.all()),
        "fingertip_force_misfit": float(left @ left / free) if known and free else 0.0,
        "contact_link": named if np.ravel(outputs["contact"])[k] else 0,
    }


@pytest.mark.parametrize("seed", range(12))
def test_agrees_with_the_twin_and_changes_nothing_else(seed: int) -> None:
    plain, recording = random_case(seed, samples=120)
    description = with_links(plain, seed)
    if seed % 4 == 3:
        del description["contact"]["deviation"], description["contact"]["deviation_per_force"]
    outputs = Instance.from_description(description, 2).run(recording)
    without = Instance.from_description({k: v for k, v in description.items() if k not in ("links", "tip")}, 2)
    bare = without.run(recording)
    assert set(outputs) - set(bare) == set(PLACE)
    assert all(np.array_equal(outputs[name], bare[name]) for name in bare)
    for k in range(0, 120, 7):
        expected = twin(description, outputs, k)
        force = expected["fingertip_force"]
        np.testing.assert_allclose(outputs["fingertip_force"][k], force, atol=1e-9 * (1e-3 + np.abs(force).max()))
        np.testing.assert_allclose(outputs["fingertip_force_std"][k], expected["fingertip_force_std"], rtol=1e-9)
        assert outputs["fingertip_force_observable"][k] == expected["fingertip_force_observable"]
        misfit = min(1e12, expected["fingertip_force_misfit"])
        assert outputs["fingertip_force_misfit"][k] == pytest.approx(misfit, rel=1e-8, abs=1e-12)
        assert outputs["contact_link"][k] == expected["contact_link"]


def spatial_finger(links: list[dict[str, Any]], tip: list[float]) -> dict[str, Any]:
    """Four joints without friction, each pulled by a cable loop of its own; a bias that stays."""
    arms = 0.01 * np.eye(4)
    return {
        "format": "tendonfmu-finger-1",
        "name": "spatial",
        "joints": [{}] * 4,
        "tendons": [{"stiffness": 5e3, "moment_arms": row.tolist(), "bidirectional": True} for row in arms],
        "bias": {"drift_variance": 0.0, "initial_variance": 0.0},
        "contact": {"threshold": [0.001] * 4, "deviation": [0.001, 0.002, 0.001, 0.001]},
        "links": links,
        "tip": tip,
    }


SADDLE = [
    {"axis": [0, 0, 1]},
    {"axis": [0, 2, 0]},
    {"axis": [0, 1, 0], "offset": [0.045, 0, 0]},
    {"axis": [0, 1, 0], "offset": [0.028, 0, 0]},
]


def held(description: dict[str, Any], angle: Array, torque: Array) -> dict[str, Array]:
    """The outputs after a load of `torque` [4] has come, joints measured at `angle`."""
    recording = {
        "time": np.array([0.0, 0.01]),
        "tendon_force": np.array([np.full(4, 5.0), 5.0 + np.array(torque) / 0.01]),
        "joint_position": np.tile(angle, (2, 1)),
    }
    return {name: values[1] for name, values in Instance.from_description(description, 2).run(recording).items()}


def test_a_force_at_the_tip_is_found_from_the_tendons() -> None:
    description, angle, force = spatial_finger(SADDLE, [0.022, 0, 0]), np.array([0.2, 0.6, 0.9, 0.5]), [0.3, -0.7, 1.1]
    out = held(description, angle, -levers(description, angle) @ force)
    np.testing.assert_allclose(out["fingertip_force"], force, atol=1e-10)
    assert out["fingertip_force_observable"] and out["fingertip_force_misfit"] < 1e-15
    assert out["contact_link"] == 4


@pytest.mark.parametrize(
    ("what", "angle", "torque", "observable", "link"),
    [
        ("stretched: nothing turns joints along the finger", [0.0, 0.0, 0.0, 0.0], [0.03, 0.04, 0.02, 0.01], False, 4),
        ("sideways: parallel to all axes but the first", [0.2, 0.6, 0.9, 0.5], [0.05, 0.0, 0.0, 0.0], True, 2),
        ("too weak: no joint stands out", [0.2, 0.6, 0.9, 0.5], [0.0, 0.009, 0.0, 0.0], True, -1),
        ("through the last axis", [0.2, 0.6, 0.9, 0.5], [0.0, 0.06, 0.02, 0.0], True, 3),
        ("no contact", [0.2, 0.6, 0.9, 0.5], [0.0, 0.0, 0.0, 0.0], True, 0),
    ],
)
def test_what_torques_cannot_tell(
    what: str, angle: list[float], torque: list[float], observable: bool, link: int
) -> None:
    out = held(spatial_finger(SADDLE, [0.022, 0, 0]), np.array(angle), np.array(torque))
    assert (bool(out["fingertip_force_observable"]), int(out["contact_link"])) == (observable, link), what


def test_the_fmu_has_the_outputs_where_there_are_links(tmp_path: Path) -> None:
    from fmpy.validation import validate_fmu

    description = spatial_finger(SADDLE, [0.022, 0, 0])
    source, table = tmp_path / "spatial.json", tmp_path / "rec.csv"
    groups = {
        g["name"] for g in read_table(package_file("model_description/variables.json").read_text()).data["groups"]
    }
    assert set(PLACE) <= groups
    rng = np.random.default_rng(4)
    columns = {"time": 0.01 * np.arange(40)}
    columns |= {f"tendon_force[{i}]": rng.uniform(3.0, 9.0, 40) for i in range(1, 5)}
    columns |= {f"tendon_position[{i}]": 0.01 * np.cumsum(0.05 * rng.normal(size=40)) for i in range(1, 5)}
    write_table(table, columns)
    recording = read_recording(table)
    for with_geometry in (True, False):
        if not with_geometry:
            del description["links"], description["tip"]
        source.write_text(json.dumps(description))
        fmu = build_fmu(source, tmp_path / "spatial.fmu")
        assert validate_fmu(str(fmu)) == []
        out = run_fmu(fmu, recording)
        assert any(name.startswith("fingertip") or name == "contact_link" for name in out) == with_geometry
        expected = Instance(read_finger(source).image).run({"time": recording.time, **recording.groups})
        assert expected["contact"].any()
        for name in PLACE if with_geometry else ():
            values = np.column_stack([out[each] for each in out if each.split("[")[0] == name])
            assert np.array_equal(values.reshape(expected[name].shape), expected[name]), name
