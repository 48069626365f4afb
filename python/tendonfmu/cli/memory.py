"""What a limit of memory (`ulimit -v`) asks of libraries that end the process where they get none."""

from __future__ import annotations

import mmap
import os
import sys

NEEDED = 400 << 20  # bytes; the libraries of a command and their buffers: with less they crash, or print their own text


def prepare_for_limit() -> None:
    """Take under a limit what OpenBLAS, which gives no error, takes later. Raises OSError or MemoryError."""
    if sys.platform == "win32":
        return
    import resource  # Unix only

    if resource.getrlimit(resource.RLIMIT_AS)[0] == resource.RLIM_INFINITY:
        return
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    os.environ.setdefault("ARROW_DEFAULT_MEMORY_POOL", "system")
    mmap.mmap(-1, NEEDED).close()
    import numpy as np
    from scipy.linalg import blas

    square = np.ones((64, 64))
    blas.dgemm(1.0, square, square @ square)
