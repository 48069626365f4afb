"""Text logs as people have them: each oddity is read, or refused by name with what to do."""

from __future__ import annotations

import datetime as dt
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from command import Call
from map_cases import VALIDATOR
from optional_parts import PARTS, needs
from tendonfmu.errors import InputError
from tendonfmu.recordings.converters.column_map import LogFormat
from tendonfmu.recordings.converters.inspection import Inspection, inspect_log
from tendonfmu.recordings.converters.proposal import propose
from tendonfmu.recordings.converters.table import convert_table

ROWS = 300
T = np.arange(ROWS) / 500.0
FORCE = np.round(1500.0 + 400.0 * np.cos(9.0 * T), 3)  # mN: with thousands
SPOOL = np.round(6.0 * np.sin(11.0 * T), 4)  # mm
NAMES = ["time", "force [mN]", "spool [mm]"]
CELLS = [[f"{t:.4f}", f"{force:.3f}", f"{spool:.4f}"] for t, force, spool in zip(T, FORCE, SPOOL, strict=True)]


def joined(rows: list[list[str]], separator: str = ",", end: str = "\n") -> str:
    return "".join(separator.join(row) + end for row in rows)


def table(change: Callable[[str], str], separator: str = ",", names: list[str] | None = None) -> str:
    return joined([names or NAMES, *([change(cell) for cell in row] for row in CELLS)], separator)


def grouped(mark: str, decimal: str) -> Callable[[str], str]:
    return lambda cell: f"{float(cell):,.4f}".replace(",", "\0").replace(".", decimal).replace("\0", mark)


UNITS, PLAIN = ["s", "mN", "mm"], ["time", "force", "spool"]
LVM = (
    "LabVIEW Measurement\t\nSeparator\tTab\nDecimal_Separator\t,\nDate\t2026/01/05\nTime\t10:30:25,12\n"
    "***End_of_Header***\t\n\t\nChannels\t2\t\t\t\nSamples\t300\t300\t\t\nY_Unit_Label\tmN\tmm\t\t\n"
    "X_Dimension\tTime\tTime\t\t\nX0\t0,0\t0,0\t\t\nDelta_X\t0,002\t0,002\t\t\n***End_of_Header***\t\t\t\t\n"
)
READ: dict[str, str] = {
    "quoted decimal commas": table(lambda cell: f'"{cell}"'.replace(".", ",")),
    "rows end in a separator": joined([NAMES, *([*row, ""] for row in CELLS)]),
    "the first row ends in a separator": joined([NAMES, [*CELLS[0], ""], *CELLS[1:]]),
    "names and rows end in a separator": joined([[*NAMES, ""], *([*row, ""] for row in CELLS)]),
    "names without that of the index": joined([NAMES, *([str(k), *row] for k, row in enumerate(CELLS))]),
    "carriage returns alone": joined([NAMES, *CELLS], end="\r"),
    "names again": joined([NAMES, *CELLS[:100], NAMES, *CELLS[100:]]),
    "a footer": joined([NAMES, *CELLS]) + "\nStatistics\nmean force,12.3\nmax,1,2\n",
    "units in cells": joined([PLAIN, *([f"{c} {u}" for c, u in zip(r, UNITS, strict=True)] for r in CELLS)]),
    "units without a space": joined([PLAIN, *([c + u for c, u in zip(r, UNITS, strict=True)] for r in CELLS)]),
    "Fortran exponents": table(lambda cell: f"{float(cell):.8E}".replace("E", "D")),
    "thousands, English": table(grouped(",", "."), ";"),
    "thousands, German": table(grouped(".", ","), ";"),
    "thousands, Swiss": table(grouped("'", "."), "\t"),
    "thousands, French": table(grouped(" ", ","), ";"),
    "rows in brackets": joined([NAMES]) + "".join(f"[{', '.join(row)}]\n" for row in CELLS),
    "blank lines": joined([NAMES, *CELLS], end="\n\n"),
    "names, units, types": joined([["time", "force", "spool"], UNITS, ["float64"] * 3, *CELLS]),
    "LabVIEW": LVM
    + joined([["X_Value", "force", "spool", "Comment"], *([*r, ""] for r in CELLS)], "\t").replace(".", ","),
    "LabVIEW, a time for each channel": LVM
    + joined(
        [["X_Value", "force", "X_Value", "spool", "Comment"], *([t, f, t, x, ""] for t, f, x in CELLS)], "\t"
    ).replace(".", ","),
}


