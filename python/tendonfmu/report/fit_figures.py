"""What the figures of a fit show, ready to be drawn.

Torque and friction over time are figs. 6 and 7 of the paper. The residual is shown over time, angle and velocity. The
friction laws have a sheet for the joints, and one for each tendon.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu import drawing as draw
from tendonfmu.arrays import Flags, Numbers
from tendonfmu.drawing import curve, panel
from tendonfmu.estimate import FitPicture, FitSeries, LawBands, LawCurve, asymmetric, numbers_of
from tendonfmu.files import are, counted
from tendonfmu.model import Effect, effects, sliding_velocity, velocity_threshold
from tendonfmu.recordings import flagged_stretches
from tendonfmu.report.kit import rms, torque_unit

SHOWN = 10.0  # s of motion, starting at BEGIN as in the paper's figs. 6 and 7 if the recording is long enough
BEGIN = 60.0
COMPARED = 3  # recordings not trained on that are drawn; more would make the page too large
_BINS, _TIME_BINS = 36, 150
LAWS_DRAWN = 240  # friction effects at most; a snake of 16 joints and 64 tendons has thousands
_LOOKED_AT = 20_000  # samples at most that say where the motion was
_POINTS = 160  # of a curve
_HEADROOM = 2.5  # the axis ends at this times the highest curve, even if a band is wider
_VISITED = "range of the training samples"

_FEWEST = 8  # samples in a bin; emptier bins are left out
_RESIDUAL_CAPTION = (
    "Residual before the bias learns from the sample: measured minus modelled torque. A median away from 0 over the "
    "angle or the velocity is friction that the model lacks; a wide band is noise or stick-slip."
)


def fit_sheets(picture: FitPicture) -> list[draw.Sheet]:
    """Make all figures of a fit, in the order of the page."""
    return [*torque_sheets(picture), *residual_sheets(picture), *law_sheets(picture)]


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


# --- friction laws ----------------------------------------------------------------------------------------------------


def law_sheets(picture: FitPicture) -> Iterator[draw.Sheet]:
    """Show the friction laws of a fit."""
    desk = _Desk(picture)
    pairs = list(zip(effects(picture.start.data), effects(picture.fitted.data), strict=True))
    drawn = pairs[:LAWS_DRAWN]
    more = len(pairs) - len(drawn)
    hidden = f" {counted(more, 'further law')} of the finger {are(more)} not drawn." if more else ""
    for tendon in sorted({fitted.tendon for _, fitted in drawn}):
        here = [(start, fitted) for start, fitted in drawn if fitted.tendon == tendon]
        name = picture.fitted.tendon_names[tendon - 1] if tendon else ""
        yield draw.Sheet(
            "laws",
            f"laws_tendon_{tendon}" if tendon else "laws_joints",
            f"Tendon {tendon}: {name}" if tendon else "In the joints",
            [desk.panel(start, fitted) for start, fitted in here],
            _caption([fitted for _, fitted in here]) + hidden,
            folded=tendon > 1,
        )


def _caption(drawn: Sequence[Effect]) -> str:
    if not drawn[0].tendon:
        load = any(effect.kind == "load_friction" for effect in drawn)
        return "Friction over the joint's velocity." + (" Load friction is per newton of tendon force." if load else "")
    text = "Share of the tendon force that is lost, over the tendon's velocity."
    if any(effect.angles for effect in drawn):
        text += " Laws with working points: over the angle of the joint before, at the training's median speed"
        plain = any(effect.angles and not asymmetric(effect) for effect in drawn)  # one side for both directions
        text += ", and at v_min where sliding begins." if plain else "."
    return text


def is_known(effect: Effect, picture: FitPicture) -> bool:
    """Say whether the Coulomb friction of a law is known at a working point at least, or was not estimated."""
    entries = [each for each in numbers_of(effect, picture.report) if each["path"].endswith(".coulomb")]
    return not entries or any(each["identified"] or each["reason"] == "kept" for each in entries)


class _Motion:
    """Angles and velocities that the training visits, thinned."""

    def __init__(self, picture: FitPicture) -> None:
        self._data = picture.fitted.data
        training = [series for series in picture.series if series.role == "training"]
        every = max(1, sum(len(series.time) for series in training) // _LOOKED_AT)
        none = np.empty((0, len(picture.fitted.data["joints"])))
        angle = np.concatenate([none, *(series.joint_angle[series.used][::every] for series in training)])
        speed = np.concatenate([none, *(series.joint_speed[series.used][::every] for series in training)])
        known = np.isfinite(angle).all(axis=1) & np.isfinite(speed).all(axis=1)
        self._angle, self._speed = angle[known], speed[known]

    def sliding(self, effect: Effect) -> tuple[Numbers, Numbers]:
        """Return the signed velocities at which an effect slides, and the angles of the joint before then."""
        velocity = sliding_velocity(self._data, effect, self._speed)
        angle = self._angle[:, effect.joint - 2] if effect.joint > 1 else np.zeros(len(velocity))
        slides = np.abs(velocity) > velocity_threshold(self._data, effect)
        return velocity[slides], angle[slides]


class _Desk:
    """Makes the panels of one fit."""

    def __init__(self, picture: FitPicture) -> None:
        self._picture, self._bands, self._motion = picture, LawBands(picture), _Motion(picture)

    def panel(self, start: Effect, fitted: Effect) -> draw.Panel:
        return self._over_angle(start, fitted) if fitted.angles else self._over_speed(start, fitted)

    def _title(self, effect: Effect) -> str:
        joint = self._picture.fitted.joint_names[effect.joint - 1]
        if effect.tendon == 0:
            return joint if effect.kind == "friction" else f"{joint}, load"
        return f"{'pulley' if effect.kind == 'pulley_friction' else 'edge'} {effect.joint} ({joint})"

    def _fitted(self, effect: Effect, x: Numbers, y: Numbers) -> draw.Trace:
        """Draw a fitted law: grey where nothing tells its Coulomb friction."""
        if not is_known(effect, self._picture):
            return curve(x, y, "not identified", draw.GREY, 1.8)
        return curve(x, y, "fitted, over the angle at the median speed" if effect.angles else "fitted", draw.BLUE, 1.8)

    def _note(self, effect: Effect) -> str:
        numbers = numbers_of(effect, self._picture.report)
        return (
            f"{sum(bool(entry['identified']) for entry in numbers)}/{len(numbers)} identified" if numbers else "fixed"
        )

    def _over_speed(self, start: Effect, fitted: Effect) -> draw.Panel:
        """Show both directions as in fig. 2b: 0 below v_min."""
        threshold = velocity_threshold(self._picture.fitted.data, fitted)
        sliding, _ = self._motion.sliding(fitted)
        slowest = max(threshold, 1e-6)
        fastest = max(4.0 * slowest, float(np.quantile(np.abs(sliding), 0.995)) if sliding.size else 0.0)
        speed = np.geomspace(slowest, fastest, _POINTS)
        sides = [self._bands.over_speed(start, fitted, sign, speed) for sign in (-1, 1)]
        factor, y_label = _unit(fitted, sides)
        unit, x_label = (1e3, "tendon velocity (mm/s)") if fitted.tendon else (1.0, "velocity (rad/s)")
        x = unit * np.concatenate([-speed[::-1], [-slowest, slowest], speed])
        still = np.zeros(2)

        def both(left: str, right: str) -> Numbers:
            below, above = getattr(sides[0], left), getattr(sides[1], right)
            return factor * np.concatenate([-below[::-1], still, above])

        ends = factor * sides[1].fitted[[0, -1]]
        top = factor * _top(sides)
        limit = unit * fastest
        still_name = "below v_min: no friction is modelled, the bias replaces it"
        rest = [(-unit * threshold, unit * threshold)] if threshold else []
        return draw.panel(
            self._title(fitted),
            f"{self._title(fitted)}: {y_label} over {x_label}: fitted {ends[0]:.3g} where sliding "
            f"begins, {ends[1]:.3g} at {limit:.3g}; {self._note(fitted)}.",
            x_label,
            y_label,
            draw.histogram(unit * sliding, -limit, limit, _VISITED),
            draw.band(x, both("high", "low"), both("low", "high"), "95 % confidence"),
            curve(x, both("start", "start"), "start", draw.GREY, 1.1, "dash"),
            self._fitted(fitted, x, both("fitted", "fitted")),
            draw.stripes(rest, still_name, draw.SILVER, 0.35),
            note=self._note(fitted),
            x_limits=(-limit, limit),
            y_limits=(-top, top),
        )

    def _over_angle(self, start: Effect, fitted: Effect) -> draw.Panel:
        """Show a law at two speeds, or both directions at one speed where they differ."""
        threshold = velocity_threshold(self._picture.fitted.data, fitted)
        sliding, visited = self._motion.sliding(fitted)
        median = float(np.median(np.abs(sliding))) if sliding.size else 4.0 * threshold
        margin = 0.04 * (fitted.angles[-1] - fitted.angles[0]) or 0.1
        angle = np.union1d(np.linspace(fitted.angles[0] - margin, fitted.angles[-1] + margin, _POINTS), fitted.angles)
        drawn = [("slow", 1, threshold), ("fitted", 1, median)]
        if asymmetric(fitted):
            drawn = [("negative", -1, median), ("fitted", 1, median)]
        laws = [self._bands.over_angle(start, fitted, sign, speed, angle) for _, sign, speed in drawn]
        factor, y_label = _unit(fitted, laws)
        traces: list[draw.Trace] = draw.histogram(visited, float(angle[0]), float(angle[-1]), _VISITED)
        for (style, _, _), law in zip(drawn, laws, strict=True):
            ends = factor * law.low, factor * law.high
            if style == "slow":
                traces += [curve(angle, end, "its 95 %", draw.ORANGE, 0.9, "dot") for end in ends]
            elif style == "negative":
                traces += draw.band(angle, *ends, "", draw.VERMILION, 0.18)
            else:
                traces += draw.band(angle, *ends, "95 % confidence")
            traces.append(curve(angle, factor * law.start, "start", draw.GREY, 1.1, "dash"))
        for (style, _, _), law in zip(drawn, laws, strict=True):
            y = factor * law.fitted
            lines = {"slow": ("at v_min", draw.ORANGE), "negative": ("negative direction", draw.VERMILION)}
            traces.append(self._fitted(fitted, angle, y) if style == "fitted" else curve(angle, y, *lines[style], 1.8))
        before = self._picture.fitted.joint_names[fitted.joint - 2] if fitted.joint > 1 else ""
        lowest, highest = factor * laws[-1].fitted.min(), factor * laws[-1].fitted.max()
        return draw.panel(
            self._title(fitted),
            f"{self._title(fitted)}: {y_label} over the angle of {before or 'the base'}, {len(fitted.angles)} "
            f"working points: fitted {lowest:.3g} to {highest:.3g}; {self._note(fitted)}.",
            f"angle of {before} (rad)" if before else "angle (rad)",
            y_label,
            traces,
            note=self._note(fitted),
            x_limits=(float(angle[0]), float(angle[-1])),
            y_limits=(0.0, factor * _top(laws)),
        )


def _top(curves: Sequence[LawCurve]) -> float:
    """Return the upper end of the axis: all curves, and the bands where they are not too wide."""
    lines = max(float(np.max([curve.fitted, curve.start])) for curve in curves)
    bands = max(float(np.max(curve.high)) for curve in curves)
    return 1.08 * max(lines, min(bands, _HEADROOM * lines)) or 1.0


def _unit(effect: Effect, curves: Sequence[LawCurve]) -> tuple[float, str]:
    """Return factor and label of the friction axis."""
    if effect.tendon:
        return 1e2, "share of force (%)"
    largest = _top(curves)
    factor, unit = next((pair for pair in ((1.0, "N·m"), (1e3, "mN·m")) if pair[0] * largest >= 0.5), (1e6, "µN·m"))
    return factor, f"friction ({unit})" if effect.kind == "friction" else f"load friction ({unit}/N)"
