"""Which effects a diagnosis knows, and how each is added to a description.

- `table` has a row for each effect: words, places, shapes, terms.
- `places` and `terms` hold what a row cannot say in a word; `words` puts sizes into words.
- `mechanism` says what a row is, and how it changes a description.
"""

from tendonfmu.diagnosis.effects.mechanism import Column, Mechanism, Place, Term, Variant, Where
from tendonfmu.diagnosis.effects.table import (
    BY_NAME,
    CALIBRATED,
    CALIBRATION,
    COMMON,
    MECHANISMS,
    OF_LAW,
    SHARED,
    by_name,
    title_of,
)

__all__ = [
    "BY_NAME",
    "CALIBRATED",
    "CALIBRATION",
    "COMMON",
    "MECHANISMS",
    "OF_LAW",
    "SHARED",
    "Column",
    "Mechanism",
    "Place",
    "Term",
    "Variant",
    "Where",
    "by_name",
    "title_of",
]
