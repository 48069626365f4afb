"""How FMUs are packaged without a compiler, described, and run.

`packaging` makes the archive from `model_variables` and `documentation`. `fmpy_client` runs an FMU sample by sample.
`running` runs a description or an FMU over a recording.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
