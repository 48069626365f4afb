"""Third-party recordings: units and signs of the da Vinci converter, and what it refuses."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from optional_parts import DATA, needs
from tendonfmu.errors import InputError
from tendonfmu.files.tables import write_table
from tendonfmu.recordings.converters import CONVERTERS, converter
from tendonfmu.recordings.converters.davinci import convert
from tendonfmu.recordings.recording import read_recording

TOOLS = DATA / "davinci_tool"
RECORDINGS = sorted(TOOLS.glob("Tool_4_Maryland_L_4/*.TXT"))
RADIUS = 0.01

HEADER = "%Used left spindle of tool number 5\n%idxPulse_0=0\n"
# time, spindle, torque, current, jaw, jaw torque, level, command, motor, target
ROWS = [
    "0.001,-2048,10000,0.1,1000,-5000,0.1,-0.06,17946,0.03",
    "0.002,-2049,-10000,0.1,1001,5000,0.1,-0.06,17947,0.04",
]
GOOD = HEADER + "\n".join(ROWS) + "\n"

measured = needs("davinci data")


def written(folder: Path, text: str | bytes) -> Path:
    file = folder / "00.TXT"
    file.write_bytes(text if isinstance(text, bytes) else text.encode())
    return file


def test_units_and_signs(tmp_path: Path) -> None:
    """A quarter of a turn is 2048 of 8192 counts, 1000 of 4000; a count of torque is 0.000039811 N.m."""
    found = convert(written(tmp_path, GOOD), RADIUS)
    assert found["time"].tolist() == [0.001, 0.002]
    assert found["tendon_position[1]"][0] == pytest.approx(RADIUS * math.pi / 2, rel=1e-15)
    assert found["tendon_force[1]"].tolist() == pytest.approx([0.39811 / RADIUS, -0.39811 / RADIUS], rel=1e-12)
    assert found["joint_position[1]"][0] == pytest.approx(math.pi / 2, rel=1e-15)
    assert found["external_torque[1]"].tolist() == pytest.approx([0.199055, -0.199055], rel=1e-12)
    assert set(found) == {
        "time",
        "tendon_force[1]",
        "tendon_position[1]",
        "joint_position[1]",
        "external_torque[1]",
    }


def test_the_radius_leaves_torques_and_angles_alone(tmp_path: Path) -> None:
    file = written(tmp_path, GOOD)
    small, large = convert(file, 0.005), convert(file, 0.02)
    for radius, found in ((0.005, small), (0.02, large)):
        assert found["tendon_force[1]"] * radius == pytest.approx([0.39811, -0.39811], rel=1e-12)
    assert small["tendon_position[1]"] / 0.005 == pytest.approx(large["tendon_position[1]"] / 0.02, rel=1e-15)


def test_a_pretension_makes_the_closing_cable_a_tendon_that_pulls(tmp_path: Path) -> None:
    file = written(tmp_path, GOOD)
    loop, cable = convert(file, RADIUS), convert(file, RADIUS, pretension=40.0)
    assert cable["tendon_force[1]"] == pytest.approx(loop["tendon_force[1]"] + 40.0, rel=1e-12)
    friction = [found["tendon_force[1]"] * RADIUS - found["external_torque[1]"] for found in (loop, cable)]
    assert friction[1] == pytest.approx(friction[0], rel=1e-12)
    with pytest.raises(InputError, match=r"slack at 0\.002 s; expected more than 39\.81 N"):
        convert(file, RADIUS, pretension=39.0)


def test_a_converted_file_is_a_recording(tmp_path: Path) -> None:
    write_table(tmp_path / "rec.csv", convert(written(tmp_path, GOOD), RADIUS))
    recording = read_recording(tmp_path / "rec.csv")
    groups = ("tendon_force", "tendon_position", "joint_position", "external_torque")
    recording.require(1, 1, groups)
    assert set(groups) <= recording.groups.keys()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", ["no da Vinci recording"]),
        (HEADER, ["no da Vinci recording"]),
        ("time,force\n0,1\n", ["no da Vinci recording"]),
        (GOOD.replace("10000", "ten", 1), ["line 3", "column 3", "'ten'", "number"]),
        (GOOD.replace("-2049", "nan"), ["line 4", "column 2", "finite"]),
        (GOOD.replace("1001,5000", "1001"), ["line 4", "9 columns", "10"]),
        (GOOD.replace("0.002,-2049", "0.002,-2049,7"), ["line 4", "11 columns", "10"]),
        (GOOD.replace("0.002,", "0.001,"), ["line 4", "column 1", "time"]),
        (GOOD[: -len(ROWS[1]) + 8], ["line 4", "1 row before it is good"]),
        (b"\xff\xfe\x00%\n", ["da Vinci"]),
    ],
)
def test_malformed_files_are_refused_by_line_and_column(tmp_path: Path, text: str | bytes, words: list[str]) -> None:
    file = written(tmp_path, text)
    with pytest.raises(InputError) as refused:
        convert(file, RADIUS)
    line = str(refused.value)
    assert line.startswith(f"{file}: ") and "\n" not in line
    assert all(word in line for word in words), line


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    for path in (tmp_path / "absent.TXT", tmp_path):
        with pytest.raises(InputError, match=path.name):
            convert(path, RADIUS)


def test_every_converter_is_there() -> None:
    for name in CONVERTERS:
        assert callable(converter(name))
    with pytest.raises(InputError, match="davinci"):
        converter("sputnik")


@measured
@pytest.mark.parametrize("file", RECORDINGS, ids=lambda file: file.stem)
def test_measured_friction_opposes_the_motion(file: Path) -> None:
    """tau - external_torque is positive while the spindle closes, negative while it opens: half a loop is friction.

    Between 40 and 95 mN.m, as the data's own notes give it; the jaw turns 0.90 to 0.92 of the spindle.
    """
    found = convert(file, RADIUS)
    settled = found["time"] > 2.5
    friction = (found["tendon_force[1]"] * RADIUS - found["external_torque[1]"])[settled]
    spindle, jaw = found["tendon_position[1]"][settled] / RADIUS, found["joint_position[1]"][settled]
    velocity = np.convolve(np.gradient(spindle, found["time"][settled]), np.ones(51) / 51, mode="same")
    fast = np.abs(velocity) > 0.5 * np.abs(velocity).max()
    half_loop = 0.5 * (friction[fast & (velocity > 0)].mean() - friction[fast & (velocity < 0)].mean())
    assert 0.040 < half_loop < 0.095
    slope = np.polyfit(spindle, jaw, 1)[0]
    assert 0.8 < slope < 1.0
    assert found["external_torque[1]"][settled].mean() > 0.0
