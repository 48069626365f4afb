"""How well does a fit find the friction?"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from evidence.cases import EXAMPLES
from evidence.fit import memory, paper_figures
from evidence.part import Figures, Part
from evidence.table import of_cells, table

HAND = ("excite, 10 N", "excite, 40 N", "strokes, 10 N", "strokes, 40 N")


def virtual_hand(folder: Path, workers: int) -> Figures:
    """The lines that the example prints, in %; of its fits those of symmetric laws to varied tension."""
    program = [sys.executable, str(EXAMPLES / "rigs" / "virtual_hand.py"), "-o", str(folder)]
    done = subprocess.run(program, capture_output=True, text=True, check=True)
    printed = [[cell.strip() for cell in line.strip()[1:-1].split("|")] for line in done.stdout.splitlines()[2:]]
    lines = [[*line[:2], *line[4:]] for line in printed if line[1] != "constant" and line[2] != "asymmetric"]
    best = next(line for line in lines if line[:2] == ["of the paper", "varied"])
    return {"lines": lines, "left": [float(cell.split()[0].strip("*")) for cell in best[2:]]}


def contact_table(figures: Figures) -> str:
    """Figure 8 of the paper, in numbers."""
    names = {"fitted": "fitted as in the paper, its rule", "calibrated": "calibrated"}
    lines = [
        [
            name,
            ", ".join(f"{error:.1f}" for error in figures["8"][key]["error"]),
            f"{figures['8'][key]['reported']} of {figures['8'][key]['pushes']}",
            f"{100 * figures['8'][key]['false_share']:.1f} %",
        ]
        for key, name in names.items()
    ]
    return table(["description", "error by joint, mN·m rms", "pushes with contact", "alarm without a push"], lines)


def prediction_table(figures: Figures) -> str:
    """Figures 6 and 7 of the paper, in numbers."""
    lines = [
        [name, str(joint + 1), *(f"{figures[number][key][joint]:.1f}" for key in ("torque", "residual", "error"))]
        for number, name in (("6", "10 N, trained"), ("7", "40 N, not trained"))
        for joint in range(2)
    ]
    return table(["mN·m rms, 60 s", "joint", "torque", "residual", "error against the true friction"], lines)


PARTS = {
    "virtual_hand": Part(
        virtual_hand,
        headlines={"left.0": (10, 20), "left.1": (10, 25), "left.2": (10, 20), "left.3": (10, 25)},
        tables={"residual": of_cells("lines", ["bias", "training", *HAND], 2)},
    ),
    "memory": Part(
        memory.measure,
        needs=("mujoco",),
        headlines={"chosen.elastic": (0.0, 1.3), "chosen.dahl": (0.0, 2.0), "chosen.maxwell": (0.0, 2.0)},
        tables={"forms": memory.forms_table, "pretensions": memory.pretensions_table},
    ),
    "paper": Part(
        paper_figures.measure,
        minutes=0.3,
        headlines={
            "2b.largest_difference": (0.0, 1e-15),
            "6.residual.0": (2.3, 2.9),
            "7.residual.0": (7.4, 9.1),
            "8.calibrated.reported": (11, 11),
            "8.calibrated.false_share": (0.0, 0.12),
        },
        tables={"prediction": prediction_table, "contact": contact_table},
    ),
}
