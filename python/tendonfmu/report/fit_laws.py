"""What the friction laws of a fit look like: one sheet for the joints, one for each tendon."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from tendonfmu import drawing as draw
from tendonfmu.arrays import Numbers
from tendonfmu.drawing import curve
from tendonfmu.estimate import FitPicture, LawBands, LawCurve, asymmetric, numbers_of
from tendonfmu.files import are, counted
from tendonfmu.model import Effect, effects, sliding_velocity, velocity_threshold

LAWS_DRAWN = 240  # friction effects at most; a snake of 16 joints and 64 tendons has thousands
_LOOKED_AT = 20_000  # samples at most that say where the motion was
_POINTS = 160  # of a curve
_HEADROOM = 2.5  # the axis ends at this times the highest curve, even if a band is wider
_VISITED = "range of the training samples"


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
        text += ", and at v_min where sliding begins." if any(map(_is_plain, drawn)) else "."
    return text


def _is_plain(effect: Effect) -> bool:
    """Say whether a law has working points and one side for both directions."""
    return bool(effect.angles) and not asymmetric(effect)


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
