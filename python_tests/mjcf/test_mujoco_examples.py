"""examples/mujoco: the finger that loses force by the core, its recordings, the servo's log, a public model."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from optional_parts import require

require("mujoco")

from command import Call
from repository_paths import ROOT
from tendonfmu.mjcf.finger_import import ImportSettings, import_finger
from tendonfmu.model.description import read_finger
from tendonfmu.recordings.match import belongs
from tendonfmu.recordings.recording import read_recording

EXAMPLE = ROOT / "examples" / "mujoco"


@pytest.fixture(autouse=True)
def scripts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(EXAMPLE))


def test_the_descriptions_have_the_model_s_routing() -> None:
    found = import_finger(EXAMPLE / "finger.xml", ImportSettings(joints=("mcp", "pip"), tip="fingertip", gravity=True))
    assert found.warnings == []
    for name in ("losses", "finger_calibrated"):
        data = read_finger(EXAMPLE / f"{name}.json").data
        for own, drawn in zip(data["tendons"], found.data["tendons"], strict=True):
            assert (own["name"], own["stiffness"], own["moment_arms"]) == (
                drawn["name"],
                drawn["stiffness"],
                drawn["moment_arms"],
            )


def test_the_core_takes_force_from_the_tendons() -> None:
    """In steady motion the torque at the joints is Rᵀ f0 less the losses of losses.json, by the laws themselves."""
    import tendon_finger

    finger = tendon_finger.TendonFinger()
    description = json.loads(tendon_finger.LOSSES.read_text(encoding="utf-8"))
    for k in range(400):
        finger.step(finger.motors_for(np.array([0.2 + 1e-3 * k, 0.2])))
    force, velocity, applied = finger.tension(), finger.data.qvel.copy(), finger.data.qfrc_applied.copy()
    lost = 0.0  # at mcp, where only the friction before the first joint acts and all tendons slide fast
    for i, tendon in enumerate(description["tendons"]):
        law = tendon["edge_friction"][0]
        slide = float(finger.arms[i] @ velocity)
        size = law["coulomb"] + (law["static"] - law["coulomb"]) * np.exp(-abs(slide) / law["stribeck_velocity"])
        lost += finger.arms[i, 0] * force[i] * size * np.sign(slide)
    assert velocity[0] > 0.8 and -applied[0] == pytest.approx(lost, rel=0.15) and lost > 0.01


@pytest.mark.long
@pytest.mark.slow
def test_compensation_holds_the_force_closer() -> None:
    import press

    description = json.loads((EXAMPLE / "finger_calibrated.json").read_text(encoding="utf-8"))
    hold = 2.5
    rms = {}
    for way in press.WAYS[:2]:
        run = press.press(way, description, hold=hold)
        part = (run.time > press.WARM_UP + hold / 2) & (run.time < press.WARM_UP + hold)
        rms[way] = np.sqrt(np.mean((run.true[part] - press.WANTED[0]) ** 2))
        assert run.true.max() > 0.3
    assert rms[press.WAYS[0]] < 0.15 and rms[press.WAYS[0]] < 0.5 * rms[press.WAYS[1]]


def test_a_recording_belongs_to_the_finger(tmp_path: Path) -> None:
    file = tmp_path / "free.parquet"
    subprocess.run([sys.executable, EXAMPLE / "record.py", "-o", file, "--seconds", "4"], check=True)
    recording = read_recording(file)
    assert len(recording.time) == pytest.approx(4000, abs=2)
    assert list(belongs(read_finger(EXAMPLE / "finger_calibrated.json"), [recording])) == []


def test_edges_are_added_where_a_tendon_turns_a_joint(tmp_path: Path, call: Call) -> None:
    assert call("import", "mjcf", EXAMPLE / "finger.xml", "--joints", "mcp,pip", "-o", "finger.json").status == 0
    command = [sys.executable, EXAMPLE / "add_edges.py", "finger.json", "-o", "start.json"]
    subprocess.run(command, cwd=tmp_path, check=True)
    edges = [tendon["edge_friction"] for tendon in read_finger(tmp_path / "start.json").data["tendons"]]
    assert [[edge is not None for edge in row] for row in edges] == [[True, True], [True, False]] * 2


def test_the_servo_s_log_goes_through_the_map(tmp_path: Path, call: Call) -> None:
    """Degrees, milliseconds and N·cm: the description that `convert` writes has the servo's friction within 5 %."""
    subprocess.run(
        [sys.executable, EXAMPLE / "servo_log.py", "-o", tmp_path / "servo.csv", "--seconds", "20"], check=True
    )
    lines = (tmp_path / "servo.csv").read_text(encoding="utf-8").splitlines()
    assert lines[0].split(";")[3:5] == ["Position (deg)", "Load (N.cm)"] and len(lines) == 4001
    options = ("--map", EXAMPLE / "servo_map.json", "-o", "servo.parquet", "--finger", "servo.json")
    assert call("convert", "table", "servo.csv", *options).status == 0
    law = read_finger(tmp_path / "servo.json").data["joints"][0]["friction"]
    assert law["coulomb"] == pytest.approx(0.15, rel=0.05) and law["viscous"] == pytest.approx(0.04, rel=0.15)
