"""The index finger of the examples: counted and checked from its JSON alone."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from repository_paths import ROOT

FINGER = ROOT / "examples" / "fingers" / "index_finger.json"
README = FINGER.with_name("README.md")
MAGNITUDES = {"static", "coulomb", "stribeck_velocity", "viscous"}

# laws by kind, as tabled in examples/fingers/README.md
EXPECTED_LAWS = {
    "friction": 4,
    "load_friction": 4,
    "pulley_friction": 14,
    "edge_friction 1": 8,
    "edge_friction 2": 48,
    "edge_friction 3": 28,
    "edge_friction 4": 10,
}


@pytest.fixture(scope="module")
def finger() -> dict[str, Any]:
    description: dict[str, Any] = json.loads(FINGER.read_text(encoding="utf-8"))
    return description


def laws_of(finger: dict[str, Any]) -> Iterator[tuple[str, dict[str, float]]]:
    """Every law of the description with its kind; edges by the joint they stand in front of."""
    for joint in finger["joints"]:
        for kind in ("friction", "load_friction"):
            yield kind, joint[kind]
    for tendon in finger["tendons"]:
        for law in tendon["pulley_friction"]:
            if law is not None:
                yield "pulley_friction", law
        for j, edge in enumerate(tendon["edge_friction"], start=1):
            if edge is not None:
                for law in edge.get("laws", [edge]):
                    yield f"edge_friction {j}", law


def routing(finger: dict[str, Any]) -> np.ndarray:
    return np.array([tendon["moment_arms"] for tendon in finger["tendons"]])


def test_it_has_the_papers_472_numbers(finger: dict[str, Any]) -> None:
    laws = list(laws_of(finger))
    by_kind = {kind: sum(1 for k, _ in laws if k == kind) for kind in EXPECTED_LAWS}
    covers = sum(1 for joint in finger["joints"] if joint["cover"]["stiffness"] > 0)
    biases = len(finger["joints"])

    assert by_kind == EXPECTED_LAWS
    assert sum(len(law) for _, law in laws) + covers == 468
    assert sum(len(law) for _, law in laws) + covers + biases == 472
    # the paper's asymmetric count: Fs, Fc, vs per direction and one Fv
    assert len(laws) * 7 + covers + biases == 820


def test_readme_states_the_same_count() -> None:
    text = README.read_text(encoding="utf-8")
    lines = [line for line in text.splitlines() if line.startswith("|")]
    rows = [[cell.strip(" *") for cell in line.strip("|").split("|")] for line in lines]
    table = {row[0]: row[2:] for row in rows if len(row) == 4}
    assert table["friction model"] == ["116", "468"]
    assert table["together"] == ["", "472"]
    stated = [int(cells[0]) for name, cells in table.items() if cells[0].isdigit() and name != "friction model"]
    assert stated == list(EXPECTED_LAWS.values())


def test_no_number_is_absent_by_structure(finger: dict[str, Any]) -> None:
    """viscous 0 or static equal to coulomb would mean "no such friction" and not be estimated."""
    for kind, law in laws_of(finger):
        assert set(law) == MAGNITUDES, kind
        assert law["static"] > law["coulomb"] > 0, kind
        assert law["stribeck_velocity"] > 0, kind
        assert law["viscous"] > 0, kind


def test_routing_has_full_rank_and_allows_pretension(finger: dict[str, Any]) -> None:
    r = routing(finger)
    assert r.shape == (8, 4)
    assert np.linalg.matrix_rank(r) == 4
    # the projection of equal forces on the null space of R^T is a pretension of all tendons
    pretension = np.ones(8) - r @ np.linalg.solve(r.T @ r, r.T @ np.ones(8))
    assert np.all(pretension > 0.8)
    assert np.abs(r.T @ pretension).max() < 1e-12
    # each joint is pulled both ways
    assert np.all(r.max(axis=0) > 0) and np.all(r.min(axis=0) < 0)


def test_a_tendon_has_no_friction_beyond_its_last_joint(finger: dict[str, Any]) -> None:
    for tendon in finger["tendons"]:
        last = max(j for j, arm in enumerate(tendon["moment_arms"]) if arm != 0.0)
        assert all(arm == 0.0 for arm in tendon["moment_arms"][last + 1 :])
        assert all(edge is None for edge in tendon["edge_friction"][last + 1 :])
        # the pulley of the last joint sees no relative motion either
        assert all(pulley is None for pulley in tendon["pulley_friction"][last:])
        assert all(pulley is not None for pulley in tendon["pulley_friction"][:last])


def edges_over_angles(finger: dict[str, Any]) -> list[dict[str, Any]]:
    edges = [edge for tendon in finger["tendons"] for edge in tendon["edge_friction"] if edge]
    return [edge for edge in edges if "angles" in edge]


def test_working_points_are_increasing_uneven_and_differ(finger: dict[str, Any]) -> None:
    edges = edges_over_angles(finger)
    assert len(edges) == 14 == len({tuple(edge["angles"]) for edge in edges})
    for edge in edges:
        assert len(edge["angles"]) == len(edge["laws"])
        steps = np.diff(edge["angles"])
        assert np.all(steps > 0)
        assert steps.max() > 1.2 * steps.min()


def test_edges_rub_more_towards_the_ends_of_the_range(finger: dict[str, Any]) -> None:
    for edge in edges_over_angles(finger):
        coulomb = [law["coulomb"] for law in edge["laws"]]
        lowest = int(np.argmin(coulomb))
        assert 0 < lowest < len(coulomb) - 1
        assert np.all(np.diff(coulomb[: lowest + 1]) < 0)
        assert np.all(np.diff(coulomb[lowest:]) > 0)


def test_every_tendon_keeps_some_of_its_force(finger: dict[str, Any]) -> None:
    """The chain of worst-case losses leaves each tendon taut: no slack by friction alone."""
    for tendon in finger["tendons"]:
        worst = [max(law["static"] for law in edge.get("laws", [edge])) for edge in tendon["edge_friction"] if edge]
        worst += [law["static"] for law in tendon["pulley_friction"] if law]
        assert np.prod([1.0 - share for share in worst]) > 0.6


def wrap_angles() -> dict[tuple[int, int], tuple[float, float, float]]:
    """(tendon, joint), from 1 -> rest, growth, centre of the README's table."""
    rows = re.findall(
        r"^\| ([1-8]) `\w+` \| (0\.\d+) \| ([^|]*/[^|]*) \|([^|]*)\|([^|]*)\|$", README.read_text("utf-8"), re.M
    )
    found = {}
    for tendon, *edges in rows:
        for joint, cell in enumerate(edges, start=1):
            numbers = [float(each.replace("−", "-")) for each in cell.split("/") if each.strip()]
            if numbers:
                rest, growth, centre = (*numbers, 0.0, 0.0)[:3]
                found[int(tendon), joint] = (rest, growth, centre)
    return found


def test_working_points_are_those_of_the_readmes_wrap_angles(finger: dict[str, Any]) -> None:
    """Sliding friction is 0.10 times the wrap angle, rounded to four decimals."""
    wraps = wrap_angles()
    half_range = {1: 1.0, 2: 0.35, 3: 0.85, 4: 0.8}
    described = 0
    for i, tendon in enumerate(finger["tendons"], start=1):
        for j, edge in enumerate(tendon["edge_friction"], start=1):
            if edge is None:
                continue
            rest, growth, centre = wraps[i, j]
            for angle, law in zip(edge.get("angles", [0.0]), edge.get("laws", [edge]), strict=True):
                expected = 0.10 * (rest + growth * ((angle - centre) / half_range[j]) ** 2)
                assert law["coulomb"] == pytest.approx(expected, abs=0.51e-4), (i, j, angle)
            described += 1
    assert described == len(wraps) == 22
