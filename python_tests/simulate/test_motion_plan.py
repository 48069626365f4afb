"""Motion and pushes of a rig: what the recipes promise, from seeds, and what they refuse."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tendonfmu.errors import InputError
from tendonfmu.files.json_node import Node, Refusal
from tendonfmu.files.tables import write_table
from tendonfmu.simulate.motion_plan import PEAK_OVER_MEAN, Draws, Joints, Motion, Segment, expand_motion, expand_pushes

LIMITS = Joints([-0.35, -0.3, 0.0], [0.35, 1.4, 1.6])
SEGMENTS = [
    Segment(1, [0.0, 0.0, 0.0], [0.0, 0.0, 1.0]),
    Segment(2, [0.045, 0.0, 0.0], [0.0, 2.0, 0.0]),
    Segment(3, [0.022, 0.0, 0.0], [0.0, 1.0, 0.0]),
]


def strokes(limits: Joints = LIMITS, **changes: Any) -> Motion:
    recipe = {"kind": "strokes", "seed": 4, "duration": 60.0, "pretension": 10.0} | changes
    return expand_motion(Node(recipe, "motion"), limits, seed=1, duration=60.0)


def pushes(duration: float = 100.0, segments: list[Segment] = SEGMENTS, **changes: Any) -> list[Any]:
    return expand_pushes(Node({"count": 20, "seed": 4} | changes, "pushes"), segments, seed=1, duration=duration)


def digest(value: Any) -> str:
    return hashlib.sha256(json.dumps(value).encode()).hexdigest()[:16]


# --- seeds ------------------------------------------------------------------------------------------------------------


def test_the_streams_are_pcg64s() -> None:
    """numpy keeps the raw numbers of PCG64 and SeedSequence; 53 bits of each are the share."""
    raw = np.random.PCG64(np.random.SeedSequence([7, 1, 2])).random_raw(3)
    draws = Draws(7, 1, 2)
    assert [draws.share() for _ in range(3)] == [(int(word) >> 11) / 2**53 for word in raw]
    assert Draws(7, 1, 3).share() != Draws(7, 1, 2).share()


def test_directions_are_uniform_on_the_sphere() -> None:
    draws = Draws(3)
    vectors = np.array([draws.direction() for _ in range(4000)])
    assert np.allclose(np.linalg.norm(vectors, axis=1), 1.0)
    # mean 0 and covariance I/3; 5 standard errors
    assert np.abs(vectors.mean(axis=0)).max() < 5 / np.sqrt(3 * 4000)
    assert np.abs(np.cov(vectors.T) - np.eye(3) / 3).max() < 5 * 0.3 / np.sqrt(4000)


def test_the_same_seed_gives_the_same_motion_and_pushes_for_good() -> None:
    """The rig's seed serves where the motion has none."""
    assert digest(strokes().expanded()) == "6d6ed42211a3ef28" != digest(strokes(seed=5).expanded())
    assert digest(pushes(where="anywhere")) == "d13f925fd5ec0605" != digest(pushes(where="anywhere", seed=5))
    recipe = {"kind": "strokes", "duration": 60.0, "pretension": 10.0}
    seeded = expand_motion(Node(recipe, "motion"), LIMITS, seed=4, duration=None)
    assert seeded.expanded() == strokes().expanded()


# --- strokes ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("duration", [0.5, 2.0, 2.3, 2.5, 7.0, 60.0])
def test_strokes_keep_speeds_limits_and_stillness(duration: float) -> None:
    """A quintic between resting points has 15/8 of its mean speed as its peak."""
    motion = strokes(speed=[0.2, 0.7], still=1.5, duration=duration)
    for knots, low, high in zip(motion.joints, LIMITS.lower, LIMITS.upper, strict=True):
        time, position = np.array(knots["time"]), np.array(knots["position"])
        assert np.all(np.diff(time) > 0.0) and time[0] == 0.0 and time[-1] <= max(0.0, duration)
        assert knots["velocity"] == knots["acceleration"] == [0.0] * len(time)
        margin = 0.05 * (high - low)
        assert position.min() >= low + margin - 1e-12 and position.max() <= high - margin + 1e-12
        if duration == 60.0:
            assert time[1] == 1.5 and position[0] == position[1] and time[-1] <= 58.5
            peaks = PEAK_OVER_MEAN * np.abs(np.diff(position)) / np.diff(time)
            assert peaks.max() <= 0.7 + 1e-9


