"""Which files a diagnosis writes, and its report. The output folder gets all of them, or stays as it was.

The report is "tendonfmu-diagnosis-1" of docs/reference/commands/diagnose.md.
"""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any, cast

import numpy as np

from tendonfmu import diagnosis as found
from tendonfmu.errors import OutputError, own_fault
from tendonfmu.files import (
    check_output_folder,
    finite,
    is_about,
    report_text,
    write_text,
)
from tendonfmu.fmu import build_fmu
from tendonfmu.model import description_text
from tendonfmu.report.diagnosis_page import PAGE, diagnosis_page
from tendonfmu.report.diagnosis_text import names_of
from tendonfmu.report.diagnosis_types import DiagnosisReport
from tendonfmu.report.diagnosis_words import words_of
from tendonfmu.statistics import Interval
from tendonfmu.tasks import uninterrupted

FORMAT = "tendonfmu-diagnosis-1"
REPORT, NOMINAL, EXTENDED, EXTENDED_FMU = "diagnosis.json", "nominal.json", "extended.json", "extended.fmu"
DIGITS = 6  # significant digits of the curves


def check_folder(folder: Path, inputs: Sequence[Path]) -> None:
    """Check before a long computation that the results can be written to a folder."""
    check_output_folder(folder, (REPORT, EXTENDED, EXTENDED_FMU, PAGE, NOMINAL), inputs)


def write_diagnosis(diagnosis: found.Diagnosis, folder: Path) -> dict[Path, str]:
    """Write the report, both descriptions, the FMU and the page."""
    beside = folder.absolute().parent
    try:
        beside.mkdir(parents=True, exist_ok=True)
        with _folder_beside(folder) as made_in:
            (made_in / "new").mkdir()
            with own_fault("the files of the diagnosis"):
                made = _make_for(diagnosis, made_in / "new", folder)
            with uninterrupted():
                _move(made, folder, made_in / "old")
    except OSError as error:
        if not is_about(error, beside):
            raise
        raise OutputError(f"{folder}: cannot be written ({error.strerror or error})") from None
    return {folder / file.name: what for file, what in made.items()}


def _make_for(diagnosis: found.Diagnosis, folder: Path, named: Path) -> dict[Path, str]:
    """Make the files in a folder. A refusal names the folder that the user gave."""
    try:
        return _make(diagnosis, folder)
    except OutputError as refused:
        raise OutputError(str(refused).replace(str(folder), str(named))) from None


@contextmanager
def _folder_beside(folder: Path) -> Iterator[Path]:
    """Make a temporary folder on the same disk. Its removal is not interrupted."""
    name = tempfile.mkdtemp(dir=folder.absolute().parent, prefix=f".{folder.absolute().name}-")
    try:
        yield Path(name)
    finally:
        with uninterrupted():
            shutil.rmtree(name, ignore_errors=True)


def _move(files: Iterable[Path], folder: Path, old: Path) -> None:
    """Move files into a folder, the report last, and move those of an earlier diagnosis to `old`; undo all on error."""
    is_new = not folder.exists()
    folder.mkdir(exist_ok=True)
    old.mkdir()
    moved: list[tuple[Path, Path]] = []
    ordered = sorted(files, key=lambda file: file.name == REPORT)
    leaving = [(folder / file.name, old / file.name) for file in ordered if (folder / file.name).is_file()]
    try:
        for source, target in (*leaving, *((file, folder / file.name) for file in ordered)):
            os.replace(source, target)
            moved.append((source, target))
    except BaseException:
        for source, target in reversed(moved):
            os.replace(target, source)
        if is_new:
            folder.rmdir()
        raise


def _make(diagnosis: found.Diagnosis, folder: Path) -> dict[Path, str]:
    """Write all files to an empty folder."""
    write_text(folder / PAGE, diagnosis_page(diagnosis))
    causes = len(diagnosis.causes)
    added = "no cause added" if causes == 0 else "its cause added" if causes == 1 else f"its {causes} causes added"
    for name, data in ((NOMINAL, diagnosis.nominal_data), (EXTENDED, diagnosis.extended_data)):
        write_text(folder / name, description_text(dict(data)))
    build_fmu(folder / EXTENDED, folder / EXTENDED_FMU)
    files = {
        folder / PAGE: "all results, to be read in a browser",
        folder / REPORT: "the same numbers",
        folder / EXTENDED: f"the finger with {added}, fitted",
        folder / EXTENDED_FMU: "the same as an FMU",
        folder / NOMINAL: "the given model, fitted",
    }
    write_text(folder / REPORT, report_text(build_report(diagnosis, [file.name for file in files])))
    return files


# --- the report -------------------------------------------------------------------------------------------------------


