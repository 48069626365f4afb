"""Compares what installations computed (tools/wheel/try_wheel.py).

    python tools/wheel/compare_trials.py tried-3.10.json tried-3.11.json ... [tried-tree.json]

The bits of run and simulate are the same everywhere. The numbers of a fit are the same in all wheels; the package of
another compiler (tried-tree.json) may differ by TOLERANCE, since Eigen sums in the order that the compiler chooses.
Exit status: 0 alike, 1 not.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

TREE = "tried-tree"
TOLERANCE = 1e-6  # of the number: a fit ends where a step changes the cost by less than 1e-8 of it


def largest_difference(a: dict[str, float], b: dict[str, float]) -> float:
    """Largest relative difference of two fits; infinite if they hold other numbers."""
    if a.keys() != b.keys():
        return float("inf")
    return max(
        (abs(a[key] - b[key]) / max(abs(a[key]), abs(b[key]), 1e-300) for key in a if a[key] != b[key]), default=0.0
    )


def findings(trials: dict[str, dict[str, Any]]) -> list[str]:
    """What differs from the first trial; empty if all are alike."""
    (first, wanted), *others = trials.items()
    found = []
    for name, trial in others:
        for result in sorted(wanted["bits"].keys() | trial["bits"].keys()):
            if wanted["bits"].get(result) != trial["bits"].get(result):
                found.append(f"{name}: {result} has other bits than in {first}")
        difference = largest_difference(wanted["fit"], trial["fit"])
        if difference > (TOLERANCE if TREE in (first, name) else 0.0):
            found.append(f"{name}: fit differs from that of {first} by {difference:.2g}")
    return found


def main(arguments: Sequence[str]) -> int:
    trials = {Path(each).stem: json.loads(Path(each).read_text(encoding="utf-8")) for each in arguments}
    if not trials:
        print("compare_trials: no trials", file=sys.stderr)
        return 1
    for name, trial in trials.items():
        seconds = ", ".join(f"{command} {time:.1f} s" for command, time in trial["seconds"].items())
        extras = ", ".join(f"{extra} ({count})" for extra, count in trial["extras"].items()) or "none"
        print(f"{name}: {seconds}; extras imported: {extras}")
    found = findings(trials)
    for each in found:
        print(f"compare_trials: {each}", file=sys.stderr)
    if not found:
        first, *others = trials.values()
        apart = max((largest_difference(first["fit"], each["fit"]) for each in others), default=0.0)
        print(f"alike: {', '.join(first['bits'])} to the bit, fit to {apart:.2g}")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
