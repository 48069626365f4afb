"""The tables of docs/reference/rig.md: every key of a rig, from rig.json."""

from __future__ import annotations

import json
from typing import NamedTuple

from facts import Row, plain_number, range_of
from rig_schema import rig_rows

SECTIONS = {  # title: where its keys begin; a key belongs to the longest of these
    "The file": "",
    "Physics: links, tendons, motors": "physics.",
    "Physics: friction": "physics.friction.",
    "Physics: wrist": "physics.wrist.",
    "Physics: obstacle": "physics.obstacle.",
    "Sensors": "sensors.",
    "Motion": "motion.",
    "Pushes: a recipe": "pushes.",
    "Pushes: a list": "pushes[k].",
    "Integration": "integration.",
    "Recording": "recording.",
}


class RigKey(NamedTuple):
    """A row of a table; `[k]` in its path is any element of a list."""

    path: str
    default: str
    allowed: str
    meaning: str


def rig_sections() -> dict[str, list[RigKey]]:
    """Title -> rows, in the order of rig.json."""
    sections: dict[str, list[RigKey]] = {title: [] for title in SECTIONS}
    for row in rig_rows():
        path = row["path"].removesuffix("[k]")
        title = max((title for title in SECTIONS if path.startswith(SECTIONS[title])), key=lambda t: len(SECTIONS[t]))
        sections[title].append(RigKey(path, _default(row), _allowed(row), row["text"].replace("|", "\\|")))
    return sections


def _default(row: Row) -> str:
    if "default" not in row or "required" in row:
        return "required" if "required" in row else ""
    value = row["default"]
    return plain_number(value) if isinstance(value, float | int) else _word(value)


def _word(value: object) -> str:
    return f"`{json.dumps(value)}`"


def _allowed(row: Row) -> str:
    """What a value may be: `above 0 to 1e6`, `3 of ±10`, `"a"` or `"b"`."""
    kinds = {"list": "list of objects", "pushes": "list of objects; or object"}
    one = ", ".join(map(_word, row["words"])) if "words" in row else ""
    if "most" in row:
        one = ("whole, " if "whole" in row else "") + range_of(row)
    if row.get("kind") == "one or several" or "each" in row:
        return f"{one}; or list of {one}"
    if row.get("kind") == "some" or ("most" in row and "length" in row):
        return f"{row['length'] if isinstance(row.get('length'), int) else 'list'} of {one}"
    return one or kinds.get(row["kind"], str(row["kind"]))
