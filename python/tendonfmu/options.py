"""The options of the commands: name, default, values and a line of help of each, once.

`commands.command` makes the command line of a command from its class; `keywords` gives them to its function in Python,
with signature and docstring. An option means the same in every command.
"""

# ruff: noqa: RUF009 (`option` makes a field)
# The classes are made at the start of every command: their comparison and their text, which nobody needs, take 10 ms.

from __future__ import annotations

import functools
import inspect
import math
import operator
import os
import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, fields
from enum import IntEnum
from numbers import Integral, Real
from pathlib import Path
from reprlib import Repr
from typing import TYPE_CHECKING, Any, ClassVar, Concatenate, ParamSpec, TypeAlias, TypeVar

from tendonfmu.errors import InputError

if TYPE_CHECKING:
    from tendonfmu.recordings import RecordingSource
    from tendonfmu.tasks import PhaseState

RecordingSources: TypeAlias = "RecordingSource | Sequence[RecordingSource]"
_SHORT = Repr()
_SHORT.maxstring = _SHORT.maxother = 60

First = TypeVar("First")
Second = TypeVar("Second")
Result = TypeVar("Result")
Keywords = ParamSpec("Keywords")
Taken = TypeVar("Taken", bound="Options")
Made = TypeVar("Made", bound="Configured")


class KinematicsSource(IntEnum):
    """Where the motion of the joints comes from."""

    TENDON_POSITIONS = 1
    MEASURED_JOINT_POSITIONS = 2
    JOINT_POSITIONS_AND_VELOCITIES = 3


# --- which values an option takes -------------------------------------------------------------------------------------


@dataclass(eq=False, repr=False)
class Values:
    """Which values an option takes."""

    type: Any  # on the command line
    words: str
    read: Callable[[Any], Any]  # returns a plain value, or raises ValueError
    limits: dict[str, float] = field(default_factory=dict)  # least and most, as typer takes them


def number(least: float, most: float = math.inf, whole: bool = False, optional: bool = False) -> Values:
    """Take a number from `least` to `most`; both are allowed."""

    def read(value: Any) -> float | int | None:
        if value is None and optional:
            return None
        if isinstance(value, bool) or not isinstance(value, Integral if whole else Real):
            raise ValueError
        if not least <= value <= most:  # type: ignore[operator]
            raise ValueError
        plain: float | int = (int if whole else float)(value)  # type: ignore[call-overload]
        return plain

    kind: Any = int if whole else float
    reach = f"{least:.16g} to {most:.16g}" if most < math.inf else f"{least:.16g} or more"
    words = f"a {'whole ' * whole}number, {reach}{', or None' * optional}"
    limits = {"min": least} | ({"max": most} if most < math.inf else {})
    return Values(kind | None if optional else kind, words, read, limits)


def choice(*texts: str) -> Values:
    """Take one of several texts."""

    def read(value: Any) -> str:
        if not (isinstance(value, str) and value in texts):
            raise ValueError
        return value

    return Values(str, " or ".join(texts), read)


def kind(words: str, *types: Any, optional: bool = False) -> Values:
    """Take a value of one of `types`; the first is that on the command line."""

    def read(value: Any) -> Any:
        if bool in types and type(value).__name__ in ("bool", "bool_"):  # of numpy, which takes 0.1 s to import
            return bool(value)
        if not (isinstance(value, types) or (value is None and optional)):
            raise ValueError
        return value

    return Values(types[0] | None if optional else types[0], words + " or None" * optional, read)


def several(words: str, item: Values) -> Values:
    """Take one value or several; on the command line an option that may be repeated."""

    def read(value: Any) -> Any:
        alone = isinstance(value, str | os.PathLike) or not isinstance(value, Iterable)
        items = [item.read(each) for each in ([value] if alone else value)]
        # scikit-learn's clone wants back the very list that it passed
        unchanged = isinstance(value, list) and all(map(operator.is_, items, value))
        return value if unchanged else items

    return Values(list[item.type] | None, words, read, item.limits)  # type: ignore[name-defined]


File = str | os.PathLike[str]
_COLUMN = kind("the name of a column", str, optional=True)
_PATH = kind("a path", Path, str, os.PathLike, optional=True)
_TEXTS = several("a text or a list of texts", kind("a text", str))
_PATHS = several("a path or a list of paths", kind("a path", Path, str, os.PathLike))
# who uses recordings checks them
_RECORDING = Values(Path | None, "a recording, DataFrame or file or None", lambda given: given)
_RECORDINGS = Values(list[Path] | None, "a recording, DataFrame or file, or a list of them", lambda given: given)
_FUNCTION = kind("a function", Callable, optional=True)
_YES, _YES_OR_NONE = kind("True or False", bool), kind("True, False", bool, optional=True)


