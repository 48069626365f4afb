"""Recordings: what is read, what is refused and with which words, and that files appear whole or not at all."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
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
    """Also more than nine columns of a group."""
    table = frame(tendons=12)
    table = table[list(reversed(table.columns))]
    table.to_csv(tmp_path / "rec.csv", index=False)
    found = read_recording(tmp_path / "rec.csv")
    assert np.array_equal(found.time, table["time"])
    for group in ("tendon_force", "tendon_position"):
        assert np.array_equal(found.groups[group], table[[f"{group}[{i}]" for i in range(1, 13)]].to_numpy())
    assert "joint_velocity" not in found.groups and found.contact is None


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


def times(text: str) -> str:
    return "\n".join([HEADER, *(f"{time},1,2,3,4" for time in text.split(","))]) + "\n"


def contact(*labels: str) -> str:
    return "\n".join([f"{HEADER},contact", *(f"{row},{label}" for row, label in zip(ROWS, labels, strict=True))]) + "\n"


REFUSED: list[tuple[str | bytes, list[str]]] = [
    *((GOOD.replace(name, "other"), [name.split("[")[0]]) for name in HEADER.split(",")),
    (GOOD.replace("tendon_force[2]", "tendon_force[1]"), ["tendon_force[1]", "2 times"]),
    (GOOD.replace("tendon_force[2]", "tendon_force[2000000000]"), ["tendon_force"]),  # at once
    *(
        (GOOD.replace("2.25", f'"{cell}"'), ["tendon_force[2]", "row 2", cell])
        for cell in ("fast", "1.2.3", "", "12 N", "True", "0x10", "1_0", "1,5")
    ),
    *(
        (GOOD.replace("0.0025", cell), ["tendon_position[2]", "row 2", "number"])
        for cell in ("nan", "inf", "-Infinity", "1e999", "NA", "null")
    ),
    (times("0,1,1,2"), ["time", "row 3", "increasing"]),
    (times("0,1,0.5,2"), ["time", "row 3", "increasing"]),
    (times("3,2,1,0"), ["time", "row 2", "increasing"]),
    (times("0,1,2,2"), ["time", "row 4", "increasing"]),
    # a last line cut off, also in the middle of its last number, which would read as another number
    *((GOOD[: -1 - cut], ["truncated", "row 3", "2 rows"]) for cut in range(1, len(ROWS[-1]))),
    (GOOD.replace("0.01,1.25,2.25", "0.01,1.25"), ["row 2", "4", "5"]),
    (GOOD.replace("0.01,1.25,2.25", "0.01,1.25,2.25,9"), ["row 2", "6", "5"]),
    *((text, []) for text in (b"", b"\n", HEADER.encode(), HEADER.encode() + b"\n", b"\n\n\n")),
    *((text, []) for text in (b"\xff\xfe\x00\x01", GOOD.encode() + b"\xe4,\xf6\n", GOOD.encode("utf-16"), b"\0" * 200)),
    (contact("0", "2", "1"), ["contact", "row 2", "0 or 1"]),
    ("time;tendon_force[1];tendon_position[1]\n0,1;2,0;0,0\n", ["expected commas"]),
]


@pytest.mark.parametrize(("text", "words"), REFUSED)
def test_csv_is_refused_by_column_and_row(tmp_path: Path, text: str | bytes, words: list[str]) -> None:
    line = refusal(written(tmp_path, text))
    assert all(word in line for word in words) and "np.float64" not in line, line


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, None, "x"])
def test_parquet_cells_are_checked(tmp_path: Path, value: object) -> None:
    table = frame()
    if isinstance(value, str):
        table["tendon_force[2]"] = ["1", "2", value, "4", "5"]
    else:
        table.loc[2, "tendon_force[2]"] = value
    table.to_parquet(tmp_path / "rec.parquet", index=False)
    line = refusal(tmp_path / "rec.parquet")
    assert "tendon_force[2]" in line and (isinstance(value, str) or "row 3" in line)


def test_parquet_that_is_none_or_cut_off(tmp_path: Path) -> None:
    names = ["time", "tendon_force[1]", "tendon_force[1]", "tendon_position[1]"]
    pq.write_table(pa.Table.from_arrays([pa.array([0.0, 1.0])] * 4, names=names), tmp_path / "double.parquet")
    assert "2 times" in refusal(tmp_path / "double.parquet")
    frame().to_parquet(tmp_path / "whole.parquet", index=False)
    whole = (tmp_path / "whole.parquet").read_bytes()
    for content in (whole[:1], whole[: len(whole) // 2], whole[:-1], GOOD.encode(), b"PAR1" * 30, os.urandom(500)):
        assert "Parquet" in refusal(written(tmp_path, content, "cut.parquet"))


def test_files_that_are_no_recordings(tmp_path: Path) -> None:
    for name in ("rec.txt", "rec", "rec.json"):
        line = refusal(written(tmp_path, GOOD, name))
        assert ".csv" in line and ".parquet" in line
    assert "no such file" in refusal(tmp_path / "absent.csv")
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
