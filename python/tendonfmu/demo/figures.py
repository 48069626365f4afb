"""The figures of the demo's page: torques of the index finger, errors of the two-joint finger."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from tendonfmu.arrays import Numbers
from tendonfmu.calibrate import rms_of
from tendonfmu.demo.demo import Story
from tendonfmu.demo.run import ABDUCTION, FLEXION, FREE, FREE_X4, PUSHES
from tendonfmu.drawing import Bars, Curve, Dots, Interval, Panel, Sheet
from tendonfmu.report import CompensationFigure, JointCurves, law_sheets, residual_tables, torque_sheets

SHOWN = (20.0, 40.0)  # s
_HEIGHT = 270  # CSS pixels


def story_sheets(story: Story) -> Iterator[Sheet]:
    """Yield all figures except those of the diagnosis, each in the section of its chapter."""
    yield _push_sheet(story)
    yield _free_sheet(story)
    if story.missing:
        return
    yield _calibration_sheet(story)
    yield _error_sheet(story)
    yield from _fit_sheets(story)


# --- the index finger: detect and run ---------------------------------------------------------------------------------


def _free_sheet(story: Story) -> Sheet:
    finger = story.finger
    titles = {FREE: "free motion", FREE_X4: "the same motion, tendons pulled tighter"}
    figures = [
        finger.curves(name, [FLEXION], f"{title}, {finger.results[name].mean_force:.0f} N")
        for name, title in titles.items()
    ]
    shown = [_during(figure, SHOWN) for figure in figures]
    panels = [
        _panel(
            figure,
            figure.joints[0],
            samples,
            figure.title,
            f"Joint {FLEXION.replace('_', ' ')}, {figure.title}: measured torque, the FMU's prediction, and "
            "what is left",
            ("measured", "predicted", "compensated"),
        )
        for figure, samples in zip(figures, shown, strict=True)
    ]
    keys = (("measured", "joint torque due to the tendons"), ("predicted", "friction and bias, predicted"))
    return Sheet("run", "run", "", "", (*keys, ("after", "what is left of it")), tuple(panels))


def _push_sheet(story: Story) -> Sheet:
    figure = story.finger.curves(PUSHES, [ABDUCTION, FLEXION], "pushes")
    samples = _during(figure, SHOWN)
    panels = [
        _panel(
            figure,
            joint,
            samples,
            joint.name.replace("_", " "),
            f"Joint {joint.name.replace('_', ' ')} while the fingertip is pushed: what is left of the torque, the "
            "external torque as a sensor measures it, and when contact is reported",
            ("external", "compensated"),
            pushes=True,
        )
        for joint in figure.joints
    ]
    keys = (
        ("after", "joint torque, friction subtracted"),
        ("slow", "external torque, by a reference sensor that the FMU does not have"),
        ("standstill", "somebody pushes"),
        ("negative", "the FMU reports contact"),
    )
    return Sheet("detect", "detect", "", "", keys, tuple(panels))


_STYLES = {"measured": "measured", "predicted": "predicted", "compensated": "after", "external": "slow"}


def _panel(
    figure: CompensationFigure,
    joint: JointCurves,
    samples: NDArray[np.bool_],
    title: str,
    alt: str,
    drawn: Sequence[str],
    *,
    pushes: bool = False,
) -> Panel:
    time = figure.time[samples]
    values = {name: 1e3 * np.asarray(getattr(joint, name), dtype=float)[samples] for name in drawn}
    curves = [Curve(_STYLES[name], time, each) for name, each in values.items()]
    low, high = (function([function(each) for each in values.values()]) for function in (np.min, np.max))
    room = 0.06 * float(high - low)
    limits = (float(low) - (3 if pushes else 1) * room, float(high) + room)
    if pushes:
        curves += _alarm([*figure.found, *figure.false], limits[0] + room)
    return Panel(
        title=title,
        alt=alt,
        x_label="time (s)",
        y_label="torque (mN·m)",
        size="medium",
        curves=tuple(curves),
        stripes=tuple(_within(figure.labelled or [], SHOWN)) if pushes else (),
        stripe_style="standstill",
        x_limits=SHOWN,
        y_limits=limits,
        height=_HEIGHT,
        zoom="pushes" if pushes else "free",
    )


def _during(figure: CompensationFigure, span: Interval) -> NDArray[np.bool_]:
    return np.asarray((figure.time >= span[0]) & (figure.time <= span[1]))


def _within(spans: Sequence[Interval], shown: Interval) -> Iterator[Interval]:
    for begin, end in spans:
        if end > shown[0] and begin < shown[1]:
            yield max(begin, shown[0]), min(end, shown[1])


def _alarm(spans: Sequence[Interval], height: float) -> list[Curve]:
    """Draw a line at this height wherever contact is reported."""
    ends = [np.array([begin, end]) for begin, end in _within(spans, SHOWN)]
    return [Curve("negative", each, np.full(2, height)) for each in ends]


# --- the two-joint finger: calibrate and fit --------------------------------------------------------------------------


def _calibration_sheet(story: Story) -> Sheet:
    """Draw the error before and after the calibration, by joint."""
    report = story.calibration.report
    names = [*report["joints"], "all joints"]
    none, before, after = (
        1e3 * np.array([*report["error"][model], rms_of(report["error"][model])])
        for model in ("bias_only", "as_given", "calibrated")
    )
    panel = _error_panel("On a recording that it has not seen", "mN·m", names, none, before, after)
    keys = (("floor", "no friction model"), ("before_dots", "the description as given"), ("after_dots", "calibrated"))
    return Sheet("calibrate", "calibrate_error", "", "", keys, (panel,))


def _error_sheet(story: Story) -> Sheet:
    """Draw the error before and after the fit, by joint."""
    tables = list(residual_tables(story.fit.picture()))
    panels = []
    for table, title in zip(tables, ("On the training recording", "On a recording that it has not seen"), strict=True):
        rows = table.rows[:-1]
        none, before, after = (
            np.array([np.nan if value is None else value for value in values])
            for values in (
                [row.bias_only for row in rows],
                [row.start for row in rows],
                [row.fitted for row in rows],
            )
        )
        panels.append(_error_panel(title, table.unit, [row.name for row in rows], none, before, after))
    keys = (("floor", "no friction model"), ("before_dots", "before the fit"), ("after_dots", "fitted"))
    return Sheet("fit", "fit_error", "", "", keys, tuple(panels))


def _error_panel(title: str, unit: str, names: Sequence[str], none: Numbers, before: Numbers, after: Numbers) -> Panel:
    """Draw the rms of each joint [k]: without a friction model, before, and after."""
    places = np.arange(len(names), dtype=float)
    return Panel(
        title=title,
        alt=f"{title}: error by joint without a friction model, before, and after",
        x_label=f"rms ({unit})",
        y_label="",
        bars=(Bars("data", places, np.minimum(before, after), np.maximum(before, after), lying=True),),
        dots=(
            Dots("floor", none, places),
            Dots("before_dots", before, places),
            Dots("after_dots", after, places),
        ),
        rows=tuple(name.replace("_", " ") for name in names),
        x_limits=(0.0, 1.08 * float(np.nanmax([*before, *after, *none]))),
        height=110 + 30 * len(names),
    )


def _fit_sheets(story: Story) -> Iterator[Sheet]:
    """Draw the torque over time of the recording that was not trained on, and the friction in the joints."""
    picture = story.fit.picture()
    *_, unseen = torque_sheets(picture)
    yield Sheet("fit", "fit_torque", "", "", unseen.keys, unseen.panels)
    for sheet in law_sheets(picture):
        if sheet.name == "laws_joints":
            yield Sheet("fit", "fit_laws", "", "", sheet.keys, sheet.panels)
