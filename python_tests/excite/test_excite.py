"""`tendonfmu excite`: the motion keeps its promises between rows too, and what it says of itself is true."""

from __future__ import annotations

import copy
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.interpolate import BPoly

from command import Call
from excite_fingers import INDEX, INDEX_DATA, INDEX_RANGES, SMALL, SMALL_RANGES
from tendonfmu.errors import InputError
from tendonfmu.estimate.identifiability import EffectCoverage, coverage_of, durations
from tendonfmu.excite.excitation import (
    ACCELERATION,
    Excitation,
    Plan,
    Variation,
    evaluate_quintic,
    plan_excitation,
    pretension_vector,
)
from tendonfmu.excite.training_motion import as_array, find_pretensions, find_ranges, read_subject
from tendonfmu.files.tables import read_table
from tendonfmu.model.friction_places import effects, moment_arms, working_point_weights


@pytest.fixture(scope="module")
def motion() -> Excitation:
    """400 s of the index finger."""
    return plan_excitation(INDEX_DATA, Plan(INDEX_RANGES, seed=3))


def covered(motion: Excitation) -> list[EffectCoverage]:
    """Of the index finger."""
    return coverage_of(INDEX_DATA, motion.joint_position, motion.joint_velocity, durations(motion.time))


@pytest.fixture
def small_file(tmp_path: Path) -> Path:
    path = tmp_path / "small.json"
    path.write_text(json.dumps(SMALL))
    return path


@pytest.fixture
def run(call: Call) -> Call:
    return lambda *arguments: call("excite", *map(str, arguments))


# --- the motion -------------------------------------------------------------------------------------------------------


def test_quintic_agrees_with_scipy() -> None:
    random = np.random.default_rng(1)
    knots = np.column_stack([np.cumsum(random.uniform(0.1, 2, 9)), random.normal(size=(9, 3))])
    time = random.uniform(knots[0, 0], knots[-1, 0], 500)
    reference = BPoly.from_derivatives(knots[:, 0], knots[:, 1:])
    for order, found in enumerate(evaluate_quintic(knots, time)):
        np.testing.assert_allclose(found, reference.derivative(order)(time) if order else reference(time), atol=1e-9)
    knots = np.array([[1.0, 0.2, 0.0, 0.0], [2.0, 0.7, 0.0, 0.0]])  # constant outside
    np.testing.assert_array_equal(evaluate_quintic(knots, np.array([0.0, 1.0, 2.0, 5.0]))[0], [0.2, 0.2, 0.7, 0.7])


def test_limits_hold_between_rows(motion: Excitation) -> None:
    other = plan_excitation(SMALL, Plan(SMALL_RANGES, duration=40, rate=30.0, max_speed=3.0))
    assert len(other.time) == 40 * 30 + 1 and other.time[-1] == 40.0
    for planned, ranges, speed in ((motion, INDEX_RANGES, 1.0), (other, SMALL_RANGES, 3.0)):
        time = np.linspace(0, planned.time[-1], 100_000)
        for knots, (low, high) in zip(planned.knots, ranges, strict=True):
            position, velocity, acceleration = evaluate_quintic(knots, time)
            assert position.min() >= low - 1e-12 and position.max() <= high + 1e-12
            assert np.abs(velocity).max() <= speed + 1e-9
            assert np.abs(acceleration).max() <= ACCELERATION + 1e-9


def test_rows_reproduce_the_motion(motion: Excitation) -> None:
    """Quintic interpolation between the rows of the file is the motion itself."""
    time = np.random.default_rng(0).uniform(0, 400, 20_000)
    for j, knots in enumerate(motion.knots):
        rows = np.column_stack(
            [motion.time, *(getattr(motion, f"joint_{of}")[:, j] for of in ("position", "velocity", "acceleration"))]
        )
        for found, expected, size in zip(
            evaluate_quintic(rows, time), evaluate_quintic(knots, time), (1, 100, 1e4), strict=True
        ):
            np.testing.assert_allclose(found, expected, atol=1e-13 * size)


def test_covers_angles_speeds_and_directions(motion: Excitation) -> None:
    np.testing.assert_allclose(motion.joint_position.min(axis=0), INDEX_RANGES[:, 0], atol=1e-12)
    np.testing.assert_allclose(motion.joint_position.max(axis=0), INDEX_RANGES[:, 1], atol=1e-12)
    assert (np.abs(motion.joint_velocity).max(axis=0) > 0.9).all()
    for cover in covered(motion):
        assert min(cover.times.positive, cover.times.negative) > 100
        for point in cover.points:
            assert min(point.positive, point.negative) > 2


