"""The JSON Schema of reports and other files, from the classes that the package has of them.

Their modules are read, not imported: they hold TypedDicts and types made of those of `tendonfmu.json_types`.
"""

from __future__ import annotations

import ast
import collections.abc
import types
import typing
from collections.abc import Iterator
from typing import Annotated, Any, Literal

from facts import ROOT
from finger_schema import Schema, object_of

PACKAGE = ROOT / "python" / "tendonfmu"
KINDS = {str: "string", int: "integer", float: "number", bool: "boolean", type(None): "null"}


class NotRequired:
    """`NotRequired[X]`, which Python 3.10 lacks."""

    def __class_getitem__(cls, inner: Any) -> Any:
        return Annotated[inner, NotRequired]


class Types:
    """The classes and types of modules, each of which may use those before it."""

    def __init__(self, *files: str) -> None:
        self._names: dict[str, Any] = {"NotRequired": NotRequired}
        self._classes: dict[str, tuple[ast.ClassDef, list[str]]] = {}  # by name, with the lines of its file
        for path in (PACKAGE / file for file in ("json_types.py", *files)):
            text = path.read_text(encoding="utf-8")
            tree = ast.parse(text)
            tree.body = [node for node in tree.body if not isinstance(node, ast.If) and not _is_own(node)]
            exec(compile(tree, str(path), "exec"), self._names)
            lines = text.splitlines()
            self._classes |= {node.name: (node, lines) for node in tree.body if isinstance(node, ast.ClassDef)}

    def schema(self, root: str, head: Schema) -> Schema:
        """The schema of a class or type; `head` comes before its keys."""
        defs: dict[str, Schema] = {}
        found = self._of(self._names[root], defs)
        found = {key: value for key, value in found.items() if key != "$ref"} | defs.pop(found["$ref"])
        return _with_single_ones_inside({**head, **found, "$defs": defs})

    def _of(self, of: Any, defs: dict[str, Schema]) -> Schema:
        origin, parts = typing.get_origin(of), typing.get_args(of)
        if of is Any:
            return {}
        if of in KINDS:
            return {"type": KINDS[of]}
        if origin is Annotated:
            found = self._of(parts[0], defs)
            for part in parts[1:]:
                found |= {} if part is NotRequired else self._plain(part, defs)
            return found
        if origin is Literal:
            return {"const": parts[0]} if len(parts) == 1 else {"enum": list(parts)}
        if origin is list:
            return {"type": "array", "items": self._of(parts[0], defs)}
        if origin in (dict, collections.abc.Mapping):
            inner = self._of(parts[1], defs)
            return {"type": "object"} | ({"additionalProperties": inner} if inner else {})
        if origin in (types.UnionType, typing.Union):
            return _one_of([self._of(part, defs) for part in parts])
        if of.__name__ not in defs:
            defs[of.__name__] = {}  # it may hold itself
            defs[of.__name__] = self._object(of.__name__, defs)
        return {"$ref": of.__name__}

    def _plain(self, value: Any, defs: dict[str, Schema]) -> Any:
        """What a `Schema` says, with the types in it as schemas."""
        if isinstance(value, dict):
            return {key: self._plain(each, defs) for key, each in value.items()}
        if isinstance(value, list | tuple):
            return type(value)(self._plain(each, defs) for each in value)
        return value if value is None or isinstance(value, str | float | int) else self._of(value, defs)

    def _object(self, name: str, defs: dict[str, Schema]) -> Schema:
        properties: dict[str, Schema] = {}
        optional = set()
        for key, of, said in self._keys(name):
            if NotRequired in getattr(of, "__metadata__", ()):
                optional.add(key)
            properties[key] = ({"description": said} if said else {}) | self._of(of, defs)
        doc = " ".join((ast.get_docstring(self._classes[name][0]) or "").split())
        required = [key for key in properties if key not in optional]
        return object_of(properties, required, doc)

    def _keys(self, name: str) -> Iterator[tuple[str, Any, str]]:
        """(key, type, comment), those of the bases first."""
        node, lines = self._classes[name]
        optional = any(keyword.arg == "total" for keyword in node.keywords)
        for base in node.bases:
            if isinstance(base, ast.Name) and base.id != "TypedDict":
                yield from self._keys(base.id)
        for part in node.body:
            if isinstance(part, ast.AnnAssign) and isinstance(part.target, ast.Name):
                of = eval(compile(ast.Expression(part.annotation), name, "eval"), self._names)
                yield part.target.id, NotRequired[of] if optional else of, _comment(lines, part)


def _is_own(node: ast.stmt) -> bool:
    """Whether it imports from the package: what is read before has it."""
    return isinstance(node, ast.ImportFrom) and (node.module or "").startswith("tendonfmu.")


def _comment(lines: list[str], part: ast.AnnAssign) -> str:
    """The comment behind a key, and before it that of the lines above."""
    first, last, end = part.lineno - 1, part.end_lineno or 0, part.end_col_offset or 0
    above = first
    while lines[above - 1].lstrip().startswith("#"):
        above -= 1
    said = [*lines[above:first], lines[last - 1].encode()[end:].decode()]
    return " ".join(line.strip().lstrip("#").strip() for line in said).strip()


def _one_of(schemas: list[Schema]) -> Schema:
    """One of several; `null` joins the only other one."""
    others = [each for each in schemas if each != {"type": "null"}]
    if len(others) == len(schemas) or len(others) > 1:
        return {"anyOf": schemas}
    (other,) = others
    if not isinstance(other.get("type"), str):
        return {"anyOf": schemas}
    return other | {"type": [other["type"], "null"]} | ({"enum": [*other["enum"], None]} if "enum" in other else {})


def _with_single_ones_inside(schema: Schema) -> Schema:
    """Put definitions that are referred to once into their place, and write the others as JSON Schema does."""
    names = [node["$ref"] for node in _nodes(schema) if "$ref" in node]
    defs = schema["$defs"]

    def settled(node: Any) -> Any:
        if isinstance(node, list):
            return [settled(each) for each in node]
        if not isinstance(node, dict):
            return node
        if names.count(node.get("$ref")) == 1:
            twice = (defs[node["$ref"]].keys() & node.keys()) - {"description"}
            assert not twice, f"{node['$ref']} has {twice} of its own"
            node = defs[node["$ref"]] | node
            node = {key: node[key] for key in sorted(node, key="description".__ne__) if key != "$ref"}
        elif "$ref" in node:
            node = node | {"$ref": f"#/$defs/{node['$ref']}"}
        return {key: settled(value) for key, value in node.items()}

    kept = {name: settled(inner) for name, inner in defs.items() if names.count(name) > 1}
    whole: Schema = settled({key: value for key, value in schema.items() if key != "$defs"})
    return whole | ({"$defs": kept} if kept else {})


def _nodes(value: Any) -> Iterator[Schema]:
    if isinstance(value, dict):
        yield value
    for inner in value.values() if isinstance(value, dict) else value if isinstance(value, list) else ():
        yield from _nodes(inner)
