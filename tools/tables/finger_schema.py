"""The JSON Schema of the finger description, from the tables and from the rules between keys that they cannot hold."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from facts import Facts, Row, is_list, last, of, plain, symbol

Schema = dict[str, Any]

DIALECT = "https://json-schema.org/draft/2020-12/schema"
NAME: Schema = {"type": "string", "minLength": 1, "maxLength": 200, "pattern": "^[^\\u0000-\\u001f\\u007f]*$"}
NULL: Schema = {"type": "null"}
NO_RULES: Mapping[str, Any] = {}
LAW = "F(v) = sgn(v)·(coulomb + (static − coulomb)·exp(−|v|/stribeck_velocity) + viscous·|v|), static >= coulomb"

# What must hold between keys; the reader in runtime/description/description_reader.cpp has the same in C++.
_NEEDS_BANDS = {
    "if": {"properties": {"method": {"const": "bands"}}, "required": ["method"]},
    "then": {"required": ["bands"], "properties": {"bands": {"type": "array"}}},
    "else": {"properties": {"bands": NULL, "watches_motors": NULL}},
}
RULES: Mapping[str, Schema] = {
    "": {
        "if": {"required": ["links"], "properties": {"links": {"type": "array"}}},
        "then": {"required": ["tip"], "properties": {"tip": {"type": "array"}}},
        "else": {"properties": {"tip": NULL}},
    },
    "contact": _NEEDS_BANDS,
}
PLACES: Mapping[str, Schema] = {
    "exactly one": {"oneOf": [{"$ref": "#/$defs/at_joint"}, {"$ref": "#/$defs/at_tendon"}]},
    "at most one": {"not": {"$ref": "#/$defs/at_both"}},
    "level alone": {
        "if": {"required": ["level"], "properties": {"level": {"type": "integer"}}},
        "then": {"properties": {"joint": NULL, "tendon": NULL}},
    },
}


def finger_schema(facts: Facts) -> Schema:
    effects = facts.effects["effects"]
    schema = {
        "$schema": DIALECT,
        "$id": "urn:tendonfmu:finger-1",
        "title": "Finger description of TendonFMU",
        **_object(facts, facts.rows[0]),
        "$defs": {
            "name": NAME,
            "optional_name": {"anyOf": [{"$ref": "#/$defs/name"}, NULL]},
            **{
                row["path"][:-1]: _object(facts, {"path": row["path"], "required": True})
                for row in facts.rows
                if row.get("kind") == "list"
            },
            **_laws(facts),
            "at_joint": {"required": ["joint"], "properties": {"joint": {"type": "integer"}, "tendon": NULL}},
            "at_tendon": {"required": ["tendon"], "properties": {"joint": NULL, "tendon": {"type": "integer"}}},
            "at_both": {
                "required": ["joint", "tendon"],
                "properties": {"joint": {"type": "integer"}, "tendon": {"type": "integer"}},
            },
            **{effect["name"]: _effect(facts, effect) for effect in effects},
        },
    }
    return schema


def documented(row: Row) -> str:
    """Text, unit and note of a number in one line."""
    unit = symbol(row.get("spoken_unit", row["unit"]))
    text = of(row["text"]) + ("" if unit == "1" else f", {unit}")
    return text + (f"; {of(row['note'])}" if "note" in row else "")


def number_of(row: Row, nullable: bool) -> Schema:
    lower = {"exclusiveMinimum": row["above"]} if "above" in row else {"minimum": row["least"]}
    kind = "integer" if "whole" in row else "number"
    return {"type": [kind, "null"] if nullable else kind, **lower, "maximum": row["most"]}


def object_of(
    properties: Schema,
    required: Sequence[str] = (),
    text: str = "",
    *,
    nullable: bool = False,
    rules: Mapping[str, Any] = NO_RULES,
) -> Schema:
    """An object that has no other keys."""
    return {
        **({"description": text} if text else {}),
        "type": ["object", "null"] if nullable else "object",
        **rules,
        **({"required": list(required)} if required else {}),
        "additionalProperties": False,
        "properties": properties,
    }


def list_of(length: tuple[int, int], items: Schema, nullable: bool) -> Schema:
    return {
        "type": ["array", "null"] if nullable else "array",
        "minItems": length[0],
        "maxItems": length[1],
        "items": items,
    }


def _of_number(facts: Facts, row: Row) -> Schema:
    optional, limits = "required" not in row, facts.keys["limits"]
    described = {"description": documented(row)}
    if not is_list(row):
        default = {"default": row["default"]} if "default" in row else {}
        return described | number_of(row, optional) | default
    item = number_of(row, "default" in row)
    if row["path"].endswith("[c]"):
        some = {"contains": {"not": {"const": 0}}} if row["item"] == "LINK_AXIS" else {}
        return described | list_of((3, 3), item, optional) | some
    most = limits["points"] if row["item"] == "EDGE_ANGLES" else limits["joints"]
    return described | list_of((1, most), item, optional)


def _of_key(facts: Facts, row: Row) -> Schema:
    """The schema of a key by its kind."""
    kind, limits = row.get("kind"), facts.keys["limits"]
    described = {"description": row["text"]}
    if kind is None:
        return _of_number(facts, row)
    if kind == "object":
        return _object(facts, row)
    if kind == "list":
        name = last(row["path"])
        most = limits.get(name, limits["joints"])
        items = {"$ref": f"#/$defs/{row['path'][:-1]}"}
        return described | list_of((most if name == "bands" else 1, most), items, "required" not in row)
    if kind == "word":
        return {"enum": [*row["words"], None]} | described | {"default": row["words"][0]}
    if kind == "flag":
        return {"type": ["boolean", "null"]} | described | {"default": False}
    if kind == "format":
        return {"const": "tendonfmu-finger-1"}
    if kind == "extensions":
        rows = {"oneOf": [{"$ref": f"#/$defs/{effect['name']}"} for effect in facts.effects["effects"]]}
        return described | {"type": ["array", "null"], "maxItems": limits["extensions"], "items": rows}
    if kind == "estimates":
        error = {"type": "number", "minimum": 0, "maximum": 1e9}
        entry = {"type": "array", "prefixItems": [{"type": "number"}, error], "minItems": 2, "maxItems": 2}
        return described | {"type": ["object", "null"], "additionalProperties": entry}
    if kind in ("laws", "edges"):
        name = "optional_law" if kind == "laws" else "edge"
        items = {"$ref": f"#/$defs/{name}"}
        return described | {"type": ["array", "null"], "maxItems": limits["joints"], "items": items}
    names = {"law": "optional_law", "name": "name" if "required" in row else "optional_name"}
    return {"$ref": f"#/$defs/{names[kind]}"} | described


def _object(facts: Facts, row: Row) -> Schema:
    children = facts.children(plain(row["path"]))
    needed = [last(child["path"]) for child in children if "required" in child]
    properties = {last(child["path"]): _of_key(facts, child) for child in children}
    nullable = "required" not in row and bool(row["path"])
    return object_of(properties, needed, row.get("text", ""), nullable=nullable, rules=RULES.get(row["path"], NO_RULES))


# --- laws and extensions ----------------------------------------------------------------------------------------------


def _laws(facts: Facts) -> Schema:
    limits, numbers = facts.keys["limits"], facts.law_numbers
    keys = [number["key"] for number in numbers]
    sides: list[Schema] = [
        {
            **number_of(number, "default" in number),
            "description": f"{number['text']}: {number['note']}",
            **({"default": number["default"]} if "default" in number else {}),
        }
        for number in numbers
    ]
    side = object_of(dict(zip(keys, sides, strict=True)), [number["key"] for number in numbers if "required" in number])
    angles = facts.of_item("EDGE_ANGLES")[0]
    asymmetric = {name: {"$ref": "#/$defs/side"} for name in ("positive", "negative")}
    return {
        "side": side,
        "symmetric_law": {
            "description": LAW,
            **side,
            "properties": {**side["properties"], "positive": NULL, "negative": NULL},
        },
        "asymmetric_law": object_of(
            asymmetric | dict.fromkeys(keys, NULL), list(asymmetric), "One side for each direction of motion"
        ),
        "law": {"anyOf": [{"$ref": "#/$defs/symmetric_law"}, {"$ref": "#/$defs/asymmetric_law"}]},
        "optional_law": {"anyOf": [NULL, {"$ref": "#/$defs/law"}]},
        "edge": {"anyOf": [{"$ref": "#/$defs/optional_law"}, {"$ref": "#/$defs/working_points"}]},
        "working_points": object_of(
            {
                "angles": _of_number(facts, angles),
                "laws": list_of((1, limits["points"]), {"$ref": "#/$defs/law"}, nullable=False),
                **dict.fromkeys([*keys, *asymmetric], NULL),
            },
            ["angles", "laws"],
            "Laws at angles of the joint before; values are interpolated between them, constant outside",
        ),
    }


def units_of(number: Row) -> str:
    """`m at a tendon, rad at a joint, s everywhere`."""
    where = [f"{symbol(number['unit'])} at a tendon", f"{symbol(number.get('unit_at_joint', ''))} at a joint"]
    if "unit_everywhere" in number:
        where.append(f"{symbol(number['unit_everywhere'])} everywhere")
    return ", ".join(where) if "unit_at_joint" in number else symbol(number["unit"])


def _effect(facts: Facts, effect: Row) -> Schema:
    places = [key for key in ("joint", "tendon", "level") if effect.get(key, "refused") != "refused"]
    needed = [key for key in places if effect[key] == "required"]
    needed += [number["key"] for number in effect["numbers"] if "required" in number]
    place: Schema = {
        key: {
            "type": "integer" if effect[key] == "required" else ["integer", "null"],
            "minimum": 1,
            "maximum": facts.keys["limits"]["tendons" if key == "tendon" else "joints"],
            "description": f"Number of the {key}, from 1",
        }
        for key in places
    }
    numbers: Schema = {
        number["key"]: {
            **number_of(number, "default" in number),
            **({"default": number["default"]} if "default" in number else {}),
            "description": units_of(number) + (f"; {number['note']}" if "note" in number else ""),
        }
        for number in effect["numbers"]
    }
    properties = {"effect": {"const": effect["name"]}, **place, **numbers}
    return object_of(
        properties, ["effect", *needed], effect["text"], rules=PLACES.get(effect.get("rule", ""), NO_RULES)
    )
