"""`tendonfmu check FINGER.json RECORDING`: signs, order and units of columns, clocks and sensors.

How often it is right: docs/evidence/logs.md.
"""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from command import Call
from repetitions import repeated
from repository_paths import ROOT
from tendonfmu.errors import InputError
from tendonfmu.files.tables import write_table
from tendonfmu.model.description import Finger, read_finger
from tendonfmu.recordings.match import UNFIT_FOR_SEARCH, admit, belongs, refuse_errors
from tendonfmu.recordings.prepared import Held, prepare
from tendonfmu.recordings.recording import GROUPS, Recording, read_recording

EXAMPLES = ROOT / "examples"
INDEX = EXAMPLES / "fingers" / "index_finger.json"
DEMO = EXAMPLES / "demo_recording"
FREE = DEMO / "index_finger_free.parquet"
SECONDS = 20
SI = {"time": "s"} | {group: unit for group, (unit, _) in GROUPS.items()}
Numbers = NDArray[np.float64]


@pytest.fixture(scope="module")
def finger() -> Finger:
    return read_finger(INDEX)


@pytest.fixture(scope="module")
def sound() -> Recording:
    """20 s of the simulated index finger, 4 joints and 8 tendons, joint angles measured."""
    return part_of(read_recording(FREE), slice(0, 500 * SECONDS))


def part_of(recording: Recording, rows: slice | Numbers) -> Recording:
    groups = {name: values[rows] for name, values in recording.groups.items()}
    return dataclasses.replace(recording, time=recording.time[rows], groups=groups)


def with_group(recording: Recording, name: str, values: Numbers) -> Recording:
    return dataclasses.replace(recording, groups={**recording.groups, name: values})


def scaled(recording: Recording, name: str, factors: Numbers | float) -> Recording:
    return with_group(recording, name, recording.groups[name] * factors)


def at(size: int, *elements: int, value: float = -1.0) -> Numbers:
    """Ones, but for some elements (from 1)."""
    factors = np.ones(size)
    factors[[k - 1 for k in elements]] = value
    return factors


def without_angles(recording: Recording) -> Recording:
    groups = {name: values for name, values in recording.groups.items() if name != "joint_position"}
    return dataclasses.replace(recording, groups=groups)


# --- sound recordings -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("description", "name"),
    repeated(
        [
            (INDEX, "index_finger_free"),
            (INDEX, "index_finger_free_x4"),
            (INDEX, "index_finger_pushes"),
            (DEMO / "two_joints.json", "two_joints_training"),
            (DEMO / "two_joints.json", "two_joints_unseen"),
        ],
        4,
    ),
)
def test_sound_recordings_have_no_findings(description: Path, name: str) -> None:
    recording = read_recording(DEMO / f"{name}.parquet")
    assert belongs(read_finger(description), [recording, without_angles(recording)]) == []


def test_rest_few_samples_and_slack_tendons_have_no_findings(finger: Finger, sound: Recording) -> None:
    """Noise alone, and too little of anything, says nothing; a slack tendon does not follow its joints."""
    rng = np.random.default_rng(3)
    groups = {name: np.tile(values[:1], (len(sound), 1)) for name, values in sound.groups.items()}
    groups["tendon_force"] = groups["tendon_force"] + 0.02 * rng.standard_normal(groups["tendon_force"].shape)
    rest = dataclasses.replace(sound, groups=groups)
    force, position = (sound.groups[name].copy() for name in ("tendon_force", "tendon_position"))
    slack = (sound.time > 4.0) & (sound.time < 7.0)
    force[slack, 0] = 0.0
    position[slack, 0] += 0.005 * np.sin(3.0 * sound.time[slack]) ** 2
    spoilt = with_group(with_group(sound, "tendon_force", force), "tendon_position", position)
    assert belongs(finger, [rest, part_of(sound, slice(0, 30)), part_of(sound, slice(0, 1)), spoilt]) == []


# --- signs, order, units ----------------------------------------------------------------------------------------------

Spoil = Callable[[Recording], Recording]


def exchanged(name: str, order: list[int]) -> Spoil:
    return lambda recording: with_group(recording, name, recording.groups[name][:, order])


