"""How much refitting leaves of what a case hides: python python_tests/foreign/visibility.py [NUMBER ...]

The description's numbers, with presliding, are fitted to the recording; then the hidden term itself is fitted by what
these numbers can do. Below 0.1 of the residual's variance the right answer is "not visible". This is the judge's own
computation: it uses the product, the simulators do not.
"""

from __future__ import annotations

import dataclasses
import json
import sys
import tempfile
from pathlib import Path

import numpy as np

import fingers_in_numpy
from foreign_case import Array, Case
from tendonfmu.diagnosis.cause_search import look
from tendonfmu.diagnosis.extension_fit import FitSettings
from tendonfmu.diagnosis.signal_choice import Estimation, choose
from tendonfmu.model.description import read_finger
from tendonfmu.recordings.prepared import Held, prepare
from tendonfmu.recordings.recording import read_recording
from tendonfmu.statistics.splines import residual_of


def survives(case: Case) -> float:
    """Variance of what refitting leaves of the hidden term over that of the residual, which has it in it."""
    assert case.inside is not None
    with tempfile.TemporaryDirectory() as folder:
        finger, recording = Path(folder) / "finger.json", Path(folder) / "train.parquet"
        finger.write_text(json.dumps(case.nominal), encoding="utf-8")
        case.train.to_parquet(recording, index=False)
        given = read_finger(finger)
        chosen = choose(given, [prepare(given, read_recording(recording), 1, Held())], FitSettings(threads=1))
    view = look(chosen.model.data, chosen.recordings, chosen.grid, chosen.least, candidates=())
    hidden = dataclasses.replace(view.series, target=block_means(case, chosen, case.inside.hidden))
    left = residual_of(hidden, view.splines, view.columns.nominal)[view.series.used]
    return float(left.var() / view.residual[view.series.used].var())


def block_means(case: Case, chosen: Estimation, values: Array) -> Array:
    """[B, n] of values [N, n] at the times of the training recording."""
    time, own = case.train["time"].to_numpy(), chosen.recordings[0].time
    there = np.column_stack([np.interp(own, time - time[0] + own[0], column) for column in values.T])
    return np.concatenate([segment.mean(there[segment.part]) for segment in chosen.grid.segments])


def main() -> None:
    wanted = [int(each) for each in sys.argv[1:]] or list(fingers_in_numpy.NUMBERS)
    for number in wanted:
        case = fingers_in_numpy.make(number)
        if case.truth.rms:
            print(f"{case.name}, {case.truth.hidden}: {survives(case):.2f}", flush=True)


if __name__ == "__main__":
    main()
