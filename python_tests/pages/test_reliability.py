"""bench/reliability.py: the rows that the page has, what is kept, and that a row that fails is said."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from repository_paths import ROOT

pytest.importorskip("tendonfmu._native", reason="SKIPPED: tendonfmu is not installed")
sys.path.append(str(ROOT / "bench"))

import reliability
from reliability_rows.row import Outcome, Run

PAGE = ROOT / "docs" / "evidence" / "reliability.md"


def use(monkeypatch: pytest.MonkeyPatch, measure: Callable[[Run], Outcome], work: Path, *words: str) -> int:
    monkeypatch.setattr(reliability, "ROWS", {"R2": replace(reliability.ROWS["R2"], measure=measure)})
    monkeypatch.setattr(sys, "argv", ["reliability.py", "--work", str(work), *words])
    return reliability.main()


def test_the_rows_are_those_of_the_page() -> None:
    assert list(reliability.ROWS) == [f"R{k}" for k in range(1, 21)]
    assert re.findall(r"^\| (R\d+) \|(?:[^|\n]*\|){6}$", PAGE.read_text(encoding="utf-8"), re.MULTILINE) == list(
        reliability.ROWS
    )


def test_a_result_is_kept(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scales: list[float] = []

    def measure(run: Run) -> Outcome:
        scales.append(run.scale)
        return Outcome(f"{run.count(1000)} things", "all well", True)

    assert use(monkeypatch, measure, tmp_path, "--scale", "0.1") == 0
    assert use(monkeypatch, measure, tmp_path) == 0 and scales == [0.1]
    assert "| R2 | Time and step length | 100 things | 420 pairs | all well |" in capsys.readouterr().out
    assert use(monkeypatch, measure, tmp_path, "R2") == 0 and scales == [0.1, 1.0]


def test_full_numbers_and_what_is_left_open_are_those_of_the_page() -> None:
    lines = [line.strip("| ").split(" | ") for line in PAGE.read_text(encoding="utf-8").splitlines()]
    rows = {cells[0]: cells for cells in lines if len(cells) == 7}
    for name, row in reliability.ROWS.items():
        assert (rows[name][1], rows[name][3], rows[name][6]) == (row.title, row.full, row.leaves)


@pytest.mark.parametrize("finding", [Outcome("1", "half a file", False), ValueError("lost\ncount")])
def test_a_finding_and_an_error_are_said(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str], finding: Outcome | ValueError
) -> None:
    def measure(run: Run) -> Outcome:
        if isinstance(finding, ValueError):
            raise finding
        return finding

    assert use(monkeypatch, measure, tmp_path) == 1
    said = "half a file" if isinstance(finding, Outcome) else "NOT MEASURED: ValueError: lost count"
    assert f"**found:** {said}" in capsys.readouterr().out
