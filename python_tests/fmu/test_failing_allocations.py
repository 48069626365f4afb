"""An FMU in a host whose memory is used up at any of its allocations: it says so, and leaves nothing behind."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

from fmi2_headers import FMPY_HEADERS
from fmu_binary import UnpackedFmu
from leak_count import needs_count

PROGRAM = Path(__file__).with_name("failing_allocations.c")


@needs_count
@pytest.mark.skipif(shutil.which("cc") is None, reason="SKIPPED: needs a C compiler")
def test_each_allocation_that_fails_is_said_or_not_needed(small_fmu: UnpackedFmu, tmp_path: Path) -> None:
    program = tmp_path / "failing_allocations"
    flags = "-O1", "-fno-builtin", "-Wall", "-Wextra", "-Werror", "-rdynamic", "-isystem", FMPY_HEADERS
    subprocess.run(["cc", *flags, PROGRAM, "-o", program, "-ldl"], check=True)
    arguments = small_fmu.binary, small_fmu.guid, small_fmu.location.decode()
    done = subprocess.run([program, *arguments], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    allocations, refusals, messages, leaks = map(int, done.stdout.split())
    assert allocations >= refusals >= 5 and messages == refusals and leaks == 0, done.stdout
