"""Draws a panel (`drawing.panel_data.Panel`) as SVG: sharp at any size, and without a plotting library.

It draws curves, bands, dots and upright bars on linear, logarithmic or stretched axes.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup, escape
from numpy.typing import NDArray

from tendonfmu.drawing.panel_data import Panel
from tendonfmu.drawing.panel_styles import STYLES, Style, size_of

Numbers = NDArray[np.float64]

_LEFT, _RIGHT, _BOTTOM, _TOP = 58, 12, 44, 28  # px around the axes
_APART = {"x": 44.0, "y": 24.0}  # px between numbers at an axis
_MARGIN = 0.05  # of what is drawn, beyond its ends
_DOT = 2.2  # px radius
_DASHES = {"-": "", "--": "6 4", ":": "1.5 3"}
_INNER = 0.6  # decades that the linear part of a stretched axis takes on each side of 0


def panel_svg(panel: Panel) -> Markup:
    """An `svg` element of the panel's size in CSS pixels, which can be put into a page."""
    width, height = size_of(panel)
    x = _Axis(*_ends(panel, "x"), _LEFT, width - _RIGHT, log=panel.log_x, near=panel.near_x)
    y = _Axis(*_ends(panel, "y"), height - _BOTTOM, _TOP, log=panel.log_y)
    inside = "".join([*_bands(panel, x, y), *_curves(panel, x, y), *_bars(panel, x, y), *_dots(panel, x, y)])
    box = f'x="{_LEFT}" y="{_TOP}" width="{width - _LEFT - _RIGHT}" height="{height - _TOP - _BOTTOM}"'
    view = f'viewBox="{_LEFT} {_TOP} {width - _LEFT - _RIGHT} {height - _TOP - _BOTTOM}"'
    return Markup(  # names are escaped one by one
        f'<svg class="panel" role="img" viewBox="0 0 {width} {height}" width="{width}" height="{height}" '
        f'aria-label="{escape(panel.alt)}">'
        + "".join(_grid(panel, x, y))
        + f"<svg {box} {view}>{inside}</svg>"
        + "".join(_labels(panel, width, height))
        + "</svg>"
    )


# --- axes -------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Axis:
    """low, high: values at the pixels begin and end. near: linear up to there, logarithmic beyond; 0: linear."""

    low: float
    high: float
    begin: float
    end: float
    log: bool = False
    near: float = 0.0

    def at(self, values: Numbers | float) -> Numbers:
        """Pixels."""
        low, high = (float(self._even(end)) for end in (self.low, self.high))
        return np.asarray(self.begin + (self._even(values) - low) / ((high - low) or 1.0) * (self.end - self.begin))

    def _even(self, values: Numbers | float) -> Numbers:
        """What the axis is linear in."""
        given = np.asarray(values, dtype=float)
        if self.log:
            return np.asarray(np.log10(np.where(given > 0, given, np.nan)))
        if self.near <= 0:
            return given
        size = np.abs(given) / self.near
        return np.asarray(np.sign(given) * np.where(size <= 1, _INNER * size, _INNER + np.log10(np.maximum(size, 1.0))))

    def ticks(self, apart: float) -> list[float]:
        """Values with a number, at least so many pixels apart."""
        if not (self.log or self.near > 0):
            return _even_ticks(self.low, self.high, apart * (self.high - self.low) / abs(self.end - self.begin))
        taken: list[tuple[float, float]] = []
        for value in _decades(self.low, self.high, self.near):
            place = float(self.at(value))
            if self.low <= value <= self.high and all(abs(place - other) >= apart for _, other in taken):
                taken.append((value, place))
        return sorted(value for value, _ in taken)


def _even_ticks(low: float, high: float, least: float) -> list[float]:
    """Multiples of 1, 2 or 5 times a power of ten, at least so far apart."""
    if not (math.isfinite(least) and least > 0):
        return [low]
    power = 10.0 ** math.floor(math.log10(least))
    step = next(each * power for each in (1.0, 2.0, 5.0, 10.0) if each * power >= least * (1 - 1e-9))
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return [number * step for number in range(first, last + 1)]


def _decades(low: float, high: float, near: float) -> Iterator[float]:
    """1, then 5 and 2 times powers of ten on both sides of 0, the largest first; those that matter more come first."""
    largest = max(abs(low), abs(high))
    least = near if near > 0 else low
    if near > 0:
        yield 0.0
    if not (largest > 0 and least > 0):
        return
    powers = range(math.floor(math.log10(largest)), math.floor(math.log10(least)) - 1, -1)
    for factor in (1, 5, 2):
        for power in powers:
            value = factor * 10.0**power
            if value >= least * (1 - 1e-9):
                yield from (value, -value) if near > 0 else (value,)


