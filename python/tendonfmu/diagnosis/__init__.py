"""Find what a model gets wrong, which cause it has, and what correcting it gains (`tendonfmu diagnose`).

- `series` averages recordings over blocks of time.
- `search` adds one cause after the other, from the candidates in `effects`.
- `extension_fit` fits the extended finger; `gain` measures on unseen data; `diagnosis` runs all of these steps.
- `experiments` finds what to record next.
- `changes` compares with reference recordings.
- `campaign` runs many cases.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
