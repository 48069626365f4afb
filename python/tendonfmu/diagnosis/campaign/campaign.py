"""How often a diagnosis is right: many recordings whose cause is known, diagnosed and judged.

A campaign runs anywhere, can be resumed at any time, and ends in one table. Each case is a job (tasks/jobs.py) whose
row is DIR/rows/NAME.json. All rows together are DIR/campaign.parquet.
"""

from __future__ import annotations

import json
import math
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tendonfmu.diagnosis.campaign.cases import Case, made, python_function
from tendonfmu.diagnosis.campaign.judging import judge, judge_names
from tendonfmu.diagnosis.result import Diagnosis
from tendonfmu.errors import InputError
from tendonfmu.files import whole_file
from tendonfmu.tasks import ROWS, Job, Row, rows_of, run_jobs, waiting_jobs

TABLE = "campaign.parquet"


# --- one case, on a worker --------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class How:
    """How the cases of a campaign are diagnosed."""

    beside: str | None = None  # FILE.py:FUNCTION with an absolute path, for rival methods
    least_gain: float = 0.03  # of a cause, as for `diagnose`


ALL_OF_IT = How()


def run_case(case: Case, how: How = ALL_OF_IT) -> Row:
    """Make the recordings, diagnose them without the truth, and judge the answer."""
    with tempfile.TemporaryDirectory(prefix="tendonfmu-campaign-") as folder:
        return known_of(case) | _answered(made(case, Path(folder)), how)


def known_of(case: Case) -> Row:
    """Return what a row says of its case, even if the case fails."""
    return {"name": case.name, "group": case.group, "rig": case.rig, "seed": case.seed}


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
    if case.gain_recordings:
        row["true_gain"] = true_gain(found.nominal_data, found.extended_data, case)
    if case.experiment is not None:
        row["named_after_experiment"] = named_after_experiment(case, found, how)
    return row


def named_after_experiment(case: Case, found: Diagnosis, how: How = ALL_OF_IT) -> bool:
    """Return whether the hidden effect is named once the requested experiment has been recorded, too."""
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
    from tendonfmu.diagnosis.diagnosis import diagnose

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
    """Return 1 − rms of the extended / rms of the nominal model, over all joints of the case's gain recordings."""
    from tendonfmu.diagnosis.gain import residual_of
    from tendonfmu.model import read_finger
    from tendonfmu.recordings import Held, prepare, read_recording

    assert case.finger is not None
    finger = read_finger(case.finger)
    sums = np.zeros(2)
    for path in case.gain_recordings:
        recording = prepare(finger, read_recording(path), case.kinematics, Held())
        for k, data in enumerate((nominal, extended)):
            sums[k] += float(np.nansum(residual_of(data, recording)[1:] ** 2))
    return 1.0 - math.sqrt(sums[1] / sums[0])


# --- all of them ------------------------------------------------------------------------------------------------------


def jobs_of(cases: Sequence[Case], how: How) -> list[Job]:
    return [Job(case.name, (case, how)) for case in cases]


def still_to_do(cases: Sequence[Case], folder: Path, failed_again: bool = False) -> list[Case]:
    """Return the cases without a row."""
    waiting = {job.name for job in waiting_jobs(jobs_of(cases, ALL_OF_IT), folder, failed_again)}
    return [case for case in cases if case.name in waiting]


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
    """Run the cases that have no row yet, as `jobs.run_jobs` does."""
    return run_jobs(
        run_case,
        jobs_of(cases, how),
        folder,
        client,
        stop_after=stop_after,
        failed_again=failed_again,
        progress=progress,
    )


def collect(cases: Sequence[Case], folder: Path) -> list[Row]:
    """Collect all existing rows and write them to DIR/campaign.parquet."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    known = {case.name: known_of(case) for case in cases}
    rows = [known[row["name"]] | row for row in rows_of(jobs_of(cases, ALL_OF_IT), folder)]
    if not rows:
        raise InputError(f"{folder / ROWS}: no rows of these cases; expected at least one case to have ended")
    keys = list(dict.fromkeys(key for row in rows for key in row))
    columns = {key: pa.array([row.get(key) for row in rows]) for key in keys}
    with whole_file(folder / TABLE) as file:
        pq.write_table(pa.table(columns), file)
    return rows
