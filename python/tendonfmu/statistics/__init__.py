"""Statistics that know no finger.

Series are averaged over blocks (`block_averages`, `blocks`), a slow bias is taken out by splines (`splines`), parts
are held out (`folds`), columns are judged by their Gram matrices (`block_grams`), noise is made white (`whitening`),
and what is counted or measured gets an interval (`intervals`, `paired_gain`, `effective_number`).
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
