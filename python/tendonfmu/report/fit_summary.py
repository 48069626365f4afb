"""What a fit says on the first screen of its page.

Plain sentences, the main figures, tables of residuals and of numbers. All values come from the report.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from tendonfmu.estimate import FitPicture, identifiability, verdicts
from tendonfmu.files import counted
from tendonfmu.report.page import Tile

_METHODS = {
    "batch": "Maximum likelihood over all samples at once (batch)",
    "ekf": "The extended Kalman filter of the paper (ekf), sample by sample",
}
_LIMIT = f"{100 * identifiability.LIMIT:.0f}\u00a0%"
_COMPARED = "Not trained on: "
_GROUP = re.compile(r"(joints|tendons)\[(\d+)\]\.?(.*)")


@dataclass(frozen=True)
class ResidualRow:
    """Residuals of one joint, or of all together."""

    name: str  # name of the joint, or of the set of data
    torque: float | None  # rms in `ResidualTable.unit`; None where unknown
    start: float | None
    bias_only: float | None
    model_only: float | None
    fitted: float | None
    left: float | None  # residual over torque


@dataclass(frozen=True)
class ResidualTable:
    """Residuals of one set of data, a row per joint; or of all sets if the finger has one joint."""

    title: str  # heading
    unit: str  # unit of the torques
    rows: list[ResidualRow]  # residuals by joint (or by set of data)
    all: ResidualRow  # all joints together


@dataclass(frozen=True)
class Doubt:
    """Numbers that the data do not identify for one reason."""

    reason: str  # why not
    numbers: list[Mapping[str, Any]]  # entries of the report


@dataclass(frozen=True)
class Told:
    """Standard deviation of a friction torque, and how well `contact.uncertainty` reproduces it."""

    std: float
    error: float | None  # rms and 99 % quantile of the error as shares; None where the standard deviation is 0
    worst: float | None


@dataclass(frozen=True)
class UncertaintyRow:
    """What is unknown of a joint's modelled friction torque."""

    joint: str  # name of the joint
    inflation: float  # the residuals count as this many times the noise that the description states
    directions: int  # how many directions are kept
    captured: float  # their share of the variance, before the variance that they leave out is added back
    sets: list[Told | None]  # training data, held-out data, more load; None without data


@dataclass(frozen=True)
class NumberGroup:
    """All estimated numbers of one joint or tendon."""

    name: str  # name of the joint or tendon
    identified: int  # how many of its numbers are identified
    numbers: list[tuple[str, Mapping[str, Any]]]  # (path without the joint or tendon, entry of the report)


@dataclass(frozen=True)
class Summary:
    """Everything on the page of a fit that is not a figure."""

    state: str
    sentences: list[str]
    tiles: list[Tile]
    residuals: list[ResidualTable]
    doubts: list[Doubt]
    groups: list[NumberGroup]
    consistency: list[str]
    uncertainty: list[UncertaintyRow]


def summarise(picture: FitPicture) -> Summary:
    """Summarise a fit from its report and descriptions."""
    report = picture.report
    tables = list(residual_tables(picture))
    return Summary(
        state=_state(report),
        sentences=[*_what(picture), *_how(report), *_how_well(tables), _known(report)],
        tiles=_tiles(report, tables),
        residuals=tables if len(picture.joint_names) > 1 else _joined(picture.joint_names[0], tables),
        doubts=_doubts(report),
        groups=_groups(picture),
        consistency=_consistency(picture),
        uncertainty=_uncertainty(picture),
    )


def _state(report: Mapping[str, Any]) -> str:
    """Say what is wrong with the fit; empty if nothing is."""
    if not report["finished"]:
        return "Unfinished: the fit was interrupted. These are the best values so far."
    return "" if report["converged"] else "Not converged: the values may still change with more iterations."


# --- residuals --------------------------------------------------------------------------------------------------------


def residual_tables(picture: FitPicture) -> Iterator[ResidualTable]:
    """List the residuals of a fit by set of data."""
    residual = picture.report["residual"]
    sets = [("Training", residual["train"]), ("Held out of training", residual.get("held_out"))]
    sets += [(f"{_COMPARED}{each['label']}", each) for each in residual.get("comparisons") or []]
    for title, found in sets:
        if found and found.get("rms"):
            yield _table(title, found, picture.joint_names)


def _table(title: str, found: Mapping[str, Any], joints: Sequence[str]) -> ResidualTable:
    keys = ("torque_rms", "start_rms", "bias_only_rms", "model_only_rms", "rms")
    columns = [[math.nan if value is None else float(value) for value in found.get(key) or []] for key in keys]
    factor, unit = (1e3, "mN·m") if max(columns[0], default=0.0) < 2.0 else (1.0, "N·m")
    rows = [[column[j] if j < len(column) else math.nan for column in columns] for j in range(len(joints))]
    rows.append([_together(column) for column in columns])
    found_rows = []
    for name, (torque, *others) in zip([*joints, "all joints"], rows, strict=True):
        start, bias_only, model_only, fitted = (_known_or_none(factor * value) for value in others)
        left = _known_or_none(others[-1] / torque) if torque > 0 else None
        found_rows.append(
            ResidualRow(name, _known_or_none(factor * torque), start, bias_only, model_only, fitted, left)
        )
    return ResidualTable(title, unit, found_rows if len(joints) > 1 else found_rows[:1], found_rows[-1])


