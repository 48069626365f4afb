"""Learns the numbers of a finger from recordings (`tendonfmu fit`).

`structure` chooses the numbers, `methods` runs the compiled estimator (`estimation`), `fitting` puts both together in
the manner of scikit-learn; `verdicts`, `identifiability` and `uncertainty` say how well each number is known.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
