"""Which variables, units and dependencies the FMU of a finger has, from the table modelDescription/variables.json."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from tendonfmu.files import counted
from tendonfmu.model import (
    Dependencies,
    Finger,
    dependencies,
    extension_rows,
    native,
    place_of,
    structure_of,
)

# Unit -> the unit in which a person reads it, and how many of them make one. Start values and limits stay in `unit`.
DISPLAY_UNITS = {
    "rad": ("deg", 57.29577951308232),
    "rad/s": ("deg/s", 57.29577951308232),
    "m": ("mm", 1e3),
    "m/s": ("mm/s", 1e3),
    "N.m": ("mN.m", 1e3),
    "N/m": ("N/mm", 1e-3),
}
# Unit -> size of such a signal in a robot finger: importers scale tolerances and plots by it.
NOMINAL_VALUES = {"N": 10.0, "m": 0.01, "rad": 1.0, "rad/s": 1.0, "N.m": 0.1}

# Types of FMI 3.0 by their names in FMI 2.0.
TYPES = {"Real": "Float64", "Integer": "Int32", "Boolean": "Boolean", "String": "String"}

# Characters that XML 1.0 does not allow, even escaped.
NOT_IN_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


@dataclass(frozen=True)
class VariableTable:
    """The content of variables.json."""

    data: Mapping[str, Any]  # the parsed JSON
    patterns: list[tuple[re.Pattern[str], str]]  # compiled patterns of parameter paths, each with its description


def read_table(text: str) -> VariableTable:
    """Read a table of variables."""
    data = json.loads(text)
    patterns = [(re.compile(pattern), wording) for pattern, wording in data["parameters"]["descriptions"]]
    return VariableTable(data, patterns)


def describe_model(description: Finger, table: VariableTable) -> dict[str, Any]:
    """Return the template's context, except what belongs to the package: identifier, GUID, version, sources."""
    finger = native.Instance(description.image)
    sizes = group_sizes(finger.joints, finger.tendons)
    has = {"links": finger.has_links, "sensor_fault": finger.watches_sensors}
    groups = present_groups(table, {need for need, given in has.items() if given})
    variables = [variable for group in groups for variable in elements(group, sizes)]
    variables += _parameters(finger.parameters(), table, description.data)
    index = {variable["name"]: k for k, variable in enumerate(variables, start=1)}
    late = any(row["effect"] == "time_delay" for row in extension_rows(description.data))
    outputs = list(_outputs(groups, sizes, index, dependencies(structure_of(description)), late))
    return {
        "name": NOT_IN_XML.sub("?", description.name),
        "description": f"Friction compensation of the tendon-driven finger {NOT_IN_XML.sub('?', description.name)}: "
        f"{counted(finger.joints, 'joint')}, {counted(finger.tendons, 'tendon')}",
        "units": units_of(variables, table),
        "log_categories": table.data["log_categories"],
        "variables": variables,
        "outputs": outputs,
        "initial_unknowns": [output["index"] for output in outputs],
        "directional_derivative": True,
        "default_experiment": {"start": 0.0, "stop": 10.0, "step": 0.001},
    }


def group_sizes(joints: int, tendons: int) -> dict[str, int]:
    """Return the number of elements of a group by its `size` in the table."""
    return {"scalar": 1, "joints": joints, "tendons": tendons, "vector": 3}


def present_groups(table: VariableTable, has: set[str]) -> list[Mapping[str, Any]]:
    """Return the table's groups that a model has. has: what the model has of the groups' needs."""
    return [group for group in table.data["groups"] if group.get("needs") is None or group["needs"] in has]


def units_of(variables: list[dict[str, Any]], table: VariableTable) -> dict[str, Any]:
    """Return the table's units that the variables use."""
    used = {variable.get("unit") for variable in variables}
    return {
        unit: {"base": base, "display": DISPLAY_UNITS.get(unit)}
        for unit, base in table.data["units"].items()
        if unit in used
    }


def _names(group: Mapping[str, Any], sizes: Mapping[str, int]) -> list[str]:
    name = group["name"]
    return [name] if group["size"] == "scalar" else [f"{name}[{i}]" for i in range(1, sizes[group["size"]] + 1)]


def elements(group: Mapping[str, Any], sizes: Mapping[str, int]) -> Iterator[dict[str, Any]]:
    """Yield the variables of a group, as the template needs them."""
    given = {key: group[key] for key in ("type", "causality", "variability")}
    where = {key: group[key] for key in ("initial", "unit", "min", "max", "start", "terminal") if key in group}
    if group["causality"] != "parameter" and group.get("unit") in NOMINAL_VALUES:
        where["nominal"] = NOMINAL_VALUES[group["unit"]]
    for i, name in enumerate(_names(group, sizes)):
        text = group["description"].replace("{i}", str(i + 1))
        yield {**given, **where, "name": name, "vr": group["base"] + i, "description": text}


