"""Many diagnoses of recordings whose cause is known: run anywhere, resumed at any time, one table at the end.

Each case writes its row as soon as it ends, DIR/rows/NAME.json, whole or not at all; a case with a row is not run
again. The rows together are DIR/campaign.parquet.
"""

from __future__ import annotations

import json
import math
import os
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tendonfmu.campaign_cases import Case, made, names_of, python_function
from tendonfmu.campaign_judgement import judge, judge_names
from tendonfmu.diagnosis_result import Diagnosis
from tendonfmu.errors import InputError
from tendonfmu.whole_file import check_output_folder, whole_file

ROWS = "rows"
TABLE = "campaign.parquet"

Row = dict[str, Any]


def row_file(folder: Path, name: str) -> Path:
    return folder / ROWS / f"{name}.json"


def still_to_do(cases: Sequence[Case], folder: Path, failed_again: bool = False) -> list[Case]:
    """Cases without a row; failed_again: also those whose row is an error."""
    return [case for case in cases if _wanted(row_file(folder, case.name), failed_again)]


def _wanted(file: Path, failed_again: bool) -> bool:
    if not file.is_file():
        return True
    return failed_again and bool(json.loads(file.read_text(encoding="utf-8")).get("error"))


# --- one case, on a worker --------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class How:
    """beside: FILE.py:FUNCTION, its file absolute, called as FUNCTION(case) -> name of a rival -> the causes that it
    names. least_gain: of a cause, as `diagnose` takes it."""

    beside: str | None = None
    least_gain: float = 0.03


ALL_OF_IT = How()


def run_case(case: Case, how: How = ALL_OF_IT) -> Row:
    """Makes the recordings, diagnoses them untold, and judges the answer. What goes wrong becomes the row's `error`."""
    begin = time.perf_counter()
    row: Row = {"name": case.name, "group": case.group, "rig": case.rig, "seed": case.seed, "error": ""}
    try:
        with tempfile.TemporaryDirectory(prefix="tendonfmu-campaign-") as folder:
            row |= _answered(made(case, Path(folder)), how)
    except Exception as failed:  # a campaign of days goes on: the row says what happened
        row["error"] = f"{type(failed).__name__}: {' '.join(str(failed).split())}"
    return row | {"run_seconds": time.perf_counter() - begin}


def _answered(case: Case, how: How) -> Row:
    row: Row = {"rig": case.rig, "truth": json.dumps([vars(truth) for truth in case.truth])}
    if case.truth:
        row |= {f"true_{key}": value for key, value in vars(case.truth[0]).items()}
    row |= dict(case.facts) | _diagnosed(case, how)
    if how.beside is not None:
        for rival, names in python_function(how.beside, Path.cwd())(case).items():
            row |= {f"{rival}.{key}": value for key, value in judge_names(case, names).items()}
    return row


def _diagnosed(case: Case, how: How) -> Row:
    found = _diagnosis(case, case.recordings, how)
    row = judge(case, found)
    if case.reference:
        row["true_gain"] = true_gain(found.nominal_data, found.extended_data, case)
    if case.experiment is not None:
        row["named_after_experiment"] = named_after_experiment(case, found, how)
    return row


def named_after_experiment(case: Case, found: Diagnosis, how: How = ALL_OF_IT) -> bool:
    """Whether the hidden effect is named once what the diagnosis asks for, for its sake, has been recorded as well."""
    assert case.experiment is not None
    truth = case.truth[0]
    own = [each.motion for each in found.invisible if each.where.effect == truth.effect and each.motion]
    motion = own[0] if own else found.experiment.motion
    if not motion:
        return False
    folder = case.recordings[0].parent
    recording = folder / python_function(case.experiment, folder)(folder, motion, **case.arguments)
    causes = _diagnosis(case, [*case.recordings, recording], how).causes
    return any(truth.effect in (w.effect for w in (each.where, *each.confusable_with)) for each in causes)


def _diagnosis(case: Case, recordings: Sequence[Path], how: How) -> Diagnosis:
    from tendonfmu.diagnosis import diagnose

    assert case.finger is not None
    return diagnose(
        case.finger,
        list(recordings),
        list(case.test),
        kinematics=case.kinematics,
        least_gain=how.least_gain,
        seed=case.seed,
    )


