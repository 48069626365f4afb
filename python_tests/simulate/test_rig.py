"""Rig files: what they expand to, what is refused and how, and `tendonfmu check`."""

from __future__ import annotations

import hashlib
import json
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from plant_rigs import needs_plant
from random_rigs import random_rig
from rig_cases import EXAMPLES, FINGER, INDEX_RIGS, RIGS, changed, index_rig, with_everything, written
from tendonfmu.cli import main
from tendonfmu.errors import InputError
from tendonfmu.simulate import plant
from tendonfmu.simulate.rig import Rig, is_rig, read_rig
from tendonfmu.simulate.simulation import plant_of

# --- reading ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", INDEX_RIGS)
def test_index_rigs_expand(name: str) -> None:
    rig = read_rig(RIGS / name)
    expanded = json.loads(rig.json())
    assert (rig.joints, rig.tendons, rig.version, rig.rate) == (4, 8, 1, 500.0)
    assert expanded["finger"] == FINGER
    assert set(expanded["motion"]) == {"joints", "pretension"} and len(expanded["motion"]["joints"]) == 4
    assert "base" not in expanded
    assert len(rig.times()) == 30000 and rig.times()[-1] == 29999 / 500


def test_the_numbers_of_version_1_are_frozen() -> None:
    """Later figures are compared with these: a change is a version 2, not another digest here."""
    digests = [
        hashlib.sha256(json.dumps(json.loads((RIGS / name).read_text()), sort_keys=True).encode()).hexdigest()[:16]
        for name in INDEX_RIGS
    ]
    assert digests == ["c5684190258469be", "310606ed8d953861", "e7bbe71ce308b482"]
    # and the laws, arms and springs of the finger they refer to; its thresholds and bias are the model's
    finger = json.loads((RIGS / "../fingers/index_finger.json").read_text())
    physics = json.dumps({key: finger[key] for key in ("joints", "tendons")}, sort_keys=True)
    assert hashlib.sha256(physics.encode()).hexdigest()[:16] == "51d5ec52adb92818"


def test_recording_times_stay_below_the_duration(tmp_path: Path) -> None:
    for duration, rate, samples in ((0.3, 1000, 300), (0.1, 30, 3), (0.11, 30, 4), (1e-4, 100, 1)):
        data = index_rig()
        data["recording"] = {"duration": duration}
        data["sensors"]["rate"] = rate
        times = read_rig(written(tmp_path, data)).times()
        assert len(times) == samples
        assert np.array_equal(times, np.arange(samples) / rate)


def test_a_rig_without_a_recording_cannot_be_recorded(tmp_path: Path) -> None:
    data = index_rig()
    del data["recording"]
    rig = read_rig(written(tmp_path, data))
    with pytest.raises(InputError, match=r"rig\.json: recording: missing; expected an object with duration, s"):
        rig.times()


def test_the_format_key_decides(tmp_path: Path) -> None:
    assert is_rig(RIGS / "index_finger.json")
    assert is_rig(written(tmp_path, {"format": "tendonfmu-rig-9"}))
    assert not is_rig(EXAMPLES / "fingers" / "index_finger.json")
    assert not is_rig(written(tmp_path, "{"))
    assert not is_rig(written(tmp_path, "[1]"))
    assert not is_rig(tmp_path / "none.json")


# --- base -------------------------------------------------------------------------------------------------------------


def derived(folder: Path, **own: Any) -> Rig:
    written(folder, index_rig(), "base.json")
    return read_rig(written(folder, {"format": "tendonfmu-rig-1", "base": "base.json"} | own))


def test_a_base_gives_what_is_not_given(tmp_path: Path) -> None:
    rig = derived(tmp_path, seed=9, physics={"friction": {"stribeck_exponent": 1}, "servo": None})
    base = index_rig()
    assert rig.expanded["seed"] == 9 and rig.name == "index_finger"
    assert rig.expanded["physics"]["links"] == base["physics"]["links"]
    assert rig.expanded["physics"]["friction"] == base["physics"]["friction"] | {"stribeck_exponent": 1}
    assert "servo" not in rig.expanded["physics"]


