"""The published JSON Schema of rigs: it says to editors what the reader and the plant take."""

from __future__ import annotations

import copy
import json
import re
from collections.abc import Iterator
from importlib.resources import files
from pathlib import Path
from typing import Any

import jsonschema
import pytest

from plant_rigs import needs_plant
from random_rigs import random_rig
from repetitions import repeated
from rig_cases import INDEX_RIGS, RIGS, accepted, place_of, with_everything

SCHEMA = json.loads((files("tendonfmu") / "schema" / "rig.schema.json").read_text(encoding="utf-8"))
VALIDATOR = jsonschema.Draft202012Validator(SCHEMA)


def errors(rig: Any) -> list[str]:
    return [error.message for error in VALIDATOR.iter_errors(rig)]


def test_the_schema_is_valid_and_says_what_every_key_is() -> None:
    jsonschema.Draft202012Validator.check_schema(SCHEMA)

    def properties(schema: Any) -> Iterator[tuple[str, Any]]:
        if isinstance(schema, dict):
            if "additionalProperties" in schema:
                yield from schema["properties"].items()
            for value in schema.values():
                yield from properties(value)
        elif isinstance(schema, list):
            for value in schema:
                yield from properties(value)

    found = list(properties(SCHEMA))
    assert len(found) > 90
    for key, schema in found:
        assert schema.get("description") or "const" in schema, key


@pytest.mark.parametrize("name", INDEX_RIGS)
def test_the_schema_takes_the_index_rigs(name: str) -> None:
    assert errors(json.loads((RIGS / name).read_text(encoding="utf-8"))) == []


def test_the_schema_takes_random_rigs() -> None:
    for rig in (with_everything(), *map(random_rig, range(20))):
        assert errors(rig) == []


def test_the_schema_asks_a_rig_without_a_base_for_everything() -> None:
    partial = {"format": "tendonfmu-rig-1", "physics": {"wrist": {"amplitude": 0.2}}, "recording": {"columns": []}}
    VALIDATOR.validate(partial | {"base": "other.json"})
    assert not VALIDATOR.is_valid(partial)
    assert not VALIDATOR.is_valid(partial | {"base": "other.json", "motion": {"speeds": [1, 2]}})


CHANGES: list[Any] = ["DELETE", "ADD", None, True, "text", [], {}, -1, 0, 3, 1e13, [0.0, 1.0]]

# What reader and plant refuse and a schema cannot express: relations between values in different places.
BEYOND_THE_SCHEMA = {
    "lengths of lists and the finger's size": r"expected a list of \d+( numbers|, one (link|angle) per joint.*)$",
    "lengths that plain numbers may have, too": r"has \d+ elements?: expected a list of \d+ numbers?",
    "indices and the finger's size": r"\.(link|joint|tendon) = \d+: expected a whole number from [12] to",
    "an edge that the finger has not": r"expected a joint where the finger's tendon has an edge",
    "an order of two numbers": r"the second not below the first",
    "an order of two keys": r"expected an angle (above limits\.lower|not (below|above) motion)",
    "angles and the joint's limits": r"expected an angle within the joint's range",
    "a direction of no length": r"expected a direction \[x, y, z\] that is not zero",
    "moments of inertia of no body": r"expected three moments of inertia",
    "a law that sticks and does not slide": r"coulomb = .*: expected a positive number where `static` is one",
    "arms that leave no null vector": r"expected arms with a positive null vector",
    "time that pushes need": r"the next one would end at",
    "number of samples": r"expected at most \d+ samples",
}


def varied(data: dict[str, Any], path: tuple[Any, ...], change: Any) -> dict[str, Any]:
    result = copy.deepcopy(data)
    place = place_of(result, path[:-1])
    if change == "DELETE":
        del place[path[-1]]
    elif change == "ADD":
        inner = place[path[-1]]
        if isinstance(inner, dict):
            inner["unknown"] = 1.0
        elif isinstance(inner, list) and inner:
            inner.append(copy.deepcopy(inner[-1]))
    else:
        place[path[-1]] = change
    return result


def places(value: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, inner in items:
        if (*path, key) != ("finger",):
            yield (*path, key)
            yield from places(inner, (*path, key))


RECIPE = {
    "count": 2,
    "seed": 1,
    "first": 1.0,
    "force": [0.5, 1.0],
    "hold": [0.1, 0.2],
    "rise": [0.1, 0.2],
    "gap": [0.1, 1.0],
    "where": "anywhere",
    "direction": ["side"],
}


def assert_agreement(folder: Path, rig: dict[str, Any], what: str) -> None:
    refused, errors = accepted(folder, rig), [error.message for error in VALIDATOR.iter_errors(rig)]
    if refused is None:
        assert errors == [], what
    elif not errors:
        assert any(re.search(line, refused) for line in BEYOND_THE_SCHEMA.values()), f"{what}: {refused}"


@pytest.mark.long
@needs_plant
@pytest.mark.parametrize("every", repeated([5, 1], 0))
def test_schema_and_readers_agree_on_changed_values(tmp_path: Path, every: int) -> None:
    """Both accept the same, but for relations between values that a schema cannot express."""
    data = with_everything()
    agreed = 0
    for pushes in (data["pushes"], RECIPE):
        rig = data | {"pushes": pushes}
        assert accepted(tmp_path, rig) is None
        for path in places(rig):
            one_of_many = isinstance(path[-1], int) and path[-1] > 0  # the other elements of a list
            if path[0] == "finger" or one_of_many or (pushes is RECIPE and path[0] != "pushes"):
                continue
            for change in CHANGES:
                agreed += 1
                if agreed % every == 0:
                    assert_agreement(tmp_path, varied(rig, path, change), f"{path} = {change!r}")
    assert agreed > 1500
