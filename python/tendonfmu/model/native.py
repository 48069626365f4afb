"""How Python calls the C runtime: the binding, through which every call of the model goes.

Errors are `NativeError` with the runtime's own line: what, where and what was expected. They are not `InputError`: the
caller that passes user input to the runtime adds the name of the file.
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
from tendonfmu.model.signals import INPUTS

Array = NDArray[Any]


class NativeError(ValueError):
    """The runtime refuses a description, an image, a parameter, a sample or a state."""


@dataclass(frozen=True)
class Parameter:
    """One number of a finger.

    Attributes
    ----------
    path
        Path, as of the FMU's parameter.
    start
        Value in the image.
    minimum, maximum
        Allowed range.
    above_minimum
        Whether the value must be above the minimum, not equal to it.
    tunable
        Whether it may change between steps.
    unit
        FMI unit.
    """

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
    """Return the version of the compiled runtime.

    Returns
    -------
    str
        Numbers separated by points.
    """
    return _native.version()


def image_from_json(text: str | bytes) -> bytes:
    """Compile a finger description to a model image.

    Parameters
    ----------
    text
        The description (JSON).

    Returns
    -------
    bytes
        The image.

    Raises
    ------
    NativeError
        Key path, value and allowed range.
    """
    with _refusals():
        return _native.image_from_json(text.encode() if isinstance(text, str) else text)


def image_guid(image: bytes, salt: int) -> str:
    """Return an identifier of an image's content.

    Parameters
    ----------
    image
        A model image.
    salt
        Any number; it changes the identifier.

    Returns
    -------
    str
        "{xxxxxxxx-...}".
    """
    return _native.image_guid(image, salt)


class Instance:
    """One finger of the C runtime: parameters, state, and runs over whole recordings in one call.

    Not to be used by two threads at a time.

    Parameters
    ----------
    image
        A model image, as `image_from_json` makes it.
    kinematics_source
        1, 2 or 3, as of the FMU.
    """

    def __init__(self, image: bytes, kinematics_source: int = 1) -> None:
        with _refusals():
            self._finger = _native.Finger(image)
            self._finger.kinematics_source = kinematics_source

    @classmethod
    def from_description(cls, description: Mapping[str, Any] | str | bytes, kinematics_source: int = 1) -> Instance:
        """Make a finger from a description.

        Parameters
        ----------
        description
            Parsed JSON or its text.
        kinematics_source
            1, 2 or 3, as of the FMU.

        Returns
        -------
        Instance
            A new finger.

        Raises
        ------
        NativeError
            Key path, value and allowed range.
        """
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
    def watches_rest(self) -> bool:
        """Whether the description has contact.rest. It needs tendon positions with every source."""
        return self._finger.watches_rest

    @property
    def watches_sensors(self) -> bool:
        """Whether the description has sensor_fault. It needs tendon positions with every source."""
        return self._finger.watches_sensors

    @property
    def kernel(self) -> str:
        """Instruction set of the step: "plain", "sse2" or "avx2". All give the same bits."""
        return self._finger.kernel

    @kernel.setter
    def kernel(self, name: str) -> None:
        with _refusals():
            self._finger.kernel = name

    def parameters(self) -> list[Parameter]:
        """Return all parameters in canonical order.

        Returns
        -------
        list of Parameter
            Index k is index k in the image.
        """
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
        """Return the value of one parameter.

        Parameters
        ----------
        path
            Path of the parameter.

        Returns
        -------
        float
            In the parameter's unit.

        Raises
        ------
        NativeError
            The finger has no such parameter.
        """
        return self._finger.get_parameters([self._index(path)])[0]

    def set(self, values: Mapping[str, float]) -> None:
        """Write parameters by path, all or none.

        Parameters
        ----------
        values
            Values by path.

        Raises
        ------
        NativeError
            A path is unknown, or a value is out of its range.
        """
        with _refusals():
            self._finger.set_parameters([self._index(path) for path in values], list(values.values()))

    def values(self) -> NDArray[np.float64]:
        """Return all parameter values.

        Returns
        -------
        ndarray
            [p], in canonical order.
        """
        return np.array(self._finger.get_parameters(range(self._finger.parameter_count)))

    def set_values(self, values: Sequence[float] | NDArray[np.float64]) -> None:
        """Write all parameters.

        Parameters
        ----------
        values
            [p], in canonical order.

        Raises
        ------
        NativeError
            A value is out of its range.
        """
        with _refusals():
            self._finger.set_parameters(range(self._finger.parameter_count), [float(value) for value in values])

    def reset(self) -> None:
        """Return to the image: its parameters, kinematics source 1, no sample taken."""
        self._finger.reset()

    def set_kinematics_source(self, source: int) -> None:
        """Choose where angles and speeds come from.

        Parameters
        ----------
        source
            1, 2 or 3, as of the FMU.

        Raises
        ------
        NativeError
            Another number.
        """
        with _refusals():
            self._finger.kinematics_source = source

    def save_state(self) -> bytes:
        """Return a copy of the state.

        Returns
        -------
        bytes
            For `restore_state` of a finger of the same image.
        """
        return self._finger.save_state()

    def restore_state(self, state: bytes) -> None:
        """Return to a saved state.

        Parameters
        ----------
        state
            From `save_state`.

        Raises
        ------
        NativeError
            The state does not belong to this finger.
        """
        with _refusals():
            self._finger.restore_state(state)

    def run(self, recording: Mapping[str, Array], parts: bool = False) -> dict[str, Array]:
        """Take all samples of a recording in one call, and return all outputs of the FMU.

        A later call continues where this one ended.

        Parameters
        ----------
        recording
            `time` [N] (s), `tendon_force` [N, m] (N), `tendon_position` [N, m] (m), `joint_position` [N, n] (rad) and
            `joint_velocity` [N, n] (rad/s). Signals that the kinematics source does not use may be left out.
        parts
            Whether to add `friction_parts` [N, n, m + 3] (N·m), the contributions to each joint's friction. This needs
            contact.uncertainty.

        Returns
        -------
        dict of arrays
            Outputs [N, n], `slack` [N, m] and `contact` [N]; flags are bool. In addition to those of the FMU:
            `compensated_torque_std`, `residual`, `innovation`, `stuck_friction`, `friction_jump` and `drift` (N·m;
            docs/reference/semantics.md#outputs).

            With links also `fingertip_force` and `fingertip_force_std` [N, 3] (N, base frame), and
            `fingertip_force_observable`, `fingertip_force_misfit` and `contact_link` [N]. With contact.rest also
            `contact_change` [N, n] (N·m) and `contact_at_rest` [N]. With sensor_fault also `sensor_fault` [N, m] and
            `contact_observable` [N].

        Raises
        ------
        NativeError
            A signal is missing, has the wrong shape or an invalid value.
        """
        inputs = [
            None if recording.get(name) is None else np.ascontiguousarray(recording[name], dtype=np.float64)
            for name in INPUTS
        ]
        with _refusals():
            time = np.ascontiguousarray(recording["time"], dtype=np.float64)
            outputs: dict[str, Array] = self._finger.run(time, inputs[0], inputs[1], inputs[2], inputs[3], parts)
        flags = (name for name in outputs if outputs[name].dtype == np.uint8)
        return outputs | {name: outputs[name].view(bool) for name in flags}

    def step_outputs(self) -> dict[str, Array]:
        """Return the arrays that `step` writes.

        Returns
        -------
        dict of arrays
            Outputs of `run` without friction parts: [n], [m], [3] or [1]; flags are bool. Always the same arrays.
        """
        arrays = self._finger.step_outputs()
        return {name: each.view(bool) if each.dtype == np.uint8 else each for name, each in arrays.items()}

    def step(
        self,
        time: float,
        tendon_force: Array | None,
        tendon_position: Array | None = None,
        joint_position: Array | None = None,
        joint_velocity: Array | None = None,
    ) -> None:
        """Take one sample and write its outputs into the arrays of `step_outputs`.

        Parameters
        ----------
        time
            Time (s), after that of the sample before.
        tendon_force, tendon_position
            [m] (N and m), float64.
        joint_position, joint_velocity
            [n] (rad and rad/s), float64. Signals that the kinematics source does not use may be None.

        Raises
        ------
        NativeError
            The sample is refused. State and outputs are those of the sample before.
        """
        try:  # a context manager takes longer than the step
            self._finger.step(time, tendon_force, tendon_position, joint_position, joint_velocity)
        except ValueError as refused:
            raise NativeError(str(refused)) from None

    def directional_derivative(self, direction: Mapping[str, Array]) -> dict[str, Array]:
        """Return the derivative of the last sample's outputs along a direction of its inputs.

        Parameters
        ----------
        direction
            Change of each input [m] or [n]. Missing inputs count as zero.

        Returns
        -------
        dict of arrays
            Change of each output [n].

        Raises
        ------
        NativeError
            No sample was taken yet, or a direction has the wrong shape.
        """
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