def test_lists_are_taken_whole(tmp_path: Path) -> None:
    rig = derived(tmp_path, physics={"gravity": [0.0, 0.0, 0.0]}, recording={"columns": ["contact"]})
    assert rig.expanded["physics"]["gravity"] == [0.0, 0.0, 0.0]
    assert (rig.columns, rig.duration) == (["contact"], 60.0)


def test_another_kind_of_motion_takes_the_place_of_the_bases(tmp_path: Path) -> None:
    rig = derived(tmp_path, motion={"kind": "still", "pretension": 7.0})
    assert rig.motion.says == "still"
    rig = derived(tmp_path, motion={"pretension": 7.0})
    assert rig.motion.says.startswith("strokes") and rig.motion.pretension["value"] == [7.0]


def test_paths_are_relative_to_the_file_in_which_they_stand(tmp_path: Path) -> None:
    (tmp_path / "fingers").mkdir()
    (tmp_path / "rigs").mkdir()
    written(tmp_path / "fingers", FINGER, "finger.json")
    base = index_rig() | {"finger": "../fingers/finger.json"}
    written(tmp_path / "rigs", base, "base.json")
    rig = read_rig(written(tmp_path, {"format": "tendonfmu-rig-1", "base": "rigs/base.json"}))
    assert rig.finger.path.resolve() == (tmp_path / "fingers" / "finger.json").resolve()


def test_a_base_of_itself_is_refused(tmp_path: Path) -> None:
    written(tmp_path, {"format": "tendonfmu-rig-1", "base": "b.json"}, "a.json")
    written(tmp_path, {"format": "tendonfmu-rig-1", "base": "./a.json"}, "b.json")
    with pytest.raises(
        InputError, match=r"b\.json: base: .*a\.json -> .*b\.json -> .*a\.json; expected no rig that is"
    ):
        read_rig(tmp_path / "a.json")


def test_errors_of_a_base_name_its_file(tmp_path: Path) -> None:
    written(tmp_path, {"format": "tendonfmu-rig-1", "colour": 1}, "base.json")
    with pytest.raises(InputError, match=r"base\.json: colour = 1: unknown key; expected one of format, base"):
        read_rig(written(tmp_path, {"format": "tendonfmu-rig-1", "base": "base.json"}))
    with pytest.raises(InputError, match=r"other\.json: No such file or directory; expected a rig"):
        read_rig(written(tmp_path, {"format": "tendonfmu-rig-1", "base": "other.json"}))


# --- refusals of the reader -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("", r"line 1, column 1: .*; expected a rig \(JSON\)"),
        ('{"format": }', r"line 1, column 12: "),
        ('{"seed": 1, "seed": 2}', r'key "seed" occurs twice in one object; expected once'),
        ('{"seed": NaN}', r"NaN: not a number in JSON"),
        ('{"seed": -Infinity}', r"-Infinity: not a number in JSON"),
        ('{"seed": 1e999}', r"1e999: beyond the range of a double"),
        ("[" * 5000, r"nested too deeply|column"),
        ("[]", r"the document = \[\]: expected an object"),
        ('{"format": "tendonfmu-rig-2"}', r'format = "tendonfmu-rig-2": expected "tendonfmu-rig-1"'),
        ("{}", r"format: missing; expected"),
    ],
)
def test_bad_json_is_refused(tmp_path: Path, text: str, line: str) -> None:
    with pytest.raises(InputError, match=r"rig\.json: .*" + line):
        read_rig(written(tmp_path, text))


