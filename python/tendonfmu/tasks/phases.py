"""How far a computation is, how signals end it, and how results of its steps are kept for a second call."""

from __future__ import annotations

import hashlib
import json
import shutil
import signal
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from types import FrameType
from typing import TYPE_CHECKING, Any

from tendonfmu.files import write_text

if TYPE_CHECKING:
    from numpy.typing import NDArray


PATIENCE = 3.0  # s; the remaining time is not estimated before
LEAST_SHARE = 0.02  # of all the work; the remaining time is not extrapolated from less
# The default action of each signal. SIGHUP: the terminal has closed; Windows has none.
_USUAL: dict[int, Any] = {signal.SIGINT: signal.default_int_handler, signal.SIGTERM: signal.SIG_DFL}
if hasattr(signal, "SIGHUP"):
    _USUAL[signal.SIGHUP] = signal.SIG_DFL


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


# --- interruption -----------------------------------------------------------------------------------------------------


class Terminated(KeyboardInterrupt):
    """SIGTERM or SIGHUP asked the process to end."""


class Ending:
    """Remembers which signal ends the command."""

    def __init__(self) -> None:
        self.asked: int | None = None

    @property
    def status(self) -> int:
        """Exit status: 128 + number of the signal; SIGINT if none was seen."""
        return 128 + (self.asked or signal.SIGINT)

    def end(self, number: int, frame: FrameType | None) -> None:
        """Handle a signal: remember its number, and raise KeyboardInterrupt or Terminated."""
        self.asked = number
        self.raise_again()

    def raise_again(self) -> None:
        """Raise what a signal has asked for, if any has."""
        if self.asked is not None:
            raise KeyboardInterrupt if self.asked == signal.SIGINT else Terminated


_endings: list[Ending] = []  # of the blocks of `ended_by_signals`, innermost last


def raise_lost_interruption() -> None:
    """Raise the KeyboardInterrupt again that a signal asked for and somebody swallowed."""
    # A long computation calls this between its phases, so that Ctrl-C ends it all the same.
    if _endings:
        _endings[-1].raise_again()


@contextmanager
def ended_by_signals() -> Iterator[Ending]:
    """Let SIGTERM and SIGHUP raise KeyboardInterrupt inside the block, as Ctrl-C does, and remember which one came."""
    ending = Ending()
    if threading.current_thread() is not threading.main_thread() or signal.getsignal(signal.SIGTERM) != signal.SIG_DFL:
        yield ending
        return
    taken = [number for number, usual in _USUAL.items() if signal.getsignal(number) == usual]
    for number in taken:
        signal.signal(number, ending.end)
    _endings.append(ending)
    try:
        yield ending
    finally:
        _endings.remove(ending)
        for number in taken:
            signal.signal(number, _USUAL[number])


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Delay Ctrl-C, SIGTERM and SIGHUP to the end of the block, where the first of them takes effect."""
    # Outside the main thread it does nothing, since only the main thread is interrupted.
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    waiting: list[int] = []
    before = {number: signal.signal(number, lambda which, frame: waiting.append(which)) for number in _USUAL}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, signal.SIG_DFL if handler is None else handler)
        if waiting:
            signal.raise_signal(waiting[0])


# --- steps whose results are kept -------------------------------------------------------------------------------------


FOLDER = ".steps"
FORMAT = "tendonfmu-calibration-step-1"


class Steps:
    """Results of steps in a folder."""

    def __init__(self, folder: Path, made_from: Mapping[str, Any]) -> None:
        self._folder = folder / FOLDER
        self._before = digest_of(made_from)
        self.repeated: list[str] = []  # names of the steps whose results were reused

    def result(
        self,
        name: str,
        made_from: Mapping[str, Any],
        compute: Callable[[], dict[str, Any]],
        page: Path | None = None,
    ) -> dict[str, Any]:
        """Return the result of a step, computed only if it does not exist."""
        key = self._before = digest_of({"before": self._before, "name": name, **made_from})
        file = self._folder / f"{name}.json"
        kept = _read(file, key)
        if kept is not None and (page is None or page.is_file()):
            self.repeated.append(name)
            return kept
        result = compute()
        self._folder.mkdir(parents=True, exist_ok=True)
        write_text(file, json.dumps({"format": FORMAT, "key": key, "result": result}) + "\n")
        # as a later call would read it: tuples become lists
        return dict(json.loads(json.dumps(result)))


def forget_steps(folder: Path) -> None:
    """Delete the results, so that the next calibration in this folder computes everything again."""
    shutil.rmtree(folder / FOLDER, ignore_errors=True)


def _read(file: Path, key: str) -> dict[str, Any] | None:
    """Return the result with this key, or None if there is none or the file is something else."""
    try:
        content = json.loads(file.read_bytes())
    except (OSError, ValueError):
        return None
    if not isinstance(content, dict) or content.get("format") != FORMAT or content.get("key") != key:
        return None
    result = content.get("result")
    return result if isinstance(result, dict) else None


def digest_of(content: Mapping[str, Any]) -> str:
    """Return the digest of JSON values, independent of the order of keys."""
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def digest_of_arrays(arrays: Mapping[str, NDArray[Any]]) -> str:
    """Return the digest of named arrays."""
    digest = hashlib.sha256()
    for name, values in arrays.items():
        digest.update(f"{name}{values.shape}".encode() + values.tobytes())
    return digest.hexdigest()
