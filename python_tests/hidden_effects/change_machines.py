"""The measured machines of the cases of a change: stretches of their recordings, and models of them.

EMPS: two recordings of the same path, of which one has pulses of the drive's force on it; these may stand as motor
force or as known load. da Vinci: 15 runs, ten loads at 0.1 Hz and five at 0.5 Hz. A stretch is a part of one of them.
Needs the recordings in ../shared/data or $TENDONFMU_DATA.
"""

from __future__ import annotations

import json
import os
import tempfile
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from scipy import io, signal

from change_case import Columns
from measured import FORCE, LOAD, Description, Machine
from tendonfmu.estimate.fitting import FitWarning, FrictionFit
from tendonfmu.files.tables import write_table
from tendonfmu.recordings.converters import convert_file
from tendonfmu.recordings.converters.emps import CUTOFF

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
DATA = Path(os.environ.get("TENDONFMU_DATA") or ROOT.parent / "shared" / "data")
THINNED = 2  # samples of 1 kHz to one: the remainder of the EMPS model grows by 1 %
PRETENSION = 13.0  # N, da Vinci: the closing cable never goes slack
JAMMED = {"07": 16.5}  # s; the instrument jams after that
PULSE = 5.0695  # V, measured (README of the data); the drive's gain makes newtons of it

MODELS = ("diagnosed", "plain")
KINEMATICS = {"emps": 3, "davinci": 1}
PLAIN = {"emps": ("emps", "emps.json"), "davinci": ("davinci", "jaw_nominal.json")}  # in examples


@dataclass(frozen=True)
class Stretch:
    """run: plain, pulses or loaded of EMPS (loaded: its pulses are known load), else a run's name. begin, end: s."""

    run: str
    begin: float = 0.0
    end: float = 1e6

    def __str__(self) -> str:
        return self.run if self.end > 1e5 else f"{self.run} {self.begin:g}-{self.end:g} s"


@cache
def recording(machine: str, run: str) -> Columns:
    """All of a run, at 1 kHz."""
    if machine == "davinci":
        file = DATA / "davinci_tool" / "Tool_4_Maryland_L_4" / f"{run}.TXT"
        return part_of(convert_file("davinci", file, {"pretension": PRETENSION}), 0.0, JAMMED.get(run, 1e6))
    file = DATA / "emps" / ("DATA_EMPS.mat" if run == "plain" else "DATA_EMPS_PULSES.mat")
    columns = convert_file("emps", file, {"decimation": 1})
    return with_pulses_as_load(columns, file) if run == "loaded" else columns


def with_pulses_as_load(columns: Columns, file: Path) -> Columns:
    """The pulses taken off the drive's force, and off the torque that accelerates: a known push of the same size."""
    raw = io.loadmat(file)
    time, on = np.ravel(raw["t"]), np.ravel(raw["pulses_N"]) > 0
    force = PULSE * float(np.ravel(raw["gtau"])[0]) * on
    smooth = signal.filtfilt(*signal.butter(4, CUTOFF, fs=1.0 / float(np.median(np.diff(time)))), force)
    pulse = np.interp(columns["time"], time, smooth)
    return dict(columns) | {FORCE: columns[FORCE] - pulse, LOAD: columns[LOAD] - pulse}


def part_of(columns: Columns, begin: float, end: float) -> Columns:
    """From 0 s on again, as a recording of its own."""
    rows = (columns["time"] >= begin) & (columns["time"] < end)
    part = {name: values[rows] for name, values in columns.items()}
    return part | {"time": part["time"] - part["time"][0]}


def thinned(columns: Columns, to_one: int = THINNED) -> Columns:
    """Means of so many samples each."""
    rows = len(columns["time"]) // to_one * to_one
    return {name: values[:rows].reshape(-1, to_one).mean(axis=1) for name, values in columns.items()}


def cut(machine: str, stretches: Sequence[Stretch], known_load: bool = True) -> dict[str, Columns]:
    """Recordings at 1 kHz, by the words of their stretches. known_load: with the column `external_torque`."""
    found = {str(each): part_of(recording(machine, each.run), each.begin, each.end) for each in stretches}
    return {
        words: {name: values for name, values in columns.items() if known_load or name != LOAD}
        for words, columns in found.items()
    }


def diagnosed_model(machine: str) -> Description:
    """Diagnosed again until nothing was found (measured_*.json)."""
    model: Description = json.loads((HERE / f"measured_{machine}.json").read_text(encoding="utf-8"))
    return model


@cache
def plain_model(machine: str, stretches: tuple[Stretch, ...], known_load: bool) -> Mapping[str, Any]:
    """Coulomb and viscous friction as in examples, fitted to the stretches: what most users have."""
    folder, name = PLAIN[machine]
    start = json.loads((ROOT / "examples" / folder / name).read_text(encoding="utf-8"))
    with tempfile.TemporaryDirectory() as scratch, warnings.catch_warnings():
        warnings.simplefilter("ignore", FitWarning)
        files = []
        for k, columns in enumerate(cut(machine, stretches, known_load).values()):
            files.append(Path(scratch) / f"{k}.parquet")
            write_table(files[-1], dict(thinned(columns)))
        fit = FrictionFit(start, kinematics=KINEMATICS[machine], threads=1, uncertainty=False).fit(files)
    fitted: Mapping[str, Any] = fit.description_.data
    return fitted


def model_of(machine: str, model: str, stretches: tuple[Stretch, ...], known_load: bool = True) -> Description:
    """stretches: of the machine as it was, which a plain model is fitted to."""
    return diagnosed_model(machine) if model == "diagnosed" else dict(plain_model(machine, stretches, known_load))


def seen(machine: str, model: Description, recordings: Mapping[str, Columns]) -> Machine:
    return Machine(machine, model, {name: dict(columns) for name, columns in recordings.items()}, KINEMATICS[machine])
