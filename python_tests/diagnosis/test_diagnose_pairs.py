"""Descriptions and recordings that do not belong together well: a diagnosis that can be used, or a refusal that helps.

`./test -m "" python_tests/diagnosis/test_diagnose_pairs.py` runs all of them, the ordinary run a few.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Iterator
from importlib.resources import files
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest

import diagnosis_examples as examples
from command import Call
from odd_pairs import QUIRKS, Columns, Pair, make_pair
from repetitions import repeated
from tendonfmu.diagnosis.diagnosis import diagnose
from tendonfmu.errors import InputError
from tendonfmu.files.tables import write_table
from tendonfmu.model.description import read_finger
from tendonfmu.report.diagnosis_files import write_diagnosis

SCHEMA = json.loads((files("tendonfmu") / "schema" / "diagnosis.schema.json").read_text(encoding="utf-8"))
NAMES = list(QUIRKS)
COUNT = len(NAMES)  # each quirk once, with another one beside it in a third of the pairs
USUAL = [
    NAMES.index(name)
    for name in (
        "other_tendon_count",
        "hardly_free",
        "presliding_is_there",
        "viscous_alone",
        "few_samples",
    )
]
# of Python, not of a user's language
_CODE = re.compile(
    r"\b\w+(Error|Exception|Warning)\b|Traceback|internal|object at 0x|numpy|\bNone\b|<class|\bNoneType\b"
)
_OPTION = re.compile(r"--[a-z][a-z-]+")
OPTIONS = ("--test", "--kinematics", "--least-gain", "--seed", "--jobs")


def written(folder: Path, pair: Pair) -> tuple[Path, list[Path], list[Path]]:
    """Files of a pair: description, recordings, tests."""
    folder.mkdir(parents=True, exist_ok=True)
    finger = folder / "finger.json"
    finger.write_text(json.dumps(pair.description), encoding="utf-8")
    recordings = [recorded(folder / f"train_{k}.parquet", each) for k, each in enumerate(pair.recordings)]
    tests = [recorded(folder / f"test_{k}.parquet", each) for k, each in enumerate(pair.tests)]
    return finger, recordings, tests


def recorded(file: Path, columns: Columns) -> Path:
    table: dict[str, Any] = {}
    for name, values in columns.items():
        single = {name: values} if values.ndim == 1 else {}
        table |= single or {f"{name}[{k + 1}]": values[:, k] for k in range(values.shape[1])}
    write_table(file, table)
    return file


def faults_of(pair: Pair, folder: Path) -> list[str]:
    """What is wrong with the answer to a pair; nothing, it should be."""
    finger, recordings, tests = written(folder, pair)
    try:
        found = diagnose(finger, recordings, tests, kinematics=pair.kinematics)
    except InputError as refused:
        return list(faults_of_refusal(str(refused), [finger, *recordings, *tests]))
    write_diagnosis(found, folder / "out")
    return list(faults_of_report(folder / "out"))


def faults_of_refusal(message: str, given: list[Path]) -> Iterator[str]:
    if not any(file.name in message for file in given):
        yield f"names no file: {message}"
    if "expected" not in message and "; probably " not in message:  # a recording that does not belong: what to write
        yield f"does not say what was expected: {message}"
    if "\n" in message or _CODE.search(message):
        yield f"is not one line of plain words: {message}"


def faults_of_report(folder: Path) -> Iterator[str]:
    constants: list[str] = []
    report = json.loads((folder / "diagnosis.json").read_text(encoding="utf-8"), parse_constant=constants.append)
    if constants:
        yield f"diagnosis.json holds {constants}"
        return
    yield from (
        f"{error.json_path}: {error.message}" for error in jsonschema.Draft202012Validator(SCHEMA).iter_errors(report)
    )
    gain = report["gain"]["value"]
    if gain is None or not math.isfinite(gain) or gain < 0:
        yield f"gain = {gain}"
    if set(report["files"]) != {file.name for file in folder.iterdir()}:
        yield "files: not those in the folder"
    for name in ("nominal.json", "extended.json"):
        read_finger(folder / name)
    for text in report["warnings"]:
        yield from (f"no option of diagnose: {text}" for option in _OPTION.findall(text) if option not in OPTIONS)
    sentences = [*report["warnings"], report["next_experiment"], report["unexplained"]["description"]]
    yield from (f"not in plain words: {text}" for text in sentences if _CODE.search(text) or "nan" in text.split())


@pytest.mark.parametrize(
    "seed", [pytest.param(seed, marks=[] if seed in USUAL else pytest.mark.long) for seed in range(COUNT)]
)
def test_a_pair_gets_a_diagnosis_or_a_refusal(seed: int, tmp_path: Path) -> None:
    pair = make_pair(seed)
    try:
        faults = faults_of(pair, tmp_path)
    except Exception as fault:
        raise AssertionError(f"seed {seed}, {', '.join(pair.quirks)}: {type(fault).__name__}: {fault}") from fault
    assert faults == [], f"seed {seed}, {', '.join(pair.quirks)}"


# --- the options ------------------------------------------------------------------------------------------------------

WORDS = (
    *("finger.json", "a.csv", "b.csv", "copy.csv", "gone.csv", "out", ".", "", "-", "--", "é\u2028", "/dev/null"),
    *("-o", "--output", "--test", "--kinematics", "--seed", "--jobs", "--least-gain", "--progress", "--no-progress"),
    *("--test=b.csv", "--seed=-1", "--kinematics=2", "--least-gain=nan", "--least-gain=0.1", "--jobs=1e9", "-o=out"),
    *("0", "1", "2", "3", "65", "-1", "1e400", "nan", "inf", "0.5", "0.6", "two", "--frobnicate", "-x", "--help"),
)


@pytest.fixture
def answered(monkeypatch: pytest.MonkeyPatch) -> Callable[[], int]:
    """Puts a diagnosis in the place of the computation; gives how often it was asked for."""
    found, calls = examples.adequate(), 0

    def answer(*_: Any, **options: Any) -> Any:
        nonlocal calls
        calls += 1
        assert 0 <= options["least_gain"] <= 0.5 and options["kinematics"] in (1, 2, 3) and 1 <= options["jobs"] <= 64
        return found

    monkeypatch.setattr("tendonfmu.interface.diagnosing.find", answer)
    monkeypatch.setattr("tendonfmu.interface.diagnosing.write_diagnosis", lambda found, folder: {})
    return lambda: calls


@pytest.mark.parametrize("count", repeated([50, 400], 0))
def test_any_options_are_taken_or_refused_in_a_line(
    call: Call, tmp_path: Path, answered: Callable[[], int], count: int
) -> None:
    for name in ("finger.json", "a.csv", "b.csv"):
        (tmp_path / name).write_text(name)
    (tmp_path / "copy.csv").write_text("a.csv")
    before = {file.name for file in tmp_path.iterdir()}
    rng = np.random.default_rng(5)
    for _ in range(count):
        words = [str(rng.choice(WORDS)) for _ in range(int(rng.integers(0, 8)))]
        if rng.random() < 0.6:  # a command line that is nearly sound
            usual = ["finger.json", "a.csv", "-o", "out"]
            words = [*usual, *words] if rng.random() < 0.5 else [*words, *usual]
        answer = call("diagnose", *words)
        assert answer.status in (0, 2), (words, answer)
        if answer.status == 2:
            assert answer.err.startswith("tendonfmu: ") and answer.err.count("\n") == 1, (words, answer)
        assert {file.name for file in tmp_path.iterdir()} == before, words
    assert answered() > count / 20
