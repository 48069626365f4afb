"""How long computations show progress, end, resume and run in parallel.

`phases` shows how far a computation is, `interruption` ends it at Ctrl-C and SIGTERM, `steps` keeps the results of each
step in a folder, and `jobs` calls a function for many inputs, here or on the workers of a cluster.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
