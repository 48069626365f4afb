"""docs/reference/viewers: every curve of the layouts is a field of the MCAP file that `run` writes."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
from mcap.reader import make_reader

from command import Call
from repository_paths import ROOT
from tendonfmu.files.tables import read_table, write_table

FOLDER = ROOT / "docs" / "reference" / "viewers"
PAGE = (FOLDER / "README.md").read_text(encoding="utf-8")
DEMO = ROOT / "examples" / "demo_recording"
SHOWN = ("joint_torque", "friction_torque", "compensated_torque", "joint_contact", "joint_angle", "joint_speed")
FINGERS = {
    2: ("two_joints.json", "two_joints_unseen.parquet"),
    4: ("index_finger_calibrated.json", "index_finger_pushes.parquet"),
}


def made_layouts(folder: Path, joints: int) -> tuple[str, str]:
    """What the script of the page writes: for Foxglove, and for PlotJuggler."""
    (script,) = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    subprocess.run([sys.executable, "-c", script, str(joints)], cwd=folder, check=True)
    texts = [(folder / f"layout.{end}").read_text(encoding="utf-8") for end in ("foxglove.json", "plotjuggler.xml")]
    return texts[0], texts[1]


def leaves(node: Any) -> Iterator[str]:
    """Panels of a layout of Foxglove."""
    if isinstance(node, str):
        yield node
        return
    assert node["direction"] in ("row", "column") and 0 < node["splitPercentage"] < 100
    yield from leaves(node["first"])
    yield from leaves(node["second"])


def test_the_layouts_are_those_of_the_script(tmp_path: Path) -> None:
    foxglove, plotjuggler = made_layouts(tmp_path, 2)
    assert (FOLDER / "two_joints.foxglove.json").read_text(encoding="utf-8") == foxglove
    assert (FOLDER / "two_joints.plotjuggler.xml").read_text(encoding="utf-8") == plotjuggler
    assert "two_joints.foxglove.json" in PAGE and "viewers/two_joints.plotjuggler.xml" in PAGE


@pytest.mark.parametrize("joints", FINGERS)
def test_their_curves_are_in_the_file_that_run_writes(call: Call, tmp_path: Path, joints: int) -> None:
    finger, recording = (DEMO / name for name in FINGERS[joints])
    table = read_table(recording, lambda *_: None)
    write_table(tmp_path / "rec.parquet", {name: values[:50] for name, values in table.items()})
    answer = call("run", finger, "rec.parquet", "-o", "out.mcap")
    assert answer.status == 0, answer.err
    with open(tmp_path / "out.mcap", "rb") as stream:
        schema, channel, message = next(make_reader(stream).iter_messages())
    assert schema is not None
    fields = set(json.loads(schema.data)["properties"])
    assert fields == json.loads(message.data).keys()
    wanted = {"contact", *(f"{name}[{j}]" for name in SHOWN for j in range(1, joints + 1))}
    assert wanted <= fields

    foxglove, plotjuggler = made_layouts(tmp_path, joints)
    curves = [str(curve.get("name")) for curve in ElementTree.fromstring(plotjuggler).iter("curve")]
    assert sorted(curves) == sorted(f"{channel.topic}/{name}" for name in wanted)
    layout = json.loads(foxglove)
    assert sorted(leaves(layout["layout"])) == sorted(layout["configById"])
    # quoted: in /topic.name[1] the [1] is an element of a list
    paths = [path["value"] for panel in layout["configById"].values() for path in panel["paths"]]
    assert sorted(paths) == sorted(f'{channel.topic}."{name}"' for name in wanted)
