"""The table's runs of the command, with a program in its place that writes what a test wants."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

import fingers_in_numpy
import table
from table_text import markdown

REPORT = {
    "verdict": "explained",
    "nominal": {"test_rms": [0.02, 0.01]},
    "extended": {"test_rms": [0.01, 0.005]},
    "gain": {"value": 0.5, "interval": [0.4, 0.6]},
    "causes": [{"effect": "gravity", "joint": 1, "tendon": None, "gain": {"value": 0.5, "interval": [0.4, 0.6]}}],
}
WRITES = f"""
import os, sys
assert sys.argv[1:] == "diagnose finger.json train.parquet --test test.parquet -o report --no-progress".split()
assert all(os.path.getsize(name) > 0 for name in ("finger.json", "train.parquet", "test.parquet"))
spent = sum(k * k for k in range(2_000_000))
os.mkdir("report")
open("report/diagnosis.json", "w").write({json.dumps(REPORT)!r})
"""
FAILS = "import sys\nprint('some words', file=sys.stderr)\nsys.exit('internal error: x | y')"
SLEEPS = "import time\ntime.sleep(60)"


def program(folder: Path, text: str) -> str:
    path = folder / "program"
    path.write_text(f"#!{sys.executable}\n{text}", encoding="utf-8")
    path.chmod(0o755)
    return str(path)


def run_row(text: str, folder: Path, monkeypatch: pytest.MonkeyPatch, limit: float = 60.0) -> dict[str, Any]:
    monkeypatch.setattr(table, "command", lambda: program(folder, text))
    short = SimpleNamespace(make=lambda number: fingers_in_numpy.make(number, 1.0, 0.5))
    return table.row_of(short, 6, folder / "cases", limit)  # type: ignore[arg-type]


def test_a_report_is_judged_and_the_process_measured(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    row = run_row(WRITES, tmp_path, monkeypatch)
    assert row["run"]["exit"] == 0 and row["run"]["cpu_seconds"] > 0.02 and row["run"]["peak_megabytes"] > 3.0
    assert row["judgement"]["first"] and row["judgement"]["false"] == () and row["visible"]
    assert "gravity j1 50 %" in markdown([row], "made")
    assert json.loads(json.dumps(row))["truth"]["hidden"] == "gravity"


def test_a_failure_is_a_row_with_its_message(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    row = run_row(FAILS, tmp_path, monkeypatch)
    assert row["run"]["exit"] == 1 and row["report"] is None and row["judgement"] is None
    assert "internal error: x / y" in markdown([row], "made")


def test_a_run_without_end_is_ended(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    row = run_row(SLEEPS, tmp_path, monkeypatch, limit=0.5)
    assert row["run"]["exit"] is None and row["run"]["message"] == "ended after 0.5 s"


def test_halves_and_numbers() -> None:
    odd, even = (table.numbers(fingers_in_numpy, half, None) for half in ("odd", "even"))
    assert sorted(odd + even) == list(fingers_in_numpy.NUMBERS) and all(number % 2 for number in odd)
    assert table.numbers(fingers_in_numpy, "all", [3, 99]) == [3]


def test_errors_where_nothing_is_hidden_are_by_joint(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    row = run_row(WRITES, tmp_path, monkeypatch)
    assert "nothing hidden" not in markdown([row], "made").splitlines()[-2]
    report = {**row["report"], "nominal": {"test_rms": [0.002, 0.003]}, "extended": {"test_rms": [0.00117, 0.0013]}}
    nothing = {**row, "case": "x_01", "truth": {**row["truth"], "hidden": "none"}, "report": report}
    assert "| x_01 | 2 | 2.00, 3.00 | 1.17, 1.30 |" in markdown([nothing], "made").splitlines()
