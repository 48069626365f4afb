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
from tendonfmu.simulate.motion_plan import PEAK_OVER_MEAN, Joints, Motion, Segment, expand_motion, expand_pushes
from tendonfmu.statistics.random_numbers import Draws

LIMITS = Joints([-0.35, -0.3, 0.0], [0.35, 1.4, 1.6])
SEGMENTS = [
    Segment(1, [0.0, 0.0, 0.0], [0.0, 0.0, 1.0]),
    Segment(2, [0.045, 0.0, 0.0], [0.0, 2.0, 0.0]),
    Segment(3, [0.022, 0.0, 0.0], [0.0, 1.0, 0.0]),
]


def strokes(**changes: Any) -> Motion:
    recipe = {"kind": "strokes", "seed": 4, "duration": 60.0, "pretension": 10.0} | changes
    return expand_motion(Node(recipe, "motion"), LIMITS, seed=1, duration=60.0)


def pushes(duration: float = 100.0, **changes: Any) -> list[Any]:
    return expand_pushes(Node({"count": 20, "seed": 4} | changes, "pushes"), SEGMENTS, seed=1, duration=duration)


def digest(value: Any) -> str:
    return hashlib.sha256(json.dumps(value).encode()).hexdigest()[:16]


def peak_speeds(knots: dict[str, list[float]]) -> np.ndarray:
    """Peak speed of each stroke: a quintic between resting points has 15/8 of its mean speed."""
    speeds = PEAK_OVER_MEAN * np.abs(np.diff(knots["position"])) / np.diff(knots["time"])
    return speeds[speeds > 1e-12]


# --- draws ------------------------------------------------------------------------------------------------------------


def test_the_streams_are_pcg64s() -> None:
    """numpy keeps the raw numbers of PCG64 and SeedSequence; 53 bits of each are the share."""
    raw = np.random.PCG64(np.random.SeedSequence([7, 1, 2])).random_raw(3)
    draws = Draws(7, 1, 2)
    assert [draws.share() for _ in range(3)] == [(int(word) >> 11) / 2**53 for word in raw]


def test_streams_differ_and_repeat() -> None:
    first, again, other = (Draws(1, 1, k).share() for k in (0, 0, 1))
    assert first == again != other


def test_directions_are_uniform_on_the_sphere() -> None:
    draws = Draws(3)
    vectors = np.array([draws.direction() for _ in range(4000)])
    assert np.allclose(np.linalg.norm(vectors, axis=1), 1.0)
    # mean 0 and covariance I/3; 5 standard errors
    assert np.abs(vectors.mean(axis=0)).max() < 5 / np.sqrt(3 * 4000)
    assert np.abs(np.cov(vectors.T) - np.eye(3) / 3).max() < 5 * 0.3 / np.sqrt(4000)


# --- strokes ----------------------------------------------------------------------------------------------------------


def test_the_same_seed_gives_the_same_motion_for_good() -> None:
    assert digest(strokes().expanded()) == "6d6ed42211a3ef28"
    assert digest(strokes(seed=5).expanded()) != digest(strokes().expanded())


def test_the_rig_seed_serves_where_the_motion_has_none() -> None:
    recipe = {"kind": "strokes", "duration": 60.0, "pretension": 10.0}
    seeded = expand_motion(Node(recipe, "motion"), LIMITS, seed=4, duration=None)
    assert seeded.expanded() == strokes().expanded()


def test_strokes_keep_speeds_limits_and_stillness() -> None:
    motion = strokes(speed=[0.2, 0.7], still=1.5)
    for knots, low, high in zip(motion.joints, LIMITS.lower, LIMITS.upper, strict=True):
        time, position = np.array(knots["time"]), np.array(knots["position"])
        assert np.diff(time).min() > 0.0
        assert time[0] == 0.0 and time[1] == 1.5 and position[0] == position[1]
        assert time[-1] <= 58.5
        margin = 0.05 * (high - low)
        assert position.min() >= low + margin - 1e-12 and position.max() <= high - margin + 1e-12
        assert peak_speeds(knots).max() <= 0.7 + 1e-9
        assert knots["velocity"] == knots["acceleration"] == [0.0] * len(time)


