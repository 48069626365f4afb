"""docs/reference/semantics.md: its anchors are there where they are cited, its tables are those of the schema."""

from __future__ import annotations

import functools
import json
import re
import subprocess
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from optional_parts import require
from repository_paths import ROOT

PAGE = "docs/reference/semantics.md"
TEXT = (ROOT / PAGE).read_text(encoding="utf-8")
SCHEMAS = ROOT / "python" / "tendonfmu" / "schema"
SCHEMA = json.loads((SCHEMAS / "finger.schema.json").read_text(encoding="utf-8"))
EFFECTS = {row["$ref"].rsplit("/", 1)[1] for row in SCHEMA["properties"]["extensions"]["items"]["oneOf"]}
CITATION = re.compile(r"semantics\.md((?:#[\w-]+(?:(?:,| and) )?)*)")
LARGEST_TEXT = 500_000  # bytes; what is larger are recordings


def outside_code(text: str) -> str:
    return re.sub(r"```.*?```", "", text, flags=re.DOTALL)


def anchors() -> Counter[str]:
    """Of the headings, as GitHub and mkdocs make them: lower case, hyphens for spaces."""
    headings = re.findall(r"^#+ (.*)$", outside_code(TEXT), flags=re.MULTILINE)
    return Counter(re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings)


@functools.cache
def tracked() -> list[tuple[str, str]]:
    """(name, text) of every text of the repository but this one, which names what is not to be named."""
    require("git")
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=False)
    found = []
    for name in filter(None, listed.stdout.split("\0")):
        path = ROOT / name
        if path.is_file() and path.name != Path(__file__).name and path.stat().st_size < LARGEST_TEXT:
            data = path.read_bytes()
            if b"\0" not in data:
                found.append((name, data.decode("utf-8")))
    return found


def test_every_cited_anchor_is_there() -> None:
    known = anchors().keys()
    cited = [(name, anchor) for name, text in tracked() for tail in CITATION.findall(text)
             for anchor in re.findall(r"#([\w-]+)", tail)]  # fmt: skip
    cited += [(PAGE, anchor) for anchor in re.findall(r"\]\(#([\w-]+)\)", TEXT)]
    assert [f"{name}: #{anchor}" for name, anchor in cited if anchor not in known] == []
    assert len(cited) > 100


# --- its tables -------------------------------------------------------------------------------------------------------


def rows(start: str, end: str) -> list[list[str]]:
    """Cells of every table row that begins with `code`, between two headings."""
    part = outside_code(TEXT).split(f"\n{start}\n", 1)[1].split(f"\n{end}\n", 1)[0]
    return [
        [cell.strip() for cell in re.split(r"(?<!\\)\|", row)[1:-1]]
        for row in part.splitlines()
        if row.startswith("| `")
    ]


def keys(start: str, end: str) -> dict[str, str]:
    """Key path -> default, of the tables between two headings."""
    return {key: cells[1] for cells in rows(start, end) for key in re.findall(r"`([^`]+)`", cells[0])}


FINGER = keys("### Keys of the finger", "### Keys of a joint") | keys(
    "### Keys of the position filter", "### Parameter paths"
)
JOINT = keys("### Keys of a joint", "### Keys of a tendon")
TENDON = keys("### Keys of a tendon", "### Keys of a law")
LAW = keys("### Keys of a law", "### Keys of the position filter")
LINK = keys("### Keys of the links", "### Parameter paths")
OBJECTS = {"cover", "velocity_threshold"}  # named by their keys alone


def leaves(schema: Any, path: str = "") -> Iterator[tuple[str, Any, bool]]:
    """(path, schema, required) of every key of a table, and of the tables in it."""
    for key, inner in schema["properties"].items():
        if key not in OBJECTS:
            yield f"{path}{key}", inner, key in schema.get("required", ())
        if "properties" in inner:
            yield from leaves(inner, f"{path}{key}.")


@pytest.mark.parametrize(
    ("found", "schema", "path"),
    [
        (FINGER, SCHEMA, ""),
        (JOINT, SCHEMA["$defs"]["joint"], ""),
        (TENDON, SCHEMA["$defs"]["tendon"], ""),
        (LAW, SCHEMA["$defs"]["side"], ""),
        (LINK, SCHEMA["$defs"]["link"], "links[j]."),
    ],
    ids=["finger", "joint", "tendon", "law", "link"],
)
def test_every_key_of_the_schema_is_in_a_table_with_its_default(found: dict[str, str], schema: Any, path: str) -> None:
    for key, inner, required in leaves(schema, path):
        default = inner.get("default")
        assert found[key].startswith("required") or not required, key
        if isinstance(default, float):
            assert float(found[key]) == default, key
        elif default is not None:
            assert found[key] == f"`{json.dumps(default)}`", key


def test_the_table_of_extensions_is_that_of_the_schema() -> None:
    found = {row[0].strip("`"): row for row in rows("## Extensions", "### Signals of extensions")}
    assert found.keys() == EFFECTS
    for effect, row in found.items():
        properties = SCHEMA["$defs"][effect]["properties"]
        numbers = [key for key in properties if key not in ("effect", "joint", "tendon")]
        assert re.findall(r"`(\w+)`", row[3]) == numbers, effect
        defaults = [properties[key].get("default") for key in numbers]
        cells = row[4].split(", ") if row[4] else ["–"] * len(numbers)
        said = [None if cell == "–" else float(cell) for cell in cells]
        assert said == defaults, effect


def test_every_effect_that_a_diagnosis_may_name_is_in_the_list() -> None:
    report = json.loads((SCHEMAS / "diagnosis.schema.json").read_text(encoding="utf-8"))
    listed = [name for row in rows("### Names of effects", "### Change against a reference")
              for name in re.findall(r"`(\w+)`", row[0])]  # fmt: skip
    assert sorted(listed) == sorted(report["$defs"]["effect"]["enum"])


def test_every_output_of_the_fmu_is_in_the_table() -> None:
    variables = json.loads((ROOT / "modelDescription" / "variables.json").read_text(encoding="utf-8"))
    outputs = {group["name"] for group in variables["groups"] if group["causality"] == "output"}
    named = {name for row in rows("## Outputs", "## Contact at rest") for name in re.findall(r"`([a-z_]+)", row[0])}
    assert outputs <= named
