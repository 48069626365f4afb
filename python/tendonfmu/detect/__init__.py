"""Contact: tuned on free motion, scored on labelled recordings (`tendonfmu tune`, `score`).

`free_motion` runs a finger over free motion, `tuning` chooses the bounds for a stated rate of false alarms, `run` and
`counting` hold decisions against labels, `summary` and `score_report` say what was found.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