# --- an option, and the options of a command --------------------------------------------------------------------------


@dataclass(eq=False, repr=False)
class Option:
    """What an option takes, and how the command line shows it."""

    values: Values
    help: str | None = None
    metavar: str | None = None
    names: tuple[str, ...] = ()  # on the command line, where that of the field is not enough
    shown: bool = True  # on the command line

    def sentence(self, default: Any) -> str:
        """Describe the option for readers of Python: what it is, its values and its default."""
        words = re.sub(r"; may be repeated| \[default: .*\]", "", self.help or "")
        usual = re.findall(r"\[default: (.*)\]", self.help or "") or [repr(default)]
        return f"{words[:1].upper()}{words[1:]} ({self.values.words}; default {usual[0]})."


def option(default: Any, values: Values, help: str = "", **shown: Any) -> Any:
    """Make the field of an option, which is given by its name."""
    return field(default=default, metadata={"option": Option(values, help or None, **shown)})


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Options:
    """Base of the options of a command. Raises InputError that names an option whose value is refused."""

    def __post_init__(self) -> None:
        for name, each in self.each().items():
            try:
                object.__setattr__(self, name, each.values.read(getattr(self, name)))
            except ValueError:
                given = _SHORT.repr(getattr(self, name))
                raise InputError(f"{name}: {given}; expected {each.values.words}") from None

    def __repr__(self) -> str:
        return f"{type(self).__name__}({', '.join(f'{name}={value!r}' for name, value in vars(self).items())})"

    @classmethod
    def each(cls) -> dict[str, Option]:
        """Return the options by name."""
        return {each.name: each.metadata["option"] for each in fields(cls)}

    @classmethod
    def defaults(cls) -> dict[str, Any]:
        """Return the defaults by name."""
        return {each.name: each.default for each in fields(cls)}

    def files(self, *names: str) -> list[Path]:
        """Return the files that the command line gave for some options."""
        given = [getattr(self, name) for name in names]
        return [file for one in given for file in (one if isinstance(one, list) else [one] if one else [])]

    def without(self, *names: str) -> dict[str, Any]:
        """Return the options but some by name."""
        return {name: value for name, value in vars(self).items() if name not in names}


def keywords(
    options: Callable[Keywords, Taken],
) -> Callable[[Callable[[First, Second, Taken], Result]], Callable[Concatenate[First, Second, Keywords], Result]]:
    """Decorate a function of two arguments and options: it takes each option by name, and its docstring lists them."""
    known: Any = options

    def decorate(function: Callable[..., Result]) -> Callable[Concatenate[First, Second, Keywords], Result]:
        *sources, _ = inspect.signature(function).parameters.values()
        listed, ours = "", []
        for each in fields(known):
            by_name = inspect.Parameter.KEYWORD_ONLY
            ours.append(inspect.Parameter(each.name, by_name, default=each.default, annotation=each.type))
            listed += f"    {each.name}\n        {each.metadata['option'].sentence(each.default)}\n"

        signature = inspect.Signature([*sources, *ours])

        @functools.wraps(function)
        def call(*given: Any, **named: Any) -> Result:
            try:
                taken = signature.bind(*given, **named).arguments
            except TypeError as wrong:
                raise TypeError(f"{function.__name__}() {wrong}") from None
            by_name = {each.name: taken.pop(each.name) for each in sources if each.name in taken}
            return function(**by_name, options=known(**taken))

        call.__signature__ = signature  # type: ignore[attr-defined]
        call.__doc__ = (function.__doc__ or "").replace("\n    Returns\n", f"{listed}\n    Returns\n", 1)
        return call

    return decorate


class Configured:
    """Base of an estimator as in scikit-learn, which keeps its finger and its options."""

    Options: ClassVar[type[Options]]

    def __init__(self, finger: Any, **options: Any) -> None:
        unknown = set(options) - set(self.Options.each())
        if unknown:
            raise TypeError(f"{type(self).__name__}: unexpected options {', '.join(sorted(unknown))}")
        self.finger, self.options = finger, self.Options(**options)

    def __getattr__(self, name: str) -> Any:
        """Return an option, as scikit-learn's estimators have them."""
        options = self.__dict__.get("options")
        if options is None or name not in options.each():
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
        return getattr(options, name)

    def get_params(self, deep: bool = True) -> dict[str, Any]:
        """Return the constructor arguments by name."""
        return {"finger": self.finger, **vars(self.options)}

    def set_params(self: Made, **params: Any) -> Made:
        """Set constructor arguments by name and return the object itself."""
        known = self.get_params()
        for name in params:
            if name not in known:
                raise ValueError(f"no parameter {name!r}; expected one of {', '.join(known)}")
        Configured.__init__(self, **{**known, **params})
        return self

    def __repr__(self) -> str:
        usual = vars(self.Options())
        given = {name: value for name, value in self.get_params().items() if name not in usual or value != usual[name]}
        return f"{type(self).__name__}({', '.join(f'{name}={value!r}' for name, value in given.items())})"


