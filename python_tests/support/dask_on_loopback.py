"""A dask scheduler and its workers, processes of their own that talk by TCP on the loopback, as on a cluster."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")


@dataclass
class Processes:
    """address: of the scheduler, tcp://HOST:PORT. workers: with one thread each, and no nanny to start them again."""

    address: str
    scheduler: subprocess.Popen[bytes]
    workers: list[subprocess.Popen[bytes]] = field(default_factory=list)

    def add_worker(self) -> None:
        options = ["--nthreads", "1", "--no-nanny", "--no-dashboard", "--host", "127.0.0.1"]
        self.workers.append(_started("worker", self.address, *options))


@contextmanager
def dask_processes(workers: int) -> Iterator[Processes]:
    """All of them end with the block."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    scheduler = _started("scheduler", "--host", "127.0.0.1", "--port", str(port), "--no-dashboard")
    processes = Processes(f"tcp://127.0.0.1:{port}", scheduler)
    try:
        for _ in range(workers):
            processes.add_worker()
        yield processes
    finally:
        for each in (*processes.workers, scheduler):
            each.kill()
            each.wait()


def _started(program: str, *options: str) -> subprocess.Popen[bytes]:
    environment = os.environ | ONE_THREAD | {"PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
    command = [sys.executable, "-m", f"distributed.cli.dask_{program}", *options]
    return subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
