"""Checks XML files of an FMU with FMI's schemas, before they are packed."""

from __future__ import annotations

import importlib.util
from pathlib import Path

from tendonfmu.errors import InternalError


def checked(xml: bytes, schema: str) -> bytes:
    """Return the XML if FMI's schema accepts it."""
    from lxml import etree

    spec = importlib.util.find_spec("fmpy")
    if spec is None or not spec.submodule_search_locations:
        raise InternalError("FMI's schemas not found; expected the Python package fmpy")
    path = Path(spec.submodule_search_locations[0]) / "schema" / schema
    rules = etree.XMLSchema(etree.parse(str(path)))
    if not rules.validate(etree.fromstring(xml)):
        error = rules.error_log[0]
        raise InternalError(f"{path.stem}, line {error.line}: {error.message}")
    return xml
