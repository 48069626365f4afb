"""What a finger is: its description and the compiled model.

`description` reads a finger description. `native` is the binding of the C runtime; every call of the model goes through
it. Other modules hold the places of friction (`friction_places`), extensions, the
geometry of the routing, and checks for implausible but valid descriptions (`plausibility`).
"""

from typing import TYPE_CHECKING

from tendonfmu.lazy_exports import lazy_exports

if TYPE_CHECKING:
    from . import native
    from .description import (
        Finger,
        FingerSource,
        count,
        description_text,
        finger_file,
        finger_from_data,
        finger_from_text,
        finger_of,
        laws,
        read_finger,
        sides,
        starting_finger,
    )
    from .description_numbers import (
        DEFAULTS,
        EFFECT_NUMBERS,
        LAW_NUMBERS,
        LEFT_OUT,
        LIMITS,
        RANGES,
        Law,
        bias_is_constant,
        extended_row,
        extension_rows,
        get_number,
        law_path,
        number_of,
        own_copy,
        part_of,
        place_of,
        set_number,
        steps_of,
        without_detection,
    )
    from .friction_places import (
        Effect,
        Number,
        effects,
        estimable_numbers,
        friction_numbers,
        moment_arms,
        sliding_velocity,
        tendon_positions,
        velocity_threshold,
        without_friction,
        working_point_weights,
    )
    from .native import Instance, NativeError
    from .output_dependencies import (
        INPUTS_OF_SOURCE,
        Dependencies,
        dependencies,
        inputs_used,
        structure_of,
        watches_motors,
    )
    from .output_names import FLAGS, INPUTS, NUMBERS, OPTIONAL_NUMBERS, PLACE, SENSORS
    from .plausibility import Finding, description_findings, is_direct_drive
    from .routing_geometry import (
        EDGE_RED,
        TENDON_COLOURS,
        FingerDrawing,
        Mark,
        finger_drawing,
        finger_svg,
        keys_of,
    )

__getattr__, __dir__, __all__ = lazy_exports(__name__, __file__)
