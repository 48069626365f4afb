"""Friction fitted on recordings made in MuJoCo and written back into a model, against the model that moved.

python bench/mujoco_friction.py [--seeds 1 2 3 4]
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parents[1] / "python_tests" / "support"))

from mjcf_recovery import recover


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3, 4], help="one recording each")
    seeds = parser.parse_args().seeds
    runs = []
    for seed in seeds:
        with tempfile.TemporaryDirectory() as folder:
            runs.append(recover(Path(folder), seed))
    print("| | true | " + " | ".join(f"recording {seed}" for seed in seeds) + " |")
    print("| --- | ---: |" + " ---: |" * len(seeds))
    inside = 0
    for found in zip(*runs, strict=True):
        unit = "mN·m" if found[0].attribute == "frictionloss" else "mN·m·s/rad"
        cells = [f"{1e3 * each.value:.2f} ± {1e3 * each.error:.2f}" for each in found]
        row = f"`{found[0].attribute}` of {found[0].joint}, {unit} | {1e3 * found[0].true:g}"
        print(f"| {row} | " + " | ".join(cells) + " |")
        inside += sum(abs(each.value - each.true) <= 1.96 * each.error for each in found)
    print(f"\n{inside} of {sum(map(len, runs))} within 1.96 standard errors.")


if __name__ == "__main__":
    main()
