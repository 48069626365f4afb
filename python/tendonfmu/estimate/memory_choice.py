"""Which form of memory a finger's friction has: none, relative or absolute, relaxing, with cords that stretch, doubled.

Each form is fitted from several starts to the same windows of the recordings and judged by its error on contiguous
parts that are held out: all numbers are refitted without a part by one Gauss-Newton step from the whole fit. A form
with more numbers must be better by `MATERIAL` and by `CERTAIN` standard errors over the parts, else the simpler one
stays. Parts are added to the relative and to the absolute form, and the better end is taken.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from tendonfmu.arrays import Data, Numbers
from tendonfmu.estimate.core_runs import CoreRuns, SlowDrift
from tendonfmu.estimate.estimation import Estimator
from tendonfmu.estimate.fit_report import MemoryEntry
from tendonfmu.estimate.learning import Learned, Settings, Watch
from tendonfmu.estimate.memory import (
    CHOSEN,
    CORDS,
    FILTERED,
    FOLLOWS,
    PRESLIDING,
    STRETCH,
    memory_rows,
    memory_values,
    optional_paths,
    with_rows,
    without_time,
)
from tendonfmu.estimate.memory_fit import MemoryProblem, Minimum, minimise
from tendonfmu.estimate.memory_methods import STEP, coarse_problem, from_starts, full_problem, guess_prior, no_show
from tendonfmu.estimate.methods import learn_batch
from tendonfmu.estimate.structure import Choice, Structure, build_structure, with_values
from tendonfmu.model import Finger, effects, moment_arms, number_of
from tendonfmu.recordings import FitRecording, best_angles, make_grid, on_encoders

Row = dict[str, Any]  # of `extensions`
Rows = tuple[Row, ...]

FOLDS = 8
NEAR = 1.5  # times the least squared error of a whole form: with its parts another one may be better
MATERIAL, CERTAIN = 0.05, 1.64  # of the rms, and standard errors over the folds
DISTANCE = 2e-4  # m, to start from: what a cord on a pulley moves before it slips
STEPS, TOLERANCE = 12, 0.3
TIME = 0.1  # s, between the starts of `memory`
SPLIT, SHARE = 0.4, 0.8  # ratio of a doubled element's numbers to the single one's, and share of the softer one
OTHERWISE = 0.96  # of the squared error, with another value of what is chosen: no number is fitted for it
TYPICAL = 0.03  # friction of a place
LONGER = 1.0, 30.0  # times the distance: relaxation within a sample imitates friction without any


@dataclass(frozen=True)
class Form:
    """A form of the memory, fitted."""

    name: str
    rows: Rows  # of extensions
    finger: Finger  # with the fitted numbers
    errors: Numbers  # [K] squared error of each part held out, in variances of the plain model
    numbers: int  # how many were fitted

    def is_better_than(self, other: Form) -> bool:
        """Return whether it is clearly better: materially and certainly."""
        gain = other.errors - self.errors
        certain = gain.sum() > CERTAIN * np.sqrt(len(gain)) * gain.std(ddof=1)
        return bool(certain and self.errors.sum() < (1.0 - MATERIAL) ** 2 * other.errors.sum())


@dataclass(frozen=True)
class MemoryChoice:
    """The form that was chosen, and all that were tried."""

    finger: Finger
    form: Form
    tried: tuple[Form, ...]


def choose_memory(
    finger: Finger, recordings: Sequence[FitRecording], choice: Choice | None = None, *, threads: int = 0
) -> MemoryChoice:
    """Fit the forms of the memory, in place of what is described, to free motion, and choose one."""
    search = _Search(finger, recordings, choice or Choice(), threads)
    plain = search.fit("none", ())
    force = float(np.mean([recording.mean_force for recording in recordings]))
    forms = [search.whole(name, rows) for name, rows in _whole_forms(finger.data, force)]
    least = min(form.errors.sum() for form in forms)
    grown = [search.grown(form) for form in forms if form.errors.sum() < NEAR * least]
    best = min(grown, key=lambda form: form.errors.sum())
    best = search.simpler(plain, best)
    return MemoryChoice(search.refined(best), best, tuple(search.tried))


class _Search:
    """Fits of forms to the same windows."""

    def __init__(self, finger: Finger, recordings: Sequence[FitRecording], choice: Choice, threads: int) -> None:
        self._finger, self._recordings, self._choice = finger, recordings, choice
        self._threads, self._grid = threads, make_grid(recordings, STEP)
        self._variance: Numbers | None = None  # [n] of what the plain model leaves
        self.tried: list[Form] = []

    def fit(self, name: str, *rows: Rows, near: Form | None = None) -> Form:
        """Fit a form: from the starts of `memory.starts`, or from rows near another form and from its numbers."""
        structure, estimator = self._structure(rows[0])
        problem = coarse_problem(structure, estimator, self._recordings, self._grid, self._threads)
        begin = estimator.start if near is None else self._numbers_of(estimator, with_rows(near.finger.data, *rows[0]))
        memories = None if near is None else [memory_values(with_rows(self._finger.data, *each)) for each in rows]
        end = from_starts(problem, begin, TOLERANCE, no_show(problem, name), memories)[0]
        found = minimise(problem, end, STEPS, TOLERANCE)
        if self._variance is None:
            self._variance = problem.variance(found.state.residual)
        fitted = with_values(structure, estimator.values(problem.unknowns_at(found.state)))
        memory = tuple(dict(row) for _, row in memory_rows(fitted.data))
        form = Form(name, memory, fitted, held_out_errors(problem, found, self._variance), len(found.state.u))
        self.tried.append(form)
        return form

    def whole(self, name: str, rows: Rows) -> Form:
        """Fit a form with the travel of the angles or with that of the filtered velocity, whichever leaves less."""
        return self._otherwise(self.fit(name, rows), FILTERED, "filtered")

    def _otherwise(self, form: Form, key: str, what: str) -> Form:
        """Return a form with another value of what is chosen, if it leaves less; with measured velocities no filter."""
        if key == FILTERED and any(recording.kinematics == 3 for recording in self._recordings):
            return form
        is_on = any(row.get(key) for row in form.rows)
        bare = tuple({name: value for name, value in row.items() if name != key} for row in form.rows)
        changed = bare if is_on else _changed(bare, lambda _: {key: 1.0})
        other = self.fit(f"{form.name}, {'not ' if is_on else ''}{what}", changed, near=form)
        return other if other.errors.sum() < OTHERWISE * form.errors.sum() else form

    def refined(self, form: Form) -> Finger:
        """Return the finger with a form that is fitted to all samples."""
        structure, estimator = self._structure(form.rows)
        begin = self._numbers_of(estimator, form.finger.data)
        problem = full_problem(structure, estimator, self._recordings, self._grid, self._threads)
        problem.mean, problem.known = guess_prior(problem)
        found = minimise(problem, problem.state(problem.scale.coordinates(begin)), 30, TOLERANCE, rough=True)
        return with_values(structure, estimator.values(problem.unknowns_at(found.state)))

    def grown(self, form: Form) -> Form:
        """Return a form with the parts that make it clearly better; friction held may follow the limit."""
        by_limit = _changed(form.rows, lambda _: {FOLLOWS: 1.0})
        following = self.fit(f"{form.name}, by limit", by_limit, near=form)
        if not following.is_better_than(form):
            return self._with_parts(form)
        return self.simpler(self._with_parts(following), self._with_parts(form))

    def _with_parts(self, form: Form) -> Form:
        """Return a form with the parts that make it clearly better, and without those that do not."""
        data = self._finger.data
        cords = ({"effect": CORDS, "stiffness": stiffness} for stiffness in STRETCH)
        best = self.simpler(form, self.fit(f"{form.name}, cords", *[(*form.rows, row) for row in cords], near=form))
        lasting = tuple({key: value for key, value in row.items() if key != "relaxation_time"} for row in best.rows)
        starts = [_scaled(lasting, factor) for factor in LONGER]
        best = self.simpler(self.fit(f"{best.name}, no relaxation", *starts, near=best), best)
        whole = best
        best = self.simpler(best, self.fit(f"{best.name}, levels", _by_level(data, best.rows), near=best))
        single = best
        best = self.simpler(best, self.fit(f"{best.name}, two elements", _doubled(best.rows), near=best))
        if best is not single is whole:  # levels may differ in both elements only
            best = self.simpler(best, self.fit(f"{best.name}, levels", _by_level(data, best.rows), near=best))
        best = self._otherwise(self._otherwise(best, FILTERED, "filtered"), FOLLOWS, "by limit")
        rigid = tuple(row for row in best.rows if row["effect"] != CORDS)
        if 2 <= len(rigid) < len(best.rows):  # what came after the cords may have replaced them
            best = self.simpler(self.fit(f"{best.name}, no cords", rigid, near=best), best)
        return best

    def simpler(self, first: Form, second: Form) -> Form:
        """Return the second form if it is clearly better than the first, else the first."""
        return second if second.is_better_than(first) else first

    def _structure(self, rows: Rows) -> tuple[Structure, Estimator]:
        data = with_rows(self._finger.data, *rows)
        choice = replace(self._choice, share=(*self._choice.share, *_shared(rows)))
        structure = build_structure(self._finger.with_data(data), choice)
        return structure, Estimator(structure.start.image, structure.group, structure.scale)

    def _numbers_of(self, estimator: Estimator, data: Data) -> Numbers:
        """Return the unknowns z [u] of a description of this structure, whose numbers may be rounded out of a box."""
        numbers = estimator.unknown_values(self._finger.with_data(data).model.instance().values())
        ends = np.array([(each.lower, each.upper) for each in estimator.unknowns])
        return np.asarray(np.clip(numbers, *ends.T))


def held_out_errors(problem: MemoryProblem, found: Minimum, variance: Numbers) -> Numbers:
    """Return [K] the squared error of each contiguous part, refitted without it, in units of variances [n]."""
    residual, columns = found.state.residual / np.sqrt(variance), found.linearised.columns / np.sqrt(variance)[:, None]
    parts = [part.reshape(-1, columns.shape[2]) for part in np.array_split(columns, FOLDS)]
    left = [part.ravel() for part in np.array_split(residual, FOLDS)]
    grams = [part.T @ part for part in parts]
    scores = [part.T @ own for part, own in zip(parts, left, strict=True)]
    ridge = problem.known + 1e-9 * np.diag(np.diag(sum(grams))) + 1e-12 * np.eye(len(problem.known))
    whole, pull, errors = sum(grams) + ridge, sum(scores), []
    for own, gram, score in zip(left, grams, scores, strict=True):
        away = -np.linalg.solve(whole - gram, pull - score)
        errors.append(float(own @ own + 2.0 * away @ score + away @ gram @ away))
    return np.array(errors)


# --- forms ------------------------------------------------------------------------------------------------------------


def _whole_forms(data: Data, force: float) -> list[tuple[str, Rows]]:
    """Return one distance and one stiffness for everything, both relaxing. force: mean of the tendons (N)."""
    relaxing: dict[str, Any] = {"relaxation_time": TIME}
    thresholds = [number_of(data, f"velocity_threshold.{which}") for which in ("tendon", "joint")]
    if min(thresholds) > 0.0:
        relative: Rows = ({"effect": PRESLIDING, "displacement": DISTANCE / thresholds[0], **relaxing},)
    else:
        lengths = [DISTANCE / (_mean_square_arm(data, j) ** 0.5 or 1.0) for j in range(len(data["joints"]))]
        relative = _rows_of_places(data, "displacement", DISTANCE, lengths, relaxing)
    stiffness = _friction(data) * force / DISTANCE
    return [("relative", relative), ("absolute", ({"effect": PRESLIDING, "stiffness": stiffness, **relaxing},))]


def _rows_of_places(data: Data, key: str, at_tendons: float, at_joints: Sequence[float], others: Data) -> Rows:
    """Return a row for each level with friction of tendons, and for each joint with friction of its own."""
    places = list(effects(data))
    levels = sorted({each.drive for each in places if each.tendon})
    joints = sorted({each.joint for each in places if not each.tendon})
    return (
        *({"effect": PRESLIDING, "level": j, key: at_tendons, **others} for j in levels),
        *({"effect": PRESLIDING, "joint": j, key: at_joints[j - 1], **others} for j in joints),
    )


def _by_level(data: Data, rows: Rows) -> Rows:
    """Return rows of a whole finger as rows of its levels and joints with the same values."""
    split: list[dict[str, Any]] = []
    for row in rows:
        if row["effect"] != PRESLIDING or {"joint", "level"} & set(row):
            split.append(row)
            continue
        others: dict[str, Any] = {name: row[name] for name in ("relaxation_time", "share", *CHOSEN) if name in row}
        if "displacement" in row:
            at = [row["displacement"] * number_of(data, f"velocity_threshold.{which}") for which in ("tendon", "joint")]
            split += _rows_of_places(data, "displacement", at[0], [at[1]] * len(data["joints"]), others)
        else:
            joints = [row["stiffness"] * _mean_square_arm(data, j) for j in range(len(data["joints"]))]
            split += _rows_of_places(data, "stiffness", row["stiffness"], joints, others)
    return tuple(split)


def _shared(rows: Rows) -> list[str]:
    """Return the patterns of what all rows share: they relax alike, and second elements have the same share."""
    return [f"extensions[*].{key}" for key in ("relaxation_time", "share") if sum(key in row for row in rows) > 1]


def _scaled(rows: Rows, factor: float) -> Rows:
    """Return rows with distances, or the inverse of stiffnesses, times a factor."""
    powers = {"displacement": 1.0, "stiffness": -1.0}
    return _changed(rows, lambda row: {key: row[key] * factor**p for key, p in powers.items() if key in row})


def _changed(rows: Rows, change: Callable[[Row], Row]) -> Rows:
    """Return rows of the memory with other numbers of their elements."""
    return tuple({**row, **change(row)} if row["effect"] == PRESLIDING else row for row in rows)


def _doubled(rows: Rows) -> Rows:
    """Return two elements in place of each, a stiffer one and a softer one with a share."""
    pairs = zip(_scaled(rows, SPLIT), _scaled(rows, 1.0 / SPLIT), strict=True)
    return tuple(
        row
        for stiff, soft in pairs
        for row in ([stiff, {**soft, "share": SHARE}] if stiff["effect"] == PRESLIDING else [stiff])
    )


def _friction(data: Data) -> float:
    """Return the mean Coulomb friction of a place of a tendon."""
    laws = [law.get("positive") or law for each in effects(data) if each.tendon for law in each.laws]
    return float(np.mean([law["coulomb"] for law in laws])) if laws else TYPICAL


def _mean_square_arm(data: Data, joint: int) -> float:
    """Return Σ r²/m at a joint, from 0 (m²)."""
    return float(np.mean(moment_arms(data)[:, joint] ** 2))


# --- a fit of friction that remembers ---------------------------------------------------------------------------------
# 1. The angles are those known best (`best_angles`), whatever source the finger will run on.
# 2. What of the memory the motion does not show is left out: a relaxation time, or cords that stretch.
# 3. If the delivered source leaves far more than the best angles, the numbers are fitted to it, too, and the better
#    stay. Then the user should know what the joint encoders would leave.


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
    advice: list[str]  # sentences about a better source

    def entry(self) -> MemoryEntry:
        """Return what a report says."""
        return {
            "angles": self.angles,
            "left": self.left.tolist(),
            "left_delivered": self.left_delivered.tolist(),
            "left_out": self.left_out,
        }

    def sentences(self) -> list[str]:
        """Return what a user should know."""
        return [*(f"{path} is left out: the motion does not show it" for path in self.left_out), *self.advice]


def learn_remembered(
    structure: Structure,
    choice: Choice,
    recordings: Sequence[FitRecording],
    watch: Watch,
    settings: Settings,
) -> Remembered:
    """Fit a structure with presliding. Raises Interrupted."""
    best = best_angles(structure.start.data, recordings)
    learn = partial(_with_what_shows, structure, choice, watch=watch, settings=settings)
    found, learned, gone = learn(best.recordings)
    fitted = learned.fitted(found)
    source, left, delivered = (
        best.source,
        left_without_bias(fitted, best.recordings),
        left_without_bias(fitted, recordings),
    )
    measured = on_encoders(structure.start.data, recordings)
    by_encoders = left_without_bias(fitted, measured) if measured else None
    if np.sum(delivered**2) > MUCH**2 * np.sum(left**2):
        others = learn(recordings)
        again = left_without_bias(others[1].fitted(others[0]), recordings)
        if np.sum(again**2) < np.sum(delivered**2):
            found, learned, gone = others
            source, left, delivered = "the delivered source", again, again
    return Remembered(found, learned, source, left, delivered, gone, encoder_advice(by_encoders, delivered))


def encoder_advice(by_encoders: Numbers | None, delivered: Numbers) -> list[str]:
    """Return a sentence if angles of joint encoders leave far less than those of tendon positions, rms [n] (N·m)."""
    if by_encoders is None or np.sum(delivered**2) <= MUCH**2 * np.sum(by_encoders**2):
        return []
    less, more = (", ".join(f"{1e3 * value:.3g}" for value in values) for values in (by_encoders, delivered))
    which = "with the joint encoders' angles" + (" (rms by joint)" if len(delivered) > 1 else "")
    return [
        f"{which} {less} mN·m would be left in place of {more}: angles of tendon positions are too noisy for "
        "friction that remembers; use --kinematics 2 if the encoders are there when the finger runs"
    ]


def _with_what_shows(
    structure: Structure,
    choice: Choice,
    recordings: Sequence[FitRecording],
    *,
    watch: Watch,
    settings: Settings,
) -> tuple[Structure, Learned, list[str]]:
    """Fit, and fit again without what the motion does not show."""
    learned, gone = learn_batch(structure, recordings, watch, settings), []
    while path := _not_shown(structure, learned):
        near = replace(settings, near=True, begin=learned.fitted(structure))
        gone.append(path)
        structure = build_structure(structure.start.with_data(without_time(structure.start.data, path)), choice)
        learned = learn_batch(structure, recordings, watch, near)
    return structure, learned, gone


def _not_shown(structure: Structure, learned: Learned) -> str | None:
    """Return the path of a number without which the data are as likely, or None."""
    assert learned.memory is not None
    problem, state = learned.memory.problem, learned.memory.minimum.state
    fitted = {path for names in problem.shared for path in names}
    paths = [path for path in optional_paths(structure.start.data) if path in fitted]
    costs = {path: problem.without(state, path) for path in paths}
    least = min(costs, key=costs.__getitem__, default=None)
    return least if least is not None and costs[least] < state.cost + SHOWN else None


def left_without_bias(finger: Finger, recordings: Sequence[FitRecording]) -> Numbers:
    """Return [n] the rms of τ − T less a constant a stretch, over the samples trained on (N·m)."""
    runs = CoreRuns(finger, recordings)
    left = SlowDrift(runs.time, runs.stretch, runs.used).without(runs.residual())
    return np.asarray(np.sqrt(np.mean(left**2, axis=0)))
