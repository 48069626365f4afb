"""Logs with several clocks, stamps, units of pint, matrices and structs; what is missing, and long logs."""

from __future__ import annotations

import importlib
import json
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from command import Call
from made_logs import FORMATS, START, TYPE, header, ros_store, sound, truth, write
from map_cases import LOG, SMALL, VALIDATOR, edited, written
from tendonfmu.errors import InputError
from tendonfmu.files.tables import read_table, write_blocks, write_table
from tendonfmu.recordings.converters import text_log, units
from tendonfmu.recordings.converters.inspection import inspect_log
from tendonfmu.recordings.converters.table import Conversion, convert_table

# --- several clocks ---------------------------------------------------------------------------------------------------


def two_topics(folder: Path, gap: int = 0, plugin: str = "SQLITE3", late: int = 2_000_000, every: int = 2) -> Path:
    """A bag: tendons at 200 Hz, joint states at 100 Hz in changing order, 2 ms later; samples lost from 1 s on.

    late: ns. every: tendon samples for each of the joint states.
    """
    from rosbags.rosbag2 import StoragePlugin, Writer

    store = ros_store()
    joint_state = store.types["sensor_msgs/msg/JointState"]
    none = np.array([])
    with Writer(folder / "bag", version=9, storage_plugin=StoragePlugin[plugin]) as out:
        tendons = out.add_connection("/hand", TYPE, typestore=store)
        joints = out.add_connection("/joint_states", "sensor_msgs/msg/JointState", typestore=store)
        for k in range(400):
            ns = START + k * 5_000_000
            message = store.types[TYPE](header=header(store, ns), force=10.0 + k, spool=1.0)
            out.write(tendons, ns, store.serialize_cdr(message, TYPE))
            if k % every or 200 <= k < 200 + gap:
                continue
            angle = 0.001 * (k + 0.4)  # at its own time: 2 ms are 0.4 samples of the tendons
            names, position = (["tip", "knuckle"], [9.0, angle]) if k % 4 else (["knuckle", "tip"], [angle, 9.0])
            stamp = header(store, ns + late)
            state = joint_state(header=stamp, name=names, position=np.array(position), velocity=none, effort=none)
            out.write(joints, ns + late, store.serialize_cdr(state, "sensor_msgs/msg/JointState"))
    return folder / "bag"


def bag_map(**more: Any) -> dict[str, Any]:
    columns = {
        "time": {"column": "/hand.header.stamp", "unit": "datetime"},
        "tendon_force[1]": {"column": "/hand.force", "unit": "N"},
        "tendon_position[1]": {"column": "/hand.spool", "unit": "mm"},
        "joint_position[1]": {"column": "/joint_states.position[knuckle]", "unit": "rad"},
    }
    document = {"format": "tendonfmu-map-1", "columns": columns, **more}
    VALIDATOR.validate(document)
    return document


def with_map(folder: Path, document: dict[str, Any]) -> Path:
    (folder / "map.json").write_text(json.dumps(document), encoding="utf-8")
    return folder / "map.json"


@pytest.mark.parametrize("plugin", ["SQLITE3", "MCAP"])
def test_topics_come_onto_the_clock_of_the_time(tmp_path: Path, plugin: str) -> None:
    """Joint states by name, interpolated at the tendons' stamps; the ends without joint states are left out."""
    log = convert_table(two_topics(tmp_path, plugin=plugin), with_map(tmp_path, bag_map()))
    found = log.columns
    assert found["time"][0] == pytest.approx(0.005) and len(found["time"]) == 398
    assert found["tendon_force[1]"] == pytest.approx(10 + found["time"] / 0.005)
    assert found["joint_position[1]"] == pytest.approx(0.001 * found["time"] / 0.005, abs=1e-12)
    assert any("interpolated onto one clock; its largest gap is 10 ms" in note for note in log.notes)


def test_gaps_are_refused_or_left_out(tmp_path: Path) -> None:
    bag = two_topics(tmp_path, gap=60)
    with pytest.raises(InputError, match=r"/joint_states: a gap of 0\.31 s.*at most 0\.1 s.*leave out"):
        convert_table(bag, with_map(tmp_path, bag_map()))
    log = convert_table(bag, with_map(tmp_path, bag_map(resample={"gaps": "leave out"})))
    assert any("in gaps are left out" in note for note in log.notes)
    assert not ((log.columns["time"] > 0.993) & (log.columns["time"] < 1.3)).any()
    assert log.columns["joint_position[1]"] == pytest.approx(0.001 * log.columns["time"] / 0.005, abs=1e-12)
    log = convert_table(bag, with_map(tmp_path, bag_map(resample={"largest_gap": 1.0, "rate": 50.0})))
    assert np.diff(log.columns["time"]) == pytest.approx(0.02) and len(log.columns["time"]) == 100
    assert log.columns["tendon_force[1]"] == pytest.approx(10 + log.columns["time"] / 0.005)