def _joined(joint: str, tables: Sequence[ResidualTable]) -> list[ResidualTable]:
    """Join the tables of a finger with one joint, a row per set of data; tables in other units stay separate."""
    by_unit: dict[str, list[ResidualRow]] = {}
    for table in tables:
        by_unit.setdefault(table.unit, []).append(replace(table.all, name=table.title))
    return [ResidualTable(joint, unit, rows, rows[0]) for unit, rows in by_unit.items()]


def _together(values: Sequence[float]) -> float:
    """Return the rms over all joints from the rms of each."""
    return math.sqrt(sum(value * value for value in values) / len(values)) if values else math.nan


def _known_or_none(value: float) -> float | None:
    return value if math.isfinite(value) else None


# --- sentences --------------------------------------------------------------------------------------------------------


def _what(picture: FitPicture) -> Iterator[str]:
    report, recordings = picture.report, picture.report["recordings"]
    seconds = sum(each["duration"] or 0.0 for each in recordings)
    used, held = (sum(each[key] for each in recordings) for key in ("used", "held_out"))
    one = len(recordings) == 1
    source = f"one recording of {seconds:.4g} s" if one else f"{len(recordings)} recordings of {seconds:.4g} s together"
    finger = f"{counted(len(picture.joint_names), 'joint')}, {counted(len(picture.tendon_names), 'tendon')}"
    sentence = (
        f"{report['identified']['of']} numbers of the friction of {report['finger']} ({finger}) were estimated at once "
        f"from {source}: {_thousands(used)} samples"
    )
    yield sentence + (f"; {_thousands(held)} more were held out to judge the result." if held else ".")
    out = sum(each.get("contact_left_out") or 0 for each in recordings)
    if out:
        samples = "sample with contact was" if out == 1 else "samples with contact were"
        yield f"{_thousands(out)} {samples} left out."


def _thousands(number: int) -> str:
    return f"{number:,}".replace(",", "\u202f")


def _how(report: Mapping[str, Any]) -> Iterator[str]:
    method = _METHODS.get(report["method"], str(report["method"]))
    rounds = "" if report["method"] == "ekf" else f", {counted(report['passes'], 'pass', 'passes')} over the data"
    yield f"{method}{rounds}, {report['seconds']:.3g} s."


def _how_well(tables: Sequence[ResidualTable]) -> Iterator[str]:
    few, many = _apart(tables)
    for table in few:
        row = table.all
        if row.fitted is None or row.left is None or not row.torque:
            continue
        amounts = f"{rounded(row.fitted)} of {rounded(row.torque)} {table.unit}"
        text = f"{table.title}: {amounts} of torque are left, {_percent(row.left)}"
        if row.start is not None:
            text += f"; with the starting values {_percent(row.start / row.torque)}"
        if table is tables[0] and row.bias_only is not None and row.model_only is not None:
            text += (
                f". The bias alone, without friction, leaves {_percent(row.bias_only / row.torque)}; the friction "
                f"alone, with a constant bias, {_percent(row.model_only / row.torque)}"
            )
        yield text + "."
    if many:
        yield f"{counted(len(many), 'recording')} not trained on: {_range(many)} of the torque are left."


def _apart(tables: Sequence[ResidualTable]) -> tuple[list[ResidualTable], list[ResidualTable]]:
    """Split tables into those described one by one and comparisons that are too many for that."""
    compared = [table for table in tables if table.title.startswith(_COMPARED)]
    if len(compared) <= 2:
        return list(tables), []
    return [table for table in tables if table not in compared], compared


def _range(tables: Sequence[ResidualTable]) -> str:
    found = [table.all.left for table in tables if table.all.left is not None]
    return f"{_percent(min(found))} to {_percent(max(found))}" if found else "an unknown share"


def rounded(value: float | None, digits: int = 3) -> str:
    """Format a number for a column of numbers to compare."""
    if value is None or not math.isfinite(value):
        return "–"
    whole = len(str(int(abs(value)))) if abs(value) >= 1 else 0
    return f"{value:.{max(digits - whole, 0)}f}"


def _percent(share: float) -> str:
    return f"{100 * share:.0f}\u00a0%" if share >= 0.0995 else f"{100 * share:.1f}\u00a0%"


