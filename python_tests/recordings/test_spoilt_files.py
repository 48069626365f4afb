"""Recordings and maps with wrong bytes are read, or refused in one line that names a file; never another error."""

from __future__ import annotations

import json
import random
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from map_cases import LOG, SMALL
from tendonfmu.errors import InputError
from tendonfmu.recordings.converters.table import convert_table
from tendonfmu.recordings.recording import read_recording

WORDS = (b"nan", b"-inf", b"1e999", b'"', b"{", b"]", b",", b"\n", b"\r", b"\0", b"\xff\xfe", b"null", b"-0", b"1e-400")
RECORDING = "".join(
    ["time,tendon_force[1],tendon_position[1]\n", *(f"{0.01 * k},{5 + 0.1 * k},{1e-4 * k}\n" for k in range(40))]
)


def spoilt(seed: int, content: bytes) -> bytes:
    """Some bytes changed, cut out, doubled, or replaced by words that parsers stumble over."""
    chance, made = random.Random(seed), bytearray(content)
    for _ in range(chance.randint(1, 6)):
        at, length = chance.randrange(len(made) + 1), chance.randint(0, 40)
        kind = chance.randrange(4)
        if kind == 0 and made:
            made[min(at, len(made) - 1)] = chance.randrange(256)
        elif kind == 1:
            del made[at : at + length]
        elif kind == 2:
            made[at:at] = made[at : at + length]
        else:
            made[at:at] = chance.choice(WORDS)
    return bytes(made)


@pytest.mark.parametrize("count", [200, pytest.param(20_000, marks=pytest.mark.long)])
@pytest.mark.parametrize(("name", "content"), [("recording.csv", RECORDING), ("map.json", json.dumps(SMALL, indent=1))])
def test_wrong_bytes_are_read_or_refused_in_one_line(tmp_path: Path, name: str, content: str, count: int) -> None:
    (tmp_path / "log.csv").write_text(LOG, encoding="utf-8")
    readers: dict[str, Callable[[Path], Any]] = {
        "recording.csv": read_recording,
        "map.json": lambda file: convert_table(tmp_path / "log.csv", file),
    }
    lines: dict[int, str] = {}
    for seed in range(count):
        (tmp_path / name).write_bytes(spoilt(seed, content.encode()))
        try:
            readers[name](tmp_path / name)
        except InputError as refused:
            lines[seed] = str(refused)
    wrong = {seed: line for seed, line in lines.items() if "\n" in line or not (name in line or "log.csv" in line)}
    assert wrong == {} and len(lines) > 0.8 * count
