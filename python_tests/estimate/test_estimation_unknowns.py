"""Unknowns of the estimation: which numbers they move, starts, bounds, scales, sharing, fixed numbers."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
import pytest

from fit_cases import (
    groups,
    image_of,
    off_start,
    parameters_of,
    random_fit_case,
    shared_key,
    small_finger,
    twin_of,
)
from random_fingers import Description
from tendonfmu.estimate import estimation
from tendonfmu.estimate.verdicts import slopes

SMALL = small_finger()
PATHS, VALUES = parameters_of(SMALL)
INDEX = {path: k for k, path in enumerate(PATHS)}


def estimator_of(description: Description, chosen: dict[str, int], scale: dict[str, float] | None = None) -> Any:
    """An estimator of the numbers at some paths, in groups."""
    paths = parameters_of(description)[0]
    group = np.array([chosen.get(path, -1) for path in paths], dtype=np.int32)
    scales = None if scale is None else np.array([scale.get(path, np.nan) for path in paths])
    return estimation.Estimator(image_of(description), group, scales)


def law_paths(prefix: str) -> list[str]:
    return [f"{prefix}.{name}" for name in ("static", "coulomb", "stribeck_velocity", "viscous")]


@pytest.mark.parametrize("seed", range(12))
def test_round_trip_on_random_fingers(seed: int) -> None:
    """z -> numbers as the twin has them, and back; the start is the description's."""
    description = random_fit_case(seed, 60)[0]
    group = groups(description, shared_key(seed) if seed % 2 else lambda path: path)
    estimator = estimation.Estimator(image_of(description), group)
    twin = twin_of(description, group, estimator.unknowns)
    # the mean of what is shared, but never above a static friction that is fixed
    bounds = [[getattr(unknown, name) for unknown in estimator.unknowns] for name in ("lower", "upper")]
    start = estimator.start
    np.testing.assert_allclose(start, np.clip(twin.start, *bounds), rtol=1e-12)
    z = off_start(estimator.unknowns, seed)
    np.testing.assert_allclose(estimator.values(z), twin.parameters(z), rtol=1e-14)
    np.testing.assert_allclose(estimator.unknown_values(estimator.values(z)), z, rtol=1e-9)
    assert [unknown.role for unknown in estimator.unknowns] == [number.role for number in twin.numbers]
    if not seed % 2:  # nothing shared: the start is the description itself
        np.testing.assert_allclose(estimator.values(start), twin.values, rtol=1e-14)


def test_a_side_becomes_coulomb_drop_rate_viscous() -> None:
    prefix = "tendons[2].edge_friction[1]"
    static, coulomb, velocity, viscous = law_paths(prefix)
    estimator = estimator_of(SMALL, {static: 0, coulomb: 1, velocity: 2, viscous: 3})
    by_role = {unknown.role: unknown for unknown in estimator.unknowns}
    assert set(by_role) == {"coulomb", "drop", "rate", "viscous"}
    number = dict(zip(PATHS, VALUES, strict=True))
    expected = {
        "coulomb": number[coulomb],
        "drop": number[static] - number[coulomb],
        "rate": 1.0 / number[velocity],
        "viscous": number[viscous],
    }
    for role, value in expected.items():
        assert by_role[role].start == pytest.approx(value, rel=1e-12)
        assert by_role[role].scale == pytest.approx(value, rel=1e-12)
    # what is present stays present; vs > 0.2 v_min, v_min = 0.5 mm/s by default
    for role in ("coulomb", "drop", "viscous"):
        assert by_role[role].lower == pytest.approx(1e-6 * expected[role], rel=1e-12)
    assert by_role["rate"].lower == pytest.approx(1e-3 * expected["rate"], rel=1e-12)
    assert by_role["rate"].upper == pytest.approx(1.0 / (0.2 * 0.0005), rel=1e-12)
    for role, path in zip(("drop", "coulomb", "rate", "viscous"), law_paths(prefix), strict=True):
        assert by_role[role].path == path
        assert by_role[role].parameters == (INDEX[path],)


