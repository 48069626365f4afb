"""`convert table`: logs in random units, signs, zeros and separators read back; what is refused; one-joint machines."""

from __future__ import annotations

import gzip
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pandas as pd
import pytest

from command import Call
from map_cases import LOG, SCHEMA, SMALL, TURNING, VALIDATOR, edited, written
from tendonfmu.errors import InputError
from tendonfmu.files.tables import write_table
from tendonfmu.recordings.converters import units
from tendonfmu.recordings.converters.table import convert_table
from tendonfmu.recordings.recording import read_recording

ROWS = 200

# --- what is read -----------------------------------------------------------------------------------------------------


def test_values_become_si(tmp_path: Path) -> None:
    found = convert_table(*written(tmp_path)).columns
    assert found["time"].tolist() == [0.0, 0.002, 0.004]
    assert found["tendon_force[1]"].tolist() == [1.0, 2.0, 3.0]
    assert found["tendon_position[1]"].tolist() == pytest.approx([0.0, 0.001, 0.002], abs=1e-18)


def random_recording(random: np.random.Generator) -> dict[str, Any]:
    """Columns in SI."""
    columns: dict[str, Any] = {"time": np.cumsum(random.uniform(1e-3, 3e-3, ROWS))}
    for group, count in (("tendon", random.integers(1, 5)), ("joint", random.integers(1, 3))):
        names = {"tendon": ["tendon_force", "tendon_position"], "joint": ["joint_position", "external_torque"]}[group]
        columns |= {f"{name}[{i}]": random.normal(0.0, 3.0, ROWS) for name in names for i in range(1, count + 1)}
    if random.random() < 0.5:
        columns["contact"] = (random.random(ROWS) < 0.3).astype(float)
    return columns


@pytest.mark.parametrize("seed", range(40))
def test_random_logs_read_back(tmp_path: Path, seed: int) -> None:
    """Any units, signs, scales, zeros, separators, order and text beside; to rounding of the numbers themselves."""
    random = np.random.default_rng(seed)
    recording = random_recording(random)
    separator = str(random.choice([",", ";", "\t", "|", " "]))
    decimal = "," if separator in ";\t|" and random.random() < 0.5 else "."
    by_number, skip = random.random() < 0.3, int(random.integers(0, 3))
    names = {column: f"signal_{k}" for k, column in enumerate(random.permutation(list(recording)))}
    readings: dict[str, Any] = {}
    wanted: dict[str, Any] = {}
    errors = {}
    for column, name in names.items():
        known = units.OF_COLUMN[column.split("[")[0]]
        unit = str(random.choice(list(known)))
        plain = column in ("time", "contact")
        sign = 1 if plain else int(random.choice([1, -1]))
        scale = 1.0 if plain else float(random.uniform(0.1, 10.0))
        offset = 0.0 if plain else float(random.normal(0.0, 2.0))
        factor = known[unit] * scale
        readings[name] = sign * recording[column] / factor + offset
        errors[column] = 1e-15 * (np.abs(recording[column]).max() + abs(offset) * factor) * 4
        wanted[column] = {"column": name, "unit": unit, "sign": sign, "scale": scale, "offset": offset}
    readings["remark"] = np.array(["go"] * ROWS)
    if by_number:
        for column in wanted.values():
            column["column"] = list(readings).index(column["column"]) + 1
    log = {"header": not by_number, "skip": skip, "decimal": decimal} | ({"separator": separator} if seed % 2 else {})
    document = {"format": "tendonfmu-map-1", "log": log, "columns": wanted}
    VALIDATOR.validate(document)
    rows = zip(*(values.tolist() for values in readings.values()), strict=True)
    lines = [separator.join(str(each).replace(".", decimal) for each in row) for row in rows]
    text = "\n".join(["made by a machine"] * skip + ([] if by_number else [separator.join(readings)]) + lines) + "\n"
    name = str(random.choice(["log.csv", "log.txt", "log.csv.gz"]))
    content = gzip.compress(text.encode()) if name.endswith("gz") else text.encode()
    found = convert_table(*written(tmp_path, content, document, name)).columns
    assert found.keys() == recording.keys()
    for column, values in recording.items():
        assert np.abs(found[column] - values).max() <= errors[column], column
    write_table(tmp_path / "rec.parquet", found)
    assert len(read_recording(tmp_path / "rec.parquet")) == ROWS


def test_the_first_reading_may_be_the_zero(tmp_path: Path) -> None:
    """A clock of nanoseconds since 1970, which starts at 0 then."""
    log = LOG.replace("\n0,", "\n1700000000000000000,").replace("\n2,", "\n1700000000002000128,")
    log = log.replace("\n4,", "\n1700000000004000000,")
    wanted = edited(SMALL, "columns/time", {"column": "t", "unit": "ns", "offset": "first"})
    assert convert_table(*written(tmp_path, log, wanted)).columns["time"] == pytest.approx([0, 0.002, 0.004], abs=1e-6)


