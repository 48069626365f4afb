"""How long computations show progress, end, resume and run in parallel.

`phases` shows how far a computation is, ends it at Ctrl-C and SIGTERM, and keeps the results of its steps in a folder,
and `jobs` calls a function for many inputs, here or on the workers of a cluster.
"""

from typing import TYPE_CHECKING

from tendonfmu.lazy_exports import lazy_exports

if TYPE_CHECKING:
    from .jobs import (
        Job,
        Row,
        fault_words,
        refuse_if_all_failed,
        row_file,
        rows_of,
        run_jobs,
        version_here,
        workers_of,
    )
    from .phases import (
        FOLDER,
        Phases,
        PhaseState,
        Step,
        Steps,
        digest_of,
        digest_of_arrays,
        ended_by_signals,
        forget_steps,
        uninterrupted,
    )

__getattr__, __dir__, __all__ = lazy_exports(__name__, __file__)
