"""The Python binding of the estimation (runtime/include/tendonfmu_estimation.hpp, `_estimation`).

If Eigen was not found when the package was built, there is no estimation: `Estimator` and `Learner` then raise
`InputError(ESTIMATION_MISSING)`, and everything else works.
"""

from __future__ import annotations

from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

from tendonfmu.errors import InputError

__all__ = ["BatchResult", "EstimationError", "Estimator", "Learner", "Unknown"]

# find_spec, not try/except: a module that exists but does not load must raise its error
HAS_ESTIMATION = find_spec("tendonfmu._estimation") is not None
ESTIMATION_MISSING = "this installation cannot estimate parameters (Eigen was not found when it was built)"

if TYPE_CHECKING or HAS_ESTIMATION:
    from tendonfmu._estimation import BatchResult, EstimationError, Estimator, Learner, Unknown
else:
    EstimationError = InputError

    class Estimator:
        """What this installation lacks."""

        def __init__(self, *_: Any, **_others: Any) -> None:
            raise InputError(ESTIMATION_MISSING)

    BatchResult = Learner = Unknown = Estimator