def test_long_strokes_have_the_speeds_drawn() -> None:
    """Only ways that are too short for the shortest stroke are slower than asked for."""
    for knots in strokes(speed=[0.3, 0.5], rest_share=0.0).joints:
        durations = np.diff(knots["time"])
        speeds = PEAK_OVER_MEAN * np.abs(np.diff(knots["position"])) / durations
        long = (durations > 0.4 + 1e-9) & (speeds > 0.0)
        assert long.sum() > 5
        assert speeds[long].min() >= 0.3 - 1e-9


def test_joints_move_on_their_own_and_rest() -> None:
    motion = strokes(duration=400.0)
    assert len({len(knots["time"]) for knots in motion.joints}) == 3
    rests = [np.sum(np.diff(knots["position"]) == 0.0) for knots in motion.joints]
    ways = [np.sum(np.diff(knots["position"]) != 0.0) for knots in motion.joints]
    # a quarter of the strokes, within 4 standard deviations of a binomial; the first second is a rest too
    for rest, way in zip(rests, ways, strict=True):
        assert abs(rest - 1 - 0.25 * way) < 4 * np.sqrt(0.25 * 0.75 * way)


@pytest.mark.parametrize("duration", [0.5, 2.0, 2.3, 2.5, 7.0])
def test_short_motions_end_in_time(duration: float) -> None:
    for knots in strokes(duration=duration).joints:
        assert max(knots["time"]) <= max(duration, 0.0)
        assert np.all(np.diff(knots["time"]) > 0.0)


@pytest.mark.parametrize(
    ("changes", "line"),
    [
        ({"speed": [-1.0, 0.9]}, r"motion\.speed\[1\] = -1\.0: expected a number in rad/s, above 0"),
        ({"speed": [0.9, 0.2]}, r"motion\.speed = \[0\.9, 0\.2\]: expected .*second not below the first"),
        ({"speed": 0.5}, r"motion\.speed = 0\.5: expected a list of 2"),
        ({"rest_share": 1.5}, r"motion\.rest_share = 1\.5: expected a number, at least 0 and at most 1"),
        ({"lower": [0.0, 0.0]}, r"motion\.lower = \[0\.0, 0\.0\]: expected a list of 3"),
        ({"lower": [0.0, -0.4, 0.0]}, r"motion\.lower\[2\] = -0\.4: expected an angle within the joint's range, -0\.3"),
        ({"upper": [-0.34, 1.0, 1.0]}, r"motion\.upper\[1\] = -0\.34: expected an angle not below motion\.lower"),
        ({"position": [0.0, 2.0, 0.5]}, r"motion\.position\[2\] = 2\.0: expected an angle within the joint's range"),
        ({"seed": -1}, r"motion\.seed = -1: expected an integer from 0"),
        ({"seed": 1.5}, r"motion\.seed = 1\.5: expected an integer"),
        ({"seed": True}, r"motion\.seed = true: expected an integer"),
        ({"pretension": 0.0}, r"motion\.pretension = 0\.0: expected a number in N"),
        ({"pretension": None}, r"motion\.pretension: missing; expected a number in N"),
        ({"pretension": "10 N"}, r'motion\.pretension = "10 N": expected a number in N'),
        ({"file": "a.csv"}, r'motion\.file = "a\.csv": unknown key'),
        ({"kind": "sine"}, r'motion\.kind = "sine": expected "still" or "strokes" or "file"'),
    ],
)
def test_bad_strokes_are_refused_by_key(changes: dict[str, Any], line: str) -> None:
    with pytest.raises(Refusal, match=line):
        strokes(**changes)


def test_strokes_without_limits_need_a_range() -> None:
    endless = Joints([-np.inf], [np.inf])
    recipe = {"kind": "strokes", "duration": 9.0, "pretension": 1.0}
    with pytest.raises(Refusal, match=r"motion\.lower: missing; expected .* since physics\.links\[1\] has no limits"):
        expand_motion(Node(recipe, "motion"), endless, seed=1, duration=None)
    found = expand_motion(Node(recipe | {"lower": [-1.0], "upper": [1.0]}, "motion"), endless, seed=1, duration=None)
    assert max(np.abs(found.joints[0]["position"])) <= 1.0


