"""Rig files: what they expand to, what is refused and how, the published schema, and `tendonfmu check`."""

from __future__ import annotations

import copy
import hashlib
import json
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from importlib.resources import files
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest

from command import Call
from plant_rigs import needs_plant
from repetitions import repeated
from rig_cases import (
    EXAMPLES,
    FINGER,
    INDEX_RIGS,
    RIGS,
    accepted,
    changed,
    index_rig,
    place_of,
    with_everything,
    written,
)
from tendonfmu.errors import InputError
from tendonfmu.simulate import plant
from tendonfmu.simulate.rig import Rig, is_rig, read_rig
from tendonfmu.simulate.simulation import plant_of

VALIDATOR = jsonschema.Draft202012Validator(
    json.loads((files("tendonfmu") / "schema" / "rig.schema.json").read_text(encoding="utf-8"))
)

# --- reading ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", INDEX_RIGS)
def test_index_rigs_expand(name: str) -> None:
    rig = read_rig(RIGS / name)
    expanded = json.loads(rig.json())
    assert (rig.joints, rig.tendons, rig.version, rig.rate) == (4, 8, 1, 500.0)
    assert expanded["finger"] == FINGER and "base" not in expanded
    assert set(expanded["motion"]) == {"joints", "pretension"} and len(expanded["motion"]["joints"]) == 4
    assert len(rig.times()) == 30000 and rig.times()[-1] == 29999 / 500


def test_the_numbers_of_version_1_are_frozen() -> None:
    """Later figures are compared with these: a change is a version 2, not another digest here."""
    finger = json.loads((RIGS / "../fingers/index_finger.json").read_text())
    frozen = [*(json.loads((RIGS / name).read_text()) for name in INDEX_RIGS)]
    frozen[0]["integration"]["method"] = "cvode"  # frozen when there was a choice
    frozen.append({key: finger[key] for key in ("joints", "tendons")})  # not thresholds and bias: those are the model's
    digests = [hashlib.sha256(json.dumps(data, sort_keys=True).encode()).hexdigest()[:16] for data in frozen]
    assert digests == ["c5684190258469be", "310606ed8d953861", "e7bbe71ce308b482", "51d5ec52adb92818"]


def test_recording_times_stay_below_the_duration(tmp_path: Path) -> None:
    for duration, rate, samples in ((0.3, 1000, 300), (0.1, 30, 3), (0.11, 30, 4), (1e-4, 100, 1)):
        data = index_rig()
        data["recording"] = {"duration": duration}
        data["sensors"]["rate"] = rate
        times = read_rig(written(tmp_path, data)).times()
        assert len(times) == samples and np.array_equal(times, np.arange(samples) / rate)


def test_the_format_key_decides(tmp_path: Path) -> None:
    assert is_rig(RIGS / "index_finger.json")
    assert is_rig(written(tmp_path, {"format": "tendonfmu-rig-9"}))
    assert not is_rig(EXAMPLES / "fingers" / "index_finger.json")
    assert not any(is_rig(written(tmp_path, text)) for text in ("{", "[1]")) and not is_rig(tmp_path / "none.json")


def derived(folder: Path, **own: Any) -> Rig:
    written(folder, index_rig(), "base.json")
    return read_rig(written(folder, {"format": "tendonfmu-rig-1", "base": "base.json"} | own))


def test_a_base_gives_what_is_not_given(tmp_path: Path) -> None:
    """Objects are merged, lists are taken whole, null takes a key away; another kind of motion replaces the base's."""
    base = index_rig()
    rig = derived(tmp_path, seed=9, physics={"friction": {"stribeck_exponent": 1}, "servo": None, "gravity": [0, 0, 0]})
    assert rig.expanded["seed"] == 9 and rig.name == "index_finger" and "servo" not in rig.expanded["physics"]
    assert rig.expanded["physics"]["links"] == base["physics"]["links"]
    assert rig.expanded["physics"]["friction"] == base["physics"]["friction"] | {"stribeck_exponent": 1}
    assert rig.expanded["physics"]["gravity"] == [0, 0, 0]
    assert (derived(tmp_path, recording={"columns": ["contact"]}).columns) == ["contact"]
    assert derived(tmp_path, motion={"kind": "still", "pretension": 7.0}).motion.says == "still"
    rig = derived(tmp_path, motion={"pretension": 7.0})
    assert rig.motion.says.startswith("strokes") and rig.motion.pretension["value"] == [7.0]


