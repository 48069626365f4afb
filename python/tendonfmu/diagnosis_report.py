"""The report of a diagnosis, "tendonfmu-diagnosis-1" (contract section 7), as JSON with null for what is not known."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu.contact_scan import LEVEL as SCAN_LEVEL
from tendonfmu.diagnosis_result import (
    Cause,
    DetectionGain,
    Diagnosis,
    Event,
    Evidence,
    Experiment,
    Interval,
    Invisible,
    ResidualView,
    Where,
)
from tendonfmu.finite_numbers import finite

FORMAT = "tendonfmu-diagnosis-1"
REPORT, NOMINAL, EXTENDED, EXTENDED_FMU = "diagnosis.json", "nominal.json", "extended.json", "extended.fmu"
DIGITS = 6  # of what is drawn
UNMENDED = {
    "contact": "the recording is not free of contact",
    "unknown": "something that no effect of the list explains",
}
CONTACT = 6.0  # nominal residuals rms that an event's peak is, at least, to be called contact among the causes


def build_report(found: Diagnosis, files: Sequence[str] = ()) -> dict[str, Any]:
    """The whole report: the contract's keys first. files: names of what stands beside it."""
    report = {
        "format": FORMAT,
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
        "causes": [*(_cause(cause) for cause in found.causes), *_without_a_term(found)],
        "unexplained": {
            "share": found.unexplained.share,
            "description": found.unexplained.description,
            "by_joint": found.unexplained.by_joint,
        },
        "next_experiment": found.experiment.sentence,
        "finger": found.finger,
        "joints": [joint.get("name") for joint in found.nominal_data["joints"]],
        "tendons": [tendon.get("name") for tendon in found.nominal_data["tendons"]],
        "recordings": found.recordings,
        "tests": found.tests,
        "held_out": found.held_out,
        "seed": found.seed,
        "tested": found.tested,
        "floor_source": found.floor_source,
        "ceiling": found.ceiling,
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
    """JSON with an entry of a list of objects, or a curve of what is drawn, on one line each."""
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


def _cause(cause: Cause) -> dict[str, Any]:
    return {
        **_where(cause.where),
        "p_value": cause.p_value,
        "gain": _gain(cause.gain),
        "confusable_with": [_where(other) for other in cause.confusable_with],
        "parameters": {path: value for path, (value, _) in cause.parameters.items()},
        "units": {path: unit for path, (_, unit) in cause.parameters.items()},
        "size": cause.size,
        "title": cause.title,
        "explanation": cause.explanation,
        "share": cause.share,
        "first_gain": None if cause.first_gain is None else _gain(cause.first_gain),
        "evidence": [_evidence(each) for each in cause.evidence],
    }


def _without_a_term(found: Diagnosis) -> list[dict[str, Any]]:
    """`contact` and `unknown`, which no term of the model mends: they gain nothing."""
    causes = []
    events = [event for event in found.events if event.peak >= CONTACT * max(found.nominal.train_rms)]
    if events:
        joints = {joint for event in events for joint in event.joints}
        joint = joints.pop() if len(joints) == 1 else None
        causes.append(_unmended("contact", joint, SCAN_LEVEL, events[0].description))
    if found.unexplained.unknown:
        shares = found.unexplained.by_joint
        largest = int(np.argmax(shares)) + 1 if any(shares) else None
        causes.append(_unmended("unknown", largest, found.unexplained.p_value, found.unexplained.description))
    return causes


def _unmended(effect: str, joint: int | None, p_value: float, size: str) -> dict[str, Any]:
    return {
        **_where(Where(effect, joint)),
        "p_value": p_value,
        "gain": _gain(Interval(0.0, 0.0, 0.0)),
        "confusable_with": [],
        "parameters": {},
        "units": {},
        "size": size,
        "title": UNMENDED[effect],
        "explanation": "",
        "share": 0.0,
        "first_gain": None,
        "evidence": [],
    }


def _evidence(found: Evidence) -> dict[str, Any]:
    names = ("coordinate", "before", "after", "before_std", "after_std")
    curves = {name: _numbers(getattr(found, name)) for name in names}
    return {"joint": found.joint, "label": found.label, "unit": found.unit, **curves}


def _invisible(found: Invisible) -> dict[str, Any]:
    return {
        **_where(found.where),
        "title": found.title,
        "surviving_share": found.surviving_share,
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
