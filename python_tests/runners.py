"""Implementations of the model that the same cases are checked against.

A runner is called as `runner(description, recording, kinematics_source)`: description is the parsed JSON,
recording a dict of arrays (`time` [N], `tendon_force` [N, m], ...; absent inputs left out), the result a dict
of all outputs of contract section 4 ([N, n], [N, m]; `contact` [N]).
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import pytest
from numpy.typing import NDArray

import oracle

Outputs = dict[str, NDArray[Any]]
Run = Callable[[Mapping[str, Any], Mapping[str, NDArray[Any]], int], Outputs]


@dataclass(frozen=True)
class Runner:
    """name: shown in test ids. repeated_time: accepts a second step at the time of the sample taken."""

    name: str
    run: Run
    repeated_time: bool = True
    extensions: bool = True

    def __call__(
        self, description: Mapping[str, Any], recording: Mapping[str, NDArray[Any]], kinematics_source: int
    ) -> Outputs:
        return self.run(description, recording, kinematics_source)


def run_oracle(
    description: Mapping[str, Any], recording: Mapping[str, NDArray[Any]], kinematics_source: int
) -> Outputs:
    return oracle.run(description, recording, kinematics_source).outputs


def run_native(
    description: Mapping[str, Any], recording: Mapping[str, NDArray[Any]], kinematics_source: int
) -> Outputs:
    """The batch run of the C interface, through the one module that binds it; skips when it is not built."""
    try:
        native = importlib.import_module("tendonfmu.native")
    except ImportError as missing:
        pytest.skip(f"SKIPPED: the native module is not built ({missing})")
    outputs: Outputs = native.run_recording(description, recording, kinematics_source)
    return outputs


ORACLE = Runner("oracle", run_oracle)
# A recording's time is strictly increasing, so the batch run need not take a time twice.
NATIVE = Runner("native", run_native, repeated_time=False)

RUNNERS: list[Runner] = [ORACLE, NATIVE]
