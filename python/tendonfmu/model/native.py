"""How Python calls the C runtime: the binding, through which every call of the model goes.

Errors are `NativeError` with the runtime's own line: what, where and what was expected. They are not `InputError`: the
caller that passes user input to the runtime adds the name of the file (`refusals_of`).
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu import _native
from tendonfmu.arrays import Array
from tendonfmu.errors import InputError
from tendonfmu.model.output_names import INPUTS


class NativeError(ValueError):
    """The runtime refuses a description, an image, a parameter, a sample or a state."""


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
def _refusals() -> Iterator[None]:
    try:
        yield
    except ValueError as refused:
        raise NativeError(str(refused)) from None


@contextmanager
def refusals_of(source: object) -> Iterator[None]:
    """Turn what the runtime refuses inside the block into an InputError that begins with its source, such as a file."""
    try:
        yield
    except NativeError as refused:
        raise InputError(f"{source}: {refused}") from None


def version() -> str:
    """Return the version of the compiled runtime."""
    return _native.version()


def image_from_json(text: str | bytes) -> bytes:
    """Compile a finger description to a model image."""
    with _refusals():
        return _native.image_from_json(text.encode() if isinstance(text, str) else text)


def memory_size(image: bytes) -> int:
    """Return the bytes of memory that a finger of an image needs on this machine."""
    return _native.memory_size(image)


def image_guid(image: bytes, salt: int) -> str:
    """Return an identifier of an image's content."""
    return _native.image_guid(image, salt)


