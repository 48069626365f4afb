"""How one function is called for many inputs, here or on the workers of `dask.distributed`, and resumed at any time.

    jobs = [Job("monday", ("monday.parquet",)), Job("tuesday", ("tuesday.parquet",))]
    with workers_of(address="tcp://head:8786") as client:
        run_jobs(friction_of, jobs, Path("history"), client)
    rows = rows_of(jobs, Path("history"))

The row of a job, its result, is DIR/rows/NAME.json. It is written whole as soon as the job ends. A job with a row is
not run again unless it failed: its `error` is the line for the user, and `fault` the report if tendonfmu is at fault.
The calling process writes the rows, so workers need no shared disk for them.
"""

from __future__ import annotations

import itertools
import json
import math
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import tendonfmu
from tendonfmu.errors import InputError, InternalError, fault_report, refusal
from tendonfmu.files import check_output_folder, whole_file

ROWS = "rows"
SECONDS_TO_CONNECT = 20.0

Row = dict[str, Any]
Function = Callable[..., Row]


@dataclass(frozen=True)
class Job:
    """One call of the function."""

    name: str  # name of its row's file, of characters that a file's name may have
    arguments: tuple[Any, ...] = ()  # arguments of the function; they are pickled


def row_file(folder: Path, name: str) -> Path:
    """Return the file of a job's row."""
    return folder / ROWS / f"{name}.json"


def _read_row(folder: Path, name: str) -> Row | None:
    """Return the row of a job, or None if the job has not ended."""
    file = row_file(folder, name)
    return dict(json.loads(file.read_text(encoding="utf-8"))) if file.is_file() else None


def rows_of(jobs: Sequence[Job], folder: Path) -> list[Row]:
    """Return all existing rows."""
    rows = (_read_row(folder, job.name) for job in jobs)
    return [row for row in rows if row is not None]


