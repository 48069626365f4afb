"""What one command writes every other takes: it does its work, answers no, or refuses by name; it never fails inside.

All pairs of a writer and a reader (support/chains.py), each with some variations of the recordings and kinematics
sources. In `./test` runs a seeded sample in which each writer and each reader is once.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from chains import KINEMATICS, MODEL, READERS, VARIATIONS, WRITERS, call, inside, varied, write_description
from chains import write_recordings as write
from made_once import made_once
from repetitions import repeated

Pair = tuple[str, str, str, int]  # writer, reader, variation, kinematics
# of Python, not of a user's language
_CODE = re.compile(r"Traceback|\b\w+(Error|Exception)\b|object at 0x|<class|\bNoneType\b")


def all_pairs() -> list[Pair]:
    """Two Latin squares, the first one first: variation and source follow from the numbers of writer and reader."""
    kinds = list(itertools.product(VARIATIONS, KINEMATICS))
    return [
        (writer, reader, *kinds[(w + 4 * r + turn) % len(kinds)])
        for turn in (0, 7)
        for w, writer in enumerate(WRITERS)
        for r, reader in enumerate(READERS)
    ]


def some_pairs() -> list[int]:
    """Numbers of pairs in which every writer and every reader is once."""
    rng = np.random.default_rng(1)
    writers = [str(name) for name in rng.permutation(list(WRITERS))]
    chosen = dict(zip(READERS, itertools.cycle(writers), strict=False))
    return [k for k, (writer, reader, *_) in enumerate(PAIRS[: len(PAIRS) // 2]) if chosen[reader] == writer]


PAIRS = all_pairs()


@pytest.fixture(scope="session")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return made_once(tmp_path_factory, "chain_recordings", write)


@pytest.fixture(scope="session")
def description(tmp_path_factory: pytest.TempPathFactory, recordings: Path) -> Callable[[str], Path]:
    """The description that a writer writes."""

    def written(name: str) -> Path:
        writer = WRITERS[name]
        before = written(writer.after) if writer.after else None

        def make(folder: Path) -> None:
            write_description(folder, name, recordings, before)

        return made_once(tmp_path_factory, re.sub(r"[^a-z]+", "_", f"chain_{name}"), make) / writer.file

    return written


def faults_of(pair: Pair, finger: Path, recordings: Path, folder: Path) -> Iterator[str]:
    """What is wrong with the answers to a pair; nothing, it should be."""
    writer, reader, variation, kinematics = pair
    with inside(folder):
        Path("model.xml").write_text(MODEL)
        own = Path("finger.json")
        own.write_text(finger.read_text())
        kind = WRITERS[writer].recordings
        first, second = (
            varied(recordings / f"{kind}_{seed}.parquet", variation, Path(f"{kind}_{seed}.parquet")) for seed in (1, 2)
        )
        for command in READERS[reader](own, first, second, ["--kinematics", str(kinematics)]):
            answer = call(*command)
            told = " ".join(map(str, command))
            if answer.status not in (0, 1, 2):
                reports = [file.read_text() for file in Path().glob("tendonfmu-error-*.txt")]
                yield f"{told}: {answer.status}: {answer.err}\n{''.join(reports)}"
            if _CODE.search(answer.out + answer.err):
                yield f"{told}: not in plain words: {answer.out}{answer.err}"
            if answer.status == 2:
                last = answer.err.strip().splitlines()[-1]
                if not any(str(word) in last for word in command[1:] if Path(str(word)).suffix):
                    yield f"{told}: refused without a name: {last}"
            if answer.status:
                return


@pytest.mark.parametrize(
    "pair", repeated([(pair,) for pair in PAIRS], *some_pairs()), ids=lambda pair: ", ".join(map(str, pair))
)
def test_what_one_command_writes_the_other_takes(
    pair: Pair, description: Callable[[str], Path], recordings: Path, tmp_path: Path
) -> None:
    found = list(faults_of(pair, description(pair[0]), recordings, tmp_path / "taken"))
    assert not found, "\n".join(found)
