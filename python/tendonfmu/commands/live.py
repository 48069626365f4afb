"""Runs a finger sample by sample, in a control loop in Python."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tendonfmu.arrays import Numbers
from tendonfmu.errors import InputError
from tendonfmu.model import INPUTS, FingerSource, native, read_finger
from tendonfmu.options import RunOptions

_MASKED = np.ma.MaskedArray


class Sample:
    """Outputs of the last sample. A `Runner` has one, whose arrays each step writes again: copy what you keep.

    Attributes
    ----------
    compensated_torque, joint_torque, friction_torque, bias_torque, compensated_torque_std
        [n] (N·m).
    joint_angle, joint_speed
        [n] (rad, rad/s).
    joint_contact
        [n] bool.
    slack
        [m] bool.
    outputs
        Arrays of all outputs by name, those of links, contact.rest and sensor_fault included.
    """

    def __init__(self, outputs: dict[str, NDArray[np.generic]]) -> None:
        for values in outputs.values():
            values.flags.writeable = False
        self.outputs = outputs
        vars(self).update({name: values for name, values in outputs.items() if name != "contact"})

    compensated_torque: Numbers
    joint_torque: Numbers
    friction_torque: Numbers
    bias_torque: Numbers
    compensated_torque_std: Numbers
    joint_angle: Numbers
    joint_speed: Numbers
    joint_contact: NDArray[np.bool_]
    slack: NDArray[np.bool_]

    @property
    def contact(self) -> bool:
        """Whether any joint is in contact."""
        return bool(self.outputs["contact"][0])

    def __repr__(self) -> str:
        torques = ", ".join(f"{value:.4g}" for value in self.compensated_torque)
        return f"<Sample: compensated_torque [{torques}] N·m, contact {self.contact}>"


class Runner:
    """A finger in a control loop: it takes one sample after the other. Not to be used by two threads at a time.

    Parameters
    ----------
    finger
        A finger, its description, or the file of it.
    kinematics
        1 tendon positions, 2 measured joint positions, 3 joint positions and velocities.

    Raises
    ------
    InputError
        The finger or the option is refused.

    Examples
    --------
    >>> runner = tf.Runner("finger.json")
    >>> sample = runner.step(0.0, tendon_force=[10.0, 10.0], tendon_position=[0.0, 0.0])
    >>> sample.compensated_torque, sample.contact
    """

    def __init__(self, finger: FingerSource, kinematics: int = 1) -> None:
        self.kinematics = RunOptions(kinematics=kinematics).kinematics
        self.finger = read_finger(finger)
        self._instance = native.Instance(self.finger.image, self.kinematics)
        self._sample = Sample(self._instance.step_outputs())
        self._take = self._instance.step

    def __repr__(self) -> str:
        return f"<Runner of {self.finger!r}, kinematics {self.kinematics}>"

    @property
    def sample(self) -> Sample:
        """Outputs of the last sample; zeros before the first."""
        return self._sample

    def step(
        self,
        time: float,
        tendon_force: ArrayLike,
        tendon_position: ArrayLike | None = None,
        joint_position: ArrayLike | None = None,
        joint_velocity: ArrayLike | None = None,
    ) -> Sample:
        """Take one sample.

        The first one initialises the finger. A step at the time of the sample before changes nothing. Arrays of
        float64 are the fastest input.

        Parameters
        ----------
        time
            Time (s), not before that of the sample before.
        tendon_force, tendon_position
            [m] (N and m).
        joint_position, joint_velocity
            [n] (rad and rad/s). Signals that the kinematics do not use may be None.

        Returns
        -------
        Sample
            The outputs of this sample. It is the same object at every step, with the same arrays: copy what you keep.

        Raises
        ------
        InputError
            The sample is refused. State and outputs stay those of the sample before.
        """
        if _MASKED in (type(tendon_force), type(tendon_position), type(joint_position), type(joint_velocity)):
            _refuse_masked((tendon_force, tendon_position, joint_position, joint_velocity))
        try:
            self._take(time, tendon_force, tendon_position, joint_position, joint_velocity)  # type: ignore[arg-type]
        except native.NativeError as refused:
            raise InputError(f"sample at {time!r} s: {refused}") from None
        except TypeError:
            self._take_converted(time, (tendon_force, tendon_position, joint_position, joint_velocity))
        return self._sample

    def _take_converted(self, time: float, given: tuple[ArrayLike | None, ...]) -> None:
        """Take a sample of anything that numpy makes arrays of."""
        arrays = [_row(name, values) for name, values in zip(INPUTS, given, strict=True)]
        with native.refusals_of(f"sample at {time!r} s"):
            self._take(_number(time), *arrays)

    def reset(self) -> None:
        """Forget all samples."""
        self._instance.reset()
        self._instance.set_kinematics_source(self.kinematics)

    def save(self) -> bytes:
        """Return a copy of the state, for `restore`."""
        return self._instance.save_state()

    def restore(self, state: bytes) -> None:
        """Return to a saved state. The outputs of `sample` are written by the next step.

        Parameters
        ----------
        state
            From `save` of a runner of the same finger.

        Raises
        ------
        InputError
            The state does not belong to this finger.
        """
        try:
            self._instance.restore_state(state)
        except (native.NativeError, TypeError) as refused:
            reason = str(refused).splitlines()[0]
            raise InputError(f"state: {reason}; expected one that `save` of the same finger returned") from None


def _row(name: str, values: ArrayLike | None) -> Numbers | None:
    if values is None:
        return None
    try:
        row = np.ascontiguousarray(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError(f"{name}: {values!r}; expected numbers") from None
    if np.ndim(values) != 1:
        raise InputError(f"{name}: shape {np.shape(values)}; expected numbers of one sample, [{_size(name)}]")
    return row


def _refuse_masked(given: tuple[ArrayLike | None, ...]) -> None:
    """Raise InputError if a value is masked: the native part would read what is under the mask."""
    for name, values in zip(INPUTS, given, strict=True):
        if np.ma.is_masked(values):
            number = int(np.flatnonzero(np.ma.getmaskarray(np.ma.asarray(values)))[0]) + 1
            raise InputError(f"{name}[{number}]: masked; expected a number")


def _size(name: str) -> str:
    return "m" if name.startswith("tendon") else "n"


def _number(time: object) -> float:
    try:
        if isinstance(time, str | bytes | _MASKED):
            raise TypeError
        return float(time)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        raise InputError(f"time: {time!r}; expected seconds as a number") from None
