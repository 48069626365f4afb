"""Models of MuJoCo (MJCF): a finger description made from one, and fitted numbers written back into one.

Only `compiled_model` calls MuJoCo, and reads and changes the XML. `finger_parts` reads tendons, moment arms, links and
their weight, and `finger_import` makes a description of them and lists what it cannot hold. The way back:
`number_export` decides what MJCF can express.
"""

from typing import TYPE_CHECKING

from tendonfmu.lazy_exports import lazy_exports

if TYPE_CHECKING:
    from .finger_import import import_finger
    from .number_export import export_numbers

__getattr__, __dir__, __all__ = lazy_exports(__name__, __file__)
