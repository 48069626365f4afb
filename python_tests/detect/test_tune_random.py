"""`tune` on anything that moves: a valid description that keeps its rate, or an error that says why not."""

from __future__ import annotations

import json
import re
import warnings
from collections.abc import Mapping
from functools import lru_cache
from importlib.resources import files as files_of
from typing import Any

import jsonschema
import numpy as np
import pytest

pytest.importorskip("tendonfmu._native", reason="SKIPPED: tendonfmu is not installed")

from random_free_motion import random_free_case
from tendonfmu.detect.free_motion import closed_loop, free_parts
from tendonfmu.detect.tune_report import build_report
from tendonfmu.detect.tuning import ContactTuning, TuneWarning
from tendonfmu.errors import InputError
from tendonfmu.model.native import Instance

# 13, 23, 36 and 59: negative thresholds, or of 4e10, before bounds had a least; 1 is refused
FEW, MANY = (0, 59), range(200)
# one line each: the file or the key, and what was expected
PRECISE = re.compile(r"^(free_\d\.parquet: |bias\.|finger: |no free motion ).*(expected |; probably )", re.DOTALL)
REFUSED_AT_MOST = 0.4  # of the random cases; frozen forces and fingers whose bias has no time constant are refused


@lru_cache(maxsize=1)
def report_validator() -> Any:
    schema = json.loads(files_of("tendonfmu").joinpath("schema", "tune_report.schema.json").read_text())
    return jsonschema.Draft202012Validator(schema)


def tuned_or_refused(seed: int, method: str, longest: float) -> ContactTuning | None:
    """The tuning, or None where a precise error refuses it."""
    finger, recordings = random_free_case(seed, longest)
    tuning = ContactTuning(finger, method=method, bias_time=0.4 if seed % 2 else None)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", TuneWarning)
            return tuning.tune(recordings)
    except InputError as refused:
        sentence = str(refused)
    assert PRECISE.match(sentence) and "\n" not in sentence, sentence
    return None


def check(seed: int, method: str, longest: float) -> bool:
    """Whether it could be tuned; what it says of itself is counted again."""
    tuning = tuned_or_refused(seed, method, longest)
    if tuning is None:
        return False
    data = json.loads(tuning.description_text())
    Instance.from_description(data)  # the core takes it
    contact = data["contact"]
    assert contact["method"] == method
    for numbers in numbers_of(contact):
        assert np.isfinite(numbers).all() and (np.asarray(numbers) >= 0).all(), contact
    report_validator().validate(build_report(tuning))
    assert tuning.rate_ >= tuning.options.false_alarms_per_hour and (tuning.more_minutes_ > 0) == (tuning.rate_ > 6.0)
    # the own part of each bound is above 0 wherever the finger was, and no alarm lasts beyond those allowed
    _, recordings = random_free_case(seed, longest)
    parts = [part for each in recordings for part in free_parts(tuning.start_, each, 1)[0]]
    for part, flags, counted in zip(parts, closed_loop(data, parts), tuning.loop_, strict=True):
        force = part.mean_force[part.counted]
        for key in (contact, contact.get("innovation", contact)):
            own = np.outer(force, key.get("threshold_per_force", 0.0)) + key["threshold"]
            assert not len(own) or own.min() > 0
        begins = int((np.diff(flags[part.counted].astype(int), prepend=0) > 0).sum())
        assert begins >= counted.alarms
    alarms = sum(each.alarms for each in tuning.loop_)
    assert alarms <= tuning.allowed_ or any("even with bounds" in sentence for sentence in tuning.warnings_)
    return True


def numbers_of(contact: Mapping[str, Any]) -> list[Any]:
    """All numbers of `contact` but the directions of the uncertainty, which have signs."""
    found: list[Any] = []
    for key, value in contact.items():
        if isinstance(value, Mapping):
            found += numbers_of(value)
        elif key not in ("uncertainty", "method") and value is not None:
            found.append(value)
    return found


@pytest.mark.parametrize("method", ["innovation", "cusum", "threshold"])
def test_random_free_motion_is_tuned_or_refused(method: str) -> None:
    assert sum(check(seed, method, 40.0) for seed in FEW) >= (1 - REFUSED_AT_MOST) * len(FEW)


@pytest.mark.long
@pytest.mark.parametrize("method", ["innovation", "cusum", "threshold"])
def test_all_random_free_motion_is_tuned_or_refused(method: str) -> None:
    """10 s to 5 min."""
    assert sum(check(seed, method, 300.0) for seed in MANY) >= (1 - REFUSED_AT_MOST) * len(MANY)
