"""The public Python interface: one function per command, and its result (docs/reference/python.md).

A command of `cli` parses, calls a function of this package, writes and prints.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
