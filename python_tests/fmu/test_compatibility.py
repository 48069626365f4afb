"""tools/compatibility.py, the table of docs/reference/compatibility.md: every importer that is installed agrees."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import numpy as np
import pytest
from fmpy.util import read_csv

from command import run_script
from optional_parts import is_there
from repository_paths import ROOT

sys.path.insert(0, str(ROOT / "tools"))

import importers

PARTS = {"ecos": "ecos", "libcosim": "libcosim", "FMU Manipulation Toolbox": "fmutool"}  # names in optional_parts


@pytest.mark.long
def test_the_importers_that_are_here_agree(tmp_path: Path) -> None:
    """Its cells are the largest deviation, over that of the output: below 1e-9; in contact and out of it."""
    answer = run_script(ROOT / "tools" / "compatibility.py", "-o", tmp_path / "made")
    assert answer.status == 0, answer.out + answer.err
    lines = re.findall(r"^\| (.+) \|$", (tmp_path / "made" / "README.md").read_text(encoding="utf-8"), re.MULTILINE)
    rows = [line.split(" | ") for line in lines[2:]]
    rows = [row for row in rows if len(row) == len(lines[0].split(" | "))]
    assert [[row[0], row[2]] for row in rows] == [
        [importer.name, version] for importer in importers.IMPORTERS for version in ("2.0", "3.0")
    ]
    for name, _, fmi, *cells, _ in rows:
        is_missing = name in PARTS and not is_there(PARTS[name])
        expected = r"not tried here.*" if is_missing else r"0|\d\.\de-1\d"
        if name == "libcosim" and fmi == "3.0" and not is_missing:
            expected = r"– \(no FMI 3\.0\)"
        assert all(re.fullmatch(expected, cell) for cell in cells), (name, cells)
    for results in (tmp_path / "made").glob("*/*/*_ref.csv"):
        assert np.ptp(read_csv(results)["contact"]) == 1
