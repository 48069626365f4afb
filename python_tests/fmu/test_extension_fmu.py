"""FMUs of random fingers with `extensions`: directional derivatives, declared dependencies and saved states by call."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from test_fmu_calls import SOURCE, derivative

from fmu_binary import OK, Instance, UnpackedFmu, unpack
from random_fingers import Recording, random_case
from tendonfmu.fmu.packaging import build_fmu
from tendonfmu.model import native as native_model

SAMPLES = 60


def inputs_at(recording: Recording, k: int) -> dict[str, float]:
    return {
        f"{name}[{i + 1}]": float(value)
        for name, series in recording.items()
        if name != "time"
        for i, value in enumerate(series[k])
    }


def take(instance: Instance, recording: Recording, k: int) -> None:
    time = recording["time"]
    step = time[k + 1] - time[k] if k + 1 < len(time) else 0.001
    assert instance.set_real(inputs_at(recording, k)) == OK, instance.last_message
    assert instance.step(float(time[k]), float(step)) == OK, instance.last_message


def begin(instance: Instance, recording: Recording, source: int) -> None:
    assert instance.set_integer(SOURCE, source) == OK
    instance.initialise(inputs_at(recording, 0), float(recording["time"][0]))
    take(instance, recording, 0)


def dependencies(fmu: UnpackedFmu) -> dict[str, set[str]]:
    import fmpy

    description = fmpy.read_model_description(str(fmu.folder))
    return {u.variable.name: {d.name for d in u.dependencies} for u in description.outputs}


@pytest.mark.parametrize(("seed", "source"), [(601, 1), (612, 1), (616, 1), (605, 2), (603, 3)])
def test_fmu_is_the_native_finger(seed: int, source: int, tmp_path: Path) -> None:
    description, recording = random_case(seed, SAMPLES, extensions=True)
    (tmp_path / "finger.json").write_text(json.dumps(description))
    fmu = unpack(build_fmu(tmp_path / "finger.json", tmp_path / "finger.fmu", illustrated=False), tmp_path / "unpacked")
    declared, outputs, inputs = dependencies(fmu), fmu.with_derivatives(), fmu.names("input")
    native = native_model.Instance.from_description(description, source)
    native.run({name: series[:1] for name, series in recording.items()})
    with Instance(fmu) as instance, Instance(fmu) as other:
        begin(instance, recording, source)
        for k in range(1, SAMPLES):
            if k == 23:  # the rest in an instance that was never initialised as this one was
                assert other.set_integer(SOURCE, source) == OK
                other.initialise(inputs_at(recording, 5), float(recording["time"][0]))
                assert other.restore(instance.save()) == OK
            take(instance, recording, k)
            if k >= 23:
                take(other, recording, k)
                assert other.outputs() == instance.outputs()
            native.run({name: series[k : k + 1] for name, series in recording.items()})
            if k % 8 == 0:
                compare_slopes(instance, native, outputs, inputs, declared)


def compare_slopes(
    instance: Instance,
    native: native_model.Instance,
    outputs: list[str],
    inputs: list[str],
    declared: dict[str, set[str]],
) -> None:
    """fmi2GetDirectionalDerivative gives the bits of the C interface, 0 where no dependency is declared."""
    for name in inputs:
        group, index = name.rstrip("]").split("[")
        count = sum(each.startswith(f"{group}[") for each in inputs)
        slopes = native.directional_derivative({group: np.eye(count)[int(index) - 1]})
        expected = [slopes[o.split("[")[0]][int(o.rstrip("]").split("[")[1]) - 1] for o in outputs]
        found = derivative(instance, outputs, {name: 1.0})
        np.testing.assert_array_equal(found, expected)
        assert not [o for o, slope in zip(outputs, found, strict=True) if slope and name not in declared[o]], name
