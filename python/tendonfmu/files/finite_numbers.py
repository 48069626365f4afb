"""How reports are written as JSON: infinity and NaN, which it does not allow, as null; rows of tables on lines."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any


def finite(value: Any) -> Any:
    """Replace every number that is not finite by None."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {key: finite(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [finite(each) for each in value]
    return value


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
