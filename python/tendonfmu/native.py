"""The binding of the C runtime, and only it: every call of the model from Python goes through here.

Errors come as `NativeError` with the runtime's own line: what, where, what was expected. It is no `InputError`: who
gives the runtime something of the user's names its file.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu import _native
from tendonfmu.signals import INPUTS

Array = NDArray[Any]


class NativeError(ValueError):
    """Refused by the runtime: a description, an image, a parameter, a sample or a state."""


@dataclass(frozen=True)
class Parameter:
    """One number of a finger: path as of the FMU's parameter, value in the image, allowed range, FMI unit."""

    path: str
    start: float
    minimum: float
    maximum: float
    above_minimum: bool
    tunable: bool
    unit: str


@contextmanager
def _refusals() -> Iterator[None]:
    try:
        yield
    except ValueError as refused:
        raise NativeError(str(refused)) from None


def version() -> str:
    """Version of the compiled runtime."""
    return _native.version()


def image_from_json(text: str | bytes) -> bytes:
    """Model image of a finger description. Raises NativeError with key path, value and allowed range."""
    with _refusals():
        return _native.image_from_json(text.encode() if isinstance(text, str) else text)


def image_guid(image: bytes, salt: int) -> str:
    """Identifier of an image's content, "{xxxxxxxx-...}"; salt: any number, mixed in."""
    return _native.image_guid(image, salt)


class Finger:
    """One finger of the C runtime: parameters, state, and runs over whole recordings in one call.

    image: as `image_from_json` makes it. kinematics_source: 1, 2 or 3, as of the FMU.
    Not for use by two threads at a time.
    """

    def __init__(self, image: bytes, kinematics_source: int = 1) -> None:
        with _refusals():
            self._finger = _native.Finger(image)
            self._finger.kinematics_source = kinematics_source

    @classmethod
    def from_description(cls, description: Mapping[str, Any] | str | bytes, kinematics_source: int = 1) -> Finger:
        """From a description: parsed JSON or its text."""
        text = description if isinstance(description, str | bytes) else json.dumps(description)
        return cls(image_from_json(text), kinematics_source)

    @property
    def joints(self) -> int:
        return self._finger.joints

    @property
    def tendons(self) -> int:
        return self._finger.tendons

    @property
    def has_links(self) -> bool:
        """Whether the description has link geometry."""
        return self._finger.has_links

    @property
    def watches_rest(self) -> bool:
        """Whether the description has contact.rest; then tendon positions are needed with every source."""
        return self._finger.watches_rest

    @property
    def watches_sensors(self) -> bool:
        """Whether the description has sensor_fault; then tendon positions are needed with every source."""
        return self._finger.watches_sensors

    @property
    def kernel(self) -> str:
        """Instruction set of the step: "plain", "sse2" or "avx2"; all give the same bits."""
        return self._finger.kernel

    @kernel.setter
    def kernel(self, name: str) -> None:
        with _refusals():
            self._finger.kernel = name

    def parameters(self) -> list[Parameter]:
        """All parameters in canonical order: index k here is index k in the image."""
        return [
            Parameter(self._finger.parameter_path(k), *self._finger.parameter_info(k))
            for k in range(self._finger.parameter_count)
        ]

    def _index(self, path: str) -> int:
        index = self._finger.find_parameter(path)
        if index >= self._finger.parameter_count:
            raise NativeError(f"no parameter {path!r} in this finger")
        return index

    def get(self, path: str) -> float:
        """Value of one parameter by its path."""
        return self._finger.get_parameters([self._index(path)])[0]

    def set(self, values: Mapping[str, float]) -> None:
        """Writes parameters by path, all or none; each is checked against its range."""
        with _refusals():
            self._finger.set_parameters([self._index(path) for path in values], list(values.values()))

    def values(self) -> NDArray[np.float64]:
        """[p] all parameter values."""
        return np.array(self._finger.get_parameters(range(self._finger.parameter_count)))

    def set_values(self, values: Sequence[float] | NDArray[np.float64]) -> None:
        """Writes all parameters, [p]."""
        with _refusals():
            self._finger.set_parameters(range(self._finger.parameter_count), [float(value) for value in values])

    def reset(self) -> None:
        """Back to the image: its parameters, kinematics source 1, no sample taken."""
        self._finger.reset()

    def set_kinematics_source(self, source: int) -> None:
        with _refusals():
            self._finger.kinematics_source = source

    def save_state(self) -> bytes:
        return self._finger.save_state()

    def restore_state(self, state: bytes) -> None:
        with _refusals():
            self._finger.restore_state(state)

    def run(self, recording: Mapping[str, Array], parts: bool = False) -> dict[str, Array]:
        """Takes all samples of a recording in one call and returns all outputs of the FMU.

        recording: `time` [N] (s), `tendon_force` and `tendon_position` [N, m], `joint_position` and `joint_velocity`
            [N, n]; those that the kinematics source does not use may be left out.
        parts: with `friction_parts` [N, n, m + 3], N·m, what makes each joint's friction (needs contact.uncertainty).
        Returns [N, n], `slack` [N, m], `contact` [N]; flags are bool. Beyond these, as docs/contract-additions.md
        has them: `compensated_torque_std`, `residual`, `innovation`, `stuck_friction`, `friction_jump`, `drift`,
        N·m. With links also `fingertip_force` and `fingertip_force_std` [N, 3] (N, base frame), and [N]
        `fingertip_force_observable`, `fingertip_force_misfit`, `contact_link`. With contact.rest also `contact_change`
        [N, n] (N·m) and `contact_at_rest` [N]. With sensor_fault also `sensor_fault` [N, m] and `contact_observable`
        [N].
        A later call goes on where this one ended.
        """
        inputs = [
            None if recording.get(name) is None else np.ascontiguousarray(recording[name], dtype=np.float64)
            for name in INPUTS
        ]
        with _refusals():
            time = np.ascontiguousarray(recording["time"], dtype=np.float64)
            outputs: dict[str, Array] = self._finger.run(time, inputs[0], inputs[1], inputs[2], inputs[3], parts)
        flags = (name for name in outputs if outputs[name].dtype == np.uint8)
        return outputs | {name: outputs[name].astype(bool) for name in flags}

    def directional_derivative(self, direction: Mapping[str, Array]) -> dict[str, Array]:
        """Derivative of the last sample's outputs [n] along a direction of its inputs (missing ones count as zero)."""
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
    """Runs a fresh finger of a description over a recording; see `Finger.run`."""
    return Finger.from_description(description, kinematics_source).run(recording)
