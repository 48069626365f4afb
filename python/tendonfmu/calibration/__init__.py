"""Makes a tuned finger from free motion (`tendonfmu calibrate`).

`calibration` runs check, diagnosis, fit, tuning and score in steps that can be resumed. `report` and `text` present
and write the results.
"""

from typing import TYPE_CHECKING

from tendonfmu.lazy_exports import lazy_exports

if TYPE_CHECKING:
    from . import text
    from .calibration import DIAGNOSIS, Calibration, calibrate
    from .text import FINGER, PAGE, REPORT, calibration_page, check_folder, write_calibration

__getattr__, __dir__, __all__ = lazy_exports(__name__, __file__)
