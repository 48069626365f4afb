"""How much faster two dask workers are than one: python bench/job_scaling.py [--jobs 24] [--seconds 2.0] [--rounds 3]

A scheduler and its workers are processes of their own that talk by TCP on the loopback. Each job takes a fixed
processor time, so wall-clock time shows what the engine costs, as long as nothing else runs on the machine: the load
before it, and the processor time that the workers got, are printed beside it. With --waiting each job waits that long
and computes nothing: what the engine costs, on a busy machine too.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "python_tests" / "support"))

import some_jobs
from dask_on_loopback import dask_processes
from tendonfmu.tasks.jobs import Function, Job, rows_of, run_jobs, workers_of


@dataclass(frozen=True)
class Run:
    """wall: s, of all jobs. share: processor time of the jobs over wall-clock time of the workers, 1 on a quiet machine
    without overhead."""

    wall: float
    share: float


def run(workers: int, jobs: int, seconds: float, function: Function = some_jobs.compute) -> Run:
    """So many jobs of some seconds each, on so many workers that are there before the clock starts."""
    listed = [Job(f"job_{k}", (seconds,)) for k in range(jobs)]
    with (
        tempfile.TemporaryDirectory() as folder,
        dask_processes(workers) as processes,
        workers_of(processes.address) as client,
    ):
        client.wait_for_workers(workers, timeout=60)
        client.run(time.process_time)  # every worker has answered before the clock starts
        begin = time.perf_counter()
        run_jobs(function, listed, Path(folder), client)
        wall = time.perf_counter() - begin
        rows = rows_of(listed, Path(folder))
    failed = [row["error"] for row in rows if row["error"]]
    if failed or len(rows) < jobs:
        sys.exit(f"{len(rows)} of {jobs} jobs ended, {failed[:1]}")
    return Run(wall, sum(row["cpu_seconds"] for row in rows) / (wall * workers))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--jobs", type=int, default=24)
    parser.add_argument("--seconds", type=float, default=2.0, help="a job takes")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--waiting", action="store_true", help="jobs that wait instead of computing")
    given = parser.parse_args()
    function = some_jobs.wait if given.waiting else some_jobs.compute
    print(f"load before it: {os.getloadavg()[0]:.2f} on {os.cpu_count()} processors")
    for _ in range(given.rounds):
        one, two = (run(workers, given.jobs, given.seconds, function) for workers in (1, 2))
        print(
            f"1 worker: {one.wall:.1f} s, processor {100 * one.share:.0f} %; "
            f"2 workers: {two.wall:.1f} s, processor {100 * two.share:.0f} %; {one.wall / two.wall:.2f} times as fast"
        )


if __name__ == "__main__":
    main()
