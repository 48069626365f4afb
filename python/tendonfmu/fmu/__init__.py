"""How FMUs are packaged without a compiler, described, and run.

`packaging` makes the archive from `model_variables`. `fmpy_client` runs an FMU sample by sample.
`running` runs a description or an FMU over a recording.
"""

from typing import TYPE_CHECKING

from tendonfmu.lazy_exports import lazy_exports

if TYPE_CHECKING:
    from .fmpy_client import run_fmu
    from .model_variables import NOT_IN_XML, VariableTable, elements, group_sizes, read_table, units_of
    from .packaging import (
        build_fmu,
        c_array_report,
        find_binaries,
        fmu_report,
        guid,
        illustrations,
        licenses,
        members,
        model_description,
        model_identifier,
        pack,
        package_file,
        write_c_array,
    )
    from .running import (
        bridged_rows,
        check_model,
        columns_of,
        finger_of,
        outputs_of,
        reference_run,
        related_members,
        run_model,
        summary,
    )
    from .ssp import (
        OMS,
        SPACES,
        SSC,
        SSD,
        SSV,
        SetParameter,
        check_parameter_set_path,
        component,
        connection,
        connectors,
        parameter_sets,
        parameter_values,
        write_parameter_set,
        xml_text,
    )

__getattr__, __dir__, __all__ = lazy_exports(__name__, __file__)
