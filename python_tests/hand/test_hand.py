"""What a hand may hold, what is refused and with which words; the published JSON Schema says the same."""

from __future__ import annotations

import json
from collections.abc import Callable
from importlib.resources import files
from pathlib import Path
from typing import Any

import jsonschema
import pytest

from command import Call
from small_hand import FINGERS, write_worn_hand, write_wrist_hand
from tendonfmu.commands.command import is_hand
from tendonfmu.commands.hand.description import read_hand
from tendonfmu.errors import InputError
from tendonfmu.model.description import read_finger

SCHEMA = json.loads((files("tendonfmu") / "schema" / "hand.schema.json").read_text(encoding="utf-8"))
VALIDATOR = jsonschema.Draft202012Validator(SCHEMA)

Change = Callable[[dict[str, Any]], Any]


@pytest.fixture
def hand_file(tmp_path: Path) -> Path:
    return write_worn_hand(tmp_path)["hand"]


def test_a_hand_has_its_fingers_and_their_columns(hand_file: Path) -> None:
    hand = read_hand(hand_file)
    assert [part.name for part in hand.parts] == list(FINGERS) and hand.wrist is None
    assert [part.prefix for part in hand.parts] == ["index_", "ring_"]
    assert hand.summary()[0] == "right_hand: a valid hand of 2 fingers"
    assert is_hand(hand_file) and not is_hand(hand_file.with_name("index.json"))
    before, after = json.loads(hand_file.read_text()), json.loads(hand.with_descriptions({"ring": "worn/finger.json"}))
    before["fingers"][1]["description"] = "worn/finger.json"
    assert after == before


def test_without_columns_the_prefix_is_the_name_and_a_point(tmp_path: Path) -> None:
    hand = read_hand(write_wrist_hand(tmp_path, "tendons")[0])
    assert [part.prefix for part in hand.parts] == ["index.", "ring.", "wrist."]
    assert [part.name for part in hand.parts] == [*FINGERS, "wrist"] and [part.shared for part in hand.parts] == [
        1,
        1,
        0,
    ]
    assert [part.kinematics(1) for part in hand.parts] == [2, 2, 1] and hand.parts[0].kinematics(3) == 3


# --- refusals ---------------------------------------------------------------------------------------------------------


def set_columns(data: dict[str, Any], columns: Any) -> None:
    data["fingers"][1]["columns"] = columns


# what is changed; the words of the refusal; whether the schema, which sees neither files nor names, refuses it too
REFUSED: dict[str, tuple[Change, str, bool]] = {
    "one prefix for two": (
        lambda data: set_columns(data, "index_"),
        'fingers[2].columns = "index_": expected a prefix of its own, since that of index is the same',
        False,
    ),
    "columns one by one": (
        lambda data: set_columns(data, {"tendon_force[1]": "f"}),
        'fingers[2].columns = {"tendon_force[1]": "f"}: expected the prefix of its columns, such as index_',
        True,
    ),
    "an unknown key": (lambda data: data.update(arm=1), "arm = 1: unknown key; expected one of format, name", True),
    "an unknown key of a finger": (
        lambda data: data["fingers"][0].update(file="x"),
        'fingers[1].file = "x": unknown key; expected one of name, description, columns',
        True,
    ),
    "a missing file": (
        lambda data: data["fingers"][0].update(description="thumb.json"),
        "thumb.json: No such file or directory; expected a finger description (JSON)",
        False,
    ),
    "two of one name": (
        lambda data: data["fingers"][1].update(name="Index"),
        'fingers[2].name = "Index": expected a name that no other finger has, and none of wrist, recordings, rows',
        False,
    ),
    "a name that no folder has": (
        lambda data: data["fingers"][1].update(name="../x"),
        'fingers[2].name = "../x": expected 1 to 40 letters, digits, - and _, a letter first',
        True,
    ),
    "no fingers": (lambda data: data.update(fingers=[]), "fingers = []: expected a list of 1 to 32 fingers", True),
    "another format": (
        lambda data: data.update(format="tendonfmu-hand-2"),
        'format = "tendonfmu-hand-2": expected "tendonfmu-hand-1"',
        True,
    ),
    "a wrist of two kinds": (
        lambda data: data.update(wrist={"joints": ["a"], "description": "index.json"}),
        "wrist = {",
        True,
    ),
    "a wrist whose joints no finger has": (
        lambda data: data.update(wrist={"joints": ["flexion"]}),
        "fingers[1]: the joints of index are joint 1; expected those of the wrist first, flexion, and then its own",
        False,
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_refused(hand_file: Path, call: Call, name: str) -> None:
    """One line, by every command, and nothing written; the schema refuses what it can see."""
    change, words, visible = REFUSED[name]
    data = json.loads(hand_file.read_text())
    assert VALIDATOR.is_valid(data)
    change(data)
    assert VALIDATOR.is_valid(data) is not visible
    hand_file.write_text(json.dumps(data))
    with pytest.raises(InputError) as refused:
        read_hand(hand_file)
    assert words in str(refused.value) and "\n" not in str(refused.value)
    assert str(refused.value).startswith(str(hand_file.parent))
    answer = call("run", hand_file, "recording.csv", "-o", "out.csv")
    assert answer.status == 2 and answer.err == f"tendonfmu: {refused.value}\n" and not Path("out.csv").exists()
    assert call("check", hand_file).status == 1


def test_a_hand_is_no_finger_and_no_number(hand_file: Path) -> None:
    with pytest.raises(InputError, match='format = "tendonfmu-hand-1": a hand; expected a finger description'):
        read_finger(hand_file)
    with pytest.raises(InputError, match="hand: int; expected the path of a hand"):
        read_hand(1)  # type: ignore[arg-type]


@pytest.mark.parametrize("wrist", ["measured", "tendons"])
def test_a_wrist_has_the_first_joints_of_all_fingers(tmp_path: Path, wrist: str) -> None:
    file = write_wrist_hand(tmp_path, wrist)[0]
    data = json.loads(file.read_text())
    jsonschema.Draft202012Validator.check_schema(SCHEMA)
    assert VALIDATOR.is_valid(data) and not VALIDATOR.is_valid(data | {"wrist": {"joints": 1}})
    if wrist == "tendons":  # as many joints as its tendons move
        (tmp_path / "wrist.json").write_text((tmp_path / "index.json").read_text())
        with pytest.raises(InputError, match="joints of index are flexion, mcp, pip; expected those of the wrist"):
            read_hand(file)
