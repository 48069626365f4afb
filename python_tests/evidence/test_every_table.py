"""Every table of docs/evidence/ has a command that makes it, and one command runs them all."""

from __future__ import annotations

import importlib.util
import re
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from evidence import __main__ as every_table
from evidence.pages import Block, blocks_of, pages, tables_of
from repository_paths import ROOT
from tendonfmu.cli.program import app

BLOCKS = every_table.every_block()

PAGE = """# Evidence

## First

| before | its block |
| --- | --- |

```sh
# 2 min of one core; needs ../shared/data, requirements-foreign.lock
python -m evidence.first
```

| after | it |
| --- | ---: |

## Second

| nobody | makes it |
| --- | --- |

## Third, of the first

By the commands of [First](#first): figures.

| of | another |
| --- | --- |
"""


def test_every_table_names_a_command() -> None:
    tables = [table for page in pages() for table in tables_of(page)]
    assert len(tables) > 25
    orphans = [f"{table.page.relative_to(ROOT)}:{table.line}" for table in tables if table.maker is None]
    assert orphans == [], "a table needs a block of ```sh in its section, or 'By the commands of [Heading](#heading)'"


def test_the_command_of_every_table_is_run_by_the_tool() -> None:
    run = {(block.page, block.line) for block in BLOCKS}
    makers = [table.maker for page in pages() for table in tables_of(page) if table.maker is not None]
    assert {(maker.page, maker.line) for maker in makers} <= run
    assert len({block.name for block in BLOCKS}) == len(BLOCKS)


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


def test_a_table_belongs_to_the_block_of_its_section(tmp_path: Path) -> None:
    page = tmp_path / "made.md"
    page.write_text(PAGE, encoding="utf-8")
    (block,) = blocks_of(page)
    assert (block.name, block.minutes, block.needs) == (
        "made_first",
        2.0,
        ("../shared/data", "requirements-foreign.lock"),
    )
    assert [table.maker for table in tables_of(page)] == [block, block, None, block]


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


def test_the_programs_are_those_of_this_python(tmp_path: Path) -> None:
    here = block("here", "python -c 'import sys; print(sys.prefix)'; tendonfmu --version")
    assert every_table.make([here], tmp_path, False) == 0
    assert sys.prefix in (tmp_path / "here.md").read_text(encoding="utf-8")


def test_the_list_has_every_table_and_the_whole_time() -> None:
    text = every_table.listing(BLOCKS)
    assert all(f"{block.name} " in text for block in BLOCKS)
    assert text.splitlines()[-1].startswith("all: ")
