"""What the FMUs compute is what the core and the simulated finger compute, bit by bit, in both versions of FMI.

That the core and the FMU agree with the independent implementation: test_reference_traces.py here, and model/.
"""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from fmu_binary import FINGER, OK, SOURCE, Instance, UnpackedFmu, motion, unpack
from fmu_kinds import declared_dependencies, friction_kind
from plant_fmu_rig import SEED, play
from plant_rigs import needs_plant
from random_fingers import Recording, random_case
from repetitions import repeated
from repository_paths import ROOT, TESTS
from tendonfmu.fmu import build_fmu, run_fmu
from tendonfmu.model import native
from tendonfmu.recordings import read_recording

Array = NDArray[np.float64]


# --- outputs ----------------------------------------------------------------------------------------------------------


def test_a_recording_gives_the_same_columns_in_both_versions(tmp_path: Path) -> None:
    finger = ROOT / "examples" / "fingers" / "index_finger.json"
    recording = read_recording(TESTS / "reference" / "index_finger_in.csv")
    fmus = [build_fmu(finger, tmp_path / f"{fmi}.fmu", fmi=fmi) for fmi in (2, 3)]
    two, three = (run_fmu(fmu, recording) for fmu in fmus)
    assert list(two) == list(three) and len(two) > 20
    for name, column in two.items():
        assert column.dtype == three[name].dtype and column.tobytes() == three[name].tobytes(), name
    assert len(np.unique(two["compensated_torque[1]"])) > 0.9 * len(recording)  # it moves


