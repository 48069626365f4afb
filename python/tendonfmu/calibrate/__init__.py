"""From free motion to a tuned finger (`tendonfmu calibrate`).

`calibration` runs check, diagnosis, fit, tuning and score in resumable steps; `report`, `text` and `files` say and
write what came of them.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
