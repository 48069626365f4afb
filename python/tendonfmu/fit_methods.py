"""The two methods of a fit, over the estimator of `estimation.py`: what they are given, and what they leave."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu.errors import InputError
from tendonfmu.estimation import EstimationError, Estimator, Learner
from tendonfmu.fit_files import with_values
from tendonfmu.fit_recordings import FitRecording
from tendonfmu.fit_structure import Structure

Numbers = NDArray[np.float64]
Start = Callable[[Sequence[str]], Numbers]


@dataclass(frozen=True)
class Progress:
    """Where a fit is. phase: in words. done, total: samples of this phase. cost: so far, NaN where not known."""

    phase: str
    iteration: int
    done: int
    total: int
    cost: float


@dataclass(frozen=True)
class Learned:
    """A finished estimation. covariance: [u, u] of z, prior included; information: [u, u] of the data alone.
    innovations: standardised [N, n] by recording where the method has its own, else empty. warnings: sentences.
    """

    estimator: Estimator
    z: Numbers
    covariance: Numbers
    information: Numbers
    cost: float
    iterations: int
    passes: int
    converged: bool
    innovations: list[Numbers]
    warnings: list[str]


class Interrupted(Exception):
    """The estimation was stopped; what it had. by_user: by Ctrl-C."""

    def __init__(self, estimator: Estimator, z: Numbers, cost: float, by_user: bool) -> None:
        super().__init__("stopped")
        self.estimator, self.z, self.cost, self.by_user = estimator, z, cost, by_user


class Watch:
    """Passes progress on, and remembers that somebody wants to stop: Ctrl-C while the library computes shows here."""

    def __init__(self, progress: Callable[[Progress], bool | None] | None) -> None:
        self._progress = progress
        self.stopped, self.by_user = False, False

    def __call__(self, progress: Progress) -> bool:
        """Whether to go on."""
        try:
            answer = self._progress(progress) if self._progress is not None else None
        except KeyboardInterrupt:
            self.by_user = True
            answer = False
        self.stopped = self.stopped or answer is False
        return not self.stopped


def unknown_names(estimator: Estimator) -> list[str]:
    """[u] path of each unknown with its role: `….drop` is static − coulomb, `….rate` 1/stribeck_velocity."""
    return [
        unknown.path if unknown.role == "value" else f"{unknown.path.rsplit('.', 1)[0]}.{unknown.role}"
        for unknown in estimator.unknowns
    ]


def _estimator(structure: Structure) -> Estimator:
    """Raises InputError: a number whose size nothing tells."""
    try:
        return Estimator(structure.start.image, structure.group, structure.scale)
    except EstimationError as refused:
        raise InputError(f"{structure.start.path}: {refused}") from None


def _starting_point(estimator: Estimator, start: Start | None) -> Numbers:
    if start is None:
        return estimator.start
    low, high = (np.array([getattr(unknown, end) for unknown in estimator.unknowns]) for end in ("lower", "upper"))
    return np.clip(start(unknown_names(estimator)), low, high)


def _rows(recording: FitRecording, part: slice) -> dict[str, Any]:
    """What the estimator takes of one part."""
    external = recording.external
    return {
        "arrays": recording.arrays(part),
        "kinematics_source": recording.kinematics,
        "external_torque": None if external is None else np.ascontiguousarray(external[part]),
        "use": np.ascontiguousarray(recording.train[part]),
    }


def learn_batch(
    structure: Structure,
    recordings: Sequence[FitRecording],
    watch: Watch,
    options: Mapping[str, Any],
    start: Start | None,
) -> Learned:
    """Maximum likelihood. Raises Interrupted."""
    estimator = _estimator(structure)
    begin = _starting_point(estimator, start)
    parts = [(recording, part) for recording in recordings for part in recording.parts]
    learned = [(recording, part) for recording, part in parts if np.count_nonzero(recording.train[part]) > 1]
    if not learned:
        paths = ", ".join(str(recording.path) for recording in recordings)
        raise InputError(f"{paths}: no two samples to learn from between two gaps; expected motion without contact")
    for recording, part in learned:
        estimator.add_recording(**_rows(recording, part))
    best, best_cost = begin, float("nan")

    def show(number: int, stride: int, done: int, total: int, cost: float, z: Numbers) -> bool:
        nonlocal best, best_cost
        best, best_cost = np.array(z, dtype=float), float(cost)
        phase = f"pass {number}" if stride == 1 else f"pass {number}, 1 of {stride} samples"
        return watch(Progress(phase, number, done, total, cost))

    try:
        found = estimator.fit(
            begin,
            prior_std=options["prior"],
            max_passes=options["max_passes"],
            tolerance=options["tolerance"],
            threads=options["threads"],
            progress=show,
        )
    except KeyboardInterrupt:
        raise Interrupted(estimator, best, best_cost, by_user=True) from None
    if watch.stopped or found.stopped:
        raise Interrupted(estimator, found.z, found.cost, watch.by_user)
    return Learned(
        estimator=estimator,
        z=found.z,
        covariance=found.covariance,
        information=found.information,
        cost=found.cost,
        iterations=found.steps,
        passes=found.passes,
        converged=found.converged,
        innovations=[],
        warnings=[] if found.converged else [f"not converged after {found.passes} passes over the data"],
    )


def _slack(samples: int) -> str:
    return f"the filter did not learn from {samples} samples in which the model found a tendon slack"


def learn_ekf(
    structure: Structure,
    recordings: Sequence[FitRecording],
    watch: Watch,
    options: Mapping[str, Any],
    start: Start | None,
) -> Learned:
    """The extended Kalman filter over all recordings in their order, each pass but the first linearised where the one
    before arrived. Raises Interrupted.
    """
    estimator = _estimator(structure)
    learner = _learner(structure, estimator, options, start)
    passes = options["max_passes"]
    innovations: list[Numbers] = []
    for number in range(1, passes + 1):
        if number > 1:
            learner.begin_pass()
        innovations = _filter_once(learner, estimator, recordings, watch, number)
    scale = np.array([unknown.scale for unknown in learner.unknowns])
    prior = np.diag(1 / (options["prior"] * scale) ** 2)
    return Learned(
        estimator=estimator,
        z=learner.z,
        covariance=learner.covariance,
        information=np.asarray(np.linalg.inv(learner.covariance) - prior, dtype=np.float64),
        cost=float("nan"),
        iterations=passes,
        passes=passes,
        converged=True,
        innovations=innovations,
        warnings=[_slack(learner.slack_samples)] if learner.slack_samples else [],
    )


def _filter_once(
    learner: Learner, estimator: Estimator, recordings: Sequence[FitRecording], watch: Watch, number: int
) -> list[Numbers]:
    """Standardised innovations [N, n] by recording, NaN where not trained on."""
    total, before = sum(len(recording.time) for recording in recordings), 0

    def show(done: int, _: int) -> bool:
        return watch(Progress(f"filtering, pass {number}", number, before + done, total, float("nan")))

    innovations = []
    for recording in recordings:
        found = np.full(recording.target.shape, np.nan)
        for part in recording.parts:
            try:
                outputs = learner.run(**_rows(recording, part), progress=show)
            except EstimationError as refused:  # the filter diverges: a unit is wrong, or a scale
                raise InputError(f"{recording.path}: {refused}") from None
            except KeyboardInterrupt:
                raise Interrupted(estimator, learner.z, float("nan"), by_user=True) from None
            if watch.stopped:
                raise Interrupted(estimator, learner.z, float("nan"), watch.by_user)
            found[part] = outputs["innovation"] / np.sqrt(outputs["innovation_variance"])
            before += part.stop - part.start
        innovations.append(np.where(recording.train[:, None], found, np.nan))
    return innovations


def _learner(structure: Structure, estimator: Estimator, options: Mapping[str, Any], start: Start | None) -> Learner:
    """It begins at its description's numbers: on going on, those of the interrupted fit, with the scale as it was."""
    image, scale = structure.start.image, structure.scale
    if start is not None:
        own = np.abs(estimator.values(estimator.start))
        scale = np.where(np.isnan(scale), own, scale)
        image = with_values(structure, estimator.values(_starting_point(estimator, start))).image
    try:
        return Learner(
            image, structure.group, scale, prior_std=options["prior"], parameter_drift=options["parameter_drift"]
        )
    except EstimationError as refused:
        raise InputError(f"{structure.start.path}: {refused}") from None
