"""The page of a run: `tendonfmu run --report`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from tendonfmu.files import check_output, check_output_folder, counted, write_text
from tendonfmu.report.page import Tile, render
from tendonfmu.report.run_figures import run_sheets

PAGE = "run.html"


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


def write_run_page(
    report: Path, numbers: Mapping[str, Any], table: Mapping[str, NDArray[Any]], label: NDArray[Any] | None = None
) -> Path:
    """Write the page of a run, whole or not at all."""
    # table: [N]
    page = page_of(report)
    if page != report:
        report.mkdir(parents=True, exist_ok=True)
    write_text(page, run_page(numbers, table, label))
    return page


def run_page(numbers: Mapping[str, Any], table: Mapping[str, NDArray[Any]], label: NDArray[Any] | None = None) -> str:
    """Return the HTML text of the page of a run."""
    joints = [each["name"] for each in numbers["joints"]]
    tendons = [each["name"] for each in numbers["tendons"]]
    return render(
        "run.html.jinja",
        list(run_sheets(table, joints, tendons, label)),
        run=numbers,
        headline_numbers=list(_tiles(numbers)),
        joints=[_joint_row(each) for each in numbers["joints"]],
        slack=[
            (each["name"], f"{100 * each['slack_share']:.2g} %") for each in numbers["tendons"] if each["slack_share"]
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
    free = [(each["free_joint_torque_rms"], each["free_compensated_torque_rms"]) for each in run["joints"]]
    if all(None not in pair for pair in free):
        torque, left = (sum(value**2 for value in values) ** 0.5 for values in zip(*free, strict=True))
        yield Tile(*_torque(torque), "rms of the joint torque without contact, all joints together")
        yield Tile(*_torque(left), "rms of what compensation leaves of it")
    count = len(contact["intervals"])
    yield Tile(str(count), "", f"{'contact' if count == 1 else 'contacts'}, {100 * contact['share']:.2g} % of the time")
    slack = max((each["slack_share"] for each in run["tendons"]), default=0.0)
    yield Tile(f"{100 * slack:.2g}", "%", "of the time slack, at most, of all tendons")


def _torque(value: float) -> tuple[str, str]:
    """Format a torque (N·m) with its unit."""
    return (f"{value:.3g}", "N·m") if value >= 1.0 else (f"{1e3 * value:.3g}", "mN·m")


def _joint_row(joint: Mapping[str, Any]) -> tuple[str, ...]:
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
