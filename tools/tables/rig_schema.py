"""The JSON Schema of a rig, and the tables of its page, from the table of its keys, `rig.json`.

A row is a number (`least` or `above`, `most`, `whole`), a list of numbers (`length`; `each`: one number or a list), one
of some `words`, an object, a list of objects (`kind`; `item` is the text of one; `gaps`: some are null), or what
`schema` says. `[k]` is any element of a list. What is required is so without a base; in the element of a list always.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import NamedTuple

from facts import Row, last, plain_number, range_of
from finger_schema import DIALECT, NULL, Schema, list_of, number_of, object_of

TABLE = Path(__file__).with_name("rig.json")


def rig_schema() -> Schema:
    table, rows = _table(), rig_rows()
    schema = _object(rows, "", {"text": table["description"], "required": True})
    motion = schema["properties"]["motion"]
    motion["allOf"] = [_motion(kind, keys) for kind, keys in table["motions"].items()]
    needed = _needed(rows, "")
    needed["properties"]["motion"] |= {
        "if": {"properties": {"kind": {"enum": ["still", "strokes"]}}},
        "then": {"required": ["pretension"], "properties": {"pretension": {"type": "number"}}},
    }
    return {
        "$schema": DIALECT,
        "$id": "urn:tendonfmu:rig-1",
        "title": table["title"],
        **schema,
        "required": ["format"],
        "if": {"not": {"required": ["base"], "properties": {"base": {"type": "string"}}}},
        "then": needed,
    }


def _table() -> Row:
    table: Row = json.loads(TABLE.read_text(encoding="utf-8"))
    return table


def rig_rows() -> list[Row]:
    """The rows in the order of the page: those of `{signal}` once for each signal that they are for."""
    table = _table()
    rows = table["keys"]
    first = next(place for place, row in enumerate(rows) if "{signal}" in row["path"])
    end = next(place for place, row in enumerate(rows) if place > first and "{signal}" not in row["path"])
    of_signals = [
        row | {key: row[key].format(signal=signal, unit=unit) for key in ("path", "text")}
        for signal, unit in table["signals"].items()
        for row in rows[first:end]
        if signal in row.get("signals", table["signals"])
    ]
    return [*rows[:first], *of_signals, *rows[end:]]


def _motion(kind: str, keys: list[str]) -> Schema:
    others = {"required": ["file"], "properties": {"file": {"type": "string"}}} if kind == "file" else {}
    chosen = {"required": ["kind"], "properties": {"kind": {"const": kind}}}
    return {"if": chosen, "then": {"propertyNames": {"enum": keys}, **others}}


def _children(rows: list[Row], path: str) -> list[Row]:
    return [row for row in rows if row["path"] != path and row["path"].rpartition(".")[0] == path]


def _needed(rows: list[Row], path: str) -> Schema:
    """What an object needs if there is no base."""
    children = _children(rows, path)
    inside = {last(row["path"]): _needed(rows, row["path"]) for row in children if "[k]" not in row["path"]}
    inside = {key: needed for key, needed in inside.items() if needed}
    needed = [last(row["path"]) for row in children if "required" in row]
    return {**({"required": needed} if needed else {}), **({"properties": inside} if inside else {})}


def _object(rows: list[Row], path: str, row: Row) -> Schema:
    children = _children(rows, path)
    needed = [last(child["path"]) for child in children if "required" in child]
    properties = {last(child["path"]): _of_key(rows, child) for child in children}
    return object_of(properties, needed * ("[k]" in path), row["text"], nullable="required" not in row)


def _of_key(rows: list[Row], row: Row) -> Schema:
    described: Schema = {"description": row["text"]} | ({"default": row["default"]} if "default" in row else {})
    kind, optional, length = row.get("kind"), "required" not in row, row.get("length", 0)
    if "schema" in row:
        return {**row["schema"], **described}
    if kind == "object":
        return _object(rows, row["path"], row)
    if kind == "list":
        item = _object(rows, row["path"], {"text": row["item"]} | ({} if "gaps" in row else {"required": True}))
        return list_of(length, item, optional) | described
    if kind == "pushes":
        one = _object(rows, f"{row['path']}[k]", {"text": row["item"], "required": True})
        recipe = _object(rows, row["path"], {"text": row["recipe"], "required": True})
        return {"anyOf": [{"type": "array", "items": one}, recipe, NULL]} | described
    if "words" in row:
        words = {"enum": row["words"]}
        if kind == "some":
            return {"type": ["array", "null"], "uniqueItems": True, "items": words} | described
        if kind == "one or several":
            return {"anyOf": [words, {"type": "array", "minItems": 1, "items": words}, NULL]} | described
        return {"enum": [*row["words"], None] if optional else row["words"]} | described
    one = number_of(row, optional and not length and "each" not in row)
    if "each" in row:
        return {"anyOf": [one, list_of((1, row["each"]), one, False), NULL]} | described
    if length:
        return list_of((length, length) if isinstance(length, int) else length, one, optional) | described
    return one | described


# --- the tables of docs/reference/rig.md ------------------------------------------------------------------------------

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