def test_long_strokes_have_the_speeds_drawn() -> None:
    """Only ways that are too short for the shortest stroke are slower than asked for."""
    for knots in strokes(speed=[0.3, 0.5], rest_share=0.0).joints:
        durations = np.diff(knots["time"])
        speeds = PEAK_OVER_MEAN * np.abs(np.diff(knots["position"])) / durations
        long = (durations > 0.4 + 1e-9) & (speeds > 0.0)
        assert long.sum() > 5 and speeds[long].min() >= 0.3 - 1e-9


def test_joints_move_on_their_own_and_rest() -> None:
    motion = strokes(duration=400.0)
    assert len({len(knots["time"]) for knots in motion.joints}) == 3
    for knots in motion.joints:
        ways = np.diff(knots["position"]) != 0.0
        # a quarter of the strokes, within 4 standard deviations of a binomial; the first second is a rest too
        assert abs((~ways).sum() - 1 - 0.25 * ways.sum()) < 4 * np.sqrt(0.25 * 0.75 * ways.sum())


def test_still_stands_and_a_range_serves_without_limits() -> None:
    recipe = {"kind": "still", "position": [0.1, 0.2, 0.3], "pretension": 12.0}
    motion = expand_motion(Node(recipe, "motion"), LIMITS, seed=1, duration=None)
    assert [knots["position"] for knots in motion.joints] == [[0.1], [0.2], [0.3]]
    assert motion.pretension == {"time": [0.0], "value": [12.0]}
    endless = Joints([-np.inf], [np.inf])
    with pytest.raises(Refusal, match=r"motion\.lower: missing; expected .* since physics\.links\[1\] has no limits"):
        strokes(endless)
    assert max(np.abs(strokes(endless, lower=[-1.0], upper=[1.0]).joints[0]["position"])) <= 1.0


@pytest.mark.parametrize(
    ("changes", "line"),
    [
        ({"speed": [-1.0, 0.9]}, r"motion\.speed\[1\] = -1\.0: expected a number in rad/s, above 0"),
        ({"speed": [0.9, 0.2]}, r"motion\.speed = \[0\.9, 0\.2\]: expected .*second not below the first"),
        ({"rest_share": 1.5}, r"motion\.rest_share = 1\.5: expected a number, at least 0 and at most 1"),
        ({"lower": [0.0, 0.0]}, r"motion\.lower = \[0\.0, 0\.0\]: expected a list of 3"),
        ({"lower": [0.0, -0.4, 0.0]}, r"motion\.lower\[2\] = -0\.4: expected an angle within the joint's range, -0\.3"),
        ({"upper": [-0.34, 1.0, 1.0]}, r"motion\.upper\[1\] = -0\.34: expected an angle not below motion\.lower"),
        ({"position": [0.0, 2.0, 0.5]}, r"motion\.position\[2\] = 2\.0: expected an angle within the joint's range"),
        ({"seed": 1.5}, r"motion\.seed = 1\.5: expected an integer"),
        ({"pretension": 0.0}, r"motion\.pretension = 0\.0: expected a number in N"),
        ({"pretension": None}, r"motion\.pretension: missing; expected a number in N"),
        ({"file": "a.csv"}, r'motion\.file = "a\.csv": unknown key'),
        ({"kind": "sine"}, r'motion\.kind = "sine": expected "still" or "strokes" or "file"'),
    ],
)
def test_bad_strokes_are_refused_by_key(changes: dict[str, Any], line: str) -> None:
    with pytest.raises(Refusal, match=line):
        strokes(**changes)


# --- motion files -----------------------------------------------------------------------------------------------------