def test_stribeck_velocity_is_bounded_by_its_own_threshold() -> None:
    joint = estimator_of(SMALL, {"joints[1].friction.stribeck_velocity": 0})
    assert joint.unknowns[0].upper == pytest.approx(1.0 / (0.2 * 0.01), rel=1e-12)
    without = copy.deepcopy(SMALL) | {"velocity_threshold": {"tendon": 0.0, "joint": 0.0}}
    for path, velocity in (
        ("joints[1].friction.stribeck_velocity", 0.08),
        ("tendons[1].edge_friction[1].stribeck_velocity", 0.004),
    ):
        unknown = estimator_of(without, {path: 0}).unknowns[0]
        assert unknown.upper == pytest.approx(1.0 / (1e-3 * velocity), rel=1e-12)


def test_initial_torque_is_an_unknown_of_any_sign() -> None:
    description = copy.deepcopy(SMALL)
    description["bias"]["initial_torque"] = [0.02, 0.0]
    estimator = estimator_of(description, {"bias.initial_torque[1]": 0, "bias.initial_torque[2]": 1})
    assert [unknown.role for unknown in estimator.unknowns] == ["value", "value"]
    assert [unknown.start for unknown in estimator.unknowns] == [0.02, 0.0]
    assert estimator.unknowns[0].lower < -1.0 and estimator.unknowns[0].upper > 1.0
    assert estimator.unknowns[1].scale > 0.0


@pytest.mark.parametrize(
    ("chosen", "named"),
    [
        ({"tendons[1].stiffness": 0}, "tendons[1].stiffness"),
        ({"bias.noise_std": 0}, "bias.noise_std"),
        ({"velocity_threshold.tendon": 0}, "velocity_threshold.tendon"),
        ({"tendons[1].edge_friction[2].angles[1]": 0}, "angles[1]"),
        ({"joints[1].friction.viscous": 0, "joints[1].friction.stribeck_velocity": 0}, "joints[1].friction"),
    ],
    ids=["stiffness", "noise", "threshold", "angle", "two kinds in one group"],
)
def test_what_cannot_be_estimated_is_refused(chosen: dict[str, int], named: str) -> None:
    from tendonfmu.estimate.estimation import EstimationError

    with pytest.raises(EstimationError) as refused:
        estimator_of(SMALL, chosen)
    assert named in str(refused.value)
    assert "expected" in str(refused.value) and "\n" not in str(refused.value)
    short, long = np.full(len(PATHS) - 1, -1, dtype=np.int32), np.full(len(PATHS) + 1, np.nan)
    for group, scale in ((short, None), (groups(SMALL), long)):
        with pytest.raises(EstimationError, match=str(len(PATHS))):
            estimation.Estimator(image_of(SMALL), group, scale)


def test_a_small_drop_moves_static_as_a_large_one_does() -> None:
    """static = coulomb + drop: the slope is 1 also where the drop is far below the rounding of coulomb."""
    path = "tendons[2].edge_friction[1].static"
    coulomb = path.replace("static", "coulomb")
    estimator = estimator_of(SMALL, {path: 0, coulomb: 1}, {path: 1e-8})
    z = np.array([unknown.lower if unknown.role == "drop" else unknown.start for unknown in estimator.unknowns])
    k = [unknown.role for unknown in estimator.unknowns].index("drop")
    assert slopes(estimator, z)[INDEX[path], k] == pytest.approx(1.0, rel=1e-6)


def test_fixed_static_bounds_the_coulomb_friction() -> None:
    static, coulomb, _, _ = law_paths("joints[1].friction")
    (unknown,) = estimator_of(SMALL, {coulomb: 0}).unknowns
    assert unknown.upper == VALUES[INDEX[static]]


def test_scale_in_the_numbers_of_the_description() -> None:
    static, coulomb, velocity, viscous = law_paths("tendons[2].edge_friction[1]")
    scale = {static: 0.09, coulomb: 0.05, velocity: 0.01, viscous: 2.0}
    estimator = estimator_of(SMALL, {static: 0, coulomb: 1, velocity: 2, viscous: 3}, scale)
    found = {unknown.role: unknown.scale for unknown in estimator.unknowns}
    assert found == pytest.approx({"drop": 0.04, "coulomb": 0.05, "rate": 100.0, "viscous": 2.0}, rel=1e-12)
    lower = {unknown.role: unknown.lower for unknown in estimator.unknowns}
    expected = {"drop": 0.04e-6, "coulomb": 0.05e-6, "rate": 0.1, "viscous": 2e-6}
    assert lower == pytest.approx(expected, rel=1e-12)
