"""What the figures of a diagnosis show: sheets of panels (`drawing/panel.py`), ready to be drawn."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from tendonfmu.arrays import Numbers
from tendonfmu.diagnosis import Cause, Diagnosis, Evidence, Names, ResidualView, at_place
from tendonfmu.drawing import DIVERGING, Band, Bars, Curve, Dots, Heat, Panel, Sheet
from tendonfmu.files import counted
from tendonfmu.report.diagnosis_text import names_of, unit_of
from tendonfmu.report.diagnosis_words import Words, words_of
from tendonfmu.report.numbers import capital, unit_text, with_ends

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
_STYLES = ("before", "after")
_CAUSE_KEYS = (("before_dots", "without it"), ("after_dots", "with it"), ("after", "95 % interval of the mean"))
_CHANGE_KEYS = (
    ("reference_dots", "then, in the reference"),
    ("before_dots", "now"),
    ("after_dots", "now, with the change in the model"),
    ("after", "95 % interval of the mean"),
)
_ROOM = 3.0  # times the largest mean: the y axis shows no more of the scatter, so that the means stay visible


def diagnosis_sheets(diagnosis: Diagnosis) -> list[Sheet]:
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


def _map_sheets(diagnosis: Diagnosis, names: Names) -> Iterator[Sheet]:
    """Show where a part without a name is, over the two signals that it follows best."""
    shown, (factor, unit) = diagnosis.unexplained.map, unit_of(diagnosis)
    if shown is None:
        return
    torque = factor * shown.torque
    most = float(np.nanquantile(np.abs(torque), 0.98))
    joint, (one, two) = names.joint(shown.joint), shown.labels
    x, y = (0.5 * (edges[1:] + edges[:-1]) for edges in shown.edges)
    title = f"What remains at {joint}, over {one.split(' (')[0]} and {two.split(' (')[0]}"
    panel = Panel(
        title="Mean residual of the extended model" if diagnosis.torque_causes else "Mean residual",
        alt=f"{title}, from {-most:.2g} to {most:.2g} {unit}",
        x_label=one,
        y_label=two,
        note=f"blue −{most:.2g}, red +{most:.2g} {unit}",
        heat=Heat(torque, x, y, DIVERGING, -most, most, unit),
    )
    caption = "One colour in a whole region is a torque that comes back there each time. Cells without data are empty."
    yield Sheet(section="views", name="views_map", title=title, caption=caption, keys=(), panels=(panel,))


# --- evidence for a cause ---------------------------------------------------------------------------------------------


def _cause_sheet(diagnosis: Diagnosis, names: Names, number: int, cause: Cause) -> Sheet:
    factor, unit = unit_of(diagnosis)
    panels = tuple(_evidence_panel(evidence, names, factor, unit) for evidence in cause.evidence)
    return Sheet(
        section=f"cause_{number}",
        name=f"cause_{number}",
        title=f"{number}. {at_place(capital(cause.title), cause.where, names)}",
        caption="",
        keys=_CHANGE_KEYS if cause.changed else _CAUSE_KEYS,
        panels=(*_same_scale(panels), *_by_recording(diagnosis, cause)),
    )


def _by_recording(diagnosis: Diagnosis, cause: Cause) -> Iterator[Panel]:
    """Show how large a change is in each of several new recordings."""
    changed = cause.changed
    if changed is None or not changed.by:
        return
    factor, unit = (1.0, unit_text(changed.unit)) if unit_text(changed.unit) else (100.0, "%")
    x = np.arange(1.0, len(changed.by) + 1.0)
    value, low, high = with_ends(changed.by, factor)
    then = np.full(2, factor * changed.reference.value)
    yield Panel(
        title="In each of the new recordings",
        alt=f"Size of this change in each of {counted(len(changed.by), 'new recording')}, in their order",
        x_label="new recording, in the order given",
        y_label=f"{changed.number.replace('_', ' ')} ({unit})",
        curves=(Curve("after_line", x, value), Curve("start", np.array([1.0, x[-1]]), then)),
        bars=(Bars("after", x, low, high),),
        dots=(Dots("after_dots", x, value),),
        ticks=tuple((float(k), str(int(k))) for k in x) if len(x) <= 12 else (),
    )


def _evidence_panel(evidence: Evidence, names: Names, factor: float, unit: str) -> Panel:
    shown = [("before", evidence.before, evidence.before_std), ("after", evidence.after, evidence.after_std)]
    if evidence.reference is not None and evidence.reference_std is not None:
        shown.append(("reference", evidence.reference, evidence.reference_std))
    x, x_unit = (factor * evidence.coordinate, unit) if evidence.unit == "N·m" else (evidence.coordinate, evidence.unit)
    return Panel(
        title=f"Residual at {names.joint(evidence.joint)}",
        alt=f"Mean residual at {names.joint(evidence.joint)} over {evidence.label}, without and with this in the model",
        x_label=f"{evidence.label} ({x_unit})",
        y_label=f"residual ({unit})",
        curves=tuple(Curve(f"{style}_line", x, factor * mean) for style, mean, _ in shown),
        bars=tuple(
            Bars(style, x, factor * (mean - TWO_SIDED * std), factor * (mean + TWO_SIDED * std))
            for style, mean, std in shown
        ),
        dots=tuple(Dots(f"{style}_dots", x, factor * mean) for style, mean, _ in shown),
        near_x=_near(evidence.coordinate) if evidence.label.startswith("travel") else 0.0,
    )


def _near(travel: Numbers) -> float:
    """Return the travel (rad) up to which the axis is linear: most happens right after a reversal."""
    size = np.abs(travel[np.isfinite(travel)])
    return float(np.quantile(size, 0.25)) if len(size) else 0.0


def _same_scale(panels: Sequence[Panel]) -> tuple[Panel, ...]:
    """Give all panels the limits of the widest, so that they can be compared."""
    ends = [end for panel in panels for bars in panel.bars for end in (*bars.low, *bars.high) if math.isfinite(end)]
    if not ends:
        return tuple(panels)
    margin = 0.06 * (max(ends) - min(ends)) or 1.0
    limits = (min(ends) - margin, max(ends) + margin)
    return tuple(replace(panel, y_limits=limits) for panel in panels)


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


def _joint_sheet(diagnosis: Diagnosis, names: Names, joint: int, views: Sequence[ResidualView]) -> Sheet:
    factor, unit = unit_of(diagnosis)
    if not diagnosis.torque_causes:  # the extended model is the nominal one
        views = [replace(view, after=np.full_like(view.after, math.nan)) for view in views]
    limits = _shared_limits([view for view in views if view.kind in _BINNED], factor)
    return Sheet(
        section="views",
        name=f"residual_{joint}",
        title=f"Residual at {names.joint(joint)}",
        caption="",
        keys=(
            *(_before_after(diagnosis) if diagnosis.torque_causes else _before_after(diagnosis)[:1]),
            ("before_scatter", f"scatter within a bin, {words_of(diagnosis.kind).nominal}"),
        ),
        panels=tuple(_view_panel(view, names, factor, unit, limits, words_of(diagnosis.kind)) for view in views),
    )


def _before_after(diagnosis: Diagnosis) -> tuple[tuple[str, str], ...]:
    words = words_of(diagnosis.kind)
    return ("before", words.refitted), ("after", words.extended)


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
) -> Panel:
    title = _TITLES.get(view.kind, f"Over {view.label}")
    models = f"of the {words.nominal} and of the {words.extended}"
    panel = Panel(
        title=title,
        alt=f"Residual at {names.joint(view.joint)}, {title.lower()}, {models}",
        x_label=f"{view.label} ({view.unit})" if view.unit not in ("", "1") else view.label,
        y_label=f"residual ({unit})",
    )
    if view.unit == "N·m":  # all torques in one unit
        view = replace(view, x=factor * view.x, unit=unit)
        panel = replace(panel, x_label=f"{view.label} ({unit})")
    if view.kind == "spectrum":
        return _spectrum(panel, view, factor, unit)
    if view.kind == "autocorrelation":
        curves = (Curve("start", view.x, np.zeros_like(view.x)), *_curves(view, 1.0))
        return replace(panel, y_label="", curves=curves, y_limits=(min(-0.25, 1.1 * _least(view)), 1.05))
    if view.kind not in _BINNED:
        return replace(panel, curves=_curves(view, factor), zoom=view.kind if view.kind == "time" else "")
    bands: tuple[Band, ...] = ()
    if view.before_std is not None:
        low, high = view.before - view.before_std, view.before + view.before_std
        bands = (Band("before_scatter", view.x, factor * low, factor * high),)
    near = _near(view.x) if view.kind == "travel" else 0.0
    return replace(panel, bands=bands, curves=_curves(view, factor), y_limits=limits, near_x=near)


def _spectrum(panel: Panel, view: ResidualView, factor: float, unit: str) -> Panel:
    shown = view.x > 0
    curves = tuple(replace(curve, x=curve.x[shown], y=curve.y[shown]) for curve in _curves(view, factor**2))
    return replace(panel, y_label=f"power (({unit})²/Hz)", curves=curves, log_x=True, log_y=True)


def _curves(view: ResidualView, factor: float) -> tuple[Curve, ...]:
    return tuple(Curve(style, view.x, factor * getattr(view, style)) for style in _STYLES)


def _least(view: ResidualView) -> float:
    return float(np.nanmin([view.before, view.after]))
