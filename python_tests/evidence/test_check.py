"""`python -m evidence --check`: what fails, and that the results and pages of the repository pass."""

from __future__ import annotations

from pathlib import Path

import pytest

from evidence import table
from evidence.__main__ import all_parts, faults, keep, measure
from evidence.part import Part

PARTS = {
    "jaw.fit": Part(
        run=lambda folder, workers: {"error": 1.5, "lines": [["a", "1"], ["b", "2"]]},
        headlines={"error": (1.0, 2.0)},
        tables={"errors": table.of_cells("lines", ["run", "error"])},
    )
}
PAGE = "# Jaw\n\n<!-- jaw.fit: errors -->\n<!-- end -->\n\nAnd more.\n"


@pytest.fixture
def kept(tmp_path: Path) -> Path:
    """A result and its page."""
    (tmp_path / "jaw.md").write_text(PAGE, encoding="utf-8")
    keep(measure("jaw.fit", PARTS["jaw.fit"], tmp_path, 1), PARTS["jaw.fit"], tmp_path, tmp_path)
    return tmp_path


def test_what_was_kept_passes(kept: Path) -> None:
    assert "| b | 2 |" in (kept / "jaw.md").read_text(encoding="utf-8")
    assert faults(PARTS, kept, kept) == []


@pytest.mark.parametrize(
    ("file", "old", "new", "fault"),
    [
        ("jaw.fit.json", '"error": 1.5', '"error": 2.5', "jaw.fit: error is 2.5; the page states 1 to 2"),
        ("jaw.fit.json", '"error": 1.5', '"error": null', "jaw.fit: error is None; the page states 1 to 2"),
        ("jaw.fit.json", '"error"', '"other"', "jaw.fit: jaw.fit.json has no 'error'"),
        ("jaw.md", "| b | 2 |", "| b | 3 |", "jaw.fit: the block errors of the page is not what the result gives"),
        ("jaw.md", "jaw.fit: errors", "jaw.arms: errors", "jaw.arms: no such part, but a page has its block errors"),
    ],
)
def test_what_was_changed_fails(kept: Path, file: str, old: str, new: str, fault: str) -> None:
    text = (kept / file).read_text(encoding="utf-8")
    (kept / file).write_text(text.replace(old, new), encoding="utf-8")
    assert text.count(old) == 1 and fault in faults(PARTS, kept, kept)


def test_a_missing_result_fails(kept: Path) -> None:
    (kept / "jaw.fit.json").unlink()
    assert faults(PARTS, kept, kept) == ["jaw.fit: no result jaw.fit.json; run it with --keep"]


def test_results_and_pages_of_the_repository_agree() -> None:
    assert faults(all_parts()) == []
