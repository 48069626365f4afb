"""The compiled module (python/binding/plant.cpp)."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

class PlantError(ValueError):
    """The plant refuses a rig, a setting, an input, a time or a state. `refused_by` turns it into an InputError."""

class SolverError(PlantError):
    """The integrator failed: time, cause and what to try."""

class Settings:
    """Settings of a plant; see tendonfmu_plant_settings."""

    relative_tolerance: float  # of CVODE
    scheduled_motion: bool  # whether the plant runs the rig's motion, pushes and sensors
    scheduled_pushes: bool
    sensors: bool
    seed: int  # of the sensors' noise
    push_point: tuple[float, float, float]  # point of the pushes [3] (m), in the frame of push_link
    push_link: int  # from 1

class Statistics:
    """Work of the integrator since the initialisation."""

    steps: int
    right_hand_sides: int
    jacobians: int
    roots: int
    restarts: int

class Plant:
    """A simulated finger: created from the text of an expanded rig, initialised, then run forward in time."""

    def __init__(self, rig_json: str) -> None: ...
    @property
    def joints(self) -> int: ...
    @property
    def tendons(self) -> int: ...
    @property
    def order(self) -> int:
        """Number of continuous states."""

    @property
    def time(self) -> float:
        """Present time (s); 0 after the initialisation."""

    @property
    def initialised(self) -> bool: ...
    @property
    def settings(self) -> Settings: ...
    def configure(self, **changes: Any) -> None:
        """Change settings, before the initialisation only."""

    def set_inputs(
        self,
        tendon_position_command: Sequence[float] | NDArray[np.float64] | None = None,
        pretension: float = 0.0,
        push_force: Sequence[float] = (0.0, 0.0, 0.0),
    ) -> None:
        """Set the inputs: [m] (m), N, [3] (N). They are held until they are set again."""

    def initialise(self) -> None:
        """Settle the finger. It is then at time 0."""

    def advance(self, time: float, /) -> None: ...
    def reset(self) -> None:
        """Return to the state before the initialisation. Settings are kept."""

    def hold_command(self) -> NDArray[np.float64]:
        """Return the motor positions [m] (m) that hold the rig's first posture with its pretension."""

    def run(self, time: NDArray[np.float64], signals: Sequence[str] = ...) -> dict[str, NDArray[Any]]:
        """Advance through increasing times [N] (s), and return a row of each signal wanted, [N, size] or [N]."""

    def save_state(self) -> bytes: ...
    def restore_state(self, bytes: bytes, /) -> None: ...
    @property
    def statistics(self) -> Statistics: ...
    def continuous_state(self) -> NDArray[np.float64]:
        """Return the state at the present time, [order], in the order of tendonfmu_plant_derivative."""

    def derivative(self, time: float, state: NDArray[np.float64], /) -> NDArray[np.float64]:
        """Return the right-hand side of the differential equations, [order]."""
