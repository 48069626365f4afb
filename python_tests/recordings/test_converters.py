"""Third-party recordings, da Vinci tools and the EMPS carriage: units, signs, filters, and what is refused.

The measured files of EMPS need ../shared/data or $TENDONFMU_DATA.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import io

from command import Call
from optional_parts import DATA, needs
from tendonfmu.errors import InputError
from tendonfmu.files.tables import write_table
from tendonfmu.recordings.converters.machines import EDGE, MASS, convert_file
from tendonfmu.recordings.converters.machines import convert_davinci as convert_tool
from tendonfmu.recordings.converters.machines import convert_emps as convert
from tendonfmu.recordings.recording import read_recording


def refused(call: Any, file: Path, words: list[str]) -> None:
    """In one line that begins with the file."""
    with pytest.raises(InputError) as error:
        call()
    line = str(error.value)
    assert line.startswith(f"{file}: ") and "\n" not in line
    assert all(word in line for word in words), line


# --- da Vinci ---------------------------------------------------------------------------------------------------------

RADIUS = 0.01
HEADER = "%Used left spindle of tool number 5\n%idxPulse_0=0\n"
# time, spindle, torque, current, jaw, jaw torque, level, command, motor, target
ROWS = [
    "0.001,-2048,10000,0.1,1000,-5000,0.1,-0.06,17946,0.03",
    "0.002,-2049,-10000,0.1,1001,5000,0.1,-0.06,17947,0.04",
]
GOOD = HEADER + "\n".join(ROWS) + "\n"


def tool(folder: Path, text: str | bytes = GOOD) -> Path:
    file = folder / "00.TXT"
    file.write_bytes(text if isinstance(text, bytes) else text.encode())
    return file


def test_units_and_signs_of_a_tool(tmp_path: Path) -> None:
    """A quarter of a turn is 2048 of 8192 counts, 1000 of 4000; a count of torque is 0.000039811 N.m."""
    for radius in (RADIUS, 0.02):
        found = convert_tool(tool(tmp_path), radius)
        assert found["time"].tolist() == [0.001, 0.002]
        assert found["tendon_position[1]"][0] == pytest.approx(radius * math.pi / 2, rel=1e-15)
        assert found["tendon_force[1]"].tolist() == pytest.approx([0.39811 / radius, -0.39811 / radius], rel=1e-12)
        assert found["joint_position[1]"][0] == pytest.approx(math.pi / 2, rel=1e-15)
        assert found["external_torque[1]"].tolist() == pytest.approx([0.199055, -0.199055], rel=1e-12)
        assert len(found) == 5
    write_table(tmp_path / "rec.csv", found)
    read_recording(tmp_path / "rec.csv").require(1, 1, ("tendon_force", "tendon_position", "joint_position"))


def test_a_pretension_makes_the_closing_cable_a_tendon_that_pulls(tmp_path: Path) -> None:
    file = tool(tmp_path)
    loop, cable = convert_tool(file, RADIUS), convert_tool(file, RADIUS, pretension=40.0)
    assert cable["tendon_force[1]"] == pytest.approx(loop["tendon_force[1]"] + 40.0, rel=1e-12)
    friction = [found["tendon_force[1]"] * RADIUS - found["external_torque[1]"] for found in (loop, cable)]
    assert friction[1] == pytest.approx(friction[0], rel=1e-12)
    with pytest.raises(InputError, match=r"slack at 0\.002 s; expected more than 39\.81 N"):
        convert_tool(file, RADIUS, pretension=39.0)


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
def test_malformed_tools_are_refused_by_line_and_column(tmp_path: Path, text: str | bytes, words: list[str]) -> None:
    file = tool(tmp_path, text)
    refused(lambda: convert_tool(file, RADIUS), file, words)


def test_no_file_is_refused_by_its_name(tmp_path: Path) -> None:
    for path in (tmp_path / "absent.TXT", tmp_path):
        with pytest.raises(InputError, match=path.name):
            convert_tool(path, RADIUS)


# --- EMPS -------------------------------------------------------------------------------------------------------------

RATE = 1000.0
GAIN = 35.15065
# published (Janot, Gautier, Brunot 2019): N/(m/s), N, N
VISCOUS, COULOMB, OFFSET = 203.5034, 20.3935, -3.1648
MEASURED = [DATA / "emps" / name for name in ("DATA_EMPS.mat", "DATA_EMPS_PULSES.mat")]


def carriage(samples: int = 4001) -> dict[str, Any]:
    """A carriage of the published mass that swings with 0.5 Hz, as a MATLAB file has it."""
    time, pulse = np.arange(samples) / RATE, 2 * math.pi * 0.5
    position, velocity = 0.03 * np.sin(pulse * time), 0.03 * pulse * np.cos(pulse * time)
    force = -MASS * pulse**2 * position + VISCOUS * velocity + COULOMB * np.sign(velocity) + OFFSET
    return {"t": time[:, None], "qm": position[:, None], "vir": (force / GAIN)[:, None], "gtau": np.array([[GAIN]])}


def written(folder: Path, content: dict[str, Any]) -> Path:
    io.savemat(folder / "carriage.mat", content)
    return folder / "carriage.mat"


def test_what_is_left_of_the_force_is_the_friction(tmp_path: Path) -> None:
    """T_eff = τ − external_torque (eq. 9): friction opposes the motion, the inertial force is known load."""
    found = convert(written(tmp_path, carriage()), decimation=1)
    velocity = found["joint_velocity[1]"]
    friction = found["tendon_force[1]"] - found["external_torque[1]"]
    expected = VISCOUS * velocity + COULOMB * np.sign(velocity) + OFFSET
    away = np.abs(velocity) > 0.01  # further from the jump at standstill than the filter smears it
    inside = away & (found["time"] > 0.1) & (found["time"] < 3.9)  # the ends of the file are a jump of the motion too
    assert inside.sum() > 3000
    assert friction[inside] == pytest.approx(expected[inside], abs=0.02)


@pytest.mark.parametrize("decimation", [1, 10, 40])
def test_every_sample_kept_is_a_mean_of_its_neighbours(tmp_path: Path, decimation: int) -> None:
    """Times are the kept samples' own, equally spaced; a straight line of a force stays one up to the last sample."""
    content = carriage()
    content["vir"] = content["t"].copy()
    found = convert(written(tmp_path, content), decimation=decimation)
    time = found["time"]
    assert np.diff(time) == pytest.approx(decimation / RATE, rel=1e-9)
    inside = (time > 0.1) & (time < 3.9)
    assert found["tendon_force[1]"][inside] == pytest.approx(GAIN * time[inside], abs=1e-6)
    ends = (EDGE + (decimation if decimation > 1 else 0)) / RATE
    assert time[0] == pytest.approx(ends, abs=1e-12)
    assert 4.0 - ends - decimation / RATE < time[-1] <= 4.0 - ends + 1e-12
    pulse = 2 * math.pi * 0.5
    flat = 1.5e-3 * (0.4 if decimation < 40 else 2.0)  # what a mean over the neighbours flattens, of a swing of 0.5 Hz
    for name, size, wave in (("tendon_position[1]", 0.03, np.sin), ("joint_velocity[1]", 0.03 * pulse, np.cos)):
        assert found[name][inside] == pytest.approx(size * wave(pulse * time[inside]), abs=size * flat)
    assert found["joint_position[1]"].tolist() == found["tendon_position[1]"].tolist()


