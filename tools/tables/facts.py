"""The three tables of facts, read and checked: keys and effects of the finger description, outputs of a finger.

docs/reference/places_of_a_change.md says what each field of a row is.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

Row = Mapping[str, Any]

ROOT = Path(__file__).resolve().parent.parent.parent
FOLDER = ROOT / "runtime" / "description"
KINDS = ("object", "list", "law", "laws", "edges", "flag", "word", "name", "format", "extensions", "estimates")
FIELDS = {
    *("path", "kind", "item", "unit", "words", "spoken_unit", "least", "above", "most", "default", "required"),
    *("absent", "fixed", "option", "keys", "holds", "text", "note", "why"),
}


@dataclass(frozen=True)
class Facts:
    """keys, effects, outputs: the three files as they are."""

    keys: Row
    effects: Row
    outputs: Row

    @property
    def rows(self) -> list[Row]:
        return list(self.keys["keys"])

    @property
    def numbers(self) -> list[Row]:
        """The rows that are numbers, or lists of numbers."""
        return [row for row in self.rows if "kind" not in row]

    @property
    def law_numbers(self) -> list[Row]:
        return list(self.keys["law"]["numbers"])

    @property
    def law_places(self) -> list[Row]:
        return list(self.keys["law"]["places"])

    @property
    def groups(self) -> list[Row]:
        """Inputs, outputs and settings of a finger, in the order of the table."""
        return list(self.outputs["groups"])

    def outputs_of_a_finger(self) -> list[Row]:
        return [group for group in self.groups if group["causality"] == "output"]

    def of_item(self, item: str) -> list[Row]:
        return [row for row in self.numbers if row["item"] == item]

    def children(self, path: str) -> list[Row]:
        """The rows of the keys of an object, in the order in which errors name them; path: without brackets."""
        found = [row for row in self.rows if plain(row["path"]) and parent(row["path"]) == path]
        own = next(row for row in self.rows if plain(row["path"]) == path)
        order = own.get("keys")
        return sorted(found, key=lambda row: order.index(last(row["path"]))) if order else found


def plain(path: str) -> str:
    """`contact.rest.threshold` of `contact.rest.threshold[j]`."""
    return re.sub(r"\[[^\]]*\]", "", path)


def parent(path: str) -> str:
    return plain(path).rpartition(".")[0]


def last(path: str) -> str:
    return plain(path).rpartition(".")[2]


def is_list(row: Row) -> bool:
    """Whether a number's own key holds a list."""
    return str(row["path"]).endswith("]")


def symbol(unit: str) -> str:
    """A unit as people write it: `N2.m2/s` is `(N·m)²/s`."""
    text = unit.replace("N2.m2", "(N.m)2").replace(".", "·")
    return re.sub(r"(?<=[A-Za-z)])(\d)", lambda digit: "²³⁴⁵"[int(digit[1]) - 2], text)


def of(text: str) -> str:
    """A text for readers: the placeholders `{j}` as the letters that they are in the path."""
    return re.sub(r"\{(\w)\}", r"\1", text)


def range_of(row: Row) -> str:
    """`0 to 1e9`, `above 0 to 1e12`, `±1000`."""
    least, most = row.get("least", row.get("above")), row["most"]
    if "least" in row and least == -most:
        return f"±{plain_number(most)}"
    return f"{'above ' if 'above' in row else ''}{plain_number(least)} to {plain_number(most)}"


def plain_number(value: float) -> str:
    if value == 2**53:
        return "2^53"
    text = f"{value:g}"
    return text.replace("e+0", "e").replace("e+", "e").replace("e-0", "e-") if "e" in text else text.replace("-", "−")


def read_facts(folder: Path = FOLDER) -> Facts:
    """Raises ValueError naming the file and the row that cannot be."""
    keys, effects, outputs = (
        json.loads((folder / f"{name}.json").read_text(encoding="utf-8")) for name in ("keys", "effects", "outputs")
    )
    facts = Facts(keys, effects, outputs)
    for complaint in _complaints(facts):
        raise ValueError(complaint)
    return facts


def _complaints(facts: Facts) -> Iterator[str]:
    paths = [row["path"] for row in facts.rows]
    for row in facts.rows:
        where = f"keys.json: {row['path'] or 'the document'}"
        if not row.keys() <= FIELDS or "text" not in row or row.get("kind", "object") not in KINDS:
            yield f"{where}: expected text, a kind in {KINDS} or none, and fields in {sorted(FIELDS)}"
        if paths.count(row["path"]) > 1:
            yield f"{where}: stands there twice"
        if row["path"] and parent(row["path"]) not in {plain(path) for path in paths}:
            yield f"{where}: no row for {parent(row['path'])}"
        if "kind" not in row and ("least" in row) + ("above" in row) != 1:
            yield f"{where}: expected one of least and above, beside most, unit and item"
        if "kind" not in row and ("default" in row) + ("required" in row) + ("absent" in row) != 1:
            yield f"{where}: expected one of default, required and absent"
    items = {row["item"] for row in facts.numbers} | {place["item"] for place in facts.law_places}
    if set(facts.keys["image_order"]) != items:
        yield f"keys.json: image_order differs from the items of the rows by {set(facts.keys['image_order']) ^ items}"
    names = [last(row["path"]) for row in facts.rows if row["path"] and not parent(row["path"])]
    if sorted(facts.rows[0]["keys"]) != sorted(names):
        yield f"keys.json: the keys of the document are {names}; expected the same in its `keys`"
    for effect in facts.effects["effects"]:
        for number in effect["numbers"]:
            if ("default" in number) + ("required" in number) != 1 or not number["scale"] >= 0:
                yield f"effects.json: {effect['name']}.{number['key']}: expected default or required, and a scale"
    units = facts.outputs["units"]
    for row in (*facts.numbers, *(group for group in facts.groups if group["type"] == "Real")):
        if row["unit"] not in units:
            yield f"outputs.json: no unit {row['unit']!r}, which {row.get('path', row.get('name'))} has"
