"""Makes every table of docs/evidence/ again: python -m evidence -o FOLDER

The commands are those of the pages (pages.py finds them), run as they stand there; their seeds are in them
and in the programs that they call. What each prints and writes as Markdown goes to FOLDER/NAME.md, what else it says to
FOLDER/NAME.log, its files to FOLDER/work. FOLDER/README.md says how long each took. A table whose file is there is not
made again. Tables that need recordings of ../shared, or packages, that are not there are skipped, and it says so.

    python -m evidence --list
    python -m evidence -o FOLDER --only recalibration emps --again

Exit status: 0 all made or skipped, 1 a command failed.
"""

from __future__ import annotations

import importlib.util
import itertools
import json
import os
import resource
import shlex
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from evidence import tables
from evidence.pages import Block, blocks_of, pages
from evidence.runner import ROOT, parser, say, write

PACKAGES = {
    "requirements-foreign.lock": ("mujoco",),
    "requirements-diagnosis-peers.lock": ("pysindy", "knockpy"),
    "requirements-fit-peers.lock": ("filterpy",),
    "requirements-peers.lock": ("pythonfmu",),
}
LINKED = ("evidence", "docs", "examples", "python_tests")  # that commands of the pages name
TIMES = "times.json"


@dataclass(frozen=True)
class Took:
    seconds: float  # of the clock
    cpu_seconds: float  # of all processors


def every_block() -> list[Block]:
    return [block for page in pages() for block in blocks_of(page)]


def shared_folder() -> Path | None:
    """The folder with `data` and `foreign`: beside the repository, or that of $TENDONFMU_DATA."""
    given = os.environ.get("TENDONFMU_DATA")
    places = [Path(given).resolve().parent] if given else []
    return next((place for place in (*places, ROOT.parent / "shared") if place.is_dir()), None)


def missing(block: Block, shared: Path | None) -> list[str]:
    """What the block needs and is not there."""
    return [need for need in block.needs if not _is_there(need, shared)]


def _is_there(need: str, shared: Path | None) -> bool:
    if need in PACKAGES:
        return all(importlib.util.find_spec(name) for name in PACKAGES[need])
    return shared is not None and (shared / need.removeprefix("../shared/")).is_dir()


# --- one block --------------------------------------------------------------------------------------------------------


def work_folder(folder: Path, block: Block, shared: Path | None) -> Path:
    """Where the block's commands run: what they name by relative paths is linked."""
    own = folder / "work" / block.page.stem
    own.mkdir(parents=True, exist_ok=True)
    links = {own / name: ROOT / name for name in LINKED}
    if shared is not None:
        links[own.parent / "shared"] = shared
    for link, target in links.items():
        if not link.exists():
            link.symlink_to(target, target_is_directory=True)
    return own


def programs(folder: Path) -> Path:
    """A folder for the PATH whose `python` and `tendonfmu` are those of this Python."""
    own = folder / "work" / "bin"
    own.mkdir(parents=True, exist_ok=True)
    tendonfmu = "-c 'from tendonfmu.cli import main; main()'"
    for name, arguments in (("python", ""), ("tendonfmu", tendonfmu)):
        program = own / name
        program.write_text(f'#!/bin/sh\nexec {shlex.quote(sys.executable)} {arguments} "$@"\n', encoding="utf-8")
        program.chmod(0o755)
    return own