def test_a_topic_without_the_same_clock_needs_one_in_the_map(tmp_path: Path) -> None:
    bag = two_topics(tmp_path)
    document = bag_map()
    document["columns"]["time"]["column"] = "/hand.@log_time"
    assert len(convert_table(bag, with_map(tmp_path, document)).columns["time"]) == 398
    document["log"] = {"clocks": {"/joint_states": {"column": "/joint_states.header.stamp", "unit": "datetime"}}}
    assert len(convert_table(bag, with_map(tmp_path, document)).columns["time"]) == 398
    document["log"]["clocks"]["/joint_states"]["unit"] = "s"
    with pytest.raises(InputError, match=r"log\.clocks\./joint_states: a clock of another kind"):
        convert_table(bag, with_map(tmp_path, document))


def test_groups_of_hdf5_with_and_without_clocks(tmp_path: Path) -> None:
    import h5py

    t = np.arange(100) / 100.0
    with h5py.File(tmp_path / "log.h5", "w") as h5:
        h5["a/time"], h5["a/force"] = t, np.c_[t, 10 + t]
        h5["a/force"].attrs["unit"] = "N"
        h5["b/time"], h5["b/spool"] = t[::2] + 0.001, 2 * (t[::2] + 0.001)
    columns = {
        "time": {"column": "/a/time", "unit": "s"},
        "tendon_force[1]": {"column": "/a/force[2]", "unit": "N"},
        "tendon_position[1]": {"column": "/b/spool", "unit": "m"},
    }
    document = {"format": "tendonfmu-map-1", "columns": columns}
    found = convert_table(tmp_path / "log.h5", with_map(tmp_path, document)).columns
    assert found["tendon_force[1]"] == pytest.approx(10 + found["time"])
    assert found["tendon_position[1]"] == pytest.approx(2 * found["time"]) and len(found["time"]) == 98
    with h5py.File(tmp_path / "log.h5", "a") as h5:
        del h5["b/time"]
    with pytest.raises(InputError, match=r'/b.* has another clock than /a.*"clocks"'):
        convert_table(tmp_path / "log.h5", with_map(tmp_path, document))


def test_structs_and_matrices_of_matlab(tmp_path: Path) -> None:
    """Signals in rows, arrays of structs, and an object that no library reads."""
    from scipy import io

    t = np.arange(50.0)
    signals = np.array([({"values": np.c_[t, t + 1]},), ({"values": 3 * t},)], dtype=[("data", object)])
    io.savemat(tmp_path / "log.mat", {"out": {"time": t, "signals": signals, "rows": np.r_[[t], [t + 5]]}})
    columns = {
        "time": {"column": "out.time", "unit": "ms"},
        "tendon_force[1]": {"column": "out.rows[2]", "unit": "N"},
        "tendon_position[1]": {"column": "out.signals[1].data.values[2]", "unit": "mm"},
    }
    document = {"format": "tendonfmu-map-1", "columns": columns}
    found = convert_table(tmp_path / "log.mat", with_map(tmp_path, document)).columns
    assert found["tendon_force[1]"].tolist() == (t + 5).tolist()
    assert found["tendon_position[1]"] == pytest.approx((t + 1) / 1000)


