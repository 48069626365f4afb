"""How signals end a command: as KeyboardInterrupt, and never while results are being written."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

# The default action of each. SIGHUP: the terminal has closed; Windows has none.
_USUAL: dict[int, Any] = {signal.SIGINT: signal.default_int_handler, signal.SIGTERM: signal.SIG_DFL}
if hasattr(signal, "SIGHUP"):
    _USUAL[signal.SIGHUP] = signal.SIG_DFL


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
