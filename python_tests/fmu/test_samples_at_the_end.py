"""`build --sample-at end`: a step takes the inputs as they stand as the sample at its end."""

from __future__ import annotations

import json
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pandas as pd
import pytest

import tendonfmu as tf
from command import run_script
from fmu_binary import DISCARD, ERROR, FINGER, OK, Instance, UnpackedFmu, motion, unpack
from fmu_kinds import friction_kind
from repository_paths import ROOT

REFERENCE = ROOT / "python_tests" / "reference"
DEMO = ROOT / "examples" / "demo_recording"
STEP = 1 / 1024  # s, exact in binary: however times are added up, they are the same


@pytest.fixture(scope="module", params=[2, 3], ids=["fmi2", "fmi3"])
def at_end_path(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("at_end")
    (folder / "finger.json").write_text(json.dumps(FINGER))
    return tf.build(folder / "finger.json", folder / "small_finger.fmu", fmi=request.param, sample_at="end")


@pytest.fixture(scope="module")
def at_end(at_end_path: Path) -> UnpackedFmu:
    return unpack(at_end_path, at_end_path.parent / "unpacked")


@pytest.fixture
def at_begin(at_end: UnpackedFmu, request: pytest.FixtureRequest) -> UnpackedFmu:
    fmu: UnpackedFmu = request.getfixturevalue("small_fmu" if at_end.version == 2 else "small_fmu3")
    return fmu


def test_the_model_description_says_it(at_end_path: Path, small_fmu_path: Path) -> None:
    of_end, of_begin = (fmpy.read_model_description(str(path), validate=True) for path in (at_end_path, small_fmu_path))
    assert of_end.description == of_begin.description + "; a step takes the sample at its end"
    assert of_end.guid != of_begin.guid


def test_samples_are_those_of_the_ends_of_steps(at_end: UnpackedFmu, at_begin: UnpackedFmu) -> None:
    """What the other FMU gives after the step that begins there: a whole step later."""
    found, expected = [], []
    with Instance(at_end) as instance, Instance(at_begin) as other:
        for one in (instance, other):
            one.initialise(motion(at_end, 0.0), start=0.0)
        assert instance.outputs() == other.outputs()
        for k in range(1, 300):
            inputs = motion(at_end, k * STEP)
            assert instance.write(inputs) == OK and instance.step((k - 1) * STEP, STEP) == OK
            assert other.write(inputs) == OK and other.step(k * STEP, STEP) == OK
            found.append(instance.outputs())
            expected.append(other.outputs())
    assert found == expected


def test_a_run_gives_the_same_bits(at_end_path: Path, at_end: UnpackedFmu) -> None:
    """Also where steps vary and times are not exact in binary."""
    chance = np.random.default_rng(1)
    time = np.cumsum(chance.uniform(1e-4, 3e-3, 700)) - 0.3
    values = [motion(at_end, t) for t in time]
    frame = {"time": time} | {name: np.array([row[name] for row in values]) for name in values[0]}
    recording = tf.Recording.from_frame(pd.DataFrame(frame))
    for source in (1, 2, 3):
        found = tf.run(at_end_path, recording, kinematics=source).frame
        assert found.equals(tf.run(FINGER, recording, kinematics=source).frame)


def test_without_inputs_the_first_step_takes_the_first_sample(at_end: UnpackedFmu, at_begin: UnpackedFmu) -> None:
    with Instance(at_end) as instance, Instance(at_begin) as other:
        instance.initialise()
        other.initialise(motion(at_end, 1.0), start=1.0)
        assert instance.write(motion(at_end, 1.0)) == OK and instance.step(0.5, 0.5) == OK
        assert instance.outputs() == other.outputs()
        assert instance.write(motion(at_end, 1.5)) == other.write(motion(at_end, 1.5)) == OK
        assert instance.step(1.0, 0.5) == other.step(1.5, 0.5) == OK
        assert instance.outputs() == other.outputs()


def test_a_discarded_step_is_repeated(at_end: UnpackedFmu) -> None:
    rows = []
    for spoilt in (True, False):
        with Instance(at_end) as instance:
            instance.initialise(motion(at_end, 0.0))
            for k in range(1, 20):
                if spoilt:
                    assert instance.write({"tendon_force[1]": float("nan")}) == OK
                    before = instance.save()
                    assert instance.step((k - 1) * STEP, STEP) == DISCARD and instance.save() == before
                    assert f"tendon_force[1] = nan at time {k * STEP!r} s" in instance.last_message
                assert instance.write(motion(at_end, k * STEP)) == OK and instance.step((k - 1) * STEP, STEP) == OK
            rows.append((instance.outputs(), instance.save()))
    assert rows[0] == rows[1]


def test_times_that_are_refused(at_end: UnpackedFmu) -> None:
    with Instance(at_end) as instance:
        instance.initialise(motion(at_end, 0.0))
        assert instance.step(0.0, 1.0) == OK
        saved = instance.save()
        for point, length, expected in (
            (0.25, 0.5, "expected a step that does not end before the sample already taken"),
            (1.0, 1e16, "expected a step that ends at a magnitude of at most 1e15 s"),
            (1.0, 0.0, "expected a finite communicationStepSize above 0 s"),
        ):
            assert instance.step(point, length) == ERROR and expected in instance.last_message
            assert instance.restore(saved) == OK
        shown = instance.outputs()
        assert instance.write(motion(at_end, 0.3)) == OK
        assert instance.step(0.5, 0.5) == OK and instance.outputs() == shown  # the sample already taken


def test_saved_states_are_of_their_own_kind(at_end: UnpackedFmu, at_begin: UnpackedFmu) -> None:
    with Instance(at_end) as instance, Instance(at_end) as other, friction_kind(at_begin).brought_to("s") as begin:
        instance.initialise(motion(at_end, 0.0))
        assert instance.step(0.0, STEP) == OK
        saved = instance.save()
        assert other.restore(saved) == OK
        for one in (instance, other):
            assert one.write(motion(at_end, 2 * STEP)) == OK and one.step(STEP, STEP) == OK
        assert instance.outputs() == other.outputs() and instance.save() == other.save()
        assert begin.restore(saved) == ERROR and "state of another FMU" in begin.last_message


@pytest.mark.parametrize("fmi", [2, 3])
def test_the_reference_is_that_of_a_client_that_knows_nothing(tmp_path: Path, fmi: int) -> None:
    """It hands over the inputs of a step's beginning, which are then one step late."""
    recording = REFERENCE / "asymmetric_pair_in.csv"
    finger = REFERENCE / "asymmetric_pair.json"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", tf.InputWarning)
        fmu = tf.build(finger, tmp_path / "pair.fmu", reference=recording, fmi=fmi, sample_at="end")
    done = run_script(ROOT / "examples" / "ci_reference_check" / "check_reference.py", fmu)
    assert done.status == 0 and " 0 of 24 variables differ" in done.out, done.out + done.err


# --- what it costs in delay -------------------------------------------------------------------------------------------


def onset(fmu: UnpackedFmu, signals: Mapping[str, Any], *, inputs_of_the_end: bool) -> float:
    """Time (s) at which a master sees the first contact; it hands over the inputs of a step's begin or end."""
    names, time = fmu.names("input"), signals["time"]

    def inputs(k: int) -> dict[str, float]:
        return {name: signals[name][k] for name in names if name in signals}

    with Instance(fmu) as instance:
        instance.initialise(inputs(0), time[0])
        for k in range(len(time) - 1):
            assert instance.write(inputs(k + inputs_of_the_end)) == OK
            assert instance.step(time[k], time[k + 1] - time[k]) == OK
            if instance.read(["contact"])[0]:
                return float(time[k + 1])
    return float("nan")


def test_the_delay_of_each_kind_in_each_master(tmp_path: Path) -> None:
    """docs/reference/clients/README.md. A sample of the recording is 2 ms."""
    frame = tf.read_recording(DEMO / "index_finger_pushes.parquet").frame[:5000]
    finger = DEMO / "index_finger_calibrated.json"
    signals = {name: column.to_numpy() for name, column in frame.items()}
    seen = signals["time"][tf.run(finger, frame).frame["contact"].to_numpy().argmax()]
    assert seen > signals["time"][0]
    for at, delays in (("begin", {False: 0.002}), ("end", {False: 0.002, True: 0.0})):
        fmu = unpack(tf.build(finger, tmp_path / f"{at}.fmu", sample_at=at), tmp_path / at)
        for of_end, delay in delays.items():
            found = onset(fmu, signals, inputs_of_the_end=of_end) - seen
            assert found == pytest.approx(delay, abs=1e-9), (at, of_end)


# --- what is refused --------------------------------------------------------------------------------------------------


def test_a_rig_has_no_choice(tmp_path: Path) -> None:
    with pytest.raises(
        tf.InputError, match="a rig, whose outputs are those of a step's end; expected sample_at = 'begin'"
    ):
        tf.build(ROOT / "examples" / "rigs" / "index_finger.json", tmp_path / "a.fmu", sample_at="end")
    with pytest.raises(tf.InputError, match="sample_at: 'middle'; expected begin or end"):
        tf.build(FINGER, tmp_path / "a.fmu", sample_at="middle")
    assert not list(tmp_path.iterdir())
