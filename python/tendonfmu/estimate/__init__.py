"""Estimates the numbers of a finger from recordings (`tendonfmu fit`), and says how well each is known.

`structure` chooses the numbers, `methods` runs the compiled estimator (`estimation`), and `fitting` combines both
behind an interface like that of scikit-learn. `verdicts`, `identifiability` and `uncertainty` judge the result.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
