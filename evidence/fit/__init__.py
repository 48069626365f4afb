"""How well does a fit find the friction?"""

from __future__ import annotations

from evidence.fit import memory, paper_figures, virtual_hand
from evidence.part import Figures, Part
from evidence.table import of_cells, table


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
        virtual_hand.measure,
        headlines={"left.0": (10, 20), "left.1": (10, 25), "left.2": (10, 20), "left.3": (10, 25)},
        tables={"residual": of_cells("lines", ["bias", "training", *virtual_hand.JUDGED], 2)},
    ),
    "memory": Part(
        memory.measure,
        needs=("mujoco",),
        headlines={"chosen.elastic": (0.0, 1.3), "chosen.dahl": (0.0, 2.0), "chosen.maxwell": (0.0, 2.0)},
        tables={"forms": memory.forms_table},
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
