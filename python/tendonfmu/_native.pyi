"""The compiled module (python/binding/native.cpp). What the runtime refuses is a NativeError."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

class NativeError(ValueError):
    """The runtime refuses a description, an image, a parameter, a sample or a state."""

def version() -> str:
    """Return the version of the compiled runtime."""

def image_from_json(json: str | bytes) -> bytes:
    """Compile a finger description to a model image."""

def image_guid(image: bytes, salt: int) -> str:
    """Return an identifier of an image's content."""

def memory_size(image: bytes) -> int:
    """Return the bytes of memory that a finger of an image needs on this machine."""

class Instance:
    def __init__(self, image: bytes, kinematics_source: int = 1) -> None: ...
    @property
    def joints(self) -> int: ...
    @property
    def tendons(self) -> int: ...
    @property
    def has_links(self) -> bool: ...
    @property
    def watches_motors(self) -> bool:
        """Whether the description has contact.watches_motors. It needs tendon positions with every source."""

    @property
    def watches_sensors(self) -> bool:
        """Whether the description has sensor_fault. It needs tendon positions with every source."""
    # instruction set of the step: "plain", "sse2", "avx2" or "neon"; all give the same bits
    kernel: str
    def set_kinematics_source(self, source: int) -> None: ...
    def reset(self) -> None:
        """Return to the image: its parameters, kinematics source 1, no sample taken."""

    def parameter_rows(self) -> list[tuple[str, float, float, float, bool, bool, str]]: ...
    def get(self, path: str) -> float: ...
    def set(self, values: Mapping[str, float]) -> None:
        """Write parameters by path, all or none."""

    def values(self) -> NDArray[np.float64]:
        """Return all parameter values [p], in canonical order."""

    def save_state(self) -> bytes: ...
    def restore_state(self, bytes: bytes) -> None: ...
    def run(self, recording: Mapping[str, NDArray[Any]], terms: bool = False) -> dict[str, NDArray[Any]]:
        """Take all samples of a recording, [N] (s), and return all outputs, [N, n] [N, m] [N] (N·m, rad).

        terms: with contact_terms [N, n, 4, 8] (N·m).
        """

    def run_guided(
        self, recording: Mapping[str, NDArray[Any]], learns: NDArray[Any], known_torque: NDArray[Any] | None
    ) -> dict[str, NDArray[Any]]:
        """Return the same and `residual_variance`, S, with a bias that learns from some samples, not by contact.

        learns: [N]; known_torque: [N, n] (N·m), taken from τ. S: [N, n] ((N·m)²), NaN until the bias begins.
        """

    def step_outputs(self) -> dict[str, NDArray[Any]]:
        """Return the arrays that `step` writes."""

    def step(
        self,
        time: float,
        tendon_force: NDArray[Any] | None,
        tendon_position: NDArray[Any] | None = None,
        joint_position: NDArray[Any] | None = None,
        joint_velocity: NDArray[Any] | None = None,
    ) -> None:
        """Take one sample, of tendons [m] and joints [n], and write its outputs into the arrays of `step_outputs`."""

    def directional_derivative(self, direction: Mapping[str, NDArray[Any]]) -> dict[str, NDArray[np.float64]]:
        """Return the derivative of the last sample's outputs along a direction of its inputs."""
