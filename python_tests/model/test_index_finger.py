"""The index finger of the examples: counted and checked from its JSON alone."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from repository_paths import ROOT

FINGER = ROOT / "examples" / "fingers" / "index_finger.json"
MAGNITUDES = {"static", "coulomb", "stribeck_velocity", "viscous"}


@pytest.fixture(scope="module")
def finger() -> dict[str, Any]:
    description: dict[str, Any] = json.loads(FINGER.read_text(encoding="utf-8"))
    return description


def laws_of(finger: dict[str, Any]) -> Iterator[tuple[str, dict[str, float]]]:
    """Every law of the description with its kind."""
    for joint in finger["joints"]:
        for kind in ("friction", "load_friction"):
            yield kind, joint[kind]
    for tendon in finger["tendons"]:
        for law in tendon["pulley_friction"]:
            if law is not None:
                yield "pulley_friction", law
        for edge in tendon["edge_friction"]:
            if edge is not None:
                for law in edge.get("laws", [edge]):
                    yield "edge_friction", law


def routing(finger: dict[str, Any]) -> np.ndarray:
    return np.array([tendon["moment_arms"] for tendon in finger["tendons"]])


def test_it_has_the_papers_472_numbers(finger: dict[str, Any]) -> None:
    laws = list(laws_of(finger))
    covers = sum(1 for joint in finger["joints"] if joint["cover"]["stiffness"] > 0)
    biases = len(finger["joints"])

    assert sum(len(law) for _, law in laws) + covers == 468
    assert sum(len(law) for _, law in laws) + covers + biases == 472
    # the paper's asymmetric count: Fs, Fc, vs per direction and one Fv
    assert len(laws) * 7 + covers + biases == 820


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
