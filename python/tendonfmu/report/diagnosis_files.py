"""Which files a diagnosis writes, and its report. The output folder gets all of them, or stays as it was.

The report is "tendonfmu-diagnosis-1" of docs/reference/commands/diagnose.md.
"""

from __future__ import annotations

import json
import os
import shutil
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from tendonfmu.arrays import Numbers
from tendonfmu.diagnosis import (
    Cause,
    ChangedSize,
    DetectionGain,
    Diagnosis,
    Evidence,
    Experiment,
    ResidualView,
    Where,
    reported_causes,
)
from tendonfmu.errors import OutputError, own_fault
from tendonfmu.files import (
    check_output,
    check_output_folder,
    finite,
    in_use,
    is_about,
    remove_left_behind,
    write_text,
)
from tendonfmu.fmu import build_fmu
from tendonfmu.model import description_text
from tendonfmu.report.diagnosis_page import PAGE, diagnosis_page
from tendonfmu.report.diagnosis_text import at_place, names_of
from tendonfmu.report.diagnosis_words import words_of
from tendonfmu.statistics import Interval
from tendonfmu.tasks import uninterrupted

FORMAT = "tendonfmu-diagnosis-1"
REPORT, NOMINAL, EXTENDED, EXTENDED_FMU = "diagnosis.json", "nominal.json", "extended.json", "extended.fmu"
DIGITS = 6  # significant digits of the curves
_SUFFIXES = (".html", ".json", ".fmu", ".png")  # .png: earlier versions wrote figures beside the page
_NAMED = (REPORT, EXTENDED, EXTENDED_FMU, PAGE, NOMINAL)


def check_folder(folder: Path, inputs: Sequence[Path]) -> None:
    """Check before a long computation that the results can be written to a folder."""
    check_output_folder(folder)
    if folder.is_dir():
        for name in _NAMED:
            check_output(folder / name, *inputs)


def write_diagnosis(diagnosis: Diagnosis, folder: Path) -> dict[Path, str]:
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


def _make_for(diagnosis: Diagnosis, folder: Path, named: Path) -> dict[Path, str]:
    """Make the files in a folder. A refusal tells the folder that the user has named."""
    try:
        return _make(diagnosis, folder)
    except OutputError as refused:
        raise OutputError(str(refused).replace(str(folder), str(named))) from None


@contextmanager
def _folder_beside(folder: Path) -> Iterator[Path]:
    """Make a temporary folder on the same disk. Its removal is not interrupted."""
    remove_left_behind(folder.absolute())
    name = tempfile.mkdtemp(dir=folder.absolute().parent, prefix=f".{folder.absolute().name}-")
    try:
        with in_use(Path(name)):
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
    names = {*_earlier(folder), *(file.name for file in ordered)}
    leaving = [(folder / name, old / name) for name in sorted(names) if (folder / name).is_file()]
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


def _make(diagnosis: Diagnosis, folder: Path) -> dict[Path, str]:
    """Write all files to an empty folder."""
    write_text(folder / PAGE, diagnosis_page(diagnosis))
    causes = len(diagnosis.causes)
    added = "nothing added" if causes == 0 else "its cause" if causes == 1 else f"its {causes} causes"
    for name, data in ((NOMINAL, diagnosis.nominal_data), (EXTENDED, diagnosis.extended_data)):
        write_text(folder / name, description_text(dict(data)))
    build_fmu(folder / EXTENDED, folder / EXTENDED_FMU, illustrated=False)  # drawing takes longer than all the rest
    files = {
        folder / PAGE: "all results, to be read in a browser",
        folder / REPORT: "the same numbers",
        folder / EXTENDED: f"the finger with {added}, fitted",
        folder / EXTENDED_FMU: "the same as an FMU",
        folder / NOMINAL: "the given structure, fitted",
    }
    write_text(folder / REPORT, report_text(build_report(diagnosis, [file.name for file in files])))
    return files


def _earlier(folder: Path) -> list[str]:
    """List the files that the report of an earlier diagnosis names, including figures of causes no longer found."""
    try:
        listed = json.loads((folder / REPORT).read_bytes())["files"]
    except (OSError, ValueError, KeyError, TypeError):
        return []
    texts = [name for name in listed if isinstance(name, str)] if isinstance(listed, list) else []
    return [name for name in texts if Path(name).name == name and Path(name).suffix in _SUFFIXES]


# --- the report -------------------------------------------------------------------------------------------------------


def build_report(diagnosis: Diagnosis, files: Sequence[str] = ()) -> dict[str, Any]:
    """Make the report of a diagnosis."""
    nominal, extended, unexplained = diagnosis.nominal, diagnosis.extended, diagnosis.unexplained
    report = {
        "format": FORMAT,
        "kind": diagnosis.kind,
        "verdict": diagnosis.verdict,
        "nominal": asdict(nominal) | {"bias_only_rms": diagnosis.bias_only_rms, "finger": NOMINAL},
        "extended": asdict(extended) | {"finger": EXTENDED, "fmu": EXTENDED_FMU},
        "noise_floor": diagnosis.noise_floor,
        "gain": _gain(diagnosis.gain),
        "causes": [_cause(cause, diagnosis.kind) for cause in reported_causes(diagnosis)],
        "too_small": [_cause(cause, diagnosis.kind) for cause in diagnosis.too_small],
        "unexplained": {
            **_fields(unexplained, "share", "description", "by_joint"),
            "gain": _gain(unexplained.gain),
        },
        "next_experiment": diagnosis.experiment.sentence,
        "waterfall": _waterfall(diagnosis),
        **_fields(diagnosis, "signals", "least_gain", "finger"),
        "joints": [joint.get("name") for joint in diagnosis.nominal_data["joints"]],
        "tendons": [tendon.get("name") for tendon in diagnosis.nominal_data["tendons"]],
        **_fields(
            diagnosis,
            *("references", "repeated", "recordings", "tests", "held_out", "seed", "tested", "floor_source"),
        ),
        "whiteness": [{"nominal": before, "extended": after} for before, after in diagnosis.whiteness],
        "invisible": [
            _where(effect.where)
            | _fields(effect, "title", "surviving_share", "ordinary_gain", "needed_gain", "experiment")
            for effect in diagnosis.invisible
        ],
        "events": [
            {"recording": event.recording, "start_s": event.start, "end_s": event.end}
            | _fields(event, "joints", "peak", "description")
            for event in diagnosis.events
        ],
        "experiment": _experiment(diagnosis.experiment),
        "detection": None if diagnosis.detection is None else _detection(diagnosis.detection),
        "warnings": diagnosis.warnings,
        "seconds": diagnosis.seconds,
        "files": files,
        "views": [_view(view) for view in diagnosis.views],
    }
    return {key: finite(value) for key, value in report.items()}


