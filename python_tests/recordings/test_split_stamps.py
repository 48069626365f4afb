"""A time in two columns, as ROS writes it into tables."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from command import Call
from tendonfmu.errors import InputError
from tendonfmu.recordings.converters.inspection import inspect_log
from tendonfmu.recordings.converters.table import convert_table

START, STEP, ROWS = 1_727_769_340_123_456_789, 33_333_331, 400  # ns


def log(folder: Path, suffix: str, names: tuple[str, str] = ("header.stamp.sec", "header.stamp.nanosec")) -> Path:
    stamps = START + STEP * np.arange(ROWS)
    bend = np.sin(0.05 * np.arange(ROWS))
    table = pd.DataFrame(
        {names[0]: stamps // 10**9, names[1]: stamps % 10**9, "force [N]": 10 + bend, "spool [mm]": bend}
    )
    file = folder / f"log{suffix}"
    if suffix == ".csv":
        table.to_csv(file, index=False, sep=";", decimal=",")
    else:
        table.to_parquet(file)
    return file


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_inspect_proposes_the_joined_time_and_the_nanoseconds_stay(call: Call, tmp_path: Path, suffix: str) -> None:
    file = log(tmp_path, suffix)
    answer = call("convert", "inspect", file, "-o", "map.json")
    assert answer.status == 0, answer.err
    proposed = json.loads((tmp_path / "map.json").read_text(encoding="utf-8"))
    time = proposed["columns"]["time"]
    assert (time["column"], time["unit"]) == ("header.stamp.sec+nanosec", "datetime")
    assert suffix != ".csv" or proposed["log"]["separator"] == ";"
    made = convert_table(file, tmp_path / "map.json").columns
    np.testing.assert_allclose(made["time"], 1e-9 * STEP * np.arange(ROWS), rtol=0, atol=1e-12)
    np.testing.assert_allclose(made["tendon_position[1]"], 1e-3 * np.sin(0.05 * np.arange(ROWS)), rtol=1e-12)


@pytest.mark.parametrize("names", [("secs", "nsecs"), ("stamp_sec", "stamp_nsec"), ("t.seconds", "t.nanos")])
def test_other_names_of_both(tmp_path: Path, names: tuple[str, str]) -> None:
    (topic,) = inspect_log(log(tmp_path, ".csv", names)).topics
    assert topic.clock is not None and topic.clock.name.startswith(f"{names[0]}+") and topic.clock.step == STEP


def test_columns_that_do_not_belong_together_stay_apart(tmp_path: Path) -> None:
    (topic,) = inspect_log(log(tmp_path, ".csv", ("left.sec", "right.nanosec"))).topics
    assert not any("+" in field.field.name for field in topic.fields)


def test_a_part_that_is_missing_is_named_by_row(tmp_path: Path) -> None:
    file = log(tmp_path, ".csv")
    table = pd.read_csv(file, sep=";", decimal=",").astype({"header.stamp.nanosec": float})
    table.loc[7, "header.stamp.nanosec"] = np.nan
    table.to_csv(file, index=False)
    columns = {
        "time": {"column": "header.stamp.sec+nanosec", "unit": "datetime"},
        "tendon_force[1]": {"column": "force [N]", "unit": "N"},
        "tendon_position[1]": {"column": "spool [mm]", "unit": "mm"},
    }
    (tmp_path / "map.json").write_text(json.dumps({"format": "tendonfmu-map-1", "columns": columns}), encoding="utf-8")
    with pytest.raises(InputError, match=r"column header\.stamp\.nanosec, row 8: nan; expected a part of a time"):
        convert_table(file, tmp_path / "map.json")
