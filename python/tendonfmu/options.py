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
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from enum import IntEnum
from numbers import Integral, Real
from pathlib import Path
from reprlib import Repr
from typing import TYPE_CHECKING, Any, Concatenate, ParamSpec, TypeAlias, TypeVar

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


class KinematicsSource(IntEnum):
    """Where the motion of the joints comes from."""

    TENDON_POSITIONS = 1
    MEASURED_JOINT_POSITIONS = 2
    JOINT_POSITIONS_AND_VELOCITIES = 3


# --- an option, and the options of a command --------------------------------------------------------------------------


File = str | os.PathLike[str]
Column = str
# type of an option, as annotated -> the word for a value, its type on the command line, and its types in Python
_TYPES: Mapping[str, tuple[str, Any, Any]] = {
    "int": ("whole number", int, Integral),
    "float": ("number", float, Real),
    "bool": ("True or False", bool, bool),
    "str": ("text", str, str),
    "Column": ("the name of a column", str, str),
    "File": ("path", Path, (str, os.PathLike)),
    "Callable": ("function", None, Callable),
    "RecordingSource": ("recording, DataFrame or file", Path, object),  # who uses recordings checks them
    "RecordingSources": ("recording, DataFrame or file", Path, object),
}


@dataclass(eq=False, repr=False)
class Option:
    """What an option takes, and how the command line shows it."""

    name: str
    annotation: str
    default: Any
    help: str = ""
    metavar: str | None = None
    least: float | None = None  # of a number; both ends are allowed
    most: float = math.inf
    texts: Sequence[str] = ()  # which it takes, if it takes no others
    names: tuple[str, ...] = ()  # on the command line, where that of the field is not enough
    shown: bool = True  # on the command line

    def __post_init__(self) -> None:
        plain = self.annotation.removesuffix(" | None")
        self.optional, self.several = plain != self.annotation, plain.startswith(("Sequence[", "RecordingSources"))
        self.type = plain.removeprefix("Sequence[").partition("[")[0].rstrip("]")
        self.word, self.kind, self._types = _TYPES[self.type]

    @property
    def words(self) -> str:
        """Which values it takes."""
        if self.type == "bool":
            return "True, False or None" if self.optional else "True or False"
        if self.type == "RecordingSources":
            return f"a {self.word}, or a list of them"
        words = " or ".join(self.texts) or f"{'' if self.word.startswith('the ') else 'a '}{self.word}"
        words += f" or a list of {self.word}s" if self.several else ""
        if self.least is not None:
            words += f", {self.least:.16g} " + (f"to {self.most:.16g}" if self.most < math.inf else "or more")
        return words + ("" if not self.optional else " or None" if self.least is None else ", or None")

    def read(self, value: Any) -> Any:
        """Return a plain value. Raises ValueError."""
        if self._types is object or (value is None and self.optional):
            return value
        if not self.several:
            return self._one(value)
        alone = isinstance(value, str | os.PathLike) or not isinstance(value, Iterable)
        return [self._one(each) for each in ([value] if alone else value)]

    def _one(self, value: Any) -> Any:
        if self.type == "bool" and type(value).__name__ in ("bool", "bool_"):  # of numpy, which takes 0.1 s to import
            return bool(value)
        is_number = self.least is not None
        if not isinstance(value, self._types) or (is_number and isinstance(value, bool)):
            raise ValueError
        if (is_number and not self.least <= value <= self.most) or (self.texts and value not in self.texts):
            raise ValueError
        return self.kind(value) if is_number else value

    def sentence(self) -> str:
        """Describe the option for readers of Python: what it is, its values and its default."""
        words, _, usual = self.help.partition(" [default: ")
        return f"{words[:1].upper()}{words[1:]} ({self.words}; default {usual[:-1] or repr(self.default)})."


def option(
    default: Any,
    help: str = "",
    metavar: str | None = None,
    least: float | None = None,
    most: float = math.inf,
    **others: Any,
) -> Any:
    """Make the field of an `Option`. Its type is the annotation; a number has a least value, and a most."""
    given = {"help": help, "metavar": metavar, "least": least, "most": most, **others}
    return field(default=default, metadata=given)


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Options:
    """Base of the options of a command. Raises InputError that names an option whose value is refused."""

    def __post_init__(self) -> None:
        for name, each in self.each().items():
            try:
                object.__setattr__(self, name, each.read(getattr(self, name)))
            except ValueError:
                given = _SHORT.repr(getattr(self, name))
                raise InputError(f"{name}: {given}; expected {each.words}") from None

    def __repr__(self) -> str:
        return f"{type(self).__name__}({', '.join(f'{name}={value!r}' for name, value in vars(self).items())})"

    @classmethod
    def each(cls) -> dict[str, Option]:
        """Return the options by name."""
        return {each.name: Option(each.name, str(each.type), each.default, **each.metadata) for each in fields(cls)}

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
        for each in known.each().values():
            by_name = inspect.Parameter.KEYWORD_ONLY
            ours.append(inspect.Parameter(each.name, by_name, default=each.default, annotation=each.annotation))
            listed += f"    {each.name}\n        {each.sentence()}\n"

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