def run_jobs(
    function: Function,
    jobs: Sequence[Job],
    folder: Path,
    client: Any = None,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> int:
    """Call the function for each job without a row, or whose row failed, and write its row when it ends."""
    _check_names(jobs)
    check_output_folder(folder)
    (folder / ROWS).mkdir(parents=True, exist_ok=True)
    waiting = [job for job in jobs if (row := _read_row(folder, job.name)) is None or row.get("error")]
    before = len(jobs) - len(waiting)
    progress(before, len(jobs))
    made = (
        _rows_of_workers(function, waiting, client) if client is not None else (call(function, job) for job in waiting)
    )
    for count, row in enumerate(made, start=1):
        with whole_file(row_file(folder, row["name"])) as file:
            file.write_text(_json(row) + "\n", encoding="utf-8")
        progress(before + count, len(jobs))
    return len(waiting)


def _check_names(jobs: Sequence[Job]) -> None:
    taken = set[str]()
    for name in (job.name for job in jobs):
        if not name or name.startswith(".") or Path(name).name != name or "\\" in name:
            raise InputError(f"jobs: name {name!r}; expected one that a file can have")
        if name in taken:
            raise InputError(f"jobs: the name {name} occurs twice; expected names that differ")
        taken.add(name)


def _json(row: Row) -> str:
    """Write a row, numbers of numpy as those of JSON, and numbers that are not finite as null."""
    plain: Row = {}
    for key, value in row.items():
        value = value.item() if isinstance(value, np.generic) else value
        plain[key] = None if isinstance(value, float) and not math.isfinite(value) else value
    return json.dumps(plain, indent=1, allow_nan=False)


def failed_row(name: str, failed: BaseException) -> Row:
    """Return the row of a job that failed."""
    words = f"{type(failed).__name__}: {' '.join(str(failed).split())}"
    if (reason := refusal(failed)) is not None or type(failed).__module__.startswith("distributed"):
        return {"name": name, "error": reason or words, "fault": ""}
    return {"name": name, "error": words, "fault": fault_report(failed, sys.argv[1:])}


def fault_words(row: Row, report: Path) -> str:
    """Return the line for the user of a row whose job failed. report: file that holds its fault."""
    if not row.get("fault"):
        return str(row["error"])
    kind = row["error"].partition(":")[0]
    return f"internal error ({kind}), a fault of tendonfmu, not of its input; please send the report {report}"


def refuse_if_all_failed(rows: Sequence[Row], what: str) -> None:
    """Raise InputError if every job failed, or InternalError if tendonfmu is at fault for all of them."""
    if all(row.get("error") for row in rows):
        refused = next((row for row in rows if not row.get("fault")), None)
        raise InternalError(rows[0]["fault"]) if refused is None else InputError(f"{what}; {refused['error']}")


def call(function: Function, job: Job) -> Row:
    """Return the job's row. This runs where the job runs."""
    begin, begin_cpu = time.perf_counter(), time.process_time()
    try:
        row = {"error": "", "fault": "", **function(*job.arguments), "name": job.name}
        _json(row)  # a value that is not allowed in a row is an error of the job
    except Exception as failed:  # the other jobs continue; the row reports the error
        row = failed_row(job.name, failed)
    return row | {"run_seconds": time.perf_counter() - begin, "cpu_seconds": time.process_time() - begin_cpu}


def _rows_of_workers(function: Function, jobs: Sequence[Job], client: Any) -> Iterator[Row]:
    """Yield each row when its job ends, with at most one running job per thread of the workers."""
    import distributed

    library: Any = distributed  # distributed has no types
    waiting = iter(jobs)
    under_way: dict[Any, Job] = {}
    pending = library.as_completed()

    def top_up() -> None:
        # a job that waits on a worker would be suspected as well if another one kills it
        for job in itertools.islice(waiting, max(1, sum(client.nthreads().values())) - len(under_way)):
            future = client.submit(call, function, job, pure=False)
            under_way[future] = job
            pending.add(future)

    try:
        top_up()
        for future in pending:
            yield _row_of(future, under_way.pop(future))
            top_up()
    except (OSError, library.CancelledError) as lost:  # not from a job: its errors are in its row
        words = " ".join(str(lost).split())
        raise InputError(
            f"the dask scheduler was lost ({type(lost).__name__}: {words}); expected it to keep running: the same "
            "command resumes the jobs"
        ) from None


def _row_of(future: Any, job: Job) -> Row:
    """Return the row of a job, also for errors that `call` could not catch."""
    try:
        return failed_row(job.name, _first_of(future.exception())) if future.status == "error" else future.result()
    finally:
        future.release()  # otherwise dask computes it again when the worker that holds it dies


def _first_of(failed: BaseException) -> BaseException:
    """Return the original error that dask has wrapped in its own."""
    while failed.__cause__ is not None:
        failed = failed.__cause__
    return failed


# --- workers ----------------------------------------------------------------------------------------------------------


@contextmanager
def workers_of(address: str | None = None, count: int = 1) -> Iterator[Any]:
    """Connect to workers."""
    library = _library()
    if address is None:
        with _local_workers(library, count) as client:
            yield client
        return
    try:
        client = library.Client(address, timeout=SECONDS_TO_CONNECT)
    except (OSError, ValueError) as failed:
        raise InputError(f"--scheduler {address}: {failed}; expected the address of a dask scheduler") from None
    with client:
        _check_versions(client, address)
        yield client


def _library() -> Any:
    try:
        import distributed
    except ImportError as missing:
        wanted = "expected both: pip install dask distributed"
        raise InputError(f"no module {missing.name}; {wanted}") from None
    return distributed


@contextmanager
def _local_workers(library: Any, count: int) -> Iterator[Any]:
    """Start workers with one thread of linear algebra each, on a free port, so that two runs do not conflict."""
    import dask

    limits = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    with (
        dask.config.set({"distributed.nanny.pre-spawn-environ": limits}),
        library.LocalCluster(
            n_workers=count, threads_per_worker=1, processes=True, dashboard_address="127.0.0.1:0"
        ) as here,
        library.Client(here) as client,
    ):
        yield client


def version_here() -> str:
    """Return the version of the package where this runs."""
    return tendonfmu.__version__


def _check_versions(client: Any, address: str) -> None:
    """Raise InputError if there is no worker, or if scheduler or workers lack this version of tendonfmu."""
    try:
        client.wait_for_workers(1, timeout=SECONDS_TO_CONNECT)
    except TimeoutError:
        raise InputError(f"--scheduler {address}: no workers; expected at least one, `dask worker {address}`") from None
    try:
        # the scheduler unpickles jobs as well
        versions = {"the scheduler": client.run_on_scheduler(version_here), **client.run(version_here)}
    except Exception as failed:  # from any of them, mostly a missing module
        words = " ".join(str(_first_of(failed)).split())
        raise InputError(
            f"--scheduler {address}: it or a worker cannot import tendonfmu ({words}); expected version "
            f"{version_here()} there"
        ) from None
    for place, version in versions.items():
        if version != version_here():
            raise InputError(f"--scheduler {address}: {place} has tendonfmu {version}; expected {version_here()}")
