"""How certain results are: statistics without any knowledge of fingers.

Series are averaged over blocks (`block_averages`, `blocks`), splines remove a slow bias (`splines`), and parts are held
out (`folds`). Columns are judged by their Gram matrices (`column_products`, `block_grams`), noise is whitened
(`whitening`), and counts and measurements get an interval (`intervals`, `paired_gain`, `effective_number`).
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