def test_still_stands() -> None:
    recipe = {"kind": "still", "position": [0.1, 0.2, 0.3], "pretension": 12.0}
    motion = expand_motion(Node(recipe, "motion"), LIMITS, seed=1, duration=None)
    assert [knots["position"] for knots in motion.joints] == [[0.1], [0.2], [0.3]]
    assert motion.pretension == {"time": [0.0], "value": [12.0]}


# --- motion files -----------------------------------------------------------------------------------------------------


def motion_table(rows: int = 5) -> dict[str, Any]:
    time = np.linspace(0.0, 4.0, rows)
    bump = np.sin(np.pi * time / 4.0) ** 2
    slope = np.pi / 4.0 * np.sin(np.pi * time / 2.0)
    slope[[0, -1]] = 0.0
    table: dict[str, Any] = {"time": time}
    for j in (1, 2, 3):
        table |= {
            f"joint_position[{j}]": 0.1 * bump,
            f"joint_velocity[{j}]": 0.1 * slope,
            f"joint_acceleration[{j}]": np.zeros(rows),
        }
    return table


def from_file(folder: Path, table: dict[str, Any], **changes: Any) -> Motion:
    write_table(folder / "motion.csv", table)
    recipe = {"kind": "file", "file": str(folder / "motion.csv"), "pretension": 10.0} | changes
    return expand_motion(Node(recipe, "motion"), LIMITS, seed=1, duration=None)


def test_a_motion_file_becomes_knots(tmp_path: Path) -> None:
    table = motion_table()
    motion = from_file(tmp_path, table)
    assert motion.joints[1]["time"] == table["time"].tolist()
    assert motion.joints[2]["velocity"] == table["joint_velocity[3]"].tolist()
    assert motion.file == tmp_path / "motion.csv"


def test_motor_positions_in_a_motion_file_are_for_robots(tmp_path: Path) -> None:
    """`tendonfmu excite` writes them; the rig commands its own motors."""
    with_motors = motion_table() | {"tendon_position[1]": np.full(5, 1e3), "tendon_position[2]": np.zeros(5)}
    assert from_file(tmp_path, with_motors).joints == from_file(tmp_path, motion_table()).joints


def test_the_pretension_of_a_file_keeps_its_steps(tmp_path: Path) -> None:
    table = motion_table(7) | {"pretension": np.array([10.0, 10.0, 10.0, 20.0, 20.0, 20.0, 20.0])}
    motion = from_file(tmp_path, table, pretension=None)
    time = table["time"]
    assert motion.pretension == {"time": [time[0], time[2], time[3]], "value": [10.0, 10.0, 20.0]}


def without(table: dict[str, Any], name: str) -> dict[str, Any]:
    return {key: column for key, column in table.items() if key != name}


def with_value(name: str, row: int, value: float) -> dict[str, Any]:
    table = motion_table()
    table[name] = table[name].copy()
    table[name][row - 1] = value
    return table


@pytest.mark.parametrize(
    ("table", "line"),
    [
        (without(motion_table(), "joint_velocity[2]"), r"motion\.csv: no column joint_velocity\[2\]"),
        (motion_table() | {"joint_position[4]": np.zeros(5)}, r"unknown column 'joint_position\[4\]'"),
        (with_value("time", 3, 0.5), r"column time, row 3: 0\.5; expected a time after the row before"),
        (with_value("time", 1, -1.0), r"column time, row 1: -1; expected 0 to"),
        (with_value("joint_velocity[1]", 5, 0.2), r"column joint_velocity\[1\], row 5: 0\.2; expected 0 in the first"),
        (with_value("joint_acceleration[3]", 1, 0.2), r"column joint_acceleration\[3\], row 1: 0\.2; expected 0 in"),
        (with_value("joint_position[1]", 1, 0.5), r"column joint_position\[1\], row 1: 0\.5; expected a start within"),
        (with_value("joint_position[1]", 2, 500.0), r"column joint_position\[1\], row 2: 500; expected -100 to 100"),
        (with_value("joint_position[1]", 2, np.nan), r"column joint_position\[1\], row 2: .*; expected"),
        (motion_table() | {"pretension": -np.ones(5)}, r"column pretension, row 1: -1; expected"),
    ],
)
def test_bad_motion_files_are_refused_by_column_and_row(tmp_path: Path, table: dict[str, Any], line: str) -> None:
    with pytest.raises((InputError, Refusal), match=line):
        from_file(tmp_path, table)