SPOILT: dict[str, tuple[Spoil, dict[str, dict[str, float | str]]]] = {
    "force sign": (
        lambda recording: scaled(recording, "tendon_force", at(8, 2)),
        {"tendon_force[2]": {"sign": -1.0}},
    ),
    "position signs": (
        lambda recording: scaled(recording, "tendon_position", at(8, 3, 6)),
        {"tendon_position[3]": {"sign": -1.0}, "tendon_position[6]": {"sign": -1.0}},
    ),
    "angle sign": (
        lambda recording: scaled(recording, "joint_position", at(4, 4)),
        {"joint_position[4]": {"sign": -1.0}},
    ),
    "forces exchanged": (
        exchanged("tendon_force", [0, 2, 1, 3, 4, 5, 6, 7]),
        {"tendon_force[2]": {"exchange": "tendon_force[3]"}, "tendon_force[3]": {"exchange": "tendon_force[2]"}},
    ),
    "positions in mm": (
        lambda recording: scaled(recording, "tendon_position", 1e3),
        {f"tendon_position[{i}]": {"scale": 1e-3} for i in range(1, 9)},
    ),
    "forces in mN": (
        lambda recording: scaled(recording, "tendon_force", 1e3),
        {f"tendon_force[{i}]": {"scale": 1e-3} for i in range(1, 9)},
    ),
    "one force in kgf": (
        lambda recording: scaled(recording, "tendon_force", at(8, 5, value=1 / 9.80665)),
        {"tendon_force[5]": {"scale": 9.80665}},
    ),
    "angles in degrees": (
        lambda recording: scaled(recording, "joint_position", 180 / np.pi),
        {f"joint_position[{j}]": {"scale": np.pi / 180} for j in range(1, 5)},
    ),
    "time in ms": (
        lambda recording: dataclasses.replace(recording, time=recording.time * 1e3),
        {"time": {"scale": 1e-3}},
    ),
}


@pytest.mark.parametrize("name", SPOILT)
def test_what_to_write_into_the_map(finger: Finger, sound: Recording, name: str) -> None:
    spoil, expected = SPOILT[name]
    findings = belongs(finger, [spoil(sound)])
    entries = {column: dict(entry) for finding in findings for column, entry in finding.entries.items()}
    assert entries == expected
    assert {finding.severity for finding in findings} == {"error"}
    with pytest.raises(InputError) as refused:
        refuse_errors(findings)
    assert "\n" not in str(refused.value) and str(sound.path) in str(refused.value)


def test_units_without_any_redundancy() -> None:
    """One tendon, one joint, no measured angle: nothing to compare with, but no joint turns by 500 rad."""
    finger = read_finger(ROOT / "evidence" / "machine_data" / "davinci" / "two_laws.json")
    time = np.arange(5000) / 500
    angle = 0.5 * np.sin(time)
    force = 20.0 * np.tanh(5.0 * np.cos(time)) + 0.02 * np.random.default_rng(1).standard_normal(len(time))
    groups = {"tendon_force": force[:, None], "tendon_position": (0.005 * angle + force / 4e6)[:, None]}
    recording = Recording(Path("jaw.csv"), time, groups)
    assert belongs(finger, [recording]) == []
    [finding] = belongs(finger, [scaled(recording, "tendon_position", 1e3)])
    assert finding.entries == {"tendon_position[1]": {"scale": 1e-3}}
    [finding] = belongs(finger, [scaled(recording, "tendon_force", -1.0)])
    assert finding.kind == "sign" and "against the pull" in finding.line()


def test_velocities(finger: Finger, sound: Recording) -> None:
    velocity = np.gradient(sound.groups["joint_position"], sound.time, axis=0)
    assert belongs(finger, [with_group(sound, "joint_velocity", velocity)]) == []
    spoilt = with_group(sound, "joint_velocity", velocity * at(4, 2, value=-180 / np.pi))
    entries = [finding.entries for finding in belongs(finger, [spoilt])]
    assert entries == [
        {"joint_velocity[2]": {"sign": -1.0}},
        {"joint_velocity[2]": {"scale": np.pi / 180}},
    ]


def test_a_recording_of_another_finger(sound: Recording) -> None:
    [finding, *others] = belongs(read_finger(DEMO / "two_joints.json"), [sound])
    assert finding.severity == "error" and finding.kind == "columns"
    assert "8 columns tendon_force[...], expected 4" in finding.line()
    assert {other.kind for other in others} == {"columns"}


