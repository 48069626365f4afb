"""How certain results are: statistics without any knowledge of fingers.

Series are averaged over blocks, parts are held out, and splines remove a slow bias (`blocks`). Columns are judged by
their Gram matrices (`block_grams`), noise is whitened and correlated samples are counted (`whitening`), and counts and
measurements get an interval (`intervals`).
"""

from typing import TYPE_CHECKING

from tendonfmu.lazy_exports import lazy_exports

if TYPE_CHECKING:
    from . import intervals
    from .block_grams import MEMORY, Grams, Products, bounded, standard_error
    from .blocks import (
        FEWEST_STRETCHES,
        KNOTS,
        STRETCH,
        BlockSeries,
        Folds,
        Span,
        Splines,
        basis,
        make_folds,
        residual_of,
        spline_basis,
        without,
    )
    from .intervals import (
        BlockIndex,
        Estimate,
        Interval,
        blocks_of,
        gain_interval,
        noisy_regression,
        variance_between,
    )
    from .whitening import Line, Whitener, effective_samples, find_lines, sample_weights, whitener

__getattr__, __dir__, __all__ = lazy_exports(__name__, __file__)