# --- time -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("stamps", "wanted"),
    [
        (["2026-03-29T01:59:59.5+01:00", "2026-03-29T03:00:00+02:00", "2026-03-29T03:00:00.25+02:00"], {}),
        (["2026-03-29 01:59:59.5", "2026-03-29 03:00:00", "2026-03-29 03:00:00.25"], {"zone": "Europe/Berlin"}),
        (["29.03.2026 01:59:59.500000", "29.03.2026 03:00:00.000000", "29.03.2026 03:00:00.250000"],
         {"zone": "Europe/Berlin", "pattern": "%d.%m.%Y %H:%M:%S.%f"}),
        (["1774746000.5", "1774746001", "1774746001.250000001"], {"unit": "epoch_s"}),
        (["1774746000500", "1774746001000", "1774746001250"], {"unit": "epoch_ms"}),
        (["1774746000500000000", "1774746001000000000", "1774746001250000001"], {"unit": "epoch_ns"}),
    ],
)  # fmt: skip
def test_stamps_become_seconds_from_the_first(tmp_path: Path, stamps: list[str], wanted: dict[str, Any]) -> None:
    """Across the night in which summer time begins; nanoseconds are exact."""
    log = "t,force,spool\n" + "".join(f"{stamp},1,5\n" for stamp in stamps)
    document = edited(SMALL, "columns/time", {"column": "t", "unit": "datetime", **wanted})
    VALIDATOR.validate(document)
    found = convert_table(*written(tmp_path, log, document)).columns["time"]
    last = 0.750000001 if stamps[2].endswith("000001") and "unit" in wanted else 0.75
    assert found == pytest.approx([0.0, 0.5, last], rel=0, abs=1e-15)


def test_stamps_of_parquet(tmp_path: Path) -> None:
    time = pd.to_datetime([0, 2_000_000, 4_000_001], unit="ns")
    pd.DataFrame({"t": time, "force": 1.0, "spool": 2.0}).to_parquet(tmp_path / "log.parquet")
    document = edited(SMALL, "columns/time/unit", "datetime")
    found = convert_table(tmp_path / "log.parquet", with_map(tmp_path, document)).columns["time"]
    assert found.tolist() == [0.0, 0.002, 0.004000001]


@pytest.mark.parametrize(
    ("stamp", "unit", "words"),
    [
        ("noon", "datetime", ["row 2", "'noon'", "2026-05-01T12:00:00.5Z", "pattern"]),
        ("noon", "epoch_s", ["row 2", "'noon'", "epoch_s"]),
        ("1e300", "epoch_s", ["row 2", "epoch_s"]),
        ("", "datetime", ["row 2"]),
    ],
)
def test_wrong_stamps_are_refused_by_row(tmp_path: Path, stamp: str, unit: str, words: list[str]) -> None:
    start = "2026-05-01T12:00:00Z" if unit == "datetime" else "1774746000"
    log = f"t,force,spool\n{start},1,5\n{stamp},1,5\n"
    with pytest.raises(InputError) as refused:
        convert_table(*written(tmp_path, log, edited(SMALL, "columns/time", {"column": "t", "unit": unit})))
    assert all(word in str(refused.value) for word in words), refused.value


# --- a time in two columns, as ROS writes it into tables --------------------------------------------------------------

FIRST, STEP, ROWS = 1_727_769_340_123_456_789, 33_333_331, 400  # ns


def split_log(folder: Path, suffix: str, names: tuple[str, str] = ("header.stamp.sec", "header.stamp.nanosec")) -> Path:
    stamps = FIRST + STEP * np.arange(ROWS)
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
    file = split_log(tmp_path, suffix)
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
    (topic,) = inspect_log(split_log(tmp_path, ".csv", names)).topics
    assert topic.clock is not None and topic.clock.name.startswith(f"{names[0]}+") and topic.clock.step == STEP


def test_columns_that_do_not_belong_together_stay_apart(tmp_path: Path) -> None:
    (topic,) = inspect_log(split_log(tmp_path, ".csv", ("left.sec", "right.nanosec"))).topics
    assert not any("+" in field.field.name for field in topic.fields)


def test_a_part_that_is_missing_is_named_by_row(tmp_path: Path) -> None:
    file = split_log(tmp_path, ".csv")
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


# --- units ------------------------------------------------------------------------------------------------------------


def test_units_of_pint(tmp_path: Path) -> None:
    """Its names are taken if they are of the right kind; angles are no plain numbers."""
    ounce_inch = 0.45359237 / 16 * 9.80665 * 0.0254  # N.m, by definition
    assert units.factor("ozf*inch", units.TORQUE) == pytest.approx(ounce_inch, rel=1e-12)
    assert units.factor("hour", units.TIME) == pytest.approx(3600.0)
    assert units.factor("arcmin", units.ANGLE) == pytest.approx(np.pi / 180 / 60)
    for name, known in (
        ("hour", units.FORCE),
        ("percent", units.ANGLE),
        ("Hz", units.ANGULAR_SPEED),
        ("?!", units.FORCE),
    ):
        assert units.factor(name, known) is None, name
    found = convert_table(*written(tmp_path, LOG, edited(SMALL, "columns/tendon_force[1]/unit", "dyn"))).columns
    assert found["tendon_force[1]"] == pytest.approx([1e-8, 2e-8, 3e-8])


