"""What `tendonfmu excite` says can be identified: against the core's own innovations and against estimates."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from excite_fingers import SMALL, SMALL_RANGES
from tendonfmu.estimate.fisher_information import information, noise_of, sensitivities
from tendonfmu.excite.excitation import Plan, balanced_forces, plan_excitation
from tendonfmu.excite.training_motion import as_array, excite, find_ranges, read_subject, report
from tendonfmu.model import native
from tendonfmu.model.description import finger_of
from tendonfmu.model.friction_places import friction_numbers


@pytest.fixture
def small_file(tmp_path: Path) -> Path:
    path = tmp_path / "small.json"
    path.write_text(json.dumps(SMALL))
    return path


def small_samples(data: dict[str, Any], duration: float = 60.0) -> dict[str, np.ndarray]:
    motion = plan_excitation(data, Plan(SMALL_RANGES, duration=duration, rate=50))
    samples = {name: getattr(motion, name) for name in ("time", "joint_position", "joint_velocity")}
    return samples | {"tendon_force": balanced_forces(finger_of(data), samples, motion.pretension)}


def innovations(data: dict[str, Any], samples: dict[str, np.ndarray], change: dict[str, float]) -> np.ndarray:
    """[N, n] τ − T_eff before the bias step, by the core's own filter, in units of their standard deviation."""
    free = {**data, "contact": {"threshold": [1e9] * 2}}
    finger = native.Instance.from_description(free, kinematics_source=3)
    finger.set({path: finger.get(path) + step for path, step in change.items()})
    left = finger.run(samples)["compensated_torque"]
    bias = data["bias"]
    variance, noise = bias["initial_variance"], bias["noise_std"] ** 2 * bias["noise_time"]
    result = np.zeros_like(left)
    steps = np.diff(samples["time"])
    for k, step in enumerate(steps, start=1):
        variance += bias["drift_variance"] * step
        total = variance + noise / step
        result[k] = left[k] * total / (noise / step) / np.sqrt(total)  # left = (1 − K) innovation
        variance *= 1 - variance / total
    return result


def test_information_is_that_of_the_cores_own_innovations() -> None:
    """Bundled runs, shared out and filtered in numpy, against one run of the whole core per number."""
    bias = {"drift_variance": 1e-4, "noise_std": 0.02, "noise_time": 0.01, "initial_variance": 1e-3, "forget_rate": 2.0}
    data = {**SMALL, "bias": bias}
    samples, numbers = small_samples(data), friction_numbers(SMALL)
    force = np.abs(samples["tendon_force"]).mean(axis=1)
    found = information(sensitivities(finger_of(data), numbers, samples), samples["time"], force, noise_of(data, 0.02))
    plain = innovations(data, samples, {})
    slopes = []
    for number in numbers:
        step = (-1e-5 if number.key == "coulomb" and number.with_path is None else 1e-5) * number.reference
        slopes.append(
            (innovations(data, samples, dict.fromkeys(number.paths, step)) - plain).ravel() / step * number.reference
        )
    expected = np.array(slopes) @ np.array(slopes).T
    scale = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    assert (np.diag(expected) > 0).all()
    np.testing.assert_allclose(found / scale, expected / scale, atol=2e-3)


def test_standard_errors_are_those_of_estimates() -> None:
    """A fit of simulated recordings scatters as foretold: cover and base friction of the small finger."""
    bias = {"drift_variance": 0.0, "noise_std": 0.02, "noise_time": 0.02, "initial_variance": 1e6, "forget_rate": 2.0}
    data = {**SMALL, "bias": bias}
    samples, numbers = small_samples(data), friction_numbers(SMALL)
    chosen = [k for k, number in enumerate(numbers) if number.path.startswith("joints[1]")]
    force = np.abs(samples["tendon_force"]).mean(axis=1)
    changes = np.concatenate(list(sensitivities(finger_of(data), numbers, samples)))[:, :, chosen]
    known = information([changes.copy()], samples["time"], force, noise_of(data, 0.02))
    columns = np.column_stack([changes[:, 0], np.ones(len(changes))])  # and a constant bias
    random = np.random.default_rng(5)
    estimates = [
        np.linalg.lstsq(columns, columns[:, :-1].sum(axis=1) + random.normal(0, 0.02, len(columns)), rcond=None)[0][:-1]
        for _ in range(400)
    ]
    np.testing.assert_allclose(np.std(estimates, axis=0), np.sqrt(np.diag(np.linalg.inv(known))), rtol=0.12)


@pytest.mark.parametrize(
    ("ranges", "part", "expected"),
    [
        (
            ("base=0.1:0.6", "tip=-0.4:0.4"),
            "edge_friction[2].laws[1]",
            "joint 1 never comes near working point 1 at -0.5 rad",
        ),
        (("base=0.2:0.2", "tip=-0.4:0.4"), "joints[1].friction", "never slides: always within v_min = 0.01"),
        (("base=0.2:0.2", "tip=-0.4:0.4"), "joints[1].cover", None),
    ],
)
def test_reasons_name_what_the_motion_lacks(
    small_file: Path, ranges: tuple[str, ...], part: str, expected: str | None
) -> None:
    entries = [entry for entry in small_report(small_file, *ranges)["parameters"] if part in entry["path"]]
    assert (
        {entry["reason"] for entry in entries} == {expected} if expected else {"noise"} == {e["cause"] for e in entries}
    )


def test_slower_than_the_threshold_or_noisier_identifies_less(small_file: Path) -> None:
    slow = small_report(small_file, "base=-0.05:0.05", "tip=-0.01:0.01", max_speed=0.009)
    assert {e["cause"] for e in slow["parameters"] if "friction" in e["path"]} == {"side"} and slow["identifiable"] == 0
    counts = []
    for noise in (0.001, 0.01, 0.1):
        small_file.write_text(json.dumps({**SMALL, "bias": {"noise_std": noise}}))
        counts.append(small_report(small_file, "tip=-0.4:0.4")["known_combinations"])
    assert counts[0] > counts[1] > counts[2]


def small_report(small_file: Path, *ranges: str, **plan: Any) -> dict[str, Any]:
    subject = read_subject(small_file)
    found = find_ranges(subject, ranges)
    return report(excite(subject, found, Plan(as_array(found), **{"duration": 60, **plan})), "tendonfmu excite")


def test_asymmetric_laws_have_numbers_for_each_side(small_file: Path) -> None:
    paths = {e["path"] for e in small_report(small_file)["parameters"]}
    assert {f"tendons[1].edge_friction[1].{side}.coulomb" for side in ("positive", "negative")} <= paths
    assert "tendons[1].edge_friction[1].negative.viscous" in paths
    assert "tendons[1].edge_friction[1].positive.viscous" not in paths
