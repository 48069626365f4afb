"""What happens from the command line to the exit status: `tendonfmu` parses, calls and prints.

Results go to files or standard output, messages to standard error.

Exit status: 0 done, 1 the answer is no, 2 bad usage or input, 3 internal fault of tendonfmu, 129, 130 and 143 a signal.
"""

from __future__ import annotations

import functools
import sys
import warnings
from collections.abc import Callable
from typing import Annotated, Any, NoReturn, TextIO

import typer
from typer.main import get_command

from tendonfmu.cli import (
    build,
    calibrate,
    check,
    convert,
    demo,
    describe,
    detect,
    diagnose,
    excite,
    fit,
    import_mjcf,
    run,
    simulate,
)
from tendonfmu.cli.console import BAD_INPUT, FAULT, INTERRUPTED, PRINTED, fail, leave, reader_may_leave, warn
from tendonfmu.cli.fault_report import is_own_file, is_without_memory, write_fault_report
from tendonfmu.errors import InputError, InputWarning, line_of
from tendonfmu.tasks import ended_by_signals

_show_as_python = warnings.showwarning

app = typer.Typer(
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,  # its boxes cut off the names of options at 80 columns
    context_settings={"help_option_names": ["-h", "--help"]},
    help="Model the friction of tendon-driven robot fingers, and detect contact without a tactile sensor.",
)

for command in (
    check,
    build,
    run,
    simulate,
    convert,
    import_mjcf,
    describe,
    excite,
    fit,
    calibrate,
    diagnose,
    detect,
    demo,
):  # the order of --help
    command.register(app)


@functools.cache
def _commands() -> Callable[..., Any]:
    """Return what `app` runs at each call. To read the options of all commands takes 50 ms: once in a process."""
    return get_command(app)


def main() -> None:
    """Run the command.

    A refusal is one line on standard error and exit status 2. An internal fault is one line and exit status 3.
    """
    PRINTED.quiet = PRINTED.json = PRINTED.table = False
    warnings.showwarning = _show_warning
    warnings.simplefilter("default", InputWarning)  # each text once
    with ended_by_signals() as ending:
        try:
            status = _commands()(prog_name="tendonfmu", standalone_mode=False)
        except (InputError, OSError) as refused:
            if isinstance(refused, OSError) and ending.asked is not None:  # a bar on a closed terminal
                _interrupted(ending.status)
            if isinstance(refused, BrokenPipeError):  # the reader of standard output has closed it, as `head` does
                sys.stderr.close()
                sys.exit(0)
            if isinstance(refused, OSError) and (refused.errno is None or is_own_file(refused.filename)):
                _fault(refused)
            _refuse(line_of(refused))
        except (KeyboardInterrupt, typer.Abort):
            _interrupted(ending.status)
        except SystemExit as ended:
            if ended.code == INTERRUPTED:  # the command has already reported what it saved
                leave(ending.status)
            raise
        except Exception as refused:
            if is_without_memory(refused):
                _refuse("not enough memory")
            # Bad usage is recognised by this method: its class has moved between versions of typer.
            if not hasattr(refused, "format_message"):
                _fault(refused)
            elif type(refused).__name__ == "NoArgsIsHelpError":
                print(refused.format_message(), file=sys.stderr)
                sys.exit(BAD_INPUT)
            else:
                page = getattr(getattr(refused, "ctx", None), "command_path", "tendonfmu")
                _refuse(f"{refused.format_message().rstrip('.')}; see {page} --help")
        else:
            if status == INTERRUPTED:  # newer versions of typer turn Ctrl-C into a status
                _interrupted(ending.status)
            with reader_may_leave(sys.stdout):
                sys.stdout.flush()
            sys.exit(status if isinstance(status, int) else 0)


def _show_warning(
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    file: TextIO | None = None,
    line: str | None = None,
) -> None:
    """Show a warning about the input as a line, and any other as Python does."""
    if issubclass(category, InputWarning):
        warn(" ".join(str(message).split()))
    else:
        _show_as_python(message, category, filename, lineno, file, line)


def _refuse(reason: str) -> NoReturn:
    fail(" ".join(reason.split()))
    sys.exit(BAD_INPUT)


def _fault(error: BaseException) -> NoReturn:
    report = write_fault_report(error, sys.argv[1:])
    where = "no report could be written" if report is None else f"please send the report {report}"
    fail(f"internal error ({type(error).__name__}), a fault of tendonfmu, not of its input; {where}")
    leave(FAULT)


def _interrupted(status: int) -> NoReturn:
    fail("interrupted; no file was left half written")
    leave(status)


def _show_version(wanted: bool) -> None:
    if wanted:
        from tendonfmu import __version__

        print(f"tendonfmu {__version__}")
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="print the version and exit")
    ] = False,
) -> None:
    """Model the friction of tendon-driven robot fingers, and detect contact without a tactile sensor."""
