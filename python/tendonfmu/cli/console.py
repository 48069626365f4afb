"""How commands write to the terminal: messages, results and progress bars.

Only this module and `program.py` print. What is printed depends on the options of the call (`PRINTED`):

| option | standard output | standard error |
| --- | --- | --- |
| none | lines and tables | messages, warnings, errors |
| `--quiet` | nothing | errors |
| `--json` | one JSON object | messages, warnings, errors |
| `--output -` | a table as CSV | lines and tables, messages, warnings, errors |
"""

from __future__ import annotations

import errno
import os
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, Literal, NoReturn

from tendonfmu.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from rich.progress import Progress

    from tendonfmu.tasks import PhaseState

# exit status of every command; 0 is done, 129 and 143 are ended by SIGHUP and SIGTERM
NO, BAD_INPUT, FAULT, INTERRUPTED = 1, 2, 3, 130


@dataclass
class Printed:
    """What this call of the command prints."""

    quiet: bool = False  # whether `--quiet` and `--json` are given
    json: bool = False
    table: bool = False  # whether standard output carries a table (`--output -`)


PRINTED = Printed()  # a process has one standard output; `command.py` sets this anew when it parses a command
DASH = Path("-")  # standard input or output in place of a file


def fail(message: str) -> None:
    """Print the line of an error on standard error, also with `--quiet`."""
    with reader_may_leave(sys.stderr):
        print(f"tendonfmu: {message}", file=sys.stderr)


def warn(sentence: str) -> None:
    """Print a warning on standard error."""
    say(f"tendonfmu: warning: {sentence}")


def say(message: str) -> None:
    """Print a line on standard error."""
    if not PRINTED.quiet:
        with reader_may_leave(sys.stderr):
            print(message, file=sys.stderr)


def say_files(written: Mapping[Any, str]) -> None:
    """Print each file that was written, with its content in words, on standard error."""
    for path, what in written.items():
        say(f"{path}: {what}")


def show(line: str) -> None:
    """Print a line of a result on standard output."""
    stream = _of_results()
    if stream is not None:
        with reader_may_leave(stream):
            print(line, file=stream)


def print_json(report: Callable[[], Mapping[str, Any] | str]) -> None:
    """Print a report on standard output if `--json` is given. report: makes it, as a mapping or as its JSON text."""
    if not PRINTED.json:
        return
    import json

    from tendonfmu.files import finite

    content = report()
    text = content if isinstance(content, str) else json.dumps(finite(content), indent=1, ensure_ascii=False)
    with reader_may_leave(sys.stdout):
        sys.stdout.write(f"{text.rstrip()}\n")
        sys.stdout.flush()


@contextmanager
def reader_may_leave(stream: IO[str]) -> Iterator[None]:
    """Go on silently when the reader of a stream closes it, as `head` does, or a terminal of messages."""
    try:
        yield
    except OSError as gone:
        closed_terminal = gone.errno == errno.EIO and stream is sys.stderr  # of results, EIO is a disk that fails
        if gone.errno != errno.EPIPE and not closed_terminal:
            raise
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())  # what is still buffered goes there
        os.close(nowhere)


def _of_results() -> IO[str] | None:
    """Return the stream of lines and tables, or None if they are not printed."""
    if PRINTED.quiet or PRINTED.json:
        return None
    return sys.stderr if PRINTED.table else sys.stdout


def leave(status: int) -> NoReturn:
    """End the program without waiting for threads that still compute."""
    if any(not thread.daemon for thread in threading.enumerate() if thread is not threading.main_thread()):
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(status)
    sys.exit(status)


def print_results(tables: Iterable[Any], lines: Iterable[str], left: str, warnings: Iterable[str] = ()) -> None:
    """Print tables of (title, headings, rows), lines, and then a line for each kind of warnings; reports have all."""
    from tendonfmu.files import by_kind

    _print_tables(tables, lines, left)
    for words, _ in by_kind(warnings):
        warn(words)


def _print_tables(tables: Iterable[Any], lines: Iterable[str], left: str) -> None:
    from rich.console import Console
    from rich.table import Table

    stream = _of_results()
    if stream is None:
        return
    colours: Literal["auto"] | None = None if os.environ.get("NO_COLOR") else "auto"  # rich itself keeps bold
    console = Console(file=stream, markup=False, color_system=colours)  # names such as tendon_force[1] are no markup
    if not console.is_terminal:  # a file has no width: keep each row on one line
        console.width = 160
    with reader_may_leave(stream):
        for title, headings, rows in tables:
            table = Table(title=title, title_justify="left")
            for k, heading in enumerate(headings):
                table.add_column(heading, justify="right" if k > 0 and heading != left else "left")
            for row in rows:
                table.add_row(*row)
            console.print(table)
        for line in lines:
            console.print(line, highlight=False, soft_wrap=True)


# --- tables that a command writes -------------------------------------------------------------------------------------


def check_table(output: Path, *inputs: Path) -> None:
    """Check that a table can be written: a .csv, .parquet or .mcap file that is no input, or `-`."""
    from tendonfmu.files import check_output, check_output_format

    PRINTED.table = output == DASH
    if PRINTED.table and PRINTED.json:
        raise InputError("--output -: given with --json; expected a file, since both print on standard output")
    if not PRINTED.table:
        check_output_format(output)
        check_output(output, *inputs)


def check_second_file(file: Path | None, output: Path, what: str, *inputs: Path) -> None:
    """Check that a further file, if there is one, can be written beside `output`."""
    from tendonfmu.files import check_output

    if file is None:
        return
    check_output(file, *inputs)
    if file.resolve() == output.resolve():
        raise InputError(f"{file}: the same file for {what}; expected two names")


