"""Writes a run as a recording of the viewer Rerun (`tendonfmu run --rerun`): signals, a moving drawing, and a layout.

The only module that imports rerun. Entities are named as in the table: `joints/mcp/torque/joint_torque`,
`tendons/flexor/tendon_force`. The lanes of contact are in alphabetical order: `contact/1_mcp`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu.arrays import Flags, Numbers, flagged_rows
from tendonfmu.drawing import BLUE, DARK, GREEN, GREY, IN_DARK, LIGHT, ORANGE, VERMILION
from tendonfmu.errors import InputError
from tendonfmu.files import check_output, whole_file
from tendonfmu.model import TENDON_COLOURS, BentDrawing, Finger, FingerDrawing, finger_drawing
from tendonfmu.recordings import Recording

INSTALL = 'pip install "tendonfmu[rerun]", or rerun-sdk'
TIMELINE = "time"
LATEST = 2.0**63  # ns; Rerun takes times as signed 64-bit integers
FRAMES_PER_SECOND = 30.0  # of the drawing, at most
MOST_POINTS = 4_000_000  # of all its frames together: 32 MB
THINNED = 4  # one point in so many of a drawn line
DOWN = np.array([1.0, -1.0], dtype=np.float32)  # y is downwards in Rerun

# name of an output -> name in the legend, colour
_TORQUES = {
    "joint_torque": ("pulled", DARK),
    "friction_torque": ("friction", ORANGE),
    "compensated_torque": ("compensated", BLUE),
}
_MOTION = {"joint_angle": ("angle (rad)", BLUE), "joint_speed": ("speed (rad/s)", ORANGE)}
_GROUPS = {"torque": _TORQUES, "motion": _MOTION}


def check_rerun(file: Path, *inputs: Path) -> None:
    """Check that a recording of Rerun can be written."""
    if file.suffix.lower() != ".rrd":
        raise InputError(f"{file}: unknown format {file.suffix!r}; expected .rrd")
    _rerun(file)
    check_output(file, *inputs)


def write_rerun(
    file: Path,
    outputs: Mapping[str, NDArray[Any]],
    recording: Recording,
    finger: Finger | None,
) -> None:
    """Write a run, whole or not at all; without a finger it has no names and no drawing."""
    # outputs: [N], [N, n] or [N, m]
    joints, tendons = outputs["joint_torque"].shape[1], outputs["slack"].shape[1]
    joint_names = _distinct(["joint"] * joints if finger is None else finger.joint_names)
    tendon_names = _distinct(["tendon"] * tendons if finger is None else finger.tendon_names)
    stream = _Stream(file, recording.path.stem if finger is None else finger.name, outputs["time"])
    for j, name in enumerate(joint_names):
        for group, curves in _GROUPS.items():
            for output, (word, colour) in curves.items():
                stream.send_curve(["joints", name, group, output], outputs[output][:, j], word, colour)
        for group in ("residual", "contact_level"):
            if group in outputs:  # FMUs built before version 0.2 lack them
                _send_detection(stream, [name, group], outputs[group][:, j], outputs["joint_contact"][:, j])
        stream.send_stretches(["contact", f"{j + 1}_{name}"], outputs["joint_contact"][:, j], "contact", VERMILION)
    if "external_torque" in recording.groups:
        for name, torque in zip(joint_names, recording.groups["external_torque"].T, strict=False):
            stream.send_curve(["joints", name, "torque", "external_torque"], torque, "reference sensor", GREEN)
    for i, name in enumerate(tendon_names):
        force, colour = recording.groups["tendon_force"][:, i], TENDON_COLOURS[i % len(TENDON_COLOURS)]
        stream.send_curve(["tendons", name, "tendon_force"], force, name, colour)
        if outputs["slack"][:, i].any():
            stream.send_stretches(["contact", f"slack_{name}"], outputs["slack"][:, i], "slack", ORANGE)
    if recording.contact is not None:
        stream.send_stretches(["contact", "label"], recording.contact, "labelled", GREY)
    bounds = None
    if finger is not None:
        bounds = _send_drawing(stream, finger_drawing(finger.data), outputs)
    data = stream.finished(_layout(stream.rr, joint_names, bounds))
    with whole_file(file) as temporary:
        temporary.write_bytes(data)


def _rerun(file: Path) -> Any:
    try:
        import rerun
        import rerun.blueprint

        if hasattr(rerun.blueprint, "StateTimelineView"):
            return rerun
    except ModuleNotFoundError:
        pass
    raise InputError(f"{file}: needs the Python package rerun-sdk, 0.32 or later; {INSTALL}")


def _distinct(names: Sequence[str]) -> list[str]:
    """Return names for entities, also where several joints or tendons have the same."""
    plain = [name.replace(" ", "_") for name in names]
    return plain if len(set(plain)) == len(plain) else [f"{name}_{k}" for k, name in enumerate(plain, start=1)]


# --- signals ----------------------------------------------------------------------------------------------------------


class _Stream:
    """A recording of Rerun in memory."""

    def __init__(self, file: Path, name: str, time: Numbers) -> None:
        if not np.abs(time[[0, -1]]).max() * 1e9 < LATEST:
            raise InputError(
                f"{file}: time {time[0]:g} to {time[-1]:g} s; Rerun holds times up to {LATEST / 1e9:.2g} s"
            )
        self.rr = _rerun(file)
        self.rr.set_strict_mode(True)  # else it reports its errors as warnings
        self.time = time
        self._recording = self.rr.RecordingStream("tendonfmu", send_properties=True)
        self._recording.send_recording_name(name)
        self._bytes = self._recording.binary_stream()
        self._times = np.round(time * 1e9).astype("timedelta64[ns]")

    def send(self, path: Sequence[str], columns: Any, rows: Any = slice(None)) -> None:
        """Send columns of components, of all samples or of some rows."""
        times = self.rr.TimeColumn(TIMELINE, duration=self._times[rows])
        self._recording.send_columns(self.rr.new_entity_path(list(path)), [times], columns)

    def send_constant(self, path: Sequence[str], content: Any) -> None:
        """Send what does not change with the time."""
        self._recording.log(list(path), content, static=True)

    def send_curve(self, path: Sequence[str], values: NDArray[Any], name: str, colour: str, width: float = 1.0) -> None:
        """Send a signal [N] for each sample."""
        style = self.rr.SeriesLines(names=name, colors=_rgb(colour), widths=width)
        self.send_constant(path, style)
        self.send(path, self.rr.Scalars.columns(scalars=np.asarray(values, dtype=np.float64)))

    def send_stretches(self, path: Sequence[str], flags: Flags, word: str, colour: str) -> None:
        """Send when flags [N] are set, as a lane that is empty otherwise."""
        changes = {0: ""}
        for begin, end in flagged_rows(flags):
            changes |= {begin: word, end: ""}
        changes.pop(len(flags), None)  # the last stretch lasts to the end
        self.send_constant(path, self.rr.StateConfiguration(values=[word], labels=[word], colors=[_rgb(colour)]))
        self.send(path, self.rr.StateChange.columns(state=list(changes.values())), list(changes))

    def finished(self, layout: Any) -> bytes:
        """Return the bytes of the file, with the layout in which it opens."""
        self._recording.send_blueprint(layout)
        data = self._bytes.read()
        self._recording.disconnect()
        return bytes(data or b"")


def _rgb(colour: str) -> list[int]:
    """Return a colour that is seen on a dark ground, as Rerun has, and on a light one."""
    return list(bytes.fromhex(IN_DARK.get(colour, colour)[1:]))


def _send_detection(stream: _Stream, path: Sequence[str], values: Numbers, contact: Flags) -> None:
    """Send what the detection decides by, [N], once more where it decides on contact."""
    stream.send_curve(["joints", *path, path[-1]], values, path[-1].replace("_", " "), BLUE)
    stream.send_curve(["joints", *path, "in_contact"], np.where(contact, values, np.nan), "in contact", VERMILION, 2.5)


# --- drawing ----------------------------------------------------------------------------------------------------------


def _send_drawing(stream: _Stream, drawing: FingerDrawing, outputs: Mapping[str, NDArray[Any]]) -> Any:
    """Send the finger at the angles of some samples, joints in contact coloured. Return the bounds of its view."""
    outline = np.concatenate([drawing.outline[::THINNED, :2], drawing.outline[::-THINNED, ::2]])
    lines = [np.concatenate([tendon.line[:-1:THINNED], tendon.line[-1:]]) for tendon in drawing.tendons]
    rows = _frames(stream.time, sum(map(len, [outline, *lines])))
    bent = BentDrawing(drawing, outputs["joint_angle"][rows])
    lines2d, points2d = stream.rr.LineStrips2D, stream.rr.Points2D

    def send_line(path: list[str], points: Numbers, colour: str, radius: float) -> NDArray[Any]:
        at = bent.at(points) * DOWN
        stream.send(path, lines2d.columns(strips=list(at)), rows)
        stream.send_constant(path, lines2d.from_fields(colors=[_rgb(colour)], radii=[radius]))
        return at

    skin = send_line(["finger", "outline"], outline, LIGHT, 0.02)
    for i, (tendon, line) in enumerate(zip(drawing.tendons, lines, strict=True)):
        colour = TENDON_COLOURS[i % len(TENDON_COLOURS)]
        send_line(["finger", "tendons", f"{i + 1}"], line, colour, 0.025)
        spring = lines2d([tendon.spring * DOWN], colors=[_rgb(colour)], radii=[0.02])
        stream.send_constant(["finger", "springs", f"{i + 1}"], spring)
    hubs = np.array([[joint.x, 0.0] for joint in drawing.joints])
    positions = (bent.at(hubs) * DOWN).reshape(-1, 2)
    colours = np.where(outputs["joint_contact"][rows][..., None], _rgb(VERMILION), _rgb(GREY)).astype(np.uint8)
    discs = points2d.columns(positions=positions, colors=colours.reshape(-1, 3))
    stream.send(["finger", "joints"], discs.partition([len(hubs)] * len(rows)), rows)
    labels = [joint.name for joint in drawing.joints]
    stream.send_constant(["finger", "joints"], points2d.from_fields(radii=[drawing.joints[0].radius], labels=labels))
    low, high = skin.min(axis=(0, 1)), skin.max(axis=(0, 1))
    y = min(float(low[1]), -drawing.height), max(float(high[1]), drawing.height)
    return stream.rr.blueprint.VisualBounds2D(x_range=(min(float(low[0]), drawing.left), float(high[0])), y_range=y)


def _frames(time: Numbers, points: int) -> NDArray[np.intp]:
    """Return the rows of the samples that are drawn."""
    duration = float(time[-1] - time[0])
    count = int(max(min(duration * FRAMES_PER_SECOND, MOST_POINTS / points), 1.0)) + 1
    return np.unique(np.searchsorted(time, np.linspace(time[0], time[-1], count)))


# --- layout -----------------------------------------------------------------------------------------------------------


def _layout(rr: Any, joints: Sequence[str], bounds: Any) -> Any:
    """Return the blueprint: drawing and contacts on the left, joints on the right, forces below."""
    rrb = rr.blueprint

    def views(kind: str, title: str, tab: str) -> Any:
        plots = [
            rrb.TimeSeriesView(
                origin=rr.new_entity_path(["joints", name, kind]),
                name=f"{name}: {title}",
                plot_legend=rrb.PlotLegend(visible=name == joints[0]),  # the same for all joints
            )
            for name in joints
        ]
        return rrb.Grid(*plots, grid_columns=1 if len(joints) <= 4 else 2, name=tab)

    tabs = [views("torque", "torque (N·m)", "torques"), views("motion", "angle (rad), speed (rad/s)", "motion")]
    lanes = rrb.StateTimelineView(origin="contact", name="contact")
    left = lanes
    if bounds is not None:
        tabs.insert(1, views("residual", "residual (N·m)", "residuals"))
        tabs.insert(2, views("contact_level", "contact level (bound: 1)", "contact levels"))
        left = rrb.Vertical(
            rrb.Spatial2DView(origin="finger", name="finger", visual_bounds=bounds), lanes, row_shares=[3, 2]
        )
    upper = rrb.Horizontal(left, rrb.Tabs(*tabs, active_tab=0), column_shares=[2, 3])
    forces = rrb.TimeSeriesView(origin="tendons", name="tendon forces (N)")
    return rrb.Blueprint(
        rrb.Vertical(upper, forces, row_shares=[3, 1]),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE),
        collapse_panels=True,
    )