def test_a_last_line_without_its_end_is_left_out_and_said(tmp_path: Path) -> None:
    found = convert_table(*written(tmp_path, LOG + "6,0.00"))
    assert len(found.columns["time"]) == 3
    assert "'6,0.00'" in found.notes[0] and "left out" in found.notes[0]


# --- what is refused --------------------------------------------------------------------------------------------------

BAD_MAPS = [
    ("format", "tendonfmu-map-2", ["format", "tendonfmu-map-1"]),
    ("columns", ..., ["joint: missing", "columns"]),
    ("unknown", 1, ["unknown", "expected one of format"]),
    ("joint", TURNING["joint"], ["joint", "one of the two"]),
    ("columns/time", ..., ["columns.time: missing"]),
    ("columns/tendon_position[1]", ..., ["columns.tendon_position[1]: missing"]),
    ("columns/tendon_force[3]", {"column": "x", "unit": "N"}, ["columns.tendon_force[2]: missing"]),
    ("columns/tendon_forces[1]", {"column": "x", "unit": "N"}, ["tendon_forces[1]", "tendon_force[1]"]),
    ("columns/tendon_force", {"column": "x", "unit": "N"}, ["columns.tendon_force", "tendon_force[1]"]),
    ("columns/time/unit", "newton", ["columns.time.unit", '"newton"', "s, ms, us, ns", "datetime"]),
    ("columns/time/unit", "?", ["columns.time.unit", "convert inspect", "s, ms, us, ns"]),
    ("columns/tendon_force[1]/column", "?", ["tendon_force[1].column", "convert inspect", "name of a column"]),
    ("columns/time/zone", "UTC", ["columns.time.zone", "datetime"]),
    ("columns/time", {"column": "t", "unit": "datetime", "zone": "Mars/Base"}, ["time.zone", "Europe/Berlin"]),
    ("columns/time", {"column": "t", "unit": "epoch_s", "offset": 3}, ["time.offset", "first row"]),
    ("columns/tendon_force[1]/unit", "mm", ["tendon_force[1].unit", "N, mN, kN"]),
    ("columns/tendon_force[1]/unit", ..., ["tendon_force[1].unit: missing", "N, mN"]),
    ("columns/tendon_force[1]/sign", 0, ["sign", "1 or -1"]),
    ("columns/tendon_force[1]/scale", 0, ["scale", "above 0"]),
    ("columns/tendon_force[1]/offset", "last", ["offset", "number"]),
    ("columns/tendon_force[1]/colour", "red", ["colour", "column, unit, sign, scale, offset"]),
    ("columns/tendon_force[1]/column", 0, ["column = 0", "number from 1"]),
    ("columns/tendon_force[1]/column", ..., ["column: missing"]),
    ("log", {"separator": ":"}, ["log.separator", '";"']),
    ("log", {"thousands": "x"}, ["log.thousands", "expected"]),
    ("log", {"header": 1}, ["log.header", "true or false"]),
    ("log", {"skip": -1}, ["log.skip"]),
    ("log", {"encoding": "klingon"}, ["log.encoding", "utf-16"]),
    ("log", {"missing": "guess"}, ["log.missing", "leave out"]),
    ("log", {"missing": "?"}, ["log.missing", "expected a decision", "refuse or leave out"]),
    ("log", {"disorder": "ignore"}, ["log.disorder", "sort"]),
    ("resample", {"rate": 0}, ["resample.rate", "above 0"]),
]


@pytest.mark.parametrize(("path", "value", "words"), BAD_MAPS, ids=[f"{path}={value}" for path, value, _ in BAD_MAPS])
def test_wrong_maps_are_refused_by_key(tmp_path: Path, path: str, value: Any, words: list[str]) -> None:
    document = edited(SMALL, path, value)
    file, wanted = written(tmp_path, wanted=document)
    with pytest.raises(InputError) as refused:
        convert_table(file, wanted)
    line = str(refused.value)
    assert line.startswith(f"{wanted}: ") and "\n" not in line
    assert all(word in line for word in words), line
    # a schema knows neither relations between values, nor the units of pint, nor the names of encodings and zones
    relation = path == "columns/tendon_force[3]"
    open_name = path.endswith("/unit") or "?" in str(value) or "zone" in str((path, value)) or "encoding" in str(value)
    assert relation or open_name or "offset" in str(value) or not VALIDATOR.is_valid(document)


