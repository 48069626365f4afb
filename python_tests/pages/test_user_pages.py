"""The guide and the reference pages of formats: their examples run. description_keys.md has every key."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest

from repository_paths import ROOT
from tendonfmu.files.tables import read_table
from tendonfmu.model.description import read_finger
from tendonfmu.recordings.recording import GROUPS, read_recording

DOCS = ROOT / "docs" / "reference"
GUIDE = DOCS.parent / "guide"
YOUR_FINGER = (GUIDE / "your_finger.md").read_text(encoding="utf-8")
YOUR_RECORDING = (GUIDE / "your_recording.md").read_text(encoding="utf-8")
FINGER_PAGE = (DOCS / "finger_description.md").read_text(encoding="utf-8")
RECORDING_PAGE = (DOCS / "recordings.md").read_text(encoding="utf-8")
SCHEMA = json.loads((files("tendonfmu") / "schema" / "finger.schema.json").read_text(encoding="utf-8"))


def blocks(page: str, language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", page, re.DOTALL)


def shell(script: str, folder: Path) -> str:
    """What the script said on standard error; the commands are those of this Python."""
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    done = subprocess.run(
        ["sh", "-e", "-c", script], cwd=folder, env=dict(os.environ, PATH=path), capture_output=True, check=False
    )
    assert done.returncode == 0, done.stderr.decode()
    return done.stderr.decode()


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with the finger of the page."""
    (tmp_path / "two_joints.json").write_text(blocks(YOUR_FINGER, "json")[0], encoding="utf-8")
    return tmp_path


@pytest.mark.long
def test_the_small_finger_is_sound_and_can_be_pretensioned(folder: Path) -> None:
    finger = read_finger(folder / "two_joints.json")
    assert (len(finger.joint_names), len(finger.tendon_names)) == (2, 3)
    arms = np.array(finger.moment_arms)
    assert np.allclose(arms.T @ [10.0, 10.0, 5.0], 0.0, atol=1e-15)
    shell(blocks(YOUR_FINGER, "sh")[1], folder)
    assert (folder / "two_joints.fmu").is_file()


@pytest.mark.long
def test_the_small_recording_gives_the_angles_it_was_made_of(folder: Path) -> None:
    subprocess.run([sys.executable, "-c", blocks(YOUR_RECORDING, "python")[0]], cwd=folder, check=True)
    recording = read_recording(folder / "two_joints.csv")
    said = shell(blocks(YOUR_RECORDING, "sh")[1], folder)
    assert "1000 samples in 1.998 s" in said and "-0.3 to 0.3 rad" in said
    shell(f"{blocks(YOUR_RECORDING, 'sh')[2].strip()} > answer.txt", folder)
    answer = (folder / "answer.txt").read_text(encoding="utf-8")
    assert "two_joints.csv: belongs to this finger" in answer and "nothing found" in answer
    found = read_table(folder / "two_joints_out.csv", lambda *_: None)
    assert np.allclose(found["joint_angle[1]"], 0.3 * np.sin(3 * recording.time), atol=1e-12)
    assert np.allclose(found["joint_angle[2]"], 0.2 * np.sin(2 * recording.time), atol=1e-12)


def test_the_schema_is_where_the_page_says(folder: Path) -> None:
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    told = subprocess.run(
        ["sh", "-c", blocks(FINGER_PAGE, "sh")[0]],
        cwd=folder,
        env=dict(os.environ, PATH=path),
        capture_output=True,
        text=True,
        check=True,
    ).stdout.strip()
    assert json.loads(Path(told).read_text(encoding="utf-8")) == SCHEMA


def test_every_column_of_a_recording_is_on_the_page() -> None:
    rows = re.findall(r"^\| (`.*?) \| ", RECORDING_PAGE, re.MULTILINE)
    named = {re.split(r"[.\[]", key)[0] for row in rows for key in re.findall(r"`([^`]*)`", row)}
    assert {"time", "contact", *GROUPS} <= named
