"""How long computations show progress, end, resume and run in parallel.

`phases` shows how far a computation is and ends it at Ctrl-C and SIGTERM, `steps` keeps the results of each step in a
folder, and `jobs` calls a function for many inputs, here or on the workers of a cluster.
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
    from .phases import Phases, PhaseState, Step, ended_by_signals, uninterrupted
    from .steps import FOLDER, Steps, digest_of, digest_of_arrays, forget_steps

__getattr__, __dir__, __all__ = lazy_exports(__name__, __file__)
