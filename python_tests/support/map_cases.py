"""Maps of columns and logs for `convert table`, and their schema."""

from __future__ import annotations

import copy
import json
from importlib.resources import files
from pathlib import Path
from typing import Any

import jsonschema

SCHEMA = json.loads((files("tendonfmu") / "schema" / "map.schema.json").read_text(encoding="utf-8"))
VALIDATOR = jsonschema.Draft202012Validator(SCHEMA)

SMALL = {
    "format": "tendonfmu-map-1",
    "columns": {
        "time": {"column": "t", "unit": "ms"},
        "tendon_force[1]": {"column": "force", "unit": "kN"},
        "tendon_position[1]": {"column": "spool", "unit": "mm", "sign": -1, "offset": 5},
    },
}
LOG = "t,force,spool,note\n0,0.001,5,a\n2,0.002,4,b\n4,0.003,3,c\n"
TURNING = {
    "format": "tendonfmu-map-1",
    "joint": {
        "time": {"column": "t", "unit": "s"},
        "torque": {"column": "torque", "unit": "N.m"},
        "angle": {"column": "angle", "unit": "rad"},
    },
}


def edited(document: dict[str, Any], path: str, value: Any) -> dict[str, Any]:
    """A copy with one value changed; path: keys with / between; value ...: the key is taken away."""
    found = copy.deepcopy(document)
    *parents, last = path.split("/")
    inner = found
    for key in parents:
        inner = inner.setdefault(key, {})
    if value is ...:
        del inner[last]
    else:
        inner[last] = value
    return found


def written(folder: Path, log: str | bytes = LOG, wanted: Any = SMALL, name: str = "log.csv") -> tuple[Path, Path]:
    """Log and map."""
    (folder / name).write_bytes(log if isinstance(log, bytes) else log.encode())
    (folder / "map.json").write_text(wanted if isinstance(wanted, str) else json.dumps(wanted))
    return folder / name, folder / "map.json"
