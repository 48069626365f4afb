"""`tendonfmu simulate` and what stands behind it: recording, truth, reproducibility, failure without a trace."""

from __future__ import annotations

import os
import platform
import re
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest

from command import Call
from plant_rigs import needs_plant
from repetitions import repeated
from rig_cases import index_rig, written
from tendonfmu.files.tables import write_table
from tendonfmu.recordings.recording import read_recording
from tendonfmu.simulate import plant as binding
from tendonfmu.simulate.plant import Plant, PlantError, SolverError
from tendonfmu.simulate.rig import read_rig
from tendonfmu.simulate.simulation import ENERGIES, Simulation, simulate

pytestmark = needs_plant


def short_rig(**changes: Any) -> dict[str, Any]:
    """Two seconds of the index finger with a push, all columns."""
    data = index_rig()
    data["motion"] |= {"duration": 2.0, "still": 0.1}
    data["recording"] = {"duration": 2.0, "columns": ["joint_position", "joint_velocity", "external_torque", "contact"]}
    data["pushes"] = [{"start": 0.5, "rise": 0.1, "hold": 0.3, "fall": 0.1, "force": 1.5, "direction": [0.0, 0.0, 1.0]}]
    data["settle"] = 1.0
    return data | changes


GAVE_UP = r" at t = 0\.\d+ s \(CVODE flag -\d+\): (try|check) "


def solver_failure() -> dict[str, Any]:
    """10 kN on a lever of 10 m at a fingertip of 4 g: beyond the acceleration that counts as a motion."""
    push = {"start": 0.5, "rise": 0.01, "hold": 0.3, "fall": 0.1, "force": 1e4, "direction": [0.0, 0.0, 1.0]}
    return short_rig(pushes=[push | {"point": [10.0, 0.0, 0.0]}])


def simulated(folder: Path, data: dict[str, Any], **options: Any) -> Simulation:
    return simulate(read_rig(written(folder, data)), **options)


def group(table: dict[str, Any], name: str) -> np.ndarray:
    columns = [key for key in table if key.startswith(f"{name}[")]
    assert columns == [f"{name}[{k + 1}]" for k in range(len(columns))] and columns
    return np.column_stack([table[key] for key in columns])


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> Simulation:
    return simulated(tmp_path_factory.mktemp("short"), short_rig(), truth=True)


# --- the recording ----------------------------------------------------------------------------------------------------


def test_the_recording_is_one_of_the_contract(call: Call, tmp_path: Path) -> None:
    answer = call("simulate", written(tmp_path, short_rig()), "-o", "rec.parquet")
    assert (answer.status, answer.out) == (0, "")
    assert answer.err.startswith("rec.parquet: 1000 samples, 1.998 s of index_finger, 1 push, 0.4")
    recording = read_recording("rec.parquet")
    recording.require(4, 8, ("joint_position", "joint_velocity", "external_torque"))
    assert np.array_equal(recording.time, np.arange(1000) / 500)
    assert recording.contact is not None and 200 < recording.contact.sum() < 250
    assert sorted(file.name for file in tmp_path.iterdir()) == ["rec.parquet", "rig.json"]
    first = Path("rec.parquet").read_bytes()
    assert call("simulate", tmp_path / "rig.json", "-o", "rec.parquet").status == 0
    assert Path("rec.parquet").read_bytes() == first


def test_sensors_stand_between_truth_and_recording(result: Simulation) -> None:
    """Noise and steps as the rig has them, at the sample's own time: nothing is late."""
    assert result.truth is not None
    for name, noise, step in (
        ("tendon_force", 3e-3, 2e-3),
        ("tendon_position", 0.0, 2e-6),
        ("joint_position", 2e-4, 2e-4),
    ):
        measured = group(result.recording, name)
        error = measured - group(result.truth, name)
        expected = np.hypot(noise, step / np.sqrt(12.0))
        assert np.abs(error.std() / expected - 1.0) < 0.05, name
        assert np.abs(error.mean()) < 5 * expected / np.sqrt(error.size), name
        assert np.allclose(measured / step, np.round(measured / step), atol=1e-6), name
    assert np.array_equal(group(result.recording, "joint_velocity"), group(result.truth, "joint_velocity"))