def _ends(panel: Panel, axis: str) -> tuple[float, float]:
    """Limits of what is drawn, or those of the panel."""
    given = panel.x_limits if axis == "x" else panel.y_limits
    if given is not None:
        return given
    if axis == "x":
        drawn = [each.x for part in (panel.curves, panel.bands, panel.dots, panel.bars) for each in part]
    else:
        drawn = [each.y for part in (panel.curves, panel.dots) for each in part]
        drawn += [end for part in (panel.bands, panel.bars) for each in part for end in (each.low, each.high)]
    log = panel.log_x if axis == "x" else panel.log_y
    values = np.concatenate([np.asarray(each, dtype=float).ravel() for each in drawn] or [np.zeros(0)])
    values = values[np.isfinite(values) & ((values > 0) | (not log))]
    if not len(values):
        return (0.1, 1.0) if log else (0.0, 1.0)
    low, high = float(values.min()), float(values.max())
    if log:
        room = (high / low) ** _MARGIN if high > low else 1.5
        return low / room, high * room
    margin = _MARGIN * (high - low) or abs(high) or 1.0
    return low - margin, high + margin


# --- parts ------------------------------------------------------------------------------------------------------------


def _grid(panel: Panel, x: _Axis, y: _Axis) -> Iterator[str]:
    """Numbers at both axes, light lines across, the axes themselves."""
    right, bottom = x.end, y.begin
    for value in y.ticks(_APART["y"]):
        at = f"{float(y.at(value)):.1f}"
        yield f'<path class="grid" d="M{_LEFT} {at}H{right}"/>'
        yield f'<text class="number" x="{_LEFT - 6}" y="{at}" dy="0.35em" text-anchor="end">{_number(value)}</text>'
    for value in x.ticks(_APART["x"]):
        at = f"{float(x.at(value)):.1f}"
        yield f'<path class="axis" d="M{at} {bottom}v4"/>'
        yield f'<text class="number" x="{at}" y="{bottom + 16}" text-anchor="middle">{_number(value)}</text>'
    yield f'<path class="axis" d="M{_LEFT} {_TOP}V{bottom}H{right}"/>'


def _labels(panel: Panel, width: int, height: int) -> Iterator[str]:
    middle = (_TOP + height - _BOTTOM) / 2
    yield f'<text class="title" x="4" y="16">{escape(panel.title)}</text>'
    centre = (_LEFT + width - _RIGHT) / 2
    yield f'<text x="{centre}" y="{height - 8}" text-anchor="middle">{escape(panel.x_label)}</text>'
    yield f'<text transform="translate(13 {middle}) rotate(-90)" text-anchor="middle">{escape(panel.y_label)}</text>'


def _bands(panel: Panel, x: _Axis, y: _Axis) -> Iterator[str]:
    for band in panel.bands:
        along = x.at(band.x)
        around = np.concatenate([along, along[::-1]]), np.concatenate([y.at(band.low), y.at(band.high)[::-1]])
        if path := _path(*around):
            style = STYLES[band.style]
            yield f'<path d="{path}Z" fill="{style.colour}" fill-opacity="{style.alpha}"/>'


def _curves(panel: Panel, x: _Axis, y: _Axis) -> Iterator[str]:
    for curve in panel.curves:
        if path := _path(x.at(curve.x), y.at(curve.y)):
            yield f'<path d="{path}" {_stroke(STYLES[curve.style])}/>'


def _bars(panel: Panel, x: _Axis, y: _Axis) -> Iterator[str]:
    for bars in panel.bars:
        ends = zip(x.at(bars.x).tolist(), y.at(bars.low).tolist(), y.at(bars.high).tolist(), strict=True)
        path = "".join(f"M{at:.1f} {low:.1f}V{high:.1f}" for at, low, high in ends if math.isfinite(at + low + high))
        yield f'<path d="{path}" {_stroke(STYLES[bars.style])}/>'


def _dots(panel: Panel, x: _Axis, y: _Axis) -> Iterator[str]:
    for dots in panel.dots:
        style = STYLES[dots.style]
        face = style.colour if style.filled else "#fff"
        for at, height in zip(x.at(dots.x).tolist(), y.at(dots.y).tolist(), strict=True):
            if math.isfinite(at + height):
                yield f'<circle cx="{at:.1f}" cy="{height:.1f}" r="{_DOT}" fill="{face}" stroke="{style.colour}"/>'


def _stroke(style: Style) -> str:
    dashes = f' stroke-dasharray="{_DASHES[style.dash]}"' if style.dash != "-" else ""
    return f'fill="none" stroke="{style.colour}" stroke-width="{style.width}" stroke-opacity="{style.alpha}"{dashes}'


def _path(x: Numbers, y: Numbers) -> str:
    """Lines from point to point, broken where one is not finite."""
    shown = (np.isfinite(x) & np.isfinite(y)).tolist()
    parts: list[str] = []
    pen = "M"
    for there, at, height in zip(shown, x.tolist(), y.tolist(), strict=True):
        if there:
            parts.append(f"{pen}{at:.1f} {height:.1f}")
        pen = "L" if there else "M"
    return "".join(parts)


def _number(value: float) -> str:
    """As short as it can be told."""
    mantissa, _, exponent = f"{value:.6g}".partition("e")
    return (f"{mantissa}e{int(exponent)}" if exponent else mantissa).replace("-", "−")
