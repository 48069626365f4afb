"""terminalsAndIcons.xml of both FMUs, display units, nominal values and ranges: what importers show and scale by."""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import fmpy
import pint
import pytest
from lxml import etree

from fmu_binary import ERROR, FINGER, OK, Instance, UnpackedFmu
from plant_rigs import needs_plant
from tendonfmu.fmu.packaging import members
from tendonfmu.model import read_finger

SCHEMA = Path(fmpy.__file__).parent / "schema" / "fmi3" / "fmi3TerminalsAndIcons.xsd"


def parts(fmu: Path) -> tuple[dict[str, bytes], Any, Any]:
    """All files of an FMU, its variables and its terminals."""
    with zipfile.ZipFile(fmu) as archive:
        files = {name: archive.read(name) for name in archive.namelist()}
    return (
        files,
        ElementTree.fromstring(files["modelDescription.xml"]),
        ElementTree.fromstring(files["terminalsAndIcons/terminalsAndIcons.xml"]),
    )


def names_of(terminals: Any, terminal: str) -> list[str]:
    found = terminals.findall(f"Terminals/Terminal[@name='{terminal}']/TerminalMemberVariable")
    assert all(member.attrib["memberName"] == member.attrib["variableName"] for member in found)
    return [member.attrib["variableName"] for member in found]


@pytest.fixture(params=["friction", pytest.param("plant", marks=needs_plant)])
def fmu(request: pytest.FixtureRequest) -> Path:
    name = {"friction": "small_fmu_path", "plant": "plant_fmu_path"}[request.param]
    path: Path = request.getfixturevalue(name)
    return path


def test_each_signal_is_in_one_terminal(fmu: Path) -> None:
    files, model, terminals = parts(fmu)
    data = files["terminalsAndIcons/terminalsAndIcons.xml"]
    etree.XMLSchema(etree.parse(str(SCHEMA))).assertValid(etree.fromstring(data))
    causality = {v.attrib["name"]: v.attrib["causality"] for v in model.iter("ScalarVariable")}
    listed = [member.attrib["variableName"] for member in terminals.iter("TerminalMemberVariable")]
    assert sorted(listed) == sorted(name for name, of in causality.items() if of in ("input", "output"))
    for terminal in terminals.iter("Terminal"):
        (side,) = {causality[name] for name in names_of(terminals, terminal.attrib["name"])}
        drawn = terminal.find("TerminalGraphicalRepresentation")
        assert drawn is not None and drawn.attrib["iconBaseName"] == side
        assert (float(drawn.attrib["x1"]) < 0) == (side == "input")
        assert files[f"terminalsAndIcons/{side}.png"][:8] == b"\x89PNG\r\n\x1a\n"
    assert files["terminalsAndIcons/icon.png"][:8] == b"\x89PNG\r\n\x1a\n"


@needs_plant
def test_the_sensors_of_both_fmus_match(plant_fmu_path: Path, tmp_path: Path) -> None:
    """Rule `bus`: each input of the friction FMU of the same finger has an output of that name."""
    from tendonfmu.simulate.rig import read_rig

    plant = names_of(parts(plant_fmu_path)[2], "sensors")
    rig = read_rig(plant_fmu_path.parent / "rig.json")
    friction = members(rig.finger, illustrated=False)["terminalsAndIcons/terminalsAndIcons.xml"]
    wanted = names_of(ElementTree.fromstring(friction), "sensors")
    assert len(wanted) > 8 and set(wanted) <= set(plant)


def test_without_pictures_nothing_is_drawn() -> None:
    files = members(read_finger(FINGER), illustrated=False)
    assert [name for name in files if name.startswith("terminals")] == ["terminalsAndIcons/terminalsAndIcons.xml"]
    assert b"Graphical" not in files["terminalsAndIcons/terminalsAndIcons.xml"]


# --- units, nominal values, ranges ------------------------------------------------------------------------------------


def test_display_units_are_the_same_quantity(fmu: Path) -> None:
    """By pint: one unit is `factor` display units."""
    _, model, _ = parts(fmu)
    registry = pint.UnitRegistry()
    found = {}
    for unit in model.iter("Unit"):
        for display in unit.iter("DisplayUnit"):
            one = registry.Quantity(1.0, unit.attrib["name"].replace(".", "*"))
            shown = one.to(display.attrib["name"].replace(".", "*")).magnitude
            assert float(display.attrib["factor"]) == pytest.approx(shown, rel=1e-15)
            found[unit.attrib["name"]] = display.attrib["name"]
    assert {"rad": "deg", "m": "mm", "N.m": "mN.m"}.items() <= found.items()
    for real in model.iter("Real"):
        assert real.attrib.get("displayUnit") == found.get(real.attrib["unit"])


def test_nominal_values_are_of_signals(fmu: Path) -> None:
    _, model, _ = parts(fmu)
    for variable in model.iter("ScalarVariable"):
        nominal = variable[0].attrib.get("nominal")
        signal = variable.attrib["causality"] != "parameter" and variable[0].attrib.get("unit") not in (None, "1")
        assert (nominal is not None) == signal, variable.attrib["name"]
        assert nominal is None or float(nominal) > 0


def test_inputs_have_the_range_of_a_finger_and_take_more(small_fmu: UnpackedFmu, small_fmu_path: Path) -> None:
    """The range is for importers; the binary refuses only what no computation stands (contract: any sane recording)."""
    _, model, _ = parts(small_fmu_path)
    for variable in model.iter("ScalarVariable"):
        if variable.attrib["causality"] == "input":
            low, high = (float(variable[0].attrib[key]) for key in ("min", "max"))
            assert -1e5 < low == -high < 0 and low <= float(variable[0].attrib["start"]) <= high
            with Instance(small_fmu) as instance:
                assert instance.set_real({variable.attrib["name"]: 100 * high}) == OK
                assert instance.set_real({variable.attrib["name"]: 1.1e12}) == ERROR
                assert "expected -1e+12 to 1e+12" in instance.last_message
