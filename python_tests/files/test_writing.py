"""Files are written whole or not at all, also after a process that was killed in the middle."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tendonfmu.files import are, by_kind, counted, whole_file

if os.name != "posix":
    pytest.skip("SKIPPED: locks and signals as POSIX has them", allow_module_level=True)

WRITER = """
import sys, time
from pathlib import Path
from tendonfmu.files import whole_file
with whole_file(Path(sys.argv[1])) as temporary:
    temporary.write_text("half")
    print("ready", flush=True)
    time.sleep(60)
"""


def writer(file: Path) -> subprocess.Popen[str]:
    """A process in the middle of writing a file, by the clock of the disk two minutes ago."""
    process = subprocess.Popen([sys.executable, "-c", WRITER, str(file)], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None and process.stdout.readline() == "ready\n"
    (temporary,) = hidden(file.parent)
    os.utime(file.parent / temporary, (time.time() - 120.0,) * 2)
    return process


def hidden(folder: Path) -> list[str]:
    return [each.name for each in folder.glob(".*")]


def test_the_next_write_removes_what_a_killed_process_left(tmp_path: Path) -> None:
    file = tmp_path / "out [1].csv"
    process = writer(file)
    with whole_file(file) as temporary:
        temporary.write_text("whole")
    assert len(hidden(tmp_path)) == 1 and file.read_text() == "whole"  # the other still writes
    process.kill()
    process.communicate()
    with whole_file(tmp_path / "other.csv"):
        pass
    assert len(hidden(tmp_path)) == 1  # that of another file
    with whole_file(file) as temporary:
        temporary.write_text("again")
    assert hidden(tmp_path) == [] and file.read_text() == "again"


@pytest.mark.parametrize(
    "name", [".out.csv-abcdefgh.csv", ".out.csv-my_notes.txt", ".out.csv-short.csv", "out.csv-abcdefgh.csv"]
)
def test_young_files_and_those_of_others_stay(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text("mine")
    if name != ".out.csv-abcdefgh.csv":  # that one is young
        os.utime(tmp_path / name, (time.time() - 120.0,) * 2)
    with whole_file(tmp_path / "out.csv") as temporary:
        temporary.write_text("whole")
    assert (tmp_path / name).read_text() == "mine"


def test_numbers_agree_with_their_words_and_sentences_are_told_once() -> None:
    for number, noun, plural, words in (
        (0, "sample", "", "0 samples are"),
        (1, "pass", "passes", "1 pass is"),
        (3, "pass", "passes", "3 passes are"),
    ):
        assert f"{counted(number, noun, plural)} {are(number)}" == words
    alike = [f"{file}: tendon_position[{i}]: zero is off by 0.{i} mm; learn it" for file in "ab" for i in (1, 2)]
    alone = ["c.csv: time: 1 gap, the first of 0.7 s"]
    kinds = by_kind([*alike, *alone, *alike])
    assert [sentences for _, sentences in kinds] == [alike, alone] and kinds[1][0] == alone[0]


def test_an_error_leaves_nothing(tmp_path: Path) -> None:
    def stopped() -> None:
        with whole_file(tmp_path / "out.csv") as temporary:
            temporary.write_text("half")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        stopped()
    assert not list(tmp_path.iterdir())
