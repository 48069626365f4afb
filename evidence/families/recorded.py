"""The recorded cases: 26 LuGre fingers that nobody of the project made, in `shared/foreign` beside the repository."""

from __future__ import annotations

import dataclasses
import json

import pandas as pd

from evidence.cases import FOREIGN
from evidence.families.finger import Nominal

NUMBERS = range(1, 27)


@dataclasses.dataclass(frozen=True)
class Recorded:
    nominal: Nominal
    train: pd.DataFrame
    test: pd.DataFrame
    hidden: str  # `none`, an effect, or `unknown_*`
    joint: int | None  # from 1
    tendon: int | None


def make(number: int) -> Recorded:
    """The case of a number (from 1)."""
    name = f"case_{number:02d}"
    truth = json.loads((FOREIGN / "truth.json").read_text(encoding="utf-8"))[name]
    nominal = json.loads((FOREIGN / f"{name}.json").read_text(encoding="utf-8"))
    train, test = (pd.read_parquet(FOREIGN / f"{name}_{part}.parquet") for part in ("train", "test"))
    return Recorded(nominal, train, test, truth["hidden"], truth.get("joint"), truth.get("tendon"))
