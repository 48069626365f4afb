"""tools/compatibility.py, the table of docs/reference/compatibility.md: every importer that is installed agrees."""

from __future__ import annotations

import re
import sys

import pytest

from command import run_script
from optional_parts import is_there
from repository_paths import ROOT

sys.path.insert(0, str(ROOT / "tools"))

import importers

PARTS = {"ecos": "ecos", "libcosim": "libcosim", "FMU Manipulation Toolbox": "fmutool"}  # names in optional_parts


@pytest.mark.long
def test_the_importers_that_are_here_agree() -> None:
    """Its cells are the largest deviation, over that of the output: below 1e-9."""
    answer = run_script(ROOT / "tools" / "compatibility.py")
    assert answer.status == 0, answer.out + answer.err
    rows = [line.split(" | ") for line in re.findall(r"^\| (.+) \|$", answer.out, re.MULTILINE)[2:]]
    assert [[row[0], row[2]] for row in rows] == [
        [importer.name, version] for importer in importers.IMPORTERS for version in ("2.0", "3.0")
    ]
    lacks = {("libcosim", "3.0"): r"– \(no FMI 3\.0\)", ("ecos", "3.0"): r"0|– \(no arrays\)"}
    for name, _, fmi, *cells, _ in rows:
        is_missing = name in PARTS and not is_there(PARTS[name])
        agrees = lacks.get((name, fmi), r"0|\d\.\de-1\d")
        expected = r"not tried here.*" if is_missing else agrees
        assert all(re.fullmatch(expected, cell) for cell in cells), (name, cells)
