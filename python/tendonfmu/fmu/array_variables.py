"""The variables of an FMI 3.0 FMU: those of FMI 2.0, with the elements of a group as one array."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from tendonfmu.fmu.model_variables import VariableTable, units_of

# The same numbers as in FMI 2.0 have other names of their types.
TYPES = {"Real": "Float64", "Integer": "Int32", "Boolean": "Boolean", "String": "String"}


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
    outputs = _outputs(model["outputs"], first_of)
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
    found = {**first, "name": group["name"], "type": TYPES[group["type"]]}
    if group["size"] != "scalar":
        size = sizes[group["size"]]
        text = group["description"].replace("{i}", "i")
        found["dimension"] = size
        found["description"] = f"{text}. Element i of {size}, counted from 1"
        if "start" in found:
            found["start"] = " ".join([str(found["start"])] * size)
    return found


def _outputs(outputs: list[Mapping[str, Any]], first_of: Mapping[int, int]) -> list[dict[str, Any]]:
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
