"""How a hand is checked, calibrated, run, scored and diagnosed: each of its fingers, with the wrist that they share.

`description` reads a hand, `recordings` splits its recording into those of its fingers, `running` runs them, `outcome`
does the rest, `page` shows the results, `ssp` packs the FMUs, and `commands` has the command lines.
"""

from typing import TYPE_CHECKING

from tendonfmu.lazy_exports import lazy_exports

if TYPE_CHECKING:
    from .description import Hand, read_hand
    from .outcome import HandOutcome, calibrate_hand, diagnose_hand, score_hand
    from .page import SCORE_HEADINGS, PartRow, score_rows, shared_warnings
    from .recordings import split_parts, split_recording
    from .running import HandRun, run_hand

__getattr__, __dir__, __all__ = lazy_exports(__name__, __file__)