@pytest.mark.parametrize(
    ("path", "value", "line"),
    [
        (("name",), "", r'name = "": expected the rig\'s name'),
        (("version",), 0, r"version = 0: expected an integer from 1"),
        (("seed",), 2**53 + 1, r"seed = 9007199254740993: expected an integer from 0 to 9007199254740992"),
        (("colour",), "red", r'colour = "red": unknown key; expected one of format, base, name'),
        (("finger",), 3, r"finger = 3: expected a finger description, or the path of one"),
        (("finger",), "none.json", r"none\.json: No such file or directory; expected a finger description"),
        (("finger",), None, r"finger: missing"),
        (("physics", "links"), [], r"physics\.links = \[\]: expected a list of 4, one link per joint of the finger"),
        (("physics", "links", 1, "axis"), "y", r'physics\.links\[2\]\.axis = "y": expected a list of 3, x, y and z'),
        (("physics", "links", 2, "limits", "upper"), -1.0, r"links\[3\]\.limits\.upper = -1\.0: expected"),
        (("physics", "tip"), [0.0, 0.0, True], r"physics\.tip\[3\] = true: expected a number in m"),
        (("sensors", "rate"), 0, r"sensors\.rate = 0: expected a number in Hz, at least 1 and at most 100000"),
        (("motion",), None, r"motion: missing; expected an object with the key kind"),
        (("motion", "position", 1), 1.5, r"motion\.position\[2\] = 1\.5: expected an angle within the joint's range"),
        (("pushes",), "tip", r'pushes = "tip": expected a list of pushes, or an object with count'),
        (("recording", "duration"), 0.0, r"recording\.duration = 0\.0: expected a number in s, above 0"),
        (("recording", "duration"), 1e6, r"recording\.duration = 1000000\.0: expected at most 50000000"),
        (("recording", "columns"), ["torque"], r'recording\.columns\[1\] = "torque": expected "joint_position" or'),
        (("recording", "columns"), ["contact"] * 2, r'recording\.columns\[1\] = "contact": expected each column once'),
    ],
)
def test_bad_rigs_are_refused_by_key(tmp_path: Path, path: tuple[Any, ...], value: Any, line: str) -> None:
    with pytest.raises(InputError, match=line) as refused:
        read_rig(written(tmp_path, changed(index_rig(), path, value)))
    assert "\n" not in str(refused.value)


# --- refusals of the plant --------------------------------------------------------------------------------------------


def without_antagonists() -> dict[str, Any]:
    """All tendons pull the last joint the same way: nothing holds it against pretension."""
    data = index_rig()
    data["finger"]["tendons"][7]["moment_arms"][3] = 0.0045
    return data


@needs_plant
@pytest.mark.parametrize(
    ("path", "value", "line"),
    [
        (("physics", "links", 1, "mass"), -0.01, r"physics\.links\[2\]\.mass = -0\.01: expected .*kg"),
        (
            ("physics", "links", 1, "inertia"),
            [1e-6, 1e-6, 1e-5],
            r"physics\.links\[2\]\.inertia = .*: expected three moments",
        ),
        (("physics", "links", 3, "mass"), 1e-12, r"physics\.links(\[4\])? = .*: expected "),
        (("physics", "friction", "presliding", "edge"), 0.0, r"physics\.friction\.presliding\.edge = 0\.0: expected"),
        (("physics", "gravity"), [0.0, -9.81], r"physics\.gravity has 2 elements: expected a list of 3 numbers"),
        (("physics", "spring"), 1.0, r"physics\.spring.*"),
        (("sensors", "tendon_force", "noise"), -1.0, r"sensors\.tendon_force\.noise = -1\.0: expected"),
        (("sensors", "joint_position", "backlash"), 0.1, r"sensors\.joint_position.*backlash"),
        (("integration", "method"), "euler", r'integration\.method = "euler": expected'),
        (("integration", "relative_tolerance"), 1.0, r"integration\.relative_tolerance = 1\.0: expected"),
        (("pushes",), [{"start": 1.0}], r"pushes\[1\]\."),
        (("finger", "tendons", 0, "stiffness"), 1e12, r"stiffness|physics\.links\[\d\]"),
    ],
)
def test_bad_physics_is_refused_by_key(tmp_path: Path, path: tuple[Any, ...], value: Any, line: str) -> None:
    data = index_rig()
    if path == ("physics", "links", 3, "mass"):  # without the inertia about its own centre, too
        data["physics"]["links"][3]["inertia"] = [1e-16] * 3
    with pytest.raises(InputError, match=r"rig\.json: .*" + line) as refused:
        plant_of(read_rig(written(tmp_path, changed(data, path, value))))
    assert "\n" not in str(refused.value)


