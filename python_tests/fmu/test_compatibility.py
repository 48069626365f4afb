"""tools/compatibility.py: the files that fmi-standard.org asks for, what importers do with them, and the page of it."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from fmpy.util import read_csv, read_ref_opt_file, validate_result

from command import Answer, run_script
from optional_parts import is_there
from repository_paths import ROOT

sys.path.insert(0, str(ROOT / "tools"))

import compatibility
import importers

TOOL = ROOT / "tools" / "compatibility.py"
PAGE = ROOT / "docs" / "reference" / "compatibility.md"
ROWS = [[importer.name, version] for importer in importers.IMPORTERS for version in ("2.0", "3.0")]
PARTS = {"ecos": "ecos", "libcosim": "libcosim", "FMU Manipulation Toolbox": "fmutool"}  # names in optional_parts
CELL = r"0|\d\.\de-\d\d|– \(.+\)|not tried here.*"


def table_in(text: str) -> list[list[str]]:
    """The first table of a page, without the line below its header."""
    lines = re.findall(r"^\| (.+) \|$", text, re.MULTILINE)
    rows = [line.split(" | ") for line in lines]
    assert rows[1] == ["---"] * len(rows[0])
    return [rows[0], *(row for row in rows[2:] if len(row) == len(rows[0]))]


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Answer]:
    folder = tmp_path_factory.mktemp("compatibility") / "made"
    return folder, run_script(TOOL, "-o", folder, "--finger", "cable_loop")


def test_the_importers_that_are_here_agree(made: tuple[Path, Answer]) -> None:
    folder, answer = made
    assert answer.status == 0, answer.out + answer.err
    header, *rows = table_in((folder / "README.md").read_text(encoding="utf-8"))
    assert header == ["importer", "version", "FMI", "cable_loop", "date"]
    assert [[row[0], row[2]] for row in rows] == ROWS
    for name, version, fmi, cell, date in rows:
        part = PARTS.get(name)
        expected = r"not tried here.*" if part and not is_there(part) else r"0|\d\.\de-1\d"
        if name == "libcosim" and fmi == "3.0" and version:
            expected = r"– \(no FMI 3\.0\)"
        assert re.fullmatch(expected, cell), (name, cell)
        assert re.fullmatch(r"\d{4}-\d\d-\d\d", date)
    assert rows[0][1] == fmpy.__version__


@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_the_files_are_as_fmi_standard_org_asks(made: tuple[Path, Answer], version: str) -> None:
    """Read and compared by fmpy's own functions for the FMI cross-check."""
    folder = made[0] / version / "cable_loop"
    fmu, inputs, results, options = (folder / f"cable_loop{end}" for end in (".fmu", "_in.csv", "_ref.csv", "_ref.opt"))
    assert {file.name for file in folder.iterdir()} == {each.name for each in (fmu, inputs, results, options)} | {
        "README.txt"
    }
    assert f"FMI {version}" in (folder / "README.txt").read_text(encoding="utf-8")
    told = read_ref_opt_file(str(options))
    assert set(told) == {"StartTime", "StopTime", "StepSize", "RelTol", "AbsTol"}
    for file in (inputs, results):
        header, *rows = file.read_text(encoding="utf-8").splitlines()
        assert re.fullmatch(r'"time"(,"[^",]+"){2,9}', header)  # at most 10 variables
        assert all(re.fullmatch(r"[-+.e\d ]+(,[-+.e\d ]+)+", row) for row in rows) and file.stat().st_size < 1_000_000
    signals, reference = read_csv(inputs), read_csv(results)
    variables = {
        each.name: each.causality for each in fmpy.read_model_description(str(fmu), validate=False).modelVariables
    }
    assert {variables[name] for name in signals.dtype.names[1:]} == {"input"}
    assert {variables[name] for name in reference.dtype.names[1:]} == {"output"}
    assert (reference["time"][0], reference["time"][-1]) == (told["StartTime"], told["StopTime"])
    result = fmpy.simulate_fmu(
        str(fmu),
        validate=False,
        input=signals,
        output=reference.dtype.names[1:],
        stop_time=told["StopTime"],
        output_interval=told["StepSize"],
    )
    if version == "2.0":  # fmpy's comparison takes no arrays
        assert validate_result(result, reference, told["StopTime"]) == 0
    ours, theirs = (importers.flat_rows(rows, reference.dtype.names[1:]) for rows in (result, reference))
    assert (np.abs(ours - theirs).max(0) <= told["RelTol"] * np.abs(theirs).max(0) + told["AbsTol"]).all()
    assert np.ptp(reference["contact"]) == 1