def test_joints_move_at_once_with_different_velocities(motion: Excitation) -> None:
    moving = np.abs(motion.joint_velocity) > 0.01
    assert np.mean(moving.sum(axis=1) >= 3) > 0.7
    assert np.abs(np.corrcoef(motion.joint_velocity.T) - np.eye(4)).max() < 0.2
    begin_and_end = (motion.time <= 2.0) | (motion.time >= 399.0)
    assert not motion.joint_velocity[begin_and_end].any() and not motion.joint_acceleration[begin_and_end].any()


def test_seed_alone_decides() -> None:
    plan = Plan(SMALL_RANGES, duration=30, seed=7)
    first, again = plan_excitation(SMALL, plan), plan_excitation(SMALL, plan)
    other = plan_excitation(SMALL, Plan(SMALL_RANGES, duration=30, seed=8))
    for name, column in first.columns().items():
        np.testing.assert_array_equal(column, again.columns()[name])
    assert np.abs(first.joint_position - other.joint_position).max() > 0.1


# --- pretension -------------------------------------------------------------------------------------------------------


def test_pretension_holds_itself() -> None:
    shares = pretension_vector(INDEX_DATA)
    np.testing.assert_allclose(moment_arms(INDEX_DATA).T @ shares, 0, atol=1e-12)
    assert np.mean(shares) == pytest.approx(1)
    documented = np.array([0.91, 0.87, 1.11, 1.09, 0.89, 1.08, 0.94, 1.04])  # examples/fingers/README.md
    np.testing.assert_allclose(shares, documented / documented.mean(), atol=0.006)


def test_pretension_keeps_every_tendon_taut() -> None:
    """Where the even share would push, the nearest one that pulls is taken."""
    data = copy.deepcopy(SMALL)
    data["joints"] = [{"name": "only"}]
    data["tendons"] = [
        {"stiffness": 1000.0, "moment_arms": [arm]} for arm in (0.02, 0.001, -0.001, -0.001, -0.001, -0.001)
    ]
    shares = pretension_vector(data)
    assert shares.min() > 0.04 and np.mean(shares) == pytest.approx(1)
    assert abs(float(moment_arms(data)[:, 0] @ shares)) < 1e-9


def test_several_pretensions_in_turn() -> None:
    motion = plan_excitation(SMALL, Plan(SMALL_RANGES, duration=30, pretensions=(10, 40)))
    assert motion.time[-1] == 60
    alternating = plan_excitation(SMALL, Plan(SMALL_RANGES, duration=60, pretensions=(10, 20, 40), alternate=10))
    assert [level for _, _, level in alternating.blocks] == [10, 20, 40, 10, 20, 40]
    np.testing.assert_allclose(motion.joint_position[:3001], motion.joint_position[3000:], atol=1e-12)
    assert set(np.unique(motion.pretension[[0, 3000, 3200, 6000]])) == {10, 40}
    changing = np.flatnonzero(np.diff(motion.pretension))
    assert len(changing) and not motion.joint_velocity[changing].any()
    assert np.abs(np.diff(motion.pretension)).max() < 0.5
    stretch = motion.tendon_position - motion.joint_position @ moment_arms(SMALL).T
    force = stretch * [tendon["stiffness"] for tendon in SMALL["tendons"]]
    np.testing.assert_allclose(force.mean(axis=1), motion.pretension)
    np.testing.assert_allclose(force @ moment_arms(SMALL), 0, atol=1e-12)


# --- tensions that vary -----------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def varied() -> Excitation:
    """400 s of the index finger, at 20 rows per second."""
    return plan_excitation(INDEX_DATA, Plan(INDEX_RANGES, rate=20, vary=Variation(5.0, 30.0, 10.0)))


def test_varied_tensions_hold_themselves_within_their_limits(varied: Excitation) -> None:
    np.testing.assert_allclose(varied.tension @ moment_arms(INDEX_DATA), 0, atol=1e-12)
    assert varied.tension.min() >= 5.0 - 1e-9 and varied.tension.max() <= 30.0 + 1e-9
    assert (varied.tension.min(axis=0) < 6.5).all() and (varied.tension.max(axis=0) > 24.0).all()
    np.testing.assert_allclose(varied.pretension, varied.tension.mean(axis=1))
    stretch = varied.tendon_position - varied.joint_position @ moment_arms(INDEX_DATA).T
    stiffness = [tendon["stiffness"] for tendon in INDEX_DATA["tendons"]]
    np.testing.assert_allclose(stretch * stiffness, varied.tension, rtol=1e-9)


