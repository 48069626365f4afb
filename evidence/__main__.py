"""Runs parts of the evidence, keeps their results, and checks that the pages say what was measured.

    python -m evidence --list
    python -m evidence fit.paper logs.faults -o FOLDER [--workers N] [--keep]
    python -m evidence --check

A part prints one JSON: its figures, command, commit, processor and seconds of processor time. It works in FOLDER/PART,
and a second call goes on there. With --keep the JSON becomes evidence/results/PART.json, and the marked blocks of
docs/evidence are written from it. --check fails where a headline figure left the interval that its part states, where a
result is missing, and where a block is not what the result gives.
"""

from __future__ import annotations

import argparse
import importlib
import json
import os
import pkgutil
import platform
import re
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import evidence
from evidence import table
from evidence.cases import ROOT, is_there, plain, say, write
from evidence.part import Figures, Part

RESULTS = ROOT / "evidence" / "results"
PAGES = ROOT / "docs" / "evidence"

Result = dict[str, Any]


def all_parts() -> dict[str, Part]:
    """By QUESTION.NAME."""
    names = [module.name for module in pkgutil.iter_modules(evidence.__path__) if module.name != "__main__"]
    parts = {name: getattr(importlib.import_module(f"evidence.{name}"), "PARTS", {}) for name in names}
    return {f"{question}.{name}": part for question, own in parts.items() for name, part in own.items()}


def measure(name: str, part: Part, folder: Path, workers: int) -> Result:
    work = folder / name
    work.mkdir(parents=True, exist_ok=True)
    before = _processor_time()
    figures = plain(part.run(work, workers))
    return {
        "part": name,
        "figures": figures,
        "command": f"python -m evidence {name} -o FOLDER",
        "commit": _commit(),
        "processor": _processor(),
        "seconds": round(_processor_time() - before, 1),
    }


def _processor_time() -> float:
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system


def _commit() -> str:
    """With -dirty where anything but results and pages differs from it."""
    head = ["git", "rev-parse", "--short=12", "HEAD"]
    changed = ["git", "status", "--porcelain", "--untracked-files=no", "--", ".", ":!evidence/results", ":!docs"]
    commit, changes = (
        subprocess.run(c, cwd=ROOT, capture_output=True, text=True).stdout.strip() for c in (head, changed)
    )
    return f"{commit}-dirty" if changes else commit


def _processor() -> str:
    known = Path("/proc/cpuinfo")
    names = re.findall(r"model name\s*: (.+)", known.read_text(encoding="utf-8")) if known.is_file() else []
    return f"{next(iter(names), platform.machine())}, {os.cpu_count()} cores"


def keep(result: Result, part: Part, results: Path = RESULTS, pages: Path = PAGES) -> None:
    """Store the result, and write its tables into its page."""
    write(results / f"{result['part']}.json", as_text(result))
    page = _page_of(result["part"], pages)
    if page.is_file():
        texts = {name: make(result["figures"]) for name, make in part.tables.items()}
        write(page, table.with_blocks(page.read_text(encoding="utf-8"), result["part"], texts))


def as_text(result: Result) -> str:
    """JSON whose innermost lists stand on one line each."""
    text = json.dumps(result, indent=1, ensure_ascii=False) + "\n"
    return re.sub(r"\[\n[^\[\]{}]*\n\s*\]", lambda match: re.sub(r"\n\s*", " ", match[0]), text)


def _page_of(name: str, pages: Path) -> Path:
    return pages / f"{name.split('.')[0]}.md"


def faults(parts: Mapping[str, Part], results: Path = RESULTS, pages: Path = PAGES) -> list[str]:
    """What is wrong with results and pages, a line each."""
    lines: list[str] = []
    blocks: dict[tuple[str, str], str] = {}
    for page in pages.glob("*.md"):
        blocks |= table.blocks(page.read_text(encoding="utf-8"))
    for name, part in parts.items():
        file = results / f"{name}.json"
        if not file.is_file():
            lines.append(f"{name}: no result {file.name}; run it with --keep")
            continue
        own = {block: text for (of, block), text in blocks.items() if of == name}
        try:
            lines += _faults_of(name, part, json.loads(file.read_text(encoding="utf-8"))["figures"], own)
        except (KeyError, IndexError) as missing:
            lines.append(f"{name}: {file.name} has no {missing}")
    return lines + [
        f"{name}: no such part, but a page has its block {block}" for name, block in blocks if name not in parts
    ]


def _faults_of(name: str, part: Part, figures: Figures, blocks: Mapping[str, str]) -> list[str]:
    lines = []
    for path, (low, high) in part.headlines.items():
        value = table.at(figures, path)
        if value is None or not low <= value <= high:
            lines.append(f"{name}: {path} is {value}; the page states {low:g} to {high:g}")
    for block, make in part.tables.items():
        if blocks.get(block) != make(figures):
            lines.append(f"{name}: the block {block} of the page is not what the result gives")
    return lines + [
        f"{name}: the page has a block {block}, which is no table" for block in blocks if block not in part.tables
    ]


def listing(parts: Mapping[str, Part]) -> str:
    """A line for each part: its time of one core, and what it needs."""
    lines = []
    for name, part in parts.items():
        time = "time not measured" if part.minutes is None else f"{part.minutes:g} min"
        needs = [need if is_there(need) else f"{need} (MISSING)" for need in part.needs]
        lines.append(f"{name:28} {time:18} {', '.join(needs)}".rstrip())
    return "\n".join(lines)


def main() -> int:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("parts", nargs="*", metavar="PART")
    options.add_argument("-o", "--output", type=Path, metavar="FOLDER", help="of everything that parts write")
    options.add_argument("--workers", type=int, default=1, help="processes that run cases")
    options.add_argument("--keep", action="store_true", help="store results, and write the pages' blocks")
    options.add_argument("--list", action="store_true", help="names, minutes of one core, and needs")
    options.add_argument("--check", action="store_true", help="compare results with headlines and pages")
    given = options.parse_args()
    parts = all_parts()
    if given.list:
        print(listing(parts))
        return 0
    if given.check:
        lines = faults(parts)
        print("\n".join(lines) or f"{len(parts)} parts: results, headlines and pages agree")
        return 1 if lines else 0
    if unknown := set(given.parts) - set(parts):
        options.error(f"{min(unknown)}: no such part; --list has the names")
    if not given.parts or given.output is None:
        options.error("expected PART and -o FOLDER, --list or --check")
    for name in given.parts:
        if missing := [need for need in parts[name].needs if not is_there(need)]:
            say(f"SKIPPED: {name}: needs {', '.join(missing)}, which is not there")
            continue
        result = measure(name, parts[name], given.output.resolve(), given.workers)
        if given.keep:
            keep(result, parts[name])
        print(as_text(result), end="")
    return 0


if __name__ == "__main__":
    sys.exit(main())
