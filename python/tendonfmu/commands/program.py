"""What happens from the command line to the exit status: `tendonfmu` parses, calls and prints.

Results go to files or standard output, messages to standard error.

Exit status: 0 done, 1 the answer is no, 2 bad usage or input, 3 internal fault of tendonfmu, 129, 130 and 143 a signal.
"""

from __future__ import annotations

import functools
import mmap
import os
import sys
import warnings
from importlib import import_module
from typing import Annotated, Any, NoReturn, TextIO

import typer
from typer.core import TyperGroup

from tendonfmu.commands.command import SeveralValues, for_typer
from tendonfmu.commands.console import BAD_INPUT, FAULT, INTERRUPTED, PRINTED, fail, leave, reader_may_leave, warn
from tendonfmu.errors import InputWarning, refusal, write_fault_report
from tendonfmu.tasks import ended_by_signals

_show_as_python = warnings.showwarning

NEEDED = 400 << 20  # bytes; the libraries of a command and their buffers: with less they crash, or print their own text
SETTINGS: dict[str, Any] = {
    "pretty_exceptions_enable": False,
    "rich_markup_mode": None,  # its boxes cut off the names of options at 80 columns
    "context_settings": {"help_option_names": ["-h", "--help"]},
}

DATA, TWO = "tendonfmu-demo/data", "tendonfmu-demo/data/two_joints"  # which `tendonfmu demo` leaves
INDEX = f"{DATA}/index_finger_calibrated.json"
# name -> what it does and an example, in the order of --help; an example runs where `tendonfmu demo` has run, and in a
# clone where it names examples
COMMANDS = {
    "check": ("Check a description, and whether recordings belong to it.", f"{TWO}.json {TWO}_training.parquet"),
    "build": ("Pack an FMU of a finger, or of a simulated one.", f"{INDEX} -o index_finger.fmu"),
    "run": (
        "Run a model over a recording and write all outputs.",
        f"{INDEX} {DATA}/index_finger_pushes.parquet -o out.csv",
    ),
    "simulate": (
        "Simulate a finger and write the recording.",
        "examples/rigs/index_finger_pushes.json -o pushes.parquet",
    ),
    "convert": ("Convert any log into a recording.", f"inspect {TWO}_training.parquet"),
    "import": ("Make a description from a MuJoCo model.", "mjcf examples/mujoco/finger.xml -o finger.json"),
    "export": (
        "Write fitted numbers into a MuJoCo model.",
        "mjcf examples/mujoco/finger_calibrated.json examples/mujoco/finger.xml -o fitted.xml",
    ),
    "describe": (
        "Write a description to begin with.",
        'finger --name thumb --joints base,tip --tendon "flexor base+ tip+" --tendon "extensor base- tip-" '
        '--tendon "tip_extensor base+ tip-" -o thumb.json',
    ),
    "excite": ("Plan a training motion.", f"{TWO}.json -o motion.csv --duration 60 --pretension 20"),
    "fit": (
        "Estimate the numbers of a finger from free motion.",
        f"{TWO}.json {TWO}_training.parquet --compare {TWO}_unseen.parquet -o fitted.json",
    ),
    "calibrate": (
        "The main way: from free motion to a tuned FMU.",
        f"{TWO}.json {TWO}_training.parquet --test {TWO}_unseen.parquet -o calibrated",
    ),
    "diagnose": (
        "Show what a model gets wrong, and name the cause.",
        f"{TWO}.json {TWO}_training.parquet --test {TWO}_unseen.parquet -o diagnosis",
    ),
    "tune": (
        "Tune contact detection for a rate of false alarms.",
        f"{INDEX} {DATA}/index_finger_free.parquet -o tuned.json",
    ),
    "score": ("Measure contact detection against labels.", f"{INDEX} {DATA}/index_finger_pushes.parquet -o score.json"),
    "demo": ("Show every step on built-in data.", ""),
}
MODULES = {  # of commands that have none of their own name
    "simulate": "build",
    **dict.fromkeys(("describe", "import", "export"), "descriptions"),
    **dict.fromkeys(("tune", "score"), "detection"),
}


@functools.cache
def _made(name: str) -> Any:
    """Import a command and make its command line."""
    import_module(f"tendonfmu.commands.{MODULES.get(name, name)}")
    alone = typer.Typer(add_completion=False, **SETTINGS)
    summary, example = COMMANDS[name]
    shown = "\n  ".join(["\b\nExample:", f"tendonfmu {name} {example}".rstrip()])
    alone.command(name, cls=SeveralValues, short_help=summary, epilog=shown)(for_typer(name))
    return typer.main.get_command(alone)


class Commands(TyperGroup):
    """The group of all commands."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(**settings)
        self.commands: Any = dict.fromkeys(COMMANDS)  # whose names are proposed for one in another spelling

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """Import a command when it is asked for."""
        return _made(cmd_name) if cmd_name in COMMANDS else None

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """List the commands without importing them."""
        with formatter.section("Commands"):
            formatter.write_dl([(name, summary) for name, (summary, _) in COMMANDS.items()])


app = typer.Typer(
    cls=Commands,
    no_args_is_help=True,
    help="Model the friction of tendon-driven robot fingers, and detect contact without a tactile sensor.",
    **SETTINGS,
)


@functools.cache
def _app() -> Any:
    """Return what `app` runs at each call, made once in a process."""
    return typer.main.get_command(app)


def main() -> None:
    """Run the command.

    A refusal is one line on standard error and exit status 2. An internal fault is one line and exit status 3.
    """
    PRINTED.quiet = PRINTED.json = PRINTED.table = False
    warnings.showwarning = _show_warning
    warnings.simplefilter("default", InputWarning)  # each text once
    with ended_by_signals() as ending:
        try:
            prepare_for_limit()
            asked = [*sys.argv[2:3], "--help"] if sys.argv[1:2] == ["help"] else sys.argv[1:]
            status = _app()(asked, prog_name="tendonfmu", standalone_mode=False)
        except (KeyboardInterrupt, typer.Abort):
            _interrupted(ending.status)
        except SystemExit as ended:
            if ended.code == INTERRUPTED:  # the command has already reported what it saved
                leave(ending.status)
            raise
        except Exception as refused:
            if ending.asked is not None:  # a bar on a closed terminal, or an import that the signal cut short
                _interrupted(ending.status)
            if isinstance(refused, BrokenPipeError):  # the reader of standard output has closed it, as `head` does
                sys.stderr.close()
                sys.exit(0)
            if (reason := refusal(refused)) is not None:
                _refuse(reason)
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


def prepare_for_limit() -> None:
    """Take under a limit what OpenBLAS, which gives no error, takes later. Raises OSError or MemoryError."""
    if sys.platform == "win32":
        return
    import resource  # Unix only

    if resource.getrlimit(resource.RLIMIT_AS)[0] == resource.RLIM_INFINITY:
        return
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    os.environ.setdefault("ARROW_DEFAULT_MEMORY_POOL", "system")
    mmap.mmap(-1, NEEDED).close()
    import numpy as np
    from scipy.linalg import blas

    square = np.ones((64, 64))
    blas.dgemm(1.0, square, square @ square)


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
        bool, typer.Option("--version", "-V", callback=_show_version, is_eager=True, help="print the version and exit")
    ] = False,
) -> None:
    """Model the friction of tendon-driven robot fingers, and detect contact without a tactile sensor."""