def run(block: Block, folder: Path, shared: Path | None) -> Took | None:
    """Runs the block's commands and writes NAME.md and NAME.log. None: a command failed."""
    own = work_folder(folder, block, shared)
    environment = os.environ | {"PATH": f"{programs(folder)}{os.pathsep}{os.environ['PATH']}", "COLUMNS": "200"}
    if shared is not None:
        environment |= {"TENDONFMU_DATA": str(shared / "data")}
    began, clock, before = time.time(), time.monotonic(), resource.getrusage(resource.RUSAGE_CHILDREN)
    log = folder / f"{block.name}.log"
    with log.open("w", encoding="utf-8") as said:
        ended = subprocess.run(
            ["bash", "-euo", "pipefail", "-c", block.commands],
            cwd=own, env=environment, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=said, text=True,
        )  # fmt: skip
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    took = Took(time.monotonic() - clock, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
    if ended.returncode:
        with log.open("a", encoding="utf-8") as said:
            said.write(f"{ended.stdout}\nended with status {ended.returncode}\n")
        return None
    written = [path for path in sorted(own.glob("**/*.md")) if path.stat().st_mtime >= began - 1.0]
    write(folder / f"{block.name}.md", page_of(block, took, ended.stdout, written))
    return took


def skipped(log: Path) -> list[str]:
    """What a command has left out for what is not there, in its own words."""
    return [line for line in log.read_text(encoding="utf-8", errors="replace").splitlines() if "SKIPPED" in line]


def page_of(block: Block, took: Took, printed: str, written: Sequence[Path]) -> str:
    """Markdown: the commands, their time, and the tables that they wrote; where they wrote none, what they printed."""
    head = f"# {block.section or block.page.stem}\n\n```sh\n{block.commands}\n```\n\n{spoken(took)}\n"
    if written:
        return head + "".join(f"\n{path.read_text(encoding='utf-8').strip()}\n" for path in written)
    return f"{head}\n{as_markdown(printed)}\n"


def as_markdown(printed: str) -> str:
    """Tables of Markdown as they are, all else as it was printed."""
    parts = []
    for is_table, lines in itertools.groupby(printed.strip().splitlines(), lambda line: line.startswith("|")):
        text = "\n".join(lines).strip("\n")
        if text:
            parts.append(text if is_table else f"```\n{text}\n```")
    return "\n\n".join(parts)


# --- all of them ------------------------------------------------------------------------------------------------------


def make(blocks: Sequence[Block], folder: Path, again: bool) -> int:
    """Makes what is not there, one after another. Returns how many failed."""
    shared = shared_folder()
    times = read_times(folder)
    failed = 0
    for block in blocks:
        lacks = missing(block, shared)
        if lacks:
            say(f"SKIPPED: {block.name}: needs {', '.join(lacks)}, which is not there")
        elif (folder / f"{block.name}.md").is_file() and not again:
            say(f"{block.name}: there already")
        else:
            say(f"{block.name}: begins; {known_time(block)}")
            took = run(block, folder, shared)
            if took is None:
                failed += 1
                say(f"FAILED: {block.name}: see {folder / block.name}.log")
                continue
            times[block.name] = took
            for line in skipped(folder / f"{block.name}.log"):
                say(f"{block.name}: {line}")
            say(f"{block.name}: {spoken(took)}")
        write(folder / TIMES, {name: vars(took) for name, took in times.items()})
        write(folder / "README.md", index(times))
    return failed


def read_times(folder: Path) -> dict[str, Took]:
    file = folder / TIMES
    if not file.is_file():
        return {}
    return {name: Took(**took) for name, took in json.loads(file.read_text(encoding="utf-8")).items()}


def index(times: Mapping[str, Took]) -> str:
    """What is there, and how long it took."""
    whole = Took(sum(took.seconds for took in times.values()), sum(took.cpu_seconds for took in times.values()))
    named = {f"[{name}]({name}.md)": took for name, took in times.items()} | {"all": whole}
    lines = [[name, _clock(took.seconds), _clock(took.cpu_seconds)] for name, took in named.items()]
    return tables.table(["table", "time", "processor time"], lines) + "\n"


def spoken(took: Took) -> str:
    return f"{_clock(took.seconds)}, processor time {_clock(took.cpu_seconds)}"


def known_time(block: Block) -> str:
    return "time not measured" if block.minutes is None else f"{_clock(60.0 * block.minutes)} of one core"


def _clock(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 120.0 else f"{seconds / 60.0:.0f} min"


def listing(blocks: Sequence[Block]) -> str:
    """A line for each block, and the time of all."""
    width = max(len(block.name) for block in blocks)
    lines = []
    for block in blocks:
        needs = f"; needs {', '.join(block.needs)}" if block.needs else ""
        lines.append(f"{block.name:{width}}  {known_time(block)}{needs}  ({block.page.relative_to(ROOT)})")
    unknown = sum(block.minutes is None for block in blocks)
    total = _clock(60.0 * sum(block.minutes or 0.0 for block in blocks))
    return "\n".join([*lines, f"all: {total} of one core, and {unknown} whose time is not measured"])


def main() -> None:
    options = parser(__doc__, output=None)
    options.add_argument("-o", "--output", type=Path, metavar="FOLDER")
    options.add_argument("--only", nargs="+", metavar="NAME", help="only these (--list has the names)")
    options.add_argument("--again", action="store_true", help="make tables that are there once more")
    options.add_argument("--list", action="store_true", help="names, known times and needs")
    given = options.parse_args()
    blocks = every_block()
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
    began = time.monotonic()
    failed = make(chosen, folder, given.again)
    say(f"{folder}: {_clock(time.monotonic() - began)} in all, {failed} failed")
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
