"""Implementations of the model that the same cases are checked against.

A runner is called as `runner(description, recording, kinematics_source)`: description is the parsed JSON,
recording a dict of arrays (`time` [N], `tendon_force` [N, m], ...; absent inputs left out), the result a dict
of all outputs of docs/reference/semantics/outputs.md#outputs ([N, n], [N, m]; `contact` [N]).
"""

from __future__ import annotations

import atexit
import functools
import importlib
import json
import shutil
import tempfile
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import agreement
import oracle

Outputs = dict[str, NDArray[Any]]
Run = Callable[[Mapping[str, Any], Mapping[str, NDArray[Any]], int], Outputs]


@dataclass(frozen=True)
class Runner:
    """name: shown in test ids. repeated_time: accepts a second step at the time of the sample taken."""

    name: str
    run: Run
    repeated_time: bool = True

    def __call__(
        self, description: Mapping[str, Any], recording: Mapping[str, NDArray[Any]], kinematics_source: int
    ) -> Outputs:
        return self.run(description, recording, kinematics_source)


def run_oracle(
    description: Mapping[str, Any], recording: Mapping[str, NDArray[Any]], kinematics_source: int
) -> Outputs:
    return oracle.run(description, recording, kinematics_source).outputs


def product(module: str) -> Any:
    """A module of the installed product; skips where it is not built."""
    try:
        return importlib.import_module(f"tendonfmu.{module}")
    except ImportError as missing:
        pytest.skip(f"SKIPPED: the product is not built ({missing})")


def run_native(
    description: Mapping[str, Any],
    recording: Mapping[str, NDArray[Any]],
    kinematics_source: int,
    kernel: str | None = None,
) -> Outputs:
    """The batch run of the C interface, through the one module that binds it. kernel: `plain` runs on any machine."""
    finger = product("model.native").Instance.from_description(description, kinematics_source)
    if kernel is not None:
        finger.kernel = kernel
    outputs: Outputs = finger.run(recording, terms=True)
    return outputs


def run_single_steps(
    description: Mapping[str, Any], recording: Mapping[str, NDArray[Any]], kinematics_source: int
) -> Outputs:
    """One call of the C interface a sample, the state saved and restored into a fresh finger half way."""
    native = product("model.native")
    finger = native.Instance.from_description(description, kinematics_source)
    samples = len(recording["time"])
    rows = []
    for k in range(samples):
        if k == samples // 2 and k > 0:
            state = finger.save_state()
            finger = native.Instance.from_description(description)
            finger.restore_state(state)
        rows.append(finger.run({name: np.asarray(array)[k : k + 1] for name, array in recording.items()}, terms=True))
    return {name: np.concatenate([row[name] for row in rows]) for name in rows[0]}


@functools.cache
def packed(text: str) -> Path:
    """An FMU of a description's text, kept while the tests run."""
    folder = Path(tempfile.mkdtemp(prefix="tendonfmu-tests-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    (folder / "finger.json").write_text(text, encoding="utf-8")
    fmu: Path = product("fmu.packaging").build_fmu(folder / "finger.json", folder / "finger.fmu")
    return fmu


def run_fmu(description: Mapping[str, Any], recording: Mapping[str, NDArray[Any]], kinematics_source: int) -> Outputs:
    """The FMU through fmpy, stepped by hand."""
    samples = product("recordings.recording").Recording(
        Path("recording"),
        np.asarray(recording["time"], dtype=float),
        {name: np.asarray(array, dtype=float) for name, array in recording.items() if name != "time"},
    )
    fmu = packed(json.dumps(description))
    columns = product("fmu.fmpy_client").run_fmu(fmu, samples, kinematics_source=kinematics_source)
    groups: dict[str, list[NDArray[Any]]] = {}
    for name, column in columns.items():
        groups.setdefault(name.split("[")[0], []).append(column)
    outputs = {name: np.column_stack(each) for name, each in groups.items() if name != "time"}
    return outputs | {"contact": columns["contact"]}


ORACLE = Runner("oracle", run_oracle)
NATIVE = Runner("native", run_native)

RUNNERS: list[Runner] = [
    ORACLE,
    NATIVE,
    Runner("plain_kernel", functools.partial(run_native, kernel="plain")),
    Runner("single_steps", run_single_steps),
    # fmi2DoStep has no step of length 0; test_fmu_states.py takes a time twice
    Runner("fmu", run_fmu, repeated_time=False),
]
OTHERS = [runner for runner in RUNNERS if runner is not ORACLE]
# a call from Python for each sample, and a package to be made
SLOW = [runner for runner in RUNNERS if runner.name in ("single_steps", "fmu")]


def assert_agreement(
    runner: Runner,
    cases: Iterable[tuple[int, Mapping[str, Any], Mapping[str, NDArray[Any]], int, oracle.Result]],
    *required: str,
) -> None:
    """Compare a runner with the oracle. cases: seed, description, recording, kinematics source, run of the oracle."""
    wrong = []
    for seed, description, recording, source, reference in cases:
        outputs = runner(description, recording, source)
        assert set(required) <= set(outputs)
        result = agreement.compare(reference.outputs, outputs)
        if not result.agrees:
            wrong.append(f"finger {seed}, source {source}: {result}")
    assert not wrong, "\n".join(wrong[:10])


def assert_state_continues(
    description: Mapping[str, Any],
    recording: Mapping[str, NDArray[Any]],
    source: int,
    cuts: Iterable[int],
) -> None:
    """Save the state at each cut, and go on twice from it in another instance: all outputs have the same bits."""
    native = product("model.native")
    whole = native.Instance.from_description(description, source).run(recording, terms=True)
    for cut in cuts:
        head, tail = ({name: x[part] for name, x in recording.items()} for part in (slice(cut), slice(cut, None)))
        first, other = (
            native.Instance.from_description(description, source),
            native.Instance.from_description(description),
        )
        first.run(head)
        state = first.save_state()
        for finger in (first, other, other):
            finger.restore_state(state)
            for name, values in finger.run(tail, terms=True).items():
                np.testing.assert_array_equal(values, whole[name][cut:], err_msg=f"{name} from {cut}")
