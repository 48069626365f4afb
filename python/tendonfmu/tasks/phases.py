"""How far a long computation is: its phases, the progress of each, and the remaining time.

    phases = Phases({"fitting the model": 3.0, "looking for causes": 10.0}, watch=show)
    with phases.start("fitting the model", total=40) as step:
        for k in range(40):
            ...
            step(k + 1)

This module prints nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from time import perf_counter

from tendonfmu.tasks.interruption import raise_lost_interruption

PATIENCE = 3.0  # s; the remaining time is not estimated before
LEAST_SHARE = 0.02  # of all the work; the remaining time is not extrapolated from less


@dataclass(frozen=True)
class PhaseState:
    """The state of a computation."""

    number: int  # number of the present phase, from 1, and of all phases
    count: int
    words: str  # what is being done
    done: int  # steps of the phase
    total: int | None
    seconds: float  # time since the beginning (s)
    left_s: float | None  # estimate of the remaining time (s)


Watch = Callable[[PhaseState], None]
Step = Callable[[int], None]


class Phases:
    """Phases in their order."""

    def __init__(
        self,
        names: Mapping[str, float] | Sequence[str],
        watch: Watch = lambda state: None,
        clock: Callable[[], float] = perf_counter,
    ) -> None:
        shares = dict(names) if isinstance(names, Mapping) else dict.fromkeys(names, 1.0)
        whole = sum(shares.values())
        self._names = list(shares)
        self._shares = [share / whole for share in shares.values()]
        self._watch, self._clock = watch, clock
        self._begun = clock()
        self._worked = 0.0  # shares of the phases that have ended

    @contextmanager
    def start(self, words: str, total: int | None = None) -> Iterator[Step]:
        """Enter a phase."""
        index = self._names.index(words)

        def step(done: int) -> None:
            raise_lost_interruption()
            part = min(done / total, 1.0) if total else 0.0
            self._watch(self._state(index, done, total, part))

        step(0)
        yield step
        self._worked += self._shares[index]

    def _state(self, index: int, done: int, total: int | None, part: float) -> PhaseState:
        seconds = self._clock() - self._begun
        return PhaseState(
            number=index + 1,
            count=len(self._names),
            words=self._names[index],
            done=done,
            total=total,
            seconds=seconds,
            left_s=self._left(index, part, seconds),
        )

    def _left(self, index: int, part: float, seconds: float) -> float | None:
        worked = self._worked + part * self._shares[index]
        if seconds < PATIENCE or worked < LEAST_SHARE:
            return None
        left = sum(self._shares[index + 1 :]) + (1.0 - part) * self._shares[index]
        return seconds / worked * left
