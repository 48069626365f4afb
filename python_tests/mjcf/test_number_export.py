"""`tendonfmu export mjcf`: numbers written back, what cannot be, and the rest of the file as it was."""

from __future__ import annotations

import copy
import json
from pathlib import Path
from typing import Any

import pytest

from optional_parts import require

require("mujoco")

import mujoco
from lxml import etree

from command import Call
from mjcf_models import fixed_model
from tendonfmu.errors import InputError
from tendonfmu.mjcf.finger_import import import_finger
from tendonfmu.mjcf.number_export import Export, export_numbers
from tendonfmu.options import ImportOptions

SETTINGS = ImportOptions(joints=("mcp", "pip"))


def exported(folder: Path, data: dict[str, Any], model: str = "model.xml", output: str = "out.xml") -> Export:
    (folder / "fitted.json").write_text(json.dumps(data), encoding="utf-8")
    return export_numbers(folder / "fitted.json", folder / model, folder / output)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "model.xml").write_text(fixed_model(), encoding="utf-8")
    return tmp_path


@pytest.fixture
def data(folder: Path) -> dict[str, Any]:
    """The model's own description."""
    return import_finger(folder / "model.xml", SETTINGS).data


def fitted(data: dict[str, Any]) -> dict[str, Any]:
    """The description with other numbers wherever MJCF has one."""
    changed = copy.deepcopy(data)
    changed["joints"][0]["friction"] |= {"static": 0.0123456789012345, "coulomb": 0.0123456789012345, "viscous": 0.003}
    changed["joints"][0]["cover"] = {"stiffness": 0.05, "rest_angle": -0.2}
    for row in changed["extensions"]:
        if row["effect"] == "preload_friction":
            row["coulomb"] = 0.7
        elif row["joint"] == 2:
            row["inertia"] += 1e-5
    return changed


def test_the_rest_of_the_file_stays(folder: Path, data: dict[str, Any]) -> None:
    """Line by line: only the elements of the joints and the tendon differ, and none without a change."""
    before = etree.tostring(etree.parse(str(folder / "model.xml"))).decode().splitlines()
    for wanted, named in ((data, []), (fitted(data), ['"mcp"', '"pip"', '"long"'])):
        exported(folder, wanted)
        after = etree.tostring(etree.parse(str(folder / "out.xml"))).decode().splitlines()
        differing = [old for old, new in zip(before, after, strict=True) if old != new]
        assert len(differing) == len(named) and all(any(name in line for name in named) for line in differing)
    data["joints"][1]["friction"] = {"static": 0.001, "coulomb": 0.001, "stribeck_velocity": 0.1, "viscous": 0.0005}
    exported(folder, data)
    model = mujoco.MjModel.from_xml_path(str(folder / "out.xml"))  # the default class of both joints stays
    assert [model.dof_damping[model.joint(name).dofadr[0]] for name in ("mcp", "pip")] == [0.002, 0.0005]


@pytest.mark.parametrize("angle", ["radian", "degree"])
def test_numbers_come_back_through_export_and_import(folder: Path, angle: str) -> None:
    unit = {"radian": 1.0, "degree": 57.29577951308232}[angle]
    text = fixed_model(angle=angle, low=-0.5 * unit, high=1.2 * unit, rest=0.1 * unit)
    (folder / "model.xml").write_text(text, encoding="utf-8")
    wanted = fitted(import_finger(folder / "model.xml", SETTINGS).data)
    written = exported(folder, wanted)
    assert {(change.name, change.attribute) for change in written.changes} == {
        ("mcp", "frictionloss"),
        ("mcp", "damping"),
        ("mcp", "stiffness"),
        ("mcp", "springref"),
        ("pip", "armature"),
        ("long", "frictionloss"),
    }
    back = import_finger(folder / "out.xml", SETTINGS).data
    assert back["tendons"] == wanted["tendons"]
    for got, own in zip(back["joints"], wanted["joints"], strict=True):
        for key in own.keys() - {"name"}:
            assert got[key] == pytest.approx(own[key], rel=1e-12)
    for got, own in zip(back["extensions"], wanted["extensions"], strict=True):
        assert got.pop("effect") == own.pop("effect") and got == pytest.approx(own, rel=1e-9)


def test_what_mjcf_cannot_express_is_listed(folder: Path, data: dict[str, Any]) -> None:
    law = {"static": 0.03, "coulomb": 0.02, "stribeck_velocity": 0.01}
    data["joints"][0]["friction"] = {"positive": law, "negative": law | {"coulomb": 0.01}}
    data["joints"][1].pop("friction")
    data["joints"][1]["load_friction"] = law
    data["tendons"][0]["edge_friction"] = [law, law]
    data["tendons"][0]["pulley_friction"] = [law, None]
    data["extensions"] += [
        {"effect": "gravity", "joint": 1, "sine": 0.01},
        {"effect": "preload_friction", "tendon": 1, "joint": 2, "coulomb": 0.1},
    ]
    next(row for row in data["extensions"] if row["effect"] == "inertia")["inertia"] = 1e-7
    written = exported(folder, data)
    text = "\n".join(written.left_out)
    for words in (
        "joint mcp: friction by direction, coulomb 0.02 and 0.01",
        "joint mcp: static friction 0.03",
        "joint pip: no friction law",
        "edge_friction at 2 places",
        "pulley_friction at 1 place:",
        "load_friction at 1 place:",
        "1 gravity",
        "preload_friction of tendon deep: not before the tendon's first joint",
        "joint mcp: inertia 1e-07",
    ):
        assert words in text, text
    values = {(change.name, change.attribute): change.after for change in written.changes}
    assert values["mcp", "frictionloss"] == pytest.approx(0.015) and values["mcp", "armature"] == 0.0


