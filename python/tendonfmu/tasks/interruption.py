"""Ctrl-C and SIGTERM: both end a command as KeyboardInterrupt, and neither in the middle of writing its results."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from types import FrameType

_SIGNALS = (signal.SIGINT, signal.SIGTERM)


class Terminated(KeyboardInterrupt):
    """The process was asked to end by SIGTERM."""


class Ending:
    """Remembers which signal ends the command. status: 128 + its number; SIGINT where none was seen."""

    def __init__(self) -> None:
        self.status = 128 + signal.SIGINT

    def terminate(self, number: int, frame: FrameType | None) -> None:
        self.status = 128 + number
        raise Terminated


@contextmanager
def ended_by_signals() -> Iterator[Ending]:
    """Within, SIGTERM raises KeyboardInterrupt, as Ctrl-C does. Does nothing outside the main thread."""
    ending = Ending()
    if threading.current_thread() is not threading.main_thread() or signal.getsignal(signal.SIGTERM) != signal.SIG_DFL:
        yield ending
        return
    signal.signal(signal.SIGTERM, ending.terminate)
    try:
        yield ending
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Within, Ctrl-C and SIGTERM wait; the first that came takes effect at the end.

    For the milliseconds in which several files take their places together. Does nothing outside the main thread, which
    alone is interrupted.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    waiting: list[int] = []
    before = {number: signal.signal(number, lambda which, frame: waiting.append(which)) for number in _SIGNALS}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, signal.SIG_DFL if handler is None else handler)
        if waiting:
            signal.raise_signal(waiting[0])


@contextmanager
def worker_threads(count: int) -> Iterator[ThreadPoolExecutor]:
    """A pool that an error, or Ctrl-C, does not wait for: what has not begun is dropped, what runs is left behind."""
    pool = ThreadPoolExecutor(count)
    try:
        yield pool
    except BaseException:
        pool.shutdown(wait=False, cancel_futures=True)
        raise
    pool.shutdown()
