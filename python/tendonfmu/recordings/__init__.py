"""How recordings are read, checked and prepared for a fit.

`recording` reads them and `converters` turns foreign formats into ours. `match` says whether they belong to a finger,
and if not, why. `prepared`, `signal_noise` and `residuals` prepare them for a fit and compute the torque that a finger
leaves unexplained.
"""

from typing import TYPE_CHECKING

from tendonfmu.lazy_exports import lazy_exports

if TYPE_CHECKING:
    from .columns import GROUPS, Nis, RecordingEntry, RoutingEntry, Whiteness
    from .converters.column_map import read_log_format
    from .converters.inspection import Inspection, inspect_log
    from .converters.lerobot_log import LeRobotLog
    from .converters.machines import convert_file
    from .converters.one_joint import describe_joint, describe_recorded_joint, joint_description
    from .converters.proposal import (
        Proposal,
        clock_line,
        field_rows,
        inspection_document,
        proposal_rows,
        propose,
        unused_line,
    )
    from .converters.table import Conversion, convert_table
    from .faults import gaps, tendon_angles
    from .findings import check_report, recording_report, refusal_report, routing_entry, varying_sentences
    from .match import UNFIT_FOR_SEARCH, admit, belongs
    from .prepared import (
        FitRecording,
        Grid,
        Held,
        Segment,
        held_out_blocks,
        make_grid,
        motion_of,
        prepare,
        refuse_stillness,
        require_noise,
        slack_sentences,
        without_rests,
    )
    from .recording import (
        GROUP_PER,
        LABEL,
        Recording,
        RecordingSource,
        at_rows,
        flagged_stretches,
        listed_sources,
        read_recording,
        read_recordings,
    )
    from .residuals import BENDING, Model, consistency, delayed_torque, rms, run_parts, whiteness, with_linear_springs
    from .routing import (
        Learned,
        TendonRouting,
        curves,
        held_on_the_way,
        learn_routing,
        require_routing,
        routed,
        smooth_speeds,
    )
    from .signal_noise import FEWEST, best_angles, joint_position_noise, on_encoders, stopped, zero_phase

__getattr__, __dir__, __all__ = lazy_exports(__name__, __file__)
