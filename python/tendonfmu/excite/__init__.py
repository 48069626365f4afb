"""Training motions, and what they tell about each number (`tendonfmu excite`).

`excitation` plans strokes of all joints, `tension_plan` the internal tensions, `training_motion` puts them together
and judges the result.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
