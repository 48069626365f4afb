"""A number of a finger description by its path, with the default of the table of keys where it is left out."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from tendonfmu.model.description_defaults import DEFAULTS


def number_of(data: Mapping[str, Any], path: str) -> float:
    """Return a number of a finger description, or its default where it is left out."""
    node: Any = data
    for key in path.split("."):
        node = (node or {}).get(key)
    return DEFAULTS[path] if node is None else float(node)
