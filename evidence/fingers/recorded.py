"""The recorded cases: 26 LuGre fingers that nobody of the project made, in `shared/foreign` beside the repository."""

from __future__ import annotations

import json
import sys

import pandas as pd

from evidence.fingers.foreign import Case, Truth
from evidence.runner import FOREIGN

FAMILY = "recorded"
TRUTHS = FOREIGN / "truth.json"


def numbers() -> range:
    """Numbers of the cases; none, with a word on standard error, where the recordings are not there."""
    if not TRUTHS.is_file():
        print(f"SKIPPED: the recorded cases: no folder {FOREIGN}", file=sys.stderr)
        return range(0)
    return range(1, len(json.loads(TRUTHS.read_text(encoding="utf-8"))) + 1)


def make(number: int) -> Case:
    """The case of a number (from 1)."""
    name = f"case_{number:02d}"
    truth = json.loads(TRUTHS.read_text(encoding="utf-8"))[name]
    nominal = json.loads((FOREIGN / f"{name}.json").read_text(encoding="utf-8"))
    train, test = (pd.read_parquet(FOREIGN / f"{name}_{part}.parquet") for part in ("train", "test"))
    return Case(FAMILY, number, nominal, train, test, Truth(**truth))
