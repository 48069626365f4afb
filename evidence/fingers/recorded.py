"""The recorded cases: 26 LuGre fingers that nobody of the project made, in `shared/foreign` beside the repository."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pandas as pd

from evidence.fingers.foreign import Case, Truth

FAMILY = "recorded"
ROOT = Path(__file__).resolve().parents[2]


def folder() -> Path | None:
    """The recordings' folder, beside this repository or, for a work tree elsewhere, beside the one it belongs to."""
    found = [root.parent / "shared" / "foreign" for root in (ROOT, main_tree()) if root]
    return next((each for each in found if (each / "truth.json").is_file()), None)


def main_tree() -> Path | None:
    command = ["git", "rev-parse", "--path-format=absolute", "--git-common-dir"]
    try:
        answer = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    except OSError:
        return None
    return Path(answer.stdout.strip()).parent if answer.returncode == 0 else None


def numbers() -> range:
    """Numbers of the cases; none, with a word on standard error, where the recordings are not there."""
    place = folder()
    if place is None:
        print("SKIPPED: the recorded cases: no folder shared/foreign beside the repository", file=sys.stderr)
        return range(0)
    return range(1, len(json.loads((place / "truth.json").read_text(encoding="utf-8"))) + 1)


def make(number: int) -> Case:
    """The case of a number (from 1)."""
    place = folder()
    if place is None:
        raise FileNotFoundError("no folder shared/foreign beside the repository")
    name = f"case_{number:02d}"
    truth = json.loads((place / "truth.json").read_text(encoding="utf-8"))[name]
    nominal = json.loads((place / f"{name}.json").read_text(encoding="utf-8"))
    train, test = (pd.read_parquet(place / f"{name}_{part}.parquet") for part in ("train", "test"))
    return Case(FAMILY, number, nominal, train, test, Truth(**truth))
