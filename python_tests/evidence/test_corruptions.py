"""Corruptions of recordings: each changes what it says and nothing else, and the same seed does the same."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from evidence.fingers.corruptions import Corruption, applicable, columns_of, corrupt, corruptions
from evidence.fingers.foreign import frame

CORRUPTIONS = list(corruptions())


@pytest.fixture(scope="module")
def sound() -> pd.DataFrame:
    """4 s of 2 joints and 4 tendons."""
    time = np.arange(2000) / 500
    phases = np.arange(1, 5)
    waves = np.sin(np.outer(time, phases) + phases)
    return frame(time, 20.0 + 5.0 * waves, 0.01 * waves[:, ::-1], waves[:, :2])


@pytest.mark.parametrize("corruption", CORRUPTIONS, ids=lambda each: f"{each.family}: {each.name}")
def test_a_corruption_changes_its_columns_alone(sound: pd.DataFrame, corruption: Corruption) -> None:
    if not applicable(sound, corruption):
        assert corruption.columns > len(columns_of(sound, corruption.group))
        return
    before = sound.copy()
    changed, chosen = corrupt(sound, corruption, np.random.default_rng(1))
    pd.testing.assert_frame_equal(sound, before)
    again, same = corrupt(sound, corruption, np.random.default_rng(1))
    pd.testing.assert_frame_equal(changed, again)
    assert chosen == same and len(chosen) == (corruption.columns or len(columns_of(sound, corruption.group)))
    assert (np.diff(changed["time"]) > 0).all()
    if len(changed) == len(sound) and "velocity" not in corruption.name and corruption.family != "filled":
        differing = {column for column in sound if not np.array_equal(sound[column], changed[column])}
        elements = {column.split("[")[-1] for column in chosen}
        assert differing and {column.split("[")[-1] for column in differing} <= elements