@pytest.mark.parametrize(
    ("log", "words"),
    [
        ("", ["no line"]),
        ("t,force,spool,note\n", ["no samples"]),
        (LOG.replace("force", "Forces"), ["'force'", "columns.tendon_force[1]", "it has Forces"]),
        (LOG.replace("note", "t"), ["'t'", "2 times"]),
        (LOG.replace("0.002", "much"), ["column force", "row 2", "'much'", "number"]),
        (LOG.replace("0.002", "nan"), ["column force", "row 2", "number"]),
        (LOG.replace("0.002", ""), ["column force", "row 2", "''"]),
        (LOG.replace("0.002", "1_0"), ["column force", "row 2", "'1_0'"]),
        (LOG.replace("4,b", "4"), ["row 2", "3 fields", "expected 4"]),
        (LOG.replace("\n4,", "\n2,"), ["column t", "row 3", "2.0 after 2.0", "increasing"]),
        (LOG.replace("\n2,", "\n9,"), ["column t", "row 3", "4.0 after 9.0"]),
        (b"t,force\n\xff\xfe\x00", ["not a text file"]),
        (b"t,\0", ["not a text file"]),
    ],
)
def test_wrong_logs_are_refused_by_column_and_row(tmp_path: Path, log: str | bytes, words: list[str]) -> None:
    file, wanted = written(tmp_path, log)
    with pytest.raises(InputError) as refused:
        convert_table(file, wanted)
    line = str(refused.value)
    assert line.startswith(f"{file}: ") and "\n" not in line
    assert all(word in line for word in words), line


def test_other_refusals(tmp_path: Path) -> None:
    file, wanted = written(tmp_path)
    with pytest.raises(InputError, match=r"absent\.csv: no such file"):
        convert_table(tmp_path / "absent.csv", wanted)
    with pytest.raises(InputError, match=r"log\.xlsx: unknown format"):
        convert_table(written(tmp_path, name="log.xlsx")[0], wanted)
    with pytest.raises(InputError, match=r"gz: not a gzip file"):
        convert_table(written(tmp_path, LOG, name="log.csv.gz")[0], wanted)
    with pytest.raises(InputError, match="not a whole Parquet file"):
        convert_table(written(tmp_path, name="log.parquet")[0], wanted)
    with pytest.raises(InputError, match=r"columns\.time\.column = 9: .* has 4 columns"):
        convert_table(file, written(tmp_path, wanted=edited(SMALL, "columns/time/column", 9))[1])
    labelled = edited(SMALL, "columns/contact", {"column": "force"})
    with pytest.raises(InputError, match=r"column force, row 1: 0\.001; expected 0 or 1"):
        convert_table(*written(tmp_path, wanted=labelled))
    pd.DataFrame({"t": ["a"], "force": [1.0], "spool": [2.0]}).to_parquet(tmp_path / "log.parquet")
    with pytest.raises(InputError, match=r"column t, row 1: .*; expected numbers"):
        convert_table(tmp_path / "log.parquet", wanted)


def test_the_command_writes_whole_files_or_none(call: Call, tmp_path: Path) -> None:
    written(tmp_path, LOG.replace("0.002", "much"))
    for arguments, words in (
        (["log.csv", "--map", "map.json"], ["row 2"]),
        (["log.csv"], ["--map", "missing"]),
        (["log.csv", "--map", "map.json", "--mass", "3"], ["--mass", "--map or --finger"]),
        (["log.csv", "--map", "map.json", "--finger", "rec.csv"], ["two names"]),
        (["log.csv", "--map", "absent.json"], ["absent.json"]),
    ):
        answer = call("convert", "table", *arguments, "-o", "rec.csv")
        assert answer.status == 2 and len(answer.err.splitlines()) == 1
        assert all(word in answer.err for word in words), answer.err
    answer = call("convert", "davinci", "log.csv", "--map", "map.json", "-o", "rec.csv")
    assert answer.status == 2 and "--map" in answer.err
    written(tmp_path)
    answer = call("convert", "table", "log.csv", "--map", "map.json", "-o", "rec.csv", "--finger", "finger.json")
    assert answer.status == 2 and '"joint" instead of "columns"' in answer.err
    assert sorted(file.name for file in tmp_path.iterdir()) == ["log.csv", "map.json"]
    answer = call("convert", "table", "log.csv", "--map", "map.json", "-o", "map.json")
    assert answer.status == 2
    answer = call("convert", "table", "log.csv", "--map", "map.json", "-o", "rec.csv")
    assert answer.status == 0 and "3 samples" in answer.err


# --- the schema -------------------------------------------------------------------------------------------------------


def test_the_schema_says_what_every_key_is() -> None:
    jsonschema.Draft202012Validator.check_schema(SCHEMA)
    for wanted in (SMALL, TURNING):
        VALIDATOR.validate(wanted)
    stamps = {"time": tuple(units.STAMPS)}
    tables = {(*table, *stamps.get(name, ())) for name, table in units.QUANTITIES.items()}
    assert set(offered_units(SCHEMA)) == tables


def offered_units(node: Any) -> Iterator[tuple[str, ...]]:
    if isinstance(node, dict) and "anyOf" in node.get("properties", {}).get("unit", ()):
        yield tuple(node["properties"]["unit"]["anyOf"][0]["enum"])
    for inner in node.values() if isinstance(node, dict) else node if isinstance(node, list) else ():
        yield from offered_units(inner)