# --- included files ---------------------------------------------------------------------------------------------------


def divided(folder: Path) -> None:
    """The model in three files: tendons and bodies are included, the bodies' joints by yet another file."""
    text = fixed_model()
    begin, end = text.index("<worldbody>"), text.index("</worldbody>") + len("</worldbody>")
    tendons = text.index("<tendon>"), text.index("</tendon>") + len("</tendon>")
    (folder / "bodies.xml").write_text(f"<mujoco><!-- bodies -->{text[begin:end]}</mujoco>", encoding="utf-8")
    (folder / "tendons.xml").write_text(f"<any>{text[tendons[0] : tendons[1]]}</any>", encoding="utf-8")
    whole = text[:begin] + '<include file="bodies.xml"/>' + text[end : tendons[0]]
    whole += '<include file="tendons.xml"/>' + text[tendons[1] :]
    (folder / "model.xml").write_text(whole, encoding="utf-8")


def test_included_files_with_changed_numbers_stand_in_the_text(folder: Path, data: dict[str, Any]) -> None:
    divided(folder)
    assert exported(folder, data).changes == []
    assert (folder / "out.xml").read_bytes().strip() == (folder / "model.xml").read_bytes().strip()
    data["joints"][0]["friction"]["viscous"] = 0.01
    exported(folder, data)
    text = (folder / "out.xml").read_text(encoding="utf-8")
    assert "<!-- bodies -->" in text and '<include file="tendons.xml"/>' in text and "bodies.xml" not in text
    assert import_finger(folder / "out.xml", SETTINGS).data["joints"][0]["friction"]["viscous"] == 0.01
    assert 'damping="0.01"' not in (folder / "bodies.xml").read_text(encoding="utf-8")
    (folder / "elsewhere").mkdir()
    with pytest.raises(InputError, match=r"beside it; expected an output in the folder of model\.xml"):
        exported(folder, data, output="elsewhere/out.xml")


# --- refusals ---------------------------------------------------------------------------------------------------------


def test_names_that_the_model_does_not_have(folder: Path, data: dict[str, Any], call: Call) -> None:
    for key, kind in (("joints", "joint"), ("tendons", "tendon")):
        changed = copy.deepcopy(data)
        changed[key][0]["name"] = "ring"
        (folder / "fitted.json").write_text(json.dumps(changed), encoding="utf-8")
        answer = call("export", "mjcf", "fitted.json", "model.xml", "-o", "out.xml")
        assert answer.status == 2 and f"{kind} ring" in answer.err and "it has" in answer.err
        changed[key][0].pop("name")
        with pytest.raises(InputError, match=rf"{key}\[1\]\.name: missing"):
            exported(folder, changed)
    assert not (folder / "out.xml").exists()
    (folder / "fitted.json").write_text(json.dumps(fitted(data)), encoding="utf-8")
    answer = call("export", "mjcf", "fitted.json", "model.xml", "-o", "out.xml")
    assert answer.status == 0 and answer.out == "" and "6 numbers changed" in answer.err and "left out: " in answer.err


def test_a_number_that_is_none_or_not_known_stays_the_models(folder: Path, data: dict[str, Any]) -> None:
    """Below 0, at the bound 0 of a fit, and what the fit's report does not identify."""
    changed = fitted(data)
    for row in changed["extensions"]:
        if row["effect"] == "preload_friction":
            row["coulomb"] = -0.008
    changed["joints"][0]["friction"]["viscous"] = 0.0
    found = exported(folder, changed)
    written = {(change.kind, change.attribute) for change in found.changes}
    assert ("tendon", "frictionloss") not in written and ("joint", "frictionloss") in written
    assert sum("-0.008 N: below 0; the model's number stays" in text for text in found.left_out) == 1
    assert sum("damping" in text and "at its bound 0" in text for text in found.left_out) == 1
    row = {"path": "joints[1].friction.coulomb", "at_bound": False, "identified": False}
    report = folder / "report.json"
    report.write_text(json.dumps({"format": "tendonfmu-fit-1", "parameters": [row]}), encoding="utf-8")
    found = export_numbers(folder / "fitted.json", folder / "model.xml", folder / "out.xml", report)
    assert ("joint", "frictionloss") not in {(change.kind, change.attribute) for change in found.changes}
    assert any("not identified by the fit" in text for text in found.left_out)
    with pytest.raises(InputError, match="expected a report of tendonfmu fit"):
        export_numbers(folder / "fitted.json", folder / "model.xml", folder / "out.xml", folder / "fitted.json")
