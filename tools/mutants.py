"""Mutants: small wrong changes of the product, which its tests have to notice.

    python tools/mutants.py build/mutants                                  one line of results.jsonl for each mutant
    python tools/mutants.py build/after --noticed build/mutants/results.jsonl     only those that were noticed then

A mutant of Python is run by the tests that reach its lines (coverage by test), one of C and C++ by ctest, and then by
the Python tests of what is compiled of it: the quickest first, LIMIT seconds of them. For one that does not compile the
next of its kind is taken. A call goes on where another ended. Needs what ./test has set up.
"""

from __future__ import annotations

import argparse
import filecmp
import itertools
import json
import os
import random
import re
import shutil
import subprocess
import sys
import threading
import time
from collections import defaultdict, deque
from collections.abc import Iterator
from dataclasses import asdict, dataclass, fields
from pathlib import Path

import coverage

ROOT = Path(__file__).resolve().parent.parent
LIMIT = 40.0  # s, of the tests of one mutant, by their time without it
SHARE = {  # folders -> share of the mutants, and the Python tests of what is compiled
    "runtime/core": (0.2, ("model", "fmu", "estimate")),
    "runtime/estimation": (0.15, ("estimate",)),
    "fmu_src": (0.15, ("fmu", "simulate")),
    "python/tendonfmu/detect": (0.125, ()),
    "python/tendonfmu/estimate": (0.125, ()),
    "python/tendonfmu/diagnosis": (0.125, ()),
    "python/tendonfmu/recordings": (0.125, ()),
}
KINDS = ("operator", "constant", "comparison", "statement")
SWAPS = {"+": "-", "-": "+", "*": "/", "/": "*", "&&": "||", "||": "&&", "and": "or", "or": "and"}
SWAPS |= {"<": "<=", "<=": "<", ">": ">=", ">=": ">", "==": "!=", "!=": "==", "is": "is not"}
NOT_C = re.compile(
    r'//[^\n]*|/\*.*?\*/|"(?:\\.|[^"\\\n])*"|\'(?:\\.|[^\'\\\n])*\'|^[ \t]*#(?:\\\n|[^\n])*', re.S | re.M
)
NOT_PYTHON = re.compile(r'""".*?"""|#[^\n]*|"(?:\\.|[^"\\\n])*"', re.S)
TOKENS = {
    "operator": re.compile(r"(?<= )(?:[-+*/]|&&|\|\||and|or)(?= )"),
    "constant": re.compile(r"(?<![\w.])\d+(?:\.\d*)?(?:e-?\d+)?(?![\w.])"),
    "comparison": re.compile(r"(?<= )(?:[<>]=?|[=!]=|is(?! not))(?= )"),
}
STATEMENT_OF_C = re.compile(r"(?<=[;{}]\n)[ \t]+(?:[\w.*>\[\]-]+ [-+*/|&]?= [^;{]*|\w+\([^;{]*\))(?=;\n)")
STATEMENT_OF_PYTHON = re.compile(r"(?<=\n)[ ]+[\w.\[\]]+(?: [-+*/|&]= [^\n]*[^\n\[({,]|\([^\n]*\))(?=\n)")


@dataclass(frozen=True)
class Mutant:
    """A change of whole lines of one file."""

    name: str
    group: str
    kind: str
    file: str
    line: int  # from 1
    old: str
    new: str
    by: str = ""  # the test that noticed it before, which runs first


def is_compiled(mutant: Mutant) -> bool:
    return not mutant.file.startswith("python/")


# --- drawing ----------------------------------------------------------------------------------------------------------


def changes_of(text: str, is_python: bool) -> Iterator[tuple[str, int, int, str]]:
    """Kind, begin, end and replacement of every change of a source."""
    code = (NOT_PYTHON if is_python else NOT_C).sub(lambda found: re.sub(r"[^\n]", " ", found[0]), text)
    for kind, pattern in TOKENS.items():
        for match in pattern.finditer(code):
            yield kind, match.start(), match.end(), SWAPS.get(match[0]) or other_number(match[0])
    for match in (STATEMENT_OF_PYTHON if is_python else STATEMENT_OF_C).finditer(code):
        begin = match.end() - len(match[0].lstrip())
        yield "statement", begin, match.end(), "pass" if is_python else ""


