"""Tunes contact detection on free motion, and scores it on labelled recordings (`tendonfmu tune`, `score`).

`free_motion` prepares free motion, `learning` runs a finger over it and chooses the bounds from that, and `tuning` does
both for a stated rate of false alarms. `scoring` and `counting` compare decisions with labels, and
`summary` says what that means.
"""

from typing import TYPE_CHECKING

from tendonfmu.lazy_exports import lazy_exports

if TYPE_CHECKING:
    from . import tune_report
    from .counting import GRACE, DetectionScore, Event, pooled, sample_seconds, score_detection, stretches
    from .free_motion import SETTLING, free_parts, require_no_contact
    from .noise import pretension_of
    from .scoring import Scored, Track, build_report, run_track, score_recordings
    from .summary import Estimate, Figures, Point
    from .tune_report import TuneReport
    from .tuning import ContactTuning, NotEnough, TuneWarning

__getattr__, __dir__, __all__ = lazy_exports(__name__, __file__)
