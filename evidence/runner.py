"""Named cases of a bench, here or on workers of dask, resumed at any time; and what benches say on the command line.

A bench is a function of one case and a table of its rows. The row of a case is FOLDER/rows/NAME.json (tendonfmu.tasks
writes it); a case that has one is not run again.
"""

from __future__ import annotations

import argparse
import functools
import hashlib
import json
import math
import os
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from tendonfmu.files import whole_file
from tendonfmu.model import read_finger
from tendonfmu.tasks import Job, rows_of, run_jobs, workers_of
from tendonfmu.tasks.jobs import Function, Row

ROOT = Path(__file__).resolve().parent.parent
EXAMPLES = ROOT / "examples"
INDEX_FINGER = EXAMPLES / "fingers" / "index_finger.json"
INDEX_RIG = EXAMPLES / "rigs" / "index_finger.json"
DATA = Path(os.environ.get("TENDONFMU_DATA") or ROOT.parent / "shared" / "data")  # recordings that others have made
FOREIGN = DATA.parent / "foreign"


# --- cases ------------------------------------------------------------------------------------------------------------


def run_cases(
    function: Function,
    cases: Mapping[str, Sequence[Any]],
    folder: Path,
    workers: int = 1,
    scheduler: str | None = None,
    *,
    keep_errors: bool = False,
    stop_after: float = math.inf,
) -> list[Row]:
    """Rows of all cases, in order. A case that fails is run again by the next call, and raises an error here."""
    # keep_errors: rows of failed cases are returned instead; stop_after: s until no further case begins
    jobs = [Job(name, tuple(arguments)) for name, arguments in cases.items()]
    run = functools.partial(
        run_jobs,
        functools.partial(_plain_row, function),
        jobs,
        folder,
        stop_after=stop_after,
        keep_failed=keep_errors,
        progress=lambda done, total: say(f"{folder.name}: {done} of {total} cases"),
    )
    if workers == 1 and scheduler is None:
        run()
    else:
        with workers_of(scheduler, workers) as client:
            run(client)
    rows = rows_of(jobs, folder)
    failed = [f"{row['name']}: {row['error']}" for row in rows if row["error"]]
    if failed and not keep_errors:
        raise RuntimeError("\n".join(["cases failed:", *failed]))
    return rows


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


def digest(*values: Any) -> str:
    """Of all that a case depends on, for its name: what was computed with other settings is not taken for it."""
    return hashlib.sha256(json.dumps(plain(values), sort_keys=True).encode()).hexdigest()[:12]


# --- command line -----------------------------------------------------------------------------------------------------


def parser(text: str | None, output: str | None = "folder of everything") -> argparse.ArgumentParser:
    """The options of every bench; output: help text of -o, None for a bench without one."""
    options = argparse.ArgumentParser(description=text, formatter_class=argparse.RawDescriptionHelpFormatter)
    if output is not None:
        options.add_argument("-o", "--output", type=Path, required=True, help=output)
        options.add_argument("--workers", type=int, default=1, help="processes that run cases")
        options.add_argument("--scheduler", metavar="ADDRESS", help="of a dask cluster that runs cases")
    return options


def named_finger(text: str) -> tuple[str, dict[str, Any]]:
    """NAME=FILE of a finger description: its name and content, for argparse."""
    name, _, file = text.partition("=")
    if not Path(file).is_file():
        raise argparse.ArgumentTypeError(f"{text}: expected NAME=FILE with a finger description that exists")
    return name, dict(read_finger(Path(file)).data)


def say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


def write(file: Path, content: str | Mapping[str, Any] | Sequence[Any]) -> None:
    """Write a text, or an object as JSON, whole or not at all."""
    text = content if isinstance(content, str) else json.dumps(plain(content), indent=1)
    file.parent.mkdir(parents=True, exist_ok=True)
    with whole_file(file) as temporary:
        temporary.write_text(text, encoding="utf-8")


def publish(file: Path, text: str) -> None:
    """Write a page of tables, and print it."""
    write(file, text)
    print(text)
