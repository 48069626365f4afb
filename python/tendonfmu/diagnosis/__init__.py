"""Find what a model gets wrong, which cause it has, and what correcting it gains (`tendonfmu diagnose`).

- `series` averages recordings over blocks of time.
- `search` adds one cause after the other, from the candidates in `effects`.
- `extension_fit` fits the extended finger; `gain` measures on unseen data; `diagnosis` runs all of these steps.
- `experiments` finds what to record next.
- `changes` compares with reference recordings.
"""

from typing import TYPE_CHECKING

from tendonfmu.lazy_exports import lazy_exports

if TYPE_CHECKING:
    from .cause_search import predicted_of, series_of
    from .changes.history import History, Line, diagnose_history, share_of
    from .diagnosis import diagnose
    from .effects import CANDIDATES
    from .effects.friction_law_places import thresholds
    from .experiments.discrimination import discriminating_motion
    from .extension_fit import FitSettings, learn_numbers
    from .gain import residual_of, squared_residual
    from .reported import CONTACT, TITLES, UNKNOWN, reported_causes
    from .result import (
        Cause,
        ChangedSize,
        DetectionGain,
        Diagnosis,
        Event,
        Evidence,
        Experiment,
        FoundPlace,
        Invisible,
        ResidualView,
        Where,
    )
    from .search import events_of, without_blocks
    from .series import make_grid
    from .signal_choice import estimation_recordings
    from .size import NBSP, quantity, size_at
    from .sliding import settled, without_stuck

__getattr__, __dir__, __all__ = lazy_exports(__name__, __file__)
