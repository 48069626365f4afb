"""What follows from tables, and from classes of the package, is what tools/tables/generate.py makes of them."""

from __future__ import annotations

import copy
import importlib
import json
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from repository_paths import ROOT
from tendonfmu.model import native
from tendonfmu.model.description_numbers import DEFAULTS, RANGES

TABLES = ROOT / "tools" / "tables"


@pytest.fixture(scope="module")
def generator() -> Iterator[ModuleType]:
    sys.path.insert(0, str(TABLES))
    yield importlib.import_module("generate")
    sys.path.remove(str(TABLES))


def test_the_generated_files_are_those_of_the_tables() -> None:
    command = [sys.executable, str(TABLES / "generate.py"), "--check"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", ""), "run python tools/tables/generate.py"


def test_each_generated_file_says_so_in_its_first_line(generator: ModuleType) -> None:
    files = generator.generated(generator.read_facts())
    assert len(files) > 12
    for path, text in files.items():
        assert f"by `{generator.COMMAND}`: do not edit." in "".join(text.splitlines()[:2]), path


def changed(generator: ModuleType, change: Callable[[Any], object]) -> set[str]:
    """The generated files that differ once the tables are changed."""
    facts = generator.read_facts()
    other = copy.deepcopy(facts)
    change(other)
    return set(generator.differing(generator.generated(other)))


def test_a_default_is_a_fact_of_one_table(generator: ModuleType) -> None:
    row = {"default": 21.0}
    found = changed(generator, lambda facts: facts.of_item("FILTER_CUTOFF")[0].update(row))
    assert found == {
        "docs/reference/description_keys.md",
        "python/tendonfmu/schema/description_numbers.json",
        "python/tendonfmu/schema/finger.schema.json",
        "runtime/description/description_keys.cpp",
    }


def test_an_output_is_a_fact_of_one_table(generator: ModuleType) -> None:
    row = {"name": "warmth", "base": 2900, "type": "Real", "unit": "N", "size": "joints", "causality": "output"}
    row |= {"variability": "discrete", "initial": "calculated", "description": "Of joint {i}"}
    found = changed(generator, lambda facts: facts.outputs["groups"].append(row))
    assert found == {
        "docs/reference/fmu_variables.md",
        "fmu_src/finger_signals.h",
        "modelDescription/variables.json",
        "python/binding/output_table.h",
        "python/tendonfmu/model/output_names.py",
        "runtime/include/tendonfmu_outputs.h",
        "runtime/include/tendonfmu_outputs.hpp",
    }


def test_the_size_of_an_effect_is_a_fact_of_one_table(generator: ModuleType) -> None:
    found = changed(generator, lambda facts: facts.effects["effects"][0]["numbers"][0].update(scale=0.06))
    assert found == {"python/tendonfmu/schema/description_numbers.json", "runtime/core/effects/effect_facts.c"}


MADE = '''from typing import Annotated, Literal, TypedDict
from tendonfmu.json_types import Count, Number, Schema

class Part(TypedDict, total=False):
    n: Count

class Base(TypedDict):
    kind: Literal["a"]

class Whole(Base):
    """The whole."""
    # Two
    # lines.
    one: Annotated[Part, Schema(minProperties=1)]
    two: NotRequired[dict[str, list[Part | None]]]  # Behind.
    x: Number
    y: Annotated[str, Schema(enum=["u"])] | None

Root = Annotated[Whole, Schema({"not": {"properties": {"x": Base}}})]
'''


def test_a_class_is_a_schema(generator: ModuleType, tmp_path: Path) -> None:
    """Bases, comments, what may be missing or null, a type in a schema, and a class that stands in two places."""
    (tmp_path / "made_types.py").write_text(MADE, encoding="utf-8")
    schema = json.loads(generator.typed_text("T", "Root", str(tmp_path / "made_types.py")))
    assert schema["title"] == "T" and schema["description"] == "The whole."
    assert schema["required"] == ["kind", "one", "x", "y"] and schema["additionalProperties"] is False
    part = {"$ref": "#/$defs/Part"}
    parts = {"type": "array", "items": {"anyOf": [part, {"type": "null"}]}}
    assert schema["properties"] == {
        "kind": {"const": "a"},
        "one": {"description": "Two lines.", "minProperties": 1, **part},
        "two": {"description": "Behind.", "type": "object", "additionalProperties": parts},
        "x": {"type": ["number", "null"]},
        "y": {"type": ["string", "null"], "enum": ["u", None]},
    }
    numbers = {"n": {"type": "integer", "minimum": 0}}
    assert schema["$defs"] == {"Part": {"type": "object", "additionalProperties": False, "properties": numbers}}
    assert schema["not"]["properties"]["x"]["properties"] == {"kind": {"const": "a"}}


@pytest.mark.parametrize(
    ("table", "damage", "said"),
    [
        ("keys", lambda t: t["keys"][-1].update(range=3), "expected text, a kind in"),
        ("keys", lambda t: t["keys"].append(dict(t["keys"][-1])), "stands there twice"),
        (
            "keys",
            lambda t: t["image_order"].remove("COVER"),
            "image_order differs from the items of the rows",
        ),
        ("keys", lambda t: t["keys"][0]["keys"].remove("tip"), "expected the same in its `keys`"),
        (
            "effects",
            lambda t: t["effects"][0]["numbers"][0].update(scale=-1.0),
            "and a scale",
        ),
        ("outputs", lambda t: t["units"].pop("Hz"), "no unit 'Hz', which velocity_filter_cutoff has"),
    ],
)
def test_a_table_that_cannot_be_is_refused(
    generator: ModuleType, tmp_path: Path, table: str, damage: Callable[[Any], object], said: str
) -> None:
    for name in ("keys", "effects", "outputs"):
        content = json.loads((ROOT / "runtime" / "description" / f"{name}.json").read_text(encoding="utf-8"))
        if name == table:
            damage(content)
        (tmp_path / f"{name}.json").write_text(json.dumps(content), encoding="utf-8")
    with pytest.raises(ValueError, match=f"^{table}.json: ") as refused:
        generator.read_facts(tmp_path)
    assert said in str(refused.value)


def test_the_compiled_runtime_has_the_numbers_of_the_table() -> None:
    """A finger that leaves out all it may, and one that has all its objects."""
    plain = {
        "format": "tendonfmu-finger-1",
        "name": "plain",
        "joints": [{"cover": {"stiffness": 1.0}}],
        "tendons": [{"stiffness": 5000, "moment_arms": [0.01]}],
        "contact": {"threshold": [0.1]},
    }
    tendon = {"stiffness": 5000, "moment_arms": [0.01]}
    full = plain | {
        "tendons": [tendon | {"zero": 0.0}, tendon],
        "sensor_fault": {},
        "links": [{"axis": [0, 0, 1]}],
        "tip": [0, 0, 0],
        "contact": {
            "threshold": [0.1],
            "method": "bands",
            "bands": [{"noise": [0.1]}] * 4,
            "deviation": [None],
        },
    }
    left_out = set()
    for description in (plain, full):
        for parameter in native.Instance.from_description(description).parameters():
            path = "".join(part.partition("]")[2] if k else part for k, part in enumerate(parameter.path.split("[")))
            assert (parameter.minimum, parameter.maximum) == RANGES[path], path
            if path in DEFAULTS:
                assert parameter.start == DEFAULTS[path], path
                left_out.add(path)
    assert left_out == set(DEFAULTS)
