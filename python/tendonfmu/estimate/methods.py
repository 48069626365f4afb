"""The two methods of a fit, maximum likelihood and Kalman filter, over the estimator of `estimation.py`.

Both first fit with each sample counting as one. If the residuals are then not white, each sample counts for its share
of an effective number of samples (`sample_weights`), by joint and stretch of a recording, and the fit is repeated
with these weights: they shift the balance of data and prior, the estimates and their covariance.


The residuals are measured once, at the first fit. A fit that the prior holds back has residuals of a wrong model, which
are more strongly correlated.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from tendonfmu.arrays import Numbers
from tendonfmu.errors import InputError, NothingLeftError
from tendonfmu.estimate.estimation import BatchResult, EstimationError, Estimator, Learner
from tendonfmu.estimate.learning import (
    GUESS,
    FitProgress,
    FrictionFitOptions,
    Interrupted,
    Learned,
    Prior,
    Settings,
    Watch,
    inverse,
    most_likely,
)
from tendonfmu.estimate.memory import has_memory
from tendonfmu.estimate.memory_methods import learn_with_memory, learned_with_memory_at, stroke_time
from tendonfmu.estimate.structure import Structure
from tendonfmu.files import counted
from tendonfmu.recordings import FitRecording
from tendonfmu.statistics import sample_weights


def _estimator(structure: Structure, recordings: Sequence[FitRecording]) -> Estimator:
    """Build the estimator. Raises InputError if nothing gives the size of a number."""
    # a bias that does not learn at rest must not forget there what it holds
    rests = any(recording.silent.any() for recording in recordings)
    try:
        start = structure.start
        held = start.replace({"bias.forget_rate": 0.0, "bias.forgetting": "time"}) if rests else start
        return Estimator(held.image, structure.group, structure.scale)
    except EstimationError as refused:
        raise InputError(f"{structure.start.path}: {refused}") from None


def _rows(recording: FitRecording, part: slice) -> dict[str, Any]:
    """Return the arguments of the estimator for one part of a recording."""
    external = recording.external
    return {
        "arrays": recording.arrays(part),
        "kinematics_source": recording.kinematics,
        "external_torque": None if external is None else np.ascontiguousarray(external[part]),
        "use": np.ascontiguousarray(recording.train[part]),
    }


def _add_recordings(estimator: Estimator, recordings: Sequence[FitRecording]) -> list[tuple[int, slice]]:
    """Add each stretch with samples to learn from; return the index of its recording and its rows."""
    added = []
    for place, recording in enumerate(recordings):
        for part in recording.parts:
            if np.count_nonzero(recording.train[part]) > 1:
                estimator.add_recording(**_rows(recording, part), silent=recording.silent[part])
                added.append((place, part))
    if not added:
        paths = ", ".join(str(recording.path) for recording in recordings)
        raise NothingLeftError(f"{paths}: no two samples to learn from without a gap; expected motion without contact")
    return added


def _measured_weights(
    estimator: Estimator,
    z: Numbers,
    recordings: Sequence[FitRecording],
    added: Sequence[tuple[int, slice]],
    settings: Settings,
) -> list[Numbers]:
    """Measure by recording [N, n] the weight of each sample from the residuals at z [u]."""
    weights = [np.ones_like(recording.target) for recording in recordings]
    most = 1.0 if settings.previous is None else settings.previous.share
    for number, (place, part) in enumerate(added):
        innovation, variance, _ = estimator.innovations(number, z)  # the variance is NaN where nothing is learned
        step = float(np.median(np.diff(recordings[place].time[part])))
        stroke = stroke_time(recordings[place].model.joint_speed[part], step)
        measured = sample_weights(innovation / np.sqrt(variance), step, stroke)
        weights[place][part] = np.minimum(measured, most)
    return weights


def learn_batch(structure: Structure, recordings: Sequence[FitRecording], watch: Watch, settings: Settings) -> Learned:
    """Estimate by maximum likelihood. Raises Interrupted."""
    estimator = _estimator(structure, recordings)
    begin = estimator.start
    if settings.begin is not None:
        begin = _within(estimator, estimator.unknown_values(structure.values_of(settings.begin)))
    if structure.needs_runs:
        return learn_with_memory(structure, estimator, recordings, watch, settings, begin)
    added = _add_recordings(estimator, recordings)
    prior = Prior.of(estimator, settings)
    given = settings.options.prior
    covariance = prior.of_spread(GUESS if given is None else given)
    result = _fitted(estimator, begin, covariance, settings, watch, "")
    steps, passes = result.steps, result.passes
    weights = [np.ones_like(recording.target) for recording in recordings]
    if settings.options.effective_samples:
        weights = _measured_weights(estimator, result.z, recordings, added, settings)
    is_coloured = any((each < 1).any() for each in weights)
    if is_coloured:
        for number, (place, part) in enumerate(added):
            estimator.set_weights(number, weights[place][part.start])
    if is_coloured or given is None:
        if given is None:
            _, gradient, information = estimator.evaluate(result.z)
            passes += 1
            pull = information @ (result.z - estimator.start) - gradient
            covariance = most_likely(information, pull, prior)
        what = ", with effective samples" if is_coloured else ""
        result = _fitted(estimator, result.z, covariance, settings, watch, what)
        steps, passes = steps + result.steps, passes + result.passes
    return Learned(
        estimator=estimator,
        z=result.z,
        covariance=result.covariance if given is not None else prior.posterior(result.information),
        prior=prior.reported(given),
        information=result.information,
        cost=result.cost,
        iterations=steps,
        passes=passes,
        converged=result.converged,
        weights=weights,
        warnings=[]
        if result.converged
        else [f"not converged after {counted(result.passes, 'pass', 'passes')} over the data"],
    )


def learned_at(structure: Structure, recordings: Sequence[FitRecording]) -> Learned:
    """Return what recordings tell of numbers that were fitted to them; the estimate is the start of the structure."""
    estimator, settings = _estimator(structure, recordings), Settings(FrictionFitOptions(), passes=1)
    if structure.needs_runs:
        return learned_with_memory_at(structure, estimator, recordings, settings)
    added = _add_recordings(estimator, recordings)
    weights = _measured_weights(estimator, estimator.start, recordings, added, settings)
    for number, (place, part) in enumerate(added):
        estimator.set_weights(number, weights[place][part.start])
    cost, _, information = estimator.evaluate(estimator.start)
    prior = Prior.of(estimator, settings)
    return Learned(
        estimator=estimator,
        z=estimator.start,
        covariance=prior.posterior(information),
        prior=prior.reported(None),
        information=information,
        cost=cost,
        iterations=0,
        passes=1,
        converged=True,
        weights=weights,
    )


def _fitted(
    estimator: Estimator, begin: Numbers, prior: Numbers, settings: Settings, watch: Watch, what: str
) -> BatchResult:
    """Fit from `begin` [u]. `what` is added to the words of each phase. Raises Interrupted."""
    best = begin
    estimator.set_known(inverse(prior))  # [u, u]

    def show(number: int, stride: int, done: int, total: int, cost: float, z: Numbers) -> bool:
        nonlocal best
        best = np.array(z, dtype=float)
        phase = f"pass {number}" if stride == 1 else f"pass {number}, 1 of {stride} samples"
        return watch(FitProgress(f"{phase}{what}", number, done, total, cost))

    try:
        result = estimator.fit(
            begin,
            prior_std=np.inf,
            max_passes=settings.passes,
            tolerance=settings.options.tolerance,
            threads=settings.options.threads,
            progress=show,
        )
    except KeyboardInterrupt:
        raise Interrupted(estimator, best, by_user=True) from None
    if watch.stopped or result.stopped:
        raise Interrupted(estimator, result.z, watch.by_user)
    return result


def learn_ekf(structure: Structure, recordings: Sequence[FitRecording], watch: Watch, settings: Settings) -> Learned:
    """Estimate by the extended Kalman filter over all recordings in order. Raises Interrupted."""
    if structure.needs_runs:
        what = "presliding" if has_memory(structure.start.data) else "a number of an extension"
        raise InputError(
            f"{structure.start.path}: {what}: the Kalman filter has no derivatives of it; expected --method batch, or "
            f"{'a description without presliding' if has_memory(structure.start.data) else '--fix extensions*'}"
        )
    estimator = _estimator(structure, recordings)
    learner = _learner(structure, settings)
    innovations: list[Numbers] = []
    for number in range(1, settings.passes + 1):
        if number > 1:
            learner.begin_pass()
        innovations = _filter_once(learner, estimator, recordings, watch, number)
    z, covariance = learner.z, learner.covariance
    prior, given = Prior.of(estimator, settings), settings.options.prior
    begun = GUESS if given is None else given
    plain = np.diag(1 / (begun * np.array([unknown.scale for unknown in learner.unknowns])) ** 2)
    information = np.asarray(np.linalg.inv(covariance) - plain, dtype=np.float64)
    weights = [np.ones_like(recording.target) for recording in recordings]
    if settings.options.effective_samples and settings.options.drift == 0:
        weights = _common_weight(estimator, z, recordings, settings)
    share = float(weights[0][0, 0])
    if share < 1 or settings.previous is not None or (given is None and settings.options.drift == 0):
        # information of the data alone
        mean = estimator.start
        pull = np.asarray(share * np.linalg.solve(covariance, z - mean), dtype=np.float64)
        information = share * information
        about = most_likely(information, pull, prior) if given is None else prior.of_spread(given)
        found = np.asarray(np.linalg.inv(information + inverse(about)), dtype=np.float64)
        z = _within(estimator, mean + found @ pull)
        covariance = prior.posterior(information) if given is None else found
    return Learned(
        estimator=estimator,
        z=z,
        covariance=covariance,
        prior=prior.reported(given),
        information=information,
        cost=float("nan"),
        iterations=settings.passes,
        passes=settings.passes,
        converged=True,
        weights=weights,
        innovations=innovations,
        warnings=[f"the filter did not learn from {counted(slack, 'sample')} in which the model found a tendon slack"]
        if (slack := learner.slack_samples)
        else [],
    )


def _common_weight(
    estimator: Estimator, z: Numbers, recordings: Sequence[FitRecording], settings: Settings
) -> list[Numbers]:
    """Return by recording [N, n] one weight for all samples: the share of all samples trained on together."""
    weights = _measured_weights(estimator, z, recordings, _add_recordings(estimator, recordings), settings)
    trained = np.concatenate([each[recording.train] for each, recording in zip(weights, recordings, strict=True)])
    return [np.full_like(each, trained.mean()) for each in weights]


def _within(estimator: Estimator, z: Numbers) -> Numbers:
    low, high = (np.array([getattr(unknown, end) for unknown in estimator.unknowns]) for end in ("lower", "upper"))
    return np.asarray(np.clip(z, low, high))


def _filter_once(
    learner: Learner, estimator: Estimator, recordings: Sequence[FitRecording], watch: Watch, number: int
) -> list[Numbers]:
    """Return by recording [N, n] the standardised innovations, NaN where not trained on."""
    total, before = sum(len(recording.time) for recording in recordings), 0

    def show(done: int, _: int) -> bool:
        return watch(FitProgress(f"filtering, pass {number}", number, before + done, total, float("nan")))

    innovations = []
    for recording in recordings:
        standardised = np.full(recording.target.shape, np.nan)
        for part in recording.parts:
            try:
                outputs = learner.run(**_rows(recording, part), progress=show)
            except EstimationError as refused:  # the filter diverges: a unit or a scale is wrong
                raise InputError(f"{recording.path}: {refused}") from None
            except KeyboardInterrupt:
                raise Interrupted(estimator, learner.z, by_user=True) from None
            if watch.stopped:
                raise Interrupted(estimator, learner.z, watch.by_user)
            standardised[part] = outputs["innovation"] / np.sqrt(outputs["innovation_variance"])
            before += part.stop - part.start
        innovations.append(np.where(recording.train[:, None], standardised, np.nan))
    return innovations


def _learner(structure: Structure, settings: Settings) -> Learner:
    try:
        prior = GUESS if settings.options.prior is None else settings.options.prior
        return Learner(
            structure.start.image,
            structure.group,
            structure.scale,
            prior_std=prior,
            parameter_drift=settings.options.drift,
        )
    except EstimationError as refused:
        raise InputError(f"{structure.start.path}: {refused}") from None
