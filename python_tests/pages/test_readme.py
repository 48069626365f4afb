"""The README's commands do what it says, and its links lead somewhere."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
import warnings
from pathlib import Path

import pandas as pd
import pytest

from optional_parts import require
from repetitions import repeated
from repository_paths import ROOT
from tendonfmu.estimate.estimation import HAS_ESTIMATION

README = (ROOT / "README.md").read_text(encoding="utf-8")
COMMANDS = re.findall(r"^    \.venv/bin/(tendonfmu [^#\n]*)", README, flags=re.MULTILINE)


def test_links_lead_to_files_that_git_knows() -> None:
    require("git")
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=False)
    known = {Path(name) for name in listed.stdout.splitlines()}
    known |= {parent for name in known for parent in name.parents}
    pages = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md")), *sorted((ROOT / "examples").rglob("*.md"))]
    for page in pages:
        for target in re.findall(r"\]\(([^)#\s]+)[^)]*\)", page.read_text(encoding="utf-8")):
            if "://" in target:
                continue
            path = (page.parent / target).resolve().relative_to(ROOT)
            assert path in known, f"{page.relative_to(ROOT)}: {target}"


@pytest.mark.parametrize("calibrate", repeated([False, True], 0))
def test_commands_of_the_readme(tmp_path: Path, calibrate: bool) -> None:
    """In order, in a folder that sees the examples: one builds what the next one runs. To calibrate takes long."""
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    assert len(COMMANDS) >= 4
    wanted = [command for command in COMMANDS if (HAS_ESTIMATION and calibrate) or not needs_estimation(command)]
    if calibrate and len(wanted) < len(COMMANDS):
        warnings.warn("NOT TESTED: tendonfmu calibrate of the README, built without Eigen", stacklevel=1)
    for command in wanted:
        words = [str(Path(sys.executable).parent / "tendonfmu"), *shlex.split(command)[1:]]
        done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=False)
        assert done.returncode == 0, f"{command}\n{done.stderr}"
    outputs = pd.read_csv(tmp_path / "out.csv")
    assert len(outputs) == 30000
    assert outputs["contact"].any()
    assert not outputs["contact"].all()
    if HAS_ESTIMATION and calibrate:
        assert len(pd.read_csv(tmp_path / "free.csv")) == 20000


def needs_estimation(command: str) -> bool:
    return command.startswith(("tendonfmu calibrate ", "tendonfmu run calibrated/"))
