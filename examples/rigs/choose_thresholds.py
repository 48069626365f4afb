"""How the contact thresholds of ../fingers/index_finger.json were chosen: see ../fingers/README.md.

Usage: python choose_thresholds.py      (needs tendonfmu installed, with the simulated finger; seconds)

Eight recordings with pushes, of other seeds than those of the rigs beside this file: as many minutes, 88 pushes. Each
row is a factor on thresholds that were chosen on a simpler finger; the last row has those of the description.
"""

from __future__ import annotations

import copy
import json
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from tendonfmu.detect.counting import DetectionScore, score_detection
from tendonfmu.model.native import Instance
from tendonfmu.simulate.rig import read_rig
from tendonfmu.simulate.simulation import Table, simulate

HERE = Path(__file__).resolve().parent
FINGER = HERE.parent / "fingers" / "index_finger.json"
SEEDS = range(21, 29)  # of motion, pushes and noise
FACTORS = (1.0, 1.3, 1.6, 2.0)
# N·m and N·m per N of mean tendon force
START = {"threshold": (0.010, 0.014, 0.011, 0.007), "threshold_per_force": (0.0015, 0.0021, 0.0016, 0.0011)}


def record(seed: int, folder: Path) -> Table:
    """The recording of index_finger_pushes.json with all its seeds replaced."""
    rig = {
        "format": "tendonfmu-rig-1",
        "base": str(HERE / "index_finger_pushes.json"),
        "name": f"seed_{seed}",
        "seed": seed,
        "motion": {"seed": seed},
        "pushes": {"seed": seed},
    }
    file = folder / f"{seed}.json"
    file.write_text(json.dumps(rig), encoding="utf-8")
    return simulate(read_rig(file)).recording


def score(description: dict[str, Any], recording: Table) -> DetectionScore:
    tendons = len(description["tendons"])
    inputs = {
        name: np.column_stack([recording[f"{name}[{i + 1}]"] for i in range(tendons)])
        for name in ("tendon_force", "tendon_position")
    }
    outputs = Instance.from_description(description).run({"time": recording["time"], **inputs})
    return score_detection(recording["time"], recording["contact"].astype(bool), outputs["contact"])


def main() -> None:
    described = json.loads(FINGER.read_text(encoding="utf-8"))
    with tempfile.TemporaryDirectory() as folder:
        recordings = [record(seed, Path(folder)) for seed in SEEDS]
    candidates = {}
    for factor in FACTORS:
        candidate = copy.deepcopy(described)
        candidate["contact"] |= {key: [factor * value for value in values] for key, values in START.items()}
        candidates[f"{factor:.1f}"] = candidate
    print(f"{'factor':>9} {'found':>9} {'alarms outside':>15}   seeds with more than 10 %")
    for name, description in {**candidates, "described": described}.items():
        scores = [score(description, recording) for recording in recordings]
        found, pushes = sum(each.found for each in scores), sum(len(each.events) for each in scores)
        shares = [each.free_alarm_share for each in scores]
        much = [str(seed) for seed, share in zip(SEEDS, shares, strict=True) if share > 0.1]
        print(f"{name:>9} {found:3} of {pushes} {100 * np.mean(shares):13.1f} %   {', '.join(much) or 'none'}")


if __name__ == "__main__":
    main()
