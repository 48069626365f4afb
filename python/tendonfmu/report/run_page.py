"""What a run gives: its numbers (`tendonfmu run --json`), and its page (`--report`): torques, contact, motion."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu import drawing as draw
from tendonfmu.files import check_output, check_output_folder, counted, write_text
from tendonfmu.model import Finger
from tendonfmu.recordings import flagged_stretches
from tendonfmu.report.kit import Row, Tile, render, rms, torque_unit

Table = Mapping[str, NDArray[Any]]

FORMAT = "tendonfmu-run-1"
PAGE = "run.html"
ZOOM = "time"  # all panels are zoomed together
_TIME = "time (s)"
_MOST = 1000  # stretches of a band; curves are thinned where they are drawn


def page_of(report: Path) -> Path:
    """Return the file of the page. report: a name that ends in .html, or a folder."""
    return report if report.suffix.lower() in (".html", ".htm") else report / PAGE


def check_page(report: Path, *inputs: Path) -> None:
    """Check that the page of a run can be written."""
    page = page_of(report)
    if page != report:
        check_output_folder(report)
    if page == report or report.is_dir():
        check_output(page, *inputs)


def write_run_page(report: Path, numbers: Mapping[str, Any], table: Table, label: NDArray[Any] | None = None) -> Path:
    """Write the page of a run, whole or not at all."""
    # table: [N]
    page = page_of(report)
    if page != report:
        report.mkdir(parents=True, exist_ok=True)
    write_text(page, run_page(numbers, table, label))
    return page


def run_page(numbers: Mapping[str, Any], table: Table, label: NDArray[Any] | None = None) -> str:
    """Return the HTML text of the page of a run."""
    joints = [joint["name"] for joint in numbers["joints"]]
    return render(
        "run.html.jinja",
        run_sheets(table, joints, label),
        run=numbers,
        headline_numbers=list(_tiles(numbers)),
        joints=[_joint_row(joint) for joint in numbers["joints"]],
        slack=[
            (tendon["name"], f"{100 * tendon['slack_share']:.2g} %")
            for tendon in numbers["tendons"]
            if tendon["slack_share"]
        ],
        files=[
            ("model", numbers["model"]),
            ("recording", numbers["recording"]),
            ("outputs", numbers["output"]),
            ("kinematics", str(numbers["kinematics"])),
        ],
    )


def _tiles(run: Mapping[str, Any]) -> Iterator[Tile]:
    seconds, contact = run["duration"], run["contact"]
    length = (f"{seconds / 60:.3g}", "min") if seconds >= 120 else (f"{seconds:.3g}", "s")
    yield Tile(*length, f"recorded, {counted(run['samples'], 'sample')}")
    free = [(joint["free_joint_torque_rms"], joint["free_compensated_torque_rms"]) for joint in run["joints"]]
    if all(None not in pair for pair in free):
        torque, left = (sum(value**2 for value in values) ** 0.5 for values in zip(*free, strict=True))
        yield Tile(*_torque(torque), "rms of the joint torque without contact, all joints together")
        yield Tile(*_torque(left), "rms of what compensation leaves of it")
    count = len(contact["intervals"])
    yield Tile(str(count), "", f"{'contact' if count == 1 else 'contacts'}, {100 * contact['share']:.2g} % of the time")
    slack = max((tendon["slack_share"] for tendon in run["tendons"]), default=0.0)
    yield Tile(f"{100 * slack:.2g}", "%", "of the time slack, at most, of all tendons")


def _torque(value: float) -> tuple[str, str]:
    """Format a torque (N·m) with its unit."""
    factor, unit = torque_unit(value, 1.0)
    return f"{factor * value:.3g}", unit


def _joint_row(joint: Mapping[str, Any]) -> Row:
    low, high = joint["angle"]
    names = ("joint", "friction", "compensated", "free_joint", "free_compensated")
    torques = (joint[f"{name}_torque_rms"] for name in names)
    return (
        joint["name"],
        f"{low:.3g} to {high:.3g}".replace("-", "−"),
        *("–" if value is None else f"{1e3 * value:.3g}" for value in torques),
        f"{1e3 * joint['largest_compensated_torque']:.3g}",
        f"{100 * joint['contact_share']:.2g} %",
    )


# --- figures ----------------------------------------------------------------------------------------------------------


def run_sheets(table: Table, joints: Sequence[str], label: NDArray[Any] | None = None) -> Iterator[draw.Sheet]:
    """Yield the figures of a run."""
    # table: [N]
    torques = (table[f"joint_torque[{j}]"] for j in range(1, len(joints) + 1))
    factor, unit = torque_unit(max(float(np.abs(torque).max()) for torque in torques), 1.0)
    for j, name in enumerate(joints, start=1):
        yield draw.Sheet("joints", f"joint_{j}", name, list(_torque_panels(table, j, name, factor, unit, label)))
    motion = [
        draw.panel(
            f"{name}: {key}",
            f"Joint {key} of {name} over time",
            _TIME,
            f"{key} ({unit})",
            draw.curve(table["time"], table[f"joint_{key}[{j}]"], key, colour, 1.8),
            zoom=ZOOM,
        )
        for key, colour, unit in (("angle", draw.BLUE, "rad"), ("speed", draw.ORANGE, "rad/s"))
        for j, name in enumerate(joints, start=1)
    ]
    yield draw.Sheet("motion", "motion", "Joint angles and speeds", motion, folded=True)


def _torque_panels(
    table: Table, j: int, name: str, factor: float, unit: str, label: NDArray[Any] | None
) -> Iterator[draw.Panel]:
    time = table["time"]
    torque, friction, left, std = (
        factor * np.asarray(table[f"{key}[{j}]"], dtype=np.float64)
        for key in ("joint_torque", "friction_torque", "compensated_torque", "compensated_torque_std")
    )
    contact = draw.stripes(
        flagged_stretches(time, table[f"joint_contact[{j}]"]), "contact as detected", draw.VERMILION, 0.16
    )
    labelled = [] if label is None else flagged_stretches(time, label)
    yield draw.panel(
        "Torque and friction",
        f"Joint torque of {name} and its friction torque over time",
        _TIME,
        f"torque ({unit})",
        draw.curve(time, torque, "joint torque", draw.DARK, 1.0),
        draw.curve(time, friction, "friction torque", draw.SKY, 1.5),
        contact,
        note=f"{rms(torque):.3g} {unit} rms",
        size="medium",
        zoom=ZOOM,
    )
    yield draw.panel(
        "Compensated torque",
        f"Compensated torque of {name} over time, and when contact was detected there",
        _TIME,
        f"torque ({unit})",
        draw.band(*_thinned_band(time, left - std, left + std), "± one standard deviation") if std.any() else [],
        draw.curve(time, left, "compensated torque", draw.BLUE, 1.0),
        draw.stripes(labelled, "contact as labelled", draw.DARK, 0.1),
        contact,
        note=f"{rms(left):.3g} {unit} rms",
        size="medium",
        zoom=ZOOM,
    )


def _thinned_band(
    time: NDArray[Any], low: NDArray[Any], high: NDArray[Any]
) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
    """Thin a band to the extremes of at most `_MOST` stretches of samples."""
    if len(time) <= 2 * _MOST:
        return time, low, high
    begins = np.unique(np.linspace(0, len(time), _MOST, endpoint=False).astype(int))
    middles = (begins + np.append(begins[1:], len(time)) - 1) // 2
    return time[middles], np.minimum.reduceat(low, begins), np.maximum.reduceat(high, begins)


# --- the numbers ------------------------------------------------------------------------------------------------------


def run_report(
    model: Path, recording: Path, table: Table, finger: Finger | None, *, kinematics: int, output: str
) -> dict[str, Any]:
    """Return the results of a run in numbers."""
    # table: [N]
    time = table["time"]
    joints, tendons = _count(table, "joint_torque"), _count(table, "slack")
    joint_names = [f"joint {j}" for j in range(1, joints + 1)] if finger is None else finger.joint_names
    tendon_names = [f"tendon {i}" for i in range(1, tendons + 1)] if finger is None else finger.tendon_names
    return {
        "format": FORMAT,
        "model": str(model),
        "finger": None if finger is None else finger.name,
        "recording": str(recording),
        "kinematics": kinematics,
        "output": output,
        "samples": len(time),
        "duration": float(time[-1] - time[0]),
        "contact": {
            "samples": int(table["contact"].sum()),
            "share": _share(table["contact"]),
            "intervals": flagged_stretches(time, table["contact"]),
        },
        "joints": [_joint(table, j, name) for j, name in enumerate(joint_names, start=1)],
        "tendons": [
            {"name": name, "slack_share": _share(table[f"slack[{i}]"])} for i, name in enumerate(tendon_names, start=1)
        ],
    }


def _joint(table: Table, j: int, name: str) -> dict[str, Any]:
    torques = {key: table[f"{key}_torque[{j}]"] for key in ("joint", "friction", "compensated")}
    angle, free = table[f"joint_angle[{j}]"], ~np.asarray(table["contact"], dtype=bool)
    return {
        "name": name,
        "angle": [float(angle.min()), float(angle.max())],
        **{f"{key}_torque_rms": rms(values) for key, values in torques.items()},
        **{f"free_{key}_torque_rms": rms(values[free]) if free.any() else None for key, values in torques.items()},
        "largest_compensated_torque": float(np.abs(torques["compensated"]).max()),
        "contact_share": _share(table[f"joint_contact[{j}]"]),
    }


def _count(table: Table, name: str) -> int:
    return sum(column.startswith(f"{name}[") for column in table)


def _share(flags: NDArray[Any]) -> float:
    return float(np.mean(np.asarray(flags, dtype=np.float64)))
