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

from tendonfmu.cli import calibrate, check, convert, demo, detect, diagnose, excite, fit, import_mjcf, run
from tendonfmu.cli.command import SeveralValues
from tendonfmu.cli.console import BAD_INPUT, FAULT, INTERRUPTED, PRINTED, fail, leave, reader_may_leave, warn
from tendonfmu.cli.memory import prepare_for_limit
from tendonfmu.errors import InputWarning, refusal
from tendonfmu.fault_report import write_fault_report
from tendonfmu.tasks import ended_by_signals

_show_as_python = warnings.showwarning

app = typer.Typer(
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,  # its boxes cut off the names of options at 80 columns
    context_settings={"help_option_names": ["-h", "--help"]},
    help="Model the friction of tendon-driven robot fingers, and detect contact without a tactile sensor.",
)

DATA, TWO = "tendonfmu-demo/data", "tendonfmu-demo/data/two_joints"  # which `tendonfmu demo` leaves
INDEX = f"{DATA}/index_finger_calibrated.json"
# in the order of --help; an example runs where `tendonfmu demo` has run, and, where it names examples, in a clone
for name, (function, summary, example) in {
    "check": (
        check.check,
        "Check a description, and whether recordings belong to it.",
        f"{TWO}.json {TWO}_training.parquet",
    ),
    "build": (run.build, "Pack an FMU of a finger, or of a simulated one.", f"{INDEX} -o index_finger.fmu"),
    "run": (
        run.run,
        "Run a model over a recording and write all outputs.",
        f"{INDEX} {DATA}/index_finger_pushes.parquet -o out.csv",
    ),
    "simulate": (
        run.simulate,
        "Simulate a finger and write the recording.",
        "examples/rigs/index_finger_pushes.json -o pushes.parquet",
    ),
    "convert": (
        convert.convert,
        "Convert any log into a recording.",
        f"inspect {TWO}_training.parquet",
    ),
    "import": (
        import_mjcf.import_model,
        "Make a description from a MuJoCo model.",
        "mjcf examples/mujoco/finger.xml -o finger.json",
    ),
    "export": (
        import_mjcf.export_model,
        "Write fitted numbers into a MuJoCo model.",
        "mjcf examples/mujoco/finger_calibrated.json examples/mujoco/finger.xml -o fitted.xml",
    ),
    "describe": (
        convert.describe,
        "Write a description to begin with.",
        'finger --name thumb --joints base,tip --tendon "flexor base+ tip+" --tendon "extensor base- tip-" '
        '--tendon "tip_extensor base+ tip-" -o thumb.json',
    ),
    "excite": (excite.excite, "Plan a training motion.", f"{TWO}.json -o motion.csv --duration 60 --pretension 20"),
    "fit": (
        fit.fit,
        "Estimate the numbers of a finger from free motion.",
        f"{TWO}.json {TWO}_training.parquet --compare {TWO}_unseen.parquet -o fitted.json",
    ),
    "calibrate": (
        calibrate.calibrate,
        "The main way: from free motion to a tuned FMU.",
        f"{TWO}.json {TWO}_training.parquet --test {TWO}_unseen.parquet -o calibrated",
    ),
    "diagnose": (
        diagnose.diagnose,
        "Show what a model gets wrong, and name the cause.",
        f"{TWO}.json {TWO}_training.parquet --test {TWO}_unseen.parquet -o diagnosis",
    ),
    "tune": (
        detect.tune,
        "Tune contact detection for a rate of false alarms.",
        f"{INDEX} {DATA}/index_finger_free.parquet -o tuned.json",
    ),
    "score": (
        detect.score,
        "Measure contact detection against labels.",
        f"{INDEX} {DATA}/index_finger_pushes.parquet -o score.json",
    ),
    "demo": (demo.demo, "Show every step on built-in data.", ""),
}.items():
    shown = "\n  ".join(["\b\nExample:", f"tendonfmu {name} {example}".rstrip()])
    app.command(name, cls=SeveralValues, short_help=summary, epilog=shown)(function)


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
            prepare_for_limit()
            asked = [*sys.argv[2:3], "--help"] if sys.argv[1:2] == ["help"] else sys.argv[1:]
            status = _commands()(asked, prog_name="tendonfmu", standalone_mode=False)
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