# --- options of several commands --------------------------------------------------------------------------------------


def _kinematics() -> Any:
    words = (f"{source}: {source.name.lower().replace('_', ' ')}" for source in KinematicsSource)
    return option(1, number(1, 3, whole=True), ", ".join(words), metavar="1|2|3")


def _seed() -> Any:
    return option(0, number(0, 2**53, whole=True), "seed of the random numbers", metavar="N")


def _jobs() -> Any:
    return option(1, number(1, 1024, whole=True), "processor cores to use; no effect on the result", metavar="N")


def _false_alarms() -> Any:
    return option(6.0, number(1e-3, 3600.0), "false alarms an hour in other free motion, at most", metavar="RATE")


def _path(help: str, **shown: Any) -> Any:
    return option(None, _PATH, help, **shown)


def _recordings(help: str, metavar: str = "RECORDING", default: Any = ()) -> Any:
    words, bracket, usual = help.partition(" [")
    return option(default, _RECORDINGS, f"{words}; may be repeated{bracket}{usual}", metavar=metavar)


def _progress(help: str) -> Any:
    return option(None, _FUNCTION, help, shown=False)


# --- the commands -----------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class BuildOptions(Options):
    """Options of `build`."""

    reference: RecordingSource | None = option(
        None, _RECORDING, "recording; the FMU carries its inputs and outputs for checks", metavar="REC"
    )
    ssv: Sequence[File] = option((), _PATHS, "parameter set that the FMU carries; may be repeated", metavar="SET.ssv")
    binaries: File | None = _path("folder of binaries by FMI platform [default: those installed]", metavar="DIR")
    fmi: int = option(2, number(2, 3, whole=True), "version of FMI; 3: forces and torques as arrays", metavar="2|3")
    sample_at: str = option(
        "begin",
        choice("begin", "end"),
        "end: for masters that hand over the inputs of a step's end",
        metavar="begin|end",
    )
    c_array: bool = option(
        False, _YES, "write the finger as a C source for a microcontroller, in place of an FMU", names=("--c-array",)
    )


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class RunOptions(Options):
    """Options of `run`."""

    kinematics: int = _kinematics()
    progress: Callable[[int], None] | None = _progress("called with the number of samples done")


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class ExciteOptions(Options):
    """Options of `excite`."""

    duration: float = option(400.0, number(1.0, 1e5), "per pretension, in all with --alternate", metavar="SECONDS")
    max_speed: float = option(1.0, number(1e-3, 100.0), "limit for every joint", metavar="RAD/S")
    range_: Sequence[str] = option(
        (),
        _TEXTS,
        "joint range in rad, by number or name; may be repeated",
        metavar="JOINT=LOW:HIGH",
        names=("--range",),
    )
    pretension: Sequence[float] = option(
        (),
        several("a number or a list of numbers, 0.001 to 1000000", number(1e-3, 1e6)),
        "mean tendon force; may be repeated [default: 10]",
        metavar="NEWTON",
    )
    alternate: float | None = option(
        None, number(1.0, optional=True), "time between changes of the pretension", metavar="SECONDS"
    )
    vary_tension: str | None = option(
        None,
        kind("a text", str, optional=True),
        "in N; vary the tension of each tendon in turn, without a pretension",
        metavar="LOW:HIGH",
    )
    vary_every: float = option(10.0, number(2.0, 1e5), "time between changes of the tensions", metavar="SECONDS")
    max_acceleration: float = option(10.0, number(0.1, 1e4), "limit for every joint", metavar="RAD/S²")
    rate: float = option(100.0, number(20.0, 10000.0), "rows per second", metavar="HZ")
    seed: int = _seed()


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class FitOptions(Options):
    """Options of `fit`."""

    method: str = option("batch", choice("batch", "ekf"), "maximum likelihood or Kalman filter", metavar="batch|ekf")
    holdout: float = option(0.0, number(0.0, 0.9), "share of the time not used in the fit", metavar="SHARE")
    holdout_block: float = option(10.0, number(1.0), "longest block left out", metavar="SECONDS")
    kinematics: int = _kinematics()
    routing: bool = option(
        False, _YES, "first learn moment arms, stiffness and zeros, by joint_position", names=("--routing",)
    )
    # patterns of paths: which numbers are estimated, kept, and share one value
    only: Sequence[str] = option((), _TEXTS, "estimate only these numbers; may be repeated", metavar="PATTERN")
    fix: Sequence[str] = option((), _TEXTS, "keep these numbers fixed; may be repeated", metavar="PATTERN")
    share: Sequence[str] = option(
        (), _TEXTS, "laws that share one set of values; may be repeated", metavar="tendons|pulleys|PATTERN"
    )
    asymmetric: bool | None = option(
        None, _YES_OR_NONE, "fit the two sides of a law apart, or as one", names=("--asymmetric/--symmetric",)
    )
    prior: float | None = option(
        None,
        number(1e-6, 1e6, optional=True),
        "by how much the given numbers are off / expected magnitude [default: learned from the data]",
        metavar="RATIO",
    )
    scale: Sequence[str] = option(
        (), _TEXTS, "expected magnitude, instead of the description's", metavar="PATTERN=VALUE"
    )
    previous: File | None = _path(
        "report or description of an earlier fit, as the prior", metavar="PREVIOUS.json", names=("--from",)
    )
    effective_samples: bool = option(
        True,
        _YES,
        "count correlated residuals as fewer samples",
        names=("--effective-samples/--no-effective-samples",),
    )
    passes: int | None = option(
        None, number(1, whole=True, optional=True), "most passes over the data [default: 60; ekf: 2]", metavar="N"
    )
    tolerance: float = option(0.3, number(1e-9, 0.5), "batch: last step, in standard errors", metavar="SIZE")
    drift: float = option(0.0, number(0.0, 1.0), "ekf: relative variance of the numbers per s", metavar="RATE")
    progress: Callable[[Any], bool | None] | None = _progress("called with each `FitProgress`; returns False to stop")

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.drift and self.method != "ekf":
            raise InputError(
                f"drift = {self.drift!r}: expected 0 with method {self.method}; only method ekf lets parameters drift"
            )


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class FitArguments(FitOptions):
    """What `fit` takes beside finger and recordings."""

    compare: RecordingSources = _recordings("recording to judge, not to fit")


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class CalibrateOptions(Options):
    """Options of `calibrate`."""

    test: RecordingSources = _recordings("free motion that only judges the result [default: parts of FREE]", "FREE")
    pushes: RecordingSources = _recordings("recordings with labelled contact, to count what is found", "LABELLED")
    previous: File | None = _path(
        "finger.json of an earlier calibration, or report of a fit, as the prior; for little data",
        metavar="PREVIOUS.json",
        names=("--from",),
    )
    folder: File | None = _path("folder for the results of the steps: a repeated call goes on there", shown=False)
    false_alarms_per_hour: float = _false_alarms()
    kinematics: int = _kinematics()
    seed: int = _seed()
    jobs: int = _jobs()
    progress: Callable[[PhaseState], None] | None = _progress("called with each `PhaseState`")


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class DiagnoseOptions(Options):
    """Options of `diagnose`."""

    test: RecordingSources = _recordings("recordings to measure the gain on, not to fit [default: parts of RECORDING]")
    reference: RecordingSources | None = _recordings(
        "recordings of the same finger when healthy, to find what has changed since; best the same motion", default=None
    )
    kinematics: int = _kinematics()
    least_gain: float = option(
        0.03, number(0.0, 0.5), "least drop of the rms on unseen data for a cause", metavar="SHARE"
    )
    seed: int = _seed()
    jobs: int = _jobs()
    progress: Callable[[PhaseState], None] | None = _progress("called with each `PhaseState`")


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class TuneOptions(Options):
    """Options of `tune`."""

    false_alarms_per_hour: float = _false_alarms()
    method: str = option(
        "bands", choice("bands", "paper"), "contact.method; paper is the rule of the paper", metavar="bands|paper"
    )
    bias_time: float | None = option(
        None, number(1e-3, 1e4, optional=True), "time constant of the bias [default: unchanged]", metavar="SECONDS"
    )
    kinematics: int = _kinematics()
    progress: Callable[[int, int], None] | None = _progress("called with steps done and steps")


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class ScoreOptions(Options):
    """Options of `score`."""

    labels: str | None = option(None, _COLUMN, "1 in contact, else 0 [default: contact, if present]", metavar="COLUMN")
    force: str | None = option(None, _COLUMN, "sensed force in N, reported at each alarm and drawn", metavar="COLUMN")
    kinematics: int = _kinematics()
    seed: int = _seed()
    progress: Callable[[int, int], None] | None = _progress("called with runs done and runs")
