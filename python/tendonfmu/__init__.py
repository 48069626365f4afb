"""Friction of tendon-driven robot fingers: check, build, run, fit, diagnose, tune and score.

>>> import tendonfmu as tf
>>> tf.run("finger.json", "recording.parquet").frame

The command line is `tendonfmu --help`, the reference docs/reference/python.md.
"""

from typing import Any

import lazy_loader

_lazy, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
__all__ += ["__version__"]


def __getattr__(name: str) -> Any:
    if name == "__version__":  # looking it up takes longer than all the rest
        from importlib.metadata import version

        return version("tendonfmu")
    return _lazy(name)
