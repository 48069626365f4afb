"""What the figures of a fit show, ready to be drawn; the friction laws are in `fit_laws.py`.

Torque and friction over time are figs. 6 and 7 of the paper. The residual is shown over time, angle and velocity. How
well the numbers are known: standard error over value of each, and the correlations of all unknowns.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tendonfmu import drawing as draw
from tendonfmu.arrays import Flags, Numbers
from tendonfmu.drawing import panel
from tendonfmu.estimate import FitPicture, FitSeries, FittedNumber, identifiability
from tendonfmu.recordings import flagged_stretches
from tendonfmu.report.fit_laws import law_sheets
from tendonfmu.report.numbers import rms, torque_unit

SHOWN = 10.0  # s of motion, starting at BEGIN as in the paper's figs. 6 and 7 if the recording is long enough
BEGIN = 60.0
COMPARED = 3  # recordings not trained on that are drawn; more would make the page too large
_BINS, _TIME_BINS = 36, 150
_SHOWN = (1e-3, 10.0)  # standard error over value
_TICKS = ((1e-3, "0.1 %"), (1e-2, "1 %"), (1e-1, "10 %"), (1.0, "100 %"), (10.0, "1000 %"))
_KINDS = {
    "friction": "joint friction",
    "load_friction": "load friction",
    "pulley_friction": "pulley",
    "edge_friction": "edge",
}
_ORDER = ("static", "coulomb", "stribeck_velocity", "viscous")
_FEWEST = 8  # samples in a bin; emptier bins are left out
_RESIDUAL_CAPTION = (
    "Residual before the bias learns from the sample: measured minus modelled torque. A median away from 0 over the "
    "angle or the velocity is friction that the model lacks; a wide band is noise or stick-slip."
)


def fit_sheets(picture: FitPicture) -> list[draw.Sheet]:
    """Make all figures of a fit, in the order of the page."""
    return [
        *torque_sheets(picture),
        *residual_sheets(picture),
        *law_sheets(picture),
        error_sheet(picture),
    ]


def unit_of(series: Sequence[FitSeries]) -> tuple[float, str]:
    """Return factor and unit in which the torques of these recordings read well."""
    return torque_unit(max((float(np.nanmax(np.abs(one.torque))) for one in series), default=0.0))


# --- torque over time -------------------------------------------------------------------------------------------------


def torque_sheets(picture: FitPicture) -> Iterator[draw.Sheet]:
    """Show the torque over time, ten seconds of each set of data."""
    first = BEGIN
    explanation = (
        " The residual is taken before the bias learns from the sample. Its share is that of the rms in the time shown."
    )
    if any(recording["external_torque"] for recording in picture.report["recordings"]):
        explanation += " A measured external torque is subtracted from the torque shown."
    for number, (part, series, where) in enumerate(_parts(picture), start=1):
        shown = _window(series.time, where, first)
        begin, end = float(series.time[shown][0]), float(series.time[shown][-1])
        if number == 1:
            first = begin - float(series.time[0])
        joints, name = picture.fitted.joint_names, f"torque_{number}"
        scale = unit_of([series])
        panels = [_torque_panel(series, shown, j, joint, scale, name) for j, joint in enumerate(joints)]
        yield draw.Sheet(
            "torque",
            name,
            f"{part}: {series.label}, {begin:.0f} to {end:.0f} s",
            panels,
            f"Mean tendon force {series.mean_force:.3g} N." + (explanation if number == 1 else ""),
        )


def _parts(picture: FitPicture) -> Iterator[tuple[str, FitSeries, Flags]]:
    training = [series for series in picture.series if series.role == "training"]
    if training:
        yield "Training", training[0], training[0].used
    for series in training:
        if series.held_out is not None and series.held_out.any():
            yield "Held out", series, series.held_out
            break
    for series in _compared(picture):
        yield "Not trained on", series, np.ones(len(series.time), dtype=bool)


def _compared(picture: FitPicture) -> list[FitSeries]:
    return [series for series in picture.series if series.role == "comparison"][:COMPARED]


def _window(time: Numbers, where: Flags, first: float) -> NDArray[np.bool_]:
    """Flag `SHOWN` seconds in the first stretch of `where` that is long enough, from `first` s on if possible."""
    stretches = flagged_stretches(time, where) or [(float(time[0]), float(time[-1]))]
    wanted = float(time[0]) + first
    later = [(max(begin, wanted), end) for begin, end in stretches if end - max(begin, wanted) >= SHOWN]
    long = [(begin, end) for begin, end in stretches if end - begin >= SHOWN]
    longest = max(stretches, key=lambda stretch: stretch[1] - stretch[0])
    begin, end = (later or [((a + b - SHOWN) / 2, b) for a, b in long] or [longest])[0]
    return np.asarray((time >= begin) & (time <= min(end, begin + SHOWN)))


def _torque_panel(
    series: FitSeries, shown: Flags, j: int, name: str, scale: tuple[float, str], zoom: str
) -> draw.Panel:
    factor, unit = scale
    time, torque, residual = series.time[shown], series.torque[shown, j], series.residual[shown, j]
    predicted = torque - residual
    bias = predicted - series.model_torque[shown, j]
    left, size = rms(residual), rms(torque)
    share = f"{100 * left / size:.0f} %" if size > 0 and np.isfinite(left) else "unknown"
    gaps = _gaps(series.time, time)

    def drawn(values: Numbers, *style: Any, **more: Any) -> draw.Trace:
        return draw.curve(np.insert(time, gaps, np.nan), factor * np.insert(values, gaps, np.nan), *style, **more)

    return panel(
        name,
        f"Joint {name}, {time[0]:.0f} to {time[-1]:.0f} s of {series.label}: measured torque, the model's "
        f"prediction and the bias in it. Torque rms {factor * size:.3g} {unit}, residual rms {factor * left:.3g} "
        f"{unit}.",
        "time (s)",
        f"torque ({unit})",
        drawn(torque, "measured joint torque", draw.DARK, 1.0),
        drawn(bias, "bias alone", draw.ORANGE, 0.8, alpha=0.8),
        drawn(predicted, "model with bias, before the bias learns from the sample", draw.SKY, 1.5),
        note=f"residual {share} of torque",
        size="medium",
        x_limits=(float(time[0]), float(time[-1])),
        zoom=zoom,
    )


def _gaps(all_times: Numbers, time: Numbers) -> NDArray[np.intp]:
    """Return where a line must break: time steps of more than ten usual ones."""
    usual = float(np.median(np.diff(all_times)))
    return np.flatnonzero(np.diff(time) > 10 * usual) + 1


# --- residual ---------------------------------------------------------------------------------------------------------


def residual_sheets(picture: FitPicture) -> Iterator[draw.Sheet]:
    """Show the residual of each joint over time, angle and velocity: all training data, then each comparison."""
    training = [series for series in picture.series if series.role == "training"]
    if training:
        label = training[0].label if len(training) == 1 else f"{len(training)} recordings, end to end"
        yield _residual_sheet(picture, training, f"Training: {label}", 1)
    for number, series in enumerate(_compared(picture), start=2):
        yield _residual_sheet(picture, [series], f"Not trained on: {series.label}", number)


def _residual_sheet(picture: FitPicture, series: Sequence[FitSeries], title: str, number: int) -> draw.Sheet:
    scale = unit_of(series)
    zoom = f"residual_{number}"
    panels = [
        panel
        for j, name in enumerate(picture.fitted.joint_names)
        for panel in _residual_panels(series, j, name, scale, zoom)
    ]
    return draw.Sheet("residual", zoom, title, panels, _RESIDUAL_CAPTION if number == 1 else "")


def _residual_panels(
    series: Sequence[FitSeries], j: int, name: str, scale: tuple[float, str], zoom: str
) -> Iterator[draw.Panel]:
    factor, unit = scale
    residual = factor * np.concatenate([one.residual[:, j] for one in series])
    judged = np.isfinite(residual) & np.concatenate([_judged(one) for one in series])  # NaN: no kinematics there
    time, held = _end_to_end(series)
    angle, speed = (
        np.concatenate([getattr(one, key)[:, j] for one in series]) for key in ("joint_angle", "joint_speed")
    )
    spread = np.quantile(residual[judged], (0.02, 0.98)) if judged.any() else np.array([-1.0, 1.0])
    limit = 1.25 * float(np.max(np.abs(spread)))
    for x, x_label, what, even in (
        (time, "time (s)", "time", True),
        (angle, "angle (rad)", "angle", False),
        (speed, "velocity (rad/s)", "velocity", False),
    ):
        centre, low, middle, high = _binned(x[judged], residual[judged], even)
        worst = float(np.max(np.abs(middle))) if middle.size else float("nan")
        yield panel(
            f"{name} over {what}",
            f"Residual of joint {name} over {what}: its median in a bin is at most {worst:.2g} {unit} away from 0, "
            f"its rms is {rms(residual[judged]):.3g} {unit}.",
            x_label,
            f"residual ({unit})",
            draw.band(centre, low, high, "10 to 90 % of the samples", draw.SKY, 0.35),
            draw.curve(centre, middle, "median", draw.BLUE, 1.6),
            draw.stripes(held if even else [], "held out of training", draw.ORANGE, 0.16),
            note=f"rms {rms(residual[judged]):.3g} {unit}" if even else "",
            y_limits=(-limit, limit) if limit > 0 else None,
            zoom=zoom if even else "",
        )


def _judged(series: FitSeries) -> Flags:
    """Flag the samples whose residual judges the model: trained on or held out; all samples of a comparison."""
    if series.role == "comparison":
        return np.ones(len(series.time), dtype=bool)
    return series.used if series.held_out is None else series.used | series.held_out


def _end_to_end(series: Sequence[FitSeries]) -> tuple[Numbers, list[draw.Interval]]:
    """Return the times of recordings joined end to end, from 0, and the intervals that were held out."""
    times, held, begin = [], list[draw.Interval](), 0.0
    for one in series:
        time = one.time - one.time[0] + begin
        times.append(time)
        if one.held_out is not None:
            held += flagged_stretches(time, one.held_out)
        begin = float(time[-1])
    return np.concatenate(times), held


def _binned(x: Numbers, y: Numbers, even: bool) -> tuple[Numbers, Numbers, Numbers, Numbers]:
    """Return the middle of each bin, and there the 10, 50 and 90 % quantiles of y."""
    # Bins have the same width if `even`, the same number of samples otherwise.
    if not x.size:
        return np.empty(0), np.empty(0), np.empty(0), np.empty(0)
    edges = (
        np.linspace(x.min(), x.max(), _TIME_BINS + 1)
        if even
        else np.unique(np.quantile(x, np.linspace(0, 1, _BINS + 1)))
    )
    order = np.argsort(x, kind="stable")
    x, y = x[order], y[order]
    begins = np.searchsorted(x, edges[:-1])
    ends = np.append(begins[1:], len(x))
    rows = [
        (np.median(x[a:b]), *np.quantile(y[a:b], (0.1, 0.5, 0.9)))
        for a, b in zip(begins, ends, strict=True)
        if b - a >= _FEWEST
    ]
    table = np.array(rows).reshape(-1, 4)
    return table[:, 0], table[:, 1], table[:, 2], table[:, 3]


# --- standard error over value ----------------------------------------------------------------------------------------


def kind_of(path: str) -> tuple[int, int, str]:
    """Return rank and name of the kind of a number: where it acts, and which number of a law it is."""
    key = path.rsplit(".", 1)[-1]
    for rank, (place, name) in enumerate(_KINDS.items()):
        if re.search(rf"\.{place}(\[|\.)", path) and key in _ORDER:
            return rank, _ORDER.index(key), f"{name}: {key.replace('_', ' ')}"
    if ".cover." in path:
        return len(_KINDS), 0, "cover: stiffness"
    name = re.sub(r"\[\d+\]", "", path).replace("_", " ").replace(".", ": ", 1)
    return len(_KINDS) + 1, 0, name


def relative_error(entry: FittedNumber) -> float:
    """Return standard error over value of a number of the report; infinite where there is none."""
    error, value = entry["standard_error"], entry["value"]
    if error is None or not value or not np.isfinite(error):
        return float("inf")
    return abs(error / value)


def error_sheet(picture: FitPicture) -> draw.Sheet:
    """Show every estimated number as a dot, by kind."""
    entries = picture.report["parameters"]
    kinds = sorted({kind_of(entry["path"]) for entry in entries})
    row_of = {kind: row for row, kind in enumerate(kinds)}
    members: list[list[FittedNumber]] = [[] for _ in kinds]
    for entry in entries:
        members[row_of[kind_of(entry["path"])]].append(entry)
    names = tuple(
        f"{name}  {sum(bool(entry['identified']) for entry in of_kind)}/{len(of_kind)}"
        for (_, _, name), of_kind in zip(kinds, members, strict=True)
    )
    known, of = sum(bool(entry["identified"]) for entry in entries), len(entries)
    shown = panel(
        "Standard error over value",
        f"Standard error over value of {of} numbers by kind, on a logarithmic axis; {known} are identified: "
        + "; ".join(names)
        + ".",
        "standard error / value",
        "",
        *_dots(members),
        draw.mark(identifiability.LIMIT),
        size="large",
        log_x=True,
        x_limits=_SHOWN,
        x_ticks=_TICKS,
        rows=names,
        height=90 + 24 * len(names),
    )
    return draw.Sheet(
        "errors",
        "standard_errors",
        "How well each number is known",
        [shown],
        "Each kind shows how many of its numbers are identified. The line is at "
        f"{100 * identifiability.LIMIT:.0f} % of the value. Dots beyond the axis are drawn at its end.",
    )


def _dots(members: list[list[FittedNumber]]) -> Iterator[draw.Trace]:
    """Place the dots of a row side by side in the order of the description, so that none hides another."""
    for name, wanted in (("identified", True), ("not identified", False)):
        x, y = list[float](), list[float]()
        for row, entries in enumerate(members):
            for k, entry in enumerate(entries):
                if bool(entry["identified"]) == wanted:
                    x.append(float(np.clip(relative_error(entry), *_SHOWN)))
                    y.append(row + (0.6 * (k + 0.5) / len(entries) - 0.3))
        yield draw.dots(x, y, name, *((draw.BLUE, 0.7) if wanted else (draw.GREY, 1.0)), ring=not wanted)


# --- correlation ------------------------------------------------------------------------------------------------------


class Pair(NamedTuple):
    """Two unknowns and the correlation of their errors."""

    first: str
    second: str
    correlation: float


def correlation(covariance: Numbers) -> Numbers:
    """Return the correlations [p, p] of a covariance; 0 where the variance is 0."""
    size = np.sqrt(np.diag(covariance))
    scale = np.divide(1.0, size, out=np.zeros_like(size), where=size > 0)
    return np.asarray(np.clip(covariance * scale[:, None] * scale[None, :], -1.0, 1.0))


def strongest_pairs(picture: FitPicture, count: int) -> list[Pair]:
    """Return the pairs of unknowns whose errors are most strongly correlated, strongest first."""
    values = correlation(picture.covariance)
    rows, columns = np.triu_indices(len(values), 1)
    best = np.argsort(-np.abs(values[rows, columns]), kind="stable")[:count]
    names = [unknown.name for unknown in picture.unknowns]
    return [Pair(names[a], names[b], float(values[a, b])) for a, b in zip(rows[best], columns[best], strict=True)]
