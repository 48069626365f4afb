"""The binding of the simulated finger (runtime/include/tendonfmu_plant.h), and only it.

Where SUNDIALS was not found when the package was built, there is no simulated finger: `Plant` then raises
`InputError(PLANT_MISSING)`, and everything else works.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu.errors import InputError

# a module that is there and does not load is a fault to be seen, not a missing one
HAS_PLANT = find_spec("tendonfmu._plant") is not None
if HAS_PLANT:
    from tendonfmu import _plant

Array = NDArray[Any]

PLANT_MISSING = "this installation has no simulated finger (SUNDIALS was not found when it was built)"
INTEGRATORS = {"cvode": 1, "fixed_step": 2}

# what the sensors say, and the truth; sizes as in tendonfmu_plant_signals
MEASURED = ("tendon_force", "tendon_position", "joint_position", "joint_velocity", "external_torque")
TRUE = (
    "tendon_force",
    "tendon_position",
    "joint_position",
    "joint_velocity",
    "joint_torque",
    "friction_torque",
    "external_torque",
    "inertial_torque",
    "stop_torque",
    "contact",
    "contact_force",
    "contact_point",
    "tip_position",
    "friction_level",
    "energy",
    "slack",
)
SIGNALS = (*(f"measured_{name}" for name in MEASURED), *TRUE)
FLAGS = ("contact", "slack")
SCALARS = ("contact", "friction_level")


class PlantError(ValueError):
    """Refused by the plant: a rig, a setting, an input, a time or a state. `refused_by` makes it an InputError."""


class SolverError(PlantError):
    """The integrator gave up: time, cause, what to try."""


@dataclass(frozen=True)
class Settings:
    """What a plant does by itself; see tendonfmu_plant_settings.

    integrator: a key of `INTEGRATORS`. relative_tolerance: of CVODE. step: s, of the fixed-step integrator.
    push_point: m, in the frame of push_link (from 1).
    """

    integrator: str
    relative_tolerance: float
    step: float
    scheduled_motion: bool
    scheduled_pushes: bool
    sensors: bool
    seed: int
    push_point: tuple[float, float, float]
    push_link: int


@dataclass(frozen=True)
class Statistics:
    """Work of the integrator since the initialisation."""

    steps: int
    right_hand_sides: int
    jacobians: int
    roots: int
    restarts: int


@contextmanager
def _refusals() -> Iterator[None]:
    try:
        yield
    except ValueError as refused:
        raise PlantError(str(refused)) from None
    except RuntimeError as failed:
        raise SolverError(str(failed)) from None


@contextmanager
def refused_by(rig: Path) -> Iterator[None]:
    """Within, what the plant refuses is the fault of a rig's file: an InputError that begins with it."""
    try:
        yield
    except PlantError as refused:
        raise InputError(f"{rig}: {refused}") from None


def require_plant() -> None:
    """Raises InputError where this installation has no simulated finger."""
    if not HAS_PLANT:
        raise InputError(PLANT_MISSING)


