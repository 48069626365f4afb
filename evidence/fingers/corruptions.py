"""What goes wrong with recordings, done to sound ones: signs, order, units, clocks, sensors.

A corruption changes a frame of columns as `foreign.frame` makes it, and says what a check should answer.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Sequence
from functools import partial

import numpy as np
import pandas as pd

Change = Callable[[pd.DataFrame, list[str]], pd.DataFrame]


@dataclasses.dataclass(frozen=True)
class Corruption:
    """One fault of a recording."""

    family: str  # heading of the table
    name: str  # which one, with its size
    group: str  # whose columns it changes
    columns: int  # how many of them, chosen at random; 0: all
    change: Change  # of a frame and the columns chosen
    kinds: tuple[str, ...]  # findings that are right about it
    factor: float | None = None  # what a map has to multiply by; None: nothing mends it, or an exchange does


def columns_of(frame: pd.DataFrame, group: str) -> list[str]:
    return [str(column) for column in frame if str(column).split("[")[0] == group]


def applicable(frame: pd.DataFrame, corruption: Corruption) -> bool:
    """Whether the frame has such columns, and enough of them."""
    return len(columns_of(frame, corruption.group)) >= max(corruption.columns, 1)


def corrupt(frame: pd.DataFrame, corruption: Corruption, rng: np.random.Generator) -> tuple[pd.DataFrame, list[str]]:
    """The changed frame, and the columns that were chosen."""
    columns = columns_of(frame, corruption.group)
    if corruption.columns:
        chosen = rng.choice(len(columns), corruption.columns, replace=False)
        columns = [columns[k] for k in sorted(chosen)]
    return corruption.change(frame.copy(), columns), columns


# --- what is done -----------------------------------------------------------------------------------------------------


def multiplied(factor: float, frame: pd.DataFrame, columns: list[str]) -> pd.DataFrame:
    frame[columns] *= factor
    return frame


def turned(groups: Sequence[str], frame: pd.DataFrame, columns: list[str]) -> pd.DataFrame:
    """Each of the columns where the next one belongs, in each of the groups; two of them are exchanged."""
    indices = [column.split("[")[1] for column in columns]
    for group in groups:
        names = [f"{group}[{index}" for index in indices]
        frame[names] = frame[names[1:] + names[:1]].to_numpy()
    return frame


def reversed_order(groups: Sequence[str], frame: pd.DataFrame, _: list[str]) -> pd.DataFrame:
    for group in groups:
        names = columns_of(frame, group)
        frame[names] = frame[names[::-1]].to_numpy()
    return frame


def clipped(part: float, frame: pd.DataFrame, columns: list[str]) -> pd.DataFrame:
    """All above a part of the range cut off."""
    for column in columns:
        low, high = frame[column].min(), frame[column].max()
        frame[column] = frame[column].clip(upper=low + part * (high - low))
    return frame


def held(begin: float, end: float, frame: pd.DataFrame, columns: list[str]) -> pd.DataFrame:
    """A value held between two shares of the recording."""
    rows = slice(int(begin * len(frame)), int(end * len(frame)))
    for column in columns:
        frame.loc[frame.index[rows], column] = frame[column].iloc[rows.start]
    return frame


def stepped(steps: int, frame: pd.DataFrame, columns: list[str]) -> pd.DataFrame:
    """The range in so many steps."""
    for column in columns:
        step = np.ptp(frame[column]) / steps
        frame[column] = np.round(frame[column] / step) * step
    return frame


def shifted_to_zero(frame: pd.DataFrame, columns: list[str]) -> pd.DataFrame:
    """Sensors zeroed under load."""
    frame[columns] -= frame[columns].mean()
    return frame


def without(share: float, frame: pd.DataFrame, _: list[str]) -> pd.DataFrame:
    lost = np.random.default_rng(len(frame)).random(len(frame)) < share
    kept: pd.DataFrame = frame[~lost].reset_index(drop=True)
    return kept


def interrupted(frame: pd.DataFrame, _: list[str]) -> pd.DataFrame:
    """A second and a half missing in the middle."""
    middle = frame.time.iloc[len(frame) // 2]
    kept: pd.DataFrame = frame[(frame.time < middle) | (frame.time > middle + 1.5)].reset_index(drop=True)
    return kept


def jittered(share: float, frame: pd.DataFrame, _: list[str]) -> pd.DataFrame:
    step = frame.time.diff().median()
    noise = np.random.default_rng(len(frame)).normal(0.0, share * step / np.sqrt(2.0), len(frame))
    frame["time"] = np.maximum.accumulate(frame.time + noise + 1e-9 * np.arange(len(frame)))
    frame["time"] += 1e-9 * np.arange(len(frame))  # strictly increasing
    return frame


def with_velocity(factor: float, frame: pd.DataFrame, columns: list[str]) -> pd.DataFrame:
    """Joint velocities, which the recordings lack, times a factor. columns: of the joint positions."""
    for column in columns_of(frame, "joint_position"):
        speed = np.gradient(frame[column].rolling(9, center=True, min_periods=1).mean(), frame.time)
        wrong = factor if column in columns else 1.0
        frame[column.replace("position", "velocity")] = wrong * speed
    return frame


def unsigned(frame: pd.DataFrame, columns: list[str]) -> pd.DataFrame:
    """Readings of 16 bits around the middle of the range, their sign lost."""
    for column in columns:
        step = np.ptp(frame[column]) / 4000
        frame[column] = step * (np.round((frame[column] - frame[column].median()) / step) % 65536)
    return frame


def filled(seconds: float, frame: pd.DataFrame, _: list[str]) -> pd.DataFrame:
    """Straight lines in all columns over a time in the middle."""
    frame, middle = frame.astype(float), frame.time.iloc[len(frame) // 2]
    lost = (frame.time > middle) & (frame.time < middle + seconds)
    for column in frame.columns.drop("time"):
        frame.loc[lost, column] = np.interp(frame.time[lost], frame.time[~lost], frame.loc[~lost, column])
    return frame


def slowed(every: int, frame: pd.DataFrame, columns: list[str]) -> pd.DataFrame:
    """Columns that are only read at every so-many-th sample."""
    frame[columns] = frame[columns].iloc[(np.arange(len(frame)) // every) * every].to_numpy()
    return frame


def switched(factor: float, frame: pd.DataFrame, columns: list[str]) -> pd.DataFrame:
    """Another unit in the second half."""
    frame.loc[frame.index[len(frame) // 2 :], columns] *= factor
    return frame


def drifting(ppm: float, frame: pd.DataFrame, columns: list[str]) -> pd.DataFrame:
    """A clock of their own that runs faster."""
    time = frame.time * (1.0 + 1e-6 * ppm)
    for column in columns:
        frame[column] = np.interp(time, frame.time, frame[column])
    return frame


# --- all of them ------------------------------------------------------------------------------------------------------


def corruptions() -> Iterator[Corruption]:
    yield from _signs()
    yield from _orders()
    yield from _units()
    yield from _sensors()
    yield from _clocks()
    yield from _traps()


def _traps() -> Iterator[Corruption]:
    for group, factor, unit in (
        ("tendon_force", 1e3, "mN"),
        ("tendon_position", 1e3, "mm"),
        ("joint_position", 180 / np.pi, "degrees"),
    ):
        name = f"{group}, 1"
        yield Corruption("unsigned", name, group, 1, unsigned, ("wrapped",))
        yield Corruption("half in another unit", f"{name}, {unit}", group, 1, partial(switched, factor), ("switched",))
        yield Corruption("slower sensor", f"{group}, every 4th sample", group, 0, partial(slowed, 4), ("slow",))
    yield Corruption("filled", "a gap of 0.5 s, by straight lines", "time", 0, partial(filled, 0.5), ("filled",))
    for ppm in (10.0, 100.0):
        name = f"joint_position, {ppm:g} ppm"
        yield Corruption("drift", name, "joint_position", 0, partial(drifting, ppm), ("drift",))


def _signs() -> Iterator[Corruption]:
    for group in ("tendon_force", "tendon_position", "joint_position"):
        for count in (1, 2, 3, 0):
            name = f"{group}, {count or 'all'}"
            yield Corruption("sign", name, group, count, partial(multiplied, -1.0), ("sign",), -1.0)
    yield Corruption("sign", "joint_velocity, 1", "joint_position", 1, partial(with_velocity, -1.0), ("sign",), -1.0)


def _orders() -> Iterator[Corruption]:
    for group in ("tendon_force", "tendon_position", "joint_position"):
        yield Corruption("exchange", f"{group}, 2", group, 2, partial(turned, (group,)), ("exchange",))
    both = partial(turned, ("tendon_force", "tendon_position"))
    yield Corruption("exchange", "tendons, 2", "tendon_force", 2, both, ("exchange",))
    yield Corruption("exchange", "tendons, 3 in a circle", "tendon_force", 3, both, ("exchange",))
    last_first = partial(reversed_order, ("tendon_force", "tendon_position"))
    yield Corruption("exchange", "tendons, last first", "tendon_force", 0, last_first, ("exchange",))


def _units() -> Iterator[Corruption]:
    for group, unit, factor in (
        ("tendon_position", "mm", 1e-3),
        ("tendon_position", "cm", 1e-2),
        ("tendon_force", "mN", 1e-3),
        ("tendon_force", "gf", 9.80665e-3),
        ("tendon_force", "kgf", 9.80665),
        ("tendon_force", "lbf", 4.448222),
        ("joint_position", "degrees", np.pi / 180),
    ):
        for count in (0, 1):
            name = f"{group} in {unit}, {count or 'all'}"
            yield Corruption("unit", name, group, count, partial(multiplied, 1.0 / factor), ("scale",), factor)
    degrees = partial(with_velocity, 180 / np.pi)
    yield Corruption("unit", "joint_velocity in degrees/s", "joint_position", 0, degrees, ("scale",), np.pi / 180)
    for unit, factor in (("ms", 1e-3), ("µs", 1e-6)):
        yield Corruption("unit", f"time in {unit}", "time", 0, partial(multiplied, 1.0 / factor), ("clock",), factor)


def _sensors() -> Iterator[Corruption]:
    for group in ("tendon_force", "tendon_position", "joint_position"):
        for part in (0.95, 0.85, 0.7):
            yield Corruption(
                "clipped", f"{group}, at {100 * part:.0f} %", group, 1, partial(clipped, part), ("clipped",)
            )
        for begin, end in ((0.3, 0.4), (0.2, 0.5), (0.0, 1.0)):
            name = f"{group}, {100 * (end - begin):.0f} % of the time"
            yield Corruption("held", name, group, 1, partial(held, begin, end), ("held",))
        for steps in (30, 15):
            yield Corruption("coarse", f"{group}, {steps} steps", group, 1, partial(stepped, steps), ("coarse",))
    yield Corruption("zero", "tendon_force zeroed under load, all", "tendon_force", 0, shifted_to_zero, ("pushing",))
    yield Corruption("zero", "tendon_force zeroed under load, 1", "tendon_force", 1, shifted_to_zero, ("pushing",))


def _clocks() -> Iterator[Corruption]:
    yield Corruption("clock", "1.5 s missing", "time", 0, interrupted, ("gaps",))
    for share in (0.005, 0.05):
        yield Corruption("clock", f"{100 * share:g} % of samples lost", "time", 0, partial(without, share), ("lost",))
    for share in (0.15, 0.3):
        yield Corruption(
            "clock", f"steps vary by {100 * share:.0f} %", "time", 0, partial(jittered, share), ("jitter",)
        )
