"""Which effects a diagnosis knows, and how each is added to a description.

- `table` has a row for each effect: words, places, shapes, terms.
- `places` and `terms` hold what a row cannot say in a word; `words` puts sizes into words.
- `candidate` says what a row is, and how it changes a description.
"""

from tendonfmu.diagnosis.effects.candidate import Candidate, Column, Place, Term, Variant, Where
from tendonfmu.diagnosis.effects.table import (
    BY_NAME,
    CALIBRATED,
    CALIBRATION,
    CANDIDATES,
    COMMON,
    OF_LAW,
    RUBBING,
    SHARED,
    by_name,
)

__all__ = [
    "BY_NAME",
    "CALIBRATED",
    "CALIBRATION",
    "CANDIDATES",
    "COMMON",
    "OF_LAW",
    "RUBBING",
    "SHARED",
    "Candidate",
    "Column",
    "Place",
    "Term",
    "Variant",
    "Where",
    "by_name",
]
