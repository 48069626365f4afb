"""Estimates the numbers of a finger from recordings (`tendonfmu fit`), and says how well each is known.

`structure` chooses the numbers, `methods` runs the compiled estimator (`estimation`), and `fitting` combines both
behind an interface like that of scikit-learn. `verdicts` and `identifiability` judge the result.
"""

from typing import TYPE_CHECKING

from tendonfmu.lazy_exports import lazy_exports

if TYPE_CHECKING:
    from . import identifiability, verdicts
    from .core_runs import CoreRuns, SlowDrift, slowest_drift
    from .estimation import ESTIMATION_MISSING, HAS_ESTIMATION, EstimationError, Estimator, Unknown
    from .files import (
        FIT_REPORT,
        check_given_once,
        check_outputs,
        check_unseen,
        known_numbers,
        read_previous_fit,
        with_previous_values,
    )
    from .fisher_information import Noise, Progress, friction_probe, information, noise_of, sensitivities
    from .fit_report import (
        Comparison,
        FitPicture,
        FitReport,
        FitSeries,
        FittedNumber,
        LawBands,
        LawCurve,
        ResidualRms,
        asymmetric,
        evaluate,
        numbers_of,
        unseen_square,
    )
    from .fitting import FitWarning, FrictionFit
    from .identifiability import EffectCoverage, Judgement, Verdict, counts_by_kind, coverage_of, durations, judge
    from .learning import (
        FitProgress,
        FrictionFitOptions,
        Interrupted,
        Learned,
        Settings,
        Watch,
        settings_of,
        unknown_names,
    )
    from .memory import CHOSEN, has_memory, without_memory
    from .memory_choice import choose_memory, encoder_advice
    from .memory_fit import MemoryProblem, minimise
    from .memory_methods import guess_prior
    from .methods import learn_batch
    from .structure import (
        SCALING,
        Choice,
        Structure,
        build_structure,
        held_delay,
        torque_scales,
        with_values,
    )
    from .verdicts import Fitted, with_known_numbers, with_learned_numbers

__getattr__, __dir__, __all__ = lazy_exports(__name__, __file__)
