"""What the questions share: paths, and cases whose rows are kept, so that a part goes on where it ended.

A row is FOLDER/rows/NAME.json (tendonfmu.tasks writes it); a case that has one is not run again.
"""

from __future__ import annotations

import functools
import importlib.util
import json
import math
import os
import resource
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from tendonfmu.files import whole_file
from tendonfmu.tasks import Job, rows_of, run_jobs, workers_of
from tendonfmu.tasks.jobs import Function, Row

ROOT = Path(__file__).resolve().parent.parent
EXAMPLES = ROOT / "examples"
INDEX_FINGER = EXAMPLES / "fingers" / "index_finger.json"
INDEX_RIG = EXAMPLES / "rigs" / "index_finger.json"
DATA = Path(os.environ.get("TENDONFMU_DATA") or ROOT.parent / "shared" / "data")  # recordings that others have made
FOREIGN = DATA.parent / "foreign"
LIMIT = 3600.0  # s that a command may take


def is_there(need: str) -> bool:
    """Whether a folder of ../shared, or a package, is there: see Part.needs."""
    if need.startswith("../shared/"):
        return {"data": DATA, "foreign": FOREIGN}[need.removeprefix("../shared/")].is_dir()
    return importlib.util.find_spec(need) is not None


def run_cases(function: Function, cases: Mapping[str, Sequence[Any]], folder: Path, workers: int = 1) -> list[Row]:
    """Rows of all cases, in order. A case that fails raises an error after the others, and is run again next time."""
    jobs = [Job(name, tuple(arguments)) for name, arguments in cases.items()]
    row = functools.partial(_plain_row, function)
    if workers == 1:
        run_jobs(row, jobs, folder, progress=functools.partial(_progress, folder.name))
    else:
        with workers_of(None, workers) as client:
            run_jobs(row, jobs, folder, client, progress=functools.partial(_progress, folder.name))
    rows = rows_of(jobs, folder)
    failed = [f"{row['name']}: {row['error']}" for row in rows if row["error"]]
    if failed:
        raise RuntimeError("\n".join(["cases failed:", *failed]))
    return rows


def tendonfmu(*words: str | Path, folder: Path | None = None) -> float:
    """Call the command in a folder, as a user does; return its processor time, s.

    Raises RuntimeError with the last lines of its report of an internal error, else of what it said.
    """
    before = _seconds_of_children()
    command = [sys.executable, "-m", "tendonfmu", *words]
    ended = subprocess.run(
        command, cwd=folder, timeout=LIMIT, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )
    if ended.returncode:
        reports = sorted((folder or Path()).glob("tendonfmu-error-*.txt"))
        said = reports[-1].read_text(encoding="utf-8") if reports else ended.stdout
        raise RuntimeError("\n".join(said.strip().splitlines()[-4:]) or f"exit status {ended.returncode}")
    return _seconds_of_children() - before


def _seconds_of_children() -> float:
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def _progress(name: str, done: int, total: int) -> None:
    say(f"{name}: {done} of {total} cases")


def _plain_row(function: Function, *arguments: Any) -> Row:
    return dict(plain(function(*arguments)))


def plain(value: Any) -> Any:
    """The value as JSON has it: arrays as lists, numbers that are not finite as null."""
    if isinstance(value, Mapping):
        return {str(key): plain(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [plain(inner) for inner in value]
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    value = value.item() if isinstance(value, np.generic) else value
    return None if isinstance(value, float) and not math.isfinite(value) else value


def say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


def write(file: Path, content: str | Mapping[str, Any] | Sequence[Any]) -> None:
    """Write a text, or an object as JSON, whole or not at all."""
    text = content if isinstance(content, str) else json.dumps(plain(content), indent=1)
    file.parent.mkdir(parents=True, exist_ok=True)
    with whole_file(file) as temporary:
        temporary.write_text(text, encoding="utf-8")
