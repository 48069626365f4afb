"""docs/reference/paper.md: its figures are drawn by its command, and its numbers are what comes out."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from plant_rigs import needs_plant
from repository_paths import ROOT

PAGE = (ROOT / "docs" / "reference" / "paper.md").read_text(encoding="utf-8")

from evidence.fit import paper_figures  # noqa: E402


def numbers_of(text: str) -> list[float]:
    return [float(number) for number in re.findall(r"(?<![\w(])-?\d+(?:\.\d+)?(?:e-?\d+)?", text)]


def test_figures_2b_and_5_are_those_of_the_formulas(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    paper_figures.figure_2b(tmp_path)
    paper_figures.figure_5(tmp_path)
    rows = [line.strip("| ").split(" | ") for line in capsys.readouterr().out.splitlines()]
    assert float(rows[0][2]) < 1e-15
    assert max(numbers_of(rows[1][2])) < 1e-3  # coming to rest
    for row in rows[2:]:
        found, expected = numbers_of(row[2].replace("by eq.", ""))
        assert found == pytest.approx(expected, abs=1e-6)
    assert {path.name for path in tmp_path.iterdir()} == {"paper_2b.png", "paper_5.png"}


@needs_plant
@pytest.mark.long
def test_the_page_has_the_numbers_of_the_command(tmp_path: Path) -> None:
    """Rounded as on the page: within 3 %."""
    command = [sys.executable, "-m", "evidence.fit.paper_figures", "-o", str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, check=True, cwd=ROOT)
    rows = [line.strip("| ").split(" | ") for line in done.stdout.splitlines()]
    found = [numbers_of(re.sub(r"\(.*?\)", "", row[2])) for row in rows if row[0] in ("6", "7")]
    shown = [
        numbers_of(re.sub(r"\(.*?\)", "", line))[-3:] for line in re.findall(r"^\| [14]0 N, .*$", PAGE, re.MULTILINE)
    ]
    assert len(found) == len(shown) == 4
    for measured, printed in zip(found, shown, strict=True):
        assert measured == pytest.approx(printed, rel=0.03)
    errors = [numbers_of(row[2]) for row in rows if row[0] == "8" and "error" in row[1]]
    lines = re.findall(r"^\| (?:fitted|calibrated).*? \| (.*?) \|", PAGE, re.MULTILINE)
    for measured, printed in zip(errors, map(numbers_of, lines), strict=True):
        assert measured == pytest.approx(printed, rel=0.03)
