"""What the page of a run shows over time: torques by joint, contact and slack, motion."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu.drawing import Band, Curve, Panel, Sheet
from tendonfmu.recordings import flagged_stretches
from tendonfmu.report.figure_data import Interval

Table = Mapping[str, NDArray[Any]]

ZOOM = "time"  # all panels are zoomed together
_TIME = "time (s)"
_KEYS = (
    ("measured", "joint torque"),
    ("predicted", "friction torque"),
    ("after", "compensated torque"),
    ("confidence", "± one standard deviation"),
    ("in_contact", "contact"),
)


def run_sheets(
    table: Table, joints: Sequence[str], tendons: Sequence[str], label: NDArray[Any] | None = None
) -> Iterator[Sheet]:
    """Yield the figures of a run."""
    # table: [N]
    factor, unit = _torque_unit(table, len(joints))
    for j, name in enumerate(joints, start=1):
        yield Sheet(
            section="joints",
            name=f"joint_{j}",
            title=name,
            caption="",
            keys=tuple(_keys_of(table, j)),
            panels=tuple(_torque_panels(table, j, name, factor, unit)),
        )
    yield _events_sheet(table, joints, tendons, label)
    yield Sheet(
        section="motion",
        name="motion",
        title="Joint angles and speeds",
        caption="",
        keys=(("fitted", "angle"), ("slow", "speed")),
        panels=tuple(_motion_panels(table, joints)),
        folded=True,
    )


def _keys_of(table: Table, j: int) -> Iterator[tuple[str, str]]:
    drawn = {"in_contact": table[f"joint_contact[{j}]"], "confidence": table[f"compensated_torque_std[{j}]"]}
    yield from (key for key in _KEYS if np.any(drawn.get(key[0], True)))


def _torque_unit(table: Table, joints: int) -> tuple[float, str]:
    """Choose N·m or mN·m by the largest torque: factor and name of the unit."""
    largest = max(float(np.abs(table[f"joint_torque[{j}]"]).max()) for j in range(1, joints + 1))
    return (1.0, "N·m") if largest >= 1.0 else (1e3, "mN·m")


def _torque_panels(table: Table, j: int, name: str, factor: float, unit: str) -> Iterator[Panel]:
    time, contact = table["time"], tuple(flagged_stretches(table["time"], table[f"joint_contact[{j}]"]))
    torque, friction, left, std = (
        factor * np.asarray(table[f"{key}[{j}]"], dtype=np.float64)
        for key in ("joint_torque", "friction_torque", "compensated_torque", "compensated_torque_std")
    )
    yield Panel(
        title="Torque and friction",
        note=f"{_rms(torque):.3g} {unit} rms",
        alt=f"Joint torque of {name} and its friction torque over time",
        x_label=_TIME,
        y_label=f"torque ({unit})",
        size="medium",
        curves=(Curve("measured", time, torque), Curve("predicted", time, friction)),
        stripes=contact,
        stripe_style="in_contact",
        zoom=ZOOM,
    )
    yield Panel(
        title="Compensated torque",
        note=f"{_rms(left):.3g} {unit} rms",
        alt=f"Compensated torque of {name} over time, and when contact was detected there",
        x_label=_TIME,
        y_label=f"torque ({unit})",
        size="medium",
        bands=(Band("confidence", *_thinned_band(time, left - std, left + std)),) if std.any() else (),
        curves=(Curve("after", time, left),),
        stripes=contact,
        stripe_style="in_contact",
        zoom=ZOOM,
    )


_MOST = 1000  # stretches of a band; curves are thinned where they are drawn


def _thinned_band(
    time: NDArray[Any], low: NDArray[Any], high: NDArray[Any]
) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
    """Thin a band to the extremes of at most `_MOST` stretches of samples."""
    if len(time) <= 2 * _MOST:
        return time, low, high
    begins = np.unique(np.linspace(0, len(time), _MOST, endpoint=False).astype(int))
    middles = (begins + np.append(begins[1:], len(time)) - 1) // 2
    return time[middles], np.minimum.reduceat(low, begins), np.maximum.reduceat(high, begins)


def _events_sheet(table: Table, joints: Sequence[str], tendons: Sequence[str], label: NDArray[Any] | None) -> Sheet:
    time = table["time"]
    rows: list[tuple[str, str, list[Interval]]] = []
    if label is not None:
        rows.append(("labelled contact", "labelled", flagged_stretches(time, label)))
    rows += [
        (f"contact, {name}", "contact", flagged_stretches(time, table[f"joint_contact[{j}]"]))
        for j, name in enumerate(joints, start=1)
    ]
    slack = [
        (f"slack, {name}", "slack", flagged_stretches(time, table[f"slack[{i}]"])) for i, name in enumerate(tendons, 1)
    ]
    rows += [row for row in slack if row[2]]  # only tendons that have been slack
    used = {style for _, style, found in rows if found}
    meanings = (("labelled", "contact as labelled"), ("contact", "contact as detected"), ("slack", "tendon slack"))
    panel = Panel(
        title="Over time",
        alt="When contact was detected at each joint, and when a tendon was slack",
        x_label=_TIME,
        y_label="",
        size="large" if len(rows) > 8 else "medium",
        curves=tuple(Curve(style, *_line_of(found, row)) for row, (_, style, found) in enumerate(rows) if found),
        rows=tuple(name for name, _, _ in rows),
        x_limits=(float(time[0]), float(time[-1])) if time[-1] > time[0] else None,
        zoom=ZOOM,
    )
    return Sheet(
        section="events",
        name="events",
        title="Contact and slack",
        caption="" if used else "No contact was detected, and no tendon was slack.",
        keys=tuple(key for key in meanings if key[0] in used),
        panels=(panel,) if used else (),
    )


def _line_of(stretches: Sequence[Interval], row: int) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return a line at the height of the row that is broken between the stretches."""
    x = np.array([each for begin, end in stretches for each in (begin, end, np.nan)])
    return x, np.where(np.isfinite(x), float(row), np.nan)


def _motion_panels(table: Table, joints: Sequence[str]) -> Iterator[Panel]:
    time = table["time"]
    for key, style, unit in (("angle", "fitted", "rad"), ("speed", "slow", "rad/s")):
        for j, name in enumerate(joints, start=1):
            yield Panel(
                title=f"{name}: {key}",
                alt=f"Joint {key} of {name} over time",
                x_label=_TIME,
                y_label=f"{key} ({unit})",
                curves=(Curve(style, time, np.asarray(table[f"joint_{key}[{j}]"], dtype=np.float64)),),
                zoom=ZOOM,
            )


def _rms(values: NDArray[Any]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))
