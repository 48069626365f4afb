"""docs/guide: eleven short pages, each with a command that works and a picture; a reader can follow them."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from itertools import groupby
from pathlib import Path

import pytest

from plant_rigs import needs_plant
from repetitions import repeated
from repository_paths import ROOT

GUIDE = ROOT / "docs" / "guide"
PAGES = sorted(path.stem for path in GUIDE.glob("*.md"))
MOST_WORDS = 900
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
START = re.compile(
    r"# .+\n\n```(?:sh\n(?:tendonfmu|python) |python\n)(?:.*\n)+?```\n\n"
    r"!\[[^\]]{20,}\]\(\.\./(figures/\w+\.png)\)\n"
)
SAVED = {"your_finger": "two_joints.json", "simulated_finger": "softer.json"}  # what the page has the reader save
CHECK_ONLY = ["-Wall", "-Wextra", "-Werror", "-fsyntax-only", f"-I{ROOT / 'runtime' / 'include'}"]
FITS = ("calibrate", "fit", "diagnose", "change", "from_python")


def text(name: str) -> str:
    return (GUIDE / f"{name}.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("name", PAGES)
def test_a_page_is_short_and_begins_with_a_command_and_a_picture(name: str) -> None:
    page = text(name)
    assert len(page.split()) <= MOST_WORDS
    start = START.match(page)
    assert start, "expected: a heading, a block of commands, a picture with a description"
    assert (ROOT / "docs" / start[1]).stat().st_size < 400_000


def blocks(name: str) -> Iterator[tuple[str, str]]:
    """Language and code of each block; blocks of Python one after another are one program."""
    for language, several in groupby(BLOCK.findall(text(name)), key=lambda block: block[0]):
        codes = [code for _, code in several]
        yield from ((language, code) for code in (["".join(codes)] if language == "python" else codes))


def follow(name: str, folder: Path) -> None:
    """Does what the page says, from its first line to its last."""
    (folder / "examples").symlink_to(ROOT / "examples")
    environment = os.environ | {"PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"}
    for language, code in blocks(name):
        if language == "json" and name in SAVED:
            (folder / SAVED[name]).write_text(code, encoding="utf-8")
        command = {"sh": ["sh", "-e", "-c", code], "python": [sys.executable, "-c", code]}.get(language)
        if command:
            done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
            assert done.returncode == 0, f"{code}\n{done.stderr}"


@pytest.mark.parametrize("name", repeated(("your_finger", "detect", "in_your_loop", "in_your_simulator", *FITS), 0))
def test_a_reader_can_follow(name: str, tmp_path: Path) -> None:
    follow(name, tmp_path)


@pytest.mark.long
def test_a_reader_can_follow_from_the_finger_to_the_recording(tmp_path: Path) -> None:
    """your_recording uses the finger of the page before."""
    finger = next(code for language, code in BLOCK.findall(text("your_finger")) if language == "json")
    (tmp_path / "two_joints.json").write_text(finger, encoding="utf-8")
    follow("your_recording", tmp_path)


@needs_plant
@pytest.mark.long
def test_a_reader_can_simulate(tmp_path: Path) -> None:
    follow("simulated_finger", tmp_path)
    assert (tmp_path / "softer.parquet").is_file()


def check_compiles(folder: Path, compiler: str, standard: str, source: str) -> None:
    command = [compiler, standard, *CHECK_ONLY, source]
    result = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr


def test_the_loop_is_c(tmp_path: Path) -> None:
    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip("SKIPPED: no C compiler")
    (code,) = (code for language, code in BLOCK.findall(text("in_your_loop")) if language == "c")
    (tmp_path / "loop.c").write_text(code, encoding="utf-8")
    check_compiles(tmp_path, compiler, "-std=c11", "loop.c")


@pytest.mark.parametrize("standard", ["c++17", "c++20"])
def test_the_other_loop_is_cpp(tmp_path: Path, standard: str) -> None:
    compiler = shutil.which("c++")
    if compiler is None:
        pytest.skip("SKIPPED: no C++ compiler")
    (code,) = (code for language, code in BLOCK.findall(text("in_your_loop")) if language == "cpp")
    (tmp_path / "loop.cpp").write_text(code, encoding="utf-8")
    check_compiles(tmp_path, compiler, f"-std={standard}", "loop.cpp")
