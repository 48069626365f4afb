"""What the examples of pages give: a rig's balance of torques, and layouts of viewers for what `run` writes."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest
from mcap.reader import make_reader
from test_code_blocks import BLOCK, DEMO, Page, run

from command import Call
from plant_rigs import needs_plant
from repository_paths import ROOT
from rig_cases import written
from tendonfmu.files.tables import read_table, write_table
from tendonfmu.simulate.rig import read_rig
from tendonfmu.simulate.simulation import simulate

VIEWERS = ROOT / "docs" / "reference" / "viewers"
SHOWN = ("joint_torque", "friction_torque", "compensated_torque", "joint_contact", "joint_angle", "joint_speed")


def code_of(page: str, language: str) -> str:
    return next(code for found, code in BLOCK.findall(Page(page).text) if found == language)


@needs_plant
def test_the_example_of_a_rig_runs(tmp_path: Path) -> None:
    result = simulate(read_rig(written(tmp_path, code_of("reference/rig", "json"))), truth=True)
    assert len(result.recording["time"]) == 20000 and result.contact_seconds > 0.6
    assert result.truth is not None
    parts = sum(result.truth[f"{name}_torque[1]"] for name in ("friction", "external", "inertial", "stop"))
    assert abs(result.truth["joint_torque[1]"] - parts).max() < 1e-12


@pytest.mark.parametrize(
    ("joints", "finger", "recording"),
    [(2, "two_joints", "two_joints_unseen"), (4, "index_finger_calibrated", "index_finger_pushes")],
)
def test_the_layouts_show_what_run_writes(call: Call, tmp_path: Path, joints: int, finger: str, recording: str) -> None:
    """Every curve of the layouts for Foxglove and PlotJuggler is a field of the MCAP file."""
    table = read_table(DEMO / f"{recording}.parquet", lambda *_: None)
    write_table(tmp_path / "rec.parquet", {name: values[:50] for name, values in table.items()})
    answer = call("run", DEMO / f"{finger}.json", "rec.parquet", "-o", "out.mcap")
    assert answer.status == 0, answer.err
    with open(tmp_path / "out.mcap", "rb") as stream:
        schema, channel, message = next(make_reader(stream).iter_messages())
    assert schema is not None
    fields = set(json.loads(schema.data)["properties"])
    wanted = {"contact", *(f"{name}[{j}]" for name in SHOWN for j in range(1, joints + 1))}
    assert fields == json.loads(message.data).keys() and wanted <= fields

    run([sys.executable, "-c", code_of("reference/viewers/README", "python"), str(joints)], tmp_path)
    foxglove, plotjuggler = (tmp_path / f"layout.{end}" for end in ("foxglove.json", "plotjuggler.xml"))
    curves = [str(curve.get("name")) for curve in ElementTree.parse(plotjuggler).iter("curve")]
    assert sorted(curves) == sorted(f"{channel.topic}/{name}" for name in wanted)
    panels = json.loads(foxglove.read_text(encoding="utf-8"))["configById"].values()
    # quoted: in /topic.name[1] the [1] is an element of a list
    paths = [path["value"] for panel in panels for path in panel["paths"]]
    assert sorted(paths) == sorted(f'{channel.topic}."{name}"' for name in wanted)
    if joints == 2:  # the layouts that users load
        for file in (foxglove, plotjuggler):
            assert (VIEWERS / f"two_joints.{file.name.removeprefix('layout.')}").read_bytes() == file.read_bytes()
