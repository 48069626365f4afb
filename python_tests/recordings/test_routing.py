"""Moment arms, stiffness and zeros are learned from joint encoders, with intervals that hold."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from command import Call
from repository_paths import ROOT
from tendonfmu.calibration.calibration import _read
from tendonfmu.files import write_table
from tendonfmu.model import Finger, finger_from_data, read_finger, tendon_positions
from tendonfmu.options import CalibrateOptions
from tendonfmu.recordings import Recording, belongs, learn_routing, read_recording, routed
from tendonfmu.recordings.faults import tendon_angles
from tendonfmu.recordings.routing import is_creep

INDEX = ROOT / "examples" / "fingers" / "index_finger.json"
FREE = ROOT / "examples" / "demo_recording" / "index_finger_free.parquet"
STEP = 1e-6  # m, of the motors' encoders
ARMS = np.array([[0.009, 0.006], [-0.008, -0.007], [0.010, -0.005]])
STIFFNESS = np.array([3000.0, 4000.0, 6000.0])
ZEROS = np.array([0.0125, 0.0, -0.002])


@pytest.fixture(scope="module")
def index() -> tuple[Finger, Recording]:
    return read_finger(INDEX), read_recording(FREE)


def changed(finger: Finger, **numbers: float) -> Finger:
    """The index finger with all arms, all stiffnesses and the zero of the third tendon off."""
    data = json.loads(json.dumps(dict(finger.data)))
    for i, tendon in enumerate(data["tendons"]):
        tendon["moment_arms"] = [
            arm * (1 + numbers.get("arms", 0.0) * (-1) ** (i + j)) for j, arm in enumerate(tendon["moment_arms"])
        ]
        tendon["stiffness"] *= numbers.get("stiffness", 1.0)
    return finger_from_data(data)


def turned_round(travel: np.ndarray[Any, Any], distance: float) -> np.ndarray[Any, Any]:
    """Which way friction points, -1 to 1: it turns round over a distance."""
    state = np.zeros_like(travel)
    for k in range(1, len(travel)):
        state[k] = np.clip(state[k - 1] + (travel[k] - travel[k - 1]) / distance, -1.0, 1.0)
    return state


def made_up(
    seed: int,
    encoder: float = 1e-4,
    curved: float = 0.0,
    still: bool = False,
    stiff: float = 1.0,
    rubbing: float = 0.0,
    creep: tuple[float, float] = (0.0, 1.0),
) -> tuple[Finger, Recording]:
    """A minute at 100 Hz of a finger that shares no code with the rest, and its true description."""
    draws = np.random.default_rng(seed)
    time = np.arange(6000) / 100.0
    phases, rates = draws.uniform(0.0, 6.0, (2, 3)), draws.uniform(0.2, 0.9, (2, 3))
    angle = np.stack(
        [
            0.4 * np.sin(rate[:, None] * time + phase[:, None]).sum(axis=0)
            for rate, phase in zip(rates, phases, strict=True)
        ],
        axis=1,
    )
    if still:
        angle[:, 1] = 0.3
    force = 12.0 + 6.0 * np.sin(draws.uniform(0.3, 1.5, 3) * time[:, None] + draws.uniform(0, 6, 3))
    force += 2.0 * np.sign(np.gradient(angle[:, :1], axis=0))  # friction that turns round
    share, seconds = creep
    crept = force[:1]  # the part of the stretch that follows slowly
    if share:
        force += 3.0 * np.sign(np.sin(time / 3.0))[:, None]  # another pretension
        kept, crept = np.exp(-0.01 / seconds), force.copy()
        for k in range(1, len(time)):
            crept[k] = kept * crept[k - 1] + (1.0 - kept) * force[k]
    position = angle @ ARMS.T + (force + share * crept) / (stiff * STIFFNESS) + ZEROS
    position[:, 0] += curved * angle[:, 0] ** 2
    for j in range(2) if rubbing else ():  # behind each level a cord bears a share less, or more where it is let out
        position -= rubbing * force * turned_round(angle[:, j:] @ ARMS[:, j:].T, 3e-5) / STIFFNESS
    groups = {
        "tendon_force": force + 0.05 * draws.standard_normal(force.shape),
        "tendon_position": STEP * np.round(position / STEP),
        "joint_position": angle + encoder * draws.standard_normal(angle.shape),
    }
    data = {
        "format": "tendonfmu-finger-1",
        "name": "made_up",
        "joints": [{"name": "near"}, {"name": "far"}],
        "tendons": [
            {"stiffness": k, "moment_arms": arms, "zero": zero}
            for k, arms, zero in zip((stiff * STIFFNESS).tolist(), ARMS.tolist(), ZEROS.tolist(), strict=True)
        ],
        "contact": {"threshold": [0.1, 0.1]},
    }
    return finger_from_data(data), Recording(Path("made_up.csv"), time, groups)


@pytest.mark.parametrize("encoder", [1e-5, 1e-2])
def test_intervals_cover_the_truth(encoder: float) -> None:
    """In 95 of 100 cases, and with coarse encoders, too, whose noise would make the arms too small."""
    covered = []
    for seed in range(20):
        finger, recording = made_up(seed, encoder)
        numbers = [number for each in learn_routing(finger, [recording]) for number in each.numbers]
        assert len(numbers) == 12 and all(number.is_known for number in numbers)
        covered += [abs(number.value - number.described) <= number.half for number in numbers]
    assert 0.90 <= np.mean(covered) <= 0.99


def test_friction_along_a_cord_is_no_other_spring() -> None:
    """A cord that stretches less behind its pulleys, by a share that turns round with its motion."""
    off, covered = [], []
    for seed in range(8):
        finger, recording = made_up(seed, rubbing=0.03)
        for each in learn_routing(finger, [recording]):
            off += [abs(number.value / number.described - 1.0) for number in (each.stiffness, *each.arms.values())]
            covered += [abs(number.value - number.described) <= number.half for number in each.numbers]
    assert max(off) < 0.008 and np.mean(covered) > 0.7  # without regard to it: 0.037


@pytest.mark.parametrize("seconds", [0.8, 5.0])
def test_a_cord_that_creeps_has_no_other_zero(seconds: float) -> None:
    """The stiffness is that of a load at rest, whatever time the cord takes."""
    stiffness, zeros = [], []
    for seed in range(4):
        finger, recording = made_up(seed, creep=(0.05, seconds))
        for each in learn_routing(finger, [recording]):
            stiffness.append(abs(1.05 * each.stiffness.value / each.stiffness.described - 1.0))
            zeros.append(abs(each.zero.off))
    assert max(stiffness) < 0.01 and max(zeros) < 20e-6  # without regard to it: 0.047 and 183e-6


def test_slow_stretches_that_cancel_are_no_creep() -> None:
    """Shares of the stretch within 1, 3 and 10 s: of cords that creep, and of elastic ones that only seem to."""
    for parts in ([0.009, 0.024, 0.019], [-0.006, 0.034, 0.019], [0.053, -0.015, 0.008]):
        assert is_creep(np.array(parts))
    for parts in ([0.65, -0.48, -0.02], [0.37, -0.11, -0.17], [0.04, 0.02, -0.06], [-0.01, -0.03, -0.02]):
        assert not is_creep(np.array(parts))


def test_springs_and_play_that_are_described_are_not_off() -> None:
    """Progressive springs and play of the drives, as the description has them: no arm, stiffness or zero differs."""
    hardening, play = 2e5, 0.4e-3  # N/m², m
    finger, recording = made_up(3)
    force, straight = recording.groups["tendon_force"], recording.groups["tendon_position"]
    progressive = (np.sqrt(STIFFNESS**2 + 4.0 * hardening * np.abs(force)) - STIFFNESS) / (2.0 * hardening)
    bent = straight + np.sign(force) * progressive - force / STIFFNESS
    bent[:, 0] += play / 2.0 * turned_round(bent[:, :1], play / 2.0)[:, 0]
    given = Recording(recording.path, recording.time, {**recording.groups, "tendon_position": bent})
    rows = [{"effect": "tendon_nonlinearity", "tendon": i, "hardening": hardening} for i in (1, 2, 3)]
    rows.append({"effect": "backlash", "tendon": 1, "width": play})
    whole = finger.replace({"extensions": rows})
    most = {
        name: max(abs(n.off) / n.known_to for each in learn_routing(described, [given]) for n in each.numbers)
        for name, described in (("bent", whole), ("straight", finger))
    }
    assert most["bent"] < 1.0 and most["straight"] > 10.0


def test_a_finger_begun_wrong_gets_its_routing_back(index: tuple[Finger, Recording]) -> None:
    """Arms off by 20 % and stiffness by a factor of 2: within 1 and 5 %, zeros within 3 steps of the encoder."""
    finger, recording = index
    given = changed(finger, arms=0.2, stiffness=2.0)
    found, moved = routed(given, learn_routing(given, [recording]))
    assert len(moved) == 8 + int(np.count_nonzero(finger.moment_arms))
    np.testing.assert_allclose(found.moment_arms, finger.moment_arms, rtol=0.01)
    stiffness = [[tendon["stiffness"] for tendon in each.data["tendons"]] for each in (found, finger)]
    np.testing.assert_allclose(*stiffness, rtol=0.05)
    assert all(abs(tendon.get("zero") or 0.0) < 3.0 * STEP for tendon in found.data["tendons"])


def test_a_zero_is_found_and_said(index: tuple[Finger, Recording]) -> None:
    finger, recording = index
    position = recording.groups["tendon_position"] + np.where(np.arange(8) == 2, 0.0125, 0.0)
    moved = replace(recording, groups={**recording.groups, "tendon_position": position})
    (finding,) = belongs(finger, [moved])
    assert (finding.kind, finding.severity) == ("routing", "warning")
    assert "tendon mcp_extensor_radial: zero is off by 12.5 ± " in finding.line()
    found, _ = routed(finger, learn_routing(finger, [moved]))
    assert found.data["tendons"][2]["zero"] == pytest.approx(0.0125, abs=3.0 * STEP)
    assert not belongs(found, [moved])


def test_arm_stiffness_and_unit_are_named(index: tuple[Finger, Recording]) -> None:
    finger, recording = index
    lines = [finding.line() for finding in belongs(changed(finger, arms=0.1, stiffness=0.625), [recording])]
    assert len(lines) == 8
    assert "moment arm at joint mcp_abduction is 9.09 to 9.1 % smaller than described" in lines[0]
    assert "N/m, 59.9 to 60 % larger than described" in lines[1]
    grams = {**recording.groups, "tendon_force": recording.groups["tendon_force"] / 9.80665e-3}
    (unit,) = belongs(finger, [replace(recording, groups=grams)])
    assert unit.severity == "error" and '"unit": "gf"' in unit.line()


def test_a_unit_of_forces_shows_in_stiff_springs_too() -> None:
    """Whose stretch is too small a part of the positions for the balance of the columns."""
    finger, recording = made_up(5, encoder=1e-5, stiff=20.0)
    assert not belongs(finger, [recording])
    grams = {**recording.groups, "tendon_force": recording.groups["tendon_force"] / 9.80665e-3}
    (unit,) = belongs(finger, [replace(recording, groups=grams)])
    assert (unit.kind, unit.severity) == ("scale", "error") and '"unit": "gf"' in unit.line()


def test_what_the_motion_cannot_tell_stays() -> None:
    finger, recording = made_up(3, still=True)
    learned = learn_routing(finger, [recording])
    assert learned[0].unknown == ["tendons[1].moment_arms[2]", "tendons[1].zero"]
    assert routed(finger, learned)[1] == []
    slack = {**recording.groups, "tendon_force": recording.groups["tendon_force"] * [1.0, 0.0, 1.0]}
    assert [each.tendon for each in learn_routing(finger, [replace(recording, groups=slack)])] == [0, 2]
    alone = {name: values for name, values in recording.groups.items() if name != "joint_position"}
    assert all(each.seen_from for each in learn_routing(finger, [replace(recording, groups=alone)]))


def test_an_arm_that_varies_is_seen_and_no_other() -> None:
    finger, recording = made_up(4, curved=1e-3)
    learned = learn_routing(finger, [recording])
    assert [list(each.varying) for each in learned] == [[0], [], []]
    assert learned[0].varying[0] == pytest.approx(
        2e-3 * np.ptp(recording.groups["joint_position"][:, 0]) / 0.009, rel=0.1
    )
    findings = belongs(finger, [recording])
    assert findings[0].severity == "warning" and "tendon 1: moment arm at joint near changes" in findings[0].line()


# --- the commands -----------------------------------------------------------------------------------------------------


def test_fit_without_joint_positions_says_so(tmp_path: Path, call: Call) -> None:
    finger, recording = made_up(8)
    data = {**finger.data, "joints": [{"name": "near"}], "contact": {"threshold": [0.1]}}
    data["tendons"] = [{"stiffness": 3000.0, "moment_arms": [0.009]}]
    columns = {f"{name}[1]": recording.groups[name][:, 0] for name in ("tendon_force", "tendon_position")}
    write_table(tmp_path / "alone.csv", {"time": recording.time, **columns})
    (tmp_path / "given.json").write_text(json.dumps(data), encoding="utf-8")
    said = call("fit", tmp_path / "given.json", tmp_path / "alone.csv", "-o", tmp_path / "f.json", "--routing")
    assert said.status == 2 and "no routing can be learned; expected joint_position, or more tendons" in said.err


# --- without encoders -------------------------------------------------------------------------------------------------


def test_redundant_tendons_show_their_stiffness() -> None:
    """Intervals cover; at several joints no arm and no zero is known by itself."""
    covered = []
    for seed in range(10):
        finger, recording = made_up(seed)
        recording.groups.pop("joint_position")
        given = changed(finger, stiffness=0.5)
        learned = learn_routing(given, [recording])
        assert all(
            each.unknown == [number.path for number in each.numbers if number != each.stiffness] for each in learned
        )
        truth = [tendon["stiffness"] for tendon in finger.data["tendons"]]
        covered += [abs(each.stiffness.value - truth[each.tendon]) <= each.stiffness.half for each in learned]
        assert [number.path for number in routed(given, learned)[1]] == [each.stiffness.path for each in learned]
    assert len(covered) == 30 and np.mean(covered) >= 0.85


def test_redundant_tendons_are_corrected_together() -> None:
    """They stand in one equation: where one is off, smaller differences of the others count, too."""
    finger, recording = made_up(0)
    recording.groups.pop("joint_position")

    def moved(*factors: float) -> list[int]:
        tendons = [
            {**tendon, "stiffness": factor * tendon["stiffness"]}
            for tendon, factor in zip(finger.data["tendons"], factors, strict=True)
        ]
        learned = learn_routing(finger.with_data({**finger.data, "tendons": tendons}), [recording])
        return [each.tendon for each in learned if each.stiffness.differs]

    assert moved(1.08, 0.98, 1.0) == [0, 1]
    assert moved(1.02, 0.98, 1.0) == []


def test_a_calibration_begins_with_the_routing(tmp_path: Path, index: tuple[Finger, Recording]) -> None:
    given, free = tmp_path / "given.json", tmp_path / "free.parquet"
    given.write_text(json.dumps(dict(changed(index[0], arms=0.2, stiffness=0.5).data)), encoding="utf-8")
    index[1][:30.0].write(free)
    case = _read(given, [[free], [], []], CalibrateOptions())
    np.testing.assert_allclose(case.finger.moment_arms, index[0].moment_arms, rtol=0.01)
    assert case.routing is not None and len(case.routing["sentences"]) == 8
    assert _read(INDEX, [[free], [], []], CalibrateOptions()).routing is None


def test_a_finger_is_described_by_names(tmp_path: Path, call: Call) -> None:
    table, out = tmp_path / "tendons.txt", tmp_path / "finger.json"
    table.write_text("FDP mcp+ pip+\n\nEDC mcp- pip-\nFDS mcp+\n", encoding="utf-8")
    given: list[Any] = ["describe", "finger", "--name", "index", "--joints", "mcp, pip", "-o", out]
    assert call(*given, "--table", table).status == 0
    finger = read_finger(out)
    assert np.sign(finger.moment_arms).tolist() == [[1, 1], [-1, -1], [1, 0]]
    assert finger.tendon_names == ["FDP", "EDC", "FDS"] and finger.joint_names == ["mcp", "pip"]
    out.unlink()
    for line, reason in (
        ("FDP mcp+ dip+", "'dip+' is none of the joints mcp, pip with + or -"),
        ("FDP mcp", "'mcp' is none of the joints"),
        ("FDP", "expected a name and the joints"),
        ("FDP mcp+", "not of full column rank"),
    ):
        said = call(*given, "--tendon", line)
        assert said.status == 2 and reason in said.err and said.err.count("\n") == 1 and not out.exists()
    assert call(*given).status == 2
    assert call(*given, "--tendon", "A mcp+", "--tendon", "A pip+").err.count("given twice") == 1
    assert call(*given, "--table", tmp_path / "nowhere.txt").status == 2


@pytest.mark.long
def test_intervals_cover_on_fingers_by_seed() -> None:
    """Four fingers that share no code with the product: arms within 1 %, stiffness within 5 %, zeros within 3 steps."""
    from evidence.families import cases

    off, covered, alone = [], [], []
    for seed in (1, 3, 5, 7):
        case = cases.make("dahl", seed, "none")
        finger = finger_from_data(case.nominal)
        for table in case.recordings.values():
            part = Recording.from_frame(table)[0.0:60.0]
            for each in learn_routing(finger, [part]):
                covered += [abs(number.value - number.described) <= number.half for number in each.numbers]
                off += [
                    *(abs(arm.value / arm.described - 1.0) / 0.01 for arm in each.arms.values()),
                    abs(each.stiffness.value / each.stiffness.described - 1.0) / 0.05,
                    abs(each.zero.value) / (3.0 * STEP),
                ]
            part.groups.pop("joint_position")
            alone += [each.stiffness for each in learn_routing(finger, [part]) if each.stiffness.is_known]
    assert len(covered) > 100 and 0.88 <= np.mean(covered) <= 1.0 and max(off) < 1.0
    assert len(alone) == 32 and max(abs(each.value / each.described - 1.0) for each in alone) < 0.02
    assert sum(abs(each.value - each.described) <= each.half for each in alone) >= 31


def test_a_rigid_drive_has_no_stiffness_to_learn() -> None:
    """Its stretch is rounding, as of a motor whose angle is the joint's."""
    finger, recording = made_up(7, encoder=1e-9, stiff=1e6)
    learned = learn_routing(finger, [recording])
    assert [each.stiffness.is_known for each in learned] == [False] * 3 and routed(finger, learned)[1] == []


def test_a_planned_motion_drives_the_motors_from_their_zeros() -> None:
    finger, recording = made_up(6)
    angle, force = recording.groups["joint_position"], recording.groups["tendon_force"]
    bare = [{key: value for key, value in row.items() if key != "zero"} for row in finger.data["tendons"]]
    ordered, plain = (tendon_positions(data, angle, force) for data in (finger.data, {**finger.data, "tendons": bare}))
    np.testing.assert_allclose(ordered - plain, np.broadcast_to(ZEROS, ordered.shape), atol=1e-15)
    read = tendon_angles(replace(recording, groups={**recording.groups, "tendon_position": ordered}), finger)
    np.testing.assert_allclose(read, angle, atol=1e-9)
