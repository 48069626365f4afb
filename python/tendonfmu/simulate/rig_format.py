"""Which files are rigs. Every command that takes a finger asks this: nothing of the simulated finger is imported."""

from __future__ import annotations

import json
from pathlib import Path


def is_rig(path: Path) -> bool:
    """Return whether a file claims to be a rig, even an invalid one."""
    try:
        with path.open(encoding="utf-8") as file:
            data = json.load(file)
    except (OSError, ValueError, RecursionError):
        return False
    return isinstance(data, dict) and str(data.get("format", "")).startswith("tendonfmu-rig-")
