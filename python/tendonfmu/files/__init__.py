"""How files are read and written: whole or not at all.

`writing` writes whole files, names what temporary ones stand for, writes a number with its noun and reads templates of
HTML, `tables` reads and writes tables of numbers (CSV, Parquet, pandas, MCAP), and `json_node` reads JSON and keeps the
path of each value for error messages.
"""

from typing import TYPE_CHECKING

from tendonfmu.lazy_exports import lazy_exports

if TYPE_CHECKING:
    from .json_node import Node, Refusal, finite, format_of, read_json, report_text
    from .tables import (
        FORMATS,
        OUTPUTS,
        Table,
        check_format,
        check_output_format,
        csv_lines,
        frame_of,
        is_frame,
        read_table,
        require_extra,
        table_of_frame,
        write_blocks,
        write_table,
    )
    from .writing import (
        StandIn,
        are,
        by_kind,
        check_output,
        check_output_folder,
        counted,
        html_template,
        listed,
        path_of,
        percent,
        whole_file,
        write_bytes,
        write_files,
        write_text,
    )

__getattr__, __dir__, __all__ = lazy_exports(__name__, __file__)
