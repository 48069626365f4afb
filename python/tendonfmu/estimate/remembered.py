"""The fit of a finger whose friction remembers, from its recordings to its structure and what the report says of it.

1. The angles are those known best (`best_angles`), whatever source the finger will run on.
2. What of the memory the motion does not show is left out: a relaxation time, or cords that stretch.
3. If the delivered source leaves far more than the best angles, the numbers are fitted to it, too, and the better stay.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from tendonfmu.arrays import Data, Numbers
from tendonfmu.estimate.core_runs import CoreRuns
from tendonfmu.estimate.learning import Learned, Settings, Watch, unknown_names
from tendonfmu.estimate.memory import optional_paths, without_time
from tendonfmu.estimate.methods import Start, learn_batch
from tendonfmu.estimate.slow_drift import SlowDrift
from tendonfmu.estimate.structure import Choice, Structure, build_structure, with_values
from tendonfmu.model import finger_from_data
from tendonfmu.recordings import FitRecording, best_angles

MUCH = 1.5  # times what the best angles leave
SHOWN = 5.4  # of the log likelihood: without what is not there it falls by less in 99.9 % of the cases (χ²/2)


@dataclass(frozen=True)
class Remembered:
    """A fit of friction that remembers."""

    structure: Structure
    learned: Learned
    angles: str  # source of the angles that the numbers were fitted to, in words
    left: Numbers  # [n] rms without a learning bias with these angles, and by the delivered source (N·m)
    left_delivered: Numbers
    left_out: list[str]  # paths of the numbers that the motion does not show

    def entry(self) -> dict[str, object]:
        """Return what a report says."""
        return {
            "angles": self.angles,
            "left": self.left.tolist(),
            "left_delivered": self.left_delivered.tolist(),
            "left_out": self.left_out,
        }

    def sentences(self) -> list[str]:
        """Return what a user should know."""
        return [f"{path} is left out: the motion does not show it" for path in self.left_out]


def learn_remembered(
    structure: Structure,
    choice: Choice,
    recordings: Sequence[FitRecording],
    watch: Watch,
    settings: Settings,
    start: Start | None,
) -> Remembered:
    """Fit a structure with presliding. Raises Interrupted."""
    best = best_angles(structure.start.data, recordings)
    learn = partial(_with_what_shows, structure, choice, watch=watch, settings=settings, start=start)
    found, learned, gone = learn(best.recordings)
    data = _fitted(found, learned)
    source, left, delivered = best.source, left_without_bias(data, best.recordings), left_without_bias(data, recordings)
    if np.sum(delivered**2) > MUCH**2 * np.sum(left**2):
        others = learn(recordings)
        again = left_without_bias(_fitted(*others[:2]), recordings)
        if np.sum(again**2) < np.sum(delivered**2):
            found, learned, gone = others
            source, left, delivered = "the delivered source", again, again
    return Remembered(found, learned, source, left, delivered, gone)


def _with_what_shows(
    structure: Structure,
    choice: Choice,
    recordings: Sequence[FitRecording],
    *,
    watch: Watch,
    settings: Settings,
    start: Start | None,
) -> tuple[Structure, Learned, list[str]]:
    """Fit, and fit again without what the motion does not show."""
    learned, gone = learn_batch(structure, recordings, watch, settings, start), []
    while path := _not_shown(structure, learned):
        fitted = with_values(structure, np.asarray(learned.estimator.values(learned.z)))
        values = dict(zip(unknown_names(learned.estimator), learned.z.tolist(), strict=True))
        gone.append(path)
        data = without_time(structure.start.data, path)
        structure = build_structure(finger_from_data(data, fitted.path), choice)
        learned = learn_batch(structure, recordings, watch, replace(settings, near=True), _start_at(values))
    return structure, learned, gone


def _start_at(values: dict[str, float]) -> Start:
    return lambda names: np.array([values[name] for name in names])


def _not_shown(structure: Structure, learned: Learned) -> str | None:
    """Return the path of a number without which the data are as likely, or None."""
    assert learned.memory is not None
    problem, state = learned.memory.problem, learned.memory.minimum.state
    fitted = {path for names in problem.shared for path in names}
    paths = [path for path in optional_paths(structure.start.data) if path in fitted]
    costs = {path: problem.without(state, path) for path in paths}
    least = min(costs, key=costs.__getitem__, default=None)
    return least if least is not None and costs[least] < state.cost + SHOWN else None


def _fitted(structure: Structure, learned: Learned) -> Data:
    return with_values(structure, np.asarray(learned.estimator.values(learned.z))).data


def left_without_bias(data: Data, recordings: Sequence[FitRecording]) -> Numbers:
    """Return [n] the rms of τ − T less a constant a stretch, over the samples trained on (N·m)."""
    runs = CoreRuns(data, recordings)
    left = SlowDrift(runs.time, runs.stretch, runs.used).without(runs.residual())
    return np.asarray(np.sqrt(np.mean(left**2, axis=0)))