def test_all_outputs_that_there_may_be(tmp_path: Path) -> None:
    """Force at the tip, link of a contact (an Int32), level of contact, faults of sensors."""
    description = FINGER | {
        "links": [{"axis": [0, 0, 1]}, {"axis": [0, 0, 1], "offset": [0.05, 0, 0]}],
        "tip": [0.04, 0, 0],
        "contact": {"threshold": [0.03, 0.02], "method": "bands", "bands": [{"noise": [0.01, 0.01]}] * 4},
        "sensor_fault": {},
    }
    rows = []
    for fmi in (2, 3):
        fmu = unpack(build_fmu(description, tmp_path / f"{fmi}.fmu", fmi=fmi), tmp_path / str(fmi))
        names = [name for kind in ("Float64", "Boolean", "Int32") for name in fmu.names("output", kind)]
        assert {"contact_observable", "contact_level[2]", "fingertip_force[3]", "contact_link"} <= set(names)
        with Instance(fmu) as instance:
            instance.initialise(motion(fmu, 0.0))
            rows.append([])
            for k in range(400):
                assert instance.write(motion(fmu, 0.005 * k, k // 100)) == instance.step(0.005 * k, 0.005) == OK
                rows[-1].append(instance.read(names))
    assert rows[0] == rows[1]
    assert len({row[names.index("contact_link")] for row in rows[0]}) > 1


def inputs_at(recording: Recording, k: int) -> dict[str, float]:
    return {
        f"{name}[{i + 1}]": float(value)
        for name, series in recording.items()
        if name != "time"
        for i, value in enumerate(series[k])
    }


@pytest.mark.parametrize(
    ("seed", "source", "fmi"), repeated([(601, 1, 2), (605, 2, 3), (603, 3, 2), (612, 1, 3), (616, 1, 2)], 0, 1, 2)
)
def test_the_fmu_is_the_native_finger(seed: int, source: int, fmi: int, tmp_path: Path) -> None:
    """With `extensions`: outputs, directional derivatives, declared dependencies; with a saved state in another one."""
    samples = 60
    description, recording = random_case(seed, samples, extensions=True)
    fmu = unpack(build_fmu(description, tmp_path / "finger.fmu", fmi=fmi), tmp_path / "unpacked")
    time, names = recording["time"].tolist(), fmu.names("output")
    finger = native.Instance.from_description(description, source)
    with Instance(fmu) as instance, Instance(fmu) as other:
        assert instance.write({SOURCE: source}) == OK
        instance.initialise(inputs_at(recording, 0), time[0])
        for k in range(samples):
            expected = finger.run({name: series[k : k + 1] for name, series in recording.items()})
            step = time[k + 1] - time[k] if k + 1 < samples else 0.001
            if k == 23:
                other.initialise()
                assert other.restore(instance.save()) == OK
            for one in (instance, other) if k >= 23 else (instance,):
                assert one.write(inputs_at(recording, k)) == one.step(time[k], step) == OK, one.last_message
                shown = dict(zip(names, one.read(names), strict=True))
                for name, value in shown.items():
                    group, _, index = name.rstrip("]").partition("[")
                    assert value == np.ravel(expected[group][0])[int(index or 1) - 1], name
            if k % 8 == 1:
                compare_slopes(instance, finger)


def compare_slopes(instance: Instance, finger: native.Instance) -> None:
    """Directional derivatives have the bits of the C interface, and are 0 where no dependency is declared."""
    fmu = instance.fmu
    outputs, inputs = with_derivatives(fmu), fmu.names("input")
    found, declared = jacobian(instance, outputs, inputs), declared_dependencies(fmu.folder)
    for column, name in enumerate(inputs):
        group, index = name.rstrip("]").split("[")
        count = sum(each.startswith(f"{group}[") for each in inputs)
        slopes = finger.directional_derivative({group: np.eye(count)[int(index) - 1]})
        expected = [slopes[o.split("[")[0]][int(o.rstrip("]").split("[")[1]) - 1] for o in outputs]
        np.testing.assert_array_equal(found[:, column], expected)
        for output, slope in zip(outputs, found[:, column], strict=True):
            assert not slope or fmu.place(name)[0] in declared[fmu.place(output)[0]], (output, name)


# --- derivatives ------------------------------------------------------------------------------------------------------


def with_derivatives(fmu: UnpackedFmu) -> list[str]:
    """The outputs that are numbers but for discrete ones."""
    return [name for name in fmu.names("output") if fmu.variables[fmu.place(name)[0]].variability == "continuous"]


def derive(instance: Instance, name: str, unknowns: list[str], knowns: list[str], seed: list[float]) -> list[float]:
    """A derivative of whole variables. name: Directional or Adjoint."""
    count = instance.fmu.count(unknowns if name == "Directional" else knowns)
    status, found = instance.derive(name, unknowns, knowns, seed, count)
    assert status == OK, instance.last_message
    return list(found)


def jacobian(instance: Instance, outputs: list[str], inputs: list[str]) -> Array:
    """Derivatives of all elements by all elements; both lists hold whole arrays."""
    unknowns, knowns = instance.fmu.whole(outputs), instance.fmu.whole(inputs)
    unit = np.eye(len(inputs))
    return np.array([derive(instance, "Directional", unknowns, knowns, row) for row in unit.tolist()]).T


@pytest.mark.parametrize("source", [1, 2, 3])
@pytest.mark.parametrize("state", "ms")
def test_both_versions_derive_the_same(
    small_fmu: UnpackedFmu, small_fmu3: UnpackedFmu, source: int, state: str
) -> None:
    """Directional ones have the same bits; adjoint ones are the transposed Jacobian times the seed."""
    outputs, inputs = with_derivatives(small_fmu), small_fmu.names("input")
    found = []
    with Instance(small_fmu) as two, Instance(small_fmu3) as three:
        for instance in (two, three):
            assert instance.write({SOURCE: source}) == instance.enter_initialisation() == OK
            assert instance.write(motion(small_fmu, 0.0)) == OK
            if state == "s":
                assert instance.call("ExitInitializationMode") == OK
                friction_kind(instance.fmu).advance(instance, 1, 20)
            before = instance.save()
            found.append(jacobian(instance, outputs, inputs))
            assert instance.save() == before
        j = found[0]
        assert j.tobytes() == found[1].tobytes() and np.abs(j).max() > 1e-3
        weights = np.random.default_rng(1).normal(size=len(j))
        adjoint = derive(three, "Adjoint", small_fmu3.whole(outputs), small_fmu3.whole(inputs), weights.tolist())
        # sums of 30 products in another order: rounding only
        np.testing.assert_allclose(adjoint, j.T @ weights, rtol=0, atol=1e-14 * np.abs(j).sum() * np.abs(weights).max())


def test_derivatives_in_initialisation_mode(small: UnpackedFmu) -> None:
    """joint_torque = transposed moment arms times forces; the first of two tendons that a joint has."""
    arms = [[0.009, -0.008, 0.005], [0.007, -0.006, -0.004]]
    forces, torques = [f"tendon_force[{i}]" for i in (1, 2, 3)], ["joint_torque[1]", "joint_torque[2]"]
    with friction_kind(small).brought_to("m") as instance:
        np.testing.assert_allclose(jacobian(instance, torques, forces), arms, rtol=1e-15)


def test_repeated_arrays(small_fmu3: UnpackedFmu) -> None:
    """The same known twice: the directions add up, as in FMI 2.0."""
    force, torque = ["tendon_force"], ["joint_torque"]
    with Instance(small_fmu3) as instance:
        instance.initialise()
        once = derive(instance, "Directional", torque, force, [1.0, 2.0, 3.0])
        twice = derive(instance, "Directional", torque * 2, force * 2, [0.0, 2.0, 3.0, 1.0, 0.0, 0.0])
        assert twice == once * 2 and any(once)


def test_a_step_at_the_same_time_leaves_parameters_to_the_next_sample(small: UnpackedFmu) -> None:
    """The derivatives too stay those of the sample taken."""
    speeds = ["joint_velocity[1]", "joint_velocity[2]"]
    moving = {**motion(small, 0.0), **dict.fromkeys(speeds, 1.0)}
    with Instance(small) as instance:
        assert instance.write({SOURCE: 3}) == OK
        instance.initialise(moving)
        assert instance.write(moving) == instance.step(0.005) == OK

        def slope() -> float:
            return float(jacobian(instance, ["friction_torque[1]", "friction_torque[2]"], speeds)[0, 0])

        before = slope()
        assert instance.write({"joints[1].friction.viscous": 5.0}) == OK
        assert instance.step(0.005) == OK and slope() == before
        assert instance.step(0.006) == OK and slope() != before


# --- the simulated finger ---------------------------------------------------------------------------------------------


@needs_plant
def test_the_fmu_is_the_plant(plant_fmu: UnpackedFmu) -> None:
    """Every output against the Python binding, sensors and truth, to the bit."""
    from tendonfmu.simulate.plant import Plant
    from tendonfmu.simulate.rig import read_rig

    plant = Plant(read_rig(plant_fmu.folder.parent / "rig.json").json())
    plant.initialise()
    expected = plant.run(np.arange(1, 301) / 1000)
    names, rows = plant_fmu.names("output"), []
    with Instance(plant_fmu) as instance:
        instance.initialise()
        for k in range(300):
            assert instance.step(k * 0.001) == OK
            rows.append(instance.read(names))
    moved = 0
    for name, column in zip(names, np.array(rows).T, strict=True):
        group, _, index = name.partition("[")
        signal = group.removeprefix("truth.") if group.startswith("truth.") else f"measured_{group}"
        array = expected[signal].reshape(300, -1)
        np.testing.assert_array_equal(column, array[:, int(index[:-1]) - 1 if index else 0], name)
        moved += bool(np.ptp(column) > 0.0)
    assert moved > 30


@needs_plant
def test_steps_of_any_length_agree_within_the_tolerance(plant_fmu: UnpackedFmu) -> None:
    """The truth at 0.6 s by 1 ms, 10 ms, 1/60 s, uneven and one single step."""
    truth = [n for n in plant_fmu.names("output") if n.startswith(("truth.joint_position", "truth.tendon_force"))]
    ends = []
    uneven = [0.0, 0.013, 0.013 + 1e-9, 0.2, 0.21, 0.377, 0.6]
    for times in (np.arange(601) * 1e-3, np.arange(61) * 1e-2, np.arange(37) / 60, uneven, [0.0, 0.6]):
        with Instance(plant_fmu) as instance:
            instance.initialise()
            for now, then in pairwise(times):
                assert instance.step(now, then - now) == OK, instance.last_message
            ends.append(instance.read(truth))
    for end in ends[1:]:
        np.testing.assert_allclose(end, ends[0], rtol=1e-4, atol=1e-5)


@needs_plant
def test_the_motors_hold_until_they_are_commanded(plant_fmu: UnpackedFmu) -> None:
    motors = [f"truth.tendon_position[{i}]" for i in range(1, 5)]
    with Instance(plant_fmu) as instance:
        assert instance.write({"scheduled_motion": 0}) == OK
        instance.initialise()
        first = instance.read(motors)
        for k in range(100):
            assert instance.step(k * 0.001) == OK
        np.testing.assert_allclose(instance.read(motors), first, rtol=0, atol=1e-9)
        goal = np.add(first, [2e-4, 0.0, 0.0, -1e-4])
        assert instance.write({f"tendon_position_command[{i + 1}]": float(x) for i, x in enumerate(goal)}) == OK
        for k in range(100, 600):
            assert instance.step(k * 0.001) == OK
        np.testing.assert_allclose(instance.read(motors), goal, rtol=0, atol=1e-7)  # commands are absolute


@needs_plant
def test_settings_act(plant_fmu: UnpackedFmu) -> None:
    names = plant_fmu.names("output")

    def run(**settings: float) -> dict[str, float]:
        with Instance(plant_fmu) as instance:
            assert instance.write(settings) == OK
            instance.initialise()
            play(instance, 280)
            return dict(zip(names, instance.read(names), strict=True))

    plain, seed = run(), run(seed=SEED + 1)
    assert plain == run(seed=SEED)
    measured = [name for name in names if not name.startswith("truth.")]
    assert {name for name in names if plain[name] != seed[name]} <= set(measured)
    assert plain["tendon_force[1]"] != seed["tendon_force[1]"]
    exact = run(sensors=0)
    assert all(exact[name] == exact[f"truth.{name}"] for name in measured)
    assert run(scheduled_pushes=0)["truth.contact_force[3]"] == 0.0 != plain["truth.contact_force[3]"]
    rough = run(relative_tolerance=1e-4)
    difference = max(abs(rough[name] - plain[name]) for name in names if name.startswith("truth.tendon_force"))
    assert 0.0 < difference < 0.1  # N
