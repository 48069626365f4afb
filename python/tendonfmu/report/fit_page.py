"""How a fit reads: tables and lines for the terminal, and its page, `report.html`."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tendonfmu.estimate import (
    Comparison,
    FitPicture,
    FitReport,
    Fitted,
    FittedNumber,
    FrictionFit,
    ResidualRms,
    identifiability,
    known_numbers,
    verdicts,
)
from tendonfmu.files import are, counted, write_files
from tendonfmu.model import Finger, effects, part_of
from tendonfmu.recordings import RecordingEntry
from tendonfmu.report.fit_figures import fit_sheets
from tendonfmu.report.kit import Row, Table, Tile, column, percent, render, rounded, together, torque_unit, unit_text

PAGE = "report.html"
TILES = 4  # sets of data whose error has a tile
EXAMPLES = 3  # paths listed for each reason
_METHODS = {
    "batch": "Maximum likelihood over all samples at once (batch)",
    "ekf": "The extended Kalman filter of the paper (ekf), sample by sample",
}
_LIMIT = f"{100 * identifiability.LIMIT:.0f}\u00a0%"


# --- residuals --------------------------------------------------------------------------------------------------------


RESIDUAL_HEADINGS = ("torque", "fitted", "left", "before the fit", "bias alone", "friction alone")


@dataclass(frozen=True)
class ResidualRow:
    """Residuals of one joint, or of all together: rms in `ResidualTable.unit`, None where unknown."""

    name: str  # of the joint, or of the set of data
    torque: float | None
    fitted: float | None
    start: float | None
    bias_only: float | None
    model_only: float | None

    @property
    def left(self) -> float | None:
        """Return the residual over the torque."""
        return self.share(self.fitted)

    def share(self, value: float | None) -> float | None:
        return value / self.torque if value is not None and self.torque else None

    @property
    def texts(self) -> Row:
        """Return the cells below `RESIDUAL_HEADINGS`."""
        left = "–" if self.left is None else f"{rounded(100 * self.left, 2)} %"
        others = map(rounded, (self.start, self.bias_only, self.model_only))
        return rounded(self.torque), rounded(self.fitted), left, *others


@dataclass(frozen=True)
class ResidualTable:
    """Residuals of one set of data, a row per joint; or of all sets if the finger has one joint."""

    title: str
    unit: str  # of the torques
    rows: list[ResidualRow]
    all: ResidualRow  # all joints together


def residual_tables(report: FitReport, joints: Sequence[str]) -> list[ResidualTable]:
    """List the residuals of a fit by set of data, all in one unit."""
    residual = report["residual"]
    sets: list[tuple[str, ResidualRms | Comparison | None]]
    sets = [("Training", residual["train"]), ("Held out of training", residual["held_out"])]
    sets += [(f"Not trained on: {run['label']}", run) for run in residual["comparisons"]]
    known = [(title, data) for title, data in sets if data and "rms" in data]
    factor, unit = torque_unit(max((max(column(data["torque_rms"])) for _, data in known), default=0.0))
    listed = []
    for title, data in known:
        figures = (data["torque_rms"], data["rms"], data["start_rms"], data["bias_only_rms"], data["model_only_rms"])
        columns = [column(each) for each in figures]
        rows = [
            ResidualRow(name, *(factor * value if math.isfinite(value) else None for value in values))
            for name, *values in zip(
                [*joints, "all joints"], *([*each, together(each)] for each in columns), strict=True
            )
        ]
        listed.append(ResidualTable(title, unit, rows if len(joints) > 1 else rows[:1], rows[-1]))
    return listed


# --- sentences of the page --------------------------------------------------------------------------------------------


def state_of(report: FitReport) -> str:
    """Say what is wrong with the fit; empty if nothing is."""
    if not report["finished"]:
        return "Unfinished: the fit was interrupted. These are the best values so far."
    return "" if report["converged"] else "Not converged: the values may still change with more iterations."


def summary_sentences(picture: FitPicture, tables: Sequence[ResidualTable]) -> Iterator[str]:
    """Say what was estimated, how, how well the model fits, and how well its numbers are known."""
    report = picture.report
    yield from _what(picture)
    method = _METHODS.get(report["method"], str(report["method"]))
    rounds = "" if report["method"] == "ekf" else f", {counted(report['passes'], 'pass', 'passes')} over the data"
    yield f"{method}{rounds}, {report['seconds']:.3g} s."
    yield from _how_well(tables)
    yield from report["routing"]["sentences"] if report["routing"] else ()
    yield from memory_sentences(report)
    yield report["given_numbers"]["paragraph"]
    count, of = report["identified"]["count"], report["identified"]["of"]
    kept = sum(entry["reason"] == "kept" for entry in report["parameters"])
    yield (
        f"{count} of {of} numbers are identified by these recordings: their standard errors are at most {_LIMIT} of "
        "their values, and at most half of what was known before."
    )
    if kept:
        yield f"{counted(kept, 'number')} {are(kept)} better known from the earlier fit than from these recordings."
    if count + kept < of:
        yield f"What would identify the other {of - count - kept} is listed below."
    yield from sums_known(picture.fitted)


def memory_sentences(report: FitReport) -> Iterator[str]:
    """Say which angles friction that remembers was fitted to, and what is left with them and as delivered."""
    memory = report["memory"]
    if memory:
        left, delivered = (
            ", ".join(f"{1e3 * value:.3g}" for value in column(values))
            for values in (memory["left"], memory["left_delivered"])
        )
        beside = "" if left == delivered else f"; {delivered} mN·m with the kinematics asked for"
        yield f"Fitted to the angles of {memory['angles']}: {left} mN·m by joint left without a learning bias{beside}."


def sums_known(finger: Finger) -> Iterator[str]:
    """Name the tendons whose friction is known in sum, but not at each of its places."""
    known = known_numbers(finger.data)
    for i, name in enumerate(finger.tendon_names, start=1):
        places = [effect.path for effect in effects(finger.data) if effect.tendon == i]
        if f"tendons[{i}]" in known and not all(path in known for path in places):
            value, error = known[f"tendons[{i}]"]
            yield (
                f"Coulomb friction of tendon {name}, all {counted(len(places), 'place')} together: "
                f"{rounded(100.0 * value, 2)} ± {rounded(100.0 * error, 1)} % of its force."
            )


def _what(picture: FitPicture) -> Iterator[str]:
    report, recordings = picture.report, picture.report["recordings"]
    seconds = sum(recording["duration"] or 0.0 for recording in recordings)
    used, held = (sum(recording[key] for recording in recordings) for key in ("used", "held_out"))
    one = len(recordings) == 1
    source = f"one recording of {seconds:.4g} s" if one else f"{len(recordings)} recordings of {seconds:.4g} s together"
    finger = (
        f"{counted(len(picture.fitted.joint_names), 'joint')}, {counted(len(picture.fitted.tendon_names), 'tendon')}"
    )
    sentence = (
        f"{report['identified']['of']} numbers of the friction of {report['finger']} ({finger}) were estimated "
        f"together from {source}: {_thousands(used)} samples"
    )
    yield sentence + (f"; {_thousands(held)} more were held out to judge the result." if held else ".")
    out = sum(recording.get("contact_left_out") or 0 for recording in recordings)
    if out:
        samples = "sample with contact was" if out == 1 else "samples with contact were"
        yield f"{_thousands(out)} {samples} left out."


def _thousands(number: int) -> str:
    return f"{number:,}".replace(",", "\u202f")


def _how_well(tables: Sequence[ResidualTable]) -> Iterator[str]:
    for table in tables:
        row = table.all
        if row.left is None:
            continue
        amounts = f"{rounded(row.fitted)} of {rounded(row.torque)} {table.unit}"
        text = f"{table.title}: {amounts} of torque are left, {percent(row.left)}"
        start, bias, model = (row.share(value) for value in (row.start, row.bias_only, row.model_only))
        if start is not None:
            text += f"; with the starting values {percent(start)}"
        if table is tables[0] and bias is not None and model is not None:
            text += (
                f". The bias alone, without friction, leaves {percent(bias)}; the friction alone, with a constant "
                f"bias, {percent(model)}"
            )
        yield text + "."


def consistency(picture: FitPicture) -> Iterator[str]:
    """Describe the size (NIS) and whiteness of the innovations in words."""
    innovations = picture.report["innovations"]
    nis, lag_one = innovations["nis"], innovations["whiteness"]["lag_one"]
    mean = nis["mean"]
    if mean is not None:
        low, high = nis["interval"]
        meaning = "as large as the noise that the description states"
        if not nis["consistent"]:
            size, far = ("larger", "small") if mean > 1 else ("smaller", "large")
            meaning = (
                f"{size} than the noise that the description states, by a factor of {math.sqrt(mean):.2g}; this "
                f"alone makes the standard errors too {far} by about the same factor"
            )
        yield (
            f"Mean squared standardised innovation (NIS) {mean:.3g}; expected 1, in 95 % of cases between "
            f"{low:.4g} and {high:.4g}. The innovations are {meaning}."
        )
    strong = [
        f"{name} {value:.2f}"
        for name, value in zip(picture.fitted.joint_names, lag_one, strict=True)
        if value is not None and abs(value) > 0.1
    ]
    if strong:
        samples, worth = sum(innovations["effective"]["samples"]), sum(innovations["effective"]["worth"])
        count = "the standard errors count each sample as new"
        if worth < samples:
            count = f"estimates and standard errors count the {samples:.0f} samples as {worth:.0f}"
        yield (
            f"Autocorrelation from sample to sample: {', '.join(strong)}. White innovations have none. The residual "
            f"has a shape in time that the model lacks; {count}."
        )


# --- printed ----------------------------------------------------------------------------------------------------------


def tables(fit: FrictionFit) -> Iterator[Table]:
    """List the tables to print: what is left of the torque, and the numbers by kind."""
    report, known = fit.report_, fit.report_["identified"]
    sets = residual_tables(report, fit.description_.joint_names)
    unit = sets[0].unit if sets else "mN·m"
    yield (
        f"{report['finger']}: residual before the bias learns from the sample, rms in {unit}",
        ("", "joint", *RESIDUAL_HEADINGS),
        [("" if k else each.title, row.name, *row.texts) for each in sets for k, row in enumerate(each.rows)],
    )
    yield (
        f"numbers that these recordings identify: {known['count']} of {known['of']}",
        ("kind", "numbers", "identified", "median change", "at a bound"),
        list(_kinds(fit.numbers_)),
    )


def _kinds(numbers: Sequence[Fitted]) -> Iterator[Row]:
    by_kind: dict[str, list[Fitted]] = {}
    for number in numbers:
        path = number.number.path
        kind = path.split("[")[0] if path.startswith("bias") else f"{number.number.kind}.{number.number.key}"
        by_kind.setdefault(kind, []).append(number)
    for kind, members in sorted(by_kind.items()):
        known = [number for number in members if number.identified]
        changes = sorted(abs(number.value / number.start - 1) for number in known if number.start)
        change = f"{100 * changes[len(changes) // 2]:.0f} %" if changes else "-"
        bound = sum(number.at_bound is not None for number in members)
        yield kind, str(len(members)), str(len(known)), change, str(bound) if bound else "-"


def lines(fit: FrictionFit) -> Iterator[str]:
    """List the lines to print: how the fit went, the residuals, and what would identify the remaining numbers."""
    report, numbers = fit.report_, fit.numbers_
    recordings = report["recordings"]
    used, held = sum(each["used"] for each in recordings), sum(each["held_out"] for each in recordings)
    rests = sum(each["at_rest"] for each in recordings)
    left_out = sum(each["contact_left_out"] + each["faulty_left_out"] for each in recordings)
    ended = "converged" if report["converged"] else "NOT converged"
    passes = f", {counted(report['passes'], 'pass', 'passes')}" if report["passes"] else ""
    yield (
        f"{report['method']}: {ended} in {report['seconds']:.1f} s{passes}; trained on {counted(used, 'sample')}, "
        f"{held} held out, {left_out} left out" + (f", {rests} at rest" if rests else "")
    )
    innovations = report["innovations"]
    low, high = innovations["nis"]["interval"]
    if innovations["nis"]["mean"] is not None:
        lags = ", ".join("-" if value is None else f"{value:.2f}" for value in innovations["whiteness"]["lag_one"])
        yield (
            f"innovations: NIS {innovations['nis']['mean']:.3g} ({low:.3f} to {high:.3f} if the noise settings "
            f"hold), autocorrelation at lag one {lags}"
        )
    samples, worth = innovations["effective"]["samples"], innovations["effective"]["worth"]
    if sum(worth) < sum(samples):
        by_joint = ", ".join(f"{count:.0f}" for count in worth)
        yield f"effective number of samples by joint: {by_joint} of {samples[0]:.0f}"
    yield from report["routing"]["sentences"] if report["routing"] else ()
    yield from memory_sentences(report)
    yield report["given_numbers"]["paragraph"]
    for cause, count in Counter(number.cause for number in numbers if number.cause).most_common():
        yield f"  {count} not identified: {verdicts.CAUSES[cause]}"
        several = [number for number in numbers if number.cause == cause and number.advice]
        for number in several[:EXAMPLES]:
            yield f"    {number.number.path}: {number.advice}"
        if len(several) > EXAMPLES:
            yield f"    ... and {count - EXAMPLES} more; --report lists all"
    yield from sums_known(fit.description_)


# --- the page ---------------------------------------------------------------------------------------------------------


def write_fit_page(picture: FitPicture, folder: Path) -> dict[Path, str]:
    """Write `report.html` to a folder, which is made if missing, whole or not at all."""
    write_files(folder, {PAGE: fit_page(picture).encode()})
    return {folder / PAGE: "all results, to be read in a browser"}


def fit_page(picture: FitPicture) -> str:
    """Return the HTML text of the page of a fit."""
    report, joints = picture.report, picture.fitted.joint_names
    tables = residual_tables(report, joints)
    return render(
        "fit.html.jinja",
        fit_sheets(picture),
        report=report,
        state=state_of(report),
        tiles_shown=_tiles(report, tables),
        sentences=list(summary_sentences(picture, tables)),
        joint_names=joints,
        residuals=[
            (f"{each.title}: rms in {each.unit}", [(row.name, *row.texts) for row in each.rows]) for each in tables
        ],
        residual_headings=RESIDUAL_HEADINGS,
        consistency=list(consistency(picture)),
        doubts=list(_doubts(report)),
        recordings=[_recording(recording) for recording in report["recordings"]],
        options={name: _option(value) for name, value in report["options"].items()},
        groups=list(_groups(picture)),
    )


def _tiles(report: FitReport, tables: Sequence[ResidualTable]) -> list[Tile]:
    tiles = [
        Tile(percent(table.all.left), "", f"of the torque is left: {table.title[0].lower() + table.title[1:]}")
        for table in tables[:TILES]
        if table.all.left is not None
    ]
    bias = tables[0].all.share(tables[0].all.bias_only) if tables else None
    if bias is not None:
        tiles.append(Tile(percent(bias), "", "would be left by the bias alone"))
    return [*tiles, Tile(f"{report['identified']['count']}/{report['identified']['of']}", "", "numbers identified")]


def _doubts(report: FitReport) -> Iterator[tuple[str, list[Row]]]:
    """List the numbers that are not identified by reason, most frequent first."""
    by_reason: dict[str, list[FittedNumber]] = {}
    for entry in report["parameters"]:
        if not entry["identified"]:
            by_reason.setdefault(entry["reason"] or "unknown", []).append(entry)
    for reason, entries in sorted(by_reason.items(), key=lambda item: -len(item[1])):
        rows: list[Row] = [
            (entry["path"], *_value(entry), unit_text(entry["unit"]), entry["advice"] or "") for entry in entries
        ]
        yield verdicts.CAUSES.get(reason, reason), rows


def _groups(picture: FitPicture) -> Iterator[dict[str, Any]]:
    """List all numbers by joint and tendon: (number, start, fitted, standard error, unit, identified)."""
    groups: dict[str, list[tuple[str, FittedNumber]]] = {}
    for entry in picture.report["parameters"]:
        name, path = "Others", entry["path"]
        if place := part_of(path):
            part, number, path = place
            names = picture.fitted.joint_names if part == "joints" else picture.fitted.tendon_names
            name = f"{part[:-1].capitalize()} {number}: {names[number - 1]}"
        groups.setdefault(name, []).append((path, entry))
    for name, numbers in groups.items():
        yield {
            "name": name,
            "identified": sum(bool(entry["identified"]) for _, entry in numbers),
            "doubtful": [not entry["identified"] for _, entry in numbers],
            "rows": [
                (path, _number(entry["start"], 4), *_value(entry), unit_text(entry["unit"]), _identified(entry))
                for path, entry in numbers
            ],
        }


def _value(entry: FittedNumber) -> tuple[str, str]:
    return _number(entry["value"], 4), _number(entry["standard_error"], 2)


def _identified(entry: FittedNumber) -> str:
    bound = f", at its {entry['at_bound']} bound" if entry["at_bound"] else ""
    return ("yes" if entry["identified"] else "no") + bound


def _recording(recording: RecordingEntry) -> Row:
    counts = recording["samples"], recording["used"], recording["held_out"], recording["contact_left_out"]
    length, force = _number(recording["duration"], 4), _number(recording["mean_force"])
    return recording["path"], length, *map(str, counts), force, str(recording["kinematics"])


def _option(value: Any) -> str:
    if isinstance(value, list | tuple):
        return ", ".join(map(_option, value)) or "none"
    return {True: "yes", False: "no", None: "none"}.get(value, str(value)) if not value else str(value)


def _number(value: float | None, digits: int = 3) -> str:
    """Format a number with some significant digits; a dash where there is none."""
    return "–" if value is None or value != value else f"{value:.{digits}g}"
