"""The documentation: code cites pages and sections that exist, links lead to files."""

from __future__ import annotations

import re
import subprocess
from functools import cache
from pathlib import Path
from typing import Any

import typer

from optional_parts import require
from repository_paths import ROOT
from tendonfmu.commands.program import app
from tendonfmu.diagnosis.effects.table import MECHANISMS

SOURCES = re.compile(r"^(runtime|fmu_src|python)/.*\.(c|h|cpp|hpp|py|json)$")
CITED = re.compile(r"(docs/[\w/]+\.md)(?:#([\w-]+))?")


@cache
def tracked() -> list[str]:
    require("git")
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=False)
    return [name for name in listed.stdout.splitlines() if (ROOT / name).is_file()]


@cache
def anchors(page: str) -> set[str]:
    """Of the headings, as GitHub and MkDocs make them."""
    text = re.sub(r"```.*?```", "", (ROOT / page).read_text(encoding="utf-8"), flags=re.DOTALL)
    headings = re.findall(r"^#+ (.*)$", text, flags=re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def test_every_page_and_section_that_code_cites_is_there() -> None:
    cited = {match for name in tracked() if SOURCES.match(name) for match in CITED.findall((ROOT / name).read_text())}
    assert len(cited) > 20
    missing = [
        page for page, anchor in cited if not (ROOT / page).is_file() or (anchor and anchor not in anchors(page))
    ]
    assert missing == []


def test_links_lead_to_files_that_git_knows() -> None:
    known = {Path(name) for name in tracked()}
    known |= {parent for name in known for parent in name.parents}
    for page in (ROOT / name for name in tracked() if re.match(r"(README|docs/.*|examples/.*)\.md$", name)):
        for target in re.findall(r"\]\(([^)#\s]+)[^)]*\)", page.read_text(encoding="utf-8")):
            if "://" not in target:
                path = (page.parent / target).resolve().relative_to(ROOT)
                assert path in known, f"{page.relative_to(ROOT)}: {target}"


def test_every_option_and_every_effect_is_in_the_reference() -> None:
    pages = "".join(path.read_text("utf-8") for path in (ROOT / "docs" / "reference" / "commands").glob("*.md"))
    group: Any = typer.main.get_command(app)
    commands = [group.get_command(None, name) for name in group.commands]
    options = {option for command in commands for each in command.params for option in each.opts}
    named = set(re.findall(r"(?<![\w-])--?[a-z][\w-]*", pages))
    assert {option for option in options if option.startswith("-")} - named == set()
    assert [each.name for each in MECHANISMS if f"| `{each.name}` | {each.title} |" not in pages] == []
