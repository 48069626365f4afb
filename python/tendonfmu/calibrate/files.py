"""The files of a calibration: finger, FMU, page and report."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from tendonfmu.calibrate.calibration import DIAGNOSIS, Calibration
from tendonfmu.calibrate.text import (
    TORQUE_HEADINGS,
    cause_rows,
    error_rows,
    push_sentence,
    recording_rows,
    sensor_sentence,
    size_rows,
    tiles,
    torque_rows,
    verdict,
)
from tendonfmu.files import check_output, check_output_folder, write_text
from tendonfmu.fmu import build_fmu
from tendonfmu.model import description_text
from tendonfmu.report import render

FINGER, FMU, PAGE, REPORT = "finger.json", "finger.fmu", "calibration.html", "calibration.json"
_WHAT = {
    PAGE: "the results, for a browser",
    FINGER: "the calibrated description",
    FMU: "the same as an FMU",
    REPORT: "the numbers of the page",
}
_DIAGNOSED = {f"{DIAGNOSIS}/diagnosis.html": "what the description lacked, and how it was found"}


def files_of(report: Mapping[str, Any]) -> dict[str, str]:
    """Return the name of each file in the folder, with its content in words."""
    return _WHAT | (_DIAGNOSED if report["structure"]["recordings"] else {})


def check_folder(folder: Path, inputs: Sequence[Path]) -> None:
    """Check that the results can be written, before a long computation."""
    check_output_folder(folder)
    if folder.is_dir():
        for name in (FINGER, FMU, PAGE, REPORT):
            check_output(folder / name, *inputs)


def write_calibration(found: Calibration, folder: Path) -> dict[Path, str]:
    """Write the files of a calibration; each appears whole or not at all, the report last."""
    folder.mkdir(parents=True, exist_ok=True)
    write_text(folder / FINGER, description_text(dict(found.data)))
    build_fmu(folder / FINGER, folder / FMU)
    write_text(folder / PAGE, calibration_page(found.report))
    written = files_of(found.report)
    report = {**found.report, "files": list(written)}
    text = ",\n".join(f" {json.dumps(key)}: {json.dumps(value, ensure_ascii=False)}" for key, value in report.items())
    write_text(folder / REPORT, f"{{\n{text}\n}}\n")
    return {folder / name: what for name, what in written.items()}


def calibration_page(report: Mapping[str, Any]) -> str:
    """Return the HTML text of the page."""
    tone, sentence = verdict(report)
    return render(
        "calibration.html.jinja",
        report=report,
        tone=tone,
        verdict=sentence,
        headline_numbers=list(tiles(report)),
        errors=error_rows(report),
        causes=cause_rows(report),
        torques=torque_rows(report),
        torque_headings=list(TORQUE_HEADINGS),
        sensors=sensor_sentence(report),
        push=push_sentence(report) if report["pushes"] is not None else "",
        sizes=size_rows(report),
        recordings=recording_rows(report),
        files=files_of(report),
    )
