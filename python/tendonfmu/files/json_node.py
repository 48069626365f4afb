"""How JSON files are read so that every error message can give the path of the value, and what JSON cannot hold.

The messages are like those of the native reader: `motion.speed[1] = -1: expected ...`. Lists count from 1.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import is_dataclass
from pathlib import Path
from typing import Any, NoReturn, TypeVar, cast

from tendonfmu.errors import InputError

T = TypeVar("T")

LARGEST_FILE = 64 << 20  # bytes, as the native reader's


class Refusal(ValueError):
    """Why a JSON text or value is refused, without the file."""


def read_json(path: Path, what: str) -> Any:
    """Read a JSON file."""
    try:
        size = path.stat().st_size
        text = path.read_bytes() if size <= LARGEST_FILE else b""
    except OSError as failed:
        raise InputError(f"{path}: {failed.strerror}; expected {what} (JSON)") from None
    if size > LARGEST_FILE:
        raise InputError(f"{path}: {size} bytes; expected {what} (JSON) of at most {LARGEST_FILE}")
    try:
        return json.loads(
            text.decode("utf-8"),
            object_pairs_hook=_object,
            parse_constant=_refuse_number,
            parse_float=_finite,
            parse_int=_integer,
        )
    except Refusal as refused:
        raise InputError(f"{path}: {refused}") from None
    except UnicodeDecodeError:
        raise InputError(f"{path}: not a text file in UTF-8; expected {what} (JSON)") from None
    except json.JSONDecodeError as failed:
        place = f"line {failed.lineno}, column {failed.colno}"
        raise InputError(f"{path}: {place}: {failed.msg}; expected {what} (JSON)") from None
    except RecursionError:
        raise InputError(f"{path}: nested too deeply; expected {what} (JSON)") from None


def format_of(path: Path) -> str:
    """Return the format that a JSON file claims to have, even an invalid one; "" if there is none."""
    try:
        data = json.loads(path.read_bytes())
    except (OSError, ValueError, RecursionError):
        return ""
    return str(data.get("format", "")) if isinstance(data, dict) else ""


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for key, value in pairs:
        if key in found:
            raise Refusal(f"key {shown(key)} occurs twice in one object; expected once")
        found[key] = value
    return found


def _refuse_number(text: str) -> NoReturn:
    raise Refusal(f"{text}: not a number in JSON; expected a finite number")


def _finite(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise Refusal(f"{text[:60]}: beyond the range of a double; expected a finite number")
    return value


def _integer(text: str) -> int:
    _finite(text)
    return int(text)


def shown(value: Any) -> str:
    """Return a value for a message: JSON on one line, at most 60 characters."""
    text = json.dumps(value, ensure_ascii=True)
    return text if len(text) <= 60 else f"{text[:57]}..."


def finite(value: T) -> T:
    """Replace every number that is not finite by None; an object of a dataclass becomes what JSON has of it."""
    made: Any = value
    if is_dataclass(value):
        made = finite(vars(value))
    elif isinstance(value, float):
        made = value if math.isfinite(value) else None
    elif isinstance(value, Mapping):
        made = {key: finite(inner) for key, inner in value.items()}
    elif isinstance(value, list | tuple):
        made = [finite(inner) for inner in value]
    return cast("T", made)


def report_text(report: Mapping[str, Any]) -> str:
    """Return a report as JSON in which a key, and an entry of a list of objects or of lists, has a line of its own."""
    return "{\n" + ",\n".join(f" {json.dumps(key)}: {_text(value, '  ')}" for key, value in report.items()) + "\n}\n"


def _text(value: Any, indent: str) -> str:
    if _is_table(value):
        rows = f",\n{indent}".join(_text(row, f"{indent} ") for row in value)
        return f"[\n{indent}{rows}]"
    if isinstance(value, Mapping) and any(map(_is_table, value.values())):
        parts = (f"{json.dumps(key)}: {_text(part, f'{indent} ')}" for key, part in value.items())
        return "{" + f",\n{indent}".join(parts) + "}"
    return json.dumps(value, ensure_ascii=False, allow_nan=False)


def _is_table(value: Any) -> bool:
    return isinstance(value, list) and bool(value) and all(isinstance(row, list | Mapping) for row in value)


class Node:
    """A value of a JSON document with its path. null counts as absent."""

    def __init__(self, value: Any, path: str = "") -> None:
        self.value = value
        self.path = path

    @property
    def absent(self) -> bool:
        """Whether the value is missing or null."""
        return self.value is None

    def refuse(self, expectation: str) -> NoReturn:
        """Refuse the value."""
        place = self.path or "the document"
        if self.absent:
            raise Refusal(f"{place}: missing; expected {expectation}")
        raise Refusal(f"{place} = {shown(self.value)}: expected {expectation}")

    def member(self, key: str) -> Node:
        """Return the value of a key."""
        inner = self.value.get(key) if isinstance(self.value, dict) else None
        return Node(inner, f"{self.path}.{key}" if self.path else key)

    def elements(self) -> list[Node]:
        """Return the elements of a list."""
        items = self.value if isinstance(self.value, list) else []
        return [Node(item, f"{self.path}[{k}]") for k, item in enumerate(items, start=1)]

    def keys(self, known: Collection[str]) -> Node:
        """Refuse a value that is no object, and the first unknown key."""
        if not isinstance(self.value, dict):
            self.refuse("an object")
        for key, value in self.value.items():
            if key not in known:
                where = f"{self.path}.{key}" if self.path else key
                raise Refusal(f"{where} = {shown(value)}: unknown key; expected one of {', '.join(known)}")
        return self

    def text(self, expectation: str) -> str:
        """Return a string of at least one character without control characters."""
        if not isinstance(self.value, str) or not self.value or any(ord(letter) < 32 for letter in self.value):
            self.refuse(expectation)
        return self.value

    def choice(self, *choices: str) -> str:
        """Return a string that is one of some choices."""
        if self.value not in choices or not isinstance(self.value, str):
            self.refuse(" or ".join(f'"{choice}"' for choice in choices))
        return self.value

    def _numeric(self, kinds: type | tuple[type, ...]) -> bool:
        return isinstance(self.value, kinds) and not isinstance(self.value, bool)

    def integer(self, least: int, most: int, default: int | None = None) -> int:
        """Return a whole number; 3.0 is one."""
        if self.absent and default is not None:
            return default
        whole = self._numeric((int, float)) and float(self.value) == math.floor(self.value)
        if not whole or not least <= self.value <= most:
            self.refuse(f"an integer from {least} to {most}")
        return int(self.value)

    def number(self, least: float, most: float, unit: str, default: float | None = None, above: bool = False) -> float:
        """Return a number."""
        if self.absent and default is not None:
            return default
        inside = self._numeric((int, float)) and (least < self.value <= most if above else least <= self.value <= most)
        if not inside:
            of = f" in {unit}" if unit else ""
            self.refuse(f"a number{of}, {'above' if above else 'at least'} {least:g} and at most {most:g}")
        return float(self.value)

    def list_of(self, count: int | None, meaning: str, read: Callable[[Node], float]) -> list[float]:
        """Return a list of numbers."""
        wrong = not isinstance(self.value, list) or not self.value
        if wrong or (count is not None and len(self.value) != count):
            self.refuse(f"a list of {count if count is not None else 'numbers'}, {meaning}")
        return [read(element) for element in self.elements()]

    def span(
        self, least: float, most: float, unit: str, default: tuple[float, float] | None = None, above: bool = False
    ) -> tuple[float, float]:
        """Return two numbers [lowest, highest], the second not below the first."""
        if self.absent and default is not None:
            return default
        low, high = self.list_of(
            2, f"[lowest, highest] in {unit}", lambda node: node.number(least, most, unit, above=above)
        )
        if high < low:
            self.refuse(f"[lowest, highest] in {unit}, the second not below the first")
        return low, high