def test_a_pretension_is_given_once(tmp_path: Path) -> None:
    table = motion_table() | {"pretension": np.full(5, 10.0)}
    with pytest.raises(
        Refusal, match=r"motion\.pretension = 10\.0: expected nothing, since .* has a column pretension"
    ):
        from_file(tmp_path, table)
    with pytest.raises(Refusal, match=r"motion\.pretension: missing"):
        from_file(tmp_path, motion_table(), pretension=None)


# --- pushes -----------------------------------------------------------------------------------------------------------


def test_the_same_seed_gives_the_same_pushes_for_good() -> None:
    assert digest(pushes(where="anywhere")) == "d13f925fd5ec0605"
    assert digest(pushes(where="anywhere", seed=5)) != digest(pushes(where="anywhere"))


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
    for k, push in enumerate(found):
        along, side, pad = np.abs(push["direction"])
        if k % 3 == 0:
            assert (along, side, pad) == (0.0, 0.0, 1.0)
        elif k % 3 == 1:
            assert (along, side, pad) == (0.0, 1.0, 0.0)
        else:
            assert 0.0 < max(along, side, pad) < 1.0
    # as often from the pad as from the nail, within 4 standard deviations of 40 draws
    assert abs(sum(push["direction"][2] for push in found[::3])) < 4 * np.sqrt(40)


def test_anywhere_is_along_all_links_by_their_length() -> None:
    found = pushes(duration=1e5, count=600, where="anywhere")
    share = np.mean([push["link"] == 2 for push in found])
    assert {push["link"] for push in found} == {2, 3}
    assert abs(share - 45 / 67) < 4 * np.sqrt(0.25 / 600)
    far = np.array([push["point"][0] for push in found if push["link"] == 2])
    assert far.min() >= 0.0 and far.max() <= 0.045
    assert abs(far.mean() - 0.0225) < 4 * 0.045 / np.sqrt(12 * len(far))


@pytest.mark.parametrize(
    ("changes", "line"),
    [
        ({"count": 60}, r"pushes\.count = 60: expected at most \d+: the next one would end at"),
        ({"count": -1}, r"pushes\.count = -1: expected an integer from 0"),
        ({"count": None}, r"pushes\.count: missing"),
        ({"force": [-1.0, 2.0]}, r"pushes\.force\[1\] = -1\.0: expected a number in N, at least 0"),
        ({"rise": [0.0, 0.1]}, r"pushes\.rise\[1\] = 0\.0: expected a number in s, above 0"),
        ({"where": "palm"}, r'pushes\.where = "palm": expected "tip" or "anywhere"'),
        ({"direction": ["pad", "up"]}, r'pushes\.direction\[2\] = "up": expected "any" or "pad" or "side"'),
        ({"strength": 2.0}, r"pushes\.strength = 2\.0: unknown key; expected one of count"),
    ],
)
def test_bad_pushes_are_refused_by_key(changes: dict[str, Any], line: str) -> None:
    with pytest.raises(Refusal, match=line):
        pushes(**changes)


def test_a_pad_needs_a_link_with_a_length() -> None:
    tipless = [Segment(1, [0.0, 0.0, 0.0], [0.0, 1.0, 0.0])]
    with pytest.raises(
        Refusal, match=r'pushes\.direction = "pad": expected "any" or "side": no pad, since physics\.tip'
    ):
        expand_pushes(Node({"count": 1, "direction": "pad"}, "pushes"), tipless, seed=1, duration=9.0)
    with pytest.raises(Refusal, match=r"pushes\.where .*no link of this finger has a length"):
        expand_pushes(Node({"count": 1, "where": "anywhere"}, "pushes"), tipless, seed=1, duration=9.0)


def test_a_list_of_pushes_is_left_to_the_plant() -> None:
    listed = [{"start": 1.0}]
    assert expand_pushes(Node(listed, "pushes"), SEGMENTS, seed=1, duration=9.0) == listed
    with pytest.raises(Refusal, match=r"pushes\[1\] = 3: expected an object"):
        expand_pushes(Node([3], "pushes"), SEGMENTS, seed=1, duration=9.0)
