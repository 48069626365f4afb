"""How a function becomes a command: its options from their dataclass, `-` for standard input, repeated values.

Every command takes `--json` and `--quiet`; a command with options shared by several takes them from
`tendonfmu.options`, or from the annotations here.
"""

from __future__ import annotations

import inspect
import math
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import wraps
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import typer
from typer.core import TyperCommand

from tendonfmu.commands.console import DASH, PRINTED
from tendonfmu.errors import InputError
from tendonfmu.options import Option, Options

REPEATED = ("--test", "--pushes")  # `--test A B` means `--test A --test B`
# how a file begins -> its suffix; what is none of these is a table in text
_BEGINNINGS = {
    b"PK\x03\x04": ".fmu",
    b"PAR1": ".parquet",
    b"MATLAB": ".mat",
    b"\x89HDF": ".h5",
    b"\x89MCAP": ".mcap",
    b"\x1f\x8b": ".csv.gz",
    b"{": ".json",
    b"[": ".json",
}

# --- arguments and options of several commands ------------------------------------------------------------------------


def output_option(metavar: str, help: str) -> Any:
    """Return the option `--output`."""
    return typer.Option("-o", "--output", metavar=metavar, help=help)


FingerFile = Annotated[Path, typer.Argument(metavar="FINGER.json", help="finger description; its structure is kept")]
ExtendedFinger = Annotated[
    Path,
    typer.Argument(
        metavar="FINGER.json|HAND.json", help="finger description, or hand; kept, and extended by the causes found"
    ),
]
Model = Annotated[
    Path, typer.Argument(metavar="FINGER.json|FINGER.fmu|HAND.json", help="finger description, its FMU, or a hand")
]
FreeRecordings = Annotated[list[Path], typer.Argument(metavar="RECORDING", help="free motion, .csv or .parquet")]
FreeAtPretensions = Annotated[
    list[Path], typer.Argument(metavar="FREE", help="free motion at several pretensions, .csv or .parquet")
]
Subject = Annotated[Path, typer.Argument(metavar="FINGER.json|RIG.json", help="finger description, or rig")]
Figures = Annotated[Path | None, typer.Option(metavar="DIR", help="folder for a page with figures")]
Report = Annotated[Path | None, typer.Option(metavar="R.json", help="report with all results, as JSON")]
Scheduler = Annotated[
    str | None,
    typer.Option(
        metavar="ADDRESS", help="dask cluster for the fingers of a hand, or for --history [default: --jobs processes]"
    ),
]
Progress = Annotated[
    bool | None,
    typer.Option("--progress/--no-progress", help="show progress [default: a bar on a terminal, else lines]"),
]


def _set_quiet(wanted: bool) -> None:
    PRINTED.quiet = wanted


def _set_json(wanted: bool) -> None:
    PRINTED.json = wanted


# what these set is read by `console`, so no command takes them
_OF_ALL = {
    "as_json": Annotated[bool, typer.Option("--json", callback=_set_json, help="print the result as one JSON object")],
    "quiet": Annotated[bool, typer.Option("-q", "--quiet", callback=_set_quiet, help="print errors only")],
}


# --- from function to command -----------------------------------------------------------------------------------------


class Line(NamedTuple):
    """What a command line calls."""

    function: Callable[..., None]  # takes files and options, calls the function of Python, writes and prints
    options: type[Options] | None
    reads: Sequence[str]


LINES: dict[str, Line] = {}  # by the name of the command
OF_HANDS = ("check", "run", "calibrate", "diagnose", "score")  # commands that take a hand in place of a finger


