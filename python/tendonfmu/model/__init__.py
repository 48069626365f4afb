"""What a finger is: its description and the compiled model.

`description` reads a finger description. `native` is the binding of the C runtime; every call of the model goes through
it. Other modules hold the places of friction (`friction_places`), extensions, quasi-static balance, the geometry of the
routing, and checks for implausible but valid descriptions (`plausibility`).
"""

from typing import TYPE_CHECKING

from tendonfmu.lazy_exports import lazy_exports

if TYPE_CHECKING:
    from . import native
    from .balance import balanced_forces, friction_probe, moment_arms, pretension_vector
    from .description import (
        Finger,
        FingerSource,
        Law,
        count,
        finger_file,
        finger_from_data,
        finger_from_text,
        read_finger,
        sides,
    )
    from .description_defaults import DEFAULTS, EFFECT_NUMBERS, LIMITS, RANGES
    from .description_numbers import number_of
    from .description_path import law_path, steps_of
    from .description_text import description_text
    from .extensions import LEFT_OUT, MAGNITUDES, extended_row, extension_numbers, extension_rows, place_of
    from .findings import Finding
    from .friction_places import Effect, effects, sliding_velocity, velocity_threshold, working_point_weights
    from .native import Instance, NativeError
    from .output_dependencies import Dependencies, dependencies, structure_of
    from .output_names import FLAGS, INPUTS, NUMBERS, OPTIONAL_NUMBERS, PLACE, REST, SENSORS
    from .plausibility import description_findings, is_direct_drive
    from .routing_geometry import DrawnTendon, FingerDrawing, Points, finger_drawing
    from .signals import INPUTS_OF_SOURCE, inputs_used, watches_motors

__getattr__, __dir__, __all__ = lazy_exports(__name__, __file__)
