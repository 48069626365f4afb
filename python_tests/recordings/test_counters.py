"""Counters of a log that start again: encoders of many turns and timers that overflow."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from tendonfmu.errors import InputError
from tendonfmu.recordings.converters.inspection import inspect_log
from tendonfmu.recordings.converters.proposal import propose
from tendonfmu.recordings.converters.table import convert_table
from tendonfmu.recordings.traps import overflow, unwrapped, wrap_of

T = np.arange(2000) / 500.0
MOTION = 2.3 * np.sin(1.7 * T) + 0.6 * np.sin(5.0 * T)  # turns


def written(folder: Path, columns: dict[str, Any], wraps: dict[str, Any]) -> tuple[Path, Path]:
    log, file = folder / "log.csv", folder / "map.json"
    pd.DataFrame(columns).to_csv(log, index=False)
    time = {"column": "t", "unit": "us"} | {key: wraps[key] for key in wraps if key == "wrap"}
    document = {
        "format": "tendonfmu-map-1",
        "columns": {
            "time": time,
            "tendon_force[1]": {"column": "force", "unit": "N"},
            "tendon_position[1]": {"column": "motor_count", "unit": "m", "scale": 1e-6} | wraps.get("position", {}),
        },
    }
    file.write_text(json.dumps(document), encoding="utf-8")
    return log, file


def counts(turn: float, noise: int = 2) -> np.ndarray[Any, Any]:
    return np.round(turn * MOTION) + np.random.default_rng(3).integers(-noise, noise + 1, len(T))


@pytest.mark.parametrize("turn", [4096.0, 4000.0, 4800.0, 16384.0, 36000.0])
def test_the_turn_of_an_encoder_is_recognised(turn: float) -> None:
    """Raw, and in SI with a factor, where only its steps say what a turn is."""
    readings = counts(turn) % turn
    assert wrap_of(readings) == turn
    if turn == 4800.0:
        return  # not a round number of steps in SI
    assert wrap_of(readings * 7.67e-7) == pytest.approx(turn * 7.67e-7, rel=1e-9)
    assert wrap_of((2 * np.pi * MOTION) % (2 * np.pi)) == pytest.approx(2 * np.pi)


def test_steps_saws_and_noise_are_no_encoder() -> None:
    square = 1000.0 * (np.sin(20.0 * T) > 0.0) + np.random.default_rng(1).normal(0.0, 3.0, len(T))
    assert wrap_of(square) is None
    assert wrap_of(np.random.default_rng(1).normal(0.0, 400.0, len(T))) is None
    assert wrap_of(counts(4096.0)) is None
    sticking = np.round(4096.0 * ((5.0 * T) % 1.0))  # a force that grows and slips
    assert wrap_of(sticking, turns=False) is None


def test_turns_are_followed_from_block_to_block(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from tendonfmu.recordings.converters import text_log

    monkeypatch.setattr(text_log, "CHUNK", 16000)
    whole = counts(4096.0) + 300
    columns = {"t": 2000 * np.arange(len(T)), "force": 5.0 + MOTION, "motor_count": whole.astype(int) % 4096}
    log, file = written(tmp_path, columns, {"position": {"wrap": 4096, "offset": 300}})
    converted = convert_table(log, file)
    assert converted.columns["tendon_position[1]"] == pytest.approx((whole - 300) * 1e-6, abs=1e-12)
    assert not converted.notes
    proposal = propose(inspect_log(log))
    assert {line.column: line.wrap for line in proposal.lines}["tendon_position[1]"] == 4096.0


def test_a_step_of_nearly_half_a_turn_is_named(tmp_path: Path) -> None:
    columns = {"t": 2000 * np.arange(len(T)), "force": 5.0 + MOTION, "motor_count": (3000 * np.arange(len(T))) % 8192}
    assert any(
        "turns may be lost" in note
        for note in convert_table(*written(tmp_path, columns, {"position": {"wrap": 8192}})).notes
    )


@pytest.mark.parametrize("bits", [16, 32])
def test_a_timer_that_overflows_is_named_and_never_sorted(tmp_path: Path, bits: int) -> None:
    word = 2**bits
    time = (
        (word - 100_000 % word + 2000 * np.arange(len(T))) % word if bits == 32 else (2000 * np.arange(len(T))) % word
    )
    columns = {"t": time, "force": 5.0 + MOTION, "motor_count": counts(4096.0)}
    log, file = written(tmp_path, columns, {})
    for disorder in ({}, {"log": {"disorder": "sort"}}):
        document = json.loads(file.read_text(encoding="utf-8")) | disorder
        file.write_text(json.dumps(document), encoding="utf-8")
        with pytest.raises(InputError, match=f'overflows: write "wrap": {word} at columns.time') as error:
            convert_table(log, file)
        assert "sort" not in str(error.value)
    log, file = written(tmp_path, columns, {"wrap": word})
    time = convert_table(log, file).columns["time"]
    assert np.diff(time) == pytest.approx(2000e-6, rel=1e-6)
    inspection = inspect_log(log)
    line = propose(inspection).lines[0]
    assert (line.source, line.unit, line.wrap) == ("t", "us", float(word))
    assert inspection.topics[0].clock is not None and not inspection.topics[0].clock.backwards
    assert any("overflows" in note for note in inspection.notes)


def test_a_clock_that_is_set_back_is_no_overflow() -> None:
    assert overflow(np.array([100.0, 101.0, 102.0, 50.0, 51.0])) is None
    assert overflow(np.arange(9.0)) is None
    assert overflow(np.random.default_rng(5).permutation(np.arange(0.0, 1000.0, 5.0))) is None  # shuffled
    assert overflow(np.arange(0, 4000, 4) % 1000) == 1000.0  # milliseconds beyond a second
    assert unwrapped(np.array([1, 3, 0, 2]), 4.0, 0.0).tolist() == [1.0, -1.0, 0.0, -2.0]


def test_microseconds_since_boot_are_no_date(tmp_path: Path) -> None:
    """Of 50 minutes, whose number looks like seconds since 1970."""
    pd.DataFrame({"time": 3_000_000_000 + 2000 * np.arange(len(T)), "force": MOTION}).to_csv(
        tmp_path / "l.csv", index=False
    )
    assert propose(inspect_log(tmp_path / "l.csv")).lines[0].unit == "us"
