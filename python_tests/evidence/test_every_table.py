"""One command runs the commands of docs/evidence/."""

from __future__ import annotations

import importlib.util
import re
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from evidence import __main__ as every_table
from evidence.__main__ import Block, blocks_of, pages
from repository_paths import ROOT
from tendonfmu.cli.program import app

BLOCKS = [block for page in pages() for block in blocks_of(page)]


def test_each_page_with_a_table_has_a_command() -> None:
    for page in pages():
        assert "\n| ---" not in page.read_text(encoding="utf-8") or blocks_of(page), page.name
    assert len(BLOCKS) > 25 and len({block.name for block in BLOCKS}) == len(BLOCKS)


@pytest.mark.parametrize("block", BLOCKS, ids=lambda block: block.name)
def test_a_block_says_its_time_and_calls_what_is_there(block: Block) -> None:
    assert block.known, "the first line has to be '# 20 min of one core' or '# time not measured', then '; needs ...'"
    assert all(need in every_table.PACKAGES or re.fullmatch(r"\.\./shared/\w+", need) for need in block.needs)
    lines = re.sub(r"#.*", "", block.commands)
    assert any("shared" in need for need in block.needs) or "../shared/" not in lines
    commands = {command.name or command.callback.__name__ for command in app.registered_commands if command.callback}
    called = re.findall(r"(?:^|\bdo )\s*(python|tendonfmu|cmake) (\S+)(?: (\S+))?", lines, re.MULTILINE)
    assert called
    for program, what, module in called:
        if program == "python":
            assert (ROOT / what).is_file() or (what == "-m" and importlib.util.find_spec(module))
        else:
            assert program == "cmake" or what in commands


# --- running ----------------------------------------------------------------------------------------------------------


def block(name: str, commands: str, needs: tuple[str, ...] = ()) -> Block:
    return Block(name, Path("page.md"), "Section", 0, commands, True, None, needs)


def test_what_is_there_is_not_made_again(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    counts = block("counts", 'echo x >> runs; echo "| $(wc -l < runs) |"; ls evidence/__main__.py')
    for again, runs in ((False, 1), (False, 1), (True, 2)):
        assert every_table.make([counts], tmp_path, again) == 0
        assert f"| {runs} |" in (tmp_path / "counts.md").read_text(encoding="utf-8").splitlines()
    assert "counts: there already" in capsys.readouterr().err


def test_tables_that_are_written_count_in_place_of_what_is_printed(tmp_path: Path) -> None:
    assert (
        every_table.make([block("written", "mkdir -p out; echo '| 7 |' > out/t.md; echo '| 8 |'")], tmp_path, False)
        == 0
    )
    text = (tmp_path / "written.md").read_text(encoding="utf-8")
    assert "\n| 7 |\n" in text and "\n| 8 |\n" not in text


def test_a_failure_leaves_no_table_and_the_rest_goes_on(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    blocks = [block("fails", "echo '| 1 |'; false | cat; echo '| 2 |'"), block("works", "python --version")]
    assert every_table.make(blocks, tmp_path, False) == 1
    assert not (tmp_path / "fails.md").exists() and (tmp_path / "works.md").is_file()
    assert "FAILED: fails" in capsys.readouterr().err


def test_what_is_missing_is_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    needy = block("needy", "echo '| 1 |'", ("../shared/no_such_recordings",))
    assert every_table.make([needy], tmp_path, False) == 0
    assert "SKIPPED: needy: needs ../shared/no_such_recordings" in capsys.readouterr().err
    own_words = replace(needy, name="partly", needs=(), commands="echo 'SKIPPED: half of it' >&2; echo '| 1 |'")
    assert every_table.make([own_words], tmp_path, False) == 0
    assert "partly: SKIPPED: half of it" in capsys.readouterr().err


def test_the_programs_are_those_of_this_python_and_the_list_has_the_whole_time(tmp_path: Path) -> None:
    here = block("here", "python -c 'import sys; print(sys.prefix)'; tendonfmu --version")
    assert every_table.make([here], tmp_path, False) == 0
    assert sys.prefix in (tmp_path / "here.md").read_text(encoding="utf-8")
    assert every_table.listing(BLOCKS).splitlines()[-1].startswith("all: ")