def test_the_truth_is_whole_and_consistent(result: Simulation) -> None:
    truth = result.truth
    assert truth is not None
    assert next(iter(truth)) == "time" and set(ENERGIES) < set(truth)
    assert {len(column) for column in truth.values()} == {1000}
    arms = np.array([tendon["moment_arms"] for tendon in index_rig()["finger"]["tendons"]])
    torque = group(truth, "joint_torque")
    assert np.allclose(torque, group(truth, "tendon_force") @ arms, atol=1e-12)
    parts = [group(truth, f"{name}_torque") for name in ("external", "inertial", "stop", "friction")]
    assert np.allclose(torque, sum(parts), atol=1e-12)
    force = np.linalg.norm(group(truth, "contact_force"), axis=1)
    assert np.array_equal(truth["contact"], force > 0.05) and abs(force.max() - 1.5) < 1e-9
    assert np.abs(group(truth, "external_torque")[~truth["contact"]]).max() < 0.05 * 0.1
    balance = truth["kinetic_energy"] + truth["potential_energy"] + truth["friction_work"] + truth["damping_work"]
    balance = balance - truth["motor_work"] - truth["push_work"]
    assert np.ptp(balance) < 1e-4 * np.ptp(truth["friction_work"])


# --- reproducibility --------------------------------------------------------------------------------------------------


@pytest.mark.long
@pytest.mark.skipif(
    not sys.platform.startswith("linux") or platform.machine() != "x86_64",
    reason="SAME NUMBERS ON ANOTHER PROCESSOR NOT TESTED: the C library of x86-64 Linux can be told to do without FMA",
)
@pytest.mark.parametrize("tolerance", repeated([1e-6, 1e-4], 0))
def test_the_processor_shows_within_the_tolerance_only(tolerance: float, tmp_path: Path) -> None:
    """CVODE takes its step sizes by pow(), whose last bit differs between processors with and without fused
    multiply-add."""
    rig = short_rig(integration={"relative_tolerance": tolerance})
    for name, environment in {"with": {}, "without": {"GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-FMA,-FMA4"}}.items():
        command = [sys.executable, "-m", "tendonfmu", "simulate", str(written(tmp_path, rig))]
        files = ["-o", f"{name}.parquet", "--truth", f"{name}_truth.parquet"]
        subprocess.run(
            [*command, *files],
            cwd=tmp_path,
            env=os.environ | environment,
            check=True,
            capture_output=True,
        )
    tables = [pq.read_table(tmp_path / f"{name}_truth.parquet").to_pydict() for name in ("with", "without")]
    for name, bound in (("joint_position", 100.0 * tolerance), ("tendon_force", 500.0 * tolerance)):  # rad, N
        np.testing.assert_allclose(*(group(table, name) for table in tables), atol=bound)


# --- failure ----------------------------------------------------------------------------------------------------------


def test_a_solver_failure_leaves_no_file(call: Call, tmp_path: Path) -> None:
    (tmp_path / "rec.parquet").write_text("what was there before")
    rig = written(tmp_path, solver_failure())
    answer = call("simulate", rig, "-o", "rec.parquet", "--truth", "truth.parquet")
    assert (answer.status, answer.out) == (2, "")
    assert len(answer.err.splitlines()) == 1
    assert answer.err.startswith(f"tendonfmu: {rig}: ") and re.search(GAVE_UP, answer.err)
    assert sorted(file.name for file in tmp_path.iterdir()) == ["rec.parquet", "rig.json"]
    assert (tmp_path / "rec.parquet").read_text() == "what was there before"


def test_the_binding_tells_solver_failures_from_bad_calls(tmp_path: Path) -> None:
    plant = Plant(read_rig(written(tmp_path, solver_failure())).json())
    plant.initialise()
    with pytest.raises(SolverError, match=GAVE_UP):
        plant.advance(2.0)
    assert plant.time == 0.0  # where it stood
    fresh = Plant(read_rig(written(tmp_path, short_rig())).json())
    with pytest.raises(PlantError) as early:
        fresh.advance(1.0)
    assert not isinstance(early.value, SolverError)


@pytest.mark.skipif(sys.platform == "win32", reason="no SIGINT for one process on Windows")
def test_ctrl_c_ends_a_long_simulation_at_once(tmp_path: Path) -> None:
    data = short_rig(recording={"duration": 20000.0})
    data["motion"]["duration"] = 20000.0
    command = [sys.executable, "-m", "tendonfmu", "simulate", str(written(tmp_path, data)), "-o", "rec.csv"]

    def take_interrupts() -> None:
        """A job in the background of a shell inherits that SIGINT is ignored."""
        signal.signal(signal.SIGINT, signal.SIG_DFL)

    with subprocess.Popen(
        [*command, "--progress"], cwd=tmp_path, stderr=subprocess.PIPE, preexec_fn=take_interrupts
    ) as process:
        assert process.stderr is not None
        process.stderr.read(1)  # the bar is drawn: it runs
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=120)  # of hours that the whole would take
    assert process.returncode == 130
    assert err.decode().splitlines()[-1].endswith("tendonfmu: interrupted; no file was left half written")
    assert [file.name for file in tmp_path.iterdir()] == ["rig.json"]


