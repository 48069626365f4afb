"""The page of `tendonfmu run`: where the command writes it, and that a file that cannot be is refused first."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from command import Call
from tendonfmu.files.tables import read_table

Files = tuple[str, str]


def test_the_command_writes_a_file_or_into_a_folder(call: Call, files: Files, tmp_path: Path) -> None:
    for given, page in (("page.html", "page.html"), ("new/folder", "new/folder/run.html")):
        answer = call("run", *files, "-o", "out.csv", "--report", given, "--json")
        assert answer.status == 0 and page in answer.err
        text, report = (tmp_path / page).read_text(encoding="utf-8"), json.loads(answer.out)
        assert all(f"<h3>{each['name']}</h3>" in text for each in report["joints"])
    assert call("build", "finger.json", "-o", "f.fmu").status == 0
    packed = json.loads(call("run", "f.fmu", "r.csv", "-o", "out.csv", "--json").out)
    assert packed == report | {"model": "f.fmu"}
    torque = read_table(tmp_path / "out.csv", lambda *_: None)["joint_torque[1]"]
    assert packed["joints"][0]["joint_torque_rms"] == pytest.approx(np.sqrt(np.mean(torque**2)))


@pytest.mark.parametrize(
    ("option", "target", "words"),
    [
        ("--report", "finger.json/x", "finger.json is a file"),
        ("--report", "absent/page.html", "no folder absent"),
        ("--report", "-", "standard output takes tables only"),
    ],
)
def test_a_page_that_cannot_be_is_refused_first(
    call: Call, files: Files, tmp_path: Path, option: str, target: str, words: str
) -> None:
    answer = call("run", *files, "-o", "out.csv", option, target)
    assert answer.status == 2 and words in answer.err and not (tmp_path / "out.csv").exists()
