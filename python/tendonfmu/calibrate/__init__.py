"""Makes a tuned finger from free motion (`tendonfmu calibrate`).

`calibration` runs check, diagnosis, fit, tuning and score in steps that can be resumed. `report`, `text` and `files`
present and write the results.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
