"""The text of a finger description: JSON with each law, or list of numbers, on one line."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

_WIDTH = 160  # longest line of JSON that is not broken: a law with all digits fits


def description_text(data: Mapping[str, Any]) -> str:
    """Return a description as JSON with each law, or list of numbers, on one line."""
    return _laid_out(data, "") + "\n"


def _laid_out(value: Any, indent: str) -> str:
    flat = json.dumps(value, ensure_ascii=False)
    inner = list(value.values()) if isinstance(value, dict) else value if isinstance(value, list) else []
    leaf = not any(isinstance(each, dict | list) for each in inner)
    if not inner or (leaf and len(indent) + len(flat) <= _WIDTH):
        return flat
    deeper = indent + "  "
    if isinstance(value, dict):
        parts = [f"{json.dumps(key, ensure_ascii=False)}: {_laid_out(each, deeper)}" for key, each in value.items()]
        return "{\n" + ",\n".join(deeper + part for part in parts) + f"\n{indent}}}"
    parts = [_laid_out(each, deeper) for each in value]
    return "[\n" + ",\n".join(deeper + part for part in parts) + f"\n{indent}]"
