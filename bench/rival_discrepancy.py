"""A discrepancy of the model as Kennedy and O'Hagan have it (JRSS B 63 (2001)): it predicts what is left, unnamed.

y = T + δ(q, q̇, f) + bias + noise: T is the nominal model with its fitted numbers, δ a Gaussian process for each joint
over all joint angles, all joint velocities and the tendons' mean force (squared exponential kernel with a length for
each input, white noise; hyperparameters by the marginal likelihood; scikit-learn), learned from 400 random blocks of
10 ms. The numbers of T are not fitted again with δ: it gets what they leave. One mean force in place of all forces was
chosen on five cases (a spring and a load friction on matched rigs, numpy 04, 06 and 10): on unseen recordings it
predicts better and takes less time.

Its gain is that of `diagnose`: 1 − rms ratio with and without δ of the residual on raw samples of recordings that
nothing was fitted to, before the bias update.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

from tendonfmu.diagnosis.cause_search import residual_alone, series_of
from tendonfmu.diagnosis.series import make_grid
from tendonfmu.estimate.evaluation import model_over, residuals
from tendonfmu.recordings.prepared import FitRecording
from tendonfmu.recordings.residuals import Model

Numbers = NDArray[np.float64]
Processes = list[GaussianProcessRegressor]

BLOCKS = 400
SEED = 0


def gain_of_discrepancy(
    data: Mapping[str, Any], training: Sequence[FitRecording], tests: Sequence[FitRecording]
) -> float:
    """1 − rms ratio on the tests. data: the fitted nominal description, with the settings for raw samples."""
    scale, processes = learned(data, training)
    sums = np.zeros(2)
    for test in tests:
        model = model_over(data, test)
        inputs = inputs_of(model.joint_angle, model.joint_speed, test.recording.groups["tendon_force"])
        seen = test.tracked & np.isfinite(inputs).all(axis=1)
        correction = np.zeros_like(test.target)
        correction[seen] = np.column_stack([each.predict(inputs[seen] / scale) for each in processes])
        for k, own in enumerate((model, corrected(model, correction))):
            sums[k] += float(np.nansum(residuals(data, test, own).residual[seen] ** 2))
    return 1.0 - float(np.sqrt(sums[1] / sums[0]))


def inputs_of(angle: Numbers, velocity: Numbers, force: Numbers) -> Numbers:
    """[N, 2n + 1] of δ. angle, velocity: [N, n] of the joints. force: [N, m] of the tendons."""
    return np.column_stack([angle, velocity, np.abs(force).mean(axis=1)])


def corrected(model: Model, correction: Numbers) -> Model:
    return replace(model, torque=model.torque + correction)


def learned(data: Mapping[str, Any], training: Sequence[FitRecording]) -> tuple[Numbers, Processes]:
    """[2n + 1] scale of the inputs, and a process for each joint."""
    series = series_of(data, training, make_grid(training))
    left = residual_alone(data, series)[series.used]
    inputs = inputs_of(series.angle, series.velocity, series.force)[series.used]
    scale = np.maximum(inputs.std(axis=0), 1e-12)
    rows = np.random.default_rng(SEED).permutation(len(inputs))[:BLOCKS]
    kernel = ConstantKernel() * RBF(np.ones(inputs.shape[1])) + WhiteKernel()
    found = []
    for joint in range(left.shape[1]):
        process = GaussianProcessRegressor(kernel, normalize_y=True, random_state=SEED)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of inputs that tell nothing: their lengths end at a bound
            found.append(process.fit(inputs[rows] / scale, left[rows, joint]))
    return scale, found
