"""examples/notebooks: they run, and show what their texts claim."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import nbformat
import pytest

from repository_paths import ROOT

NOTEBOOKS = sorted((ROOT / "examples" / "notebooks").glob("*.ipynb"))
FIGURE = "application/vnd.plotly.v1+json"


def outputs_of(notebook: Any) -> dict[str, list[Any]]:
    return {cell["id"]: cell["outputs"] for cell in notebook["cells"] if cell["cell_type"] == "code"}


def figures_of(outputs: list[Any]) -> list[Any]:
    return [each["data"][FIGURE] for each in outputs if FIGURE in each.get("data", {})]


def table_of(outputs: list[Any]) -> dict[str, list[str]]:
    """Cells of the table of a DataFrame by the name of the row."""
    page = next(each["data"]["text/html"] for each in outputs if "text/html" in each.get("data", {}))
    rows = re.findall(r"<tr>\s*<th>(.*?)</th>(.*?)</tr>", page, re.DOTALL)
    return {name: re.findall(r"<td>(.*?)</td>", cells) for name, cells in rows if "<td>" in cells}


def printed(outputs: list[Any]) -> str:
    return "".join(each["text"] for each in outputs if each.get("name") == "stdout")


def run_notebook(file: Path, folder: Path) -> Any:
    """The notebook with its outputs; what it writes is in folder/notebooks."""
    notebook = folder / "notebooks" / file.name
    notebook.parent.mkdir()
    shutil.copy(file, notebook)
    for name in ("demo_recording", "fingers"):
        (folder / name).symlink_to(ROOT / "examples" / name, target_is_directory=True)
    program = Path(sys.executable).with_name("jupyter")
    settings = {**os.environ, "PLOTLY_RENDERER": "plotly_mimetype"}
    subprocess.run([program, "execute", "--inplace", "--timeout=600", notebook], env=settings, check=True)
    return nbformat.read(notebook, as_version=4)


@pytest.mark.long
def test_run_and_fit(tmp_path: Path) -> None:
    found = outputs_of(run_notebook(NOTEBOOKS[0], tmp_path))
    assert "<svg" in found["finger"][0]["data"]["text/html"]
    assert {trace["name"] for trace in figures_of(found["run"])[0]["data"]} == {"pulled", "friction", "compensated"}
    parameters = table_of(found["parameters"])
    assert len(parameters) == 16 and 1 <= sum(row[-1] == "True" for row in parameters.values()) < 8  # "few"
    assert len(figures_of(found["plot"])) == 1
    for no_model, given, fitted in table_of(found["unseen"]).values():
        assert float(fitted) < 0.95 * float(given) < 0.15 * float(no_model)
    assert (tmp_path / "notebooks" / "two_joints_fitted.fmu").is_file()


@pytest.mark.long
def test_diagnose_and_extend(tmp_path: Path) -> None:
    found = outputs_of(run_notebook(NOTEBOOKS[1], tmp_path))
    hidden = table_of(found["truth"])
    size = re.search(r"weight at joint (\d): ([\d.]+)\s*mN·m", printed(found["causes"]))
    assert size and hidden["joint"] == [size[1]] and hidden["effect"] == ["gravity"]
    # 2 %: ten standard errors of the fitted weight
    assert float(size[2]) == pytest.approx(1000 * float(hidden["magnitude"][0]), rel=0.02)
    gains = {name: [float(each) for each in row] for name, row in table_of(found["causes"]).items()}
    assert list(gains) == ["gravity", "unknown", "all"] and gains["all"][0] > gains["all"][1] > 0.2
    assert len(figures_of(found["plot"])) == 1
    for given, fitted, extended in table_of(found["extend"]).values():
        assert float(extended) < 0.8 * float(fitted) < 0.8 * float(given)
    assert (tmp_path / "notebooks" / "diagnosis" / "diagnosis.html").is_file()


@pytest.mark.long
def test_detect_and_tune(tmp_path: Path) -> None:
    found = outputs_of(run_notebook(NOTEBOOKS[2], tmp_path))
    assert len(figures_of(found["plot"])[0]["layout"]["shapes"]) >= 4 * 2 * 11
    assert any(
        re.search(r"6 false alarms an hour .* record [\d.]+ min more", each.get("text", "")) for each in found["tune"]
    )
    rows = table_of(found["compare"])
    assert [row[0] for row in rows.values()] == ["8 of 11", "11 of 11", "11 of 11"]
    delays = [int(row[2].split()[0]) for row in rows.values()]
    assert delays[1] <= delays[2] < delays[0]
    text = printed(found["live"])
    assert re.search(r"contact at 9\.\d+ s", text) and text.count("mN·m") == 4
