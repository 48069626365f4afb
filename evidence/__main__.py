"""Makes every table of docs/evidence/ again: python -m evidence -o FOLDER

The commands are the shell blocks (```sh) of the pages, run as they stand there. What each prints and writes as Markdown
goes to FOLDER/NAME.md, what else it says to FOLDER/NAME.log, its files to FOLDER/work. A table whose file is there is
not made again. Tables that need recordings of ../shared, or packages, that are not there are skipped, and it says so.
The first line of a block is a comment with its time and needs:

    # 20 min of one core; needs requirements-foreign.lock, ../shared/data
    # time not measured

    python -m evidence --list
    python -m evidence -o FOLDER --only recalibration emps --again

Exit status: 0 all made or skipped, 1 a command failed.
"""

from __future__ import annotations

import importlib.util
import itertools
import os
import re
import resource
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from evidence.runner import ROOT, parser, say, write

PACKAGES = {
    "requirements-foreign.lock": ("mujoco",),
}
LINKED = ("evidence", "docs", "examples", "python_tests")  # that commands of the pages name
RUNNER = "python -m evidence -o"
UNITS = {"s": 1.0 / 60.0, "min": 1.0, "h": 60.0}

_KNOWN = re.compile(r"# (?:(?P<time>[\d.]+) (?P<unit>s|min|h) of one core|time not measured)(?:; needs (?P<needs>.+))?")
_HEADING = re.compile(r"(?P<level>#+) (?P<text>.+)")


# --- the shell blocks of the pages ------------------------------------------------------------------------------------


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


def pages() -> list[Path]:
    every = sorted((ROOT / "docs" / "evidence").glob("*.md"))
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


# --- running them -----------------------------------------------------------------------------------------------------


def shared_folder() -> Path | None:
    """The folder with `data` and `foreign`: beside the repository, or that of $TENDONFMU_DATA."""
    given = os.environ.get("TENDONFMU_DATA")
    places = [Path(given).resolve().parent] if given else []
    return next((place for place in (*places, ROOT.parent / "shared") if place.is_dir()), None)


def missing(block: Block, shared: Path | None) -> list[str]:
    """What the block needs and is not there."""

    def is_there(need: str) -> bool:
        if need in PACKAGES:
            return all(importlib.util.find_spec(name) for name in PACKAGES[need])
        return shared is not None and (shared / need.removeprefix("../shared/")).is_dir()

    return [need for need in block.needs if not is_there(need)]


def work_folder(folder: Path, block: Block, shared: Path | None) -> Path:
    """Where the block's commands run: what they name by relative paths is linked."""
    work = folder / "work" / block.page.stem
    work.mkdir(parents=True, exist_ok=True)
    links = {work / name: ROOT / name for name in LINKED}
    if shared is not None:
        links[work.parent / "shared"] = shared
    for link, target in links.items():
        if not link.exists():
            link.symlink_to(target, target_is_directory=True)
    return work


def run(block: Block, folder: Path, shared: Path | None) -> str | None:
    """Runs the block's commands, writes NAME.md and NAME.log, returns the time it took. None: a command failed."""
    work = work_folder(folder, block, shared)
    programs = (
        f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"  # `python` and `tendonfmu` of this Python
    )
    environment = os.environ | {"PATH": programs, "COLUMNS": "200"}
    if shared is not None:
        environment |= {"TENDONFMU_DATA": str(shared / "data")}
    began, clock, before = time.time(), time.monotonic(), resource.getrusage(resource.RUSAGE_CHILDREN)
    log = folder / f"{block.name}.log"
    with log.open("w", encoding="utf-8") as messages:
        ended = subprocess.run(
            ["bash", "-euo", "pipefail", "-c", block.commands],
            cwd=work, env=environment, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=messages, text=True,
        )  # fmt: skip
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    processor = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    took = f"{spoken(time.monotonic() - clock)}, processor time {spoken(processor)}"
    if ended.returncode:
        with log.open("a", encoding="utf-8") as messages:
            messages.write(f"{ended.stdout}\nended with status {ended.returncode}\n")
        return None
    # the tables that they wrote; where they wrote none, what they printed
    written = [path for path in sorted(work.glob("**/*.md")) if path.stat().st_mtime >= began - 1.0]
    texts = [path.read_text(encoding="utf-8").strip() for path in written] or [as_markdown(ended.stdout)]
    head = f"# {block.section or block.page.stem}\n\n```sh\n{block.commands}\n```\n\n{took}"
    write(folder / f"{block.name}.md", "\n\n".join([head, *texts]) + "\n")
    return took


def as_markdown(printed: str) -> str:
    """Tables of Markdown as they are, all else as it was printed."""
    parts = []
    for is_table, lines in itertools.groupby(printed.strip().splitlines(), lambda line: line.startswith("|")):
        text = "\n".join(lines).strip("\n")
        if text:
            parts.append(text if is_table else f"```\n{text}\n```")
    return "\n\n".join(parts)


def make(blocks: Sequence[Block], folder: Path, again: bool) -> int:
    """Makes what is not there, one after another. Returns how many failed."""
    shared = shared_folder()
    failed = 0
    for block in blocks:
        if lacks := missing(block, shared):
            say(f"SKIPPED: {block.name}: needs {', '.join(lacks)}, which is not there")
        elif (folder / f"{block.name}.md").is_file() and not again:
            say(f"{block.name}: there already")
        else:
            say(f"{block.name}: begins; {known_time(block)}")
            took, log = run(block, folder, shared), folder / f"{block.name}.log"
            failed += took is None
            for line in log.read_text(encoding="utf-8", errors="replace").splitlines():
                if "SKIPPED" in line:  # by the command itself
                    say(f"{block.name}: {line}")
            say(f"FAILED: {block.name}: see {log}" if took is None else f"{block.name}: {took}")
    return failed


def known_time(block: Block) -> str:
    return "time not measured" if block.minutes is None else f"{spoken(60.0 * block.minutes)} of one core"


def spoken(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 120.0 else f"{seconds / 60.0:.0f} min"


def listing(blocks: Sequence[Block]) -> str:
    """A line for each block, and the time of all."""
    width = max(len(block.name) for block in blocks)
    lines = []
    for block in blocks:
        needs = f"; needs {', '.join(block.needs)}" if block.needs else ""
        lines.append(f"{block.name:{width}}  {known_time(block)}{needs}  ({block.page.relative_to(ROOT)})")
    unknown = sum(block.minutes is None for block in blocks)
    total = spoken(60.0 * sum(block.minutes or 0.0 for block in blocks))
    return "\n".join([*lines, f"all: {total} of one core, and {unknown} whose time is not measured"])


def main() -> None:
    options = parser(__doc__, output=None)
    options.add_argument("-o", "--output", type=Path, metavar="FOLDER")
    options.add_argument("--only", nargs="+", metavar="NAME", help="only these (--list has the names)")
    options.add_argument("--again", action="store_true", help="make tables that are there once more")
    options.add_argument("--list", action="store_true", help="names, known times and needs")
    given = options.parse_args()
    blocks = [block for page in pages() for block in blocks_of(page)]
    unknown = set(given.only or ()) - {block.name for block in blocks}
    if unknown:
        options.error(f"--only {min(unknown)}: no such table; --list has the names")
    chosen = [block for block in blocks if not given.only or block.name in given.only]
    if given.list:
        print(listing(chosen))
        return
    if given.output is None:
        options.error("-o FOLDER is missing")
    folder = given.output.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    sys.exit(1 if make(chosen, folder, given.again) else 0)


if __name__ == "__main__":
    main()
