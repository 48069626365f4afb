"""How files are read and written: whole or not at all.

`writing` writes whole files, `tables` reads and writes tables of numbers (CSV, Parquet), `mcap_table` writes them for
PlotJuggler and Foxglove, `extras` imports the libraries of the extra `logs`, `json_node` reads JSON and keeps the path
of each value for error messages, `finite_numbers` replaces numbers that JSON does not allow by null, `counting` writes
a number with its noun, and `templates` reads templates of HTML.
"""

from typing import TYPE_CHECKING

from tendonfmu.lazy_exports import lazy_exports

if TYPE_CHECKING:
    from .counting import are, counted
    from .extras import require_extra
    from .finite_numbers import finite, report_text
    from .frames import frame_of, is_frame, table_of_frame
    from .json_node import Node, Refusal, read_json
    from .tables import (
        FORMATS,
        Table,
        check_format,
        check_output_format,
        csv_lines,
        read_table,
        write_blocks,
        write_table,
    )
    from .templates import html_template
    from .writing import check_output, check_output_folder, in_use, is_about, remove_left_behind, whole_file, write_text

__getattr__, __dir__, __all__ = lazy_exports(__name__, __file__)
