"""The rows of docs/evidence/reliability.md: what is kept, and that a row that fails is said."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from evidence.reliability import __main__ as reliability
from evidence.reliability.row import Outcome, Run, Unavailable


def use(monkeypatch: pytest.MonkeyPatch, measure: Callable[[Run], Outcome], work: Path, *words: str) -> int:
    monkeypatch.setattr(reliability, "ROWS", {"R16": measure})
    monkeypatch.setattr(sys, "argv", ["reliability", "--work", str(work), *words])
    return reliability.main()


def test_every_row_of_the_page_is_measured() -> None:
    head, *names = reliability.rows_of_the_page()
    assert head == "row" and set(reliability.ROWS) == set(names)


def test_a_result_is_kept(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scales: list[float] = []

    def measure(run: Run) -> Outcome:
        scales.append(run.scale)
        return Outcome(f"{run.count(1000)} things", "all well", True)

    assert use(monkeypatch, measure, tmp_path, "--scale", "0.1") == 0
    assert use(monkeypatch, measure, tmp_path) == 0 and scales == [0.1]
    assert "| R16 | Commands that are killed | 100 things | 200 kills | all well |" in capsys.readouterr().out
    assert use(monkeypatch, measure, tmp_path, "R16") == 0 and scales == [0.1, 1.0]


@pytest.mark.parametrize(
    ("outcome", "status", "text"),
    [
        (Outcome("1", "half a file", False), 1, "**found:** half a file"),
        (ValueError("lost\ncount"), 1, "**found:** NOT MEASURED: ValueError: lost count"),
        (Unavailable("no clang++"), 0, "SKIPPED: no clang++"),
    ],
)
def test_a_finding_an_error_and_what_is_missing_are_said(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, outcome: Outcome | Exception, status: int, text: str
) -> None:
    def measure(run: Run) -> Outcome:
        if isinstance(outcome, Exception):
            raise outcome
        return outcome

    assert use(monkeypatch, measure, tmp_path, "-o", str(tmp_path / "table.md")) == status
    assert text in (tmp_path / "table.md").read_text(encoding="utf-8")
    assert json.loads((tmp_path / "R16.json").read_text(encoding="utf-8"))["sound"] == (status == 0)
