"""What a model gets wrong, which cause it has, and what mending it gains (`tendonfmu diagnose`).

`series` averages recordings over blocks, `search` adds one cause after the other from the candidates in `effects`,
`extension_fit` fits the extended finger, `gain` measures on unseen data, `diagnosis` does all of that. `experiments`
finds what to record next, `changes` compares with a reference, `campaign` runs many cases.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
