"""Make the figures of docs/reference/simulated_finger.md from the rigs of the index finger.

Usage: python make_figures.py [-o ../../docs/figures]      (needs tendonfmu installed, with the simulated finger)
"""

from __future__ import annotations

import argparse
from pathlib import Path

from plant_figures import loop_figure, presliding_figure, truth_figure
from rig_drawing import rig_drawing
from rig_plots import draw_loops, draw_presliding, draw_rig, draw_truth

from tendonfmu.simulate.rig import read_rig

HERE = Path(__file__).parent
JOINT, TENDON = 1, 4  # mcp_flexion; the flexor of the middle joint, which passes it (from 0)
SHOWN = (20.0, 36.0)  # s of the recording with pushes


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, default=HERE.parents[1] / "docs" / "figures", help="folder")
    folder = parser.parse_args().output
    rig = read_rig(HERE / "index_finger.json")
    draw_rig(rig_drawing(rig.expanded), folder / "simulated_finger.png")
    draw_loops(loop_figure(rig, JOINT), folder / "friction_loop.png")
    draw_presliding(presliding_figure(rig, JOINT, TENDON), folder / "presliding.png")
    pushed = read_rig(HERE / "index_finger_pushes.json")
    draw_truth(truth_figure(pushed, JOINT, *SHOWN), folder / "truth.png")


if __name__ == "__main__":
    main()
