"""The figures of the demo: torques of the index finger, errors of the two-joint finger."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from tendonfmu.arrays import Numbers
from tendonfmu.calibration import text as calibration_text
from tendonfmu.demo.run import ABDUCTION, FLEXION, FREE, FREE_X4, PUSHES, Curves, IndexFinger
from tendonfmu.drawing import Bars, Curve, Dots, Interval, Panel, Sheet, line_of
from tendonfmu.estimate import FitPicture
from tendonfmu.report import column, law_sheets, residual_tables, together, torque_sheets

SHOWN = (20.0, 40.0)  # s, on the page
_TORQUE, _LEFT = {"measured": "measured", "predicted": "predicted"}, {"compensated": "after"}
_TORQUE_KEYS = (("measured", "joint torque due to the tendons"), ("predicted", "friction and bias, predicted"))


# --- the index finger: detect and run ---------------------------------------------------------------------------------


def run_sheet(finger: IndexFinger) -> Sheet:
    """Draw free motion at both pretensions."""
    panels = []
    for name, motion in ((FREE, "free motion"), (FREE_X4, "the same motion, tendons pulled tighter")):
        title = f"{motion}, {finger.results[name].mean_force:.0f} N"
        alt = f"Joint {_spaced(FLEXION)}, {title}: measured torque, the FMU's prediction, and what is left"
        panels.append(_panel(finger.curves(name, FLEXION), _TORQUE | _LEFT, title, alt, "free", SHOWN))
    return Sheet("run", "run", "", (*_TORQUE_KEYS, ("after", "what is left of it")), panels)


def push_sheet(finger: IndexFinger) -> Sheet:
    """Draw what is left of the torque while the fingertip is pushed, and when contact is reported."""
    panels = []
    for joint in (ABDUCTION, FLEXION):
        curves, name = finger.curves(PUSHES, joint), _spaced(joint)
        alt = (
            f"Joint {name} while the fingertip is pushed: what is left of the torque, the external torque as a sensor "
            "measures it, and when contact is reported"
        )
        panel = _panel(curves, {"external": "slow"} | _LEFT, name, alt, "pushes", SHOWN)
        low, high = panel.y_limits or (0.0, 0.0)
        alarms = _within([*curves.found, *curves.false], SHOWN)
        below = low - 0.05 * (high - low)
        panels.append(
            replace(
                panel,
                curves=(*panel.curves, Curve("negative", *line_of(alarms, below))),
                stripes={"standstill": _within(curves.labelled, SHOWN)},
                y_limits=(below - 0.05 * (high - low), high),
            )
        )
    keys = (
        ("after", "joint torque, friction subtracted"),
        ("slow", "external torque, by a reference sensor that the FMU does not have"),
        ("standstill", "somebody pushes"),
        ("negative", "the FMU reports contact"),
    )
    return Sheet("detect", "detect", "", keys, panels)


def compensated_sheet(finger: IndexFinger) -> Sheet:
    """Draw all three recordings whole: torques above, what is left of them below (the paper's figs. 6 to 8)."""
    drawn = [
        ("(a) free motion", FREE, FLEXION),
        ("(b) the same motion", FREE_X4, FLEXION),
        ("(c) with pushes", PUSHES, ABDUCTION),
        ("(d) with pushes", PUSHES, FLEXION),
    ]
    panels: list[Panel] = []
    for k in (0, 2):  # panels are side by side in pairs
        pair = [(title, name, finger.curves(name, joint)) for title, name, joint in drawn[k : k + 2]]
        shown = (0.0, float(pair[0][2].time[-1]))
        for title, name, curves in pair:
            heading = f"{title}, {finger.results[name].mean_force:.0f} N: {curves.joint}"
            panels.append(_panel(curves, _TORQUE, heading, heading, "", shown))
        for title, _, curves in pair:
            left = {"external": "external"} | _LEFT if "external" in curves.torques else _LEFT
            stripes = {"found_stripe": curves.found, "false_stripe": curves.false}
            panels.append(replace(_panel(curves, left, "what is left", title, "", shown), stripes=stripes))
    pushes = finger.curves(PUSHES, FLEXION)
    bars = (("found_bar", pushes.found, 0), ("false_bar", pushes.false, 0), ("missed", pushes.labelled, 1))
    contacts = Panel(
        title="contact with pushes",
        alt="When contact is found, and when it is labelled",
        x_label="time (s)",
        y_label="",
        size="medium",
        height=150,
        curves=tuple(Curve(style, *line_of(spans, row)) for style, spans, row in bars),
        rows=("found", "labelled"),
        x_limits=(0.0, float(pushes.time[-1])),
    )
    keys = (
        ("measured", "measured joint torque"),
        ("predicted", "predicted friction and bias"),
        ("after", "compensated torque"),
        ("external", "external torque (sensor)"),
        ("found_stripe", "contact found"),
        ("false_stripe", "found without a push"),
        ("missed", "contact labelled"),
    )
    title = f"{finger.description.name}: friction compensation"
    return Sheet("compensated", "compensated", title, keys, (*panels, contacts))


def _panel(curves: Curves, styles: Mapping[str, str], title: str, alt: str, zoom: str, shown: Interval) -> Panel:
    """Draw some of the torques of a joint over a span of time."""
    samples = (curves.time >= shown[0]) & (curves.time <= shown[1])
    torques = {name: 1e3 * np.asarray(curves.torques[name], dtype=float)[samples] for name in styles}
    low, high = (float(end([end(torque) for torque in torques.values()])) for end in (np.min, np.max))
    room = 0.06 * (high - low)
    return Panel(
        title=title,
        alt=alt,
        x_label="time (s)",
        y_label="torque (mN·m)",
        size="medium",
        curves=tuple(Curve(styles[name], curves.time[samples], torque) for name, torque in torques.items()),
        x_limits=shown,
        y_limits=(low - room, high + room),
        height=270,
        zoom=zoom,
    )


def _within(spans: Sequence[Interval], shown: Interval) -> list[Interval]:
    begin, end = shown
    return [(max(first, begin), min(last, end)) for first, last in spans if last > begin and first < end]


def _spaced(name: str) -> str:
    return name.replace("_", " ")


# --- the two-joint finger: calibrate and fit --------------------------------------------------------------------------


def calibration_sheet(report: Mapping[str, Any]) -> Sheet:
    """Draw the error before and after the calibration, by pretension and joint, and of all joints."""
    places, error = calibration_text.places(report), report["error"]
    names = [*(place.words for place in places), "all"]
    errors = [
        1e3 * np.array([*(getattr(place, key) for place in places), together(error[model])])
        for key, model in (("before", "as_given"), ("after", "calibrated"))
    ]
    panel = _error_panel("On a recording that it has not seen", "mN·m", names, *errors)
    keys = (("before_dots", "the description as given"), ("after_dots", "calibrated"))
    return Sheet("calibrate", "calibrate_error", "", keys, (panel,))


def fit_sheets(picture: FitPicture) -> Iterator[Sheet]:
    """Draw the errors before and after the fit, the torque that was not trained on, and the friction in the joints."""
    panels = []
    titles = ("On the training recording", "On a recording that it has not seen")
    for table, title in zip(residual_tables(picture), titles, strict=True):
        rows = table.rows[:-1]
        errors = [np.array(column([getattr(row, key) for row in rows])) for key in ("start", "fitted", "bias_only")]
        panels.append(_error_panel(title, table.unit, [row.name for row in rows], *errors))
    keys = (("floor", "no friction model"), ("before_dots", "before the fit"), ("after_dots", "fitted"))
    yield Sheet("fit", "fit_error", "", keys, panels)
    *_, unseen = torque_sheets(picture)
    yield Sheet("fit", "fit_torque", "", unseen.keys, unseen.panels)
    joints = next(sheet for sheet in law_sheets(picture) if sheet.name == "laws_joints")
    yield Sheet("fit", "fit_laws", "", joints.keys, joints.panels)


def _error_panel(title: str, unit: str, names: Sequence[str], before: Numbers, after: Numbers, *none: Numbers) -> Panel:
    """Draw the rms of each joint [k]: before and after, and without a friction model if that is known."""
    places = np.arange(len(names), dtype=float)
    styles = ("before_dots", "after_dots", "floor")
    dots = [Dots(style, values, places) for style, values in zip(styles, (before, after, *none), strict=False)]
    return Panel(
        title=title,
        alt=f"{title}: error by joint before and after{', and without a friction model' if none else ''}",
        x_label=f"rms ({unit})",
        y_label="",
        bars=(Bars("data", places, np.minimum(before, after), np.maximum(before, after), lying=True),),
        dots=tuple(reversed(dots)),
        rows=tuple(map(_spaced, names)),
        x_limits=(0.0, 1.08 * float(np.nanmax([before, after, *none]))),
        height=110 + 30 * len(names),
    )
