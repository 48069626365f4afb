"""Tunes contact detection on free motion, and scores it on labelled recordings (`tendonfmu tune`, `score`).

`free_motion` runs a finger over free motion, and `tuning` chooses the bounds for a stated rate of false alarms. `run`
and `counting` compare decisions with labels; `summary` and `score_report` report the result.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
