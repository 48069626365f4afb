"""Benches resume where they ended, keep one row for each case, and write numbers with their intervals."""

from __future__ import annotations

import ast
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from evidence import tables
from evidence.runner import ROOT, run_cases


def measured(number: int, log: str) -> dict[str, Any]:
    with Path(log).open("a", encoding="utf-8") as file:
        file.write(f"{number}\n")
    if number == 2 and Path(log).read_text(encoding="utf-8").count("2\n") == 1:
        raise ValueError("not yet")
    return {"number": number, "found": np.array([1.0, math.nan]), "nested": {"count": np.int64(number)}}


def test_a_case_with_a_row_is_not_run_again_and_a_failed_one_is(tmp_path: Path) -> None:
    log = str(tmp_path / "log")
    cases = {f"case_{number}": (number, log) for number in (1, 2, 3)}
    with pytest.raises(RuntimeError, match="case_2: ValueError: not yet"):
        run_cases(measured, cases, tmp_path)
    rows = run_cases(measured, cases | {"case_4": (4, log)}, tmp_path)
    assert Path(log).read_text(encoding="utf-8").split() == ["1", "2", "3", "2", "4"]
    assert [row["number"] for row in rows] == [1, 2, 3, 4]
    assert rows[0]["found"] == [1.0, None] and rows[0]["nested"] == {"count": 1}
    files = sorted(file.name for file in (tmp_path / "rows").iterdir())
    assert files == [f"case_{number}.json" for number in (1, 2, 3, 4)]


@pytest.mark.long
@pytest.mark.slow
def test_the_same_rows_come_from_workers(tmp_path: Path) -> None:
    cases = {f"case_{number}": (number, 10) for number in (20, 30)}
    rows = run_cases(divmod_row, cases, tmp_path, workers=2)
    assert [(row["quotient"], row["rest"]) for row in rows] == [(2, 0), (3, 0)]


def divmod_row(number: int, by: int) -> dict[str, int]:
    quotient, rest = divmod(number, by)
    return {"quotient": quotient, "rest": rest}


def test_cells_have_their_intervals() -> None:
    assert tables.count([True, False, True], with_interval=True) == "2/3 (9 to 99 %)"
    assert tables.percent([]) == tables.count([]) == tables.median([None, math.nan]) == tables.NOTHING
    assert tables.events(0, 10.0) == "0.0 (0.0 to 0.4)"
    assert tables.median([1.0, None, 3.0, 2.0]) == "2.00"


def test_a_table_has_a_line_for_each_group_and_a_cell_for_each_column() -> None:
    rows = [{"finger": name, "size": size, "found": size > 1} for name in ("a", "b") for size in (1.0, 2.0)]
    lines = tables.by(rows, ["finger"], lambda own: [tables.count(row["found"] for row in own)])
    assert lines == [["a", "1/2"], ["b", "1/2"]]
    names = {name: tables.equal(finger=name) for name in ("a", "c")}
    sizes = {"small": tables.equal(size=1.0), "large": tables.equal(size=2.0)}
    text = tables.crossed(rows, names, sizes, lambda own: tables.count(row["found"] for row in own))
    assert text.splitlines()[0] == "|  | small | large |"
    assert text.splitlines()[2:] == ["| a | 0/1 | 1/1 |", "| c | – | – |"]
    assert tables.table(["x", "y"], [["1", 2]], 1).splitlines()[1] == "| --- | ---: |"
    assert json.dumps(tables.values_of(rows, "finger")) == '["a", "b"]'


def test_evidence_imports_nothing_of_the_tests() -> None:
    tests = {"python_tests", *(file.stem for file in (ROOT / "python_tests").rglob("*.py"))}
    for file in (ROOT / "evidence").rglob("*.py"):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            assert not tests & {name.split(".")[0] for name in names}, file
