"""Which training motion shows the friction of a finger, and how well it identifies each number (`tendonfmu excite`).

`excitation` plans strokes of all joints and the internal tensions, and `training_motion` judges the result.
"""

from typing import TYPE_CHECKING

from tendonfmu.lazy_exports import lazy_exports

if TYPE_CHECKING:
    from . import training_motion
    from .excitation import (
        Excitation,
        Plan,
        Variation,
        balanced_forces,
        evaluate_quintic,
        plan_excitation,
        pretension_vector,
    )
    from .training_motion import ExciteResult, read_subject

__getattr__, __dir__, __all__ = lazy_exports(__name__, __file__)
