"""LeRobot datasets as the package lerobot wrote them (lerobot_datasets/write.py), and spoilt ones, written by hand."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from command import Answer, Call
from map_cases import VALIDATOR
from repository_paths import ROOT
from tendonfmu.files.tables import read_table
from tendonfmu.recordings.converters.lerobot_log import LeRobotLog

OFFICIAL = ROOT / "python_tests" / "recordings" / "lerobot_datasets"
LENGTHS = (60, 40, 50)  # of the episodes in `write.py`, at 50 Hz
VERSIONS = ("v2.1", "v3.0")
COLUMNS = {
    "time": {"column": "timestamp", "unit": "s"},
    "tendon_force[1]": {"column": "observation.state[shoulder.torque]", "unit": "N"},
    "tendon_position[1]": {"column": "observation.state[shoulder.pos]", "unit": "mm"},
    "joint_velocity[1]": {"column": "observation.velocity[1]", "unit": "rad/s"},
}
MAP = {"format": "tendonfmu-map-1", "columns": COLUMNS}
every_version = pytest.mark.parametrize("version", VERSIONS)


@pytest.fixture(autouse=True)
def map_file(tmp_path: Path) -> Path:
    VALIDATOR.validate(MAP)
    (tmp_path / "map.json").write_text(json.dumps(MAP), encoding="utf-8")
    return tmp_path / "map.json"


def by_hand(
    folder: Path, version: str, features: dict[str, Any], episodes: list[dict[str, Any]], fps: float = 50
) -> Path:
    """A dataset of the columns of each episode; v3.0 with all episodes in one file and one row group."""
    dataset = folder / "set"
    (dataset / "meta").mkdir(parents=True)
    pattern = (
        "chunk-{chunk_index:03d}/file-{file_index:03d}"
        if version == "v3.0"
        else ("chunk-{episode_chunk:03d}/episode_{episode_index:06d}")
    )
    info = {"codebase_version": version, "fps": fps, "chunks_size": 2, "data_path": f"data/{pattern}.parquet"}
    listed = {"timestamp": {"dtype": "float32", "shape": [1], "names": None}, **features}
    (dataset / "meta" / "info.json").write_text(json.dumps({**info, "features": listed}), encoding="utf-8")
    tables, rows = [], []
    for k, columns in enumerate(episodes):
        count = len(next(iter(columns.values())))
        time = np.arange(count, dtype=np.float32) / np.float32(fps)
        tables.append(pa.table({"timestamp": time, **columns, "episode_index": np.full(count, k)}))
        rows.append({"episode_index": k, "length": count, "data/chunk_index": 0, "data/file_index": 0})
    if version == "v3.0":
        write(dataset / "data" / "chunk-000" / "file-000.parquet", pa.concat_tables(tables))
        write(dataset / "meta" / "episodes" / "chunk-000" / "file-000.parquet", pa.Table.from_pylist(rows))
        return dataset
    for k, table in enumerate(tables):
        write(dataset / "data" / f"chunk-{k // 2:03d}" / f"episode_{k:06d}.parquet", table)
    lines = "".join(json.dumps(row) + "\n" for row in rows)
    (dataset / "meta" / "episodes.jsonl").write_text(lines, encoding="utf-8")
    return dataset


def write(file: Path, table: pa.Table) -> None:
    file.parent.mkdir(parents=True, exist_ok=True)
    pq.write_table(table, file)


def with_info(dataset: Path, **more: Any) -> None:
    file = dataset / "meta" / "info.json"
    file.write_text(json.dumps({**json.loads(file.read_text(encoding="utf-8")), **more}), encoding="utf-8")


def recording(file: Path) -> dict[str, Any]:
    return read_table(file, lambda *_: None)


def check_episode(columns: dict[str, Any], episode: int) -> None:
    """Compare with what `write.py` computes; angles are of 32 bits, times are exact."""
    assert len(columns["time"]) == LENGTHS[episode]
    t = np.arange(LENGTHS[episode]) / 50
    angle = 0.6 * np.sin(3 * t + episode)
    assert columns["tendon_position[1]"] == pytest.approx(1e-3 * angle, abs=1e-10)
    assert columns["joint_velocity[1]"] == pytest.approx(2 * angle, abs=1e-6)
    assert columns["tendon_force[1]"] == pytest.approx(0.8 * np.sign(np.cos(3 * t + episode)), abs=1e-6)


def check_refused(answer: Answer, *words: str) -> None:
    assert answer.status == 2 and len(answer.err.splitlines()) == 1 and answer.out == "", answer
    assert all(word in answer.err for word in words), answer.err


# --- what the package wrote -------------------------------------------------------------------------------------------


@every_version
def test_every_episode_becomes_a_recording(call: Call, tmp_path: Path, version: str) -> None:
    answer = call("convert", "lerobot", str(OFFICIAL / version), "--map", "map.json", "-o", "new/out", "--json")
    assert answer.status == 0, answer.err
    report = json.loads(answer.out)
    assert [made["samples"] for made in report["recordings"]] == list(LENGTHS)
    names = sorted(file.name for file in (tmp_path / "new" / "out").iterdir())
    assert names == [f"episode_00000{k}.parquet" for k in range(3)]
    assert [file.name for file in (tmp_path / "new").iterdir()] == ["out"]
    for k, name in enumerate(names):
        columns = recording(tmp_path / "new" / "out" / name)
        assert columns["time"].tolist() == (np.arange(LENGTHS[k]) / 50).tolist()
        check_episode(columns, k)


@every_version
def test_one_recording_has_gaps_between_episodes(call: Call, tmp_path: Path, version: str) -> None:
    dataset = str(OFFICIAL / version)
    answer = call("convert", "lerobot", dataset, "--map", "map.json", "-o", "rec.csv", "--episodes", "0,2")
    assert answer.status == 0, answer.err
    columns = recording(tmp_path / "rec.csv")
    steps = np.diff(columns["time"])
    assert steps[59] == pytest.approx(1.0) and np.delete(steps, 59) == pytest.approx(0.02)
    check_episode({name: values[:60] for name, values in columns.items()}, 0)
    check_episode({name: values[60:] for name, values in columns.items()}, 2)


@every_version
def test_inspect_names_fields_by_the_features(call: Call, version: str) -> None:
    answer = call("convert", "inspect", str(OFFICIAL / version), "--json")
    assert answer.status == 0, answer.err
    (topic,) = json.loads(answer.out)["topics"]
    fields = {field["name"]: field["count"] for field in topic["fields"]}
    elements = ("shoulder.pos", "elbow.pos", "shoulder.torque", "elbow.torque")
    numbers = [f"observation.state[{name}]" for name in elements]
    numbers += ["observation.velocity[1]", "observation.velocity[2]", "action[shoulder.pos]", "action[elbow.pos]"]
    expected = dict.fromkeys([*numbers, "next.reward", "timestamp"], 150)
    assert fields == {**expected, "observation.matrix": 0, "observation.images.wrist": 0}
    assert (topic["clock"]["gaps"], topic["clock"]["backwards"], topic["clock"]["rate"]) == (2, 0, pytest.approx(50.0))
    assert "action" not in json.dumps(json.loads(answer.out)["map"])  # commands are no signals
    one = json.loads(call("convert", "inspect", str(OFFICIAL / version), "--episodes", "1", "--json").out)
    assert one["topics"][0]["clock"]["rows"] == 40


# --- by hand ----------------------------------------------------------------------------------------------------------

STATE = {"dtype": "float32", "shape": [2], "names": {"torque": 1, "pos": 0}}


def episode_of(count: int, start: float = 0.0) -> dict[str, Any]:
    return {"observation.state": [[start + k, -k] for k in range(count)], "observation.velocity": [[0.0, 1.0]] * count}


def small(folder: Path, version: str, **more: Any) -> Path:
    features = {"observation.state": STATE, "observation.velocity": {"dtype": "float32", "shape": [2], "names": None}}
    columns = {**COLUMNS, "tendon_force[1]": {"column": "observation.state[torque]", "unit": "N"}}
    columns["tendon_position[1]"] = {"column": "observation.state[pos]", "unit": "mm"}
    (folder / "map.json").write_text(json.dumps({**MAP, "columns": columns}), encoding="utf-8")
    return by_hand(folder, version, features, [episode_of(5, 10.0 * k) for k in range(5)], **more)


@every_version
def test_names_with_indices_and_episodes_of_one_row_group(
    call: Call, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, version: str
) -> None:
    small(tmp_path, version, fps=10)
    answer = call("convert", "lerobot", "set", "--map", "map.json", "-o", "out", "--episodes", "3-4, 1,1")
    assert answer.status == 0, answer.err
    assert sorted(file.name[-9:-8] for file in (tmp_path / "out").iterdir()) == ["1", "3", "4"]
    columns = recording(tmp_path / "out" / "episode_000003.parquet")
    assert columns["tendon_force[1]"].tolist() == [0.0, -1.0, -2.0, -3.0, -4.0]
    assert columns["tendon_position[1]"] == pytest.approx([0.03, 0.031, 0.032, 0.033, 0.034])
    answer = call("convert", "lerobot", "set", "--map", "map.json", "-o", "rec.csv")
    assert np.diff(recording(tmp_path / "rec.csv")["time"]).max() == pytest.approx(2.0)  # 20 steps of 0.1 s


def test_times_are_those_of_frames_without_rounding(tmp_path: Path) -> None:
    """Times of 32 bits at 1000 s are wrong by up to 31 µs; times that are not those of frames stay as they are."""
    log = LeRobotLog(small(tmp_path, "v2.1"))
    frames = np.arange(50_000, 50_100) / 50
    assert log._exact(frames.astype(np.float32).astype(np.float64)).tolist() == frames.tolist()
    late = frames + 0.004
    assert log._exact(late).tolist() == late.tolist()


@every_version
def test_positions_alone_are_refused(call: Call, tmp_path: Path, version: str) -> None:
    state = {"dtype": "float32", "shape": [2], "names": ["a.pos", "b.pos"]}
    images = {"dtype": "image", "shape": [4, 4, 3], "names": None}
    by_hand(tmp_path, version, {"observation.state": state, "force_camera": images}, [episode_of(5)])
    said = "set: positions alone; friction cannot be learned without effort, torque or current\n"
    for arguments in (["inspect", "set"], ["lerobot", "set", "--map", "map.json", "-o", "out"]):
        answer = call("convert", *arguments)
        check_refused(answer)
        assert answer.err.endswith(said)
    assert not (tmp_path / "out").exists()
    state["names"] = None
    with_info(tmp_path / "set", features={"observation.state": state})
    check_refused(call("convert", "inspect", "set"), "positions alone", "observation.state", "meta/info.json")
    with_info(tmp_path / "set", features={"observation.effort": state})
    check_refused(call("convert", "inspect", "set"), "no column observation.effort of episode 0")


# --- faults -----------------------------------------------------------------------------------------------------------


def changed(file: str, *, without: str = "", bytes_kept: int | None = None, **columns: Any) -> Any:
    def change(dataset: Path) -> None:
        path = dataset / file
        if bytes_kept is not None:
            path.write_bytes(path.read_bytes()[:bytes_kept])
            return
        table = pq.read_table(path)
        table = table.drop_columns([without]) if without else table
        for name, values in columns.items():
            table = table.set_column(table.schema.get_field_index(name), name, pa.array(values))
        pq.write_table(table, path)

    return change


LAST = "data/chunk-002/episode_000004.parquet"
ALL = "data/chunk-000/file-000.parquet"
ENTRIES = "meta/episodes/chunk-000/file-000.parquet"
FAULTS: list[tuple[str, Any, list[str]]] = [
    ("v2.1", lambda s: with_info(s, codebase_version="v2.0"), ['info.json: codebase_version = "v2.0"', "v2.1 or v3.0"]),
    ("v3.0", lambda s: with_info(s, codebase_version="v4.0"), ['codebase_version = "v4.0"', "package lerobot"]),
    ("v3.0", lambda s: with_info(s, codebase_version=None), ["codebase_version", "missing"]),
    ("v3.0", lambda s: with_info(s, fps=0), ["info.json: fps = 0", "Hz"]),
    ("v3.0", lambda s: with_info(s, features=[]), ["info.json: features = []"]),
    ("v3.0", lambda s: with_info(s, data_path="data/{wrong}"), ["info.json: data_path", "chunk_index"]),
    ("v2.1", lambda s: with_info(s, chunks_size=0), ["info.json: chunks_size = 0"]),
    ("v2.1", lambda s: (s / "meta/info.json").write_text("{"), ["info.json: line 1"]),
    ("v2.1", lambda s: (s / "meta/info.json").unlink(), ["set: no meta/info.json", "LeRobot dataset"]),
    ("v2.1", lambda s: (s / "meta/episodes.jsonl").unlink(), ["episodes.jsonl", "No such file"]),
    ("v2.1", lambda s: (s / "meta/episodes.jsonl").write_text('{"length": 5}\n'), ["line 1: episode", "missing"]),
    ("v2.1", lambda s: (s / "meta/episodes.jsonl").write_text("[1]\n"), ["line 1: episode", "missing"]),
    ("v2.1", lambda s: (s / "meta/episodes.jsonl").write_text("{\n"), ["episodes.jsonl: line 1: "]),
    ("v2.1", lambda s: (s / "meta/episodes.jsonl").write_text(""), ["set: no episodes"]),
    ("v3.0", lambda s: (s / ENTRIES).unlink(), ["meta/episodes: no Parquet file", "finalize"]),
    ("v3.0", changed(ENTRIES, bytes_kept=200), [ENTRIES, "not a whole Parquet file", "copy"]),
    ("v3.0", changed(ENTRIES, without="length"), [f"{ENTRIES}: row 1: episode.length: missing"]),
    ("v3.0", changed(ENTRIES, length=[5, 5, 5, 5, 6]), [f"{ALL}: 5 rows of episode 4; expected 6"]),
    ("v2.1", lambda s: (s / LAST).unlink(), [f"{LAST}: no such file", "episode 4", "copy"]),
    ("v2.1", changed(LAST, bytes_kept=300), [LAST, "not a whole Parquet file", "copy"]),
    ("v3.0", changed(ALL, bytes_kept=300), [ALL, "not a whole Parquet file", "copy"]),
    ("v2.1", lambda s: (s / LAST).write_text("version https://git-lfs.github.com/spec/v1\n"), [LAST, "whole Parquet"]),
    ("v2.1", changed(LAST, without="observation.velocity"), [f"{LAST}: no column observation.velocity of episode 4"]),
    ("v3.0", changed(ALL, without="observation.velocity"), [f"{ALL}: no column observation.velocity of episode 0"]),
    ("v2.1", changed(LAST, without="episode_index"), [f"{LAST}: no column episode_index"]),
    ("v2.1", changed(LAST, episode_index=[4, 4, 4, 0, 0]), [f"{LAST}: 3 rows of episode 4; expected 5"]),
    ("v2.1", changed(LAST, **{"observation.state": [[1.0]] * 5}), [LAST, "fewer elements", "--episodes"]),
    ("v2.1", changed(LAST, **{"observation.state": ["a"] * 5}), ["set/episode 4: column", "row 1: 'a'"]),
    ("v2.1", changed(LAST, **{"observation.state": [[1.0, None]] * 5}), ["set/episode 4: column", "row 1: no number"]),
    ("v2.1", changed(LAST, timestamp=np.float32([0, 1, 1, 2, 3])), ["set/episode 4: column timestamp", "row 3"]),
]  # fmt: skip


@pytest.mark.parametrize(("version", "spoil", "words"), FAULTS)
def test_faults_are_one_line_and_leave_nothing(
    call: Call, tmp_path: Path, version: str, spoil: Any, words: list[str]
) -> None:
    spoil(small(tmp_path, version))
    before = set(tmp_path.rglob("*"))
    check_refused(call("convert", "lerobot", "set", "--map", "map.json", "-o", "out"), *words)
    assert set(tmp_path.rglob("*")) == before
    answer = call("convert", "lerobot", "set", "--map", "map.json", "-o", "rec.parquet")
    assert answer.status == 2 and len(answer.err.splitlines()) == 1 and set(tmp_path.rglob("*")) == before


def test_bad_usage(call: Call, tmp_path: Path) -> None:
    small(tmp_path, "v3.0")
    (tmp_path / "log.csv").write_text("t,force\n1,2\n")
    (tmp_path / "counted.json").write_text(
        json.dumps(
            {**MAP, "columns": {**json.loads((tmp_path / "map.json").read_text())["columns"], "time": {"rate": 50}}}
        )
    )
    convert = ["lerobot", "set", "--map", "map.json", "-o", "out"]
    for arguments, words in (
        (["lerobot", "log.csv", *convert[2:]], ["log.csv: no meta/info.json"]),
        (["lerobot", "absent", *convert[2:]], ["absent: no meta/info.json"]),
        (["inspect", "log.csv", "--episodes", "1"], ["log.csv: no meta/info.json"]),
        (["lerobot", "set", "-o", "out"], ["--map", "missing"]),
        (["lerobot", "set", "--map", "map.json"], ["--output", "missing"]),
        ([*convert, "--finger", "f.json"], ["--finger", "not an option"]),
        ([*convert, "--radius", "1"], ["--radius", "not an option"]),
        (["table", *convert[1:], "--episodes", "1"], ["--episodes", "not an option"]),
        (
            ["emps", "log.csv", "-o", "r.csv", "--map", "m.json", "--episodes", "1"],
            ["--map", "not an option", "convert table, convert lerobot and convert inspect; expected --mass"],
        ),
        ([*convert, "--episodes", "3-1"], ["--episodes = '3-1'", "0-9,12"]),
        ([*convert, "--episodes", ""], ["--episodes = ''", "0-9,12"]),
        ([*convert, "--episodes", "2-5"], ["2-5", "episodes 0 to 4"]),
        (["lerobot", "set", "--map", "map.json", "-o", "set/data/chunk-000"], ["in the dataset set"]),
        (["lerobot", "set", "--map", "map.json", "-o", "map.json/x"], ["map.json is a file"]),
        (["lerobot", "set", "--map", "counted.json", "-o", "r.csv"], ["several episodes", '"column": "timestamp"']),
    ):
        check_refused(call("convert", *arguments), *words)
    assert call("convert", "lerobot", "set", "--map", "counted.json", "-o", "out").status == 0