def build_report(diagnosis: found.Diagnosis, files: Sequence[str] = ()) -> DiagnosisReport:
    """Make the report of a diagnosis."""
    effect = ("title", "surviving_share", "ordinary_gain", "needed_gain", "experiment")
    report = {
        "format": FORMAT,
        **_fields(diagnosis, "kind", "verdict"),
        "nominal": _plain(diagnosis.nominal) | {"bias_only_rms": diagnosis.bias_only_rms, "finger": NOMINAL},
        "extended": _plain(diagnosis.extended) | {"finger": EXTENDED, "fmu": EXTENDED_FMU},
        "delivered": dict(zip(("nominal", "extended"), _plain(diagnosis.delivered), strict=True)),
        **_fields(diagnosis, "noise_floor", "gain"),
        "causes": [_cause(cause, diagnosis.kind) for cause in found.reported_causes(diagnosis)],
        "too_small": [_cause(cause, diagnosis.kind) for cause in diagnosis.too_small],
        "uncertain": [
            _cause(cause, diagnosis.kind) | {"experiment": cause.experiment} for cause in diagnosis.uncertain
        ],
        "unexplained": _fields(diagnosis.unexplained, "share", "description", "by_joint", "gain", "planted"),
        "next_experiment": diagnosis.experiment.sentence,
        "waterfall": _waterfall(diagnosis),
        **_fields(diagnosis, "least_gain", "finger"),
        "joints": [joint.get("name") for joint in diagnosis.nominal_data["joints"]],
        "tendons": [tendon.get("name") for tendon in diagnosis.nominal_data["tendons"]],
        **_fields(diagnosis, "references", "repeated", "recordings", "tests", "held_out", "seed", "tested"),
        "floor_source": diagnosis.floor_source,
        "whiteness": [{"nominal": before, "extended": after} for before, after in diagnosis.whiteness],
        "invisible": [_where(invisible.where) | _fields(invisible, *effect) for invisible in diagnosis.invisible],
        "events": [_plain(event, start="start_s", end="end_s") for event in diagnosis.events],
        "experiment": _experiment(diagnosis.experiment),
        "detection": None if diagnosis.detection is None else _detection(diagnosis.detection),
        **_fields(diagnosis, "warnings", "seconds"),
        "files": files,
        "views": [_view(view) for view in diagnosis.views],
    }
    return cast("DiagnosisReport", finite(report))


def _plain(value: Any, **renamed: str) -> Any:
    """Return a dataclass as JSON has it; fields may have other names there, and those without a value are left out."""
    if isinstance(value, Interval):
        return {"value": value.value, "interval": [value.low, value.high]}
    if isinstance(value, np.ndarray):
        return [float(f"{number:.{DIGITS}g}") for number in value.astype(float).tolist()]
    if isinstance(value, tuple):
        return [_plain(part) for part in value]
    if is_dataclass(value):
        known = {field.name: getattr(value, field.name) for field in fields(value)}
        return {renamed.get(name, name): _plain(part) for name, part in known.items() if part is not None}
    return value


def _fields(source: Any, *names: str) -> dict[str, Any]:
    return {name: _plain(getattr(source, name)) for name in names}


def _where(where: found.Where) -> dict[str, Any]:
    return _fields(where, "effect", "joint", "tendon")


def _cause(cause: found.Cause, kind: str) -> dict[str, Any]:
    return {
        **_where(cause.where),
        **_fields(cause, "p_value", "gain", "gain_unit"),
        "confusable_with": [_where(other) for other in cause.confusable_with],
        **_numbers_of(cause.parameters, cause.intervals),
        **(_changed(cause.changed) if kind == "change" else {}),
        "places": [
            _fields(place, "joint", "tendon") | _numbers_of(place.parameters, cause.intervals) for place in cause.places
        ],
        **({"sensors": [_sensor(sensor) for sensor in cause.sensors]} if cause.sensors else {}),
        **_fields(cause, "size", "title", "explanation", "evidence"),
    }


def _sensor(sensor: found.Sensor) -> dict[str, Any]:
    return _where(sensor.where) | _fields(sensor, "correction", "unit")


def _changed(changed: found.ChangedSize | None) -> dict[str, Any]:
    """Return the main number in the reference and now; null where there is none, as for contact."""
    if changed is None:
        return {"reference": None, "now": None}
    return {
        **_fields(changed, "number", "unit"),
        "reference": changed.reference.value,
        "now": changed.now.value,
        "now_interval": [changed.now.low, changed.now.high],
        "change": _plain(changed.change),
        "by_recording": _plain(changed.by),
    }


def _numbers_of(parameters: Mapping[str, tuple[float, str]], intervals: Mapping[str, Interval]) -> dict[str, Any]:
    return {
        "parameters": {path: value for path, (value, _) in parameters.items()},
        "units": {path: unit for path, (_, unit) in parameters.items()},
        "intervals": {path: [intervals[path].low, intervals[path].high] for path in parameters if path in intervals},
    }


def _waterfall(diagnosis: found.Diagnosis) -> list[dict[str, Any]]:
    """List the rms over all joints on unseen data: of the nominal model, then after each cause."""
    names = names_of(diagnosis)
    steps = [(words_of(diagnosis.kind).nominal, found.Where("", None, None))]
    steps += [(found.at_place(cause.title, cause.where, names), cause.where) for cause in diagnosis.torque_causes]
    return [
        {"label": label, "effect": where.effect or None, "joint": where.joint, "tendon": where.tendon, "rms": rms}
        for (label, where), rms in zip(steps, diagnosis.steps, strict=True)
    ]


def _experiment(experiment: found.Experiment) -> dict[str, Any]:
    return {
        **_fields(experiment, "sentence", "distance"),
        "separates": [[_where(one), _where(other)] for one, other in experiment.separates],
        "makes_visible": [_where(where) for where in experiment.makes_visible],
        "motion": dict(experiment.motion),
    }


def _detection(gain: found.DetectionGain) -> dict[str, Any]:
    def of(when: str) -> dict[str, Any]:
        return {
            "found": getattr(gain, f"found_{when}"),
            "false_alarms": getattr(gain, f"false_alarms_{when}"),
            "median_delay_s": getattr(gain, f"median_delay_{when}"),
            "smallest_push": getattr(gain, f"smallest_push_{when}"),
        }

    return {"events": gain.events, "nominal": of("before"), "extended": of("after")}


def _view(view: found.ResidualView) -> dict[str, Any]:
    names = {"before": "nominal", "after": "extended", "before_std": "nominal_std"}
    return {"nominal_std": None, **_plain(view, **names)}