@needs_plant
def test_a_finger_that_cannot_be_pretensioned_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"finger\.tendons\[\d\]\.moment_arms: expected .*positive null vector"):
        plant_of(read_rig(written(tmp_path, without_antagonists())))


@needs_plant
@pytest.mark.parametrize(
    "data", [index_rig(), with_everything(), *map(random_rig, range(8))], ids=lambda data: data["name"]
)
def test_the_plant_takes_good_rigs(tmp_path: Path, data: dict[str, Any]) -> None:
    found = plant_of(read_rig(written(tmp_path, data)))
    assert found.joints == len(data["finger"]["joints"]) and not found.initialised
    assert found.settings.seed == data["seed"] and found.settings.integrator == "cvode"


# --- check ------------------------------------------------------------------------------------------------------------


def run_check(path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> tuple[int, str, str]:
    monkeypatch.setattr(sys, "argv", ["tendonfmu", "check", str(path)])
    capfd.readouterr()
    with pytest.raises(SystemExit) as ended:
        main()
    out, err = capfd.readouterr()
    assert isinstance(ended.value.code, int)
    return ended.value.code, out, err


@needs_plant
def test_check_says_what_the_rig_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    status, out, err = run_check(RIGS / "index_finger_pushes.json", monkeypatch, capfd)
    assert (status, err) == (0, "")
    for part in ("index_finger_pushes, version 1", "mcp_abduction", "together 28.4 g", "14 pulleys, 22 edges", "11"):
        assert part in out
    assert "effects            gravity; joint limits; bristle damping; capstan tension loss\n" in out
    _, out, _ = run_check(written(tmp_path, with_everything()), monkeypatch, capfd)
    for effect in ("hardening covers", "progressive springs", "moment arms that vary", "wrist", "obstacle", "heat"):
        assert effect in out


@needs_plant
def test_check_refuses_with_status_1(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    bad = written(tmp_path, changed(index_rig(), ("physics", "links", 0, "mass"), -1.0))
    status, out, err = run_check(bad, monkeypatch, capfd)
    assert (status, out) == (1, "")
    assert err.startswith(f"tendonfmu: {bad}: physics.links[1].mass = -1.0: expected") and err.count("\n") == 1


def test_without_a_plant_check_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(plant, "HAS_PLANT", False)
    status, out, err = run_check(written(tmp_path, index_rig()), monkeypatch, capfd)
    assert (status, out, err) == (2, "", f"tendonfmu: {plant.PLANT_MISSING}\n")
    assert read_rig(tmp_path / "rig.json").rate == 500.0  # the file itself can still be read


@pytest.mark.long
def test_an_installation_without_the_module_does_everything_else(tmp_path: Path) -> None:
    """The package as it is where SUNDIALS was not found, in an interpreter of its own."""
    installed = Path(plant.__file__).parent.parent
    without = shutil.ignore_patterns("_plant*.so", "_plant*.pyd", "binaries", "sources", "__pycache__")
    shutil.copytree(installed, tmp_path / "tendonfmu", ignore=without)

    def run(*arguments: str | Path) -> tuple[int, str, str]:
        command = [sys.executable, "-m", "tendonfmu.cli", *map(str, arguments)]
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
        return done.returncode, done.stdout, done.stderr

    missing = (2, "", f"tendonfmu: {plant.PLANT_MISSING}\n")
    assert run("check", RIGS / "index_finger.json") == missing
    assert run("simulate", RIGS / "index_finger.json", "-o", "rec.parquet") == missing
    status, out, err = run("check", EXAMPLES / "fingers" / "index_finger.json")
    assert (status, err) == (0, "") and out.startswith("index_finger: a valid finger description")
