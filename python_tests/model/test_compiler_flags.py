"""Flags that let a compiler reorder sums: refused by name, or without effect on a bit of the exponential."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

from repetitions import repeated
from repository_paths import ROOT

CORE = ROOT / "runtime" / "core"
PRINT_EXPONENTIALS = """
#include "floating_point.h"
#include <stdio.h>
#include <stdlib.h>
#include "kernel/exponential.h"
int main(int count, char** arguments) {
  if (!rounds_as_written()) {
    return 3; /* a finger is not created */
  }
  const double scale = strtod(arguments[count - 1], NULL);
  for (int k = 0; k < 2000; ++k) {
    const quad x = quad_set(scale * k);
    const quad e = exp_of_minus(x), share = 1.0 - e;
    printf("%a %a\\n", e, share);
  }
  return 0;
}
"""
REORDERS = "-fassociative-math -fno-signed-zeros -fno-trapping-math"
FLAGS = ["-ffast-math", "-Ofast", "-ffinite-math-only", "-freciprocal-math", REORDERS, "-ffp-contract=fast"]
SEEN_BY_ALL = FLAGS[:3]  # clang has macros for no more


def compilers() -> list[str]:
    return [name for name in ("gcc", "clang") if shutil.which(name)]


def exponentials(compiler: str, flags: str, folder: Path) -> str | None:
    """Return what the program prints; None where sources or program refuse the flags by name."""
    (folder / "print.c").write_text(PRINT_EXPONENTIALS)
    given = ["-std=c11", "-O2", "-march=native", *flags.split(), f"-I{CORE}"]
    command = [compiler, *given, "-o", "print", "print.c", "-lm"]
    made = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if made.returncode:
        assert "TendonFMU cannot be compiled with -ffast-math or a part of it" in made.stderr, made.stderr
        return None
    answer = subprocess.run([folder / "print", "0.0173"], capture_output=True, text=True, check=False)
    assert answer.returncode in (0, 3)
    return answer.stdout if answer.returncode == 0 else None


@pytest.mark.parametrize("compiler", compilers())
@pytest.mark.parametrize("flags", repeated(FLAGS, 0, 4, 5))
def test_no_flag_gives_other_exponentials(compiler: str, flags: str, tmp_path: Path) -> None:
    plain, other = exponentials(compiler, "", tmp_path), exponentials(compiler, flags, tmp_path)
    assert plain is not None and plain.count("\n") == 2000
    assert other in (None, plain)
    assert other is None or flags not in SEEN_BY_ALL


@pytest.mark.parametrize("compiler", compilers())
@pytest.mark.parametrize("flags", ["", *SEEN_BY_ALL])
def test_the_simulated_finger_refuses_such_flags_too(compiler: str, flags: str) -> None:
    header = ROOT / "runtime" / "plant" / "elementary.h"
    command = [compiler, "-x", "c++", "-std=c++17", "-O2", "-fsyntax-only", *flags.split(), str(header)]
    made = subprocess.run(command, capture_output=True, text=True, check=False)
    assert ("cannot be compiled with -ffast-math" in made.stderr) == bool(flags), made.stderr
    assert (made.returncode != 0) == bool(flags), made.stderr
