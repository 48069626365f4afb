"""The code blocks of the pages run, in order, in a folder that has what the page supposes.

Blocks of Python one after another are one program; JSON is saved where the page says so; C and C++ compile.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import groupby
from pathlib import Path

import pytest

from plant_rigs import needs_plant
from repository_paths import ROOT

DOCS = ROOT / "docs"
DEMO = ROOT / "examples" / "demo_recording"
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
COMMAND = re.compile(r"^    \.venv/bin/(tendonfmu [^#\n]*)", re.MULTILINE)  # of README.md
COMPILERS = {"c": ("cc", ["-std=c11"]), "cpp": ("c++", ["-std=c++17", "-std=c++20"])}
CHECK_ONLY = ["-Wall", "-Wextra", "-Werror", "-fsyntax-only", f"-I{ROOT / 'runtime' / 'include'}"]
FINGER, TRAINING, UNSEEN = (DEMO / f"two_joints{end}" for end in (".json", "_training.parquet", "_unseen.parquet"))


@dataclass(frozen=True)
class Page:
    """A page, and what a reader has before."""

    path: str  # below docs, without .md
    given: Mapping[str, Path] = field(default_factory=dict)  # files in the reader's folder
    saved: tuple[str, ...] = ()  # names of its JSON blocks, in order; "": not saved
    before: str = ""  # the page whose JSON the reader has saved, too
    shorter: Mapping[str, str] = field(default_factory=dict)  # text -> text that takes less time
    left_out: str = "no block has this"  # blocks with this text need what a test has not
    outcome: tuple[str, ...] = ()  # files that are there afterwards

    @property
    def text(self) -> str:
        text = (DOCS / f"{self.path}.md").read_text(encoding="utf-8")
        for long, short in self.shorter.items():
            assert long in text, long
            text = text.replace(long, short)
        return text


SAVED = {"guide/your_finger": ("two_joints.json",)}
QUICK = (
    Page("guide/your_finger", saved=SAVED["guide/your_finger"], outcome=("two_joints.fmu",)),
    Page("guide/trouble"),
    Page("guide/in_your_loop"),
    Page("guide/microcontroller", left_out="apt-get", outcome=("finger.h",)),
    Page(
        "reference/finger_description",
        given={"finger.json": FINGER, "monday.parquet": TRAINING},
    ),
    Page("reference/commands/run", given={"finger.json": FINGER, "rec.parquet": UNSEEN}, outcome=("page.html",)),
)
LONG = (
    *(Page(f"guide/{name}") for name in ("calibrate", "fit", "diagnose", "change", "detect", "from_python")),
    *(Page(f"guide/{name}") for name in ("in_your_simulator", "fit_my_hand")),
    Page("guide/your_recording", before="guide/your_finger", outcome=("my_log.parquet",)),
    Page(
        "reference/commands/fit",
        given={
            "finger.json": FINGER,
            "monday.parquet": TRAINING,
            "tuesday.parquet": UNSEEN,
            "wednesday.parquet": UNSEEN,
        },
        left_out="PKG_CONFIG_PATH",
        outcome=("figures/report.html",),
    ),
    Page("reference/python", outcome=("two_joints.fmu",)),
    Page("reference/commands/build", outcome=("two_joints.fmu",)),
    Page("reference/commands/convert", left_out="pick_and_place", outcome=("week_5/diagnosis.html",)),
    Page("reference/commands/describe", outcome=("week_5/diagnosis.html", "index.json")),
    Page(
        "reference/commands/diagnose",
        given={"finger.json": FINGER, "train.parquet": TRAINING, "other.parquet": UNSEEN},
        saved=("",),
        outcome=("diagnosis/extended.fmu", "finger.fmu"),
    ),
)
WITH_PLANT = (
    Page("guide/simulated_finger", saved=("softer.json",), outcome=("softer.parquet",)),
    Page("reference/simulated_finger", outcome=("truth.parquet",)),
    Page(
        "reference/commands/excite",
        saved=("trained.json",),
        shorter={"index_finger.json -o": "index_finger.json --duration 20 -o", '"duration": 400': '"duration": 10'},
        outcome=("recording.parquet", "excited.json"),
    ),
)


def blocks(text: str) -> Iterator[tuple[str, str]]:
    """Language and code of each block; blocks of Python one after another are one program."""
    for language, several in groupby(BLOCK.findall(text), key=lambda block: block[0]):
        codes = [code for _, code in several]
        yield from ((language, code) for code in (["".join(codes)] if language == "python" else codes))


def run(command: list[str], folder: Path) -> str:
    """Return what a command prints; the commands are those of this Python."""
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    environment = os.environ | {"PATH": path}
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, f"{command[-1]}\n{done.stderr}"
    return done.stdout


def save_json(page: Page, folder: Path) -> None:
    names = page.saved or SAVED.get(page.path, ())
    codes = [code for language, code in BLOCK.findall(page.text) if language == "json"]
    for name, code in zip(names, codes, strict=False):
        if name:
            (folder / name).write_text(code, encoding="utf-8")


def follow(page: Page, folder: Path) -> str:
    """Do what the page says, from its first line to its last, and return what it prints."""
    (folder / "examples").symlink_to(ROOT / "examples")
    for name, source in page.given.items():
        shutil.copy(source, folder / name)
    for each in (Page(page.before), page) if page.before else (page,):
        save_json(each, folder)
    printed = ""
    for language, code in blocks(page.text):
        if page.left_out in code:
            continue
        if language in ("sh", "python"):
            program = ["sh", "-e", "-c", code] if language == "sh" else [sys.executable, "-c", code]
            printed += run(program, folder)
        elif language in COMPILERS:
            compiler, standards = COMPILERS[language]
            (folder / f"block.{language}").write_text(code, encoding="utf-8")
            for standard in standards if shutil.which(compiler) else ():
                run([compiler, standard, *CHECK_ONLY, f"block.{language}"], folder)
    missing = [name for name in page.outcome if not (folder / name).is_file()]
    assert missing == []
    return printed


def cases() -> Iterator[object]:
    for pages, marks in ((QUICK, []), (LONG, [pytest.mark.long]), (WITH_PLANT, [needs_plant, pytest.mark.long])):
        yield from (pytest.param(page, id=page.path, marks=marks) for page in pages)


@pytest.mark.parametrize("page", list(cases()))
def test_a_reader_can_follow(page: Page, tmp_path: Path) -> None:
    follow(page, tmp_path)


def test_every_page_of_the_guide_is_followed() -> None:
    followed = {page.path for page in (*QUICK, *LONG, *WITH_PLANT)}
    assert {f"guide/{path.stem}" for path in (DOCS / "guide").glob("*.md")} <= followed


@pytest.mark.parametrize("fits", [False, pytest.param(True, marks=pytest.mark.long)], ids=["without fits", "with fits"])
def test_commands_of_the_readme(tmp_path: Path, fits: bool) -> None:
    """In order, in a folder that sees the examples: one builds what the next one runs."""
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    commands = COMMAND.findall((ROOT / "README.md").read_text(encoding="utf-8"))
    assert len(commands) >= 4
    for command in commands:
        if fits or "calibrate" not in command.replace("index_finger_calibrated", ""):
            run(["sh", "-e", "-c", command], tmp_path)
    rows = (tmp_path / "out.csv").read_text(encoding="utf-8").splitlines()
    contact = [row.split(",")[rows[0].split(",").index("contact")] for row in rows[1:]]
    assert len(contact) == 30000 and set(contact) == {"0", "1"}
