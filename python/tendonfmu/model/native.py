"""How Python calls the C runtime: the binding (`_native`), through which every call of the model goes.

Errors are `NativeError` with the runtime's own line: what, where and what was expected. They are not `InputError`: the
caller that passes user input to the runtime adds the name of the file (`refusals_of`).
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from tendonfmu import _native
from tendonfmu._native import NativeError, image_from_json, image_guid, memory_size, version
from tendonfmu.arrays import Array
from tendonfmu.errors import InputError

__all__ = ["Instance", "NativeError", "Parameter", "image_from_json", "image_guid", "memory_size", "version"]


@dataclass(frozen=True)
class Parameter:
    """One number of a finger."""

    path: str  # path, as of the FMU's parameter
    start: float  # value in the image
    minimum: float  # allowed range
    maximum: float
    above_minimum: bool  # whether the value must be above the minimum, not equal to it
    tunable: bool  # whether it may change between steps
    unit: str  # FMI unit


@contextmanager
def refusals_of(source: object) -> Iterator[None]:
    """Turn what the runtime refuses inside the block into an InputError that begins with its source, such as a file."""
    try:
        yield
    except NativeError as refused:
        raise InputError(f"{source}: {refused}") from None


class Instance(_native.Instance):
    """One finger of the C runtime: parameters, state, and runs over whole recordings in one call."""

    @classmethod
    def from_description(cls, description: Mapping[str, Any] | str | bytes, kinematics_source: int = 1) -> Instance:
        """Make a finger from a description."""
        text = description if isinstance(description, str | bytes) else json.dumps(description)
        return cls(image_from_json(text), kinematics_source)

    def parameters(self) -> list[Parameter]:
        """Return all parameters in canonical order."""
        return [Parameter(*row) for row in self.parameter_rows()]


def run_recording(
    description: Mapping[str, Any] | str | bytes, recording: Mapping[str, Array], kinematics_source: int = 1
) -> dict[str, Array]:
    """Run a new finger of a description over a recording; see `Instance.run`."""
    return Instance.from_description(description, kinematics_source).run(recording)
