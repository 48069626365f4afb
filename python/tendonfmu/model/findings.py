"""What a finding about a recording or a description is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path


@dataclass(frozen=True)
class Finding:
    """Something that is wrong, or probably is.

    severity: "error" (no fit of it is sound) or "warning". kind: "sign", "exchange", "scale", "clock", "unfit",
    "columns", "pushing", "against", "held", "clipped", "coarse", "gaps", "lost", "jitter", or of a description
    "moment_arms", "stiffness", "cover", "angles", "threshold". path: the recording or description. columns: of the
    recording, or keys of the description. seen: what was seen, with numbers. probably: what is probably wrong.
    write: what to do about it. entries: column -> what to write into its entry of the map of columns ("sign", "scale",
    or "exchange" with the name of another column).
    """

    severity: str
    kind: str
    path: Path
    columns: tuple[str, ...]
    seen: str
    probably: str
    write: str
    entries: Mapping[str, Mapping[str, float | str]] = field(default_factory=dict)

    def line(self) -> str:
        """All of it in one line that begins with the file."""
        where = f"{self.path}: {_listed(self.columns)}: " if self.columns else f"{self.path}: "
        return f"{where}{self.seen}; probably {self.probably}; {self.write}"


def _listed(columns: tuple[str, ...]) -> str:
    """At most four of them by name."""
    few = ", ".join(columns[:4])
    return few if len(columns) <= 4 else f"{few} and {len(columns) - 4} more"
