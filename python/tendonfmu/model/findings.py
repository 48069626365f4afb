"""What a finding about a recording or a description says."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path


@dataclass(frozen=True)
class Finding:
    """Something that is wrong, or probably is."""

    severity: str  # "error" (no fit of it is sound) or "warning"
    # of a recording: "sign", "exchange", "scale", "clock", "unfit", "columns", "pushing", "against", "held", "clipped",
    # "coarse", "gaps", "lost" or "jitter". Of a description: "moment_arms", "stiffness", "cover", "friction", "angles"
    # or "threshold"
    kind: str
    path: Path  # the recording or description
    columns: tuple[str, ...]  # columns of the recording, or keys of the description
    seen: str  # the observation, with numbers
    probably: str  # its probable cause
    write: str  # what to do about it
    # for each column, what to write into its entry of the map of columns: "sign", "scale", or "exchange" with the name
    # of another column
    entries: Mapping[str, Mapping[str, float | str]] = field(default_factory=dict)

    def line(self) -> str:
        """Return the whole finding in one line."""
        where = f"{self.path}: {_listed(self.columns)}: " if self.columns else f"{self.path}: "
        return f"{where}{self.seen}; probably {self.probably}; {self.write}"


def _listed(columns: tuple[str, ...]) -> str:
    """List at most four of the columns by name."""
    few = ", ".join(columns[:4])
    return few if len(columns) <= 4 else f"{few} and {len(columns) - 4} more"
