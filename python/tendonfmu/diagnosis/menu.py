"""What else could be recorded: a menu of motions, pretensions and known loads, mostly in the range that was recorded.

An entry is a list of sections. Each is a training motion of `excite/excitation.py` with its own pretension and load. An
entry is plain JSON (`Entry.as_json`), so a report can carry it and `tendonfmu excite --discriminate` can write it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from tendonfmu.arrays import Data, Numbers
from tendonfmu.diagnosis.samples import Span
from tendonfmu.errors import InputError
from tendonfmu.excite import Variation, pretension_vector
from tendonfmu.files import listed
from tendonfmu.model import moment_arms

LEVELS = (0.25, 0.5, 1.0)  # of the highest pretension
HIGHEST = 2.0  # times the recorded one, but no tendon is pulled more than it was
SLOW, FAST = 0.2, 2.5  # of the speed that was recorded
EVERY = 2.0  # s, between changes of the tensions
WIDER = 1.6  # times the range that was recorded
SECONDS = 80.0  # s, of an entry
LONG = 600.0  # s
_SMALL = 0.08  # of a joint's range: small strokes
_POSTURES = (0.2, 0.5, 0.8)  # of a joint's range: where small strokes are made
_LEAST_RANGE, _LEAST_SPEED = 0.02, 0.05  # rad, rad/s
_TAUT = 0.25  # of its pretension, which every pulling tendon keeps under the known load
_LOOP_LOAD = 3.0  # times the recorded torque: known load on a finger that holds no pretension
_SHARES = (0.5, 1.0, 2.0, 4.0)  # of a known load that holds the tendons
_ALTERNATIONS = 2  # from one side to the other, of a known load


@dataclass(frozen=True)
class Section:
    """A stretch of motion."""

    ranges: tuple[tuple[float, float], ...]  # (low, high) of each joint, rad [n]
    max_speed: float  # rad/s
    seconds: float  # duration, s
    pretension: float  # mean, N
    vary: Variation | None = None  # how the tensions change, other for each tendon; None for constant tensions
    load: tuple[float, ...] = ()  # known load at the joints, N·m [n]
    max_acceleration: float = 10.0  # rad/s²


@dataclass(frozen=True)
class Entry:
    """One entry of the menu; `motion`, `tension` and `load` continue "Record 80 s of"; "" if as recorded."""

    motion: str
    sections: tuple[Section, ...]
    tension: str = ""
    load: str = ""

    @property
    def seconds(self) -> float:
        return sum(section.seconds for section in self.sections)

    @property
    def words(self) -> str:
        return ", ".join(part for part in (self.motion, self.tension, self.load) if part)

    @property
    def sentence(self) -> str:
        """What to record."""
        length = f"{self.seconds:.0f} s" if self.seconds < 180.0 else f"{self.seconds / 60.0:.0f} min"
        return f"Record {length} of {self.words}."

    def as_json(self) -> dict[str, Any]:
        return asdict(self)


def entry_from_json(value: Mapping[str, Any], joints: int) -> Entry:
    """Return the entry of a report; raise InputError unless it is for a finger with that many joints."""
    try:
        sections = tuple(
            Section(
                **{
                    **section,
                    "ranges": tuple((float(low), float(high)) for low, high in section["ranges"]),
                    "load": tuple(float(torque) for torque in section.get("load") or ()),
                    "vary": Variation(**section["vary"]) if section.get("vary") else None,
                }
            )
            for section in value["sections"]
        )
        entry = Entry(str(value["motion"]), sections, str(value.get("tension", "")), str(value.get("load", "")))
    except (KeyError, TypeError, ValueError) as wrong:
        raise InputError(f"experiment.motion: {wrong}; expected an experiment of `tendonfmu diagnose`") from None
    for k, section in enumerate(sections, start=1):
        if len(section.ranges) != joints or len(section.load) not in (0, joints):
            raise InputError(
                f"experiment.motion.sections[{k}]: {len(section.ranges)} ranges and {len(section.load)} loads; "
                f"expected {joints}, one per joint"
            )
    return entry


@dataclass(frozen=True)
class Recorded:
    """What was recorded."""

    ranges: Numbers  # rad [n, 2]
    speed: float  # fastest, rad/s
    pretension: float  # mean tendon force, N
    force: Numbers  # largest of each tendon, N [m]
    torque: Numbers  # spread of the joint torque, N·m [n]
    seconds: float  # length of the longest stretch
    load: Numbers | None = None  # mean of the known load, N·m [n]


def recorded_of(span: Span, load: Numbers | None = None) -> Recorded:
    """Return what was recorded; very small ranges are widened, because every joint must move. `load` is in N·m [n]."""
    middle, half = span.angle.mean(axis=1), np.maximum(0.5 * np.ptp(span.angle, axis=1), 0.5 * _LEAST_RANGE)
    return Recorded(
        ranges=np.column_stack([middle - half, middle + half]),
        speed=max(float(span.speed.max()), _LEAST_SPEED),
        pretension=float(np.abs(span.force).mean()),
        force=np.abs(span.force).max(axis=1),
        torque=span.torque,
        seconds=span.duration,
        load=load,
    )


def own_tension(data: Data) -> Numbers:
    """Return tendon forces per newton of pretension [m]; zeros if the finger holds none by itself."""
    try:
        return pretension_vector(data)
    except InputError:
        return np.zeros(len(data["tendons"]))


# --- motions ----------------------------------------------------------------------------------------------------------


def motions(recorded: Recorded) -> Iterator[Entry]:
    """Yield the motions at the recorded tension, the simplest first."""
    whole = _as_ranges(recorded.ranges)
    held = () if recorded.load is None else tuple(recorded.load.tolist())
    usual = Section(whole, recorded.speed, SECONDS, recorded.pretension, load=held)
    yield Entry("the same kind of motion", (usual,))
    slow = SLOW * recorded.speed
    yield Entry(
        f"slow strokes of at most {slow:.2g} rad/s over the whole range",
        (_long_enough(replace(usual, max_speed=slow)),),
    )
    yield _one_at_a_time(recorded, usual)
    yield _small_strokes(recorded, usual)
    fast = FAST * recorded.speed
    yield Entry(
        f"fast strokes of up to {fast:.2g} rad/s",
        (replace(usual, max_speed=fast, max_acceleration=max(10.0, 10.0 * fast)),),
    )
    middle, half = recorded.ranges.mean(axis=1), 0.5 * WIDER * np.ptp(recorded.ranges, axis=1)
    wide = _as_ranges(np.column_stack([middle - half, middle + half]))
    yield Entry(
        f"the same kind of motion over {WIDER:g} times the range, if the joints can", (replace(usual, ranges=wide),)
    )
    long = max(LONG, 2 * recorded.seconds)
    yield Entry("the same kind of motion without a pause, from cold", (replace(usual, seconds=long),))


def _as_ranges(ranges: Numbers) -> tuple[tuple[float, float], ...]:
    return tuple((float(low), float(high)) for low, high in ranges)


def _long_enough(section: Section) -> Section:
    """Return a section that lasts at least two strokes through the whole range and back."""
    span = max(high - low for low, high in section.ranges)
    return replace(section, seconds=max(section.seconds, 10.0 + 8 * span / section.max_speed))


def _one_at_a_time(recorded: Recorded, usual: Section) -> Entry:
    middle, sections = recorded.ranges.mean(axis=1), []
    for j in range(len(middle)):
        ranges = np.column_stack([middle, middle])
        ranges[j] = recorded.ranges[j]
        alone = replace(usual, ranges=_as_ranges(ranges), seconds=max(SECONDS / len(middle), 16.0))
        sections.append(_long_enough(alone))
    if len(middle) == 1:
        return Entry("the same kind of motion, in two halves", (replace(sections[0], seconds=SECONDS / 2),) * 2)
    return Entry("motion of one joint at a time, with the others at rest", tuple(sections))


def _small_strokes(recorded: Recorded, usual: Section) -> Entry:
    width = np.ptp(recorded.ranges, axis=1)
    stroke = np.maximum(_SMALL * width, 0.5 * _LEAST_RANGE)
    speed = max(2.0 * float(stroke.max()), _LEAST_SPEED)
    sections = []
    for share in _POSTURES:
        middle = recorded.ranges[:, 0] + share * width
        ranges = np.column_stack([middle - stroke / 2, middle + stroke / 2])
        sections.append(replace(usual, ranges=_as_ranges(ranges), max_speed=speed, seconds=SECONDS / len(_POSTURES)))
    return Entry(f"small strokes of {float(stroke.max()):.2g} rad back and forth, at three postures", tuple(sections))


# --- pretensions and loads --------------------------------------------------------------------------------------------


def tensions(data: Data, entry: Entry, recorded: Recorded) -> Iterator[Entry]:
    """Yield the entry at several pretensions, and with tensions that swing faster than a bias drifts."""
    base, own = entry.sections[0].pretension, np.abs(own_tension(data))
    if not own.any() or base <= 0:
        return
    highest = min(HIGHEST * base, max(base, float(np.min(recorded.force[own > 0.0] / own[own > 0.0]))))
    levels = [level * highest for level in LEVELS]
    yield replace(
        entry,
        sections=tuple(
            _shortened(section, len(levels), pretension=level) for level in levels for section in entry.sections
        ),
        tension=f"at pretensions of {listed([f'{level:.3g}' for level in levels])} N",
    )
    low, high = levels[0], levels[-1]
    yield replace(
        entry,
        sections=tuple(replace(section, vary=Variation(low, high, EVERY)) for section in entry.sections),
        tension=f"while the tendon forces change every {EVERY:.2g} s between {low:.3g} and {high:.3g} N",
    )


def loads(data: Data, entry: Entry, recorded: Recorded) -> Iterator[Entry]:
    """Yield the entry with a known load at the joints, on one side and on the other."""
    first = entry.sections[0]
    own = first.pretension * own_tension(data)
    least = own if first.vary is None else np.minimum(own, first.vary.lowest)
    largest = known_load(data, least, recorded)
    if not largest.any():
        return
    if _held_by_load(data, recorded):
        sides = [share * largest for share in _SHARES]
        how = f"and {listed([f'{share:g}' for share in _SHARES if share != 1.0])} times as much"
    else:
        sides = [sign * largest for _ in range(_ALTERNATIONS) for sign in (1.0, -1.0)]
        how = "first one way, then the other"
    sections = tuple(
        _shortened(section, len(sides), load=tuple(load.tolist())) for load in sides for section in entry.sections
    )
    sizes = listed([f"{value:.2g}" for value in largest])
    yield replace(
        entry,
        sections=sections,
        load=f"with a known load of {sizes} N·m at the joint{'s' * (len(largest) > 1)}, {how} (column external_torque)",
    )


def _held_by_load(data: Data, recorded: Recorded) -> bool:
    """Return whether a known load alone keeps pulling tendons taut; it must then stay on its side."""
    pulls = any(not tendon.get("bidirectional") for tendon in data["tendons"])
    return pulls and not own_tension(data).any() and recorded.load is not None and bool(recorded.load.any())


def known_load(data: Data, tension: Numbers, recorded: Recorded) -> Numbers:
    """Return a load that leaves every pulling tendon taut at these tensions (N, [m]), on either side, N·m [n]."""
    if _held_by_load(data, recorded):
        return np.asarray(recorded.load)
    arms = moment_arms(data)
    pulls = np.array([not tendon.get("bidirectional") for tendon in data["tendons"]])
    if not tension.any() or not pulls.any():
        return _LOOP_LOAD * recorded.torque
    each = np.abs(arms).max(axis=0)  # N·m per N of one tendon
    taken = np.abs(np.linalg.pinv(arms)).T @ each  # N, from each tendon, at most
    return np.asarray(np.min((1 - _TAUT) * tension[pulls] / np.maximum(taken[pulls], 1e-12)) * each)


def _shortened(section: Section, count: int, **changes: Any) -> Section:
    """Return one of `count` sections that together last about as long; none is too short for a motion."""
    least = 8.0 + 4 * max(high - low for low, high in section.ranges) / section.max_speed
    return replace(section, seconds=max(section.seconds / count, least, 12.0), **changes)


def combined(data: Data, motion: Entry, recorded: Recorded) -> Sequence[Entry]:
    """Return a motion at several pretensions, each with a known load."""
    return [loaded for tense in tensions(data, motion, recorded) for loaded in loads(data, tense, recorded)]