def write_table(output: Path, *blocks: Mapping[str, NDArray[Any]]) -> None:
    """Write columns [N], in one block of rows or several, to a .csv, .parquet or .mcap file, or to standard output."""
    write_blocks(output, blocks)


def write_blocks(output: Path, blocks: Iterable[Mapping[str, NDArray[Any]]]) -> None:
    """Write a table that comes in blocks of rows, as `write_table` does; only one block is in memory."""
    from tendonfmu.files import csv_lines
    from tendonfmu.files import write_blocks as write_file

    if output != DASH:
        write_file(output, blocks)
        return
    with reader_may_leave(sys.stdout):
        sys.stdout.writelines(csv_lines(blocks))
        sys.stdout.flush()


def name_of(output: Path) -> str:
    """Return the name of an output as messages say it."""
    return "standard output" if output == DASH else str(output)


# --- progress ---------------------------------------------------------------------------------------------------------


@contextmanager
def _bar(wanted: bool | None) -> Iterator[Progress]:
    """Show a bar on standard error; by default (None) on a terminal only."""
    from rich.console import Console
    from rich.progress import TimeRemainingColumn

    wanted = False if PRINTED.quiet else wanted
    console = Console(stderr=True, force_terminal=wanted or None)
    with _progress(console, console.is_terminal if wanted is None else wanted, TimeRemainingColumn()) as bar:
        yield bar


def _progress(console: Any, shown: bool, left: Any) -> Progress:
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), left)
    return Progress(*columns, console=console, disable=not shown, transient=True)


@contextmanager
def progress_bar(words: str, wanted: bool | None, total: int | None = None) -> Iterator[Callable[..., None]]:
    """Give a callback that shows the number of steps done, and of all steps where `total` is not known before."""
    with _bar(wanted) as bar:
        task = bar.add_task(words, total=total)

        def show(done: int, total: int | None = None) -> None:
            bar.update(task, completed=done, total=total)

        yield show


@contextmanager
def phase_bar(wanted: bool | None) -> Iterator[Callable[[str, int, int | None], None]]:
    """Give a callback that shows a computation of several phases: phase in words, steps done, total or None."""
    with _bar(wanted) as bar:
        task, now = bar.add_task("reading", total=None), ""

        def show(phase: str, done: int, total: int | None) -> None:
            nonlocal now, task
            if phase != now:  # rich cannot unset the total of a task, so each phase gets a new one
                bar.remove_task(task)
                task, now = bar.add_task(phase, total=total), phase
            bar.update(task, completed=done, total=total)

        yield show


@contextmanager
def fit_bar(wanted: bool | None) -> Iterator[Callable[[Any], None]]:
    """Give a callback that shows the phase, cost and samples per second of a fit."""
    with _bar(wanted) as bar:
        task, phase = bar.add_task("reading", total=None), ""

        def show(state: Any) -> None:
            nonlocal phase
            if state.phase != phase:
                bar.reset(task, total=state.total)
                phase = state.phase
            speed = bar.tasks[0].speed
            rate = f", {speed:,.0f} samples/s" if speed else ""
            cost = f", cost {state.cost:.6g}" if state.cost == state.cost else ""
            bar.update(task, completed=state.done, total=state.total, description=f"{phase}{cost}{rate}")

        yield show


class PhaseDisplay:
    """Progress of a computation of several phases, on standard error; call it with a `tendonfmu.tasks.PhaseState`."""

    EVERY = 10.0  # s between two lines where standard error is no terminal

    def __init__(self, wanted: bool | None = None) -> None:
        from rich.console import Console
        from rich.progress import TextColumn

        wanted = False if PRINTED.quiet else wanted
        console = Console(stderr=True)
        self._on_terminal = console.is_terminal
        self._shown = console.is_terminal if wanted is None else wanted
        self._bar = _progress(console, self._shown and self._on_terminal, TextColumn("{task.fields[left]}"))
        self._task: Any = None
        self._phase: tuple[int, int] | None = None
        self._said = 0.0  # s, time of the last printed line

    def __enter__(self) -> PhaseDisplay:
        self._bar.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._bar.stop()

    def __call__(self, state: PhaseState) -> None:
        is_new = (state.number, state.count) != self._phase
        self._phase = (state.number, state.count)
        head = f"phase {state.number} of {state.count}: {state.words}"
        if not self._shown:
            return
        if self._on_terminal:
            self._show(head, state, is_new)
        elif is_new or state.seconds - self._said >= self.EVERY:
            self._said = state.seconds
            count = "" if state.done == 0 or state.total is None else f"{state.done} of {state.total}"
            say(", ".join(part for part in (head, count, time_left(state.left_s)) if part))

    def note(self, words: str) -> None:
        """Show that a short step follows the last phase."""
        self._phase = None
        if self._shown and self._on_terminal:
            self._replace(words, None, "")
        elif self._shown:
            say(words)

    def refresh(self) -> None:
        """Draw the bar now instead of at its next refresh."""
        self._bar.refresh()

    def _show(self, head: str, state: PhaseState, is_new: bool) -> None:
        left = time_left(state.left_s)
        if is_new:
            self._replace(head, state.total, left)
        self._bar.update(self._task, completed=state.done, total=state.total, left=left)

    def _replace(self, description: str, total: int | None, left: str) -> None:
        if self._task is not None:  # rich cannot unset the total of a task, so it is replaced
            self._bar.remove_task(self._task)
        self._task = self._bar.add_task(description, total=total, left=left)


def time_left(seconds: float | None) -> str:
    """Say the estimated time left in words, rounded because it is an estimate."""
    if seconds is None:
        return ""
    if seconds < 90:
        return f"about {max(5, 5 * round(seconds / 5))} s left"
    return f"about {round(seconds / 60)} min left"
