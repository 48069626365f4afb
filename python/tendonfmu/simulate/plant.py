"""How Python calls the simulated finger: the binding of runtime/include/tendonfmu_plant.h.

If SUNDIALS was not found when the package was built, there is no simulated finger. `Plant` then raises
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

from tendonfmu.arrays import Array
from tendonfmu.errors import InputError

# find_spec, not try/except: a module that exists but does not load must raise its error
HAS_PLANT = find_spec("tendonfmu._plant") is not None
if HAS_PLANT:
    from tendonfmu import _plant


PLANT_MISSING = "this installation has no simulated finger (SUNDIALS was not found when it was built)"

# readings of the sensors, and the true signals; sizes as in tendonfmu_plant_signals
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
    """The plant refuses a rig, a setting, an input, a time or a state. `refused_by` turns it into an InputError."""


class SolverError(PlantError):
    """The integrator failed: time, cause and what to try."""


@dataclass(frozen=True)
class Settings:
    """Settings of a plant; see tendonfmu_plant_settings."""

    relative_tolerance: float  # of CVODE
    scheduled_motion: bool  # whether the plant runs the rig's motion, pushes and sensors
    scheduled_pushes: bool
    sensors: bool
    seed: int  # of the sensors' noise
    push_point: tuple[float, float, float]  # point of the pushes [3] (m), in the frame of push_link
    push_link: int  # from 1


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
    """Turn what the plant refuses inside the block into an InputError that starts with the rig's file."""
    try:
        yield
    except PlantError as refused:
        raise InputError(f"{rig}: {refused}") from None


def require_plant() -> None:
    """Check that this installation has a simulated finger."""
    if not HAS_PLANT:
        raise InputError(PLANT_MISSING)


class Plant:
    """A simulated finger: created from the text of an expanded rig, initialised, then run forward in time."""

    def __init__(self, rig_json: str | bytes) -> None:
        require_plant()
        with _refusals():
            self._plant = _plant.Plant(rig_json.encode() if isinstance(rig_json, str) else rig_json)

    @property
    def joints(self) -> int:
        """Number of joints n."""
        return self._plant.joints

    @property
    def tendons(self) -> int:
        """Number of tendons m."""
        return self._plant.tendons

    @property
    def order(self) -> int:
        """Number of continuous states."""
        return self._plant.order

    @property
    def time(self) -> float:
        """Present time (s); 0 after the initialisation."""
        return self._plant.time

    @property
    def initialised(self) -> bool:
        """Whether `initialise` was called."""
        return self._plant.initialised

    @property
    def settings(self) -> Settings:
        """Present settings."""
        with _refusals():
            return Settings(*self._plant.settings())

    def configure(self, **changes: Any) -> None:
        """Change settings, before the initialisation only."""
        wanted = replace(self.settings, **changes)
        with _refusals():
            self._plant.set_settings(
                wanted.relative_tolerance,
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
        """Set the inputs. They are held until they are set again."""
        # tendon_position_command: [m] (m); push_force: [3] (N)
        command = None if tendon_position_command is None else [float(value) for value in tendon_position_command]
        with _refusals():
            self._plant.set_inputs(command, float(pretension), [float(value) for value in push_force])

    def initialise(self) -> None:
        """Settle the finger. It is then at time 0."""
        with _refusals():
            self._plant.initialise()

    def advance(self, time: float) -> None:
        """Integrate up to a time (s)."""
        with _refusals():
            self._plant.advance(time)

    def reset(self) -> None:
        """Return to the state before the initialisation. Settings are kept."""
        with _refusals():
            self._plant.reset()

    def hold_command(self) -> NDArray[np.float64]:
        """Return the motor positions [m] (m) that hold the rig's first posture with its pretension."""
        with _refusals():
            return np.array(self._plant.hold_command())

    def run(self, time: Array, signals: Sequence[str] = SIGNALS) -> dict[str, Array]:
        """Advance through increasing times, and return one row of each signal wanted."""
        # time: [N] (s); returns [N, size] [N]
        with _refusals():
            arrays = self._plant.run(np.ascontiguousarray(time, dtype=np.float64), list(signals))
        for name in FLAGS:
            if name in arrays:
                arrays[name] = arrays[name].astype(bool)
        return {name: array[:, 0] if name in SCALARS else array for name, array in arrays.items()}

    def save_state(self) -> bytes:
        """Return a copy of the state."""
        with _refusals():
            return self._plant.save_state()

    def restore_state(self, state: bytes) -> None:
        """Return to a saved state."""
        with _refusals():
            self._plant.restore_state(state)

    @property
    def statistics(self) -> Statistics:
        """Work of the integrator since the initialisation."""
        with _refusals():
            return Statistics(*self._plant.statistics())

    def continuous_state(self) -> NDArray[np.float64]:
        """Return the state at the present time. Returns [order], in the order of tendonfmu_plant_derivative."""
        with _refusals():
            return self._plant.continuous_state().reshape(-1)

    def derivative(self, time: float, state: Array) -> NDArray[np.float64]:
        """Return the right-hand side of the differential equations. state: [order]; returns [order]."""
        with _refusals():
            return self._plant.derivative(time, np.ascontiguousarray(state, dtype=np.float64)).reshape(-1)
