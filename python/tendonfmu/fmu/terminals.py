"""The terminals of an FMU: groups of variables that are connected together, and where they are drawn.

FMI 2.0.4 takes them over from FMI 3.0 (section 2.4.9). An importer that knows terminals connects the simulated finger
with the friction FMU by one line, `sensors` to `sensors`.
"""

from __future__ import annotations

import importlib.util
import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tendonfmu.errors import InternalError

if TYPE_CHECKING:
    from lxml.builder import ElementMaker

FOLDER = "terminalsAndIcons"
SCHEMA = "fmi3/fmi3TerminalsAndIcons.xsd"

DESCRIPTIONS = {
    "sensors": "Signals of the sensors: tendon forces, tendon positions, joint positions, joint velocities",
    "estimate": "Joint torques without friction, contact, and what they are made of",
    "motors": "Commands of the motors",
    "push": "Force on the finger from outside",
    "truth": "True values, which no sensor tells",
}

# In the coordinates of the file: the icon is a square, terminals sit on its left and right edge.
EDGE, HALF = 100.0, 8.0
SCALE = 0.1  # mm for a unit of coordinates


def terminals_and_icons(variables: Sequence[Mapping[str, Any]], icon: bytes | None) -> dict[str, bytes]:
    """Return the folder `terminalsAndIcons` of an FMU."""
    from lxml import etree
    from lxml.builder import ElementMaker

    groups: dict[str, list[Mapping[str, Any]]] = {}
    for variable in variables:
        if variable.get("terminal"):
            groups.setdefault(variable["terminal"], []).append(variable)
    sides = {name: members[0]["causality"] for name, members in groups.items()}
    files = {}
    if icon is not None:
        from tendonfmu.drawing import draw_terminal

        files["icon.png"] = icon
        for side in sorted(set(sides.values())):
            picture = io.BytesIO()
            draw_terminal(picture, is_input=side == "input")
            files[f"{side}.png"] = picture.getvalue()
    e = ElementMaker()
    root = e.fmiTerminalsAndIcons(
        *([_graphical_representation(e)] if files else []),
        e.Terminals(*(_terminal(e, name, members, sides, drawn=bool(files)) for name, members in groups.items())),
        fmiVersion="3.0",
    )
    text = etree.tostring(root, xml_declaration=True, encoding="UTF-8", pretty_print=True)
    files["terminalsAndIcons.xml"] = checked(bytes(text), SCHEMA)
    return {f"{FOLDER}/{name}": data for name, data in files.items()}


def _box(x: float, y: float, half: float) -> dict[str, str]:
    return {"x1": str(x - half), "y1": str(y - half), "x2": str(x + half), "y2": str(y + half)}


def _graphical_representation(e: ElementMaker) -> Any:
    return e.GraphicalRepresentation(
        e.CoordinateSystem(**_box(0.0, 0.0, EDGE), suggestedScalingFactorTo_mm=str(SCALE)),
        e.Icon(**_box(0.0, 0.0, EDGE)),
    )


def _terminal(
    e: ElementMaker, name: str, members: Sequence[Mapping[str, Any]], sides: Mapping[str, str], *, drawn: bool
) -> Any:
    """Return a terminal; on an edge, terminals stand at equal distances from top to bottom."""
    content = [
        e.TerminalMemberVariable(variableName=member["name"], memberName=member["name"], variableKind="signal")
        for member in members
    ]
    if drawn:
        beside = [other for other, side in sides.items() if side == sides[name]]
        y = EDGE - 2.0 * EDGE * (beside.index(name) + 1) / (len(beside) + 1)
        place = _box(-EDGE if sides[name] == "input" else EDGE, y, HALF)
        content.append(e.TerminalGraphicalRepresentation(**place, iconBaseName=sides[name]))
    # bus: members of the same name are connected, and either side may have more
    return e.Terminal(*content, name=name, matchingRule="bus", description=DESCRIPTIONS[name])


def checked(xml: bytes, schema: str) -> bytes:
    """Return the XML if FMI's schema accepts it."""
    from lxml import etree

    spec = importlib.util.find_spec("fmpy")
    if spec is None or not spec.submodule_search_locations:
        raise InternalError("FMI's schemas not found; expected the Python package fmpy")
    path = Path(spec.submodule_search_locations[0]) / "schema" / schema
    rules = etree.XMLSchema(etree.parse(str(path)))
    if not rules.validate(etree.fromstring(xml)):
        error = rules.error_log[0]
        raise InternalError(f"{path.stem}, line {error.line}: {error.message}")
    return xml
