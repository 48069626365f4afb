"""Repetitions of a test: a few in `./test`, all in `tools/nightly tests`."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import pytest


def repeated(values: Iterable[Any], *usual: int) -> list[Any]:
    """Values for `pytest.mark.parametrize`. usual: numbers of those that are not long, from 0; tuples are several."""
    cases = [each if hasattr(each, "marks") else pytest.param(*(each if isinstance(each, tuple) else (each,)))
             for each in values]  # fmt: skip
    return [
        each if k in usual else pytest.param(*each.values, marks=[*each.marks, pytest.mark.long], id=each.id)
        for k, each in enumerate(cases)
    ]
