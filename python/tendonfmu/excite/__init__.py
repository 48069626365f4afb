"""Which training motion shows the friction of a finger, and what it tells about each number (`tendonfmu excite`).

`excitation` plans strokes of all joints, `tension_plan` plans the internal tensions, and `training_motion` combines
them and judges the result.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
