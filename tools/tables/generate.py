"""Writes every file that follows from the tables of facts in runtime/description: keys, effects and outputs.

The page and the schema of a rig follow from rig.json, the schemas of reports from classes of the package.

    python tools/tables/generate.py          writes the files that differ, and names them
    python tools/tables/generate.py --check  writes nothing; exit code 1 where a file differs

The generated files are part of the repository; python_tests/repository/test_generated_files.py compares them.
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from facts import ROOT, Facts, Row, is_list, last, of, parent, plain, range_of, read_facts, symbol
from finger_schema import DIALECT, documented, finger_schema, units_of
from jinja2 import Environment, FileSystemLoader
from rig_schema import rig_schema, rig_sections
from typed_schema import Types

COMMAND = "python tools/tables/generate.py"
NOTICE = f"Generated from the tables in runtime/description by `{COMMAND}`: do not edit."
TEMPLATES = {
    "key_table.h.jinja": "runtime/core/key_table.h",
    "key_table.c.jinja": "runtime/core/key_table.c",
    "effect_facts.h.jinja": "runtime/core/effects/effect_facts.h",
    "effect_facts.c.jinja": "runtime/core/effects/effect_facts.c",
    "description_keys.cpp.jinja": "runtime/description/description_keys.cpp",
    "tendonfmu_outputs.h.jinja": "runtime/include/tendonfmu_outputs.h",
    "tendonfmu_outputs.hpp.jinja": "runtime/include/tendonfmu_outputs.hpp",
    "output_table.h.jinja": "python/binding/output_table.h",
    "finger_signals.h.jinja": "fmu_src/finger_signals.h",
    "output_names.py.jinja": "python/tendonfmu/model/output_names.py",
    "description_keys.md.jinja": "docs/reference/description_keys.md",
    "fmu_variables.md.jinja": "docs/reference/fmu_variables.md",
    "rig.md.jinja": "docs/reference/rig.md",
}
# Name of the schema -> its title, its class, and modules of the package: that of the class is the last.
TYPED = {
    "map": ("TendonFMU map of columns", "Map", "recordings/converters/map_types.py"),
    "hand": ("TendonFMU hand", "HandFile", "commands/hand/description.py"),
    "diagnosis": ("TendonFMU diagnosis", "DiagnosisReport", "report/diagnosis_types.py"),
    "fit_report": ("TendonFMU fit report", "FitReport", "recordings/columns.py", "estimate/fit_report.py"),
    "score_report": ("TendonFMU score report", "ScoreReport", "detect/counting.py", "detect/summary.py"),
    "tune_report": ("TendonFMU tune report", "TuneReport", "detect/tune_report.py"),
}


# --- numbers and rows of C ------------------------------------------------------------------------------------------


def c_number(value: float) -> str:
    """The shortest text that reads back the same, as a double of C."""
    return repr(float(value))


def c_path(path: str) -> str:
    """The path with a % before each index, as key_row explains it."""
    return re.sub(r"(?<=[\[,])(?=\w)", "%", path)


def key_items(facts: Facts) -> list[dict[str, Any]]:
    """The items in the order of the image: {name, what it is, the rows of its numbers}."""
    found = []
    for item in facts.keys["image_order"]:
        place = next((place for place in facts.law_places if place["item"] == item), None)
        rows = _law_rows(facts, place) if place else [_key_row(row, facts) for row in facts.of_item(item)]
        what = place["path"] if place else parent_of_item(facts, item)
        found.append({"name": item, "what": what, "rows": rows})
    return found


def parent_of_item(facts: Facts, item: str) -> str:
    rows = facts.of_item(item)
    return str(rows[0]["path"] if len(rows) == 1 else rows[0]["path"].rpartition(".")[0])


def _law_rows(facts: Facts, place: Row) -> list[dict[str, Any]]:
    path = c_path(place["path"]) + ("%@" if "at_points" in place else "") + "%~."
    return [
        _limits(number, unit) | {"path": path + number["key"], "count": "KEY_ONE", "option": "0"}
        for number, unit in zip(facts.law_numbers, place["units"], strict=True)
    ]


def _key_row(row: Row, facts: Facts) -> dict[str, Any]:
    path = row["path"]
    count = "KEY_ONE"
    if row["path"].endswith("[c]"):
        count = "KEY_THREE"
    elif is_list(row) and row["item"] != "EDGE_ANGLES":
        count = "KEY_PER_JOINT"
    if is_list(row):  # the last index counts the numbers of the item
        path = path[:-2] + "k]"
    return _limits(row, row["unit"]) | {"path": c_path(path), "count": count, "option": option_of(row, facts)}


def _limits(row: Row, unit: str) -> dict[str, Any]:
    return {
        "unit": unit,
        "minimum": c_number(row.get("least", row.get("above", 0.0))),
        "maximum": c_number(row["most"]),
        "above_minimum": int("above" in row),
        "tunable": int("fixed" not in row),
        "has_default": int("default" in row),
        "default": c_number(row.get("default", 0.0)),
    }


def option_of(row: Row, facts: Facts) -> str:
    """The bit that says whether a number is there: its own, or that of the nearest object around it that has one."""
    by_path = {each["path"]: each for each in facts.rows}
    around = row["path"]
    while around:
        option = by_path.get(around, {}).get("option")
        if option:
            return str(option)
        around = parent(around)
    return "0"


# --- the JSON files ---------------------------------------------------------------------------------------------------

WIDTH = 120


def json_text(value: Any, indent: str = "", width: int = WIDTH) -> str:
    """JSON with every list and object on one line that has room for it."""
    line = json.dumps(value, ensure_ascii=False)
    if len(indent) + len(line) < width or not isinstance(value, (dict, list)):
        return line
    inner = indent + "  "
    if isinstance(value, list):
        parts = [json_text(each, inner, width) for each in value]
    else:
        parts = [f"{json.dumps(key)}: {json_text(each, inner, width)}" for key, each in value.items()]
    begin, end = "[]" if isinstance(value, list) else "{}"
    return begin + "\n" + ",\n".join(inner + part for part in parts) + f"\n{indent}{end}"


def schema_text(facts: Facts) -> str:
    return json_text({"$comment": NOTICE} | finger_schema(facts), width=2 * WIDTH) + "\n"


def rig_text(facts: Facts) -> str:
    del facts
    comment = f"Generated from tools/tables/rig.json by `{COMMAND}`: do not edit."
    return json_text({"$comment": comment} | rig_schema(), width=2 * WIDTH) + "\n"


def typed_text(title: str, name: str, *files: str) -> str:
    """The JSON Schema of a class of the package."""
    comment = f"Generated from python/tendonfmu/{files[-1]} by `{COMMAND}`: do not edit."
    begin = {"$comment": comment, "$schema": DIALECT, "title": title}
    return json_text(Types(*files).schema(name, begin), width=2 * WIDTH) + "\n"


def numbers_text(facts: Facts) -> str:
    """What tendonfmu/model/description_numbers.py reads; all numbers in SI units."""

    def least(row: Row) -> float:
        return float(row["least"] if "least" in row else row["above"])

    numbers = {plain(row["path"]): row for row in facts.numbers}
    effects = {
        effect["name"]: {
            number["key"]: {
                "least": least(number),
                "most": float(number["most"]),
                "missing": float(number["default"]) if "default" in number else None,
                "scale": float(number["scale"]),
            }
            for number in effect["numbers"]
        }
        for effect in facts.effects["effects"]
    }
    content = {
        "$comment": NOTICE,
        "defaults": {path: float(row["default"]) for path, row in numbers.items() if "default" in row},
        "ranges": {path: [least(row), float(row["most"])] for path, row in numbers.items()},
        "limits": facts.keys["limits"],
        "effects": effects,
    }
    return json_text(content) + "\n"


def variables_text(facts: Facts) -> str:
    """modelDescription/variables.json: outputs and settings of the FMU, and the texts of its parameters."""
    outputs = dict(facts.outputs) | {"format": "tendonfmu-variables-1"}
    groups = [{key: value for key, value in group.items() if key != "note"} for group in facts.groups]
    parameters = outputs["parameters"] | {"descriptions": parameter_texts(facts)}
    rest = outputs | {"groups": [group for group in groups if group.get("fmu", True)], "parameters": parameters}
    return json_text({"$comment": NOTICE} | rest) + "\n"


def parameter_texts(facts: Facts) -> list[list[str]]:
    """[pattern of the path, text]: a text is that of the first pattern which the whole path matches."""
    found = []
    for place in facts.law_places:
        for points in ("", place["at_points"]) if "at_points" in place else ("",):
            path = f"{place['path']}.laws[k]" if points else place["path"]
            for number in facts.law_numbers:
                text = f"{number['text']}{place['text']}{points}"
                found.append(_pattern(f"{path}.{number['key']}", text))
                found.append(_pattern(f"{path}.(side).{number['key']}", f"{text}, {{side}} direction"))
    found += [_pattern(row["path"], row["text"]) for row in facts.numbers]
    return [*found, [r"extensions\[(\d+)\]\.(.+)", r"Extension \1: \2"]]


def _pattern(path: str, text: str) -> list[str]:
    letters = [letter for part in path.split("[")[1:] for letter in part.split("]")[0].split(",")]
    letters += ["side"] if "(side)" in path else []
    pattern = path.replace(".", r"\.").replace("(side)", "(positive|negative)")
    for letter in letters:
        pattern = pattern.replace(f"[{letter}", r"\[(\d+)").replace(f",{letter}", r",(\d+)")
        text = text.replace(f"{{{letter}}}", f"\\{letters.index(letter) + 1}")
    return [pattern.replace("]", r"\]").replace(r"(\d+)\]", r"(\d+)\]"), text]


# --- all of them ------------------------------------------------------------------------------------------------------


def environment(facts: Facts) -> Environment:
    made = Environment(
        loader=FileSystemLoader(Path(__file__).parent / "templates"),
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=False,
    )
    made.filters |= {"c": c_number, "symbol": symbol, "of": of, "last": last, "plain": plain, "range": range_of}
    made.globals |= {
        "notice": NOTICE,
        "facts": facts,
        "items": key_items(facts),
        "is_list": is_list,
        "documented": documented,
        "units_of": units_of,
        "tables": pages(facts),
        "rig_sections": rig_sections(),
    }
    return made


def pages(facts: Facts) -> list[tuple[Row, list[Row]]]:
    """(object, its keys), in the order of the page; objects within it come after it."""
    found = []

    def visit(row: Row) -> None:
        children = facts.children(plain(row["path"]))
        if children:
            found.append((row, children))
        for child in children:
            visit(child)

    visit(facts.rows[0])
    return found


def generated(facts: Facts) -> dict[str, str]:
    """Path from the root of the repository -> content, of every generated file."""
    templates = environment(facts)
    files = {path: templates.get_template(name).render() for name, path in TEMPLATES.items()}
    makers: Mapping[str, Callable[[Facts], str]] = {
        "python/tendonfmu/schema/finger.schema.json": schema_text,
        "python/tendonfmu/schema/description_numbers.json": numbers_text,
        "python/tendonfmu/schema/rig.schema.json": rig_text,
        "modelDescription/variables.json": variables_text,
    }
    files |= {path: make(facts) for path, make in makers.items()}
    return files | {f"python/tendonfmu/schema/{name}.schema.json": typed_text(*of) for name, of in TYPED.items()}


def differing(files: Mapping[str, str], root: Path = ROOT) -> list[str]:
    def present(path: str) -> str | None:
        return (root / path).read_text(encoding="utf-8") if (root / path).is_file() else None

    return [path for path, text in files.items() if present(path) != text]


def main(arguments: list[str]) -> int:
    if arguments not in ([], ["--check"]):
        print(f"usage: {COMMAND} [--check]", file=sys.stderr)
        return 2
    files = generated(read_facts())
    changed = differing(files)
    for path in changed:
        if not arguments:
            (ROOT / path).write_text(files[path], encoding="utf-8", newline="\n")
        print(f"{path}: {'differs' if arguments else 'written'}")
    return int(bool(changed and arguments))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