def test_an_importer_that_differs_or_fails_is_told(made: tuple[Path, Answer]) -> None:
    folder = made[0] / "2.0" / "cable_loop"
    results = read_csv(folder / "cable_loop_ref.csv")
    task = importers.Task(folder / "cable_loop.fmu", 2, read_csv(folder / "cable_loop_in.csv"), results.dtype.names[1:])
    right = importers.flat_rows(results, task.outputs)[1:]

    def cell(run: Any, package: str = "fmpy") -> tuple[str, bool]:
        return compatibility.try_importer(importers.Importer("one", package, run), task)

    def missing(_: importers.Task) -> Any:
        raise OSError("libtbb.so.12: cannot be opened")

    assert cell(lambda _: right) == ("0", True)
    assert cell(lambda _: right * (1 + 1e-10))[1] and cell(lambda _: right * (1 + 1e-10))[0] == "1.0e-10"
    assert cell(lambda _: right * (1 + 1e-8)) == ("1.0e-08 **differs**", False)
    assert cell(lambda _: right * np.nan) == ("nan **differs**", False)
    assert cell(lambda _: right[1:])[0].startswith("**failed**: ValueError(") and not cell(lambda _: right[1:])[1]
    assert cell(missing) == ("not tried here (libtbb.so.12: cannot be opened)", True)
    assert cell(missing, "no-such-distribution") == ("not tried here", True)


def test_bad_usage_is_named(made: tuple[Path, Answer], tmp_path: Path) -> None:
    (tmp_path / "page.md").write_text("no marks")
    for arguments, message in (
        (("-o", made[0]), "made: exists; expected a new folder"),
        (
            ("-o", tmp_path / "new", "--page", tmp_path / "page.md"),
            "page.md: no <!-- made by tools/compatibility.py -->",
        ),
    ):
        answer = run_script(TOOL, *arguments)
        assert answer.status == 2 and message in answer.err and answer.err.count("\n") == 1
    assert [each.name for each in tmp_path.iterdir()] == ["page.md"]


def test_the_page_has_the_importers_and_fingers_of_the_tool() -> None:
    text = PAGE.read_text(encoding="utf-8")
    header, *rows = table_in(text.partition(compatibility.BEGIN)[2].partition(compatibility.END)[0])
    assert header == ["importer", "version", "FMI", *compatibility.EXAMPLES, "date"]
    assert [[row[0], row[2]] for row in rows] == ROWS
    assert all(re.fullmatch(CELL, cell) for row in rows for cell in row[3:-1])
    assert all(f"- `{name}`: {example.shows}." in text for name, example in compatibility.EXAMPLES.items())


@pytest.mark.long
def test_the_whole_command(tmp_path: Path) -> None:
    """As a release calls it; the page that it fills is that of the documentation but for versions and numbers."""
    page = tmp_path / "page.md"
    page.write_text(PAGE.read_text(encoding="utf-8"), encoding="utf-8")
    answer = run_script(TOOL, "-o", tmp_path / "made", "--page", page)
    assert answer.status == 0, answer.out + answer.err
    header, *rows = table_in(page.read_text(encoding="utf-8"))
    assert [header, *ROWS] == [table_in(PAGE.read_text(encoding="utf-8"))[0], *([row[0], row[2]] for row in rows)]
    assert all(re.fullmatch(CELL, cell) for row in rows for cell in row[3:-1])
    for version in ("2.0", "3.0"):
        assert np.ptp(read_csv(tmp_path / "made" / version / "index_finger" / "index_finger_ref.csv")["contact"]) == 1
