"""A reference that does not fit is refused or warned of, in one line that names the file and what was expected."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from command import Call
from tendonfmu.diagnosis.inputs import read_input
from tendonfmu.errors import InputError
from worn_finger import RATE, Columns, described, finger, record, recording, write_files

SECONDS = 12.0
THEN = record(motion=1, noise=1, seconds=SECONDS)
NOW = record(motion=2, noise=2, seconds=SECONDS)


def rows(columns: Columns, begin: float, end: float, at: float | None = None) -> Columns:
    """A stretch, on its own clock or on one that begins at a time."""
    part = slice(round(begin * RATE), round(end * RATE))
    found = {name: values[part] for name, values in columns.items()}
    return found if at is None else found | {"time": found["time"] - found["time"][0] + at}


def one_after_another(first: Columns, second: Columns) -> Columns:
    """On one clock."""
    joined = {name: np.concatenate([values, second[name]]) for name, values in first.items()}
    return joined | {"time": np.arange(len(joined["time"])) / RATE}


def warnings_of(now: Columns, then: Columns, **data: Any) -> tuple[str, ...]:
    """Of the two recordings beside each other. Raises InputError."""
    before = [recording(then, "then.parquet")]
    return read_input(finger(described(**data)), [recording(now)], [], before, 3, 0.03, False).warnings


# --- shared samples ---------------------------------------------------------------------------------------------------


def test_other_recordings_of_the_same_motion_are_let_in() -> None:
    for now in (NOW, record(motion=1, noise=2, seconds=SECONDS)):
        assert warnings_of(now, THEN) == ()


@pytest.mark.parametrize("at", [None, 0.0, 100.0], ids=["its own clock", "from 0", "from 100 s"])
def test_a_stretch_of_the_new_recording_in_the_reference_is_refused(at: float | None) -> None:
    whole = one_after_another(THEN, NOW)
    with pytest.raises(InputError) as refused:
        warnings_of(rows(whole, 8.0, 20.0, at), THEN)
    begin = 8.0 if at is None else at
    assert str(refused.value) == (
        f"now.parquet: {begin:g} to {begin + 3.996:g} s are the same samples as 8 to 11.996 s of the reference "
        "then.parquet; expected recordings of different times"
    )


def test_half_a_second_of_a_rest_may_be_the_same() -> None:
    """A finger at rest gives the same numbers again and again, when its sensors are coarse."""
    still = {name: np.repeat(values[:1], round(2.0 * RATE)) for name, values in NOW.items()}
    warnings_of(one_after_another(still, NOW), one_after_another(still, THEN))
    moving = rows(NOW, 3.0, 3.5)
    with pytest.raises(InputError, match="are the same samples"):
        warnings_of(NOW, one_after_another(THEN, moving))
    warnings_of(NOW, one_after_another(THEN, rows(NOW, 3.0, 3.1)))


# --- conditions -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("side", ["then", "now"])
def test_a_recording_of_contact_alone_is_refused(side: str) -> None:
    columns = {"then": THEN, "now": NOW}
    files = {name: recording(each, f"{name}.parquet") for name, each in columns.items()}
    files[side] = replace(files[side], contact=np.ones(len(NOW["time"]), dtype=bool))
    with pytest.raises(InputError, match=rf"{side}\.parquet.*contact"):
        read_input(finger(), [files["now"]], [], [files["then"]], 3, 0.03, False)


def test_a_load_beyond_that_of_the_reference_is_warned_of() -> None:
    pulled = record(motion=2, noise=2, seconds=SECONDS, pretension=40.0)
    found = [each for each in warnings_of(pulled, THEN) if "outside" in each]
    assert len(found) == 1
    assert "tendon force" in found[0]
    assert not [each for each in warnings_of(NOW, THEN) if "outside" in each]


# --- the command ------------------------------------------------------------------------------------------------------


def other_finger() -> Columns:
    """Of three tendons."""
    return dict(THEN) | {f"tendon_{group}[3]": THEN[f"tendon_{group}[1]"] for group in ("force", "position")}


def exchanged() -> Columns:
    names = {f"tendon_{group}[{i}]": f"tendon_{group}[{3 - i}]" for group in ("force", "position") for i in (1, 2)}
    return {name: THEN[names.get(name, name)] for name in THEN}


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ("now.parquet --reference now.parquet", "now.parquet: the reference, but trained on as well"),
        ("now.parquet --reference copy.parquet", "copy.parquet: the reference, but trained on as well, as now.parquet"),
        ("now.parquet --test then.parquet --reference then.parquet", "then.parquet: the reference, but"),
        ("now.parquet --reference longer.parquet", "are the same samples as 7 to"),
        ("now.parquet --reference three.parquet", "three.parquet: tendon_"),
        ("now.parquet --reference exchanged.parquet", "exchanged.parquet: tendon_force[1]"),
        ("now.parquet --scheduler tcp://127.0.0.1:1 --reference then.parquet", "--scheduler: given without --history"),
        ("now.parquet --history", "history: one recording; expected two at least, or a reference"),
        ("now.parquet then.parquet --history --test other.parquet", "--test: given with --history"),
    ],
)
def test_bad_usage_is_one_line(call: Call, tmp_path: Path, arguments: str, words: str) -> None:
    write_files(
        tmp_path,
        then=THEN,
        now=NOW,
        copy=NOW,
        other=record(motion=3, noise=3, seconds=SECONDS),
        longer=rows(one_after_another(NOW, THEN), 0.0, 20.0, 7.0),
        three=other_finger(),
        exchanged=exchanged(),
    )
    answer = call("diagnose", "finger.json", *arguments.split(), "--kinematics", "3", "-o", "new")
    assert answer.status == 2 and words in answer.err, answer.err
    assert answer.err.count("\n") == 1 and any(word in answer.err for word in ("expected", "exchange"))
    assert answer.out == "" and not (tmp_path / "new" / "diagnosis.json").exists()