def test_the_table_agrees_with_pint() -> None:
    for what, table in units.QUANTITIES.items():
        reference = next(unit for unit, value in table.items() if value == 1.0)
        for name, value in table.items():
            by_pint = units._factor_by_pint(name.replace(".", "*"), reference.replace(".", "*"))
            assert by_pint == pytest.approx(value, rel=1e-12), (what, name)


@pytest.mark.parametrize(("name", "library"), [("MCAP, JSON", "mcap"), ("HDF5", "h5py"), ("ROS 2 bag, db3", "rosbags")])
def test_a_missing_library_says_how_to_install_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, library: str
) -> None:
    form = FORMATS[name]
    file = write(tmp_path, form, sound())
    real = importlib.import_module

    def without(module: str, package: str | None = None) -> Any:
        if module.split(".")[0] == library:
            raise ModuleNotFoundError(f"No module named {library!r}", name=library)
        return real(module, package)

    monkeypatch.setattr(importlib, "import_module", without)
    with pytest.raises(InputError, match=rf"needs the Python package {library},.*pip install h5py mcap"):
        convert_table(file, with_map(tmp_path, form.map()))


# --- long logs, and what is written -----------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["CSV", "CSV in gzip", "CSV, comments, units, UTF-16"])
def test_blocks_give_what_the_whole_gives(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    """Blocks of 100 bytes, cut anywhere in a line, a character or a row."""
    form = FORMATS[name]
    file = write(tmp_path, form, sound())
    monkeypatch.setattr(text_log, "CHUNK", 101)
    conversion = Conversion(file, with_map(tmp_path, form.map()))
    blocks = list(conversion.recording())
    assert conversion.in_blocks and len(blocks) > 20
    for key, values in truth().items():
        assert np.concatenate([block[key] for block in blocks]) == pytest.approx(values, rel=1e-12, abs=1e-15)
    write_blocks(tmp_path / "rec.parquet", blocks)
    again = read_table(tmp_path / "rec.parquet", lambda *_: None)
    assert again["time"].tolist() == np.concatenate([block["time"] for block in blocks]).tolist()


def test_faults_between_blocks_are_named_by_row(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(text_log, "CHUNK", 64)
    rows = [f"{k},1,5" for k in range(100)]
    for k, line, words in (
        (61, "61,much,5", "row 62: 'much'"),
        (40, "2,1,5", "row 41"),
        (70, "70,1", "row 71: 2 fields"),
    ):
        log = "\n".join(["t,force,spool", *rows[:k], line, *rows[k + 1 :]]) + "\n"
        with pytest.raises(InputError, match=words):
            convert_table(*written(tmp_path, log))


def test_a_block_without_a_whole_row_does_not_set_the_start(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Time counts from the first row that is kept, though blocks before it have none."""
    monkeypatch.setattr(text_log, "CHUNK", 64)
    rows = [f"{1774746000 + k},{'' if k < 20 else 1},5" for k in range(40)]
    wanted = edited(SMALL, "columns/time", {"column": "t", "unit": "epoch_s"}) | {"log": {"missing": "leave out"}}
    found = convert_table(*written(tmp_path, "\n".join(["t,force,spool", *rows]) + "\n", wanted)).columns
    assert found["time"] == pytest.approx(np.arange(20), abs=1e-12)


def test_mcap_that_is_written_reads_back(call: Call, tmp_path: Path) -> None:
    written(tmp_path)
    answer = call("convert", "table", "log.csv", "--map", "map.json", "-o", "rec.mcap")
    assert answer.status == 0 and "3 samples" in answer.err
    answer = call("convert", "inspect", "rec.mcap", "-o", "again.json")
    assert answer.status == 0, answer.err
    answer = call("convert", "table", "rec.mcap", "--map", "again.json", "-o", "rec.parquet")
    assert answer.status == 0, answer.err
    expected = convert_table(*written(tmp_path)).columns
    found = read_table(tmp_path / "rec.parquet", lambda *_: None)
    assert {name: values.tolist() for name, values in found.items()} == {k: v.tolist() for k, v in expected.items()}


def test_what_mcap_cannot_hold_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"time -1 to 0 s; MCAP holds times from 0 s on"):
        write_table(tmp_path / "rec.mcap", {"time": np.array([-1.0, 0.0])})
    with pytest.raises(InputError, match="no column time"):
        write_table(tmp_path / "rec.mcap", {"force": np.array([1.0])})
    assert list(tmp_path.iterdir()) == []