class Instance:
    """One finger of the C runtime: parameters, state, and runs over whole recordings in one call."""

    def __init__(self, image: bytes, kinematics_source: int = 1) -> None:
        with _refusals():
            self._finger = _native.Finger(image)
            self._finger.kinematics_source = kinematics_source
        self._indices: dict[str, int] = {}  # of parameters, by path

    @classmethod
    def from_description(cls, description: Mapping[str, Any] | str | bytes, kinematics_source: int = 1) -> Instance:
        """Make a finger from a description."""
        text = description if isinstance(description, str | bytes) else json.dumps(description)
        return cls(image_from_json(text), kinematics_source)

    @property
    def joints(self) -> int:
        """Number of joints n."""
        return self._finger.joints

    @property
    def tendons(self) -> int:
        """Number of tendons m."""
        return self._finger.tendons

    @property
    def has_links(self) -> bool:
        """Whether the description has link geometry."""
        return self._finger.has_links

    @property
    def watches_motors(self) -> bool:
        """Whether the description has contact.watches_motors. It needs tendon positions with every source."""
        return self._finger.watches_motors

    @property
    def watches_sensors(self) -> bool:
        """Whether the description has sensor_fault. It needs tendon positions with every source."""
        return self._finger.watches_sensors

    @property
    def kernel(self) -> str:
        """Instruction set of the step: "plain", "sse2", "avx2" or "neon". All give the same bits."""
        return self._finger.kernel

    @kernel.setter
    def kernel(self, name: str) -> None:
        with _refusals():
            self._finger.kernel = name

    def parameters(self) -> list[Parameter]:
        """Return all parameters in canonical order."""
        return [
            Parameter(self._finger.parameter_path(k), *self._finger.parameter_info(k))
            for k in range(self._finger.parameter_count)
        ]

    def _index(self, path: str) -> int:
        if path not in self._indices:  # the runtime looks through all paths
            index = self._finger.find_parameter(path)
            if index >= self._finger.parameter_count:
                raise NativeError(f"no parameter {path!r} in this finger")
            self._indices[path] = index
        return self._indices[path]

    def get(self, path: str) -> float:
        """Return the value of one parameter."""
        return self._finger.get_parameters([self._index(path)])[0]

    def set(self, values: Mapping[str, float]) -> None:
        """Write parameters by path, all or none."""
        with _refusals():
            self._finger.set_parameters([self._index(path) for path in values], list(values.values()))

    def values(self) -> NDArray[np.float64]:
        """Return all parameter values [p], in canonical order."""
        return np.array(self._finger.get_parameters(range(self._finger.parameter_count)))

    def reset(self) -> None:
        """Return to the image: its parameters, kinematics source 1, no sample taken."""
        self._finger.reset()

    def set_kinematics_source(self, source: int) -> None:
        """Choose where angles and speeds come from."""
        with _refusals():
            self._finger.kinematics_source = source

    def save_state(self) -> bytes:
        """Return a copy of the state."""
        return self._finger.save_state()

    def restore_state(self, state: bytes) -> None:
        """Return to a saved state."""
        with _refusals():
            self._finger.restore_state(state)

    def run(self, recording: Mapping[str, Array], terms: bool = False) -> dict[str, Array]:
        """Take all samples of a recording in one call, and return all outputs of the FMU."""
        # recording: [N] (s); terms: with contact_terms [N, n, 4, 8] (N·m); returns [N, n] [N, m] (N·m)
        return self._run(recording, terms, None, None)

    def run_guided(self, recording: Mapping[str, Array], learns: Array, known_torque: Array | None) -> dict[str, Array]:
        """Return the same and `residual_variance`, S, with a bias that learns from some samples, not by contact."""
        # learns: [N]; known_torque: [N, n] (N·m), taken from τ; returns also [N, n] ((N·m)²), NaN until the bias begins
        known = None if known_torque is None else np.ascontiguousarray(known_torque, dtype=np.float64)
        return self._run(recording, False, np.ascontiguousarray(learns, dtype=np.uint8), known)

    def _run(
        self, recording: Mapping[str, Array], terms: bool, learns: Array | None, known: Array | None
    ) -> dict[str, Array]:
        inputs = [
            None if recording.get(name) is None else np.ascontiguousarray(recording[name], dtype=np.float64)
            for name in INPUTS
        ]
        with _refusals():
            time = np.ascontiguousarray(recording["time"], dtype=np.float64)
            outputs: dict[str, Array] = self._finger.run(
                time, inputs[0], inputs[1], inputs[2], inputs[3], terms, learns, known
            )
        flags = (name for name in outputs if outputs[name].dtype == np.uint8)
        return outputs | {name: outputs[name].view(bool) for name in flags}

    def step_outputs(self) -> dict[str, Array]:
        """Return the arrays that `step` writes."""
        arrays = self._finger.step_outputs()
        return {name: array.view(bool) if array.dtype == np.uint8 else array for name, array in arrays.items()}

    def step(
        self,
        time: float,
        tendon_force: Array | None,
        tendon_position: Array | None = None,
        joint_position: Array | None = None,
        joint_velocity: Array | None = None,
    ) -> None:
        """Take one sample, of tendons [m] and joints [n], and write its outputs into the arrays of `step_outputs`."""
        try:  # a context manager takes longer than the step
            self._finger.step(time, tendon_force, tendon_position, joint_position, joint_velocity)
        except ValueError as refused:
            raise NativeError(str(refused)) from None

    def directional_derivative(self, direction: Mapping[str, Array]) -> dict[str, Array]:
        """Return the derivative of the last sample's outputs along a direction of its inputs."""
        sizes = (self.tendons, self.tendons, self.joints, self.joints)
        seeds = [
            np.asarray(direction.get(name, np.zeros(size)), dtype=float).tolist()
            for name, size in zip(INPUTS, sizes, strict=True)
        ]
        with _refusals():
            return self._finger.directional_derivative(*seeds)


def run_recording(
    description: Mapping[str, Any] | str | bytes, recording: Mapping[str, Array], kinematics_source: int = 1
) -> dict[str, Array]:
    """Run a new finger of a description over a recording; see `Instance.run`."""
    return Instance.from_description(description, kinematics_source).run(recording)