def test_bad_usage_is_refused_before_anything_runs(call: Call, tmp_path: Path) -> None:
    rig = written(tmp_path, short_rig())
    for arguments, line in (
        ("-o rec.txt", "rec.txt: unknown format '.txt'; expected .csv, .parquet or .mcap"),
        ("-o none/rec.csv", "none/rec.csv: no folder none; expected one that exists"),
        ("-o rec.csv --truth rec.csv", "rec.csv: the same file for recording and truth; expected two names"),
    ):
        answer = call("simulate", rig, *arguments.split())
        assert (answer.status, answer.err) == (2, f"tendonfmu: {line}\n")
    assert [file.name for file in tmp_path.iterdir()] == ["rig.json"]


def test_no_file_of_the_rig_is_overwritten(call: Call, tmp_path: Path) -> None:
    table = {"time": [0.0, 1.0]} | {
        f"joint_{kind}[{j}]": [0.3, 0.3] if kind == "position" else [0.0, 0.0]
        for j in range(1, 5)
        for kind in ("position", "velocity", "acceleration")
    }
    write_table("motion.csv", {name: np.array(column) for name, column in table.items()})
    data = short_rig(motion={"kind": "file", "file": "motion.csv", "pretension": 10.0})
    answer = call("simulate", written(tmp_path, data), "-o", "motion.csv")
    assert answer.status == 2 and "motion.csv: the same file as the input" in answer.err


# --- the binding ------------------------------------------------------------------------------------------------------


@pytest.fixture
def plant(tmp_path: Path) -> Plant:
    return Plant(read_rig(written(tmp_path, short_rig())).json())


def test_settings_read_back_and_are_checked(plant: Plant) -> None:
    before = plant.settings
    assert (before.relative_tolerance, before.seed, before.push_link) == (1e-6, 1, 4)
    plant.configure(relative_tolerance=1e-4, seed=2**53, push_point=(0.0, 0.0, 0.01), push_link=2)
    after = plant.settings
    assert (after.relative_tolerance, after.seed) == (1e-4, 2**53)
    assert (after.push_point, after.push_link) == ((0.0, 0.0, 0.01), 2)
    with pytest.raises(PlantError):
        plant.configure(push_link=9)
    plant.initialise()
    with pytest.raises(PlantError):
        plant.configure(relative_tolerance=1e-3)


def test_signals_have_their_shapes(plant: Plant) -> None:
    plant.initialise()
    assert (plant.time, plant.initialised) == (0.0, True)
    found = plant.run(np.array([0.0, 0.01, 0.02]))
    assert set(found) == set(binding.SIGNALS)
    assert found["tendon_force"].shape == (3, 8) and found["joint_position"].shape == (3, 4)
    assert found["contact_point"].shape == (3, 3) and found["energy"].shape == (3, 6)
    assert found["contact"].shape == found["friction_level"].shape == (3,)
    assert found["contact"].dtype == found["slack"].dtype == bool
    assert plant.time == 0.02 and plant.statistics.steps > 0
    with pytest.raises(PlantError, match="no signal torque"):
        plant.run(np.array([0.03]), ["torque"])
    with pytest.raises(PlantError):
        plant.run(np.array([0.01]))


def test_inputs_act_and_states_come_back(plant: Plant) -> None:
    plant.configure(scheduled_motion=False, scheduled_pushes=False, sensors=False)
    plant.initialise()
    hold = plant.hold_command()
    assert hold.shape == (8,)
    plant.set_inputs(hold)
    still = plant.run(np.array([0.2]))["joint_position"][0]
    state = plant.save_state()
    plant.set_inputs(hold, push_force=(0.0, 0.0, 1.0))
    pushed = plant.run(np.array([0.4]))
    assert np.abs(pushed["joint_position"][0] - still).max() > 1e-3 and pushed["contact"][0]
    plant.restore_state(state)
    assert plant.time == 0.2
    assert np.array_equal(plant.run(np.array([0.2]))["joint_position"][0], still)
    with pytest.raises(PlantError):
        plant.restore_state(state[:-1])
    with pytest.raises(PlantError, match="one command per tendon"):
        plant.set_inputs([0.0])
    plant.reset()
    assert not plant.initialised
