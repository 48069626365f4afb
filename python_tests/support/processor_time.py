"""Tells at the end which tests took most CPU time, their subprocesses included: other load does not change it much."""

from __future__ import annotations

import os
from collections.abc import Generator

import pytest

SHOWN = 10


def spent() -> float:
    """User and system time, s, of this process and of all that it has waited for."""
    return sum(os.times()[:4])


def timed(item: pytest.Item, phase: str) -> Generator[None, None, None]:
    begun = spent()
    try:
        return (yield)
    finally:
        item.user_properties.append((f"cpu {phase}", spent() - begun))


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> Generator[None, None, None]:
    return (yield from timed(item, "setup"))


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_call(item: pytest.Item) -> Generator[None, None, None]:
    return (yield from timed(item, "call"))


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """With several workers, too: their reports carry the times."""
    reports = [each for each in terminalreporter.getreports("") if each.when == "teardown"]
    times = []
    for report in reports:
        for name, seconds in report.user_properties:
            if name.startswith("cpu "):
                times.append((float(seconds), f"{name[4:]:5} {report.nodeid}"))
    if times:
        terminalreporter.section(f"CPU time of {len(reports)} tests: {sum(t for t, _ in times):.0f} s; the largest")
    for seconds, name in sorted(times, reverse=True)[:SHOWN]:
        terminalreporter.write_line(f"{seconds:6.2f}s {name}")