def test_paths_are_relative_to_the_file_in_which_they_stand(tmp_path: Path) -> None:
    (tmp_path / "fingers").mkdir()
    (tmp_path / "rigs").mkdir()
    written(tmp_path / "fingers", FINGER, "finger.json")
    written(tmp_path / "rigs", index_rig() | {"finger": "../fingers/finger.json"}, "base.json")
    rig = read_rig(written(tmp_path, {"format": "tendonfmu-rig-1", "base": "rigs/base.json"}))
    assert rig.finger.path.resolve() == (tmp_path / "fingers" / "finger.json").resolve()


# --- refusals of the reader and of the plant --------------------------------------------------------------------------


def test_errors_of_a_base_name_its_file(tmp_path: Path) -> None:
    def rig_of(base: str, name: str = "rig.json") -> Path:
        return written(tmp_path, {"format": "tendonfmu-rig-1", "base": base}, name)

    written(tmp_path, {"format": "tendonfmu-rig-1", "colour": 1}, "base.json")
    with pytest.raises(InputError, match=r"base\.json: colour = 1: unknown key; expected one of format, base"):
        read_rig(rig_of("base.json"))
    with pytest.raises(InputError, match=r"other\.json: No such file or directory; expected a rig"):
        read_rig(rig_of("other.json"))
    rig_of("b.json", "a.json"), rig_of("./a.json", "b.json")
    with pytest.raises(InputError, match=r"b\.json: base: .*a\.json -> .*b\.json -> .*a\.json; expected no rig that"):
        read_rig(tmp_path / "a.json")


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("", r"line 1, column 1: .*; expected a rig \(JSON\)"),
        ('{"seed": 1, "seed": 2}', r'key "seed" occurs twice in one object; expected once'),
        ('{"seed": NaN}', r"NaN: not a number in JSON"),
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


BAD: list[tuple[str, Any, str]] = [
    ("name", "", r'name = "": expected the rig\'s name'),
    ("version", 0, r"version = 0: expected an integer from 1"),
    ("seed", 2**53 + 1, r"seed = 9007199254740993: expected an integer from 0 to 9007199254740992"),
    ("colour", "red", r'colour = "red": unknown key; expected one of format, base, name'),
    ("finger", 3, r"finger = 3: expected a finger description, or the path of one"),
    ("finger", "none.json", r"none\.json: No such file or directory; expected a finger description"),
    ("finger", None, r"finger: missing"),
    ("physics.links", [], r"physics\.links = \[\]: expected a list of 4, one link per joint of the finger"),
    ("physics.links.1.axis", "y", r'physics\.links\[2\]\.axis = "y": expected a list of 3, x, y and z'),
    ("physics.links.2.limits.upper", -1.0, r"links\[3\]\.limits\.upper = -1\.0: expected"),
    ("physics.tip", [0.0, 0.0, True], r"physics\.tip\[3\] = true: expected a number in m"),
    ("sensors.rate", 0, r"sensors\.rate = 0: expected a number in Hz, at least 1 and at most 100000"),
    ("motion", None, r"motion: missing; expected an object with the key kind"),
    ("motion.position.1", 1.5, r"motion\.position\[2\] = 1\.5: expected an angle within the joint's range"),
    ("pushes", "tip", r'pushes = "tip": expected a list of pushes, or an object with count'),
    ("recording.duration", 1e6, r"recording\.duration = 1000000\.0: expected at most 50000000"),
    ("recording.columns", ["torque"], r'recording\.columns\[1\] = "torque": expected "joint_position" or'),
    ("recording.columns", ["contact"] * 2, r'recording\.columns\[1\] = "contact": expected each column once'),
]
BAD_PHYSICS: list[tuple[str, Any, str]] = [
    ("physics.links.1.mass", -0.01, r"physics\.links\[2\]\.mass = -0\.01: expected .*kg"),
    ("sensors.tendon_force.noise", -1.0, r"sensors\.tendon_force\.noise = -1\.0: expected"),
    ("pushes", [{"start": 1.0}], r"pushes\[1\]\."),
    # all tendons pull the last joint the same way: nothing holds it against pretension
    ("finger.tendons.7.moment_arms.3", 0.0045, r"finger\.tendons\[\d\]\.moment_arms: expected .*positive null vector"),
]