def test_smoothing_makes_no_reversal_that_was_not_there(tmp_path: Path) -> None:
    """A carriage that slows down to a touch of standstill and goes on the same way; a steeper filter rings there."""
    content = carriage()
    velocity = np.minimum(0.1, 0.8 * np.abs(content["t"][:, 0] - 2.0)) + 1e-4
    content["qm"] = np.cumsum(velocity)[:, None] / RATE
    assert convert(written(tmp_path, content))["joint_velocity[1]"][5:-5].min() > 0.0


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"qm": None}, ["no variable qm", "t, qm, vir and gtau"]),
        ({"gtau": np.array([1.0, 2.0])}, ["gtau: 2 numbers", "N/V"]),
        ({"vir": np.zeros(7)}, ["vir: 7 samples", "4001"]),
        ({"vir": np.zeros((4001, 2))}, ["vir", "(4001, 2)", "row or column"]),
        ({"vir": np.array(["volts"])}, ["vir", "numbers"]),
        ({"qm": np.where(np.arange(4001) == 9, np.nan, 0.1)}, ["qm, sample 10: nan", "finite"]),
        ({"t": (np.arange(4001) + 5 * (np.arange(4001) >= 100)) / RATE}, ["t, sample 101: 0.006 s", "equal steps"]),
        ({"t": np.arange(4001) / 150.0}, ["150 samples per second", "more than 200"]),
        (carriage(999), ["999 samples; expected at least 1000, 100 times --decimation"]),
    ],
)
def test_wrong_variables_are_named(tmp_path: Path, change: dict[str, Any], words: list[str]) -> None:
    file = written(tmp_path, {name: value for name, value in (carriage() | change).items() if value is not None})
    refused(lambda: convert(file), file, words)


