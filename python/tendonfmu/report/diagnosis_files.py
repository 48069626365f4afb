"""Which files a diagnosis writes, and its report. A full disk leaves the output folder as it was.

The report is "tendonfmu-diagnosis-1" of docs/reference/commands/diagnose.md.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any, cast

import numpy as np

from tendonfmu import diagnosis as found
from tendonfmu.errors import own_fault
from tendonfmu.files import check_output_folder, finite, report_text, write_files
from tendonfmu.fmu import members, pack
from tendonfmu.model import description_text, finger_from_text
from tendonfmu.report.diagnosis_page import PAGE, diagnosis_page
from tendonfmu.report.diagnosis_text import names_of
from tendonfmu.report.diagnosis_types import DiagnosisReport
from tendonfmu.report.kit import words_of
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
    with own_fault("the files of the diagnosis"):
        page = diagnosis_page(diagnosis).encode()
        nominal, extended = (
            description_text(dict(data)).encode() for data in (diagnosis.nominal_data, diagnosis.extended_data)
        )
        fmu = pack(members(finger_from_text(Path(EXTENDED), extended)))
    causes = len(diagnosis.causes)
    added = "no cause added" if causes == 0 else "its cause added" if causes == 1 else f"its {causes} causes added"
    what = {
        PAGE: "all results, to be read in a browser",
        REPORT: "the same numbers",
        EXTENDED: f"the finger with {added}, fitted",
        EXTENDED_FMU: "the same as an FMU",
        NOMINAL: "the given model, fitted",
    }
    report = report_text(build_report(diagnosis, list(what))).encode()
    contents = {REPORT: report, PAGE: page, EXTENDED: extended, EXTENDED_FMU: fmu, NOMINAL: nominal}
    with uninterrupted():
        write_files(folder, contents)
    return {folder / name: words for name, words in what.items()}


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
    sensors = [_where(sensor.where) | _fields(sensor, "correction", "unit") for sensor in cause.sensors]
    return {
        **_where(cause.where),
        **_fields(cause, "p_value", "gain", "gain_unit"),
        "confusable_with": [_where(other) for other in cause.confusable_with],
        **_numbers_of(cause.parameters, cause.intervals),
        **(_changed(cause.changed) if kind == "change" else {}),
        "places": [
            _fields(place, "joint", "tendon") | _numbers_of(place.parameters, cause.intervals) for place in cause.places
        ],
        **({"sensors": sensors} if sensors else {}),
        **_fields(cause, "size", "title", "explanation", "evidence"),
    }


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
