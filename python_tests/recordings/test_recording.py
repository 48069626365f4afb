"""Recordings: what is read, what is refused and with which words, and that files appear whole or not at all."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tendonfmu.errors import InputError, InputWarning
from tendonfmu.files.tables import write_table
from tendonfmu.recordings.recording import read_recording

HEADER = "time,tendon_force[1],tendon_force[2],tendon_position[1],tendon_position[2]"
ROWS = ["0.0,1.5,2.5,0.001,0.002", "0.01,1.25,2.25,0.0015,0.0025", "0.02,1.125,2.125,0.00175,0.00275"]
GOOD = "\n".join([HEADER, *ROWS]) + "\n"


def written(folder: Path, text: str | bytes, name: str = "rec.csv") -> Path:
    file = folder / name
    file.write_bytes(text if isinstance(text, bytes) else text.encode())
    return file


def refusal(file: Path) -> str:
    """The one line, which begins with the file."""
    with pytest.raises(InputError) as refused:
        read_recording(file)
    line = str(refused.value)
    assert line.startswith(f"{file}: ")
    assert "\n" not in line
    return line.removeprefix(f"{file}: ")


def frame(samples: int = 5, joints: int = 2, tendons: int = 3, seed: int = 1) -> pd.DataFrame:
    rng = np.random.default_rng(seed)
    columns = {"time": np.cumsum(rng.uniform(0.001, 0.02, samples))}
    for group, size in (("tendon_force", tendons), ("tendon_position", tendons), ("joint_position", joints)):
        columns |= {f"{group}[{i + 1}]": rng.normal(size=samples) for i in range(size)}
    return pd.DataFrame(columns)


# --- what is read -----------------------------------------------------------------------------------------------------


def test_csv_is_read_by_name_not_by_position(tmp_path: Path) -> None:
    table = frame()
    table = table[list(reversed(table.columns))]
    table.to_csv(tmp_path / "rec.csv", index=False)
    found = read_recording(tmp_path / "rec.csv")
    assert np.array_equal(found.time, table["time"])
    for group in ("tendon_force", "tendon_position"):
        assert np.array_equal(found.groups[group], table[[f"{group}[{i}]" for i in (1, 2, 3)]].to_numpy())
    assert "joint_velocity" not in found.groups
    assert found.contact is None


def test_more_than_nine_columns_keep_their_order(tmp_path: Path) -> None:
    table = frame(tendons=12)
    table.to_csv(tmp_path / "rec.csv", index=False)
    force = read_recording(tmp_path / "rec.csv").groups["tendon_force"]
    assert np.array_equal(force, table[[f"tendon_force[{i}]" for i in range(1, 13)]].to_numpy())


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_optional_columns(tmp_path: Path, suffix: str) -> None:
    table = frame()
    for group in ("joint_velocity", "external_torque"):
        table[f"{group}[1]"], table[f"{group}[2]"] = 0.5, -0.25
    table["contact"] = [0, 1, 1, 0, 1]
    write_table(tmp_path / f"rec{suffix}", {name: table[name].to_numpy() for name in table})
    found = read_recording(tmp_path / f"rec{suffix}")
    assert found.groups["external_torque"].tolist() == [[0.5, -0.25]] * 5
    assert found.contact is not None
    assert found.contact.tolist() == [False, True, True, False, True]


@pytest.mark.parametrize(
    "text",
    [
        GOOD.replace("\n", "\r\n"),
        "\ufeff" + GOOD,
        GOOD.replace(HEADER, ",".join(f'"{name}"' for name in HEADER.split(","))),
        GOOD.replace(",", ", "),
        GOOD.replace("0.01,1.25", "1e-2,125e-2"),
        GOOD + "\n",
    ],
    ids=["crlf", "byte order mark", "quoted header", "spaces", "exponents", "empty last line"],
)
def test_usual_spellings_of_csv(tmp_path: Path, text: str) -> None:
    found = read_recording(written(tmp_path, text))
    assert found.time.tolist() == [0.0, 0.01, 0.02]
    assert found.groups["tendon_force"].tolist() == [[1.5, 2.5], [1.25, 2.25], [1.125, 2.125]]


def test_a_parquet_file_with_time_as_index(tmp_path: Path) -> None:
    frame().set_index("time").to_parquet(tmp_path / "rec.parquet")
    assert np.array_equal(read_recording(tmp_path / "rec.parquet").time, frame()["time"])


@settings(max_examples=60, deadline=None)
@given(st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=4, max_size=4))
def test_numbers_come_back_to_the_last_bit(tmp_path_factory: pytest.TempPathFactory, numbers: list[float]) -> None:
    names = HEADER.split(",")
    for suffix in (".csv", ".parquet"):
        file = tmp_path_factory.getbasetemp() / f"exact{suffix}"
        write_table(
            file, {names[0]: np.array([0.1]), **{n: np.array([x]) for n, x in zip(names[1:], numbers, strict=True)}}
        )
        found = read_recording(file)
        back = [*found.groups["tendon_force"][0], *found.groups["tendon_position"][0]]
        assert np.array(back).tobytes() == np.array(numbers).tobytes()


# --- what is refused --------------------------------------------------------------------------------------------------


def test_every_missing_column_is_named(tmp_path: Path) -> None:
    for name in HEADER.split(","):
        table = pd.read_csv(written(tmp_path, GOOD)).drop(columns=name)
        table.to_csv(tmp_path / "less.csv", index=False)
        if name == "tendon_position[2]":  # then the groups are of different size
            assert "tendon_position" in refusal(tmp_path / "less.csv")
        elif name == "tendon_force[2]":
            assert "tendon_force" in refusal(tmp_path / "less.csv")
        else:
            assert name in refusal(tmp_path / "less.csv")


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_other_columns_are_ignored_with_one_warning(tmp_path: Path, suffix: str) -> None:
    """Also text, which is never read as a number."""
    file = written(
        tmp_path, "\n".join([f"{HEADER},motor_current[1],phase", *(f"{row},1.0,start" for row in ROWS)]) + "\n"
    )
    if suffix == ".parquet":
        pd.read_csv(file).to_parquet(tmp_path / "rec.parquet")
        file = tmp_path / "rec.parquet"
    with pytest.warns(InputWarning) as found:
        recording = read_recording(file)
    assert len(found) == 1
    assert str(found[0].message).startswith(f"{file}: ignored columns: 'motor_current[1]', 'phase'; a recording has ")
    plain = read_recording(written(tmp_path, GOOD, "plain.csv"))
    assert set(recording.arrays()) == set(plain.arrays())
    assert all((values == plain.arrays()[name]).all() for name, values in recording.arrays().items())


@pytest.mark.parametrize(
    ("name", "right"),
    [
        ("tendon_force_1", "tendon_force[1]"),
        ("Tendon_Force[1]", "tendon_force[1]"),
        ("tendon_force[01]", "tendon_force[1]"),
        ("tendon_force[0]", "tendon_force[1], tendon_force[2], ..., with indices from 1"),
        ("tendon_force", "tendon_force[1], tendon_force[2], ..., with indices from 1"),
        ("tendonPosition(12)", "tendon_position[12]"),
        ("joint velocity 3", "joint_velocity[3]"),
        ("Time", "time"),
        ("CONTACT", "contact"),
    ],
)
def test_other_spellings_are_errors_with_the_right_name(tmp_path: Path, name: str, right: str) -> None:
    lines = [f"{HEADER},{name}", *(f"{row},0" for row in ROWS)]
    line = refusal(written(tmp_path, "\n".join(lines) + "\n"))
    assert f"column {name!r}; expected the name {right}; `tendonfmu convert table`" in line


@pytest.mark.parametrize("name", ["time_of_day", "timestamp", "force[1]", "tendon_force[1].raw", "contacts", "t"])
def test_what_is_not_ours_in_another_spelling_is_ignored(tmp_path: Path, name: str) -> None:
    lines = [f"{HEADER},{name}", *(f"{row},0" for row in ROWS)]
    with pytest.warns(InputWarning, match="ignored columns"):
        read_recording(written(tmp_path, "\n".join(lines) + "\n"))


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_duplicate_columns_are_named(tmp_path: Path, suffix: str) -> None:
    if suffix == ".csv":
        file = written(tmp_path, GOOD.replace("tendon_force[2]", "tendon_force[1]"))
    else:
        import pyarrow as pa
        import pyarrow.parquet as pq

        names = ["time", "tendon_force[1]", "tendon_force[1]", "tendon_position[1]"]
        file = tmp_path / "rec.parquet"
        pq.write_table(pa.Table.from_arrays([pa.array([0.0, 1.0])] * 4, names=names), file)
    line = refusal(file)
    assert "tendon_force[1]" in line and "2 times" in line


@pytest.mark.parametrize("cell", ["fast", "1.2.3", "", "12 N", "--", "True", "0x10", "1_0", "1,5"])
def test_text_in_a_number_column(tmp_path: Path, cell: str) -> None:
    line = refusal(written(tmp_path, GOOD.replace("2.25", f'"{cell}"' if "," in cell else cell)))
    assert "tendon_force[2]" in line and "row 2" in line and cell in line


@pytest.mark.parametrize("cell", ["nan", "NaN", "inf", "-inf", "Infinity", "1e999", "NA", "null"])
def test_numbers_that_are_not_finite(tmp_path: Path, cell: str) -> None:
    line = refusal(written(tmp_path, GOOD.replace("0.0025", cell)))
    assert "tendon_position[2]" in line and "row 2" in line and "number" in line


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, None, "x"])
def test_parquet_cells_are_checked(tmp_path: Path, value: object) -> None:
    table = frame().astype(object if isinstance(value, str) else float)
    if isinstance(value, str):
        table = frame()
        table["tendon_force[2]"] = ["1", "2", value, "4", "5"]
    else:
        table.loc[2, "tendon_force[2]"] = value
    table.to_parquet(tmp_path / "rec.parquet", index=False)
    line = refusal(tmp_path / "rec.parquet")
    assert "tendon_force[2]" in line
    if not isinstance(value, str):
        assert "row 3" in line


@pytest.mark.parametrize(
    ("times", "row"), [("0,1,1,2", 3), ("0,1,0.5,2", 3), ("0,0,1,2", 2), ("3,2,1,0", 2), ("0,1,2,2", 4)]
)
def test_time_must_increase(tmp_path: Path, times: str, row: int) -> None:
    rows = [f"{time},1,2,3,4" for time in times.split(",")]
    line = refusal(written(tmp_path, "\n".join([HEADER, *rows]) + "\n"))
    assert "time" in line and f"row {row}" in line and "increasing" in line
    assert "np.float64" not in line


@pytest.mark.parametrize("cut", range(1, len(ROWS[-1]) + 1))
def test_a_last_line_cut_off_anywhere(tmp_path: Path, cut: int) -> None:
    """Also in the middle of its last number, which would read as another number."""
    line = refusal(written(tmp_path, GOOD[: -1 - cut] if cut < len(ROWS[-1]) else GOOD[: -1 - cut] + "0"))
    assert "truncated" in line and "row 3" in line
    assert "2 rows" in line


@pytest.mark.parametrize(("line", "fields"), [("0.01,1.25", "4"), ("0.01,1.25,2.25,9", "6")])
def test_lines_of_another_length(tmp_path: Path, line: str, fields: str) -> None:
    refused = refusal(written(tmp_path, GOOD.replace("0.01,1.25,2.25", line)))
    assert "row 2" in refused and fields in refused and "5" in refused


@pytest.mark.parametrize("text", [b"", b"\n", HEADER.encode(), HEADER.encode() + b"\n", b"\n\n\n"])
def test_files_without_samples(tmp_path: Path, text: bytes) -> None:
    refusal(written(tmp_path, text))


@pytest.mark.parametrize(
    "content",
    [
        b"\xff\xfe\x00\x01",
        GOOD.encode() + b"\xe4,\xf6\n",
        GOOD.encode("utf-16"),
        b"\x00" * 200,
        os.urandom(500),
        b"PAR1" * 30,
    ],
)
@pytest.mark.parametrize("name", ["rec.csv", "rec.parquet"])
def test_files_of_another_kind(tmp_path: Path, content: bytes, name: str) -> None:
    refusal(written(tmp_path, content, name))


def test_a_truncated_parquet_file(tmp_path: Path) -> None:
    frame().to_parquet(tmp_path / "whole.parquet", index=False)
    whole = (tmp_path / "whole.parquet").read_bytes()
    for size in (1, len(whole) // 2, len(whole) - 1):
        assert "Parquet" in refusal(written(tmp_path, whole[:size], "cut.parquet"))


def test_a_huge_index_is_refused_at_once(tmp_path: Path) -> None:
    line = refusal(written(tmp_path, GOOD.replace("tendon_force[2]", "tendon_force[2000000000]")))
    assert "tendon_force" in line


def test_contact_is_0_or_1(tmp_path: Path) -> None:
    lines = [f"{HEADER},contact", *(f"{row},{label}" for row, label in zip(ROWS, ("0", "2", "1"), strict=True))]
    line = refusal(written(tmp_path, "\n".join(lines) + "\n"))
    assert "contact" in line and "row 2" in line and "0 or 1" in line


@pytest.mark.parametrize("name", ["rec.txt", "rec", "rec.json"])
def test_unknown_formats(tmp_path: Path, name: str) -> None:
    line = refusal(written(tmp_path, GOOD, name))
    assert ".csv" in line and ".parquet" in line


def test_missing_files_and_folders(tmp_path: Path) -> None:
    assert "no such file" in refusal(tmp_path / "absent.csv")
    (tmp_path / "german.csv").write_text("time;tendon_force[1];tendon_position[1]\n0,1;2,0;0,0\n")
    assert "expected commas" in refusal(tmp_path / "german.csv")
    (tmp_path / "folder.csv").mkdir()
    refusal(tmp_path / "folder.csv")


# --- recording and finger -----------------------------------------------------------------------------------------


def test_a_recording_must_fit_the_finger(tmp_path: Path) -> None:
    frame(joints=2, tendons=3).to_csv(tmp_path / "rec.csv", index=False)
    recording = read_recording(tmp_path / "rec.csv")
    recording.require(2, 3, ("tendon_force", "tendon_position"))
    for joints, tendons, groups, word in (
        (2, 4, ("tendon_force",), "tendon_force"),
        (3, 3, ("tendon_force",), "joint_position"),
        (2, 3, ("tendon_force", "joint_velocity"), "joint_velocity"),
    ):
        with pytest.raises(InputError, match=word):
            recording.require(joints, tendons, groups)


# --- what is written --------------------------------------------------------------------------------------------------


def test_flags_are_written_as_0_and_1(tmp_path: Path) -> None:
    write_table(tmp_path / "out.csv", {"time": np.array([0.0, 0.5]), "contact": np.array([True, False])})
    assert (tmp_path / "out.csv").read_text().split() == ["time,contact", "0.0,1", "0.5,0"]


@pytest.mark.parametrize("name", ["out.csv", "out.parquet"])
def test_a_write_that_fails_leaves_the_old_file(tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    old = written(tmp_path, b"old", name)

    def fail(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    real: Callable[..., None] = os.replace
    monkeypatch.setattr(os, "replace", fail)
    with pytest.raises((OSError, InputError)):
        write_table(old, {"time": np.array([0.0])})
    monkeypatch.setattr(os, "replace", real)
    assert old.read_bytes() == b"old"
    assert [file.name for file in tmp_path.iterdir()] == [name]


@pytest.mark.parametrize("target", ["out.txt", "absent/out.csv", "folder.csv"])
def test_targets_that_cannot_be_written(tmp_path: Path, target: str) -> None:
    (tmp_path / "folder.csv").mkdir()
    with pytest.raises(InputError) as refused:
        write_table(tmp_path / target, {"time": np.array([0.0])})
    assert str(refused.value).startswith(str(tmp_path / target))
    assert sorted(file.name for file in tmp_path.iterdir()) == ["folder.csv"]
