"""The terminal: messages, tables and progress bars for the commands. With `cli.py` the only module that prints."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.progress import Progress


def say(message: str) -> None:
    """A line on standard error."""
    print(message, file=sys.stderr)


def print_tables(tables: Iterable[Any], lines: Iterable[str], left: str) -> None:
    """Tables of (title, headings, rows), then lines. left: heading of a further column that is text."""
    from rich.console import Console
    from rich.table import Table

    console = Console()
    if not console.is_terminal:  # nothing to fit into: no broken lines
        console.width = 160
    for title, headings, rows in tables:
        table = Table(title=title, title_justify="left")
        for k, heading in enumerate(headings):
            table.add_column(heading, justify="right" if k > 0 and heading != left else "left")
        for row in rows:
            table.add_row(*row)
        console.print(table)
    for line in lines:
        console.print(line, highlight=False, soft_wrap=True)


def progress_bar(wanted: bool | None = None) -> Progress:
    """A progress bar on standard error; unless it is said, only where that is a terminal."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    console = Console(stderr=True, force_terminal=wanted or None)
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        console=console,
        disable=not (console.is_terminal if wanted is None else wanted),
        transient=True,
    )


def phase_bar(bar: Progress) -> Callable[[str, int, int | None], None]:
    """Shows where something of several phases is: called with the phase in words, done, and total or None."""
    task = bar.add_task("reading", total=None)
    now = ""

    def show(phase: str, done: int, total: int | None) -> None:
        nonlocal now, task
        if phase != now:  # another task: a total, once given, cannot be taken back
            bar.remove_task(task)
            task = bar.add_task(phase, total=total)
            now = phase
        bar.update(task, completed=done, total=total)

    return show


def fit_bar(bar: Progress) -> Any:
    """Shows where a fit is: its phase, cost and samples per second."""
    task = bar.add_task("reading", total=None)
    phase = ""

    def show(now: Any) -> None:
        nonlocal phase
        if now.phase != phase:
            bar.reset(task, total=now.total)
            phase = now.phase
        speed = bar.tasks[0].speed
        rate = f", {speed:,.0f} samples/s" if speed else ""
        cost = f", cost {now.cost:.6g}" if now.cost == now.cost else ""
        bar.update(task, completed=now.done, total=now.total, description=f"{phase}{cost}{rate}")

    return show
