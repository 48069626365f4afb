"""Where a long computation is: its phases, how far each is, and how long the rest will take. Prints nothing.

phases = Phases({"fitting the model": 3.0, "looking for causes": 10.0}, watch=show)
with phases.start("fitting the model", total=40) as step:
    for k in range(40):
        ...
        step(k + 1)
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from time import perf_counter

PATIENCE = 3.0  # s; before, nothing is said of the time that is left
LEAST_SHARE = 0.02  # of all the work: what is extrapolated from less says nothing


@dataclass(frozen=True)
class PhaseState:
    """number: of the phase, from 1, of `count`. words: what is being done. done, total: steps of it; total None where
    it is not known. seconds: since the beginning. left_s: estimate for all that is left, None in the first seconds.
    """

    number: int
    count: int
    words: str
    done: int
    total: int | None
    seconds: float
    left_s: float | None


Watch = Callable[[PhaseState], None]
Step = Callable[[int], None]


class Phases:
    """Phases in their order.

    names: words -> share of the work, in any unit; or words alone, for equal shares. watch: called at every step.
    clock: s.

    A phase may be skipped: its share is then neither done nor left. A phase may come again, also after others: what it
    did before counts as work done, and the phases after it as left.
    """

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
        """Gives step(done), to be called as the work goes on. words: one of the names."""
        index = self._names.index(words)

        def step(done: int) -> None:
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
