"""How LeRobot datasets are read: local folders of version 2.1 and 3.0, one episode at a time.

Version 2.1 has a Parquet file for each episode, version 3.0 several episodes in a file. Their time starts anew in each
episode; here each episode follows the one before it after a gap. Other features than numbers are not read.
"""

from __future__ import annotations

import json
import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from copy import copy
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from tendonfmu.arrays import Numbers
from tendonfmu.errors import InputError
from tendonfmu.files import Node, Refusal, listed, read_json
from tendonfmu.recordings.converters.column_map import LogFormat
from tendonfmu.recordings.converters.log import INFO, LONGEST, NUMBER, OTHER, Block, Field, Topic
from tendonfmu.recordings.converters.parquet_log import cut_off, opened, values_of

V21, V30 = "v2.1", "v3.0"  # codebase_version
TIME, EPISODE = "timestamp", "episode_index"
COUNTERS = (EPISODE, "frame_index", "index", "task_index")  # features that every dataset has, and no signals
GAP = 1.0, 20.0  # s and frames between two episodes, whichever is longer
EFFORT = re.compile(r"effort|torque|current|force|load|tension|wrench|\btau")
PLACE = ("data/chunk_index", "data/file_index")  # of an episode, version 3.0
MOST = 10**9  # of numbers of episodes, files and rows


@dataclass(frozen=True)
class Episode:
    """An episode and where it is."""

    number: int
    length: int  # rows
    file: Path  # with its rows, perhaps among those of others


class LeRobotLog:
    """A LeRobot dataset, or some of its episodes."""

    open_ended = False

    def __init__(self, file: Path, settings: LogFormat | None = None, chosen: str | None = None) -> None:
        """Open a dataset. chosen: numbers of episodes, such as 0-9,12; all by default."""
        self.file = file
        self.notes: list[str] = []
        if not (file / INFO).is_file():
            raise InputError(f"{file}: no {INFO}; expected the folder of a LeRobot dataset")
        try:
            info = Node(read_json(file / INFO, "a LeRobot dataset"))
            version = info.member("codebase_version")
            if version.value not in (V21, V30):
                version.refuse(f"{V21} or {V30}; convert the dataset with the package lerobot")
            self._fps = info.member("fps").number(0.0, 1e6, "Hz", above=True)
            self._fields = dict(_fields(info.member("features")))
            episodes = {episode.number: episode for episode in _episodes(file, info, version.value == V21)}
        except Refusal as refused:
            raise InputError(f"{file / INFO}: {refused}") from None
        _refuse_positions_alone(file, self._fields)
        if not episodes:
            raise InputError(f"{file}: no episodes; expected at least one in meta")
        numbers = sorted(episodes) if chosen is None else _numbers(file, chosen, sorted(episodes))
        self.episodes = [episodes[number] for number in numbers]
        self.topics = [Topic("", tuple(self._fields), sum(episode.length for episode in self.episodes))]

    def only(self, episode: Episode) -> LeRobotLog:
        """Return the log of one episode."""
        alone = copy(self)
        alone.file, alone.episodes, alone.notes = self.file / f"episode {episode.number}", [episode], []
        alone.topics = [Topic("", self.topics[0].fields, episode.length)]
        return alone

    def blocks(self, wanted: Mapping[str, Sequence[str]], texts: Sequence[str] = ()) -> Iterator[tuple[str, Block]]:
        """Read episode by episode; see `log.Log`."""
        places = {field.name: place for field, place in self._fields.items() if field.name in wanted.get("", ())}
        if len(self.episodes) > 1 and TIME not in places:
            expected = (
                f'expected "time": {{"column": "{TIME}", "unit": "s"}} in the map, or a recording for each episode'
            )
            raise InputError(f"{self.file}: several episodes in one recording, without their time; {expected}")
        end = -np.inf
        for episode in self.episodes:
            rows = _rows_of(episode, {feature for feature, _ in places.values()})
            block = {name: _values(episode, rows, *place) for name, place in places.items()}
            if TIME in block and episode.length:
                block[TIME] = self._exact(block[TIME])
                if np.isfinite(end):
                    block[TIME] = block[TIME] - block[TIME][0] + end + max(GAP[0], GAP[1] / self._fps)
                end = block[TIME][-1]
            yield "", block

    def _exact(self, time: Numbers) -> Numbers:
        """Return times [N] without their rounding to 32 bits, where they are those of frames."""
        frames = np.round(time * self._fps) / self._fps
        return np.where(np.abs(time - frames) <= np.spacing(np.abs(time).astype(np.float32)), frames, time)


def _refuse_positions_alone(file: Path, fields: Mapping[Field, tuple[str, int]]) -> None:
    if any(field.kind == NUMBER and EFFORT.search(field.name.lower()) for field in fields):
        return
    nameless = [feature for field, (feature, k) in fields.items() if field.name == f"{feature}[{k + 1}]" and not k]
    advice = f"; if {listed(nameless)} has one, name its elements in {INFO}" if nameless else ""
    raise InputError(f"{file}: positions alone; friction cannot be learned without effort, torque or current{advice}")


def _numbers(file: Path, chosen: str, known: Sequence[int]) -> list[int]:
    """Return the numbers in a text such as 0-9,12. known: all numbers, in order."""
    numbers: set[int] = set()
    for part in chosen.split(","):
        match = re.fullmatch(r"\s*(\d{1,9})(?:\s*-\s*(\d{1,9}))?\s*", part)
        first, last = (int(match[1]), int(match[2] or match[1])) if match else (1, 0)
        if first > last:
            raise InputError(f"--episodes = {chosen!r}: expected numbers and ranges of episodes, such as 0-9,12")
        if first not in known or last not in known:
            there = f"{file} has episodes {known[0]} to {known[-1]}"
            raise InputError(f"--episodes = {chosen!r}: no such episode: {part.strip()}; {there}")
        numbers |= {number for number in known if first <= number <= last}
    return sorted(numbers)


