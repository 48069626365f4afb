"""Files in and out: whole or not at all.

`writing` writes files whole, `tables` reads and writes tables of numbers (CSV, Parquet), `json_node` reads JSON with
the path of each value for error messages, `finite_numbers` turns what JSON cannot hold into null.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
