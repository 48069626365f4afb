"""The figures of a diagnosis: evidence for each cause, and what is left at each joint."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from tendonfmu import drawing as draw
from tendonfmu.arrays import Numbers
from tendonfmu.diagnosis import Cause, Diagnosis, Evidence, Names, ResidualView, at_place
from tendonfmu.report.diagnosis_text import names_of, unit_of
from tendonfmu.report.kit import Words, capital, words_of

TWO_SIDED = 1.96  # standard errors of a 95 % interval
_TITLES = {
    "time": "Over time",
    "angle": "Over the joint angle",
    "velocity": "Over the joint velocity",
    "tendon_force": "Over the tendon force",
    "load": "Over the load",
    "travel": "Over the travel since reversal",
    "spectrum": "Spectrum",
    "autocorrelation": "Autocorrelation",
}
_BINNED = ("angle", "velocity", "tendon_force", "load", "travel")
_ROOM = 3.0  # times the largest mean: the y axis shows no more of the scatter, so that the means stay visible


def diagnosis_sheets(diagnosis: Diagnosis) -> list[draw.Sheet]:
    """Make the sheets of a diagnosis: the evidence for each cause, then the residual at each joint."""
    names = names_of(diagnosis)
    return [
        *(
            _cause_sheet(diagnosis, names, k, cause)
            for k, cause in enumerate(diagnosis.causes, start=1)
            if cause.evidence
        ),
        *_map_sheets(diagnosis, names),
        *(_joint_sheet(diagnosis, names, j, views) for j, views in _by_joint(diagnosis.views)),
    ]


def _map_sheets(diagnosis: Diagnosis, names: Names) -> Iterator[draw.Sheet]:
    """Show where a part without a name is, over the two signals that it follows best."""
    shown, (factor, unit) = diagnosis.unexplained.map, unit_of(diagnosis)
    if shown is None:
        return
    torque = factor * shown.torque
    most = float(np.nanquantile(np.abs(torque), 0.98))
    joint, (one, two) = names.joint(shown.joint), shown.labels
    x, y = (0.5 * (edges[1:] + edges[:-1]) for edges in shown.edges)
    title = f"What remains at {joint}, over {one.split(' (')[0]} and {two.split(' (')[0]}"
    drawn = draw.panel(
        "Mean residual of the extended model" if diagnosis.torque_causes else "Mean residual",
        f"{title}, from {-most:.2g} to {most:.2g} {unit}",
        one,
        two,
        draw.heat(torque, x, y, draw.DIVERGING, (-most, most), unit),
        note=f"blue −{most:.2g}, red +{most:.2g} {unit}",
    )
    caption = "One colour in a whole region is a torque that comes back there each time. Cells without data are empty."
    yield draw.Sheet("views", "views_map", title, [drawn], caption)


# --- evidence for a cause ---------------------------------------------------------------------------------------------


def _cause_sheet(diagnosis: Diagnosis, names: Names, number: int, cause: Cause) -> draw.Sheet:
    factor, unit = unit_of(diagnosis)
    limits = _same_scale(cause.evidence, factor)
    panels = [_evidence_panel(each, names, (factor, unit), limits, bool(cause.changed)) for each in cause.evidence]
    title = f"{number}. {at_place(capital(cause.title), cause.where, names)}"
    return draw.Sheet(f"cause_{number}", f"cause_{number}", title, panels)


def _evidence_panel(
    evidence: Evidence, names: Names, scale: tuple[float, str], limits: draw.Interval | None, changed: bool
) -> draw.Panel:
    factor, unit = scale
    words = ("now", "now, with the change in the model") if changed else ("without it", "with it")
    shown = zip(
        (*words, "then, in the reference"), (draw.VERMILION, draw.BLUE, draw.DARK), _means_of(evidence), strict=False
    )
    x, x_unit = (factor * evidence.coordinate, unit) if evidence.unit == "N·m" else (evidence.coordinate, evidence.unit)
    intervals, lines, points = list[draw.Trace](), list[draw.Trace](), list[draw.Trace]()
    for name, colour, (low, mean, high) in shown:
        interval = "95 % interval of the mean" if colour == draw.BLUE else ""
        intervals += draw.bars(x, factor * low, factor * high, interval, colour, 1.2)
        lines.append(draw.curve(x, factor * mean, "", colour, 0.9, alpha=0.45))
        points.append(draw.dots(x, factor * mean, name, colour))
    return draw.panel(
        f"Residual at {names.joint(evidence.joint)}",
        f"Mean residual at {names.joint(evidence.joint)} over {evidence.label}, without and with this in the model",
        f"{evidence.label} ({x_unit})",
        f"residual ({unit})",
        intervals,
        lines,
        points,
        y_limits=limits,
        near_x=_near(evidence.coordinate) if evidence.label.startswith("travel") else 0.0,
    )


def _means_of(evidence: Evidence) -> Iterator[tuple[Numbers, Numbers, Numbers]]:
    """Yield 95 % interval and mean, (low, mean, high): without the cause, with it, and in the reference."""
    pairs = [(evidence.before, evidence.before_std), (evidence.after, evidence.after_std)]
    if evidence.reference is not None and evidence.reference_std is not None:
        pairs.append((evidence.reference, evidence.reference_std))
    yield from ((mean - TWO_SIDED * std, mean, mean + TWO_SIDED * std) for mean, std in pairs)


def _near(travel: Numbers) -> float:
    """Return the travel (rad) up to which the axis is linear: most happens right after a reversal."""
    size = np.abs(travel[np.isfinite(travel)])
    return float(np.quantile(size, 0.25)) if len(size) else 0.0


def _same_scale(evidence: Sequence[Evidence], factor: float) -> draw.Interval | None:
    """Return the y limits of several panels, so that they can be compared."""
    ends = [factor * end for each in evidence for low, _, high in _means_of(each) for end in (*low, *high)]
    ends = [end for end in ends if math.isfinite(end)]
    margin = 0.06 * (max(ends) - min(ends)) or 1.0 if ends else 0.0
    return (min(ends) - margin, max(ends) + margin) if ends else None


# --- the residual of a joint ------------------------------------------------------------------------------------------


def _by_joint(views: Sequence[ResidualView]) -> Iterator[tuple[int, list[ResidualView]]]:
    for joint in sorted({view.joint for view in views}):
        yield (
            joint,
            sorted(
                (view for view in views if view.joint == joint and np.isfinite(view.before).any()),
                key=lambda view: _order(view.kind),
            ),
        )


def _order(kind: str) -> int:
    return list(_TITLES).index(kind) if kind in _TITLES else len(_TITLES)


def _joint_sheet(diagnosis: Diagnosis, names: Names, joint: int, views: Sequence[ResidualView]) -> draw.Sheet:
    factor, unit = unit_of(diagnosis)
    if not diagnosis.torque_causes:  # the extended model is the nominal one
        views = [replace(view, after=np.full_like(view.after, math.nan)) for view in views]
    limits = _shared_limits([view for view in views if view.kind in _BINNED], factor)
    words, title = words_of(diagnosis.kind), f"Residual at {names.joint(joint)}"
    panels = [_view_panel(view, names, factor, unit, limits, words) for view in views]
    return draw.Sheet("views", f"residual_{joint}", title, panels)


def _shared_limits(views: Sequence[ResidualView], factor: float) -> tuple[float, float] | None:
    """Return y limits for all binned views of a joint: all means, and the scatter up to `_ROOM` times the largest."""
    means = [value for view in views for value in (*view.before, *view.after) if math.isfinite(value)]
    if not means:
        return None
    mean = max(abs(value) for value in means)
    ends = [(view.before, view.before_std) for view in views if view.before_std is not None]
    wide = max((float(np.nanmax(np.abs(m) + s, initial=0.0)) for m, s in ends), default=0.0)
    largest = factor * max(mean, min(wide, _ROOM * mean))
    return (-1.12 * largest, 1.12 * largest) if largest > 0 else None


def _view_panel(
    view: ResidualView, names: Names, factor: float, unit: str, limits: tuple[float, float] | None, words: Words
) -> draw.Panel:
    title = _TITLES.get(view.kind, f"Over {view.label}")
    models = f"of the {words.nominal} and of the {words.extended}"
    alt = f"Residual at {names.joint(view.joint)}, {title.lower()}, {models}"
    if view.unit == "N·m":  # all torques in one unit
        view = replace(view, x=factor * view.x, unit=unit)
    x_label = f"{view.label} ({view.unit})" if view.unit not in ("", "1") else view.label

    def drawn(y_label: str, factor: float, *below: draw.Trace | list[draw.Trace], **axes: Any) -> draw.Panel:
        shown = view.x > 0 if view.kind == "spectrum" else slice(None)
        before, after = (factor * values[shown] for values in (view.before, view.after))
        lines = (
            draw.curve(view.x[shown], before, words.refitted, draw.VERMILION, 1.0, alpha=0.9),
            draw.curve(view.x[shown], after, words.extended, draw.BLUE, 1.0),
        )
        return draw.panel(title, alt, x_label, y_label, *below, *lines, **axes)

    if view.kind == "spectrum":
        return drawn(f"power (({unit})²/Hz)", factor**2, log_x=True, log_y=True)
    if view.kind == "autocorrelation":
        least = min(-0.25, 1.1 * float(np.nanmin([view.before, view.after])))
        zero = draw.curve(view.x, np.zeros_like(view.x), "", draw.GREY, 1.1, "dash")
        return drawn("", 1.0, zero, y_limits=(least, 1.05))
    if view.kind not in _BINNED:
        return drawn(f"residual ({unit})", factor, zoom=view.kind if view.kind == "time" else "")
    scatter: list[draw.Trace] = []
    if view.before_std is not None:
        low, high = (factor * (view.before + side * view.before_std) for side in (-1, 1))
        scatter = draw.band(view.x, low, high, f"scatter within a bin, {words.nominal}", draw.VERMILION, 0.13)
    near = _near(view.x) if view.kind == "travel" else 0.0
    return drawn(f"residual ({unit})", factor, scatter, y_limits=limits, near_x=near)
