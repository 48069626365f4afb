"""Jobs here and on dask workers: each has one row, whatever fails or dies on the way."""

from __future__ import annotations

import signal
import time
from pathlib import Path
from threading import Thread

import pytest

import some_jobs
from dask_on_loopback import dask_processes
from tendonfmu.errors import InputError, InternalError
from tendonfmu.tasks import jobs as engine
from tendonfmu.tasks.jobs import Job, fault_words, refuse_if_all_failed, rows_of, run_jobs, workers_of


def noting(count: int, seconds: float, log: Path) -> list[Job]:
    return [Job(f"job_{k}", (k, seconds, str(log))) for k in range(count)]


def begun(log: Path) -> list[int]:
    return [int(line.split()[0]) for line in log.read_text(encoding="utf-8").splitlines()] if log.is_file() else []


def test_jobs_are_resumed_and_a_failure_is_a_row(tmp_path: Path) -> None:
    some = [Job(str(k), (k,)) for k in range(4)]
    assert run_jobs(some_jobs.fail, some[:3], tmp_path) == 3
    assert run_jobs(some_jobs.fail, some, tmp_path) == 2  # the third again, and the fourth
    rows = rows_of(some, tmp_path)
    assert [row["name"] for row in rows] == ["0", "1", "2", "3"]
    assert [row["error"] for row in rows] == ["", "", "ValueError: two is refused", ""]
    assert rows[0]["bad"] is None and rows[0]["run_seconds"] >= 0.0
    no_rows = [Job("a", ({"list": [float("nan")]},)), Job("b", ({"object": Path()},))]  # what JSON cannot hold
    assert run_jobs(dict, no_rows, tmp_path / "dict") == 2
    errors = [row["error"].partition(":")[0] for row in rows_of(no_rows, tmp_path / "dict")]
    assert errors == ["ValueError", "TypeError"]


@pytest.mark.parametrize("names", [("a", "a"), ("",), ("../a",), ("a/b",), (".a",), ("a\\b",)])
def test_names_of_jobs_are_those_of_different_files(tmp_path: Path, names: tuple[str, ...]) -> None:
    with pytest.raises(InputError, match="expected"):
        run_jobs(some_jobs.fail, [Job(name, (1,)) for name in names], tmp_path)
    assert not any(tmp_path.iterdir())


def refuse_or_break(broken: bool) -> dict[str, int]:
    raise KeyError("arms") if broken else InputError("a.csv: no column\ntime")


def test_a_row_says_whose_fault_it_is(tmp_path: Path) -> None:
    some = [Job("refused", (False,)), Job("broken", (True,))]
    run_jobs(refuse_or_break, some, tmp_path)
    refused, broken = rows_of(some, tmp_path)
    assert (refused["error"], refused["fault"]) == ("a.csv: no column time", "")
    assert "Traceback" in broken["fault"] and "platform:" in broken["fault"]
    words = fault_words(broken, Path("rows/broken.json"))
    assert (
        words
        == "internal error (KeyError), a fault of tendonfmu, not of its input; please send the report rows/broken.json"
    )
    with pytest.raises(InputError, match=r"^none could be done; a\.csv: no column time$"):
        refuse_if_all_failed([broken, refused], "none could be done")
    with pytest.raises(InternalError, match="Traceback"):
        refuse_if_all_failed([broken], "none could be done")
    refuse_if_all_failed([broken, {"error": ""}], "none could be done")


def test_a_scheduler_that_is_not_there_is_refused_by_its_address(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(engine, "SECONDS_TO_CONNECT", 1.0)
    with (
        pytest.raises(InputError, match=r"--scheduler tcp://127.0.0.1:1: .*expected the address"),
        workers_of("tcp://127.0.0.1:1"),
    ):
        pass


def test_a_worker_killed_on_the_way_costs_no_row_and_adds_none(tmp_path: Path) -> None:
    """A scheduler and two workers, processes of their own on the loopback. One is killed with a job in its hands: that
    job begins twice and has one row, all others begin once."""
    log, output, count = tmp_path / "log", tmp_path / "out", 16
    jobs = noting(count, 0.4, log)
    reported: list[tuple[int, int]] = []
    with dask_processes(2) as processes, workers_of(processes.address) as client:
        client.wait_for_workers(2, timeout=30)
        victim = processes.workers[0]

        def kill_amid_a_job() -> None:
            while sum(line.endswith(f" {victim.pid}") for line in log_lines(log)) < 3:
                time.sleep(0.01)
            victim.send_signal(signal.SIGKILL)

        killer = Thread(target=kill_amid_a_job)
        killer.start()
        ran = run_jobs(some_jobs.note, jobs, output, client, progress=lambda *state: reported.append(state))
        killer.join()
        assert victim.wait(10) == -signal.SIGKILL
    rows = rows_of(jobs, output)
    assert ran == count
    assert [row["number"] for row in rows] == list(range(count)) and not any(row["error"] for row in rows)
    assert reported == [(k, count) for k in range(count + 1)]
    assert sorted(path.stem for path in (output / "rows").iterdir()) == sorted(job.name for job in jobs)
    starts = begun(log)
    assert set(starts) == set(range(count)) and len(starts) == count + 1
    assert {row["process"] for row in rows} == {each.pid for each in processes.workers}


def log_lines(log: Path) -> list[str]:
    return log.read_text(encoding="utf-8").splitlines() if log.is_file() else []


@pytest.mark.long
def test_a_job_that_kills_every_worker_is_an_error_of_its_own(tmp_path: Path) -> None:
    """Nannies start the workers again; after the fourth death the job is given up, and the others have their rows."""
    some = [Job(str(k), (k,)) for k in range(3)]
    with workers_of(count=1) as client:
        assert run_jobs(some_jobs.end_its_worker, some, tmp_path, client) == 3
    rows = {row["name"]: row["error"] for row in rows_of(some, tmp_path)}
    assert rows["1"].startswith("KilledWorker") and rows["0"] == "" and rows["2"] == ""


@pytest.mark.long
def test_a_scheduler_that_dies_is_an_error_and_the_rest_is_resumed(tmp_path: Path) -> None:
    jobs = noting(8, 0.2, tmp_path / "log")
    output = tmp_path / "out"
    with dask_processes(1) as processes, workers_of(processes.address) as client:

        def kill_after_two(done: int, total: int) -> None:
            if done == 2:
                processes.scheduler.kill()

        with pytest.raises(InputError, match="the dask scheduler was lost"):
            run_jobs(some_jobs.note, jobs, output, client, progress=kill_after_two)
    assert 1 <= run_jobs(some_jobs.note, jobs, output) <= 6
    assert [row["number"] for row in rows_of(jobs, output)] == list(range(8))
