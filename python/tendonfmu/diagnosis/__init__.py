"""Find what a model gets wrong, which cause it has, and what correcting it gains (`tendonfmu diagnose`).

- `inputs` reads and checks recordings; `kinematic_causes` and `force_gains` find what positions show.
- `base` settles `delay`, position-dependent torque and memory.
- `samples` is what runs of the core are compared with, and its signals; `view` turns both into columns.
- A mechanism (`effects`) at a place is a candidate (`candidate_columns`), with gain and certainty it is judged
  (`selection`), with its numbers a cause (`result`).
- `search` adds what a description lacks, one cause after the other; `change_search` finds what has changed since a
  reference. `extension_diagnosis` and `change_diagnosis` confirm and report; `diagnosis` begins.
- `extension_fit` fits the extended finger; `gain` measures on unseen data; `next_experiment` finds what to record.
"""

from typing import TYPE_CHECKING

from tendonfmu.lazy_exports import lazy_exports

if TYPE_CHECKING:
    from .contact_scan import events_of, without_events
    from .diagnosis import diagnose
    from .effects.mechanism import Where
    from .effects.table import CONTACT, UNKNOWN, ZERO, title_of
    from .effects.words import NBSP, quantity
    from .extension_fit import FitSettings, with_known
    from .history import History, Line, diagnose_history, share_of
    from .motion import discriminating_motion
    from .names import Names, at_place, names_in, numbered, reported_causes, size_at
    from .result import (
        Cause,
        CausePlace,
        ChangedSize,
        DetectionGain,
        Diagnosis,
        Event,
        Evidence,
        Experiment,
        Invisible,
        ResidualView,
        Sensor,
    )
    from .samples import Samples

__getattr__, __dir__, __all__ = lazy_exports(__name__, __file__)