@pytest.mark.parametrize(
    ("path", "value", "line"), [*BAD, *(pytest.param(*row, marks=needs_plant) for row in BAD_PHYSICS)]
)
def test_bad_rigs_are_refused_by_key(tmp_path: Path, path: str, value: Any, line: str) -> None:
    keys = tuple(int(key) if key.isdigit() else key for key in path.split("."))
    file = written(tmp_path, changed(index_rig(), keys, value))
    refuse = read_rig if (path, value, line) in BAD else lambda file: plant_of(read_rig(file))
    with pytest.raises(InputError, match=line) as refused:
        refuse(file)
    assert "\n" not in str(refused.value)


def test_a_rig_without_a_recording_cannot_be_recorded(tmp_path: Path) -> None:
    data = index_rig()
    del data["recording"]
    with pytest.raises(InputError, match=r"rig\.json: recording: missing; expected an object with duration, s"):
        read_rig(written(tmp_path, data)).times()


@needs_plant
@pytest.mark.parametrize("data", [index_rig(), with_everything()], ids=lambda data: data["name"])
def test_the_plant_and_the_schema_take_good_rigs(tmp_path: Path, data: dict[str, Any]) -> None:
    found = plant_of(read_rig(written(tmp_path, data)))
    assert found.joints == len(data["finger"]["joints"]) and not found.initialised
    assert found.settings.seed == data["seed"] and found.settings.relative_tolerance == 1e-6
    VALIDATOR.validate(data)


# --- the published schema ---------------------------------------------------------------------------------------------


def test_the_schema_asks_a_rig_without_a_base_for_everything() -> None:
    VALIDATOR.check_schema(VALIDATOR.schema)
    for name in INDEX_RIGS:
        VALIDATOR.validate(json.loads((RIGS / name).read_text(encoding="utf-8")))
    partial = {"format": "tendonfmu-rig-1", "physics": {"wrist": {"amplitude": 0.2}}, "recording": {"columns": []}}
    VALIDATOR.validate(partial | {"base": "other.json"})
    assert not VALIDATOR.is_valid(partial)
    assert not VALIDATOR.is_valid(partial | {"base": "other.json", "motion": {"speeds": [1, 2]}})


CHANGES: list[Any] = ["DELETE", "ADD", None, True, "text", [], {}, -1, 0, 3, 1e13, [0.0, 1.0]]

# What reader and plant refuse and a schema cannot express: relations between values in different places.
BEYOND_THE_SCHEMA = {
    "lengths of lists and the finger's size": r"expected a list of \d+( numbers|, one (link|angle) per joint.*)$",
    "lengths that plain numbers may have, too": r"has \d+ elements?: expected a list of \d+ numbers?",
    "indices and the finger's size": r"\.(link|joint|tendon) = \d+: expected a whole number from [12] to",
    "an edge that the finger has not": r"expected a joint where the finger's tendon has an edge",
    "an order of two numbers": r"the second not below the first",
    "an order of two keys": r"expected an angle (above limits\.lower|not (below|above) motion)",
    "angles and the joint's limits": r"expected an angle within the joint's range",
    "a direction of no length": r"expected a direction \[x, y, z\] that is not zero",
    "moments of inertia of no body": r"expected three moments of inertia",
    "a law that sticks and does not slide": r"coulomb = .*: expected a positive number where `static` is one",
    "arms that leave no null vector": r"expected arms with a positive null vector",
    "time that pushes need": r"the next one would end at",
    "number of samples": r"expected at most \d+ samples",
}
RECIPE: dict[str, Any] = {"count": 2, "seed": 1, "first": 1.0, "where": "anywhere", "direction": ["side"]}
RECIPE |= {"force": [0.5, 1.0], "hold": [0.1, 0.2], "rise": [0.1, 0.2], "gap": [0.1, 1.0]}