CHANNELS = dict(zip(("force [mN]", "spool [mm]"), (1, 2), strict=True))
ROW_BY_ROW = [[row[0], name, row[k]] for row in CELLS for name, k in CHANNELS.items()]
ONE_BY_ONE = [[row[0], name, row[k]] for name, k in CHANNELS.items() for row in CELLS]
READ["a channel a row"] = joined([["time", "channel", "value"], *ROW_BY_ROW])
READ["one channel after the other"] = joined([["time", "channel", "value"], *ONE_BY_ONE])
READ["InfluxDB"] = "#group,false,false,true\n#default,_result,,,,\n" + joined(
    [
        ["", "result", "table", "_time", "_value", "_field", "_measurement"],
        *(["", "", str(name != "force [mN]"), time, value, name, "hand"] for time, name, value in ONE_BY_ONE),
    ]
)


def inspected(folder: Path, text: str, name: str = "log.csv") -> Inspection:
    (folder / name).write_bytes(text.encode())
    return inspect_log(folder / name)


@pytest.mark.parametrize("oddity", READ)
def test_every_row_is_read(tmp_path: Path, oddity: str) -> None:
    inspection = inspected(tmp_path, READ[oddity], "log.lvm" if "LabVIEW" in oddity else "log.csv")
    proposal = propose(inspection)
    VALIDATOR.validate(proposal.document)
    (tmp_path / "map.json").write_text(json.dumps(proposal.document), encoding="utf-8")
    columns = convert_table(inspection.file, tmp_path / "map.json").columns
    assert columns["time"] == pytest.approx(T, abs=1e-12)
    assert columns["tendon_force[1]"] == pytest.approx(FORCE / 1000.0, rel=1e-7)
    assert columns["tendon_position[1]"] == pytest.approx(SPOOL / 1000.0, abs=1e-9)


FAULTY = {
    "a dash": ("-", "no number"),
    "1.#IND": ("-1.#IND", "no number"),
    "nan(ind)": ("-nan(ind)", "no number"),
    "a word": ("OVERLOAD", "'OVERLOAD'; expected a finite number"),
    "another unit": ("1.2 lbf", "expected a number in no unit of its own"),
    "a decimal comma": ('"1,25"', "'1,25'; expected a finite number"),
    "thousands": ('"1,250.5"', "'1,250.5'; expected a finite number"),
}


@pytest.mark.parametrize("fault", FAULTY)
def test_a_cell_without_a_number_is_named_or_left_out(tmp_path: Path, fault: str) -> None:
    cell, words = FAULTY[fault]
    rows = [[*row] for row in CELLS]
    rows[30][1] = cell
    inspection = inspected(tmp_path, joined([NAMES, *rows]))
    document = propose(inspection).document
    assert document["log"].pop("missing") == "?"
    (tmp_path / "map.json").write_text(json.dumps(document), encoding="utf-8")
    with pytest.raises(InputError, match=r"row 31") as refused:
        convert_table(tmp_path / "log.csv", tmp_path / "map.json")
    assert words in str(refused.value)
    document["log"]["missing"] = "leave out"
    (tmp_path / "map.json").write_text(json.dumps(document), encoding="utf-8")
    assert len(convert_table(tmp_path / "log.csv", tmp_path / "map.json").columns["time"]) == ROWS - 1


def test_a_short_row_is_refused_with_the_line_of_the_map_that_reads_it(tmp_path: Path) -> None:
    text = joined([NAMES, *CELLS[:50], CELLS[50][:2], *CELLS[51:]])
    inspection = inspected(tmp_path, text)
    assert any("1 line without all numbers" in note for note in inspection.notes)
    with pytest.raises(InputError, match=r'row 51: 2 fields.*"missing": "leave out"'):
        list(log_of(tmp_path / "log.csv").blocks({"": ["time"]}))