def test_varied_tensions_change_in_every_way_there_is(varied: Excitation) -> None:
    """8 tendons, 4 joints: 4 ways, none of them faint; a tendon is tight while another one is loose."""
    ways = np.linalg.svd(varied.tension - varied.tension.mean(axis=0), compute_uv=False)
    assert ways[3] > 0.2 * ways[0] and ways[4] < 1e-9 * ways[0]
    together = np.corrcoef(varied.tension.T)[np.ix_((0, 1, 4, 6), (0, 1, 4, 6))]  # one of each pair of antagonists
    assert np.abs(together - np.eye(4)).max() < 0.5


def test_varied_tensions_stand_and_change_in_turn(varied: Excitation) -> None:
    phase = np.mod(varied.time[1:], 10.0)
    step = np.abs(np.diff(varied.tension, axis=0)).max(axis=1)
    assert step[(phase > 1.6) | (varied.time[1:] < 10.0)].max() < 1e-9
    assert step.max() < 25.0 * 15 / 8 / 1.5 / 20 * (1 + 1e-9)  # the fastest of a quintic of 1.5 s
    moving = np.abs(varied.joint_velocity[1:][step > 1e-3]).max(axis=1)
    assert np.mean(moving > 0.01) > 0.9
    plain = plan_excitation(INDEX_DATA, Plan(INDEX_RANGES, rate=20))
    np.testing.assert_array_equal(plain.joint_position, varied.joint_position)  # strokes stay as they are


# --- what it says -----------------------------------------------------------------------------------------------------


def test_weights_are_the_cores_interpolation() -> None:
    effect = next(e for e in effects(SMALL) if e.path == "tendons[1].edge_friction[2]")
    angles = np.array([[-0.9, 0.0], [-0.5, 0.0], [-0.25, 0.0], [0.3, 0.0], [2.0, 0.0]])
    expected = [[1, 0, 0], [1, 0, 0], [0.5, 0.5, 0], [0, 0.5, 0.5], [0, 0, 1]]
    np.testing.assert_allclose(working_point_weights(effect, angles), expected, atol=1e-12)


# --- cable loops, ranges and rigs -------------------------------------------------------------------------------------


def loops(count: int) -> Any:
    """The small finger with its first tendons as cable loops."""
    return {**SMALL, "tendons": [{**tendon, "bidirectional": True} for tendon in SMALL["tendons"][:count]]}


def test_cable_loops_need_no_pretension_and_may_push(tmp_path: Path) -> None:
    np.testing.assert_array_equal(pretension_vector(loops(2)), 0)
    motion = plan_excitation(loops(2), Plan(SMALL_RANGES, duration=20))
    np.testing.assert_allclose(motion.tendon_position, motion.joint_position @ moment_arms(loops(2)).T)
    (tmp_path / "loops.json").write_text(json.dumps(loops(2)))
    assert find_pretensions(read_subject(tmp_path / "loops.json"), []) == [0.0]
    with pytest.raises(InputError, match="--pretension 10: the finger has only cable loops"):
        find_pretensions(read_subject(tmp_path / "loops.json"), [10.0])
    tension = plan_excitation(loops(3), Plan(SMALL_RANGES, duration=60, vary=Variation(2.0, 20.0, 5.0))).tension
    assert tension.min() < -10.0 and np.abs(tension).max() <= 20.0 + 1e-9
    np.testing.assert_allclose(tension @ moment_arms(loops(3)), 0, atol=1e-12)


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (SMALL, r"--vary-tension 10:11: no balanced pretension .*HIGH at least 2 times LOW"),
        (loops(2), "2 tendons at 2 joints hold no tension; expected more tendons than joints"),
    ],
)
def test_tensions_that_cannot_be_are_refused(data: Any, words: str) -> None:
    with pytest.raises(InputError, match=words):
        plan_excitation(data, Plan(SMALL_RANGES, duration=20, vary=Variation(10.0, 11.0)))
    with pytest.raises(InputError, match="every tendon pulls"):
        pretension_vector({**SMALL, "tendons": SMALL["tendons"][:2]})


