"""docs/reference/commands/excite.md: its commands exist as it says, and its example gives the motion."""

from __future__ import annotations

import json
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from plant_rigs import needs_plant
from repository_paths import ROOT
from tendonfmu.excite.excitation import Plan, plan_excitation
from tendonfmu.excite.training_motion import as_array, find_ranges, read_subject
from tendonfmu.statistics.quintic import evaluate

PAGE = (ROOT / "docs" / "reference" / "commands" / "excite.md").read_text(encoding="utf-8")
INDEX = ROOT / "examples" / "fingers" / "index_finger.json"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the page's first command was run, for 30 s of motion."""
    place = tmp_path_factory.mktemp("page")
    command = re.search(r"^tendonfmu (excite .*)$", PAGE, re.MULTILINE)
    assert command is not None
    words = [str(INDEX) if word.endswith("index_finger.json") else word for word in command[1].split()]
    subprocess.run([sys.executable, "-m", "tendonfmu.cli", *words, "--duration", "30"], cwd=place, check=True)
    return place


@pytest.mark.long
def test_the_example_interpolates_the_motion(folder: Path) -> None:
    code = re.search(r"```python\n(.*?)```", PAGE, re.DOTALL)
    assert code is not None
    done = subprocess.run([sys.executable, "-c", code[1]], cwd=folder, capture_output=True, text=True, check=True)
    subject = read_subject(INDEX)
    motion = plan_excitation(subject.finger.data, Plan(as_array(find_ranges(subject, [])), duration=30))
    expected = [float(values[0]) for values in evaluate(motion.knots[0], np.array([12.3456]))[:2]]
    np.testing.assert_allclose([float(word) for word in done.stdout.split()], expected, atol=1e-10)


@needs_plant
@pytest.mark.long
def test_the_simulated_finger_plays_it(tmp_path: Path) -> None:
    """The page's commands and rig, in a folder with the repository's examples; 10 s of motion."""
    part = PAGE.split("## On the simulated finger")[1].split("\n## ")[0]
    rig = re.search(r"```json\n(.*?)```", part, re.DOTALL)
    assert rig is not None
    for folder in ("fingers", "rigs"):
        shutil.copytree(ROOT / "examples" / folder, tmp_path / "examples" / folder)
    (tmp_path / "trained.json").write_text(json.dumps(json.loads(rig[1]) | {"recording": {"duration": 10}}), "utf-8")
    commands = re.findall(r"^tendonfmu (.*)$", part, re.MULTILINE)
    assert [command.split()[0] for command in commands] == ["excite", "simulate"]
    for command, more in zip(commands, (["--duration", "10"], []), strict=True):
        words = [sys.executable, "-m", "tendonfmu.cli", *shlex.split(command), *more]
        subprocess.run(words, cwd=tmp_path, check=True)
    assert (tmp_path / "recording.parquet").is_file()
