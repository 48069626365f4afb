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
import warnings
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from time import perf_counter
from typing import IO, TYPE_CHECKING, Any, Literal, NoReturn

from tendonfmu.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tendonfmu.estimate import FitProgress
    from tendonfmu.tasks import PhaseState

MOST_WARNINGS = 5  # lines at the end of a result
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


def deliver(result: Any, output: Path, words: str, report: Path | None = None) -> None:
    """Write and print a result. words: what `output` holds."""
    from tendonfmu.files import report_text, write_text

    result.write(output)
    text = report_text(result.report)
    if report is not None:
        write_text(report, text)
    print_json(lambda: text)
    print_result(result)
    say(f"{output}: {words}")


class Result(ABC):
    """Base of a result that is a report: it shows itself in a notebook as in the terminal."""

    @property
    @abstractmethod
    def report(self) -> Mapping[str, Any]:
        """All results, as the command writes them."""

    @property
    def warnings(self) -> list[str]:
        """Remarks on the recordings and the result, one sentence each."""
        return list(self.report["warnings"])

    @abstractmethod
    def shown(self) -> tuple[Iterable[Any], Iterable[str], str]:
        """Return tables, lines, and the heading of a column that is aligned to the left, as the command prints them."""

    def warn(self, category: type[Warning]) -> None:
        """Issue the remarks as warnings, at the call of the command's function."""
        for sentence in self.warnings:
            warnings.warn(sentence, category, stacklevel=4)

    def _repr_html_(self) -> str:
        tables, lines, _ = self.shown()
        from tendonfmu.report import html_of  # its packages take time of every command

        return html_of(repr(self)[1:-1], tables, lines, self.warnings)


def print_result(result: Result) -> None:
    """Print the tables, lines and warnings of a result."""
    tables, lines, left = result.shown()
    print_results(tables, lines, left, result.warnings)


def print_results(tables: Iterable[Any], lines: Iterable[str], left: str, warnings: Iterable[str] = ()) -> None:
    """Print tables of (title, headings, rows), lines, and a line for each of the first kinds of warnings."""
    from tendonfmu.files import by_kind

    _print_tables(tables, lines, left)
    kinds = by_kind(warnings)
    for words, _ in kinds[:MOST_WARNINGS]:
        warn(words)
    if more := len(kinds[MOST_WARNINGS:]):
        warn(f"{more} more of other kinds: the report and the page have all")


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


class Bar:
    """What is being done, on standard error: a bar on a terminal, elsewhere a line every 10 s.

    wanted: True says each new step at once, too; False says nothing.
    """

    EVERY = 10.0  # s
    PATIENCE = 3.0  # s; the remaining time is not estimated before

    def __init__(self, wanted: bool | None = None, clock: Callable[[], float] = perf_counter) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

        console = Console(stderr=True)
        self._lines = not PRINTED.quiet and wanted is not False and not console.is_terminal
        self._at_once, self._clock = wanted is True, clock
        is_bar = not PRINTED.quiet and wanted is not False and console.is_terminal
        columns = (
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TextColumn("{task.fields[left]}"),
        )
        self._bar = Progress(*columns, console=console, disable=not is_bar, transient=True)
        self._task: Any = None
        self._words = ""
        self._begun = self._said = clock()

    def __enter__(self) -> Bar:
        self._bar.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._bar.stop()

    def __call__(self, words: str, done: int = 0, total: int | None = None, left: str | None = None) -> None:
        """Show what is being done, how many steps of it, and what is left, by default the time."""
        now, is_new = self._clock(), words != self._words
        if is_new:
            self._begun = now if self._words else self._begun
            self._words = words
        if left is None:
            passed = now - self._begun
            known = total is not None and 0 < done < total and passed > self.PATIENCE
            left = time_left(passed / done * (total - done)) if known and total is not None else ""
        if self._lines:
            if now - self._said >= self.EVERY or (is_new and self._at_once):
                self._said = now
                count = "" if done == 0 or total is None else f"{done} of {total}"
                say(", ".join(part for part in (words, count, left) if part))
            return
        if is_new:
            if self._task is not None:  # rich cannot unset the total of a task, so it is replaced
                self._bar.remove_task(self._task)
            self._task = self._bar.add_task(words, total=total, left=left)
        self._bar.update(self._task, completed=done, total=total, left=left)

    def phase(self, state: PhaseState) -> None:
        """Show a computation of several phases."""
        head = f"phase {state.number} of {state.count}: {state.words}"
        self(head, state.done, state.total, time_left(state.left_s))

    def fit(self, state: FitProgress) -> None:
        """Show a fit."""
        self(state.phase, state.done, state.total, f"cost {state.cost:.6g}" if isfinite(state.cost) else "")


@contextmanager
def progress_bar(words: str, wanted: bool | None, total: int | None = None) -> Iterator[Callable[..., None]]:
    """Give a callback that shows the number of steps done, and of all steps where `total` is not known before."""
    with Bar(wanted) as bar:
        yield lambda done, all_steps=None: bar(words, done, all_steps or total)


def time_left(seconds: float | None) -> str:
    """Say the estimated time left in words, rounded because it is an estimate."""
    if seconds is None:
        return ""
    if seconds < 90:
        return f"about {max(5, 5 * round(seconds / 5))} s left"
    return f"about {round(seconds / 60)} min left"
