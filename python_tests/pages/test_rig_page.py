"""docs/reference/rig.md: its example runs, and its tables say what the schema says."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from importlib.resources import files
from pathlib import Path
from typing import Any

import pytest

from plant_rigs import needs_plant
from repository_paths import ROOT
from rig_cases import written
from tendonfmu.simulate.rig import read_rig
from tendonfmu.simulate.simulation import simulate

PAGE = (ROOT / "docs" / "reference" / "rig.md").read_text(encoding="utf-8")
SCHEMA = json.loads((files("tendonfmu") / "schema" / "rig.schema.json").read_text(encoding="utf-8"))
ROW = re.compile(r"^\| `([^`]+)` \| (.*?) \| (.*?) \| (.*) \|$", flags=re.MULTILINE)
ROWS = {match[1]: match.groups()[1:] for match in ROW.finditer(PAGE)}


def properties(schema: Any, prefix: str = "") -> Iterator[tuple[str, Any]]:
    """(key path, schema) of every key that a rig may have; `[k]` for the elements of a list."""
    if not isinstance(schema, dict):
        return
    for key, inner in schema.get("properties", {}).items():
        yield prefix + key, inner
        yield from properties(inner, f"{prefix}{key}.")
    items = schema.get("items")
    if isinstance(items, dict):
        for each in (items, *items.get("anyOf", [])):
            yield from properties(each, f"{prefix[:-1]}[k].")
    for each in schema.get("anyOf", []):
        yield from properties(each, prefix)


KEYS = dict(properties(SCHEMA))


def test_the_page_has_every_key_and_no_other() -> None:
    assert len(KEYS) > 140
    assert set(ROWS) == set(KEYS)


@pytest.mark.parametrize("key", KEYS)
def test_a_row_says_what_the_schema_says(key: str) -> None:
    default, allowed, meaning = ROWS[key]
    schema = KEYS[key]
    if "default" in schema:
        told = json.loads(default.strip("`"))
        assert told == schema["default"]
    else:
        assert default in ("", "required")
    for bound in ("minimum", "maximum", "exclusiveMinimum"):
        if bound in schema and schema[bound] != 2**53:
            assert f"{abs(schema[bound]):g}" in allowed
    assert meaning.replace("\\|", "|") == schema.get("description", "")


@needs_plant
def test_the_example_runs(tmp_path: Path) -> None:
    example = re.search(r"```json\n(.*?)```", PAGE, flags=re.DOTALL)
    assert example
    result = simulate(read_rig(written(tmp_path, example[1])), truth=True)
    assert len(result.recording["time"]) == 20000 and result.contact_seconds > 0.6
    assert result.truth is not None
    for name in result.truth:
        group = name.split("[")[0]
        assert f"`{group}`" in PAGE or f"`{group}[" in PAGE, name