def log_of(file: Path) -> Any:
    from tendonfmu.recordings.converters.log import open_log

    return open_log(file, LogFormat())


@pytest.mark.parametrize("pair", ["{}:{}", "{}={}", "{}: {}"])
def test_names_in_each_cell_are_refused(tmp_path: Path, pair: str) -> None:
    """No row becomes names, and no row vanishes."""
    rows = [[pair.format(name, cell) for name, cell in zip(("t", "F1", "x1"), row, strict=True)] for row in CELLS]
    for separator in (" ", ",", "\t") if " " not in pair else (",",):
        with pytest.raises(InputError, match=r"no column has numbers.*print the names \(t, F1, x1"):
            inspected(tmp_path, joined(rows, separator))


def test_decimal_commas_between_commas_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"3 names and 6 fields in a row between commas.*decimal points"):
        inspected(tmp_path, joined([PLAIN]) + joined(CELLS).replace(".", "\0").replace("\0", ","))


@pytest.mark.parametrize(
    "cell", ["[{0}, {1}]", "({0}, {1})", "[{0}  {1}]", "array([{0}, {1}], dtype=float32)", "[np.float64({0}), {1}]"]
)
def test_a_list_in_a_cell_has_a_field_for_each_number(tmp_path: Path, cell: str) -> None:
    rows = [[time, f'"{cell.format(force, spool)}"'] for time, force, spool in CELLS]
    inspection = inspected(tmp_path, joined([["time", "force"], *rows]))
    names = [summary.field.name for summary in inspection.topics[0].fields]
    assert names == ["time", "force[1]", "force[2]"]
    force = inspection.topics[0].fields[1]
    assert (force.low, force.high) == (pytest.approx(FORCE.min()), pytest.approx(FORCE.max()))


def test_a_number_in_parentheses_is_no_list(tmp_path: Path) -> None:
    """Accountants write negative numbers so."""
    inspection = inspected(tmp_path, joined([["time", "force"], *([time, f"({force})"] for time, force, _ in CELLS)]))
    assert [summary.field.kind for summary in inspection.topics[0].fields] == ["number", "text"]


@pytest.mark.parametrize("digits", [4, 2], ids=["times rise", "a coarse clock"])
def test_a_text_beside_a_number_makes_no_channels(tmp_path: Path, digits: int) -> None:
    rows = [[f"{t:.{digits}f}", "home" if t < 0.3 else "move", row[1]] for t, row in zip(T, CELLS, strict=True)]
    inspection = inspected(tmp_path, joined([["time", "state", "force"], *rows]))
    assert len(inspection.topics) == 1


def test_numbers_as_names_are_no_row(tmp_path: Path) -> None:
    for names in (["0", "1", "2"], ["1", "2", "3"]):
        fields = inspected(tmp_path, joined([names, *CELLS])).topics[0].fields
        assert [(part.field.name, part.count) for part in fields] == [(name, ROWS) for name in names]


@pytest.mark.parametrize(
    "lines",
    [
        [["", "force", "force"], ["", "m1", "m2"], ["time", "", ""]],  # columns of pandas with two levels
        [["time", "force", ""], ["", "m1", "m2"]],  # merged cells
    ],
)
def test_repeated_names_are_joined_with_the_lines_above(tmp_path: Path, lines: list[list[str]]) -> None:
    both = [[*row, *row[1:]] for row in lines]
    both[0][3:] = ["spool", both[0][2] and "spool"]
    rows = [[*row, *reversed(row[1:])] for row in CELLS]
    fields = inspected(tmp_path, joined([*both, *rows])).topics[0].fields
    names = ["time", "force.m1", "force.m2", "spool.m1", "spool.m2"]
    assert [(part.field.name, part.count) for part in fields] == [(name, ROWS) for name in names]


