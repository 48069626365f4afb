"""How much of a change in a simulated finger there is to see: the judge's own computation.

It uses the product's residual, as python_tests/foreign/visibility.py does; the simulators do not.
"""

from __future__ import annotations

import json
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from change_case import Array, Columns
from tendonfmu.diagnosis.cause_search import look
from tendonfmu.diagnosis.extension_fit import FitSettings
from tendonfmu.diagnosis.signal_choice import choose
from tendonfmu.files.tables import write_table
from tendonfmu.model.description import read_finger
from tendonfmu.recordings.prepared import Held, prepare
from tendonfmu.recordings.recording import read_recording
from tendonfmu.statistics.splines import residual_of


@dataclass(frozen=True)
class Visible:
    """Variance of the added torque over that of the remainder, at the joint where it is largest. whole: less the slow
    bias; survives: less all that refitting the finger's numbers to the recording can do as well."""

    whole: float
    survives: float


def visible(finger: Mapping[str, Any], recording: Columns, added: Array) -> Visible:
    """recording: without the change. added: [N, n] N·m, torque that the change adds at its samples."""
    with tempfile.TemporaryDirectory() as scratch:
        description, file = Path(scratch) / "finger.json", Path(scratch) / "quiet.parquet"
        description.write_text(json.dumps(finger), encoding="utf-8")
        write_table(file, dict(recording))
        given = read_finger(description)
        chosen = choose(given, [prepare(given, read_recording(file), 1, Held())], FitSettings(threads=1))
    view = look(chosen.model.data, chosen.recordings, chosen.grid, chosen.least, candidates=())
    used = view.series.used
    # the recording may begin at another time after its signals are prepared, and has other samples then
    own = chosen.recordings[0].time
    there = np.column_stack([np.interp(own - own[0], recording["time"] - recording["time"][0], c) for c in added.T])
    blocks = np.concatenate([segment.mean(there[segment.part]) for segment in chosen.grid.segments])
    torque = replace(view.series, target=blocks)
    nominal = view.columns.nominal
    left = view.residual[used].var(axis=0)
    ratios = [
        float(np.max(residual_of(torque, view.splines, columns)[used].var(axis=0) / left))
        for columns in (nominal[:, :, :0], nominal)
    ]
    return Visible(*ratios)
