"""docs/reference/simulated_finger.md: its tables name every switch of a rig and existing tests; its command runs."""

from __future__ import annotations

import json
import re
import shlex
import subprocess
import sys
from importlib.resources import files
from pathlib import Path

import pytest

pytest.importorskip("tendonfmu._native", reason="SKIPPED: tendonfmu is not installed")

from test_rig_page import properties

from plant_rigs import needs_plant
from repository_paths import ROOT
from tendonfmu.files.tables import read_table

PAGE = (ROOT / "docs" / "reference" / "simulated_finger.md").read_text(encoding="utf-8")
KEYS = set(dict(properties(json.loads((files("tendonfmu") / "schema" / "rig.schema.json").read_text("utf-8")))))
SWITCHES = PAGE.split("## Everything that can be switched on")[1].split("\n## ")[0]
LINES = re.findall(r"^\|(.*)\|$", SWITCHES, flags=re.MULTILINE)
ROWS = [[cell.strip() for cell in re.split(r"(?<!\\)\|", line)] for line in LINES]
ROWS = [row for row in ROWS if len(row) == 7 and row[0] != "key" and not row[0].startswith("---")]
# what says how big or where a switch in the table is, or is no switch
BESIDE = r"format|base|name|version|seed|finger|physics|recording.*|integration.*|physics\.tip"
OF_LINKS = r"physics\.links\[k\]\.(axis|offset|mass|centre_of_mass|inertia)"


def named_keys() -> set[str]:
    """Key paths that the first columns name, as the schema spells them."""
    found = set()
    for row in ROWS:
        whole = ""
        for name in re.findall(r"`([^`]+)`", row[0]):
            name = name.replace("[]", "[k]")
            whole = whole.rsplit(".", 1)[0] + name if name.startswith(".") else name
            places = [whole if whole.split(".")[0] in ("sensors", "motion", "pushes", "settle") else f"physics.{whole}"]
            if ".*." in whole:
                sensors = {key.split(".")[1] for key in KEYS if key.count(".") == 2 and key.startswith("sensors.")}
                places = [whole.replace("*", sensor) for sensor in sensors]
            found.update(places)
    return found


def test_every_key_on_the_page_is_a_rigs() -> None:
    assert len(ROWS) > 35
    assert named_keys() - KEYS == set()


def test_every_switch_is_on_the_page() -> None:
    """Itself, the object that it is part of, or a part of it; of the edges' keys their shape."""
    named = named_keys() | {"physics.friction.edges"}
    switches = {key for key in KEYS if not re.fullmatch(f"{BESIDE}|{OF_LINKS}", key)}
    assert len(switches) > 100
    inside = {key for key in switches for name in named if key == name or key.startswith((f"{name}.", f"{name}[k]"))}
    around = {key for key in switches for name in named if name.startswith((f"{key}.", f"{key}[k]"))}
    assert switches - inside - around == set()


def test_every_test_on_the_page_is_there() -> None:
    marks = {"": "test_plant_switches", "P": "test_plant_physics", "S": "test_plant_sensors"}
    tests = {
        mark: re.findall(
            r"^def test_(\w+)", (ROOT / "python_tests" / "simulate" / f"{name}.py").read_text("utf-8"), re.MULTILINE
        )
        for mark, name in marks.items()
    }
    checked = 0
    for row in ROWS:
        mark = ""
        for new_mark, name in re.findall(r"(\b[PS]\b)?\s*`([^`]+)`", row[-1]):
            mark = new_mark or mark
            start = name.rstrip("…")
            assert any(test == start or (name != start and test.startswith(start)) for test in tests[mark]), row
            checked += 1
    assert checked >= len(ROWS)


def test_every_figure_is_there() -> None:
    figures = re.findall(r"\]\(\.\./(figures/[^)]+)\)", PAGE)
    assert len(figures) == 4 and all((ROOT / "docs" / figure).is_file() for figure in figures)


@needs_plant
@pytest.mark.long
def test_the_command_runs(tmp_path: Path) -> None:
    command = re.search(r"```sh\ntendonfmu (.*)\n```", PAGE)
    assert command
    words = [str(ROOT / word) if word.startswith("examples/") else word for word in shlex.split(command[1])]
    subprocess.run([sys.executable, "-m", "tendonfmu.cli", *words], cwd=tmp_path, check=True)
    truth = read_table(tmp_path / "truth.parquet", lambda *_: None)
    parts = sum(truth[f"{name}_torque[2]"] for name in ("friction", "external", "inertial", "stop"))
    assert abs(truth["joint_torque[2]"] - parts).max() < 1e-12
    works = truth["motor_work"] + truth["push_work"] - truth["friction_work"] - truth["damping_work"]
    balance = truth["kinetic_energy"] + truth["potential_energy"] - works
    assert abs(balance - balance[0]).max() < 2e-7
