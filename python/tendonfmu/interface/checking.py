"""Checks whether recordings belong to a finger (`tendonfmu check`), and converts logs (`tendonfmu convert table`)."""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any

from tendonfmu.files import StandIn
from tendonfmu.model import Finding, Finger, FingerSource, description_findings, read_finger
from tendonfmu.recordings import Recording, RecordingSource, belongs, convert_table, listed_sources, read_recordings


@dataclass(frozen=True, eq=False, repr=False)
class CheckResult:
    """What is wrong, or probably is, with a finger and its recordings.

    Attributes
    ----------
    finger
        The finger.
    findings
        Each with `severity` ("error" or "warning"), `kind`, `path`, `columns`, `seen`, `probably`, `write`, `line()`.
    """

    finger: Finger
    findings: tuple[Finding, ...]

    @property
    def belongs(self) -> bool:
        """Whether nothing is an error."""
        return all(finding.severity != "error" for finding in self.findings)

    def __repr__(self) -> str:
        lines = [f"{finding.severity}: {finding.line()}" for finding in self.findings] or ["no problem found"]
        return "\n".join([*self.finger.summary(), *lines])

    def _repr_html_(self) -> str:
        return f"<pre>{escape(repr(self))}</pre>"


def check(finger: FingerSource, recordings: RecordingSource | Sequence[RecordingSource] = ()) -> CheckResult:
    """Check a description, and whether recordings belong to it.

    Parameters
    ----------
    finger
        A finger, its description, or the file of it.
    recordings
        Recordings, DataFrames or files. One alone needs no list.

    Returns
    -------
    CheckResult
        What was found.

    Raises
    ------
    InputError
        The description is refused, or a recording cannot be read.
    """
    read = read_finger(finger)
    found = belongs(read, read_recordings(listed_sources(recordings)))
    return CheckResult(read, (*description_findings(read), *found))


def convert(log: str | os.PathLike[str], map: Mapping[str, Any] | str | os.PathLike[str]) -> Recording:
    """Convert a log by a map of columns (`tendonfmu convert table`).

    Parameters
    ----------
    log
        CSV, Parquet, MATLAB, HDF5, MCAP or ROS 2 bag.
    map
        The map, or the file of it; `tendonfmu convert inspect` proposes one.

    Returns
    -------
    Recording
        The log with the columns of a recording; its path is that of the log.

    Raises
    ------
    InputError
        The log or the map does not allow it.
    """
    with tempfile.TemporaryDirectory() as scratch:
        file = StandIn.of(Path(scratch) / "map.json", "map") if isinstance(map, Mapping) else Path(map)
        if isinstance(map, Mapping):
            file.write_text(json.dumps(map), encoding="utf-8")
        columns = convert_table(Path(log), file).columns
    import pandas as pd

    return Recording.from_frame(pd.DataFrame(columns), name=str(log))
