"""How do other tools do on the same recordings? All learn the first part, and the rest judges.

The torque error of every tool is the joint torque of the measured tendon forces, less the known load and what the tool
predicts, behind the same filter, with the mean of each recording taken out.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np

from evidence import table
from evidence.cases import run_cases
from evidence.part import Figures, Part
from evidence.peers import tools
from evidence.peers.signals import NAMES, Case, make
from evidence.table import Row


def _of_mujoco(name: str) -> Callable[[Case], tools.Error]:
    """Imported late: mujoco.sysid is an extra of MuJoCo."""

    def learn(case: Case) -> tools.Error:
        from evidence.peers import mjcf

        made: tools.Error = getattr(mjcf, name)(case)
        return made

    return learn


ROLLED = "mujoco.sysid, rollouts"  # of tendons that motors pull
TOOLS: Mapping[str, Callable[[Case], tools.Error]] = {
    "TendonFMU": tools.tendonfmu,
    "mujoco.sysid, inverse dynamics": _of_mujoco("inverse"),
    "the same, pulleys by load": _of_mujoco("inverse_by_load"),
    ROLLED: _of_mujoco("rolled"),
    "Coulomb, viscous, load": tools.regression,
    "boosted trees": tools.trees,
}


def job_name(*parts: str) -> str:
    return "_".join("".join(letter if letter.isalnum() else "_" for letter in part) for part in parts)


def learned(folder: Path, name: str, tool: str) -> Row:
    """rms by joint on unseen motion, mN·m, and processor seconds of learning."""
    case = make(folder, name)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        before = time.process_time()
        error = TOOLS[tool](case)
        cpu = time.process_time() - before
        return {"machine": name, "tool": tool, "rms": 1e3 * tools.rms_unseen(error, case.unseen), "cpu": cpu}


def pushed(folder: Path, detector: str) -> Row:
    from evidence.peers import detection

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return detection.detected(folder, detector)


def measure(folder: Path, workers: int) -> Figures:
    from evidence.peers import detection

    pairs = [(name, tool) for name in NAMES for tool in TOOLS if tool != ROLLED or name.endswith("finger")]
    rows = run_cases(learned, {job_name(*pair): (folder, *pair) for pair in pairs}, folder, workers)
    jobs = {job_name("detection", name): (folder, name) for name in detection.DETECTORS}
    found = [pushes_by_size(row) for row in run_cases(pushed, jobs, folder, workers)]
    kept = ("machine", "tool", "rms", "cpu")
    return {"rows": [{key: row[key] for key in kept} for row in rows], "pushes": found, "wins": wins(rows)}


# --- figures and tables -----------------------------------------------------------------------------------------------

SIZES = {"< 3": (0.0, 3.0), "3–10": (3.0, 10.0), "10–30": (10.0, 30.0), "≥ 30": (30.0, np.inf)}  # mN·m, largest joint


def together(rms: Sequence[float]) -> float:
    """One number of all joints, by which a column is won."""
    return table.rms(np.array(rms))


def wins(rows: Sequence[Row]) -> dict[str, str]:
    """The tool with the least error on each machine."""
    best: dict[str, Row] = {}
    for row in rows:
        if row["machine"] not in best or together(row["rms"]) < together(best[row["machine"]]["rms"]):
            best[row["machine"]] = row
    return {machine: row["tool"] for machine, row in best.items()}


def pushes_by_size(row: Row) -> Row:
    """Found of all, by size; the median delay of those found, ms; what is false."""
    sizes = {
        name: [
            sum(p["found"] for p in row["pushes"] if low <= p["size"] < high),
            sum(low <= p["size"] < high for p in row["pushes"]),
        ]
        for name, (low, high) in SIZES.items()
    }
    delays = [1e3 * push["delay"] for push in row["pushes"] if push["found"]]
    keys = ("detector", "free_alarms", "alarms", "minutes", "cpu")
    return {key: row[key] for key in keys} | {"sizes": sizes, "delay": float(np.median(delays)) if delays else None}


def error_table(figures: Figures) -> str:
    """Errors by joint; the least of each machine is bold."""
    lines = []
    for tool in TOOLS:
        line = [tool]
        for name in NAMES:
            (row,) = table.where(figures["rows"], machine=name, tool=tool) or [{"rms": None}]
            text = " ".join(f"{value:.3g}" for value in row["rms"]) if row["rms"] else table.NOTHING
            line.append(f"**{text}**" if figures["wins"][name] == tool else text)
        lines.append(line)
    return table.table(["tool", *NAMES], lines)


def cost_table(figures: Figures) -> str:
    rows = {(row["tool"], row["machine"]): row["cpu"] for row in figures["rows"]}
    lines = [[tool, *(table.number(rows.get((tool, name)), ".3g") for name in NAMES)] for tool in TOOLS]
    return table.table(["tool", *NAMES], lines)


def push_table(figures: Figures) -> str:
    lines = [
        [
            row["detector"],
            *("{}/{}".format(*row["sizes"][size]) for size in SIZES),
            table.number(row["delay"], ".0f"),
            row["free_alarms"],
            f"{row['alarms']} in {row['minutes']:.1f}",
            table.number(row["cpu"], ".3g"),
        ]
        for row in figures["pushes"]
    ]
    head = [
        "detector",
        *(f"{size} mN·m" for size in SIZES),
        "median delay, ms",
        "false, free",
        "false, min between pushes",
    ]
    return table.table([*head, "CPU, s"], lines)


PARTS = {
    "tools": Part(
        measure,
        minutes=15.0,
        needs=("../shared/data", "mujoco", "sklearn", "absl", "colorama", "imageio", "tabulate"),
        headlines={  # mN·m of TendonFMU at the first joint, and pushes of at least 10 mN·m that it finds
            "rows.0.rms.0": (0.0, 1.5),
            "rows.6.rms.0": (0.0, 2.0),
            "rows.12.rms.0": (0.0, 5.5),
            "rows.18.rms.0": (0.0, 5.5),
            "rows.23.rms.0": (0.0, 150.0),
            "pushes.0.sizes.10–30.0": (20, 22),
            "pushes.0.sizes.≥ 30.0": (27, 28),
        },
        tables={"errors": error_table, "cost": cost_table, "pushes": push_table},
    )
}