def command(
    name: str, options: type[Options] | None = None, *, of: Callable[..., Any] | None = None, reads: Sequence[str] = ()
) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Decorate the function of a command line.

    options: class whose options stand on the command line in place of the parameter `options`. of: the command's
    function in Python, whose docstring begins the help. reads: arguments in which `-` is standard input.
    """

    def decorate(function: Callable[..., None]) -> Callable[..., None]:
        described = "" if of is None else inspect.cleandoc(of.__doc__ or "").partition("\n\nParameters\n")[0]
        function.__doc__ = "\n\n".join(filter(None, (described, inspect.getdoc(function))))
        LINES[name] = Line(function, options, reads)
        return function

    return decorate


def is_hand(path: Path) -> bool:
    """Return whether a file claims to be a hand, even an invalid one."""
    from tendonfmu.files import format_of

    return path.suffix.lower() == ".json" and format_of(path).startswith("tendonfmu-hand-")


def for_typer(name: str) -> Callable[..., None]:
    """Return the function from which typer makes a command."""
    line, parameters = LINES[name], _parameters(*LINES[name][:2])

    @wraps(line.function)
    def run(**given: Any) -> None:
        arguments = {key: value for key, value in given.items() if key not in _OF_ALL}
        if line.options is not None:
            taken = {key: arguments.pop(key) for key, each in line.options.each().items() if each.shown}
            # typer has None where nothing was given
            arguments["options"] = line.options(**{key: value for key, value in taken.items() if value is not None})
        with _standard_input(arguments, line.reads) as read:
            function = line.function
            if name in OF_HANDS and is_hand(next(iter(read.values()))):
                function = getattr(import_module("tendonfmu.commands.hand.commands"), f"{name}_hand")
            function(**read)

    run.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    run.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    return run


def _parameters(function: Callable[..., None], options: type[Options] | None) -> list[inspect.Parameter]:
    """Return the parameters that typer reads, in the order of the help."""
    parameters: list[inspect.Parameter] = []
    # get_type_hints of Python 3.10 makes Optional[Annotated[...]] of a default None
    for name, parameter in inspect.signature(function, eval_str=True).parameters.items():
        if name == "options" and options is not None:
            parameters += [_option(each) for each in options.each().values() if each.shown]
        else:
            parameters.append(parameter.replace(kind=inspect.Parameter.KEYWORD_ONLY))
    for name, annotation in _OF_ALL.items():
        kind = inspect.Parameter.KEYWORD_ONLY
        parameters.append(inspect.Parameter(name, kind, default=False, annotation=annotation))
    return parameters


def _option(option: Option) -> inspect.Parameter:
    """Make the parameter of an option."""
    words, bracket, usual = option.help.partition(" [")
    plain = f"--{option.name.rstrip('_').replace('_', '-')}"  # alone: no --no-NAME
    limits: Any = {"min": option.least, "max": None if option.most == math.inf else option.most}
    shown: Any = typer.Option(
        *(option.names or ((plain,) if option.default is False or option.name.endswith("_") else ())),
        metavar="|".join(option.texts) or option.metavar,
        help=words + "; may be repeated" * option.several + bracket + usual,
        **(limits if option.least is not None else {}),
    )
    kind: Any = list[option.kind] if option.several else option.kind  # type: ignore[name-defined]
    return inspect.Parameter(
        option.name,
        inspect.Parameter.KEYWORD_ONLY,
        default=None if option.several else option.default,
        annotation=Annotated[kind | None if option.optional or option.several else kind, shown],
    )


class SeveralValues(TyperCommand):
    """Command that takes several values for each of its options in `REPEATED`."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        valued = {name for each in self.params if not getattr(each, "is_flag", False) for name in each.opts}
        return super().parse_args(ctx, several_values(args, valued))


def several_values(args: Sequence[str], valued: set[str]) -> list[str]:
    """Repeat an option in `REPEATED` before each of its values."""
    repeated: list[str] = []
    free, option = 0, ""  # count of arguments without an option so far; the option of the next word
    rest = list(args)
    while rest and rest[0] != "--":
        word = rest.pop(0)
        name, equals, _ = word.partition("=")
        if word.startswith("-") and word != "-":
            repeated.append(word)
            if name in valued and not equals and rest:
                repeated.append(rest.pop(0))
            option = name if name in REPEATED and name in valued and free > 1 else ""
        elif option:
            repeated += [option, word]
        else:
            repeated.append(word)
            free += 1
    return repeated + rest


# --- standard input ---------------------------------------------------------------------------------------------------


@contextmanager
def _standard_input(arguments: Mapping[str, Any], reads: Sequence[str]) -> Iterator[Mapping[str, Any]]:
    """Put a file with standard input in the place of `-` in the arguments in `reads`, one file or several."""
    files = {name: _files(arguments[name]) for name in reads}
    uses = [name for name in reads for file in files[name] if file == DASH]
    if not uses:
        yield arguments
        return
    if len(uses) > 1:
        where = " and ".join(dict.fromkeys(uses))
        raise InputError(f"-: given {len(uses)} times, for {where}; standard input can be read once")
    import tempfile

    (name,) = uses
    with tempfile.TemporaryDirectory(prefix="tendonfmu-") as folder:
        kept = _kept(sys.stdin.buffer.read(), Path(folder))
        several = [kept if file == DASH else file for file in files[name]]
        yield {**arguments, name: several if isinstance(arguments[name], list) else kept}


def _files(value: Any) -> list[Path]:
    return value if isinstance(value, list) else [] if value is None else [value]


def _kept(content: bytes, folder: Path) -> Path:
    """Write the content of standard input to a file whose suffix says what it is."""
    if not content.strip():
        raise InputError("-: standard input is empty; expected a finger description (JSON), an FMU or a recording")
    start = content[:100].lstrip(b"\xef\xbb\xbf \t\r\n")
    suffix = next((suffix for begin, suffix in _BEGINNINGS.items() if start.startswith(begin)), ".csv")
    from tendonfmu.files import StandIn

    file = StandIn.of(folder / f"standard_input{suffix}", f"standard_input{suffix}")
    file.write_bytes(content)
    return file