def test_arms_of_another_finger(finger: Finger, sound: Recording) -> None:
    """What no map of columns mends is said without a guess."""
    mixed = sound.groups["tendon_position"] @ np.random.default_rng(1).standard_normal((8, 8))
    findings = belongs(finger, [with_group(sound, "tendon_position", mixed)])
    assert [finding.kind for finding in findings if finding.severity == "error"] == ["unfit"]
    assert all(not finding.entries for finding in findings)
    with pytest.raises(InputError, match="moment_arms or stiffness of another finger"):
        admit(finger, [with_group(sound, "tendon_position", mixed)], unfit=UNFIT_FOR_SEARCH)


def test_a_search_of_causes_may_find_a_spring_that_stiffens(finger: Finger, sound: Recording) -> None:
    """It is refused by a fit of the numbers that there are, and only warned of where the cause can be named."""
    force, stiffness = sound.groups["tendon_force"], finger.data["tendons"][0]["stiffness"]
    stretched = sound.groups["tendon_position"] + 20.0 * force**2 / force.max() / stiffness
    soft = with_group(sound, "tendon_position", stretched)
    assert [finding.severity for finding in belongs(finger, [soft]) if finding.kind == "unfit"] == ["error"]
    warnings = admit(finger, [soft], unfit=UNFIT_FOR_SEARCH)
    assert any("38 % of the variance unexplained" in warning for warning in warnings)


# --- clock and sensors ------------------------------------------------------------------------------------------------


def test_clock(finger: Finger, sound: Recording) -> None:
    rng = np.random.default_rng(1)
    lost = part_of(sound, rng.random(len(sound)) > 0.02)
    assert [finding.kind for finding in belongs(finger, [lost])] == ["lost"]
    gap = part_of(sound, (sound.time < 8.0) | (sound.time > 9.5))
    assert [finding.kind for finding in belongs(finger, [gap])] == ["gaps"]
    uneven = dataclasses.replace(sound, time=sound.time + rng.uniform(-4e-4, 4e-4, len(sound)))
    assert [finding.kind for finding in belongs(finger, [uneven])] == ["jitter"]


def clipped(values: Numbers) -> None:
    values[:, 1] = np.minimum(values[:, 1], np.quantile(values[:, 1], 0.97))


def coarse(values: Numbers) -> None:
    step = np.ptp(values[:, 1]) / 20
    values[:, 1] = np.round(values[:, 1] / step) * step


def pushing(values: Numbers) -> None:
    values[:, 1] -= values[:, 1].mean()


def held(values: Numbers) -> None:
    values[1500:4500, 1] = values[1500, 1]


def held_to_the_end(values: Numbers) -> None:
    values[1500:, 1] = values[1500, 1]


@pytest.mark.parametrize(
    ("spoil", "group", "kind", "severity"),
    [
        (clipped, "tendon_force", "clipped", "warning"),
        (coarse, "tendon_position", "coarse", "warning"),
        (pushing, "tendon_force", "pushing", "error"),
        *((held, group, "held", "warning") for group in ("tendon_force", "tendon_position", "joint_position")),
        *((held_to_the_end, group, "held", "error") for group in ("tendon_force", "tendon_position", "joint_position")),
    ],
)
def test_a_sensor_that_fails_is_named(
    finger: Finger, sound: Recording, spoil: Callable[[Numbers], None], group: str, kind: str, severity: str
) -> None:
    values = sound.groups[group].copy()
    spoil(values)
    findings = belongs(finger, [with_group(sound, group, values)])
    assert (severity, kind, (f"{group}[2]",)) in [(each.severity, each.kind, each.columns) for each in findings]
    assert len(findings) == 1 or ({each.severity for each in findings} == {"warning"} and kind == "coarse")
    assert kind != "pushing" or "zeroed under load" in findings[0].line()


# --- the command ------------------------------------------------------------------------------------------------------


def written(recording: Recording, file: Path) -> Path:
    columns = {
        f"{name}[{k + 1}]": column for name, values in recording.groups.items() for k, column in enumerate(values.T)
    }
    write_table(file, {"time": recording.time, **columns})
    return file


def test_check_says_what_belongs_and_what_to_write(call: Call, tmp_path: Path, sound: Recording) -> None:
    """Warnings alone are sound."""
    spoilt = written(scaled(sound, "tendon_force", at(8, 2)), tmp_path / "spoilt.parquet")
    answer = call("check", INDEX, spoilt, FREE)
    assert answer.status == 1
    assert f"error: {spoilt}: tendon_force[2]: " in answer.out and 'at "tendon_force[2]": "sign": -1' in answer.out
    assert f"{FREE}: belongs to this finger: 30000 samples, 60 s; no problem found" in answer.out
    assert answer.err.count("\n") == 1 and "1 of 2 recordings" in answer.err
    gap = written(part_of(sound, (sound.time < 8.0) | (sound.time > 9.5)), tmp_path / "gap.parquet")
    answer = call("check", INDEX, gap)
    assert answer.status == 0 and f"warning: {gap}: time: 1 gap, " in answer.out
    answer = call("check", INDEX, "absent.csv")
    assert answer.status == 2 and "absent.csv" in answer.err
    answer = call("check", EXAMPLES / "rigs" / "index_finger.json", FREE)
    assert answer.status == 2 and "a rig" in answer.err