@pytest.mark.parametrize("content", [b"", b"time,force\n0,1\n" * 100, b"MATLAB 5.0 MAT-file" + bytes(300), None, ...])
def test_files_that_cannot_be_read(tmp_path: Path, content: Any) -> None:
    """None: there is no such file; ...: a file that is cut off."""
    file = tmp_path / "carriage.mat"
    if content is ...:
        file.write_bytes(written(tmp_path, carriage()).read_bytes()[:40_000])
    elif content is not None:
        file.write_bytes(content)
    refused(lambda: convert(file), file, [])


def test_the_command_takes_the_options_of_its_format(call: Call, tmp_path: Path) -> None:
    """The mass scales the known load alone."""
    file = written(tmp_path, carriage())
    answer = call("convert", "emps", file, "-o", "rec.parquet", "--mass", "50", "--decimation", "20")
    assert answer.status == 0, answer.err
    found, expected = read_recording(tmp_path / "rec.parquet").groups, convert(file, mass=100.0, decimation=20)
    assert (2 * found["external_torque"][:, 0]).tolist() == expected["external_torque[1]"].tolist()
    assert found["tendon_force"][:, 0].tolist() == expected["tendon_force[1]"].tolist()
    for arguments, words in (
        (["emps", "carriage.mat", "--radius", "0.01"], ["convert emps", "--radius", "--mass or --decimation"]),
        (["davinci", "00.TXT", "--mass", "95"], ["convert davinci", "--mass", "--radius"]),
        (["emps", "carriage.mat", "--mass", "-1"], ["--mass", "greater than or equal to 0"]),
        (["emps", "carriage.mat", "--decimation", "0"], ["--decimation", "1"]),
    ):
        answer = call("convert", *arguments, "-o", "rec.csv")
        assert answer.status == 2 and len(answer.err.splitlines()) == 1
        assert all(word in answer.err for word in words), answer.err


@needs("emps data")
@pytest.mark.parametrize("file", MEASURED, ids=lambda file: file.stem)
def test_the_published_numbers_explain_the_force(file: Path) -> None:
    """Friction and offset as published leave about 4 % of the force, 6 % with the pulses: sign, gain and units.

    It moves from the first sample on, so that the constant bias is the offset.
    """
    found = convert_file("emps", file)
    velocity, force = found["joint_velocity[1]"], found["tendon_force[1]"]
    model = found["external_torque[1]"] + VISCOUS * velocity + COULOMB * np.sign(velocity) + OFFSET
    error = 100 * np.linalg.norm(force - model) / np.linalg.norm(force)
    assert error < (5.99 if "PULSES" in file.stem else 4.1)
    assert len(force) == 2481 and velocity[0] > 0.02 and np.abs(velocity).min() > 0.0