def motion_table(rows: int = 5, **changes: Any) -> dict[str, Any]:
    time = np.linspace(0.0, 4.0, rows)
    slope = np.pi / 4.0 * np.sin(np.pi * time / 2.0)
    slope[[0, -1]] = 0.0
    table: dict[str, Any] = {"time": time}
    for j in (1, 2, 3):
        table[f"joint_position[{j}]"] = 0.1 * np.sin(np.pi * time / 4.0) ** 2
        table[f"joint_velocity[{j}]"], table[f"joint_acceleration[{j}]"] = 0.1 * slope, np.zeros(rows)
    return table | changes


def from_file(folder: Path, table: dict[str, Any], **changes: Any) -> Motion:
    write_table(folder / "motion.csv", table)
    recipe = {"kind": "file", "file": str(folder / "motion.csv"), "pretension": 10.0} | changes
    return expand_motion(Node(recipe, "motion"), LIMITS, seed=1, duration=None)


def test_a_motion_file_becomes_knots(tmp_path: Path) -> None:
    """Motor positions, which `tendonfmu excite` writes, are for robots: the rig commands its own motors."""
    table = motion_table()
    motion = from_file(tmp_path, table)
    assert motion.joints[1]["time"] == table["time"].tolist()
    assert motion.joints[2]["velocity"] == table["joint_velocity[3]"].tolist()
    assert motion.file == tmp_path / "motion.csv"
    motors = {"tendon_position[1]": np.full(5, 1e3), "tendon_position[2]": np.zeros(5)}
    assert from_file(tmp_path, table | motors).joints == motion.joints


def test_the_pretension_of_a_file_keeps_its_steps_and_is_given_once(tmp_path: Path) -> None:
    table = motion_table(7, pretension=np.array([10.0, 10.0, 10.0, 20.0, 20.0, 20.0, 20.0]))
    time = table["time"]
    motion = from_file(tmp_path, table, pretension=None)
    assert motion.pretension == {"time": [time[0], time[2], time[3]], "value": [10.0, 10.0, 20.0]}
    with pytest.raises(
        Refusal, match=r"motion\.pretension = 10\.0: expected nothing, since .* has a column pretension"
    ):
        from_file(tmp_path, table)
    with pytest.raises(Refusal, match=r"motion\.pretension: missing"):
        from_file(tmp_path, motion_table(), pretension=None)


@pytest.mark.parametrize(
    ("column", "row", "value", "line"),
    [
        ("time", 3, 0.5, r"column time, row 3: 0\.5; expected a time after the row before"),
        ("time", 1, -1.0, r"column time, row 1: -1; expected 0 to"),
        ("joint_velocity[1]", 5, 0.2, r"column joint_velocity\[1\], row 5: 0\.2; expected 0 in the first"),
        ("joint_acceleration[3]", 1, 0.2, r"column joint_acceleration\[3\], row 1: 0\.2; expected 0 in"),
        ("joint_position[1]", 1, 0.5, r"column joint_position\[1\], row 1: 0\.5; expected a start within"),
        ("joint_position[1]", 2, 500.0, r"column joint_position\[1\], row 2: 500; expected -100 to 100"),
        ("joint_position[1]", 2, np.nan, r"column joint_position\[1\], row 2: .*; expected"),
        ("pretension", 1, -1.0, r"column pretension, row 1: -1; expected"),
        ("joint_position[4]", 1, 0.0, r"unknown column 'joint_position\[4\]'"),
        ("joint_velocity[2]", 0, 0.0, r"motion\.csv: no column joint_velocity\[2\]"),
    ],
)
def test_bad_motion_files_are_refused_by_column_and_row(
    tmp_path: Path, column: str, row: int, value: float, line: str
) -> None:
    table = motion_table()
    values = table.pop(column, np.full(5, 10.0)).copy()
    if row:
        values[row - 1] = value
        table[column] = values
    with pytest.raises((InputError, Refusal), match=line):
        from_file(tmp_path, table)


# --- pushes -----------------------------------------------------------------------------------------------------------


