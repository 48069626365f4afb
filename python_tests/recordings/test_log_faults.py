"""Every format of `convert table` with every fault: read right, recovered, or refused with a sentence that says why."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from made_logs import (
    FAULTS,
    FORMATS,
    ROWS,
    Format,
    content_of,
    converted,
    cut_at,
    going_back,
    sound,
    truth,
    write,
)
from repetitions import repeated

PLACES = 300  # at which a log is cut off, at most
REFUSED = {
    "shuffled": ["time goes back", '"disorder": "sort"', "Divide the log"],
    "NaN": ["row 5", '"missing": "leave out"'],
    "repeated times": ["the same time", "row 52", '"disorder": "sort"'],
    "time goes back": ["time goes back", "row 101", "Divide the log"],
}
EXPECTED = {"none": ROWS, "shuffled, to be sorted": ROWS, "NaN, to be left out": ROWS - 2}
EXPECTED |= {"repeated times, to be sorted": ROWS, "implausible unit": ROWS}
# protobuf and CDR hold NaN; so do the others but for texts and JSON, where a missing number is nothing


def agrees(columns: dict[str, Any], expected: dict[str, Any], rows: Any) -> None:
    for name, values in expected.items():
        assert columns[name] == pytest.approx(values[rows], rel=1e-12, abs=1e-12), name


def of_each_once() -> list[Any]:
    """Every pair of format and fault; all but those that have each format and each fault once are long."""
    pairs = [(name, fault) for name in FORMATS for fault in FAULTS]
    size = max(len(FORMATS), len(FAULTS))
    usual = {(k % len(FORMATS), k % len(FAULTS)) for k in range(size)}
    return repeated(pairs, *(i * len(FAULTS) + j for i, j in usual))


@pytest.mark.parametrize(("name", "fault"), of_each_once())
def test_each_format_with_each_fault(tmp_path: Path, name: str, fault: str) -> None:
    form = FORMATS[name]
    spoil, log = FAULTS[fault]
    file = write(tmp_path, form, spoil(sound()))
    found = converted(file, form.map(**log))
    if fault in REFUSED:
        assert found.name == "refused" and "\n" not in found.words
        assert all(word in found.words for word in REFUSED[fault]), found.words
        return
    assert found.columns is not None, found.words
    assert len(found.columns["time"]) == EXPECTED[fault]
    if fault == "implausible unit":
        assert "warning" in found.words and "tendon_position[1]" in found.words
        return
    kept = np.delete(np.arange(ROWS), [4, 77]) if "NaN" in fault else np.arange(ROWS)
    agrees(found.columns, truth(), kept)
    assert found.name == ("read" if fault == "none" else "recovered"), found.words


def check_cut(file: Path, form: Format, content: bytes, size: int) -> int:
    """Convert what is left; return the number of rows, which are the first ones. -1: refused."""
    cut_at(file, form, content, size)
    found = converted(file, form.map())
    if found.columns is None:
        assert "\n" not in found.words and len(found.words) > 30
        return -1
    rows = len(found.columns["time"])
    agrees(found.columns, truth(), np.arange(rows))
    # a cut behind the last row loses an index or a checksum only, and a text may be cut between two lines
    between_lines = form.file.startswith("log.") and b"\n" in content[max(0, size - 3) : size]
    assert rows == ROWS or between_lines or any(word in found.words for word in ("cut off", "left out", "damaged")), (
        found.words
    )
    return rows


@pytest.mark.parametrize("name", FORMATS)
def test_logs_that_are_cut_off(tmp_path: Path, name: str) -> None:
    """At some bytes: where the format allows, the more is left, the more rows are recovered."""
    form = FORMATS[name]
    file = write(tmp_path, form, sound())
    content = content_of(file, form)
    sizes = [0, 1, 40, *(len(content) * k // 12 for k in range(1, 12)), len(content) - 1]
    rows = [check_cut(file, form, content, size) for size in sizes]
    assert rows == sorted(rows)
    if form.recovers:
        assert rows[-1] > 0.95 * ROWS  # SQLite loses its last page
        # half of the bytes hold about half of the rows; SQLite and ROS definitions take the first kilobytes
        assert sum(0 < count < ROWS for count in rows) >= 3
    else:
        assert set(rows) <= {-1, ROWS}


@pytest.mark.long
@pytest.mark.parametrize("name", FORMATS)
def test_logs_that_are_cut_off_at_many_places(tmp_path: Path, name: str) -> None:
    form = FORMATS[name]
    file = write(tmp_path, form, sound())
    content = content_of(file, form)
    step = max(1, len(content) // PLACES)  # of files of 100 kB not every byte, but also bytes at odd places
    for size in range(0, len(content), step):
        check_cut(file, form, content, size)


def test_zeros_after_a_loss_of_power(tmp_path: Path) -> None:
    form = FORMATS["CSV"]
    file = write(tmp_path, form, sound())
    content = content_of(file, form)
    file.write_bytes(content[: len(content) // 2] + b"\0" * 4096)
    found = converted(file, form.map())
    assert found.columns is not None and 90 < len(found.columns["time"]) < 110
    assert "left out" in found.words
    file.write_bytes(content[:1000] + b"\0" * 10 + content[1000:])
    assert "not a text file" in converted(file, form.map()).words


def test_a_clock_that_was_reset_is_not_sorted_in_silence(tmp_path: Path) -> None:
    form = FORMATS["CSV"]
    file = write(tmp_path, form, going_back(sound()))
    found = converted(file, form.map(disorder="sort"))
    assert "time goes back at 1 place;" in found.words and "40 rows with the time of another" in found.words
