"""Which commands make which table of docs/evidence/: read from the pages themselves.

A table is made by the shell block (```sh) of its section: the nearest one above it, else the first one below; a section
is what a heading of the second level holds. A section without one says "By the commands of [Heading](#heading)"; else
the block before the first such heading counts. The first line of a block is a comment with its time and needs:

    # 20 min of one core; needs requirements-foreign.lock, ../shared/data
    # time not measured
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from evidence.runner import ROOT

RUNNER = "python -m evidence -o"
UNITS = {"s": 1.0 / 60.0, "min": 1.0, "h": 60.0}

_KNOWN = re.compile(r"# (?:(?P<time>[\d.]+) (?P<unit>s|min|h) of one core|time not measured)(?:; needs (?P<needs>.+))?")
_HEADING = re.compile(r"(?P<level>#+) (?P<text>.+)")
_ELSEWHERE = re.compile(r"[Bb]y the commands of \[(?P<heading>[^\]]+)\]\(#")
_RULE = re.compile(r"\|[\s:|-]+\|")


@dataclass(frozen=True)
class Block:
    """Commands of a page."""

    name: str  # of the file that its tables go to
    page: Path
    section: str
    line: int  # from 0
    commands: str
    known: bool  # time and needs are said
    minutes: float | None  # of one core; None: not measured
    needs: tuple[str, ...]  # what has to be installed or there


@dataclass(frozen=True)
class TableAt:
    """A table of a page."""

    page: Path
    line: int  # from 0
    maker: Block | None  # its block, None: there is none


@dataclass(frozen=True)
class _Section:
    heading: str  # of the second level, "" before the first one
    first: int
    end: int


def pages(root: Path = ROOT) -> list[Path]:
    every = sorted((root / "docs" / "evidence").glob("*.md"))
    return [page for page in every if page.name != "README.md"]  # README.md is the index


def blocks_of(page: Path) -> list[Block]:
    """All blocks of shell commands, without those that make all tables."""
    lines = page.read_text(encoding="utf-8").splitlines()
    blocks: list[Block] = []
    heading, begin = "", None
    for number, line in enumerate(lines):
        if begin is None and (match := _HEADING.fullmatch(line)):
            heading = match["text"] if len(match["level"]) > 1 else ""
        elif line == "```sh":
            begin = number + 1
        elif line == "```" and begin is not None:
            commands = "\n".join(lines[begin:number])
            if RUNNER not in commands:
                blocks.append(_block(page, heading, begin, commands))
            begin = None
    return blocks


def _block(page: Path, heading: str, line: int, commands: str) -> Block:
    known = _KNOWN.fullmatch(commands.splitlines()[0])
    short = re.sub(r"\W+", "_", re.split(r"[:,]", heading)[0].lower())
    return Block(
        name="_".join(part for part in (page.stem, short.strip("_")) if part),
        page=page,
        section=heading,
        line=line,
        commands=commands,
        known=known is not None,
        minutes=float(known["time"]) * UNITS[known["unit"]] if known and known["time"] else None,
        needs=tuple(known["needs"].split(", ")) if known and known["needs"] else (),
    )


def tables_of(page: Path) -> list[TableAt]:
    lines = page.read_text(encoding="utf-8").splitlines()
    blocks, sections = blocks_of(page), list(_sections(lines))
    rules = [number for number, line in enumerate(lines) if _RULE.fullmatch(line) and number and lines[number - 1]]
    return [TableAt(page, number, _maker(number, lines, blocks, sections)) for number in rules]


def _sections(lines: list[str]) -> Iterator[_Section]:
    starts = [number for number, line in enumerate(lines) if line.startswith("## ")]
    for first, end in zip([0, *starts], [*starts, len(lines)], strict=True):
        yield _Section(lines[first].removeprefix("## ") if first else "", first, end)


def _maker(line: int, lines: list[str], blocks: list[Block], sections: list[_Section]) -> Block | None:
    own = next(section for section in sections if section.first <= line < section.end)
    here = _inside(own, blocks)
    above = [block for block in here if block.line < line]
    if here:
        return above[-1] if above else here[0]
    named = _ELSEWHERE.search("\n".join(lines[own.first : own.end]))
    wanted = named["heading"] if named else ""
    there = [block for section in sections if section.heading == wanted for block in _inside(section, blocks)]
    return there[0] if there else None


def _inside(section: _Section, blocks: list[Block]) -> list[Block]:
    return [block for block in blocks if section.first <= block.line < section.end]
