"""Tunes contact detection on free motion, and scores it on labelled recordings (`tendonfmu tune`, `score`).

`free_motion` runs a finger over free motion, and `tuning` chooses the bounds for a stated rate of false alarms.
`scoring` and `counting` compare decisions with labels; `summary` and `score_report` report the result.
"""

from typing import TYPE_CHECKING

from tendonfmu.lazy_exports import lazy_exports

if TYPE_CHECKING:
    from . import contact_at_rest, score_report, tune_report
    from .alarm_level import NotEnough, least_hours, pretension_of, rate_limit
    from .bounds import tail_levels
    from .contact_bound import residual_and_bound
    from .counting import GRACE, DetectionScore, Event, pooled, sample_seconds, score_detection, stretches
    from .free_motion import SETTLING, FreeRun, free_parts
    from .reference_sensor import require_no_contact
    from .scoring import Scored, Subject, Track, run_track, score_recordings
    from .summary import RocPoint, Summary
    from .tuning import ContactTuning, TuneWarning

__getattr__, __dir__, __all__ = lazy_exports(__name__, __file__)