# --- options of several commands --------------------------------------------------------------------------------------


def _kinematics() -> Any:
    words = (f"{source}: {source.name.lower().replace('_', ' ')}" for source in KinematicsSource)
    return option(1, ", ".join(words), "1|2|3", 1, 3)


def _seed() -> Any:
    return option(0, "seed of the random numbers", "N", 0, 2**53)


def _jobs() -> Any:
    return option(1, "processor cores to use; no effect on the result", "N", 1, 1024)


def _false_alarms() -> Any:
    return option(6.0, "false alarms an hour in other free motion, at most", "RATE", 1e-3, 3600.0)


def _unseen(help: str) -> Any:
    return option(None, help, shown=False)


# --- the commands -----------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class BuildOptions(Options):
    """Options of `build`."""

    reference: RecordingSource | None = option(
        None, "recording; the FMU carries its inputs and outputs for checks", "REC"
    )
    ssv: Sequence[File] = option((), "parameter set that the FMU carries", "SET.ssv")
    binaries: File | None = option(None, "folder of binaries by FMI platform [default: those installed]", "DIR")
    fmi: int = option(2, "version of FMI; 3: forces and torques as arrays", "2|3", 2, 3)
    sample_at: str = option(
        "begin", "end: for masters that hand over the inputs of a step's end", texts=("begin", "end")
    )
    c_array: bool = option(False, "write the finger as a C source for a microcontroller, in place of an FMU")


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class RunOptions(Options):
    """Options of `run`."""

    kinematics: int = _kinematics()
    progress: Callable[[int], None] | None = _unseen("called with the number of samples done")


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class ExciteOptions(Options):
    """Options of `excite`."""

    duration: float = option(400.0, "per pretension, in all with --alternate", "SECONDS", 1.0, 1e5)
    max_speed: float = option(1.0, "limit for every joint", "RAD/S", 1e-3, 100.0)
    range_: Sequence[str] = option((), "joint range in rad, by number or name", "JOINT=LOW:HIGH")
    pretension: Sequence[float] = option((), "mean tendon force [default: 10]", "NEWTON", 1e-3, 1e6)
    alternate: float | None = option(None, "time between changes of the pretension", "SECONDS", 1.0)
    vary_tension: str | None = option(
        None, "in N; vary the tension of each tendon in turn, without a pretension", "LOW:HIGH"
    )
    vary_every: float = option(10.0, "time between changes of the tensions", "SECONDS", 2.0, 1e5)
    max_acceleration: float = option(10.0, "limit for every joint", "RAD/S²", 0.1, 1e4)
    rate: float = option(100.0, "rows per second", "HZ", 20.0, 10000.0)
    seed: int = _seed()


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class FitOptions(Options):
    """Options of `fit`."""

    method: str = option("batch", "maximum likelihood or Kalman filter", texts=("batch", "ekf"))
    holdout: float = option(0.0, "share of the time not used in the fit", "SHARE", 0.0, 0.9)
    holdout_block: float = option(10.0, "longest block left out", "SECONDS", 1.0)
    kinematics: int = _kinematics()
    routing: bool = option(False, "first learn moment arms, stiffness and zeros, by joint_position")
    # patterns of paths: which numbers are estimated, kept, and share one value
    only: Sequence[str] = option((), "estimate only these numbers", "PATTERN")
    fix: Sequence[str] = option((), "keep these numbers fixed", "PATTERN")
    share: Sequence[str] = option((), "laws that share one set of values", "tendons|pulleys|PATTERN")
    asymmetric: bool | None = option(
        None, "fit the two sides of a law apart, or as one", names=("--asymmetric/--symmetric",)
    )
    prior: float | None = option(
        None,
        "by how much the given numbers are off / expected magnitude [default: learned from the data]",
        "RATIO",
        1e-6,
        1e6,
    )
    scale: Sequence[str] = option((), "expected magnitude, instead of the description's", "PATTERN=VALUE")
    previous: File | None = option(
        None, "report or description of an earlier fit, as the prior", "PREVIOUS.json", names=("--from",)
    )
    start: File | None = option(None, "batch: where to begin, as an interrupted fit left it", "UNFINISHED.json")
    effective_samples: bool = option(True, "count correlated residuals as fewer samples")
    passes: int | None = option(None, "most passes over the data [default: 60; ekf: 2]", "N", 1)
    tolerance: float = option(0.3, "batch: last step, in standard errors", "SIZE", 1e-9, 0.5)
    drift: float = option(0.0, "ekf: relative variance of the numbers per s", "RATE", 0.0, 1.0)
    progress: Callable[[Any], bool | None] | None = _unseen("called with each `FitProgress`; returns False to stop")

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.drift and self.method != "ekf":
            raise InputError(
                f"drift = {self.drift!r}: expected 0 with method {self.method}; only method ekf lets parameters drift"
            )
        if self.start is not None and self.method != "batch":
            raise InputError(f"start: expected none with method {self.method}, which begins at the given numbers")


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class FitArguments(FitOptions):
    """What `fit` takes beside finger and recordings."""

    compare: RecordingSources = option((), "recording to judge, not to fit", "RECORDING")


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class CalibrateOptions(Options):
    """Options of `calibrate`."""

    test: RecordingSources = option((), "free motion that only judges the result [default: parts of FREE]", "FREE")
    pushes: RecordingSources = option((), "recordings with labelled contact, to count what is found", "LABELLED")
    previous: File | None = option(
        None,
        "finger.json of an earlier calibration, or report of a fit, as the prior; for little data",
        "PREVIOUS.json",
        names=("--from",),
    )
    folder: File | None = _unseen("folder for the results of the steps: a repeated call goes on there")
    false_alarms_per_hour: float = _false_alarms()
    kinematics: int = _kinematics()
    seed: int = _seed()
    jobs: int = _jobs()
    progress: Callable[[PhaseState], None] | None = _unseen("called with each `PhaseState`")


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class DiagnoseOptions(Options):
    """Options of `diagnose`."""

    test: RecordingSources = option(
        (), "recordings to measure the gain on, not to fit [default: parts of RECORDING]", "RECORDING"
    )
    reference: RecordingSources | None = option(
        None,
        "recordings of the same finger when healthy, to find what has changed since; best the same motion",
        "RECORDING",
    )
    kinematics: int = _kinematics()
    least_gain: float = option(0.03, "least drop of the rms on unseen data for a cause", "SHARE", 0.0, 0.5)
    seed: int = _seed()
    jobs: int = _jobs()
    progress: Callable[[PhaseState], None] | None = _unseen("called with each `PhaseState`")


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class TuneOptions(Options):
    """Options of `tune`."""

    false_alarms_per_hour: float = _false_alarms()
    method: str = option("bands", "contact.method; paper is the rule of the paper", texts=("bands", "paper"))
    bias_time: float | None = option(None, "time constant of the bias [default: unchanged]", "SECONDS", 1e-3, 1e4)
    kinematics: int = _kinematics()
    progress: Callable[[int, int], None] | None = _unseen("called with steps done and steps")


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class ScoreOptions(Options):
    """Options of `score`."""

    labels: Column | None = option(None, "1 in contact, else 0 [default: contact, if present]", "COLUMN")
    force: Column | None = option(None, "sensed force in N, reported at each alarm and drawn", "COLUMN")
    kinematics: int = _kinematics()
    seed: int = _seed()
    progress: Callable[[int, int], None] | None = _unseen("called with runs done and runs")


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class ImportOptions(Options):
    """Options of `import`. NAMES are separated by commas."""

    joints: Sequence[str] = option(
        (), "joints, base first: mcp,pip [default: the one chain that tendons move]", "NAMES"
    )
    tendons: Sequence[str] = option((), "tendons of the finger [default: all driven ones that move it]", "NAMES")
    bidirectional: Sequence[str] = option((), "tendons that are cable loops, which pull either way", "NAMES")
    range_: Sequence[str] = option((), "rad; joint range, in place of the model's limits", "JOINT=LOW:HIGH")
    tip: str | None = option(None, "site, geom or body at the fingertip; writes links and tip", "NAME")
    gravity: bool = option(False, "write the weight of the links as known load")
    stiffness: float | None = option(
        None, "N/m; of tendons whose stiffness the model does not have [default: rigid]", "N/m", 1e-3, 1e12
    )
    arm_tolerance: float = option(0.02, "a moment arm that varies less is constant", "SHARE", 0.0, 1.0)
    threshold: float = option(0.03, "N.m; contact threshold to begin with, of all joints", "N.m", 1e-9, 1e6)
    name: str | None = option(None, "of the finger [default: the model's]", "NAME")