def report_text(report: Mapping[str, Any]) -> str:
    """Format a report as JSON. Each entry of a list of objects and each curve is on a line of its own."""
    parts = []
    for key, value in report.items():
        listed = isinstance(value, list) and any(isinstance(entry, dict) for entry in value)
        text = "[\n  " + ",\n  ".join(_entry(entry) for entry in value) + "]" if listed else _in_line(value)
        parts.append(f" {json.dumps(key)}: {text}")
    return "{\n" + ",\n".join(parts) + "\n}\n"


def _entry(entry: Mapping[str, Any]) -> str:
    if "evidence" not in entry:
        return _in_line(entry)
    return "{" + ",\n   ".join(f"{json.dumps(key)}: {_in_line(value)}" for key, value in entry.items()) + "}"


def _in_line(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False, allow_nan=False)


def _fields(source: Any, *names: str) -> dict[str, Any]:
    return {name: getattr(source, name) for name in names}


def _gain(gain: Interval) -> dict[str, Any]:
    return {"value": gain.value, "interval": [gain.low, gain.high]}


def _where(where: Where) -> dict[str, Any]:
    return _fields(where, "effect", "joint", "tendon")


def _cause(cause: Cause, kind: str) -> dict[str, Any]:
    return {
        **_where(cause.where),
        "p_value": cause.p_value,
        "gain": _gain(cause.gain),
        "confusable_with": [_where(other) for other in cause.confusable_with],
        **_numbers_of(cause.parameters),
        **(_changed(cause.changed) if kind == "change" else {}),
        "places": [_fields(place, "joint", "tendon") | _numbers_of(place.parameters) for place in cause.places],
        **_fields(cause, "size", "title", "explanation"),
        "evidence": [_evidence(evidence) for evidence in cause.evidence],
    }


def _changed(changed: ChangedSize | None) -> dict[str, Any]:
    """Return the main number in the reference and now; null where there is none, as for contact."""
    if changed is None:
        return {"reference": None, "now": None}
    return {
        **_fields(changed, "number", "unit"),
        "reference": changed.reference.value,
        "now": changed.now.value,
        "now_interval": [changed.now.low, changed.now.high],
        "change": _gain(changed.change),
        "by_recording": [_gain(size) for size in changed.by],
    }


def _numbers_of(parameters: Mapping[str, tuple[float, str]]) -> dict[str, Any]:
    return {
        "parameters": {path: value for path, (value, _) in parameters.items()},
        "units": {path: unit for path, (_, unit) in parameters.items()},
    }


def _waterfall(diagnosis: Diagnosis) -> list[dict[str, Any]]:
    """List the rms over all joints on unseen data: of the nominal model, then after each cause."""
    names = names_of(diagnosis)
    steps = [(words_of(diagnosis.kind).nominal, Where("", None, None))]
    steps += [(at_place(cause.title, cause.where, names), cause.where) for cause in diagnosis.causes]
    return [
        {"label": label, "effect": where.effect or None, "joint": where.joint, "tendon": where.tendon, "rms": rms}
        for (label, where), rms in zip(steps, diagnosis.steps, strict=True)
    ]


def _evidence(evidence: Evidence) -> dict[str, Any]:
    names = ["coordinate", "before", "after", "before_std", "after_std"]
    names += ["reference", "reference_std"] if evidence.reference is not None else []
    curves = {name: _listed(getattr(evidence, name)) for name in names}
    return _fields(evidence, "joint", "label", "unit") | curves


def _experiment(experiment: Experiment) -> dict[str, Any]:
    return {
        "sentence": experiment.sentence,
        "separates": [[_where(one), _where(other)] for one, other in experiment.separates],
        "makes_visible": [_where(where) for where in experiment.makes_visible],
        "distance": experiment.distance,
        "motion": dict(experiment.motion),
    }


def _detection(gain: DetectionGain) -> dict[str, Any]:
    def of(when: str) -> dict[str, Any]:
        return {
            "found": getattr(gain, f"found_{when}"),
            "false_alarms": getattr(gain, f"false_alarms_{when}"),
            "median_delay_s": getattr(gain, f"median_delay_{when}"),
            "thresholds": getattr(gain, f"thresholds_{when}"),
        }

    return {"events": gain.events, "nominal": of("before"), "extended": of("after")}


def _view(view: ResidualView) -> dict[str, Any]:
    return {
        **_fields(view, "joint", "kind", "label", "unit"),
        "x": _listed(view.x),
        "nominal": _listed(view.before),
        "extended": _listed(view.after),
        "nominal_std": None if view.before_std is None else _listed(view.before_std),
    }


def _listed(values: Numbers) -> list[float]:
    return [float(f"{value:.{DIGITS}g}") for value in np.asarray(values, dtype=float).tolist()]