def test_ranges_come_from_working_points_and_from_a_rig(small_file: Path, tmp_path: Path) -> None:
    ranges = find_ranges(read_subject(INDEX), [])
    np.testing.assert_allclose(as_array(ranges), INDEX_RANGES)
    assert [span.guessed for span in ranges] == [False, False, False, True]

    def rig(finger: Any, *limits: tuple[float, float]) -> Path:
        link = {"axis": [0, 1, 0], "mass": 0.01, "inertia": [1e-6] * 3}
        links = [link | {"limits": {"lower": low, "upper": high}} for low, high in limits]
        path = tmp_path / "rig.json"
        path.write_text(json.dumps({"format": "tendonfmu-rig-1", "finger": finger, "physics": {"links": links}}))
        return path

    for finger in (SMALL, small_file.name):
        subject = read_subject(rig(finger, (-0.4, 0.5), (-1.0, 1.0)))
        np.testing.assert_allclose(as_array(find_ranges(subject, [])), [[-0.355, 0.455], [-0.9, 0.9]])
    with pytest.raises(InputError, match=r"--range tip=-2:0: beyond the joint.*-1 to 1 rad"):
        find_ranges(subject, ["tip=-2:0"])
    for finger, limits, words in (
        (SMALL, [(0.4, -0.5)] * 2, r"links\[1\]\.limits\.upper = -0.5: expected an angle above limits.lower, 0.4 rad"),
        (SMALL, [(-0.4, 0.5)], "expected a list of 2, one link per joint of the finger"),
        ({}, [(-0.4, 0.5)], r"finger: .*format"),
    ):
        with pytest.raises(InputError, match=words):
            read_subject(rig(finger, *limits))


# --- the command ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("words", "plan"),
    [
        (["--seed", 4, "--pretension", 12], {"seed": 4, "pretensions": (12,)}),
        (
            ["--vary-tension", "5:25", "--vary-every", 4, "--max-acceleration", 15],
            {"vary": Variation(5.0, 25.0, 4.0), "max_acceleration": 15.0},
        ),
    ],
)
def test_command(run: Call, small_file: Path, tmp_path: Path, words: list[Any], plan: dict[str, Any]) -> None:
    out, report = tmp_path / "motion.csv", tmp_path / "report.json"
    done = run(small_file, "-o", out, "--duration", 30, "--report", report, *words)
    assert done.status == 0, done.err
    motion = plan_excitation(SMALL, Plan(np.array([[-0.5, 0.6], [-0.5, 0.5]]), duration=30, **plan))
    table = read_table(out, lambda file, names: None)
    assert list(table) == list(motion.columns())
    for name, column in motion.columns().items():
        np.testing.assert_array_equal(table[name], column)
    written = json.loads(report.read_text())
    assert written["format"] == "tendonfmu-excitation-1"
    assert all(f"{words[k]} {words[k + 1]}" in written["command"] for k in range(0, len(words), 2))
    assert "warning: joint tip: range unknown, moves 0.5 rad to either side" in done.err
    assert f"{written['identifiable']} of {written['numbers']} numbers" in done.out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ("--range thumb=0:1", "no joint 'thumb'; expected 1 to 2 or one of base, tip"),
        ("--range base=1:0", "expected JOINT=LOW:HIGH in rad, LOW <= HIGH"),
        ("--range base=nan:1", "expected JOINT=LOW:HIGH"),
        ("--duration 4", "--duration: 4 s at a pretension; expected at least"),
        ("--pretension 5 --pretension 9 --alternate 2", "--alternate: 2 s at a pretension"),
        ("--max-speed 0", "max-speed"),
        ("--pretension -3", "pretension"),
        ("--report nowhere/report.json", "no folder nowhere"),
        ("--vary-tension 20:5", "--vary-tension 20:5: expected LOW:HIGH in N, 0 < LOW < HIGH"),
        ("--vary-tension 5:20 --pretension 9", "with --pretension; expected one of the two"),
        ("--vary-tension 5:20 --alternate 9", "with --alternate; expected one of the two"),
        ("--vary-tension 5:20 --vary-every 1", "vary-every"),
        ("-o m.txt", "expected .csv, .parquet or .mcap"),
    ],
)
def test_command_refuses(run: Call, small_file: Path, tmp_path: Path, arguments: str, message: str) -> None:
    done = run(small_file, "-o", "motion.csv", *arguments.split())
    assert done.status == 2 and message in done.err.splitlines()[-1]
    assert [file.name for file in tmp_path.iterdir()] == [small_file.name]
