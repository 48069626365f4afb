"""The documentation site: every page is in its menu, and the C reference has every declaration of the headers."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest

from repository_paths import ROOT

DOCS = ROOT / "docs"
sys.path.append(str(ROOT / "tools"))

from c_reference import header_markdown  # noqa: E402

HEADERS = sorted((ROOT / "runtime" / "include").glob("*.h"))


def test_every_page_is_in_the_menu() -> None:
    menu = set(re.findall(r"[\w/]+\.md", (ROOT / "mkdocs.yml").read_text(encoding="utf-8")))
    pages = {path.relative_to(DOCS).as_posix() for path in DOCS.rglob("*.md")}
    assert menu == pages | {f"notebooks/{path.stem}.md" for path in (ROOT / "examples/notebooks").glob("*.ipynb")}


@pytest.mark.parametrize("header", HEADERS, ids=lambda header: header.stem)
def test_the_c_reference_has_every_declaration(header: Path) -> None:
    code = re.sub(r"/\*.*?\*/", "", header.read_text(encoding="utf-8"), flags=re.DOTALL)
    names = set(re.findall(r"\b(tendonfmu_\w+)\(", code)) | set(re.findall(r"^} (\w+);", code, re.MULTILINE))
    text = header_markdown(header)
    shown = "".join(re.findall(r"```c\n(.*?)```", text, re.DOTALL))
    assert names
    assert {name for name in names if name not in shown} == set()
    headings = re.findall(r"^#### `(\w+)`", text, re.MULTILINE)
    assert len(set(headings)) == len(headings)


def test_the_page_has_every_call_of_the_cpp_interface() -> None:
    header = (ROOT / "runtime" / "include" / "tendonfmu.hpp").read_text(encoding="utf-8")
    page = (DOCS / "reference" / "c.md").read_text(encoding="utf-8")
    public = header[header.index("class finger {") :].split(" private:")[0]
    calls = set(re.findall(r"^  (?! )(?:static |const )*[\w:<>]+[ *]+(\w+)\(", public, re.MULTILINE)) - {"finger"}
    assert {"step", "get_outputs", "last_error", "handle", "place"} <= calls
    assert {name for name in calls if not re.search(rf"`(finger::)?{name}\(", page)} == set()
    assert all(f"`{path.name}`" in page for path in (ROOT / "runtime" / "include").glob("*.hpp"))
