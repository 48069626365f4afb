"""The tables of docs/reference/rig.md: every key of a rig, from its JSON Schema."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from finger_schema import Schema
from rig_schema import rig_schema

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


@dataclass(frozen=True)
class RigKey:
    """A row of a table; `[k]` in its path is any element of a list."""

    path: str
    default: str
    allowed: str
    meaning: str


def rig_sections() -> dict[str, list[RigKey]]:
    """Title -> rows, in the order of the schema."""
    schema = rig_schema()
    sections: dict[str, list[RigKey]] = {title: [] for title in SECTIONS}
    for key in _keys(schema, "", schema["then"]):
        title = max((name for name in SECTIONS if key.path.startswith(SECTIONS[name])), key=lambda n: len(SECTIONS[n]))
        sections[title].append(key)
    return sections


def _keys(schema: Schema, prefix: str, without_base: Schema) -> Iterator[RigKey]:
    """The keys of an object, and of the objects in it. without_base: what a rig without `base` needs besides."""
    required = {*schema.get("required", ()), *without_base.get("required", ())}
    for key, inner in schema.get("properties", {}).items():
        path = prefix + key
        default = "required" if key in required else _word(inner["default"]) if "default" in inner else ""
        yield RigKey(path, default, _allowed(inner), inner.get("description", "").replace("|", "\\|"))
        below = without_base.get("properties", {}).get(key, {})
        for variant in (inner, *inner.get("anyOf", ())):
            yield from _keys(variant, f"{path}.", below)
            items = variant.get("items", {})
            for item in (items, *items.get("anyOf", ())):
                yield from _keys(item, f"{path}[k].", {})


def _word(value: Any) -> str:
    return _number(value) if isinstance(value, (int, float)) else f"`{json.dumps(value)}`"


def _number(value: float) -> str:
    return "2^53" if value == 2**53 else f"{value:g}".replace("e+", "e").replace("e0", "e").replace("e-0", "e-")


def _allowed(schema: Schema) -> str:
    """What a value may be: `above 0 to 1e6`, `3 of ±10`, `"a"` or `"b"`."""
    variants = [each for each in schema.get("anyOf", ()) if each.get("type") != "null"]
    if variants:
        return "; or ".join(_allowed(each) for each in variants)
    if "const" in schema or "enum" in schema:
        values = schema.get("enum", [schema.get("const")])
        return ", ".join(f"`{json.dumps(value)}`" for value in values if value is not None)
    kinds = {schema["type"]} if isinstance(schema["type"], str) else set(schema["type"]) - {"null"}
    if kinds == {"string", "object"}:
        return "path or object"
    if "array" in kinds:
        fixed = "minItems" in schema and schema["minItems"] == schema.get("maxItems")
        length = schema["minItems"] if fixed else "list"
        items = _allowed(schema["items"])
        return f"{length} of {'objects' if items == 'object' else items}"
    if kinds & {"number", "integer"}:
        return ("whole, " if "integer" in kinds else "") + _range(schema)
    return {"string": "text"}.get(*kinds, *kinds)


def _range(schema: Schema) -> str:
    least, most = schema["minimum" if "minimum" in schema else "exclusiveMinimum"], schema["maximum"]
    if "minimum" in schema and least == -most:
        return f"±{_number(most)}"
    return f"{'above ' if 'exclusiveMinimum' in schema else ''}{_number(least)} to {_number(most)}"
