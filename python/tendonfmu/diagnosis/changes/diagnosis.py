"""What has changed since the reference: the same finger, recorded when it was well and recorded now.

The model is fitted to the reference. Errors that it makes in both are not reported. A cause is a change of one of its
numbers, or a term that it lacks, in the new recordings only.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy import stats

from tendonfmu.arrays import Data, Flags, Numbers
from tendonfmu.diagnosis.cause_search import residual_alone
from tendonfmu.diagnosis.changes.evidence import change_evidence
from tendonfmu.diagnosis.changes.gain import interval_of
from tendonfmu.diagnosis.changes.load import steady_load
from tendonfmu.diagnosis.changes.search import Change, ChangeSearch
from tendonfmu.diagnosis.changes.sizes import sized
from tendonfmu.diagnosis.changes.trend import sizes_by_recording
from tendonfmu.diagnosis.effects import CANDIDATES
from tendonfmu.diagnosis.event_gain import event_gain
from tendonfmu.diagnosis.extension_fit import FitSettings, fit_numbers
from tendonfmu.diagnosis.gain import measure_gain
from tendonfmu.diagnosis.hypotheses import HERE, Hypothesis, Key
from tendonfmu.diagnosis.residual_views import residual_views, whiteness
from tendonfmu.diagnosis.result import (
    ABSORBED,
    Cause,
    ChangedSize,
    Diagnosis,
    Experiment,
    FoundPlace,
    Invisible,
    SteadyLoad,
    Unexplained,
    Where,
)
from tendonfmu.diagnosis.search import SIGNIFICANCE, events_of, without_events
from tendonfmu.diagnosis.series import Series, make_grid
from tendonfmu.diagnosis.signal_choice import Estimation, choose, estimation_recordings
from tendonfmu.estimate import Choice
from tendonfmu.model import Finger
from tendonfmu.recordings import FitRecording
from tendonfmu.statistics import Interval
from tendonfmu.tasks import Phases

SIGNALS = "signals, delay and presliding"
PHASES = {SIGNALS: 20.0, "contact": 8.0, "changes": 20.0, "gain on unseen data": 20.0}
LEAST_UNKNOWN = 0.25  # of the rms: recordings of an unchanged finger differ by this much
LEVEL = 0.001  # significance level of this difference
SPREAD = 2.0  # standard deviations over the stretches of the reference: other motions have another error
FEWEST = 4  # least number of stretches on either side


@dataclass(frozen=True)
class ChangeCase:
    """Checked recordings of the reference and of now."""

    finger: Finger
    then: list[FitRecording]  # recordings; `now` has held-out stretches if there are no tests
    now: list[FitRecording]
    tests: list[FitRecording]
    warnings: tuple[str, ...]  # about recordings

    @property
    def whole(self) -> list[FitRecording]:
        """The new recordings without held-out stretches."""
        return [replace(recording, train=recording.train | recording.held_out) for recording in self.now]


def find_changes(case: ChangeCase, *, least_gain: float, seed: int, jobs: int, phases: Phases) -> Diagnosis:
    """Return the diagnosis of a change; its duration is still 0."""
    settings = FitSettings(threads=jobs, path=case.finger.path)
    with phases.start(SIGNALS):
        chosen = choose(case.finger, case.then, settings)
    return _Changes(case, chosen, settings, least_gain, seed, phases).diagnosis()


def sizes_now(case: ChangeCase, keys: Sequence[Key], *, seed: int, jobs: int) -> list[tuple[Key, ChangedSize]]:
    """Return how large these effects are in the new recordings, named or not."""
    settings = FitSettings(threads=jobs, path=case.finger.path)
    own = _Changes(case, choose(case.finger, case.then, settings), settings, 0.0, seed, Phases(PHASES))
    return own.sizes(keys)


class _Changes:
    """Everything that is reported of a change."""

    def __init__(
        self,
        case: ChangeCase,
        chosen: Estimation,
        settings: FitSettings,
        least_gain: float,
        seed: int,
        phases: Phases,
    ) -> None:
        self._case, self._chosen, self._settings = case, chosen, settings
        self._least_gain, self._seed, self._phases = least_gain, seed, phases
        finger = replace(case.finger, data=chosen.signals.description(case.finger.data))
        self._then = list(chosen.recordings)
        self._now = estimation_recordings(finger, case.whole, chosen.signals)
        self._held = estimation_recordings(finger, case.now, chosen.signals)
        self._tests = estimation_recordings(finger, case.tests, chosen.signals)
        self._all = [*self._then, *self._now, *self._tests]
        self._grid = make_grid(self._all)

    def diagnosis(self) -> Diagnosis:
        with self._phases.start("contact"):
            out = self._without_events()
        with self._phases.start("changes") as step:
            self._search = self._made(out)
            self._search.run(self._least_gain, step)
        with self._phases.start("gain on unseen data"):
            dropped, gains = self._verified()
            return self._result(dropped, gains)

    def _without_events(self) -> Flags:
        """Return the blocks that lie in contact or a stall [B]."""
        names = {str(recording.path) for recording in self._all[len(self._then) :]}
        events, out = events_of(self._chosen.model.data, self._all, self._grid, self._seed)
        self._events = tuple(event for event in events if event.recording in names)
        return out

    def _made(self, out: Flags) -> ChangeSearch:
        first, last = len(self._then), len(self._then) + len(self._now)
        now, tests = range(first, last), range(last, len(self._all))
        model, least = self._chosen.model.data, self._chosen.least
        return ChangeSearch(model, self._all, self._grid, least, now, tests, out, self._seed)

    def sizes(self, keys: Sequence[Key]) -> list[tuple[Key, ChangedSize]]:
        """Return the sizes of effects at places in the new recordings, all of them free."""
        search = self._search = self._made(self._without_events())
        search.free(keys)
        changes = [search.certain(k) for k in range(len(search.changes))]
        return [(change.hypothesis.key, sized(search, changes, k).size) for k, change in enumerate(changes)]

    # --- verified on unseen data ---

    @property
    def _unseen(self) -> Flags | None:
        """Blocks of tests [B]; None if the held-out parts of the new recordings are judged in turn."""
        return self._search.sides.test if self._case.tests else None

    def _verified(self) -> tuple[list[Change], list[Interval]]:
        """Return the changes that unseen data do not confirm, and the gains of the others."""
        search, dropped = self._search, list[Change]()
        while True:
            unseen = self._unseen
            grams = search.grams(unseen=unseen)
            after, stretch = grams.unseen_residual(), grams.counted_stretch
            without = [search.grams(k, unseen).unseen_residual() for k in range(len(search.changes))]
            gains = [interval_of(left, after, stretch) for left in without]
            beside = [search.certain(k) for k in range(len(search.changes))]
            order = sorted(range(len(gains)), key=lambda k: -gains[k].value)
            named = [search.changes[k].hypothesis.effect for k in order]
            weak = [
                k
                for place, k in enumerate(order)
                if not gains[k].low > 0.0
                or beside[k].p_value >= SIGNIFICANCE
                or not search.matters(
                    gains[k].value,
                    search.error * float(np.linalg.norm(without[k]) / np.linalg.norm(after)),
                    named[place],
                    named[:place],
                    self._least_gain,
                )
            ]
            if not weak:
                search.keep([beside[k] for k in order])
                return dropped, [gains[k] for k in order]
            worst = min(weak, key=lambda k: gains[k].value)
            dropped.append(replace(search.changes[worst], gain=gains[worst].value, error=_error(gains[worst])))
            search.keep([change for k, change in enumerate(search.changes) if k != worst])

    # --- the models ---

    def _learned(self) -> list[Change]:
        """Return the changes as learned without the samples that they are judged on."""
        search = self._search
        held = np.zeros(len(search.series.time), dtype=bool)
        for segment in self._grid.segments:
            number = segment.recording - len(self._then)
            if 0 <= number < len(self._held):
                held[segment.blocks] = segment.mean(self._held[number].held_out[segment.part]) > 0.0
        if not held.any() or not search.changes:
            return search.changes
        return search.moved_on(search.grams(unseen=held))

    def _online(self, changes: Sequence[Change]) -> Data:
        """Return the reference model with changes, with the bias at the start of the new recordings."""
        data: Data = self._search.now_data(changes)
        if (data.get("bias") or {}).get("initial_torque") is not None:
            own = [
                replace(recording, train=recording.train & other.train)
                for recording, other in zip(self._now, self._held, strict=True)
            ]
            settings = replace(self._settings, choice=Choice(only=("bias.initial_torque*",)))
            data = fit_numbers(data, own, settings).data
        return self._chosen.online(data)

    # --- what is reported ---

    def _result(self, dropped: Sequence[Change], gains: Sequence[Interval]) -> Diagnosis:
        case, search = self._case, self._search
        learned = self._learned()
        models = [self._online(learned[:k]) for k in range(len(learned) + 1)]
        nominal, extended = models[0], models[-1]
        clean = [without_events(recording, self._events) for recording in case.now]
        tests = [without_events(recording, self._events) for recording in case.tests]
        gain = measure_gain(nominal, extended, clean, tests, between=models[1:-1], seed=self._seed)
        harmful = [k for k, (one, other) in enumerate(pairwise(gain.steps)) if other > one]
        if harmful:  # it helps together with what is wrong in both, but not alone
            k = harmful[-1]
            dropped = [*dropped, search.changes[k]]
            search.keep([*search.changes[:k], *search.changes[k + 1 :]])
            return self._result(dropped, [*gains[:k], *gains[k + 1 :]])
        before, after = self._views()
        unexplained, load = self._unexplained(), self._load()
        causes = tuple(self._cause(k, search.changes, gain) for k, gain in enumerate(gains))
        return Diagnosis(
            finger=case.finger.name,
            verdict=_verdict(bool(causes) or load is not None, unexplained.unknown),
            recordings=tuple(str(recording.path) for recording in case.now),
            tests=tuple(str(recording.path) for recording in case.tests),
            held_out=gain.held_out,
            seconds=0.0,
            seed=self._seed,
            signals=self._chosen.words,
            least_gain=self._least_gain,
            nominal=gain.nominal,
            extended=gain.extended,
            bias_only_rms=gain.bias_only_rms,
            noise_floor=tuple(float(value) for value in np.minimum(self._floor(), gain.extended.test_rms)),
            floor_source="what remains on unseen stretches without the errors that both recordings share",
            gain=gain.value,
            steps=gain.steps,
            causes=causes,
            too_small=tuple(_too_small(change) for change in [*dropped, *search.refused]),
            invisible=self._invisible(),
            events=self._events,
            unexplained=unexplained,
            experiment=Experiment(self._next(causes)),
            views=residual_views(self._now_series(), before, after),
            whiteness=whiteness(self._now_series(), before, after),
            detection=None,
            nominal_data=nominal,
            extended_data=self._online(search.changes) if causes else nominal,
            warnings=(*case.warnings, *self._warnings()),
            tested=search.tried,
            event_gain=event_gain(extended, case.whole, self._events),
            smoothing=self._chosen.signals,
            kind="change",
            load=load,
            references=tuple(str(recording.path) for recording in case.then),
            repeated=search.repeated,
        )

    def _now_series(self) -> Series:
        series = self._search.series
        return replace(series, used=series.used & self._search.sides.now)

    def _views(self) -> tuple[Numbers, Numbers]:
        """Return what the reference model leaves of all recordings, without the changes and with them, N·m [B, n]."""
        search, series = self._search, self._now_series()
        before = residual_alone(search.data, series)
        if not search.changes:
            return before, before
        return before, residual_alone(search.data, replace(series, target=series.target - search.moved()))

    def _warnings(self) -> list[str]:
        folds, judged = self._search.folds, self._search.judged
        now = int(judged.sum())
        warnings = []
        if now < 4 or folds.folds - now < 4:
            warnings.append(
                "less than 16 s of motion then or now: a change has to be large to be certain; record a minute of each"
            )
        return warnings

    def _unexplained(self) -> Unexplained:
        """Return whether the new recordings, with all changes, are explained worse than the reference is by itself."""
        search = self._search
        squares, rows = search.grams().left()
        is_now = search.stretches_now
        if is_now.sum() < FEWEST or (~is_now).sum() < FEWEST:
            return Unexplained(0.0, "", tuple(0.0 for _ in range(squares.shape[1])))
        level = np.log(np.maximum(squares / rows[:, None], 1e-300)) / 2.0  # of the rms
        p_values = stats.ttest_ind(level[is_now], level[~is_now], equal_var=False, alternative="greater").pvalue
        now, then = (np.sqrt(squares[side].sum(axis=0) / rows[side].sum()) for side in (is_now, ~is_now))
        worse = np.clip(1.0 - then / np.maximum(now, 1e-300), 0.0, 1.0)
        p_value = min(1.0, float(np.nanmin(p_values)) * len(worse))
        worst = int(np.argmax(worse * now))
        apart = float(level[is_now, worst].mean() - level[~is_now, worst].mean())
        beyond = apart > SPREAD * float(level[~is_now, worst].std())
        unknown = bool(worse[worst] >= LEAST_UNKNOWN and p_values[worst] * len(worse) < LEVEL and beyond)
        share = tuple(float(1.0 - (1.0 - share) ** 2) if unknown else 0.0 for share in worse)
        gain = Interval(0.0, 0.0, 0.0)
        if unknown:
            spread = float(np.sqrt(sum(np.var(level[s, worst], ddof=1) / s.sum() for s in (is_now, ~is_now))))
            ends = [1.0 - (1.0 - float(worse[worst])) * np.exp(sign * 1.96 * spread) for sign in (1.0, -1.0)]
            gain = Interval(float(worse[worst]), float(ends[0]), float(ends[1]))
        words = (
            f"at joint {worst + 1} the new recordings are explained worse than the reference, and the cause is unknown"
        )
        whole = float(np.array(share) @ now**2 / max(float((now**2).sum()), 1e-300))
        return Unexplained(whole, words if unknown else "", share, p_value, unknown, gain)

    def _load(self) -> SteadyLoad | None:
        """Return what remains of a load both with and without the means of the changes."""
        search = self._search
        loads: list[SteadyLoad] = []
        for means in (False, True) if search.changes else (False,):
            load = steady_load(search.series, search.torque_left(means), search.sides.now, self._seed)
            if load is None or load.gain.low <= 0.0:
                return None
            loads.append(load)
        return min(loads, key=lambda load: abs(load.size.change.value))

    def _floor(self) -> Numbers:
        """Return the rms of the new recordings, N·m [n]."""
        squares, rows = self._search.selection.grams.left()
        is_now = self._search.stretches_now
        return np.asarray(np.sqrt(squares[is_now].sum(axis=0) / max(float(rows[is_now].sum()), 1.0)))

    def _cause(self, number: int, learned: Sequence[Change], gain: Interval) -> Cause:
        search = self._search
        change = learned[number]
        own = change.hypothesis
        title, explanation, coordinate = _described(own)
        sizes = sized(search, learned, number)
        by = sizes_by_recording(search, number, sizes.size, self._now)
        return Cause(
            where=Where(own.effect, own.joint, own.tendon),
            title=title,
            explanation=explanation,
            p_value=change.p_value,
            gain=gain,
            confusable_with=tuple(
                Where(other.effect, other.joint, other.tendon) for other in _named_once(change.alike)
            ),
            parameters={path: value for place in sizes.places for path, value in place.parameters.items()},
            size=sizes.words,
            places=sizes.places,
            evidence=change_evidence(search, number, coordinate),
            changed=replace(sizes.size, by=by),
        )

    def _invisible(self) -> tuple[Invisible, ...]:
        """Return, for each effect and place that refitting and background absorb, the shape that comes nearest."""
        selection = self._search.selection
        best: dict[tuple[str, int | None, int | None], tuple[Hypothesis, float]] = {}
        for hypothesis, share in zip(selection.hypotheses, selection.shares, strict=True):
            if hypothesis.level == HERE and (hypothesis.key not in best or share > best[hypothesis.key][1]):
                best[hypothesis.key] = (hypothesis, share)
        return tuple(
            Invisible(
                Where(hypothesis.effect, hypothesis.joint, hypothesis.tendon), _described(hypothesis)[0], share, REPEAT
            )
            for hypothesis, share in sorted(best.values(), key=lambda pair: -pair[1])
            if share < ABSORBED
        )

    def _next(self, causes: Sequence[Cause]) -> str:
        search = self._search
        pulls = any(not tendon.get("bidirectional") for tendon in self._case.finger.data["tendons"])
        if any(cause.confusable_with for cause in causes) and pulls:
            return (
                f"{REPEAT}, once as it was and once at half and at twice the pretension: what grows with the force is "
                "then distinguished from what does not"
            )
        if not search.repeated and (causes or self._invisible()):
            return f"{REPEAT}: then only the change is left of their difference"
        return ""


REPEAT = "Make the motions of the reference again, exactly, at the same load and pretension"


def _described(hypothesis: Hypothesis) -> tuple[str, str, str]:
    """Return title, explanation, and the coordinate of the evidence."""
    candidate = next((candidate for candidate in CANDIDATES if candidate.name == hypothesis.effect), None)
    if candidate is None:
        return hypothesis.effect.replace("_", " "), "", "velocity"
    explanation = candidate.explanation
    if not hypothesis.members:
        _, look, where = explanation.partition("Look ")
        explanation = f"The description has this effect; its number is different now. {look}{where}".strip()
    return candidate.title, explanation, candidate.coordinate


def _named_once(alike: Sequence[Hypothesis]) -> list[Hypothesis]:
    return list({other.effect: other for other in reversed(alike)}.values())[::-1]


def _too_small(change: Change) -> Cause:
    own = change.hypothesis
    title, explanation, _ = _described(own)
    half = 1.96 * change.error
    return Cause(
        where=Where(own.effect, own.joint, own.tendon),
        title=title,
        explanation=explanation,
        p_value=change.p_value,
        gain=Interval(change.gain, change.gain - half, change.gain + half),
        confusable_with=(),
        parameters={},
        size="",
        places=(FoundPlace(own.joint, own.tendon, {}),),
    )


def _error(gain: Interval) -> float:
    return (gain.high - gain.low) / (2.0 * 1.96)


def _verdict(causes: bool, unknown: bool) -> str:
    if causes:
        return "partly explained" if unknown else "explained"
    return "unexplained" if unknown else "adequate"
