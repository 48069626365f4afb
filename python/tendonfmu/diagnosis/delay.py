"""What the tendons' equation says of delays, springs and arms, and what the torque says of a delay it leaves open."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from tendonfmu.arrays import Data, Flags, Numbers
from tendonfmu.diagnosis.effects import Place, Term, by_name
from tendonfmu.diagnosis.extension_fit import FittedModel
from tendonfmu.diagnosis.samples import Samples, shifted
from tendonfmu.diagnosis.selection import LeastSizes
from tendonfmu.diagnosis.view import look
from tendonfmu.model import EFFECT_NUMBERS, Finger, extension_rows, moment_arms
from tendonfmu.recordings import BENDING, FitRecording, with_linear_springs
from tendonfmu.statistics import Interval, blocks_of, gain_interval, variance_between

DELAY = by_name("time_delay")
LONGEST = EFFECT_NUMBERS["time_delay"]["delay"].most  # s in either direction
FINE = 0.001  # s
LARGE = 0.005  # s: smaller delays compete with other causes, by their derivative
CLEAR_GAIN = 0.1  # of the rms that a starting delay must remove: any other missing effect looks a little like a delay
CHANGING = ("moment_arm_variation", "pulley_eccentricity")  # arms
SHOWN = (*BENDING, *CHANGING)  # what positions may contradict
TENDONS = 1  # source of the angles: positions of the tendons
STRETCHES = 1e-4  # of the travel (rms each) that a tendon stretches, at least: what hardly gives tells of no delay
CLEAR = 0.25  # error of the best delay, at most, over the median error of all delays


def late_forces(delay: float, *, fixed: bool = False) -> tuple[Term, ...]:
    """Return the terms of forces that are `delay` s later than positions."""
    return (Term(DELAY, Place(), {"delay": delay}, (1.0,), fixed=fixed),)


def delay_of_torque(model: FittedModel, samples: Samples, least: LeastSizes) -> tuple[Term, ...]:
    """Return a delay of forces that is too large for its derivative, beside a fitted model; () if there is none."""
    if not DELAY.places(model.data, samples.recordings[0].kinematics):
        return ()
    # a grid of all delays that a description accepts, including 0
    grid = max(2 * FINE, float(np.median(np.diff(samples.recordings[0].time))) / 2)
    delays = grid * np.arange(-int(LONGEST / grid), int(LONGEST / grid) + 1)
    late = ([shifted(each, each.target, delay) - each.target for each in samples.recordings] for delay in delays)
    moved = np.stack([samples.grid.means(changes) for changes in late], axis=2)
    view = look(model.data, samples, least, (), model)
    errors = view.grams.errors_of(view.series.target[:, :, None] + moved)
    still, best = int(np.argmin(np.abs(delays))), int(np.argmin(errors))
    # an optimum at the edge is no minimum; a small delay competes with other causes, by its derivative
    is_large = 0 < best < len(delays) - 1 and abs(delays[best]) >= LARGE
    clear = is_large and errors[best] < (1.0 - CLEAR_GAIN) ** 2 * errors[still]
    return late_forces(float(delays[best])) if clear else ()


def _further(finger: Finger, angle: Numbers) -> Numbers:
    """Return what arms that change with the angle add to the travels of the tendons at angles [N, n], m [N, m]."""
    travel = np.zeros((len(angle), finger.tendons))
    for row in extension_rows(finger.data):
        if row["effect"] in CHANGING:
            at, turns = angle[:, row["joint"] - 1], float(row.get("turns") or 1.0)
            keys = ("slope", "correction", "sine", "cosine")
            slope, fixed, sine, cosine = (float(row.get(key) or 0.0) for key in keys)
            wave = cosine * np.sin(turns * at) - sine * np.cos(turns * at)
            travel[:, row["tendon"] - 1] += slope * at**2 / 2.0 + fixed * at + wave / turns
    return travel


class Positions:
    """What positions tell of a delay, and whether they contradict springs and arms, whatever friction is.

    With joint encoders, or more tendons than joints, the joint-side positions x0 − f0/k agree with the angles, or with
    each other, only if positions and forces are of the same time. Where the angles are those of encoders, the tendons'
    positions may be as late as their forces: two loggers, two clocks.
    """

    def __init__(self, finger: Finger, recordings: Sequence[FitRecording]) -> None:
        self._finger, self._arms = finger, moment_arms(finger.data)
        self._stiffness = np.array([tendon["stiffness"] for tendon in finger.data["tendons"]])
        groups = [set(each.recording.groups) for each in recordings]
        self._measured = all("joint_position" in own for own in groups)
        self._apart = np.eye(len(self._arms)) - (0.0 if self._measured else self._arms @ np.linalg.pinv(self._arms))
        is_known = self._measured or np.linalg.matrix_rank(self._arms) < len(self._arms)
        tells = is_known and all("tendon_position" in own for own in groups)
        tells = tells and any(self._stretches(each) for each in recordings)
        self._recordings = recordings if tells else ()
        self._behind = False  # whether the tendons' positions are as late as their forces
        # s, with its standard error; None: they do not show whether there is one
        self.delay, self.error = self._found() if tells else (None, np.nan)

    def contradict(self, before: Data, after: Data) -> bool:
        """Return whether they agree worse with springs, plays and changing arms of one description than before."""
        errors = []
        for data in (before, after):
            finger, late = self._finger.with_data(data), np.array([self.delay or 0.0])
            errors.append(sum(float(self._squares(one, one.train, late, finger).sum()) for one in self._recordings))
        return errors[1] > errors[0]

    def gain(self, judged: Iterable[tuple[FitRecording, Flags]], delay: float, seed: int) -> Interval:
        """Return which share of the rms that their equation leaves of some samples a delay removes."""
        pairs = [self._squares(*each, np.array([0.0, delay])) for each in judged]
        before, after = np.concatenate(pairs).T
        return gain_interval(before, after, seed, variance_between(pairs) / len(pairs))

    def _stretches(self, recording: FitRecording) -> bool:
        """Return whether a tendon stretches enough for positions to show forces of another time."""
        groups = recording.recording.groups
        stretch = np.std(groups["tendon_force"], axis=0) / self._stiffness
        return bool((stretch > STRETCHES * np.std(groups["tendon_position"], axis=0)).any())

    def _found(self) -> tuple[float | None, float]:
        delays = np.arange(-LONGEST, LONGEST + FINE / 2, FINE)
        ways = []
        for behind in (False, True) if self._measured and self._recordings[0].kinematics != TENDONS else (False,):
            self._behind = behind
            every = [self._squares(one, np.ones(len(one.time), dtype=bool), delays) for one in self._recordings]
            ways.append((np.concatenate(every), behind))
        errors, self._behind = min(ways, key=lambda way: float(way[0].sum(axis=0).min()))
        whole = errors.sum(axis=0)
        best = int(np.argmin(whole))
        if not 0 < best < len(delays) - 1 or whole[best] > CLEAR * float(np.median(whole)):
            return None, np.nan
        before, at, after = np.stack([whole, *(whole - errors)])[:, best - 1 : best + 2].T
        found, *others = delays[best] + FINE * 0.5 * (before - after) / np.maximum(before - 2 * at + after, 1e-300)
        # jackknife (Efron and Stein, Ann. Statist. 9, 1981)
        return float(found), float(np.std(others) * np.sqrt(len(others) - 1))

    def _squares(
        self, recording: FitRecording, chosen: Flags, delays: Numbers, finger: Finger | None = None
    ) -> Numbers:
        """Return by block of the chosen samples the sum of squares that the equation leaves (m²) [K, delays]."""
        groups, index = recording.recording.groups, blocks_of(recording.time, chosen)
        linear = with_linear_springs(finger or self._finger, recording.recording).groups["tendon_position"]
        early = np.zeros(linear.shape)
        if self._measured:
            angle = groups["joint_position"]
            early -= angle @ self._arms.T + _further(finger or self._finger, angle)
        position, stretch = groups["tendon_position"], groups["tendon_force"] / self._stiffness
        late = linear - position - stretch
        early, late = (early, late + position) if self._behind else (early + position, late)
        sums, squares = [], np.zeros(len(recording.time))
        for delay in delays.tolist():
            for part in recording.parts:
                left = self._left(recording.time[part], early[part], late[part], delay)
                squares[part] = (left**2).sum(axis=1)
            sums.append(index.sums(squares))
        return np.column_stack(sums)

    def _left(self, time: Numbers, early: Numbers, late: Numbers, delay: float) -> Numbers:
        """Return what the equation leaves of a part if some of it comes a delay earlier, less its mean (m)."""
        before = np.stack([np.interp(time - delay, time, column) for column in early.T], axis=1)
        left = (before + late) @ self._apart
        return np.asarray(left - left.mean(axis=0))