class Plant:
    """A simulated finger: created from the text of an expanded rig, initialised, then run forward in time.

    rig_json: as `Rig.json()` gives it. Raises PlantError with key path, value and expectation.
    Not for use by two threads at a time.
    """

    def __init__(self, rig_json: str | bytes) -> None:
        require_plant()
        with _refusals():
            self._plant = _plant.Plant(rig_json.encode() if isinstance(rig_json, str) else rig_json)

    @property
    def joints(self) -> int:
        return self._plant.joints

    @property
    def tendons(self) -> int:
        return self._plant.tendons

    @property
    def order(self) -> int:
        """Number of continuous states."""
        return self._plant.order

    @property
    def time(self) -> float:
        """s; 0 after the initialisation."""
        return self._plant.time

    @property
    def initialised(self) -> bool:
        return self._plant.initialised

    @property
    def settings(self) -> Settings:
        with _refusals():
            integrator, tolerance, step, motion, pushes, sensors, seed, point, link = self._plant.settings()
        names = {number: name for name, number in INTEGRATORS.items()}
        x, y, z = point
        return Settings(names[integrator], tolerance, step, motion, pushes, sensors, seed, (x, y, z), link)

    def configure(self, **changes: Any) -> None:
        """Changes settings by the names of `Settings`; before the initialisation only."""
        wanted = replace(self.settings, **changes)
        if wanted.integrator not in INTEGRATORS:
            raise PlantError(f"integrator = {wanted.integrator!r}: expected {' or '.join(INTEGRATORS)}")
        with _refusals():
            self._plant.set_settings(
                INTEGRATORS[wanted.integrator],
                wanted.relative_tolerance,
                wanted.step,
                wanted.scheduled_motion,
                wanted.scheduled_pushes,
                wanted.sensors,
                wanted.seed,
                wanted.push_point,
                wanted.push_link,
            )

    def set_inputs(
        self,
        tendon_position_command: Sequence[float] | None = None,
        pretension: float = 0.0,
        push_force: Sequence[float] = (0.0, 0.0, 0.0),
    ) -> None:
        """Held until set again. Commands [m] m (None: as they are), pretension N, push_force [3] N, base frame."""
        command = None if tendon_position_command is None else [float(value) for value in tendon_position_command]
        with _refusals():
            self._plant.set_inputs(command, float(pretension), [float(value) for value in push_force])

    def initialise(self) -> None:
        """Settles the finger, then stands at time 0. Raises SolverError."""
        with _refusals():
            self._plant.initialise()

    def advance(self, time: float) -> None:
        """Integrates up to `time`, s. Raises SolverError; the plant then stands where it stood."""
        with _refusals():
            self._plant.advance(time)

    def reset(self) -> None:
        """Back to before the initialisation, settings kept."""
        with _refusals():
            self._plant.reset()

    def hold_command(self) -> NDArray[np.float64]:
        """[m] m: motor positions that hold the rig's first posture with its pretension."""
        with _refusals():
            return np.array(self._plant.hold_command())

    def run(self, time: Array, signals: Sequence[str] = SIGNALS) -> dict[str, Array]:
        """Advances through increasing times [N] s and gives one row of each signal wanted.

        Returns [N, size] by the names of `SIGNALS`, sizes and units as in tendonfmu_plant_signals; `contact` and
        `friction_level` are [N]; flags are bool. Raises SolverError.
        """
        with _refusals():
            found = self._plant.run(np.ascontiguousarray(time, dtype=np.float64), list(signals))
        for name in FLAGS:
            if name in found:
                found[name] = found[name].astype(bool)
        return {name: array[:, 0] if name in SCALARS else array for name, array in found.items()}

    def save_state(self) -> bytes:
        with _refusals():
            return self._plant.save_state()

    def restore_state(self, state: bytes) -> None:
        """Takes bytes of `save_state` of a plant of the same rig and settings, initialised as this one must be."""
        with _refusals():
            self._plant.restore_state(state)

    @property
    def statistics(self) -> Statistics:
        with _refusals():
            return Statistics(*self._plant.statistics())

    def continuous_state(self) -> NDArray[np.float64]:
        """[order] the state at the present time, in the order of tendonfmu_plant_derivative."""
        with _refusals():
            return self._plant.continuous_state().reshape(-1)

    def derivative(self, time: float, state: Array) -> NDArray[np.float64]:
        """[order] right-hand side of the differential equations at a state [order]."""
        with _refusals():
            slope, _ = self._plant.derivative(time, np.ascontiguousarray(state, dtype=np.float64), False)
        return slope.reshape(-1)

    def jacobian(self, time: float, state: Array) -> NDArray[np.float64]:
        """[order, order] derivative of the right-hand side by the state."""
        with _refusals():
            return self._plant.derivative(time, np.ascontiguousarray(state, dtype=np.float64), True)[1]
