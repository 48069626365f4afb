"""Figures of a diagnosed or calibrated finger: its drawing with marks, a stretch of motion, and a push."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup

from tendonfmu.arrays import Data, Numbers
from tendonfmu.diagnosis import Cause, Diagnosis, reported_causes
from tendonfmu.drawing import BLUE, DARK, SAND, VERMILION, Sheet, curve, mark, panel, stripes
from tendonfmu.estimate import known_numbers
from tendonfmu.files import are, counted, listed
from tendonfmu.model import Effect, Mark, effects, finger_drawing, finger_svg, keys_of
from tendonfmu.report.kit import capital, rms, rounded, torque_unit, words_of

MOST_MARKS = 8  # of one cause; one at more places is only in the caption
MOST_PLACES = 12  # whose friction is written on the drawing


@dataclass(frozen=True)
class FingerFigure:
    """A finger with marks."""

    drawing: Markup  # SVG
    keys: list[tuple[str, str, str]]  # (CSS class, colour, meaning) of the marks that are in the drawing
    caption: str


def finger_figure(diagnosis: Diagnosis) -> FingerFigure:
    """Draw the finger of a diagnosis; the numbers are those of the list of causes."""
    causes = list(enumerate(reported_causes(diagnosis), start=1))
    marks = [mark for number, cause in causes for mark in _marks(number, cause)]
    drawing = finger_drawing(diagnosis.nominal_data)
    return FingerFigure(finger_svg(drawing, marks), list(keys_of(drawing)), " ".join(_sentences(diagnosis, causes)))


def _sentences(diagnosis: Diagnosis, causes: Sequence[tuple[int, Cause]]) -> Iterator[str]:
    """Yield the caption: what the numbers are, and where the causes are that have no mark."""
    one = words_of(diagnosis.kind).one
    yield "The base is on the left."
    if any(_is_marked(cause) for _, cause in causes):
        yield f"Each filled number is a {one} in the list below."
    elsewhere: dict[str, list[str]] = {}
    for number, cause in causes:
        if not _is_marked(cause):
            elsewhere.setdefault(_elsewhere(cause), []).append(str(number))
    for place, numbers in elsewhere.items():
        several = "s" if len(numbers) > 1 else ""
        yield f"{capital(one)}{several} {listed(numbers)} {are(len(numbers))} {place}."


def _places(cause: Cause) -> list[tuple[int | None, int | None]]:
    places = [(place.joint, place.tendon) for place in cause.places] or [(cause.where.joint, cause.where.tendon)]
    return [place for place in places if place != (None, None)]


def _is_marked(cause: Cause) -> bool:
    return 0 < len(_places(cause)) <= MOST_MARKS


def _marks(number: int, cause: Cause) -> Iterator[Mark]:
    if _is_marked(cause):
        edge = cause.where.effect == "edge_friction"
        yield from (Mark(str(number), joint, tendon, edge) for joint, tendon in _places(cause))


def _elsewhere(cause: Cause) -> str:
    count = len(_places(cause))
    return f"at {counted(count, 'place')}, which the list names" if count else "everywhere"


def friction_figure(data: Data) -> FingerFigure:
    """Draw the finger with its largest friction by place, where the data tell it; else that of the tendon."""
    known, unknown = known_numbers(data), dict[int, int]()
    places: list[tuple[float, Mark]] = []
    for effect in (effect for effect in effects(data) if effect.tendon or effect.kind == "friction"):
        if effect.path not in known:
            unknown[effect.tendon] = unknown.get(effect.tendon, 0) + 1
        elif effect.tendon:
            places.append((known[effect.path][0], _mark(effect, known[effect.path][0])))
        else:
            places.append((np.inf, Mark(rounded(1e3 * known[effect.path][0], 2), effect.joint, None)))
    drawing = finger_drawing(data)
    largest = sorted((place for place in places if place[0] > 0.0), key=lambda place: -place[0])[:MOST_PLACES]
    caption = [
        "Coulomb friction: of a joint in mN·m, of a pulley or an edge in % of the tendon force.",
        "The base is on the left.",
    ]
    if len(places) > MOST_PLACES:
        caption.append("Only the largest are shown.")
    if unknown:
        left_out = counted(sum(unknown.values()), "place")
        caption.append(f"Left out: {left_out} whose friction these recordings do not determine.")
    caption += [
        f"All places of tendon {drawing.tendons[tendon - 1].name} together: {_percent(known[path][0])}."
        for tendon in sorted(unknown)
        if (path := f"tendons[{tendon}]") in known
    ]
    return FingerFigure(finger_svg(drawing, [mark for _, mark in largest]), list(keys_of(drawing)), " ".join(caption))


def _mark(effect: Effect, size: float) -> Mark:
    return Mark(_percent(size), effect.joint, effect.tendon, effect.kind == "edge_friction")


def _percent(share: float) -> str:
    return f"{rounded(100.0 * share, 2)} %"


# --- what a calibrated model leaves of motion, and a push that it finds -----------------------------------------------


@dataclass(frozen=True)
class MotionShown:
    """A stretch of a recording that nothing was chosen on, as both models run over it."""

    recording: str
    time: Numbers  # s [N]
    torque: Numbers  # of the tendons, less a known load, N·m [N, n]
    before: Numbers  # what the model that was given leaves of it, N·m [N, n]
    after: Numbers  # what the calibrated model leaves of it, N·m [N, n]


@dataclass(frozen=True)
class PushShown:
    """A push that is found, at the joint that bears most of it; times from its onset, s."""

    recording: str
    onset: float  # in the recording, s
    joint: str
    end: float
    delay: float
    time: Sequence[float]  # [N]
    felt: Sequence[float]  # the compensated torque, N·m [N]
    sensor: Sequence[float] | None  # that of a reference sensor, N·m [N]


def motion_sheet(shown: MotionShown, joints: list[str], given: str) -> Sheet:
    """Draw for each joint the torque and what each model leaves of it; `given` says what was given."""
    factor, unit = torque_unit(float(np.nanmax(np.abs(shown.torque))))
    panels = []
    for j, joint in enumerate(joints):
        before, after = (rounded(factor * rms(left[:, j])) for left in (shown.before, shown.after))
        panels.append(
            panel(
                joint,
                f"Joint {joint}: torque of the tendons, and what is left of it: {before} {unit} rms with {given}, "
                f"{after} {unit} calibrated.",
                "time (s)",
                f"torque ({unit})",
                curve(shown.time, factor * shown.torque[:, j], "torque of the tendons", DARK, 1.0),
                curve(shown.time, factor * shown.before[:, j], f"left of it with {given}", VERMILION, 1.0, alpha=0.9),
                curve(shown.time, factor * shown.after[:, j], "left of it, calibrated", BLUE, 1.0),
                note=f"left: {before} → {after} {unit} rms",
                size="medium",
                zoom="motion",
            )
        )
    return Sheet(
        "motion",
        "motion",
        f"{shown.recording}, {shown.time[0]:.0f} to {shown.time[-1]:.0f} s",
        panels,
        "A stretch with a typical error; nothing was tuned on it. What is left is the torque that the finger "
        "reports although nothing touches it.",
    )


def push_sheet(shown: PushShown) -> Sheet:
    """Draw what is felt at a joint while it is pushed, and when contact is reported."""
    factor, unit = torque_unit(float(np.max(np.abs(shown.felt))))
    time, delay = 1e3 * np.asarray(shown.time), 1e3 * shown.delay
    felt = "torque felt: the torque that the tendons have to hold, less friction"
    drawn = panel(
        shown.joint,
        f"Joint {shown.joint}: the torque felt during a push; contact is reported {delay:.0f} ms after its onset.",
        "time from the onset (ms)",
        f"torque ({unit})",
        [] if shown.sensor is None else curve(time, factor * np.asarray(shown.sensor), "reference sensor", DARK, 1.0),
        curve(time, factor * np.asarray(shown.felt), felt, BLUE, 1.0),
        stripes([(0.0, 1e3 * shown.end)], "pushed, as labelled", SAND, 0.3),
        mark(delay),
        note=f"contact reported after {delay:.0f} ms",
        size="wide",
    )
    caption = "The push with the median delay of those that are found. The line is where contact is reported."
    return Sheet("push", "push", f"{shown.recording}, at {shown.onset:.1f} s", [drawn], caption)
