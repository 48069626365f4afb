"""What `diagnosis.json` contains: the report "tendonfmu-diagnosis-1" of docs/reference/commands/diagnose.md."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu.diagnosis import (
    Cause,
    ChangedSize,
    DetectionGain,
    Diagnosis,
    Event,
    Evidence,
    Experiment,
    FoundPlace,
    Invisible,
    ResidualView,
    Where,
    reported_causes,
)
from tendonfmu.files import finite
from tendonfmu.report.diagnosis_text import at_place, names_of
from tendonfmu.report.diagnosis_words import words_of
from tendonfmu.statistics import Interval

FORMAT = "tendonfmu-diagnosis-1"
REPORT, NOMINAL, EXTENDED, EXTENDED_FMU = "diagnosis.json", "nominal.json", "extended.json", "extended.fmu"
DIGITS = 6  # significant digits of the curves


def build_report(found: Diagnosis, files: Sequence[str] = ()) -> dict[str, Any]:
    """Make the report of a diagnosis."""
    report = {
        "format": FORMAT,
        "kind": found.kind,
        "verdict": found.verdict,
        "nominal": {
            "train_rms": found.nominal.train_rms,
            "test_rms": found.nominal.test_rms,
            "bias_only_rms": found.bias_only_rms,
            "finger": NOMINAL,
        },
        "extended": {
            "train_rms": found.extended.train_rms,
            "test_rms": found.extended.test_rms,
            "finger": EXTENDED,
            "fmu": EXTENDED_FMU,
        },
        "noise_floor": found.noise_floor,
        "gain": _gain(found.gain),
        "causes": [_cause(cause, found.kind) for cause in reported_causes(found)],
        "too_small": [_cause(cause, found.kind) for cause in found.too_small],
        "unexplained": {
            "share": found.unexplained.share,
            "description": found.unexplained.description,
            "by_joint": found.unexplained.by_joint,
            "gain": _gain(found.unexplained.gain),
        },
        "next_experiment": found.experiment.sentence,
        "waterfall": _waterfall(found),
        "signals": found.signals,
        "least_gain": found.least_gain,
        "finger": found.finger,
        "joints": [joint.get("name") for joint in found.nominal_data["joints"]],
        "tendons": [tendon.get("name") for tendon in found.nominal_data["tendons"]],
        "references": found.references,
        "repeated": found.repeated,
        "recordings": found.recordings,
        "tests": found.tests,
        "held_out": found.held_out,
        "seed": found.seed,
        "tested": found.tested,
        "floor_source": found.floor_source,
        "whiteness": [{"nominal": before, "extended": after} for before, after in found.whiteness],
        "invisible": [_invisible(each) for each in found.invisible],
        "events": [_event(event) for event in found.events],
        "experiment": _experiment(found.experiment),
        "detection": None if found.detection is None else _detection(found.detection),
        "warnings": found.warnings,
        "seconds": found.seconds,
        "files": files,
        "views": [_view(view) for view in found.views],
    }
    return {key: finite(value) for key, value in report.items()}


def report_text(report: Mapping[str, Any]) -> str:
    """Format a report as JSON. Each entry of a list of objects and each curve is on a line of its own."""
    parts = []
    for key, value in report.items():
        listed = isinstance(value, list) and any(isinstance(each, dict) for each in value)
        text = "[\n  " + ",\n  ".join(_entry(each) for each in value) + "]" if listed else _flat(value)
        parts.append(f" {json.dumps(key)}: {text}")
    return "{\n" + ",\n".join(parts) + "\n}\n"


def _entry(entry: Mapping[str, Any]) -> str:
    if "evidence" not in entry:
        return _flat(entry)
    return "{" + ",\n   ".join(f"{json.dumps(key)}: {_flat(value)}" for key, value in entry.items()) + "}"


def _flat(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False, allow_nan=False)


# --- parts ------------------------------------------------------------------------------------------------------------


def _gain(found: Interval) -> dict[str, Any]:
    return {"value": found.value, "interval": [found.low, found.high]}


def _where(where: Where) -> dict[str, Any]:
    return {"effect": where.effect, "joint": where.joint, "tendon": where.tendon}


def _cause(cause: Cause, kind: str) -> dict[str, Any]:
    return {
        **_where(cause.where),
        "p_value": cause.p_value,
        "gain": _gain(cause.gain),
        "confusable_with": [_where(other) for other in cause.confusable_with],
        **_numbers_of(cause.parameters),
        **(_changed(cause.changed) if kind == "change" else {}),
        "places": [_place(each) for each in cause.places],
        "size": cause.size,
        "title": cause.title,
        "explanation": cause.explanation,
        "evidence": [_evidence(each) for each in cause.evidence],
    }


def _changed(found: ChangedSize | None) -> dict[str, Any]:
    """Return the main number in the reference and now; null where there is none, as for contact."""
    if found is None:
        return {"reference": None, "now": None}
    return {
        "number": found.number,
        "unit": found.unit,
        "reference": found.reference.value,
        "now": found.now.value,
        "now_interval": [found.now.low, found.now.high],
        "change": {"value": found.change.value, "interval": [found.change.low, found.change.high]},
        "by_recording": [_gain(each) for each in found.by],
    }


def _place(found: FoundPlace) -> dict[str, Any]:
    return {"joint": found.joint, "tendon": found.tendon, **_numbers_of(found.parameters)}


def _numbers_of(parameters: Mapping[str, tuple[float, str]]) -> dict[str, Any]:
    return {
        "parameters": {path: value for path, (value, _) in parameters.items()},
        "units": {path: unit for path, (_, unit) in parameters.items()},
    }


def _waterfall(found: Diagnosis) -> list[dict[str, Any]]:
    """List the rms over all joints on unseen data: of the nominal model, then after each cause."""
    names = names_of(found)
    steps = [(words_of(found.kind).nominal, Where("", None, None))]
    steps += [(at_place(cause.title, cause.where, names), cause.where) for cause in found.causes]
    return [
        {"label": label, "effect": where.effect or None, "joint": where.joint, "tendon": where.tendon, "rms": rms}
        for (label, where), rms in zip(steps, found.steps, strict=True)
    ]


def _evidence(found: Evidence) -> dict[str, Any]:
    names = ["coordinate", "before", "after", "before_std", "after_std"]
    names += ["reference", "reference_std"] if found.reference is not None else []
    curves = {name: _numbers(getattr(found, name)) for name in names}
    return {"joint": found.joint, "label": found.label, "unit": found.unit, **curves}


def _invisible(found: Invisible) -> dict[str, Any]:
    return {
        **_where(found.where),
        "title": found.title,
        "surviving_share": found.surviving_share,
        "ordinary_gain": found.ordinary_gain,
        "needed_gain": found.needed_gain,
        "experiment": found.experiment,
    }


def _event(event: Event) -> dict[str, Any]:
    return {
        "recording": event.recording,
        "start_s": event.start,
        "end_s": event.end,
        "joints": event.joints,
        "peak": event.peak,
        "description": event.description,
    }


def _experiment(found: Experiment) -> dict[str, Any]:
    return {
        "sentence": found.sentence,
        "separates": [[_where(one), _where(other)] for one, other in found.separates],
        "makes_visible": [_where(where) for where in found.makes_visible],
        "distance": found.distance,
        "motion": dict(found.motion),
    }


def _detection(found: DetectionGain) -> dict[str, Any]:
    def of(when: str) -> dict[str, Any]:
        return {
            "found": getattr(found, f"found_{when}"),
            "false_alarms": getattr(found, f"false_alarms_{when}"),
            "median_delay_s": getattr(found, f"median_delay_{when}"),
            "thresholds": getattr(found, f"thresholds_{when}"),
        }

    return {"events": found.events, "nominal": of("before"), "extended": of("after")}


def _view(view: ResidualView) -> dict[str, Any]:
    return {
        "joint": view.joint,
        "kind": view.kind,
        "label": view.label,
        "unit": view.unit,
        "x": _numbers(view.x),
        "nominal": _numbers(view.before),
        "extended": _numbers(view.after),
        "nominal_std": None if view.before_std is None else _numbers(view.before_std),
    }


def _numbers(values: NDArray[np.float64]) -> list[float]:
    return [float(f"{value:.{DIGITS}g}") for value in np.asarray(values, dtype=float).tolist()]