def _known(report: Mapping[str, Any]) -> str:
    count, of = report["identified"]["count"], report["identified"]["of"]
    if count == of:
        return f"All {of} numbers are identified: their standard errors are at most {_LIMIT} of their values."
    return (
        f"{count} of {of} numbers are identified: their standard errors are at most {_LIMIT} of their values. What "
        f"would identify the {'last one' if of - count == 1 else f'other {of - count}'} is listed below."
    )


def _tiles(report: Mapping[str, Any], tables: Sequence[ResidualTable]) -> list[Tile]:
    few, many = _apart(tables)
    tiles = [
        Tile(_percent(table.all.left), "", f"of the torque is left: {table.title[0].lower() + table.title[1:]}")
        for table in few
        if table.all.left is not None
    ]
    if many:
        tiles.append(Tile(_range(many), "", f"of the torque is left in {len(many)} recordings not trained on"))
    if tables and tables[0].all.bias_only is not None and tables[0].all.torque:
        tiles.append(
            Tile(_percent(tables[0].all.bias_only / tables[0].all.torque), "", "would be left by the bias alone")
        )
    return [*tiles, Tile(f"{report['identified']['count']}/{report['identified']['of']}", "", "numbers identified")]


def _consistency(picture: FitPicture) -> list[str]:
    """Describe the size (NIS) and whiteness of the innovations in words."""
    found = picture.report["innovations"]
    nis, lag_one = found["nis"], found["whiteness"]["lag_one"]
    sentences = []
    if nis.get("mean") is not None:
        low, high = nis["interval"]
        if nis["consistent"]:
            meaning = "as large as the noise that the description states"
        else:
            size, far = ("larger", "small") if nis["mean"] > 1 else ("smaller", "large")
            meaning = (
                f"{size} than the noise that the description states, by a factor of {math.sqrt(nis['mean']):.2g}; this "
                f"alone makes the standard errors too {far} by about the same factor"
            )
        sentences.append(
            f"Mean squared standardised innovation (NIS) {nis['mean']:.3g}; expected 1, in 95 % of cases between "
            f"{low:.4g} and {high:.4g}. The innovations are {meaning}."
        )
    strong = [
        f"{name} {value:.2f}"
        for name, value in zip(picture.joint_names, lag_one, strict=True)
        if value is not None and abs(value) > 0.1
    ]
    if strong:
        sentences.append(
            f"Autocorrelation from sample to sample: {', '.join(strong)}. White innovations have none. The residual "
            f"has a shape in time that the model lacks; {_counted(found)}."
        )
    return sentences


def _counted(innovations: Mapping[str, Any]) -> str:
    effective = innovations.get("effective") or {"samples": [0.0], "worth": [0.0]}
    samples, worth = sum(effective["samples"]), sum(effective["worth"])
    if worth < samples:
        return f"estimates and standard errors count the {samples:.0f} samples as {worth:.0f}"
    return "the standard errors count each sample as new"


def _uncertainty(picture: FitPicture) -> list[UncertaintyRow]:
    """List what is unknown of the friction torque, a row per joint; empty where it was not computed."""
    found = picture.report.get("uncertainty")
    if not found:
        return []
    sets = [found[name] for name in ("train", "held_out", "loaded")]
    return [
        UncertaintyRow(
            joint=joint,
            inflation=found["inflation"][j],
            directions=found["directions"][j],
            captured=found["captured"][j],
            sets=[
                _told(each["std"][j], each["error_rms"][j], each["error_worst"][j]) if each else None for each in sets
            ],
        )
        for j, joint in enumerate(picture.joint_names)
    ]


def _told(std: float, error: float, worst: float) -> Told:
    return Told(1e3 * std, error / std if std else None, worst / std if std else None)


# --- numbers ----------------------------------------------------------------------------------------------------------


def _doubts(report: Mapping[str, Any]) -> list[Doubt]:
    """List the numbers that are not identified by reason, most frequent first."""
    by_reason: dict[str, list[Mapping[str, Any]]] = {}
    for entry in report["parameters"]:
        if not entry["identified"]:
            by_reason.setdefault(entry.get("reason") or "unknown", []).append(entry)
    ordered = sorted(by_reason.items(), key=lambda item: -len(item[1]))
    return [Doubt(verdicts.CAUSES.get(reason, reason), numbers) for reason, numbers in ordered]


def _groups(picture: FitPicture) -> list[NumberGroup]:
    """List all numbers by joint and tendon, in the order of the report."""
    found: dict[str, list[tuple[str, Mapping[str, Any]]]] = {}
    for entry in picture.report["parameters"]:
        match = _GROUP.fullmatch(entry["path"])
        if match is None:
            found.setdefault("Others", []).append((entry["path"], entry))
            continue
        names = picture.joint_names if match[1] == "joints" else picture.tendon_names
        number = int(match[2])
        found.setdefault(f"{match[1][:-1].capitalize()} {number}: {names[number - 1]}", []).append((match[3], entry))
    return [
        NumberGroup(name, sum(bool(entry["identified"]) for _, entry in numbers), numbers)
        for name, numbers in found.items()
    ]
