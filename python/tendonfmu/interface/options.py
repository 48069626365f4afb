"""Which values the options of the functions take: type and range, as on the command line.

`with_checked_options` refuses any other value before a function begins. An option means the same in every function.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import wraps
from numbers import Integral, Real
from reprlib import Repr
from typing import Any, ParamSpec, TypeVar

import numpy as np

from tendonfmu.errors import InputError

Given = ParamSpec("Given")
Found = TypeVar("Found")

_SHORT = Repr()
_SHORT.maxstring = _SHORT.maxother = 60


@dataclass(frozen=True)
class Number:
    """A number from `least` to `most`; both are allowed."""

    least: float
    most: float = math.inf
    whole: bool = False
    optional: bool = False

    def __str__(self) -> str:
        kind = "a whole number" if self.whole else "a number"
        reach = f"{self.least:.16g} to {self.most:.16g}" if self.most < math.inf else f"{self.least:.16g} or more"
        return f"{kind}, {reach}" + (", or None" if self.optional else "")

    def read(self, value: Any) -> float | int | None:
        """Return the value as a plain number. Raises ValueError if it is none of these."""
        if value is None and self.optional:
            return None
        if isinstance(value, bool | np.bool_) or not isinstance(value, Real):
            raise ValueError
        if self.whole and not isinstance(value, Integral):
            raise ValueError
        number = int(value) if isinstance(value, Integral) and self.whole else float(value)
        if not self.least <= number <= self.most:
            raise ValueError
        return number


@dataclass(frozen=True)
class Kind:
    """A value of one of `types`."""

    words: str
    types: tuple[type, ...]
    optional: bool = False

    def __str__(self) -> str:
        return self.words + (" or None" if self.optional else "")

    def read(self, value: Any) -> Any:
        """Return the value. Raises ValueError if it has another type."""
        if not (isinstance(value, self.types) or (value is None and self.optional)):
            raise ValueError
        return bool(value) if isinstance(value, np.bool_) else value


class Texts:
    """One text or several."""

    def __str__(self) -> str:
        return "a text or a list of texts"

    def read(self, value: Any) -> list[str]:
        """Return a list. Raises ValueError if there is anything else in it."""
        if isinstance(value, str):
            return [value]
        found = list(value) if isinstance(value, Iterable) else [value]
        if not all(isinstance(each, str) for each in found):
            raise ValueError
        return found


class Paths:
    """One path or several."""

    def __str__(self) -> str:
        return "a path or a list of paths"

    def read(self, value: Any) -> list[str | os.PathLike[str]]:
        """Return a list. Raises ValueError if there is anything else in it."""
        alone = isinstance(value, str | os.PathLike) or not isinstance(value, Iterable)
        found = [value] if alone else list(value)
        if not all(isinstance(each, str | os.PathLike) for each in found):
            raise ValueError
        return found


class Function:
    """A function that is called with what is done, or None."""

    def __str__(self) -> str:
        return "a function or None"

    def read(self, value: Any) -> Any:
        """Return the value. Raises ValueError if it cannot be called."""
        if not (value is None or callable(value)):
            raise ValueError
        return value


_TEXT, _COLUMN = Kind("a text", (str,)), Kind("the name of a column", (str,), optional=True)
_PATH = Kind("a path", (str, os.PathLike), optional=True)
_CHOICE, _YES = Kind("True, False", (bool, np.bool_), optional=True), Kind("True or False", (bool, np.bool_))

# python_tests/interface/test_options.py holds types and ranges to those of the commands
OPTIONS: dict[str, Number | Kind | Texts | Paths | Function] = {
    "asymmetric": _CHOICE,
    "bias_time": Number(1e-3, 1e4, optional=True),
    "binaries": _PATH,
    "change": Number(1e-6, 10.0),
    "confidence": Number(0.5, 0.9999),
    "drift": Number(0.0, 1.0),
    "effective_samples": _CHOICE,
    "false_alarms_per_hour": Number(1e-3, 3600.0),
    "fix": Texts(),
    "fmi": Number(2, 3, whole=True),
    "force": _COLUMN,
    "holdout": Number(0.0, 0.9),
    "holdout_block": Number(1.0),
    "jobs": Number(1, 1024, whole=True),
    "kinematics": Number(1, 3, whole=True),
    "labels": _COLUMN,
    "least_gain": Number(0.0, 0.5),
    "method": _TEXT,
    "only": Texts(),
    "passes": Number(1, whole=True, optional=True),
    "previous": _PATH,
    "prior": Number(1e-6, 1e6),
    "progress": Function(),
    "release_time": Number(0.0),
    "resume": _PATH,
    "scale": Texts(),
    "seed": Number(0, 2**53, whole=True),
    "share": Texts(),
    "ssv": Paths(),
    "strict": _YES,
    "tolerance": Number(1e-9, 0.5),
    "uncertainty": _YES,
}


def read_option(name: str, value: Any) -> Any:
    """Return the value of an option as a plain one."""
    option = OPTIONS.get(name)
    if option is None:
        return value
    try:
        return option.read(value)
    except ValueError:
        raise InputError(f"{name}: {_SHORT.repr(value)}; expected {option}") from None


def with_checked_options(function: Callable[Given, Found]) -> Callable[Given, Found]:
    """Check the options of a function, which are given by name, before it begins."""

    @wraps(function)
    def checked(*sources: Given.args, **options: Given.kwargs) -> Found:
        for name, value in options.items():
            options[name] = read_option(name, value)
        return function(*sources, **options)

    return checked