# --- what the folder meta says ----------------------------------------------------------------------------------------


def _fields(features: Node) -> Iterator[tuple[Field, tuple[str, int]]]:
    """Yield each field with its feature and the index in it."""
    for name in features.keys(features.value if isinstance(features.value, dict) else ()).value:
        feature = features.member(name)
        kind = feature.member("dtype").text("a type, such as float32")
        shape = [size.integer(0, MOST) for size in feature.member("shape").elements()]
        if name in COUNTERS or kind == "video":
            continue
        count = int(np.prod(shape))
        if not re.match(r"u?int|float|bool", kind) or len(shape) > 1 or count > LONGEST:
            yield Field(name, OTHER, kind), (name, 0)
            continue
        names = _names(feature.member("names").value, count)
        if names is None and count == 1:
            yield Field(name, NUMBER, kind, "s" if name == TIME else ""), (name, 0)
            continue
        for k in range(count):
            yield Field(f"{name}[{names[k] if names else k + 1}]", NUMBER, kind), (name, k)


def _names(stated: Any, count: int) -> list[str] | None:
    """Return the names of elements, from a list, `{"motors": [...]}` or `{"x": 0, "y": 1}`; None without them."""
    if isinstance(stated, dict):
        lists = [names for names in stated.values() if isinstance(names, list)]
        if not lists and sorted(map(str, stated.values())) == sorted(map(str, range(count))):
            stated = sorted(stated, key=lambda name: int(stated[name]))
        else:
            stated = [name for names in lists for name in names]
    names = [str(name) for name in stated] if isinstance(stated, list) else []
    return names if len(names) == count == len(set(names)) else None


def _episodes(folder: Path, info: Node, has_one_a_file: bool) -> Iterator[Episode]:
    """Yield the episodes that the dataset lists."""
    path = info.member("data_path")
    chunk = info.member("chunks_size").integer(1, MOST) if has_one_a_file else 0
    keys = (EPISODE, "length", *(() if has_one_a_file else PLACE))
    for where, entry in _lines(folder / "meta/episodes.jsonl") if has_one_a_file else _rows(folder / "meta/episodes"):
        try:
            number, length, *places = [Node(entry, "episode").member(key).integer(0, MOST) for key in keys]
        except Refusal as refused:
            raise InputError(f"{where}: {refused}") from None
        values = {"chunk_index": places[0], "file_index": places[1]} if places else {"episode_chunk": number // chunk}
        try:
            file = folder / path.text("the pattern of the files").format(episode_index=number, **values)
        except (LookupError, ValueError, AttributeError):
            path.refuse("the pattern of the files, such as data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet")
        yield Episode(number, length, file)


def _lines(file: Path) -> Iterator[tuple[str, Any]]:
    """Yield the place and content of each line of JSON."""
    k = 1
    try:
        with open(file, encoding="utf-8") as lines:
            for k, line in enumerate(lines, start=1):
                yield f"{file}: line {k}", json.loads(line)
    except (OSError, ValueError) as error:
        raise InputError(f"{file}: line {k}: {error}; expected an episode as JSON in each line") from None


def _rows(folder: Path) -> Iterator[tuple[str, Any]]:
    """Yield the place and content of each row of Parquet files."""
    files = sorted(folder.glob("*/*.parquet"))
    if not files:
        raise InputError(f"{folder}: no Parquet file; expected one with the episodes, as lerobot's `finalize` writes")
    for file in files:
        with opened(file) as parquet:
            try:  # without the statistics of the features
                rows = parquet.read(columns=[EPISODE, "length", *PLACE]).to_pylist()
            except (pa.ArrowException, OSError) as error:
                raise cut_off(file, error) from None
        yield from ((f"{file}: row {k}", row) for k, row in enumerate(rows, start=1))


# --- the rows of an episode -------------------------------------------------------------------------------------------


def _rows_of(episode: Episode, features: Collection[str]) -> Any:
    """Return the rows of an episode as an Arrow table."""
    file, number = episode.file, episode.number
    if not file.is_file():
        raise InputError(f"{file}: no such file; expected the data of episode {number}: copy the dataset again")
    with opened(file) as parquet:
        names = parquet.schema_arrow.names
    for name in {EPISODE, *features} - {*names}:
        missing = f"no column {name} of episode {number}, though {INFO} lists it"
        raise InputError(f"{file}: {missing}; leave out the episode (--episodes), or record it again")
    try:
        is_its = pc.field(EPISODE) == number
        table = pq.read_table(file, columns=sorted({EPISODE, *features}), filters=is_its, partitioning=None)
    except (pa.ArrowException, OSError) as error:
        raise cut_off(file, error) from None
    if table.num_rows != episode.length:
        rows = f"{table.num_rows} rows of episode {number}; expected {episode.length}, as meta says"
        raise InputError(f"{file}: {rows}: copy the dataset again, or leave out the episode (--episodes)")
    return table


def _values(episode: Episode, rows: Any, feature: str, index: int) -> Any:
    """Return one element of a feature as numbers."""
    column = rows.column(feature).combine_chunks()
    if isinstance(column.type, pa.ListType | pa.LargeListType | pa.FixedSizeListType):
        try:
            column = pc.list_element(column, index)
        except pa.ArrowException:
            raise InputError(
                f"{episode.file}: column {feature} of episode {episode.number}: fewer elements than {INFO} says; leave "
                "out the episode (--episodes), or record it again"
            ) from None
    return values_of(episode.file, feature, column, 0)
