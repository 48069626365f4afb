"""How files are read and written: whole or not at all.

`writing` writes whole files, `tables` reads and writes tables of numbers (CSV, Parquet), `mcap_table` writes them for
PlotJuggler and Foxglove, `extras` imports the libraries of the extra `logs`, `json_node` reads JSON and keeps the path
of each value for error messages, `finite_numbers` replaces numbers that JSON does not allow by null, `counting` writes
a number with its noun, and `templates` reads templates of HTML.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
