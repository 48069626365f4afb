"""The recorded cases: 26 LuGre fingers that nobody of the project made, in `shared/foreign` beside the repository."""

from __future__ import annotations

import json

import pandas as pd

from evidence.cases import FOREIGN
from evidence.fingers.foreign import Case, Truth

TRUTHS = FOREIGN / "truth.json"
NUMBERS = range(1, 27)


def make(number: int) -> Case:
    """The case of a number (from 1)."""
    name = f"case_{number:02d}"
    truth = json.loads(TRUTHS.read_text(encoding="utf-8"))[name]
    nominal = json.loads((FOREIGN / f"{name}.json").read_text(encoding="utf-8"))
    train, test = (pd.read_parquet(FOREIGN / f"{name}_{part}.parquet") for part in ("train", "test"))
    return Case(nominal, train, test, Truth(truth["hidden"], truth.get("joint"), truth.get("tendon")))