def other_number(text: str) -> str:
    """Twice as large, 1 for 0; whole numbers by one more."""
    return str(2.0 * float(text) or 1.0) if "." in text or "e" in text else str(int(text) + 1)


def mutants_of(folder: str) -> dict[str, list[Mutant]]:
    """Every mutant of the folder by kind, in the order of the sources."""
    found: dict[str, list[Mutant]] = defaultdict(list)
    for path in sorted((ROOT / folder).rglob("*")):
        if path.suffix not in (".c", ".h", ".cpp", ".py") or "fuzz" in path.parts:
            continue
        text, file = path.read_text(encoding="utf-8"), str(path.relative_to(ROOT))
        for kind, begin, end, instead in sorted(changes_of(text, path.suffix == ".py"), key=lambda each: each[1]):
            first = text.rfind("\n", 0, begin) + 1
            last = text.find("\n", end)
            old, new = text[first:last], text[first:begin] + instead + text[end:last]
            line = text.count("\n", 0, first) + 1
            found[kind].append(Mutant(f"{file}:{line}:{kind}:{begin - first}", folder, kind, file, line, old, new))
    return found


def draw(number: int, seed: int) -> list[Mutant]:
    """Evenly over the folders, kinds and lines."""
    chance, drawn = random.Random(seed), []
    for folder, (share, _) in SHARE.items():
        pools, count = mutants_of(folder), round(share * number)
        for index in range(count):
            pool, of_kind = pools[KINDS[index % 4]], -(-count // 4)
            drawn.append(pool[int((index // 4 + chance.random()) / of_kind * len(pool))])
    return drawn


# --- running ----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Tests:
    """What coverage knows: how long each test takes, and which reach a line of a file of the package."""

    seconds: dict[str, float]
    reaching: dict[str, dict[int, set[str]]]

    def of(self, mutant: Mutant) -> list[str]:
        """The tests that reach it, the quickest first, LIMIT seconds of them."""
        if is_compiled(mutant):
            names = {name for name in self.seconds if name.split("/")[1] in SHARE[mutant.group][1]}
        else:
            lines = self.reaching.get(mutant.file.removeprefix("python/"), {})
            inside = range(mutant.line, mutant.line + mutant.old.count("\n") + 1)
            names = set().union(*(lines.get(line, set()) for line in inside))
            names = names or set().union(*lines.values())  # run at import: the tests that reach the file
        ordered = sorted(names, key=self.seconds.__getitem__)
        until = itertools.accumulate(self.seconds[name] for name in ordered)
        return [name for name, end in zip(ordered, until, strict=True) if end < LIMIT]


def measure_tests(folder: Path) -> Tests:
    """Runs the quick tests once under coverage, or takes what a run before has kept."""
    kept, log = folder / "coverage", folder / "tests.log"
    if not kept.is_file():
        settings = folder / "coveragerc"
        settings.write_text(f"[run]\nsource_pkgs = tendonfmu\ndata_file = {kept}\nparallel = True\n", encoding="utf-8")
        options = "-q -n2 --dist=loadfile --durations=0 -vv --cov=tendonfmu --cov-context=test --cov-report="
        with log.open("w", encoding="utf-8") as output:
            command = [sys.executable, "-m", "pytest", *options.split(), f"--cov-config={settings}"]
            subprocess.run(command, cwd=ROOT, stdout=output, stderr=subprocess.STDOUT, check=False)
    data = coverage.CoverageData(str(kept))
    data.read()
    reaching: dict[str, dict[int, set[str]]] = {}
    seconds: dict[str, float] = {}
    for file in data.measured_files():
        lines = reaching["tendonfmu" + file.rpartition("/tendonfmu")[2]] = {}
        for line, contexts in data.contexts_by_lineno(file).items():
            lines[line] = {name.rpartition("|")[0] for name in contexts if name}  # NODE|run
            seconds |= dict.fromkeys(lines[line], 0.005)  # pytest names those that take longer
    for taken, name in re.findall(r"^([\d.]+)s (?:setup|call|teardown) +(\S.*)$", log.read_text("utf-8"), re.M):
        seconds[name] = seconds.get(name, 0.0) + float(taken)
    return Tests(seconds, reaching)


class Workshop:
    """A copy of the sources with a build of its own, where one mutant after another is made."""

    def __init__(self, folder: Path, tests: Tests) -> None:
        self.source, self.site, self.build = folder / "source", folder / "site", folder / "build"
        self.tests = tests
        for name in git("ls-files"):
            copy = self.source / name
            if (ROOT / name).is_file() and not (copy.is_file() and filecmp.cmp(ROOT / name, copy, shallow=False)):
                copy.parent.mkdir(parents=True, exist_ok=True)
                shutil.copy(ROOT / name, copy)  # a new time: what an ended call left changed is compiled again
        (self.source / "build").mkdir(exist_ok=True)
        if not (self.source / "build/sundials").exists():
            (self.source / "build/sundials").symlink_to(ROOT / "build/sundials")
        shutil.copytree(self.source / "python/tendonfmu", self.site / "tendonfmu", dirs_exist_ok=True)
        options = [f"-DTENDONFMU_{name}=ON" for name in ("PYTHON", "BUILD_FMU", "BUILD_TESTS")]
        self.call("cmake", "-S", self.source, "-B", self.build, "-G", "Ninja", "-DCMAKE_BUILD_TYPE=Release", *options)
        if not self.compiles():
            raise RuntimeError(f"{folder}: the sources do not compile without a mutant")

    def call(self, *command: str | Path, seconds: float | None = None) -> subprocess.CompletedProcess[str]:
        places = {"PYTHONPATH": str(self.site), "CCACHE_BASEDIR": str(self.source), "PYTHONDONTWRITEBYTECODE": "1"}
        try:
            return subprocess.run(
                [*map(str, command)], cwd=self.source, env=os.environ | places, stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace", timeout=seconds,
            )  # fmt: skip
        except subprocess.TimeoutExpired:
            return subprocess.CompletedProcess(command, 1, "(Failed) no end\nFAILED no end\n")

    def compiles(self) -> bool:
        built = self.call("cmake", "--build", self.build, "--parallel", "1").returncode == 0
        return built and self.call("cmake", "--install", self.build, "--prefix", self.site, "--strip").returncode == 0

    def judge(self, mutant: Mutant) -> tuple[str, str]:
        """`noticed` and by which test, `survived`, or `does not compile`."""
        compiled = is_compiled(mutant)
        path = self.source / mutant.file if compiled else self.site / mutant.file.removeprefix("python/")
        original = path.read_text(encoding="utf-8")
        where = nearest(original, mutant)
        if where is None:
            return "gone", ""
        path.write_text(original[:where] + mutant.new + original[where + len(mutant.old) :], encoding="utf-8")
        try:
            if compiled and not self.compiles():
                return "does not compile", ""
            by = self.failing_again(mutant.by) or (self.failing_ctest() if mutant.group.startswith("runtime/") else "")
            by = by or self.failing_pytest(self.tests.of(mutant))
            return ("noticed", by) if by else ("survived", "")
        finally:
            path.write_text(original, encoding="utf-8")

    def failing_again(self, test: str) -> str:
        if "::" in test:
            return self.failing_pytest([test])
        return self.failing_ctest("--tests-regex", f"^{re.escape(test)}$") if test else ""

    def failing_ctest(self, *selection: str) -> str:
        command = ["ctest", "--test-dir", str(self.build), "--stop-on-failure", "--timeout", "120", *selection]
        command += ["--exclude-regex", "Plant|Integrator|Rig"]  # the simulated finger shares no code with the model
        ran = self.call(*command, seconds=10.0 * LIMIT)
        found = re.search(r"^\s*\d+ - (.+) \([^()]+\)$", ran.stdout, re.M)
        return "" if ran.returncode == 0 else found[1] if found else "ctest"

    def failing_pytest(self, chosen: list[str]) -> str:
        listed = self.source / "chosen.txt"
        listed.write_text("\n".join(chosen), encoding="utf-8")
        # a mutant may never end, or ask for memory without end
        command = ["prlimit", "--as=8000000000", sys.executable, "-m", "pytest", "-x", "-q", "-n0", "--tb=no"]
        ran = self.call(*command, "-p", "no:cacheprovider", f"@{listed}", seconds=10.0 * LIMIT) if chosen else None
        if ran is None or ran.returncode == 0 or (ran.returncode == 4 and len(chosen) == 1):  # 4: no such test
            return ""
        if ran.returncode in (3, 4, 5):  # no fault of the mutant
            raise RuntimeError(f"pytest ended with {ran.returncode}: {ran.stdout[-500:]}")
        found = re.search(r"^(?:FAILED|ERROR) (.+?)(?: - .*)?$", ran.stdout, re.M)
        return found[1] if found else f"pytest ended with {ran.returncode}"


def nearest(text: str, mutant: Mutant) -> int | None:
    """Where the lines of the mutant stand today: the place nearest to where they stood."""
    starts = [match.start() for match in re.finditer(rf"^{re.escape(mutant.old)}$", text, re.M)]
    return min(starts, key=lambda start: abs(text.count("\n", 0, start) + 1 - mutant.line), default=None)


def git(*arguments: str) -> list[str]:
    return subprocess.run(["git", *arguments], cwd=ROOT, capture_output=True, text=True, check=True).stdout.splitlines()


def run(folder: Path, number: int, seed: int, workers: int, noticed: Path | None) -> None:
    """Every mutant that has no result yet. Every other worker begins with Python, which needs no compiler."""
    if noticed:
        rows = [json.loads(line) for line in noticed.read_text("utf-8").splitlines()]
        names = [field.name for field in fields(Mutant)]
        mutants = [Mutant(*(row[name] for name in names)) for row in rows if row["status"] == "noticed"]
    else:
        mutants = draw(number, seed)
    results, lock = folder / "results.jsonl", threading.Lock()
    done = [json.loads(line)["drawn"] for line in results.read_text("utf-8").splitlines()] if results.is_file() else []
    random.Random(seed).shuffle(mutants)  # what is done so far is always an even sample
    waiting: dict[bool, deque[Mutant]] = {True: deque(), False: deque()}
    for mutant in mutants:
        if mutant.name not in done:
            waiting[is_compiled(mutant)].append(mutant)
    tests = measure_tests(folder)

    def work(index: int) -> None:
        shop, compiled = Workshop(folder / str(index), tests), index % 2 == 0
        while own := waiting[compiled] or waiting[compiled := not compiled]:
            drawn = mutant = own.popleft()
            began = time.monotonic()
            status, by = shop.judge(mutant)
            while status == "does not compile":
                mutant = neighbour(mutant)
                status, by = shop.judge(mutant)
            seconds = time.monotonic() - began
            row = {**asdict(mutant), "drawn": drawn.name, "status": status, "by": by, "seconds": seconds}
            with lock, results.open("a", encoding="utf-8") as output:
                output.write(json.dumps(row) + "\n")
                print(f"{status:9} {mutant.name}  {by}", flush=True)
            if compiled and not waiting[True]:
                shop.compiles()  # without the mutant

    threads = [threading.Thread(target=work, args=(index,)) for index in range(workers)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()


def neighbour(mutant: Mutant) -> Mutant:
    """The next of its kind in the folder."""
    pool = mutants_of(mutant.group)[mutant.kind]
    return pool[(pool.index(mutant) + 1) % len(pool)]


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("folder", type=Path)
    options.add_argument("--number", type=int, default=200)
    options.add_argument("--seed", type=int, default=1)
    options.add_argument("--workers", type=int, default=2)
    options.add_argument(
        "--noticed", type=Path, metavar="RESULTS", help="only the mutants that RESULTS says were noticed"
    )
    given = options.parse_args()
    given.folder.mkdir(parents=True, exist_ok=True)
    run(given.folder.resolve(), given.number, given.seed, given.workers, given.noticed)


if __name__ == "__main__":
    main()
