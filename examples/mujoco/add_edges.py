"""Adds what MJCF has no numbers for to an imported finger: python add_edges.py finger.json -o start.json.

Each tendon rubs where it enters a joint that it turns, by a share of its force: 2 % is a guess, and `tendonfmu fit`
finds the numbers. Friction builds up over a distance (`presliding`), in the joints over next to none. The bias learns
slowly, since a fast one would follow much of the friction that is to be fitted.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

from tendonfmu.files import write_text

EDGE = {"static": 0.02, "coulomb": 0.02, "stribeck_velocity": 0.005}
PRESLIDING = [
    {"effect": "presliding", "displacement": 0.3},
    *({"effect": "presliding", "joint": j, "displacement": 1e-4} for j in (1, 2)),
]
BIAS = {"drift_variance": 1e-8, "noise_std": 0.002, "noise_time": 0.01}


def with_edges(description: dict[str, Any]) -> dict[str, Any]:
    """The description with friction before each joint that a tendon turns."""
    tendons = [
        {**tendon, "edge_friction": [EDGE if arm else None for arm in tendon["moment_arms"]]}
        for tendon in description["tendons"]
    ]
    rows = [*description.get("extensions", []), *PRESLIDING]
    return {**description, "tendons": tendons, "bias": BIAS, "extensions": rows}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("finger", type=Path)
    parser.add_argument("-o", "--output", type=Path, required=True)
    given = parser.parse_args()
    description = json.loads(given.finger.read_text(encoding="utf-8"))
    write_text(given.output, json.dumps(with_edges(description), indent=2) + "\n")


if __name__ == "__main__":
    main()
