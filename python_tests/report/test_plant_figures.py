"""The figures of docs/reference/simulated_finger.md: drawn to the rig's numbers, computed from what the plant does."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from plant_figures import (
    PreslidingFigure,
    bristle_numbers,
    led,
    model_friction,
    presliding_figure,
    truth_figure,
)
from rig_drawing import GAP, rig_drawing

from plant_rigs import needs_plant
from repository_paths import ROOT
from tendonfmu.simulate.rig import Rig, read_rig

RIGS = ROOT / "examples" / "rigs"
JOINT, TENDON = 1, 4


@pytest.fixture(scope="module")
def rig() -> Rig:
    return read_rig(RIGS / "index_finger.json")


@pytest.fixture(scope="module")
def presliding(rig: Rig) -> PreslidingFigure:
    return presliding_figure(rig, JOINT, TENDON)


def test_the_drawing_is_to_scale(rig: Rig) -> None:
    """Links of their lengths, each tendon at the distance of its moment arm, below where it flexes."""
    drawing = rig_drawing(rig.expanded)
    assert [(body.begin, body.end) for body in drawing.bodies] == [(0.0, 45.0), (45.0, 73.0), (73.0, 95.0)]
    np.testing.assert_allclose([body.radius for body in drawing.bodies], [9.0, 8.0, 7.0], atol=0.05)
    for route, tendon in zip(drawing.side.routes, rig.finger.data["tendons"], strict=True):
        arms = 1e3 * np.array(tendon["moment_arms"])
        assert route.flexor == (arms[1] > 0.0) == ("flexor" in route.name)
        for (_, x), arm in zip(drawing.side.joints, arms[1:], strict=True):
            if arm != 0.0:
                drawn = np.interp(x, route.line[:, 0], route.line[:, 1])
                assert drawn == pytest.approx(-arm, abs=GAP) and drawn * arm < 0.0
    for route, tendon in zip(drawing.top.routes, rig.finger.data["tendons"], strict=True):
        drawn = np.interp(0.0, route.line[:, 0], route.line[:, 1])
        assert drawn == pytest.approx(1e3 * tendon["moment_arms"][0], abs=GAP)


def test_every_law_along_a_tendon_has_its_mark(rig: Rig) -> None:
    for route, tendon in zip(rig_drawing(rig.expanded).side.routes, rig.finger.data["tendons"], strict=True):
        edges = [edge for edge in tendon["edge_friction"] if edge]
        assert len(route.pulleys) == sum(pulley is not None for pulley in tendon["pulley_friction"])
        assert len(route.varying_edges) == sum("angles" in edge for edge in edges)
        assert len(route.edges) + len(route.varying_edges) == len(edges)


@pytest.mark.long
@needs_plant
def test_the_bristles_are_those_named(rig: Rig, presliding: PreslidingFigure) -> None:
    """After a reversal w = −1 + 2 exp(−angle/d): the joint by its own distance, pulley and edge over this tendon's
    moment arm, a little earlier since the joints beyond move as well."""
    arm = rig.finger.data["tendons"][TENDON]["moment_arms"][JOINT]
    expected = {"pulley": (25e-6 / arm, 0.15), "edge": (40e-6 / arm, 0.15), "joint": (0.004, 0.02)}
    assert [contact.label.split(":")[0] for contact in presliding.contacts] == list(expected)
    for contact, (distance, tolerance) in zip(presliding.contacts, expected.values(), strict=True):
        bending = (contact.bristle < 0.9) & (contact.bristle > -0.3)
        slope = np.polyfit(contact.angle[bending], np.log1p(contact.bristle[bending]), 1)[0]
        assert -1.0 / slope == pytest.approx(distance, rel=tolerance)
    assert set(bristle_numbers(rig, JOINT, TENDON)) == {"pulley", "edge", "joint"}


@needs_plant
def test_the_model_sees_the_led_joint_alone(rig: Rig) -> None:
    signals = led(rig, JOINT, ((0.0, 0.35), (0.4, 0.4)), 10.0)
    other = np.array(signals["joint_velocity"])
    other[:, 0] += 1.0
    np.testing.assert_array_equal(
        model_friction(rig, JOINT, signals), model_friction(rig, JOINT, signals | {"joint_velocity": other})
    )


@needs_plant
def test_the_truth_of_a_part_of_a_recording() -> None:
    """20 to 36 s of the rig with pushes: three of the four turn the joint, and the labels are where the pushes are."""
    figure = truth_figure(read_rig(RIGS / "index_finger_pushes.json"), JOINT, 20.0, 36.0)
    assert (figure.time[0], figure.time[-1]) == (20.0, 36.0) and figure.forces.shape == (8001, 8)
    assert sum(figure.flexors) == 4
    largest = [
        np.abs(figure.torques["external torque"][(figure.time >= begin) & (figure.time < end)]).max()
        for begin, end in figure.contacts
    ]
    assert [value > 0.03 for value in largest] == [True, False, True, True]
    rest = figure.torques["joint torque"] - figure.torques["friction"] - figure.torques["external torque"]
    assert np.abs(rest).max() < 0.012  # gravity


@needs_plant
@pytest.mark.long
def test_the_script_makes_the_figures_of_the_page(tmp_path: Path) -> None:
    subprocess.run([sys.executable, RIGS / "make_figures.py", "-o", tmp_path], check=True)
    page = (RIGS.parents[1] / "docs" / "reference" / "simulated_finger.md").read_text(encoding="utf-8")
    made = sorted(path.name for path in tmp_path.iterdir())
    assert made and all(f"](../figures/{name})" in page for name in made)
    for name in made:
        assert 20_000 < (tmp_path / name).stat().st_size < 200_000
        assert (RIGS.parents[1] / "docs" / "figures" / name).is_file()