@pytest.mark.parametrize("name", repeated(SPOILT, 3, 6))
def test_the_advice_can_be_written_into_a_map(call: Call, tmp_path: Path, sound: Recording, name: str) -> None:
    """The words name keys and values of a map; with these, the recording is converted, and belongs."""
    spoilt = written(SPOILT[name][0](sound), tmp_path / "spoilt.parquet")
    answer = call("check", INDEX, spoilt, "--json")
    assert answer.status == 1
    findings = json.loads(answer.out)["recordings"][0]["findings"]
    names = ["time", *(f"{group}[{k + 1}]" for group, all_ in sound.groups.items() for k in range(all_.shape[1]))]
    columns = {each: {"column": each, "unit": SI[each.split("[")[0]]} for each in names}
    for finding in findings:
        for column, keys in finding["map"].items():
            columns[column] |= keys
            said = [f'"{key}": {json.dumps(value)}' for key, value in keys.items() if key != "column"]
            assert all(words in finding["write"] for words in said or [f'"{column}"']), finding["write"]
    (tmp_path / "map.json").write_text(json.dumps({"format": "tendonfmu-map-1", "columns": columns}))
    answer = call("convert", "table", spoilt, "--map", "map.json", "-o", "mended.parquet")
    assert answer.status == 0, answer.err
    answer = call("check", INDEX, "mended.parquet")
    assert answer.status == 0 and "belongs to this finger" in answer.out


# --- the commands that fit --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "arguments",
    [
        ("fit", FREE, "?", "-o", "f.json"),
        pytest.param(("diagnose", FREE, "?", "-o", "out"), marks=pytest.mark.long),
        pytest.param(("tune", FREE, "?", "-o", "t.json"), marks=pytest.mark.long),
        pytest.param(("calibrate", FREE, "?", "-o", "out"), marks=pytest.mark.long),
        pytest.param(("fit", FREE, "--compare", "?", "-o", "f.json"), marks=pytest.mark.long),
        pytest.param(("diagnose", FREE, "--test", "?", "-o", "out"), marks=pytest.mark.long),
    ],
    ids=lambda arguments: " ".join(map(str, arguments[::2])),
)
def test_a_stranger_is_refused_by_name_before_any_fit(
    call: Call, tmp_path: Path, sound: Recording, arguments: tuple[str | Path, ...]
) -> None:
    """Beside a recording that belongs, and where it only judges. "?": the stranger."""
    file = written(exchanged("tendon_position", [0, 2, 1, 3, 4, 5, 6, 7])(sound), tmp_path / "stranger.parquet")
    command, *rest = (file if argument == "?" else argument for argument in arguments)
    answer = call(command, INDEX, *rest)
    assert answer.status == 2 and len(answer.err.splitlines()) == 1, answer
    assert f"{file}: tendon_position[2]" in answer.err
    assert 'the keys "tendon_position[2]" and "tendon_position[3]"' in answer.err
    assert not (tmp_path / arguments[-1]).exists()


def test_a_fit_says_itself_what_becomes_of_gaps_and_stuck_sensors(finger: Finger, sound: Recording) -> None:
    """Each of them once: `belongs` sees them, `admit` leaves them to `prepare`."""
    gap = part_of(sound, (sound.time < 8.0) | (sound.time > 9.5))
    position = sound.groups["joint_position"].copy()
    position[2000:4000, 1] = position[2000, 1]
    stuck = with_group(sound, "joint_position", position)
    assert [finding.kind for finding in belongs(finger, [gap, stuck])] == ["gaps", "held"]
    assert admit(finger, [gap, stuck]) == []
    sentences = [sentence for each in (gap, stuck) for sentence in prepare(finger, each, 1, Held()).warnings]
    assert len(sentences) == 2 and "a gap or a jump of the clock" in sentences[0]
    assert "joint_position[2] stands still" in sentences[1]