def test_labview_without_times_wants_a_rate(tmp_path: Path) -> None:
    text = LVM + joined([["X_Value", "force", "spool"], *(["", *row[1:]] for row in CELLS)], "\t").replace(".", ",")
    time = propose(inspected(tmp_path, text, "log.lvm")).lines[0]
    assert (time.source, time.unit) == ("?", "?") and '{"rate": HZ}' in time.why


def test_a_faulty_first_row_is_not_passed_over(tmp_path: Path) -> None:
    rows = [["0.0", "OVERLOAD", "1.0"], *CELLS[1:]]
    assert inspected(tmp_path, joined([NAMES, *rows])).topics[0].fields[1].missing == 1


def test_inspect_takes_what_a_map_says_of_the_text(call: Call, tmp_path: Path) -> None:
    lines = ["5,6,7", "made,by,hand", ",".join(NAMES), *(",".join(row) for row in CELLS)]
    (tmp_path / "log.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    (tmp_path / "skip.json").write_text('{"format": "tendonfmu-map-1", "log": {"skip": 2}}', encoding="utf-8")
    answer = call("convert", "inspect", "log.csv", "--map", "skip.json", "-o", "map.json")
    assert answer.status == 0, answer.err
    document = json.loads((tmp_path / "map.json").read_text(encoding="utf-8"))
    assert document["log"]["skip"] == 2 and document["columns"]["tendon_force[1]"]["column"] == "force [mN]"


BEGIN = dt.datetime(2026, 5, 4, 23, 59, 59, 800_000)
CLOCKS: dict[str, tuple[str, int, str]] = {  # names, digits of the fraction that are cut, and pattern
    "comma before the milliseconds": ("Timestamp", 3, "%Y-%m-%d %H:%M:%S,%f"),
    "of the day, over midnight": ("Time", 3, "%H:%M:%S.%f"),
    "colon before the milliseconds": ("Time", 3, "%H:%M:%S:%f"),
    "day first": ("Zeit", 3, "%d.%m.%Y %H:%M:%S,%f"),
    "month first": ("When", 0, "%m/%d/%Y %H:%M:%S.%f"),
    "date and time in two columns": ("Date;Time", 0, "%Y-%m-%d;%H:%M:%S.%f"),
    "both, day first": ("Log Date;Log Time", 3, "%d/%m/%Y;%H:%M:%S.%f"),
}


@pytest.mark.parametrize("clock", [*CLOCKS, "morning and afternoon", "durations of pandas"])
def test_texts_of_times_are_recognised(tmp_path: Path, clock: str) -> None:
    times = [BEGIN + dt.timedelta(seconds=float(t)) for t in T]
    if clock == "morning and afternoon":
        name, texts = "Time", [f"{time:%I:%M:%S}.{time:%f} {time:%p}" for time in times]
    elif clock == "durations of pandas":
        name, texts = "t", [f"0 days {dt.datetime(2026, 1, 1) + (time - BEGIN):%H:%M:%S.%f}" for time in times]
    else:
        name, cut, pattern = CLOCKS[clock]
        texts = [time.strftime(pattern)[: -cut or None] for time in times]
    rows = [[text, *row[1:]] for text, row in zip(texts, CELLS, strict=True)]
    inspection = inspected(tmp_path, joined([[name, *NAMES[1:]], *rows], ";"))
    proposal = propose(inspection)
    VALIDATOR.validate(proposal.document)
    (tmp_path / "map.json").write_text(json.dumps(proposal.document), encoding="utf-8")
    columns = convert_table(inspection.file, tmp_path / "map.json").columns
    assert columns["time"] == pytest.approx(T, abs=1e-9)
    assert columns["tendon_force[1]"] == pytest.approx(FORCE / 1000.0)


def converted(folder: Path, inspection: Inspection) -> dict[str, Any]:
    (folder / "map.json").write_text(json.dumps(propose(inspection).document), encoding="utf-8")
    return dict(convert_table(inspection.file, folder / "map.json").columns)


def test_pairs_of_time_and_value_come_onto_one_clock(tmp_path: Path) -> None:
    """Each channel with its own rate and length, as LabVIEW and trend recorders export them."""
    late = T[::2] + 0.0003
    other = np.interp(late, T, SPOOL)
    names = ["F time", "F [mN]", "x time", "x spool [mm]"]
    rows = [
        [f"{T[k]:.4f}", f"{FORCE[k]:.3f}", *((f"{late[k]:.5f}", f"{other[k]:.6f}") if k < len(late) else ("", ""))]
        for k in range(ROWS)
    ]
    inspection = inspected(tmp_path, joined([names, *rows]))
    assert [(topic.topic.name, topic.clock and topic.clock.rows) for topic in inspection.topics] == [
        ("F [mN]", ROWS),
        ("x spool [mm]", ROWS // 2),
    ]
    columns = converted(tmp_path, inspection)
    kept = (late[0] <= T) & (late[-1] >= T)
    assert len(columns["time"]) == kept.sum()
    assert columns["tendon_force[1]"] == pytest.approx(FORCE[kept] / 1000.0)
    assert columns["tendon_position[1]"] == pytest.approx(SPOOL[kept] / 1000.0, abs=1e-4)
    alike = joined([["Time", "force [mN]", "Time", "spool [mm]"], *([r[0], r[1], r[0], r[2]] for r in CELLS)])
    assert converted(tmp_path, inspected(tmp_path, alike))["tendon_position[1]"] == pytest.approx(SPOOL / 1000.0)


@pytest.mark.parametrize("stamp", ["[2026-01-05 10:30:{:06.3f}] ", "10:30:{:06.3f} -> "])
def test_times_of_a_terminal_are_a_column(tmp_path: Path, stamp: str) -> None:
    lines = [stamp.format(25.0 + t) + ",".join(row[1:]) for t, row in zip(T, CELLS, strict=True)]
    text = "force [mN],spool [mm]\n" + "\n".join(lines) + "\n"
    columns = converted(tmp_path, inspected(tmp_path, text))
    assert columns["time"] == pytest.approx(T, abs=1e-9)
    assert columns["tendon_force[1]"] == pytest.approx(FORCE / 1000.0)


def test_a_format_of_another_program_says_what_to_do(tmp_path: Path) -> None:
    (tmp_path / "log.bag").write_bytes(b"#ROSBAG V2.0")
    with pytest.raises(InputError, match="rosbags-convert"):
        inspect_log(tmp_path / "log.bag")


@needs("cases")
def test_logs_of_public_reports() -> None:
    """Each is read whole, or is refused by name."""
    folder = PARTS["cases"].find()
    read = {}
    for file in sorted((folder / "25-csv-oddities").glob("*.csv")):
        inspection = inspect_log(file)
        read[file.stem] = {part.count for topic in inspection.topics for part in topic.fields}
        assert len(propose(inspection).lines) == 9, file
    assert len(read) == 19 and all(counts == {400} for counts in read.values()), read
    for name in ("log.lvm", "log.txt"):
        topic = inspect_log(folder / "12-lvm" / name).topics[0]
        assert [part.count for part in topic.fields] == [1000] * 9 and topic.clock is not None
        assert topic.clock.step == pytest.approx(0.002)
    with pytest.raises(InputError, match="no column has numbers"):
        inspect_log(folder / "14-arduino-keyvalue" / "serial.txt")
    for name, count in (("15-zero-based-names/log.csv", 4), ("18-multiarray/bag.mcap", 4)):
        lines = propose(inspect_log(folder / name)).lines
        forces = [line.source for line in lines if line.column.startswith("tendon_force")]
        assert len(forces) == count and not any("layout" in str(source) for source in forces)
    for name in ("four_interfaces.mcap", "two_interfaces.mcap"):
        lines = propose(inspect_log(folder / "05-dynamic-joint-states" / name)).lines
        assert sum(str(line.source).endswith("[effort]") for line in lines) == 4
    late = inspect_log(folder / "06-effort-nan" / "late_effort.mcap").topics[0]
    assert {part.missing for part in late.fields if "effort" in part.field.name} == {10}
    counters = inspect_log(folder / "03-multiturn-encoder" / "log.csv")
    assert {part.wrap for part in counters.topics[0].fields if part.wrap} == {4096.0}
