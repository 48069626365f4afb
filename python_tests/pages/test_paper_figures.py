"""docs/reference/paper.md: figures 2b and 5 are those of the formulas, and the numbers are those of the result."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from evidence.fit import paper_figures
from repository_paths import ROOT

PAGE = (ROOT / "docs" / "reference" / "paper.md").read_text(encoding="utf-8")
RESULT = json.loads((ROOT / "evidence" / "results" / "fit.paper.json").read_text(encoding="utf-8"))["figures"]


def numbers_of(text: str) -> list[float]:
    return [float(number) for number in re.findall(r"(?<![\w(])-?\d+(?:\.\d+)?", text)]


def test_figures_2b_and_5_are_those_of_the_formulas(tmp_path: Path) -> None:
    assert paper_figures.figure_2b(tmp_path)["largest_difference"] < 1e-15
    found = paper_figures.figure_5(tmp_path)
    assert max(found["steps_to_rest"]) < 1e-3
    for reversal in ("fast", "with_rest"):
        assert found[reversal]["change"] == pytest.approx(found[reversal]["formula"], abs=1e-6)


def test_the_page_has_the_numbers_of_the_result() -> None:
    rows = [numbers_of(re.sub(r"\(.*?\)", "", line)) for line in re.findall(r"^\| [14]0 N, .*$", PAGE, re.MULTILINE)]
    found = [
        [RESULT[figure][key][joint] for key in ("torque", "residual", "error")] for figure in "67" for joint in (0, 1)
    ]
    assert [row[-3:] for row in rows] == [pytest.approx(values, rel=0.01) for values in found]
    lines = re.findall(r"^\| (?:fitted|calibrated).*? \| (.*?) \| (\d+) of", PAGE, re.MULTILINE)
    for (errors, reported), name in zip(lines, ("fitted", "calibrated"), strict=True):
        assert numbers_of(errors) == pytest.approx(RESULT["8"][name]["error"], abs=0.06)
        assert int(reported) == RESULT["8"][name]["reported"]
