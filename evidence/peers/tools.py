"""The tools without a simulator. Each learns a case and gives what predicts the joint torque of unseen motion."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from scipy import optimize

import tendonfmu as tf
from evidence.peers.signals import Case, Signals, filtered, known_load, rows_at, signals_of
from tendonfmu.arrays import Numbers

Error = Callable[[tf.Recording], Numbers]  # [N, n] N·m at RATE: measured torque less the known load and the prediction
Predict = Callable[[Signals], Numbers]


def learned_signals(case: Case) -> Signals:
    return Signals.joined([signals_of(case, recording) for recording in case.learned])


def error_by(case: Case, predict: Predict) -> Error:
    def error(recording: tf.Recording) -> Numbers:
        signals = signals_of(case, recording)
        return signals.torque - predict(signals)

    return error


# --- TendonFMU --------------------------------------------------------------------------------------------------------


def tendonfmu(case: Case) -> Error:
    """What `calibrate` delivers, or `diagnose`, with its bias added again: no other tool follows an offset."""
    if case.calibrated:
        finger = tf.calibrate(case.finger, list(case.learned), kinematics=case.kinematics).finger
    else:
        finger = tf.diagnose(case.finger, list(case.learned), kinematics=case.kinematics).extended

    def error(recording: tf.Recording) -> Numbers:
        outputs = tf.run(finger, recording, kinematics=case.kinematics).outputs
        left = outputs["compensated_torque"] + outputs["bias_torque"] - known_load(recording, outputs["bias_torque"])
        step = float(np.median(np.diff(recording.time)))
        return filtered(left, step)[rows_at(recording, 50.0)]

    return error


# --- regression -------------------------------------------------------------------------------------------------------

WIDTHS = (1e-3, 0.3)  # rad/s, of tanh in place of the sign


def regression(case: Case) -> Error:
    return error_by(case, regressed(case, learned_signals(case)))


def regressed(case: Case, signals: Signals) -> Predict:
    """Coulomb, viscous and load friction of each joint, as papers on tendon-driven joints and robot arms identify them.

    Linear least squares of offset, spring, weight, inertia and friction, none of which drives; the width of the sign by
    a search in one dimension. The load is what the tendons press on the joint: the sum of |arm| · force.
    """
    laws = [best_law(case, signals, j) for j in range(case.arms.shape[1])]

    def predict(given: Signals) -> Numbers:
        return np.column_stack([terms(case, given, j, width) @ numbers for j, (width, numbers) in enumerate(laws)])

    return predict


def best_law(case: Case, signals: Signals, j: int) -> tuple[float, Numbers]:
    """Width of the sign, rad/s, and the numbers of a joint's terms."""
    torque = signals.torque[:, j]

    def solved(width: float) -> optimize.OptimizeResult:
        columns = terms(case, signals, j, width)
        scale = np.maximum(np.linalg.norm(columns, axis=0), 1e-12)
        lowest = np.where(np.arange(columns.shape[1]) < 4, 0.0, -np.inf)  # friction and inertia
        found = optimize.lsq_linear(columns / scale, torque, (lowest, np.inf), method="bvls")
        found.x = found.x / scale
        return found

    best = optimize.minimize_scalar(
        lambda log: solved(np.exp(log)).cost, bounds=np.log(WIDTHS), options={"xatol": 0.05}
    )
    width = float(np.exp(best.x))
    return width, np.asarray(solved(width).x)


def terms(case: Case, signals: Signals, j: int, width: float) -> Numbers:
    """[N, terms]: Coulomb, load, viscous, inertia; offset, spring, weights, inertia of the other joints."""
    velocity = signals.velocity[:, j]
    sign = np.tanh(velocity / width)
    load = np.abs(signals.force) @ np.abs(case.arms[:, j])
    angle = np.cumsum(signals.angle, axis=1)[:, j:] if case.chain else signals.angle
    others = np.delete(signals.acceleration, j, axis=1)
    always = [sign, sign * load, velocity, signals.acceleration[:, j], np.ones_like(sign), signals.angle[:, j]]
    return np.column_stack([*always, np.sin(angle), np.cos(angle), others])


# --- boosted trees ----------------------------------------------------------------------------------------------------

LEAVES, ROUNDS = (8, 31), 200  # of a tree, and trees


def trees(case: Case) -> Error:
    return error_by(case, grown(case, learned_signals(case)))


def grown(case: Case, signals: Signals) -> Predict:
    """Gradient-boosted trees of scikit-learn on all signals; their size is chosen on contiguous parts."""
    from sklearn.ensemble import HistGradientBoostingRegressor
    from sklearn.model_selection import GridSearchCV, KFold

    sizes = {"max_leaf_nodes": LEAVES}
    models = []
    for torque in signals.torque.T:
        model = HistGradientBoostingRegressor(max_iter=ROUNDS, learning_rate=0.05, early_stopping=False, random_state=0)
        search = GridSearchCV(model, sizes, cv=KFold(3), scoring="neg_mean_squared_error")
        models.append(search.fit(features(case, signals), torque).best_estimator_)

    def predict(given: Signals) -> Numbers:
        return np.column_stack([model.predict(features(case, given)) for model in models])

    return predict


def features(case: Case, signals: Signals) -> Numbers:
    """Angles, velocities, accelerations, 0.5 s of history, and forces.

    Where nothing touches the forces hold the answer, which is of no use in contact: only what pulls no joint is given.
    Where a known load was measured the answer is not among them: all are given.
    """
    return np.hstack(
        [signals.angle, signals.velocity, signals.acceleration, signals.history, allowed(case, signals.force)]
    )


def allowed(case: Case, force: Numbers) -> Numbers:
    """[N, k] N."""
    if any("external_torque" in recording.groups for recording in case.learned):
        return force
    pulls, _, _ = np.linalg.svd(case.arms)
    return np.asarray(force @ pulls[:, case.arms.shape[1] :])


def rms_unseen(error: Error, unseen: Sequence[tf.Recording]) -> Numbers:
    """[n] N·m, with the mean of every recording taken out."""
    left = [error(recording) for recording in unseen]
    return np.asarray(np.sqrt(np.mean(np.concatenate([part - part.mean(axis=0) for part in left]) ** 2, axis=0)))