def test_pushes_keep_their_ranges_and_their_order() -> None:
    found = pushes(first=3.0, force=[1.0, 2.0], hold=[0.2, 0.4], rise=[0.05, 0.1], gap=[1.0, 2.0])
    assert len(found) == 20 and found[0]["start"] == 3.0
    for push in found:
        assert 1.0 <= push["force"] <= 2.0 and 0.2 <= push["hold"] <= 0.4
        assert min(push["rise"], push["fall"]) >= 0.05 and max(push["rise"], push["fall"]) <= 0.1
        assert np.isclose(np.linalg.norm(push["direction"]), 1.0)
        assert push["link"] == 3 and push["point"] == [0.022, 0.0, 0.0]
    ends = np.array([push["start"] + push["rise"] + push["hold"] + push["fall"] for push in found])
    gaps = np.array([push["start"] for push in found])[1:] - ends[:-1]
    assert gaps.min() >= 1.0 - 1e-9 and gaps.max() <= 2.0 + 1e-9


def test_directions_are_taken_in_turn() -> None:
    found = pushes(duration=1e3, count=120, direction=["pad", "side", "any"])
    pads, sides, any_way = (np.abs([push["direction"] for push in found[k::3]]) for k in range(3))
    assert np.all(pads == [0.0, 0.0, 1.0]) and np.all(sides == [0.0, 1.0, 0.0])
    assert np.all((any_way.max(axis=1) > 0.0) & (any_way.max(axis=1) < 1.0))
    # as often from the pad as from the nail, within 4 standard deviations of 40 draws
    assert abs(sum(push["direction"][2] for push in found[::3])) < 4 * np.sqrt(40)


def test_anywhere_is_along_all_links_by_their_length() -> None:
    found = pushes(duration=1e5, count=600, where="anywhere")
    share = np.mean([push["link"] == 2 for push in found])
    assert {push["link"] for push in found} == {2, 3} and abs(share - 45 / 67) < 4 * np.sqrt(0.25 / 600)
    far = np.array([push["point"][0] for push in found if push["link"] == 2])
    assert far.min() >= 0.0 and far.max() <= 0.045 and abs(far.mean() - 0.0225) < 4 * 0.045 / np.sqrt(12 * len(far))


TIPLESS = [Segment(1, [0.0, 0.0, 0.0], [0.0, 1.0, 0.0])]


@pytest.mark.parametrize(
    ("changes", "line"),
    [
        ({"count": 60}, r"pushes\.count = 60: expected at most \d+: the next one would end at"),
        ({"count": None}, r"pushes\.count: missing"),
        ({"force": [-1.0, 2.0]}, r"pushes\.force\[1\] = -1\.0: expected a number in N, at least 0"),
        ({"rise": [0.0, 0.1]}, r"pushes\.rise\[1\] = 0\.0: expected a number in s, above 0"),
        ({"where": "palm"}, r'pushes\.where = "palm": expected "tip" or "anywhere"'),
        ({"direction": ["pad", "up"]}, r'pushes\.direction\[2\] = "up": expected "any" or "pad" or "side"'),
        ({"strength": 2.0}, r"pushes\.strength = 2\.0: unknown key; expected one of count"),
        ({"segments": TIPLESS, "direction": "pad"}, r'pushes\.direction = "pad": .*: no pad, since physics\.tip'),
        ({"segments": TIPLESS, "where": "anywhere"}, r"pushes\.where .*no link of this finger has a length"),
    ],
)
def test_bad_pushes_are_refused_by_key(changes: dict[str, Any], line: str) -> None:
    with pytest.raises(Refusal, match=line):
        pushes(**changes)


def test_a_list_of_pushes_is_left_to_the_plant() -> None:
    listed = [{"start": 1.0}]
    assert expand_pushes(Node(listed, "pushes"), SEGMENTS, seed=1, duration=9.0) == listed
    with pytest.raises(Refusal, match=r"pushes\[1\] = 3: expected an object"):
        expand_pushes(Node([3], "pushes"), SEGMENTS, seed=1, duration=9.0)
