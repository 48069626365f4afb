"""Bytes and handles that an FMU and its instances leave behind, counted in a process that does nothing else.

In pytest's own process other threads (execnet's, of pytest-xdist) and Python's allocations count too. Here one thread
runs, garbage is collected only between rounds, and the least growth of several rounds decides: a block lost by every
instance grows in each round, what the host itself happens to keep does not.
"""

from __future__ import annotations

import ctypes
import gc
import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from fmu_binary import ERROR, OK, Instance, UnpackedFmu

ROUNDS = 3
C_LIBRARY = ctypes.CDLL("libc.so.6") if sys.platform == "linux" else None

needs_count = pytest.mark.skipif(
    not hasattr(C_LIBRARY, "mallinfo2"), reason="SKIPPED: mallinfo2 (glibc 2.33) and /proc are those of Linux"
)


class Usage(ctypes.Structure):
    """glibc's struct mallinfo2."""

    _fields_ = [
        *((name, ctypes.c_size_t) for name in ("arena", "ordblks", "smblks", "hblks", "hblkhd")),
        *((name, ctypes.c_size_t) for name in ("usmblks", "fsmblks", "uordblks", "fordblks", "keepcost")),
    ]


def bytes_in_use() -> int:
    """In the heap and in blocks of their own (mmap), by the allocator's own count."""
    assert C_LIBRARY
    C_LIBRARY.mallinfo2.restype = Usage
    usage = C_LIBRARY.mallinfo2()
    return int(usage.uordblks + usage.hblkhd)


def handles() -> int:
    return len(os.listdir("/proc/self/fd"))


# --- what is done with an instance ------------------------------------------------------------------------------------


def whole(fmu: UnpackedFmu) -> Callable[[int], None]:
    """Stepped, saved, in error; every tenth is refused."""

    def cycle(k: int) -> None:
        with Instance(fmu, identifier=fmu.identifier if k % 10 else b"wrong") as instance:
            if instance.component:
                instance.initialise()
                assert instance.step(0.0) == OK
                instance.save()
                if k % 3 == 0:
                    assert instance.step(-1.0) == ERROR

    return cycle


def unloaded(fmu: UnpackedFmu) -> Callable[[int], None]:
    """The library loaded from a copy, one instance made and freed, the library unloaded."""
    import _ctypes

    folder = tempfile.TemporaryDirectory()  # until the process ends
    copy = str(shutil.copy(fmu.binary, Path(folder.name) / "unloaded.so"))
    arguments = (b"finger", 1, fmu.identifier, fmu.resources, None, 0, 0)

    def cycle(_: int) -> None:
        assert folder
        library = ctypes.CDLL(copy)
        library.fmi2Instantiate.restype = ctypes.c_void_p
        library.fmi2FreeInstance(ctypes.c_void_p(library.fmi2Instantiate(*arguments)))
        _ctypes.dlclose(library._handle)

    return cycle


CYCLES = {function.__name__: function for function in (whole, unloaded)}


def growths(cycle: Callable[[int], None], count: int) -> Iterator[tuple[int, int]]:
    """Bytes and handles that each round of `count` cycles leaves, after a first one that is not counted."""
    before = (0, 0)
    for turn in range(1 + ROUNDS):
        for k in range(count if turn else count // 5):
            cycle(k)
            if k % 100 == 99:
                gc.collect()
        gc.collect()
        now = bytes_in_use(), handles()
        if turn:
            yield now[0] - before[0], now[1] - before[1]
        before = now


def least_growth(fmu: UnpackedFmu, cycle: str, count: int) -> tuple[int, int]:
    """The least bytes and handles of the rounds, in a process of its own. cycle: one of CYCLES."""
    command = [sys.executable, __file__, str(fmu.folder), cycle, str(count)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    rounds: Any = json.loads(done.stdout)
    assert len(rounds) == ROUNDS
    return min(used for used, _ in rounds), min(opened for _, opened in rounds)


def main() -> None:
    folder, cycle, count = sys.argv[1:]
    gc.disable()
    print(json.dumps(list(growths(CYCLES[cycle](UnpackedFmu(Path(folder))), int(count)))))


if __name__ == "__main__":
    main()
