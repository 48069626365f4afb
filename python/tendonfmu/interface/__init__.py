"""The public Python interface: one function per command, and its result (docs/reference/python.md).

A command of `cli` parses, calls a function of this package, writes and prints.
"""

from typing import TYPE_CHECKING

from tendonfmu.lazy_exports import lazy_exports

if TYPE_CHECKING:
    from .building import build
    from .calibrating import CalibrateResult, CalibrationWarning, calibrate
    from .checking import CheckResult, check, convert
    from .detecting import ScoreResult, ScoreWarning, TuneResult, score, tune
    from .diagnosing import Diagnosis, DiagnosisWarning, diagnose
    from .fitting import FitInterrupted, FitResult, fit
    from .live import Runner, Sample
    from .running import RunResult, run

__getattr__, __dir__, __all__ = lazy_exports(__name__, __file__)
