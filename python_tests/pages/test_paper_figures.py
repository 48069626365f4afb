"""docs/reference/paper.md: figures 2b and 5 are those of the formulas."""

from __future__ import annotations

from pathlib import Path

import pytest

from evidence.fit import paper_figures


def test_figures_2b_and_5_are_those_of_the_formulas(tmp_path: Path) -> None:
    assert paper_figures.figure_2b(tmp_path)["largest_difference"] < 1e-15
    found = paper_figures.figure_5(tmp_path)
    assert max(found["steps_to_rest"]) < 1e-3
    for reversal in ("fast", "with_rest"):
        assert found[reversal]["change"] == pytest.approx(found[reversal]["formula"], abs=1e-6)