def _parameters(
    parameters: list[native.Parameter], table: VariableTable, data: Mapping[str, Any]
) -> Iterator[dict[str, Any]]:
    settings = table.data["parameters"]
    effects = {f"extensions[{k}]": place_of(row) for k, row in enumerate(extension_rows(data), start=1)}
    for k, parameter in enumerate(parameters):
        yield {
            "name": parameter.path,
            "vr": settings["base"] + k,
            "type": settings["type"],
            "causality": settings["causality"],
            "variability": "tunable" if parameter.tunable else "fixed",
            "initial": settings["initial"],
            "description": parameter_description(parameter.path, table) + effects.get(parameter.path.split(".")[0], ""),
            "unit": parameter.unit,
            "min": parameter.minimum,
            "max": parameter.maximum,
            "start": parameter.start,
            "above_minimum": parameter.above_minimum,
        }


PLACE = re.compile(r"\\(\d)")  # of a group in a wording; `Match.expand` reads the wording anew for each parameter


def parameter_description(path: str, table: VariableTable) -> str:
    """Return the description of the first pattern that matches the whole path."""
    for pattern, wording in table.patterns:
        match = pattern.fullmatch(path)
        if match:
            parts = PLACE.split(wording)  # every other one is the number of a group
            return "".join(match[int(part)] if k % 2 else part for k, part in enumerate(parts))
    raise LookupError(f"{path}: no description in variables.json")


def _outputs(
    present: list[Mapping[str, Any]],
    sizes: Mapping[str, int],
    index: Mapping[str, int],
    structure: Dependencies,
    late: bool,
) -> Iterator[dict[str, Any]]:
    """Yield index and dependencies of the outputs."""
    # late: forces may be those of earlier samples, so that no dependency has a fixed factor.
    groups = {group["name"]: group for group in present}
    for group in present:
        if group["causality"] != "output":
            continue
        names = _names(group, sizes)
        everything = {of: list(range(sizes[groups[of]["size"]])) for of in group["dependencies"]}
        for name, inputs in zip(names, structure.get(group["name"], [everything] * len(names)), strict=True):
            known = {
                index[_names(groups[of], sizes)[i]]: "dependent" if late else group["dependencies"][of]["kind"]
                for of, elements in inputs.items()
                for i in elements
            }
            yield {
                "index": index[name],
                "dependencies": sorted(known),
                "kinds": [known[k] for k in sorted(known)],
            }


# --- FMI 3.0: the elements of a group as one array --------------------------------------------------------------------


def in_arrays(model: Mapping[str, Any], table: VariableTable, sizes: Mapping[str, int]) -> dict[str, Any]:
    """Return the template's context for FMI 3.0."""
    base = table.data["parameters"]["base"]
    groups = {group["base"]: group for group in table.data["groups"]}
    variables = [_time(base - 1)]
    first_of = {}  # index of a variable of FMI 2.0 -> value reference in FMI 3.0
    for index, variable in enumerate(model["variables"], start=1):
        reference = variable["vr"]
        group = groups.get(reference)
        if group is not None:
            variables.append(_array(variable, group, sizes))
        elif reference >= base:
            variables.append({**variable, "type": TYPES[variable["type"]]})
        first_of[index] = variables[-1]["vr"]
    outputs = _array_outputs(model["outputs"], first_of)
    return {
        **model,
        "variables": variables,
        "outputs": outputs,
        "initial_unknowns": [output["vr"] for output in outputs],
        "units": units_of(variables, table),
    }


def _time(reference: int) -> dict[str, Any]:
    return {
        "name": "time",
        "vr": reference,
        "type": "Float64",
        "causality": "independent",
        "variability": "continuous",
        "description": "End of the last step; before the first step, the start time",
        "unit": "s",
    }


def _array(first: Mapping[str, Any], group: Mapping[str, Any], sizes: Mapping[str, int]) -> dict[str, Any]:
    """Return a group as one variable. first: its first element."""
    array = {**first, "name": group["name"], "type": TYPES[group["type"]]}
    if group["size"] != "scalar":
        size = sizes[group["size"]]
        text = group["description"].replace("{i}", "i")
        array["dimension"] = size
        array["description"] = f"{text}. Element i of {size}, counted from 1"
        if "start" in array:
            array["start"] = " ".join([str(array["start"])] * size)
    return array


def _array_outputs(outputs: list[Mapping[str, Any]], first_of: Mapping[int, int]) -> list[dict[str, Any]]:
    """Return the dependencies of arrays: those of all their elements together."""
    kinds: dict[int, dict[int, set[str]]] = {}
    for output in outputs:
        known = kinds.setdefault(first_of[output["index"]], {})
        for index, kind in zip(output["dependencies"], output["kinds"], strict=True):
            known.setdefault(first_of[index], set()).add(kind)
    return [
        {
            "vr": reference,
            "dependencies": sorted(known),
            "kinds": [next(iter(known[k])) if len(known[k]) == 1 else "dependent" for k in sorted(known)],
        }
        for reference, known in kinds.items()
    ]
