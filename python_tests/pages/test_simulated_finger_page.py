"""docs/reference/simulated_finger.md: the tests that its tables name exist; its command runs."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from plant_rigs import needs_plant
from repository_paths import ROOT
from tendonfmu.files.tables import read_table

PAGE = (ROOT / "docs" / "reference" / "simulated_finger.md").read_text(encoding="utf-8")
SWITCHES = PAGE.split("## Everything that can be switched on")[1].split("\n## ")[0]
LINES = re.findall(r"^\|(.*)\|$", SWITCHES, flags=re.MULTILINE)
ROWS = [[cell.strip() for cell in re.split(r"(?<!\\)\|", line)] for line in LINES]
ROWS = [row for row in ROWS if len(row) == 7 and row[0] != "key" and not row[0].startswith("---")]


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
