"""What the figures of a fit show: torque, modelled friction and residual, ready to be drawn.

Torque and friction over time are figs. 6 and 7 of the paper. The residual is shown over time, angle and velocity.
The friction laws are in `fit_law_figures.py`, the figures of the covariance in `fit_error_figures.py`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from tendonfmu.arrays import Flags, Numbers
from tendonfmu.drawing import Band, Curve, Interval, Panel, Sheet
from tendonfmu.estimate import FitPicture, FitSeries
from tendonfmu.recordings import flagged_stretches
from tendonfmu.report.fit_error_figures import correlation_sheet, error_sheet
from tendonfmu.report.fit_law_figures import law_sheets

SHOWN = 10.0  # s of motion, starting at BEGIN as in the paper's figs. 6 and 7 if the recording is long enough
BEGIN = 60.0
COMPARED = 3  # recordings not trained on that are drawn; more would make the page too large
_BINS, _TIME_BINS = 36, 150
_FEWEST = 8  # samples in a bin; emptier bins are left out
_TORQUE_KEYS = (
    ("measured", "measured joint torque"),
    ("predicted", "model with bias, before it sees the sample"),
    ("bias", "the bias's part of it"),
)
_RESIDUAL_CAPTION = (
    "Residual before the bias has seen the sample: measured minus modelled torque. A median away from 0 over the angle "
    "or the velocity is friction that the model lacks; a wide band is noise or stick-slip."
)
_RESIDUAL_KEYS = (("median", "median"), ("spread", "10 to 90 % of the samples"), ("held_out", "held out of training"))


def fit_sheets(picture: FitPicture) -> list[Sheet]:
    """Make all figures of a fit, in the order of the page."""
    return [
        *torque_sheets(picture),
        *residual_sheets(picture),
        *law_sheets(picture),
        error_sheet(picture),
        correlation_sheet(picture),
    ]


def rms(values: Numbers) -> float:
    """Return the root of the mean square of the finite values; NaN if there are none."""
    known = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(np.square(known)))) if known.size else float("nan")


def torque_unit(series: Sequence[FitSeries]) -> tuple[float, str]:
    """Return factor and unit in which the torques of these recordings read well."""
    largest = max((float(np.nanmax(np.abs(each.torque))) for each in series), default=0.0)
    return (1.0, "N·m") if largest >= 2.0 else (1e3, "mN·m")


# --- torque over time -------------------------------------------------------------------------------------------------


def torque_sheets(picture: FitPicture) -> Iterator[Sheet]:
    """Show the torque over time, ten seconds of each set of data."""
    first = BEGIN
    explanation = (
        " The residual is taken before the bias has seen the sample. Its share is that of the rms in the time shown."
    )
    if any(each.get("external_torque") for each in picture.report["recordings"]):
        explanation += " A measured external torque is subtracted from the torque shown."
    for number, (part, series, where) in enumerate(_parts(picture), start=1):
        shown = _window(series.time, where, first)
        begin, end = float(series.time[shown][0]), float(series.time[shown][-1])
        if number == 1:
            first = begin - float(series.time[0])
        joints, name = picture.joint_names, f"torque_{number}"
        scale = torque_unit([series])
        panels = [_torque_panel(series, shown, j, joint, scale, name) for j, joint in enumerate(joints)]
        yield Sheet(
            section="torque",
            name=name,
            title=f"{part}: {series.label}, {begin:.0f} to {end:.0f} s",
            caption=f"Mean tendon force {series.mean_force:.3g} N." + (explanation if number == 1 else ""),
            keys=_TORQUE_KEYS,
            panels=tuple(panels),
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


def _torque_panel(series: FitSeries, shown: Flags, j: int, name: str, scale: tuple[float, str], zoom: str) -> Panel:
    factor, unit = scale
    time, torque, residual = series.time[shown], series.torque[shown, j], series.residual[shown, j]
    predicted = torque - residual
    bias = predicted - series.model_torque[shown, j]
    left, size = rms(residual), rms(torque)
    note = f"residual {_share(left, size)} of torque"
    gaps = _gaps(series.time, time)
    return Panel(
        title=name,
        note=note,
        alt=f"Joint {name}, {time[0]:.0f} to {time[-1]:.0f} s of {series.label}: measured torque, the model's "
        f"prediction and the bias in it. Torque rms {factor * size:.3g} {unit}, residual rms {factor * left:.3g} "
        f"{unit}.",
        x_label="time (s)",
        y_label=f"torque ({unit})",
        size="medium",
        curves=tuple(
            Curve(style, np.insert(time, gaps, np.nan), factor * np.insert(values, gaps, np.nan))
            for style, values in (("measured", torque), ("bias", bias), ("predicted", predicted))
        ),
        x_limits=(float(time[0]), float(time[-1])),
        zoom=zoom,
    )


def _share(left: float, size: float) -> str:
    return f"{100 * left / size:.0f} %" if size > 0 and np.isfinite(left) else "unknown"


def _gaps(all_times: Numbers, time: Numbers) -> NDArray[np.intp]:
    """Return where a line must break: time steps of more than ten usual ones."""
    usual = float(np.median(np.diff(all_times)))
    return np.flatnonzero(np.diff(time) > 10 * usual) + 1


# --- residual ---------------------------------------------------------------------------------------------------------


def residual_sheets(picture: FitPicture) -> Iterator[Sheet]:
    """Show the residual of each joint over time, angle and velocity: all training data, then each comparison."""
    training = [series for series in picture.series if series.role == "training"]
    if training:
        label = training[0].label if len(training) == 1 else f"{len(training)} recordings, end to end"
        yield _residual_sheet(picture, training, f"Training: {label}", 1)
    for number, series in enumerate(_compared(picture), start=2):
        yield _residual_sheet(picture, [series], f"Not trained on: {series.label}", number)


def _residual_sheet(picture: FitPicture, series: Sequence[FitSeries], title: str, number: int) -> Sheet:
    scale = torque_unit(series)
    zoom = f"residual_{number}"
    panels = [
        panel for j, name in enumerate(picture.joint_names) for panel in _residual_panels(series, j, name, scale, zoom)
    ]
    held_out = any(each.held_out is not None for each in series)
    return Sheet(
        section="residual",
        name=zoom,
        title=title,
        caption=_RESIDUAL_CAPTION if number == 1 else "",
        keys=_RESIDUAL_KEYS if held_out else _RESIDUAL_KEYS[:2],
        panels=tuple(panels),
    )


def _residual_panels(
    series: Sequence[FitSeries], j: int, name: str, scale: tuple[float, str], zoom: str
) -> Iterator[Panel]:
    factor, unit = scale
    residual = factor * np.concatenate([each.residual[:, j] for each in series])
    judged = np.isfinite(residual) & np.concatenate([_judged(each) for each in series])  # NaN: no kinematics there
    time, stripes = _end_to_end(series)
    angle, speed = (
        np.concatenate([getattr(each, key)[:, j] for each in series]) for key in ("joint_angle", "joint_speed")
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
        yield Panel(
            title=f"{name} over {what}",
            alt=f"Residual of joint {name} over {what}: its median in a bin is at most {worst:.2g} {unit} away from 0, "
            f"its rms is {rms(residual[judged]):.3g} {unit}.",
            note=f"rms {rms(residual[judged]):.3g} {unit}" if even else "",
            x_label=x_label,
            y_label=f"residual ({unit})",
            bands=(Band("spread", centre, low, high),),
            curves=(Curve("median", centre, middle),),
            stripes=tuple(stripes) if even else (),
            y_limits=(-limit, limit) if limit > 0 else None,
            zoom=zoom if even else "",
        )


def _judged(series: FitSeries) -> Flags:
    """Flag the samples whose residual judges the model: trained on or held out; all samples of a comparison."""
    if series.role == "comparison":
        return np.ones(len(series.time), dtype=bool)
    return series.used if series.held_out is None else series.used | series.held_out


def _end_to_end(series: Sequence[FitSeries]) -> tuple[Numbers, list[Interval]]:
    """Return the times of recordings joined end to end, from 0, and the intervals that were held out."""
    times, stripes, begin = [], [], 0.0
    for each in series:
        time = each.time - each.time[0] + begin
        times.append(time)
        if each.held_out is not None:
            stripes += flagged_stretches(time, each.held_out)
        begin = float(time[-1])
    return np.concatenate(times), stripes


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
