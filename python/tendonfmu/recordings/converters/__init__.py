"""How recordings of others become recordings of tendonfmu (docs/reference/recordings.md).

`machines` converts published data sets. Logs without a format of their own are read with a map of columns (`table`).
"""