def true_gain(nominal: Mapping[str, Any], extended: Mapping[str, Any], case: Case) -> float:
    """1 − rms of the extended over that of the nominal model, over all joints of the case's reference recordings."""
    from tendonfmu.description import read_finger
    from tendonfmu.fit_recordings import Held, prepare
    from tendonfmu.gain import residual_of
    from tendonfmu.recording import read_recording

    assert case.finger is not None
    finger = read_finger(case.finger)
    sums = np.zeros(2)
    for path in case.reference:
        recording = prepare(finger, read_recording(path), case.kinematics, Held())
        for k, data in enumerate((nominal, extended)):
            sums[k] += float(np.nansum(residual_of(data, recording)[1:] ** 2))
    return 1.0 - math.sqrt(sums[1] / sums[0])


# --- all of them ------------------------------------------------------------------------------------------------------


@contextmanager
def cluster(address: str | None, workers: int) -> Iterator[Any]:
    """A dask client: of the scheduler at an address, or of worker processes here. Raises InputError without dask."""
    try:
        import dask
        import distributed
    except ImportError as missing:
        wanted = "expected dask and distributed: pip install 'tendonfmu[campaign]'"
        raise InputError(f"campaign: no module {missing.name}; {wanted}") from None
    library: Any = distributed  # it has no types
    if address is not None:
        try:
            client = library.Client(address, timeout=20)
        except (OSError, ValueError) as failed:
            raise InputError(f"--scheduler {address}: {failed}; expected the address of a dask scheduler") from None
        with client:
            yield client
        return
    # one thread of linear algebra per worker; a port of its own, so that two campaigns do not meet
    limits = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    with (
        dask.config.set({"distributed.nanny.pre-spawn-environ": limits}),
        library.LocalCluster(
            n_workers=workers, threads_per_worker=1, processes=True, dashboard_address="127.0.0.1:0"
        ) as here,
        library.Client(here) as client,
    ):
        yield client


def run_campaign(
    cases: Sequence[Case],
    folder: Path,
    client: Any,
    *,
    how: How = ALL_OF_IT,
    stop_after: float = math.inf,
    failed_again: bool = False,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> int:
    """Runs what has no row yet, a row's file as each case ends. Returns how many ran.

    client: of dask, or None: here, one after another. stop_after: s, after which no further case begins.
    """
    check_output_folder(folder)
    (folder / ROWS).mkdir(parents=True, exist_ok=True)
    waiting = still_to_do(cases, folder, failed_again)
    done = len(cases) - len(waiting)
    progress(done, len(cases))
    count = 0
    for row in _rows(waiting, client, how, time.monotonic() + stop_after):
        write_row(folder, row)
        count += 1
        progress(done + count, len(cases))
    return count


def _rows(cases: Sequence[Case], client: Any, how: How, deadline: float) -> Iterator[Row]:
    """Each row as it ends. Only as many cases are under way as there are workers to take them at once, and one more."""
    waiting = iter(cases)

    def next_case() -> Case | None:
        return next(waiting, None) if time.monotonic() < deadline else None

    if client is None:
        while (case := next_case()) is not None:
            yield run_case(case, how)
        return
    import distributed

    library: Any = distributed
    threads = max(1, sum(client.nthreads().values()))
    begun = [case for case in (next_case() for _ in range(threads + 1)) if case is not None]
    pending = library.as_completed([client.submit(run_case, case, how, pure=False) for case in begun])
    for future in pending:
        yield future.result()
        case = next_case()
        if case is not None:
            pending.add(client.submit(run_case, case, how, pure=False))


def write_row(folder: Path, row: Row) -> None:
    with whole_file(row_file(folder, row["name"])) as file:
        file.write_text(json.dumps(_plain(row), indent=1, allow_nan=True) + "\n", encoding="utf-8")


def _plain(row: Row) -> Row:
    """Numbers of numpy as those of JSON; what is not finite as null."""
    found: Row = {}
    for key, value in row.items():
        value = value.item() if isinstance(value, np.generic) else value
        found[key] = None if isinstance(value, float) and not math.isfinite(value) else value
    return found


def collect(cases: Sequence[Case], folder: Path) -> list[Row]:
    """All rows there are, in the order of the cases, also written to DIR/campaign.parquet.

    Raises InputError where there is none.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    files = [row_file(folder, name) for name in names_of(cases)]
    rows: list[Row] = [json.loads(file.read_text(encoding="utf-8")) for file in files if file.is_file()]
    if not rows:
        raise InputError(f"{folder / ROWS}: no rows of these cases; expected at least one case to have ended")
    keys = list(dict.fromkeys(key for row in rows for key in row))
    columns = {key: pa.array([row.get(key) for row in rows]) for key in keys}
    with whole_file(folder / TABLE) as file:
        pq.write_table(pa.table(columns), file)
    return rows


def worker_count() -> int:
    """As many as there are processors to use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
