"""Files are written whole or not at all, also after a process that was killed in the middle."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tendonfmu.files import are, by_kind, counted, whole_file

if os.name != "posix":
    pytest.skip("SKIPPED: signals as POSIX has them", allow_module_level=True)

WRITER = """
import sys, time
from pathlib import Path
from tendonfmu.files import whole_file
with whole_file(Path(sys.argv[1])) as temporary:
    temporary.write_text("half")
    print("ready", flush=True)
    time.sleep(60)
"""


def test_a_killed_process_leaves_the_file_as_it_was(tmp_path: Path) -> None:
    file = tmp_path / "out [1].csv"
    file.write_text("before")
    process = subprocess.Popen([sys.executable, "-c", WRITER, str(file)], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None and process.stdout.readline() == "ready\n"
    process.kill()
    process.communicate()
    assert file.read_text() == "before"
    (left,) = tmp_path.glob(".*")
    assert left.read_text() == "half"  # of its own name, as the docs say
    with whole_file(file) as temporary:
        temporary.write_text("whole")
    assert file.read_text() == "whole" and [*tmp_path.glob(".*")] == [left]


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
    ((told, _),) = by_kind(
        [f"{file}: tendon_position[1]: {k} mm off; probably a slip; set it" for k, file in enumerate("ab")]
    )
    assert told == "tendon_position[1]: 1 column of 2 files, the first: 0 mm off; probably a slip; set it"


def test_an_error_leaves_nothing(tmp_path: Path) -> None:
    def stopped() -> None:
        with whole_file(tmp_path / "out.csv") as temporary:
            temporary.write_text("half")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        stopped()
    assert not list(tmp_path.iterdir())
