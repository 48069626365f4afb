"""Which further recording answers a question that the present ones cannot.

The question is about two causes that look alike, or about one that refitting absorbs. The model predicts a recording
for every entry of a menu. The columns of the causes in it come from the C core, as in a diagnosis. All numbers of the
model, a constant and the other cause then explain as much of a cause as they can, in the new recording and in the
old ones together. What is left is the Schur complement of their Gram matrix. Its ratio to the noise says how far apart
the two predictions will be. This is the T-optimality of Atkinson and Fedorov, "The design of experiments for
discriminating between two rival models", Biometrika 62 (1975).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from tendonfmu.arrays import Data, Numbers
from tendonfmu.diagnosis.candidate_columns import CandidateColumns, Proposal, candidate_columns
from tendonfmu.diagnosis.effects import Mechanism, Term, Where
from tendonfmu.diagnosis.extension_fit import number_columns
from tendonfmu.diagnosis.menu import Entry, combined, loads, motions, own_tension, recorded_of, tensions
from tendonfmu.diagnosis.motion import expected_recording, perform
from tendonfmu.diagnosis.names import Names, at_place, names_in
from tendonfmu.diagnosis.result import Experiment
from tendonfmu.diagnosis.samples import Samples, Span, span_of
from tendonfmu.errors import InputError, InternalError
from tendonfmu.estimate import EstimationError
from tendonfmu.model import NativeError, moment_arms, number_of
from tendonfmu.recordings import FitRecording, Model, Recording

Progress = Callable[[int, int], None]

VISIBLE = 0.33  # rms of what is left over that of the noise: about a tenth of its variance, found in 49 of 50 cases
SHARE = 0.01  # of a cause that survives the refit: a smaller share is not visible, however large the cause is
NONE = "None of the available experiments can"
LISTED = 2  # further effects that a sentence names
_RATE = 50.0  # 1/s, of a predicted recording
_LEAST_RATE, _MOST_SAMPLES = 10.0, 3200
_OLD_SECONDS = 60.0  # of each old recording that is used, s
_BETTER = 1.5  # times the present distance
_FAINTEST = 0.01  # times the noise: smaller values are rounding errors
_SIMPLER = 0.7  # of the largest distance is sufficient for a simpler entry
_RANK = 1e-9  # of the largest direction of a Gram matrix of columns of length 1: resolution of float32 columns


@dataclass(frozen=True)
class Question:
    """What a recording is to show: the difference between `cause` and `rival`, or whether `cause` is there at all."""

    cause: Term
    rival: Term | None = None
    absorbed: bool = False  # whether other numbers of the model explain the cause in the present recordings


@dataclass(frozen=True)
class Answer:
    """What an entry shows for one question."""

    question: Question
    entry: Entry
    distance: float  # rms of what the entry adds to the remaining part of the cause, over that of the noise
    now: float  # the same for the present recordings
    share: float  # share of the cause's variance that survives bias and refit, in all recordings together

    @property
    def separates(self) -> bool:
        """Whether the entry is worth recording."""
        # The size of an effect that was never seen is unknown.
        if self.question.rival is None:
            shown = self.distance >= max(_BETTER * self.now, _FAINTEST)
        else:
            shown = self.distance >= VISIBLE
        return self.share >= SHARE and shown

    @property
    def where(self) -> Where:
        return self.question.cause.where


@dataclass(frozen=True)
class Experiments:
    """The planned experiments."""

    answers: tuple[Answer, ...]  # for each question, the entry that answers it best
    best: Experiment  # what to do first: the experiment that answers most questions
    seed: int = 0

    def motion(self, number: int) -> dict[str, Any]:
        """Return what answers one question in the form of `Experiment.motion`; empty if no entry of the menu does."""
        separating = bool(self.answers) and self.answers[number].separates
        return {**self.answers[number].entry.as_json(), "seed": self.seed} if separating else {}

    def sentence(self, number: int) -> str:
        """Return what to record for one question; what to look at if no entry of the menu answers it."""
        if not self.answers:
            return self.best.sentence
        answer = self.answers[number]
        explanation = answer.question.cause.mechanism.explanation
        return answer.entry.sentence if answer.separates else f"{NONE} show it. {explanation}"


def plan_experiments(
    data: Data,
    recordings: Sequence[FitRecording],
    questions: Sequence[Question],
    *,
    noise: Sequence[float] | None = None,
    seed: int = 0,
    progress: Progress | None = None,
) -> Experiments:
    """Choose experiments from the menu. noise: [n]."""
    if not questions:
        return Experiments((), Experiment(""))
    if not recordings:
        raise InternalError("next experiment: no recording; expected those of the diagnosis")
    span = span_of(data, recordings)
    lab = _Laboratory(data, recordings, questions, noise, span, seed)
    recorded = recorded_of(span, None if own_tension(data).any() else _mean_load(data, recordings))
    *plain, long = motions(recorded)
    varied = [*tensions(data, plain[0], recorded), *loads(data, plain[0], recorded)]
    scores = []
    # effects that only change over time show in long recordings, which take long to predict
    slow = any(
        cause is not None and cause.mechanism.coordinate == "time" for q in questions for cause in (q.cause, q.rival)
    )
    first = [*plain, *varied, *([long] if slow else [])]
    for k, entry in enumerate(first):
        scores += lab.answers_of([entry])
        if progress is not None:
            progress(k + 1, len(first))
    if not scores:
        return Experiments((), Experiment("This finger can make none of the available motions."))
    open_ = [q for q in range(len(questions)) if max(answers_of[q].distance for answers_of in scores) < VISIBLE]
    if open_:
        simple = [answers_of for answers_of in scores if not (answers_of[0].entry.tension or answers_of[0].entry.load)]
        motion = max(simple or scores, key=lambda answers_of: sum(answers_of[q].distance for q in open_))[0].entry
        scores += lab.answers_of(combined(data, motion, recorded))
    answers = tuple(_best([answers_of[q] for answers_of in scores]) for q in range(len(questions)))
    names = names_in(data)
    return Experiments(answers, _first_of_all(answers, scores, names, seed), seed)


# --- what a recording would show --------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Seen:
    """What one or several recordings show."""

    gram: Numbers  # products of all columns over the noise, about their means [c, c]
    power: Numbers  # of the columns by joint [c, n]
    blocks: int  # number of blocks

    def __add__(self, other: _Seen) -> _Seen:
        return _Seen(self.gram + other.gram, self.power + other.power, self.blocks + other.blocks)


class _Laboratory:
    """Predicts recordings and what they would show for the questions."""

    def __init__(
        self,
        data: Data,
        recordings: Sequence[FitRecording],
        questions: Sequence[Question],
        noise: Sequence[float] | None,
        span: Span,
        seed: int,
    ) -> None:
        self.data, self.questions, self.span, self.seed = data, questions, span, seed
        self.kinematics = recordings[0].kinematics
        given = [number_of(data, "bias.noise_std")] * len(data["joints"]) if noise is None else list(noise)
        self.noise = np.maximum(np.array(given, dtype=float), 1e-9)
        self.mechanisms = [_restricted(cause, data, span) for cause in _asked(questions)]
        self.columns: CandidateColumns | None = None
        self.nominal_count = 0
        self.old = sum(
            (self._look(_shortened(recording)) for recording in recordings[1:3]), self._look(_shortened(recordings[0]))
        )

    def answers_of(self, entries: Iterable[Entry]) -> list[list[Answer]]:
        """Return the answers to all questions for each entry that this finger can make."""
        answers = []
        for entry in entries:
            # skip entries with too short a stroke, a slack tendon, or forces outside the valid range
            with suppress(InputError, EstimationError, NativeError):
                answers.append(self.answers(entry))
        return answers

    def answers(self, entry: Entry) -> list[Answer]:
        """Return the answer to each question; raises InputError if the motion is not possible."""
        seconds = sum(section.seconds for section in entry.sections)
        rate = min(_RATE, max(_LEAST_RATE, _MOST_SAMPLES / seconds))
        performed = perform(self.data, entry, rate, self.seed)
        new = self._look(expected_recording(self.data, performed, self.kinematics))
        return [self._answer(question, entry, new) for question in self.questions]

    def _look(self, recording: FitRecording) -> _Seen:
        samples = Samples.of(self.data, [recording])
        columns = candidate_columns(self.data, samples, mechanisms=self.mechanisms, span=self.span)
        nominal, _ = number_columns(self.data, samples)
        self.columns, self.nominal_count = columns, nominal.shape[2]
        values = np.concatenate([nominal, columns.values], axis=2).astype(np.float64) / self.noise[:, None]
        rest = samples.drift.without(values)
        flat = rest.reshape(-1, rest.shape[2])
        return _Seen(flat.T @ flat, np.einsum("bjc,bjc->cj", rest, rest), len(rest))

    def _answer(self, question: Question, entry: Entry, new: _Seen) -> Answer:
        both = self.old + new
        left, before = self._left(question, both.gram), self._left(question, self.old.gram)
        direction = self._direction(question.cause)
        whole = float(direction @ both.gram @ direction)
        return Answer(
            question=question,
            entry=entry,
            distance=float(np.sqrt(max(left - before, 0.0) / self._rows(question.cause, new))),
            now=float(np.sqrt(before / self._rows(question.cause, self.old))),
            share=left / whole if whole > 0 else 0.0,
        )

    def _left(self, question: Question, gram: Numbers) -> float:
        """Return the power of the cause at its magnitudes that neither the model nor the rival explains."""
        explaining = list(range(self.nominal_count))
        if question.rival is not None:
            columns = [proposal.columns for proposal in self._proposals(question.rival)]
            explaining += range(self.nominal_count + columns[0].start, self.nominal_count + columns[-1].stop)
        return _schur(gram, self._direction(question.cause), explaining)

    def _proposals(self, cause: Term) -> list[Proposal]:
        """Return the shapes of the cause at its place, its own first."""
        assert self.columns is not None
        proposals = [
            proposal
            for proposal in self.columns.proposals
            if proposal.mechanism.name == cause.mechanism.name and proposal.place == cause.place
        ]
        if not proposals:
            raise InternalError(
                f"{cause.mechanism.name}: not possible at this place; expected a place of the mechanism"
            )
        return proposals

    def _direction(self, cause: Term) -> Numbers:
        """Return the magnitudes of the cause in all columns [c]."""
        assert self.columns is not None
        proposal = self._proposals(cause)[0]
        direction = np.zeros(self.nominal_count + self.columns.values.shape[2])
        direction[self.nominal_count :][proposal.columns] = cause.magnitudes or proposal.variant.expected
        return direction

    def _rows(self, cause: Term, seen: _Seen) -> float:
        """Return the number of blocks times joints in which the cause makes a noticeable torque."""
        power = np.sum(np.square(self._direction(cause))[:, None] * seen.power, axis=0)
        joints = int(np.sum(power > 0.05 * power.max())) if power.max() > 0 else 1
        return float(seen.blocks * max(joints, 1))


def _schur(gram: Numbers, direction: Numbers, explaining: Sequence[int]) -> float:
    """Return the power of the columns along a direction that those `explaining` do not explain; at least 0."""
    length = np.sqrt(np.maximum(np.diag(gram), 0.0))
    used = [k for k in explaining if length[k] > 0]
    mixed = gram @ direction
    whole = float(direction @ mixed)
    if not used or whole <= 0:
        return max(whole, 0.0)
    scaled = gram[np.ix_(used, used)] / np.outer(length[used], length[used])
    power, axes = np.linalg.eigh(scaled)
    kept = power > _RANK * power[-1]
    along = axes[:, kept].T @ (mixed[used] / length[used])
    left = whole - float(np.sum(along**2 / power[kept]))
    return max(left, 0.0)


def _asked(questions: Sequence[Question]) -> list[Term]:
    """Return every mechanism at a place once, with the shape of its first mention."""
    causes: dict[tuple[str, Any], Term] = {}
    for cause in (cause for question in questions for cause in (question.cause, question.rival) if cause is not None):
        causes.setdefault((cause.mechanism.name, cause.place), cause)
    return list(causes.values())


def _restricted(cause: Term, data: Data, span: Span) -> Mechanism:
    """Return the mechanism at that place only; its own shape comes first, then the others of its grid."""
    grid = cause.mechanism.find_shapes(data, cause.place, span)
    own = dict(cause.shape) or (dict(grid[len(grid) // 2]) if grid else {})
    shapes = [own, *(shape for shape in grid if dict(shape) != own)]
    return replace(
        cause.mechanism,
        possible_places=lambda *_: [cause.place],
        find_shapes=lambda *_: [dict(shape) for shape in shapes],
    )


def _mean_load(data: Data, recordings: Sequence[FitRecording]) -> Numbers:
    """Return the mean known load on the joints, N·m [n]."""
    arms = moment_arms(data)
    if all(recording.external is None for recording in recordings):
        return np.zeros(arms.shape[1])
    pulled = [(recording.recording.groups["tendon_force"] @ arms - recording.target) for recording in recordings]
    return np.asarray(np.mean([load.mean(axis=0) for load in pulled], axis=0))


def _shortened(recording: FitRecording) -> FitRecording:
    """Return the beginning of its longest part, thinned to the sample rate that a predicted recording needs."""
    part = max(recording.parts, key=lambda part: recording.time[part.stop - 1] - recording.time[part.start])
    time = recording.time[part]
    step = float(np.median(np.diff(time)))
    every = max(1, int(1 / (2 * _RATE * step)))
    rows = np.arange(part.start, part.stop)[time - time[0] <= _OLD_SECONDS][::every]
    groups = {name: np.ascontiguousarray(values[rows]) for name, values in recording.recording.groups.items()}
    whole = [slice(0, len(rows))]
    by_sample = ("target", "train", "held_out", "contact_out", "faulty", "silent")
    model = {each.name: np.ascontiguousarray(getattr(recording.model, each.name)[rows]) for each in fields(Model)}
    return replace(
        recording,
        recording=Recording(recording.path, np.ascontiguousarray(recording.time[rows]), groups),
        **{name: getattr(recording, name)[rows] for name in by_sample},
        parts=whole,
        model=Model(**model),
    )


# --- the choice, in words ---------------------------------------------------------------------------------------------


def _best(answers: Sequence[Answer]) -> Answer:
    """Return the simplest entry that shows nearly as much as the best one; the simplest entries come first."""
    able = [answer for answer in answers if answer.separates] or answers
    largest = max(answer.distance for answer in able)
    return next(answer for answer in able if answer.distance >= _SIMPLER * largest)


def _first_of_all(answers: Sequence[Answer], scores: Sequence[Sequence[Answer]], names: Names, seed: int) -> Experiment:
    """Return the entry that distinguishes most pairs of causes, then shows most effects, and is simplest."""

    def separated_by(answers_of: Sequence[Answer]) -> tuple[int, int]:
        separating = [answer for answer in answers_of if answer.separates]
        return sum(answer.question.rival is not None for answer in separating), len(separating)

    simple = [answers_of for answers_of in scores if not (answers_of[0].entry.tension and answers_of[0].entry.load)]
    chosen = max(simple or scores, key=separated_by)
    pairs, count = separated_by(chosen)
    for answers_of in scores:
        if separated_by(answers_of)[0] > pairs or (not count and separated_by(answers_of)[1]):
            chosen, (pairs, count) = answers_of, separated_by(answers_of)
    separating = [answer for answer in chosen if answer.separates]
    if not separating:
        return Experiment(_sentence([max(answers, key=lambda answer: answer.distance)], names))
    return Experiment(
        sentence=_sentence(separating, names),
        separates=tuple(
            (answer.where, answer.question.rival.where) for answer in separating if answer.question.rival is not None
        ),
        makes_visible=tuple(answer.where for answer in separating if answer.question.rival is None),
        distance=min(answer.distance for answer in separating),
        motion={**chosen[0].entry.as_json(), "seed": seed},
    )


def _sentence(separating: Sequence[Answer], names: Names) -> str:
    """Say what to record for the first of the answers of one entry, and what one will know then."""
    first, *others = separating
    shown, rival = first.question.cause, first.question.rival
    causes = [cause for cause in (shown, rival) if cause is not None]
    what = "; and ".join(at_place(cause.mechanism.title, cause.where, names) for cause in causes)
    if not first.separates:
        verb = "show this" if rival is None else "distinguish these two"
        return f"{NONE} {verb}: {what}. {shown.mechanism.explanation}"
    if rival is not None:
        purpose = f"It distinguishes two causes that look alike in the present recordings: {what}."
    else:
        hides = "other numbers of the model imitate it" if first.question.absorbed else "the noise hides it"
        purpose = f"That would show: {what}. In the present recordings {hides}."
    titles = dict.fromkeys(answer.question.cause.mechanism.title for answer in others)
    more = [title for title in titles if title not in what]
    rest = [f"{len(more) - LISTED} more"] * (len(more) > LISTED)
    also = f" It would also help to see: {'; '.join([*more[:LISTED], *rest])}." if more else ""
    return f"{first.entry.sentence} {purpose}{also}"
