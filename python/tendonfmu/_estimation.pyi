"""Types of the compiled module (python/binding/estimation.cpp, learner.cpp)."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

Numbers = NDArray[np.float64]

class Estimator:
    def __init__(self, image: bytes, group: NDArray[np.int32] | None = None, scale: Numbers | None = None) -> None: ...
    @property
    def joints(self) -> int: ...
    @property
    def tendons(self) -> int: ...
    @property
    def unknown_count(self) -> int: ...
    @property
    def parameter_count(self) -> int: ...
    def unknown(self, index: int) -> tuple[str, int, list[int], float, float, float, float]: ...
    def values(self, z: Numbers | None) -> Numbers: ...
    def unknown_values(self, values: Numbers | None) -> Numbers: ...
    def add_recording(
        self,
        time: Numbers | None,
        tendon_force: Numbers | None,
        tendon_position: Numbers | None = None,
        joint_position: Numbers | None = None,
        joint_velocity: Numbers | None = None,
        kinematics_source: int = 1,
        external_torque: Numbers | None = None,
        use: NDArray[np.uint8] | None = None,
        silent: NDArray[np.uint8] | None = None,
    ) -> int: ...
    def set_weights(self, recording: int, weight: Numbers) -> None: ...
    def set_known(self, information: Numbers) -> None: ...
    def evaluate(self, z: Numbers | None, stride: int = 1, threads: int = 0) -> tuple[float, Numbers, Numbers]: ...
    def jacobian(
        self, recording: int, z: Numbers | None, first: int, blocks: int, length: int
    ) -> tuple[Numbers, Numbers, Numbers, Numbers]: ...
    def innovations(self, recording: int, z: Numbers | None) -> tuple[Numbers, Numbers, Numbers]: ...
    def fit(
        self,
        start: Numbers | None,
        prior_std: float,
        tolerance: float,
        passes: int,
        stride: int,
        threads: int,
        watch: Callable[..., Any] | None = None,
    ) -> dict[str, Any]: ...

class Learner:
    def __init__(
        self,
        image: bytes,
        group: NDArray[np.int32] | None = None,
        scale: Numbers | None = None,
        prior_std: float = 1.0,
        block: int = 8,
        parameter_drift: float = 0.0,
    ) -> None: ...
    @property
    def joints(self) -> int: ...
    @property
    def tendons(self) -> int: ...
    @property
    def unknown_count(self) -> int: ...
    @property
    def slack_samples(self) -> int: ...
    def unknown(self, index: int) -> tuple[str, int, list[int], float, float, float, float]: ...
    def run(
        self,
        time: Numbers | None,
        tendon_force: Numbers | None,
        tendon_position: Numbers | None = None,
        joint_position: Numbers | None = None,
        joint_velocity: Numbers | None = None,
        kinematics_source: int = 1,
        external_torque: Numbers | None = None,
        use: NDArray[np.uint8] | None = None,
        watch: Callable[..., Any] | None = None,
    ) -> tuple[Numbers, Numbers, int]: ...
    def begin_pass(self) -> None: ...
    def values(self) -> tuple[Numbers, Numbers]: ...
    def unknown_values(self) -> tuple[Numbers, Numbers]: ...
    def bias(self) -> tuple[Numbers, Numbers]: ...