def varied(data: dict[str, Any], path: tuple[Any, ...], change: Any) -> dict[str, Any]:
    result = copy.deepcopy(data)
    place = place_of(result, path[:-1])
    if change == "DELETE":
        del place[path[-1]]
    elif change == "ADD":
        inner = place[path[-1]]
        if isinstance(inner, dict):
            inner["unknown"] = 1.0
        elif isinstance(inner, list) and inner:
            inner.append(copy.deepcopy(inner[-1]))
    else:
        place[path[-1]] = change
    return result


def places(value: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """All places of a rig but its finger; of a list the first element alone."""
    items = value.items() if isinstance(value, dict) else [(0, value[0])] if isinstance(value, list) and value else ()
    for key, inner in items:
        if (*path, key) != ("finger",):
            yield (*path, key)
            yield from places(inner, (*path, key))


@needs_plant
@pytest.mark.parametrize("every", repeated([50, 1], 0))
def test_schema_and_readers_agree_on_changed_values(tmp_path: Path, every: int) -> None:
    """Both accept the same, but for relations between values that a schema cannot express."""
    data = with_everything()
    cases = [(data, path, change) for path in places(data) for change in CHANGES]
    recipe = data | {"pushes": RECIPE}
    cases += [(recipe, path, change) for path in places(recipe) if path[0] == "pushes" for change in CHANGES]
    assert len(cases) > 1500 and accepted(tmp_path, recipe) is None
    for rig, path, change in cases[::every]:
        other = varied(rig, path, change)
        refused, errors = accepted(tmp_path, other), list(VALIDATOR.iter_errors(other))
        if refused is None:
            assert errors == [], f"{path} = {change!r}"
        elif not errors:
            assert any(re.search(line, refused) for line in BEYOND_THE_SCHEMA.values()), f"{path}: {refused}"


# --- check ------------------------------------------------------------------------------------------------------------


@needs_plant
def test_check_says_what_the_rig_is(tmp_path: Path, call: Call) -> None:
    answer = call("check", RIGS / "index_finger_pushes.json")
    assert (answer.status, answer.err) == (0, "")
    for part in ("index_finger_pushes, version 1", "mcp_abduction", "73 continuous states; gravity, links"):
        assert part in answer.out
    assert re.search(r"^pushes +11$", answer.out, re.MULTILINE)
    answer = call("check", written(tmp_path, with_everything()))
    for part in ("wrist", "obstacle", "friction", "joint_coupling"):
        assert part in answer.out


@needs_plant
def test_check_refuses_with_status_1(tmp_path: Path, call: Call) -> None:
    bad = written(tmp_path, changed(index_rig(), ("physics", "links", 0, "mass"), -1.0))
    answer = call("check", bad)
    assert (answer.status, answer.out) == (1, "")
    assert answer.err.startswith(f"tendonfmu: {bad}: physics.links[1].mass = -1.0: expected")
    assert answer.err.count("\n") == 1


def test_without_a_plant_commands_say_so(tmp_path: Path, call: Call, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(plant, "HAS_PLANT", False)
    rig = written(tmp_path, index_rig())
    for arguments in (("check", rig), ("simulate", rig, "-o", "rec.csv")):
        answer = call(*arguments)
        assert (answer.status, answer.out, answer.err) == (2, "", f"tendonfmu: {plant.PLANT_MISSING}\n")
    assert read_rig(rig).rate == 500.0  # the file itself can still be read


@pytest.mark.long
def test_an_installation_without_the_module_does_everything_else(tmp_path: Path) -> None:
    """The package as it is where SUNDIALS was not found, in an interpreter of its own."""
    installed = Path(plant.__file__).parent.parent
    without = shutil.ignore_patterns("_plant*.so", "_plant*.pyd", "binaries", "sources", "__pycache__")
    shutil.copytree(installed, tmp_path / "tendonfmu", ignore=without)

    def run(*arguments: str | Path) -> tuple[int, str, str]:
        command = [sys.executable, "-m", "tendonfmu", *map(str, arguments)]
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
        return done.returncode, done.stdout, done.stderr

    assert run("check", RIGS / "index_finger.json") == (2, "", f"tendonfmu: {plant.PLANT_MISSING}\n")
    status, out, err = run("check", EXAMPLES / "fingers" / "index_finger.json")
    assert (status, err) == (0, "") and out.startswith("index_finger: a valid finger description")
