"""What a hand is: its fingers, which columns of a recording are theirs, and the wrist that they share.

docs/reference/hand.md describes the file; `schema/hand.schema.json`, made from `hand_types`, is for editors.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from tendonfmu.commands.hand.hand_types import MOST_FINGERS, NAME, RESERVED, WRIST, HandFile
from tendonfmu.errors import InputError
from tendonfmu.files import Node, Refusal, counted, path_of, read_json, report_text
from tendonfmu.model import Finger, read_finger
from tendonfmu.recordings import GROUP_PER, GROUPS, LABEL

FORMAT = "tendonfmu-hand-1"
POSITIONS = ("joint_position", "joint_velocity")  # groups of the joints that fingers and wrist share
_EXPECTED_NAME = "1 to 40 letters, digits, - and _, a letter first"


@dataclass(frozen=True)
class HandPart:
    """A finger of a hand, or its wrist if that has tendons of its own."""

    name: str
    finger: Finger
    columns: Mapping[str, str]  # column of a finger's recording -> column of the hand's recording
    prefix: str | None  # of the hand's columns; None if the columns are listed


@dataclass(frozen=True)
class Wrist:
    """The wrist: joints that every finger has first."""

    joints: tuple[str, ...]  # their names [w]
    columns: Mapping[str, str]  # as of `HandPart`; measured angles and velocities, if it has no description
    part: HandPart | None  # if it has tendons of its own


@dataclass(frozen=True)
class Hand:
    """Several fingers that are recorded together.

    Attributes
    ----------
    path
        The file that it was read from.
    data
        The parsed JSON, not to be changed.
    fingers
        The fingers, in the order of the file.
    wrist
        The wrist that they share, or None.
    """

    path: Path
    data: HandFile
    fingers: tuple[HandPart, ...]
    wrist: Wrist | None

    def __repr__(self) -> str:
        return f"<Hand {self.name}: {', '.join(part.name for part in self.fingers)}>"

    @property
    def name(self) -> str:
        """Name of the hand."""
        return str(self.data["name"])

    @property
    def parts(self) -> tuple[HandPart, ...]:
        """The fingers, and the wrist if it has tendons of its own."""
        return (*self.fingers, *([self.wrist.part] if self.wrist and self.wrist.part else []))

    @property
    def wrist_joints(self) -> int:
        """Number of joints of the wrist, w; 0 without one."""
        return len(self.wrist.joints) if self.wrist else 0

    @property
    def files(self) -> list[Path]:
        """All files that describe the hand, its own first."""
        return [self.path, *(part.finger.path for part in self.parts)]

    def shared_joints(self, part: HandPart) -> int:
        """Return how many first joints of a part belong to the wrist and not to the part: w of a finger."""
        return self.wrist_joints if part in self.fingers else 0

    def kinematics(self, part: HandPart, asked: int) -> int:
        """Return the kinematics source of a part. Fingers with a shared wrist take its angle, so at least source 2."""
        return max(asked, 2) if self.shared_joints(part) else asked

    def summary(self) -> list[str]:
        """Describe the hand in lines of text."""
        head = f"{self.name}: a valid hand of {counted(len(self.fingers), 'finger')}"
        lines = [
            f"{part.name:<18} {part.finger.name}: {counted(part.finger.joints, 'joint')}, "
            f"{counted(part.finger.tendons, 'tendon')}; {_columns_in_words(part.columns, part.prefix)}"
            for part in self.parts
        ]
        if self.wrist and self.wrist.part is None:
            lines.append(f"{WRIST:<18} {', '.join(self.wrist.joints)}; {_columns_in_words(self.wrist.columns, None)}")
        return [head, *lines]


def read_hand(source: Hand | str | os.PathLike[str]) -> Hand:
    """Read a hand and the descriptions of its fingers.

    Parameters
    ----------
    source
        A JSON file, or a hand, which is returned as it is.

    Returns
    -------
    Hand
        Fingers, their columns, and the wrist.

    Raises
    ------
    InputError
        One line: the file, the key and what was expected.
    """
    if isinstance(source, Hand):
        return source
    if not isinstance(source, str | os.PathLike):
        raise InputError(f"hand: {type(source).__name__}; expected the path of a hand (JSON), or a Hand")
    path = path_of(source)
    data = read_json(path, "a hand")
    try:
        root = Node(data)
        root.member("format").choice(FORMAT)
        root.keys(("format", "name", "comment", "fingers", WRIST)).member("name").text("the name of the hand")
        fingers = tuple(_fingers(root.member("fingers"), path.parent))
        wrist = _wrist(root.member(WRIST), path.parent, fingers)
        hand = Hand(path, data, fingers, wrist)
        _check_columns(hand)
    except Refusal as refused:
        raise InputError(f"{path}: {refused}") from None
    return hand


def with_descriptions(hand: Hand, files: Mapping[str, str], name: str | None = None) -> str:
    """Return the JSON text of a hand whose parts have other descriptions, by the name of the part."""
    data = json.loads(json.dumps(hand.data))
    for entry in data["fingers"]:
        entry["description"] = files.get(entry["name"], entry["description"])
    if WRIST in files:
        data[WRIST]["description"] = files[WRIST]
    return report_text(data | ({"name": name} if name else {}))


# --- fingers ----------------------------------------------------------------------------------------------------------


def _fingers(node: Node, folder: Path) -> Iterator[HandPart]:
    if not isinstance(node.value, list) or not 1 <= len(node.value) <= MOST_FINGERS:
        node.refuse(f"a list of 1 to {MOST_FINGERS} fingers")
    taken: set[str] = set()
    for element in node.elements():
        name = element.keys(("name", "description", "columns")).member("name")
        text = name.text(_EXPECTED_NAME)
        if not re.fullmatch(NAME, text):
            name.refuse(_EXPECTED_NAME)
        if text.lower() in taken | set(RESERVED):
            name.refuse(f"a name that no other finger has, and none of {', '.join(RESERVED)}")
        taken.add(text.lower())
        yield _part(element, text, folder)


def _part(node: Node, name: str, folder: Path) -> HandPart:
    """Read a part."""
    finger = read_finger(
        folder / node.member("description").text("path of a finger description, relative to this file")
    )
    sizes = {group: finger.tendons if GROUP_PER[group] == "tendon" else finger.joints for group in GROUPS}
    ours = [f"{group}[{i}]" for group, size in sizes.items() for i in range(1, size + 1)] + [LABEL]
    columns, prefix = _columns(node.member("columns"), f"{name}.", ours)
    if prefix is None:
        for column in ours:
            if GROUPS.get(column.partition("[")[0], ("", False))[1] and column not in columns:
                raise Refusal(
                    f"{node.path}.columns: no {column}; expected one for each of the {finger.tendons} tendons"
                )
    return HandPart(name, finger, columns, prefix)


def _columns(node: Node, usual: str, ours: list[str]) -> tuple[dict[str, str], str | None]:
    """Return the hand's column of each of a part's columns, and their prefix, if they have one."""
    if node.absent or isinstance(node.value, str):
        prefix = usual if node.absent else node.text("the prefix of its columns, such as index_, or an object")
        return {column: f"{prefix}{column}" for column in ours}, prefix
    node.keys(ours)
    columns = {column: node.member(column).text("the name of a column") for column in node.value}
    for column, theirs in columns.items():
        if theirs == "time" or list(columns.values()).count(theirs) > 1:
            node.member(column).refuse("a column that is not used for anything else")
    return columns, None


def _check_columns(hand: Hand) -> None:
    """Refuse a column that two parts would read."""
    owners: dict[str, str] = {}
    sets = [(f"fingers[{k}]", part.name, part.columns) for k, part in enumerate(hand.fingers, start=1)]
    if hand.wrist:
        sets.append((WRIST, WRIST, hand.wrist.columns))
    for place, name, columns in sets:
        for column in columns.values():
            if column in owners:
                raise Refusal(
                    f"{place}.columns: column {column} is that of {owners[column]} already; expected columns of its "
                    f'own, such as "columns": "{name}."'
                )
        owners |= dict.fromkeys(columns.values(), name)


def _columns_in_words(columns: Mapping[str, str], prefix: str | None) -> str:
    if prefix is not None:
        return f"columns {prefix}..."
    return f"columns {', '.join(list(columns.values())[:3])}{', ...' * (len(columns) > 3)}"


# --- wrist ------------------------------------------------------------------------------------------------------------


def _wrist(node: Node, folder: Path, fingers: tuple[HandPart, ...]) -> Wrist | None:
    if node.absent:
        return None
    node.keys(("joints", "columns", "description"))
    described, named = node.member("description"), node.member("joints")
    if described.absent == named.absent:
        node.refuse("joints, if its angles are measured, or description, if it has tendons; one of both")
    if described.absent:
        if not isinstance(named.value, list) or not named.value:
            named.refuse("a list of names of joints, which every finger has first")
        joints = tuple(element.text("the name of a joint") for element in named.elements())
        ours = [f"{group}[{j}]" for group in POSITIONS for j in range(1, len(joints) + 1)]
        columns, _ = _columns(node.member("columns"), f"{WRIST}.", ours)
        wrist = Wrist(joints, columns, None)
        for j in range(1, len(joints) + 1):
            if f"joint_position[{j}]" not in columns:
                raise Refusal(f"{WRIST}.columns: no joint_position[{j}]; expected one for each joint of the wrist")
    else:
        part = _part(node, WRIST, folder)
        wrist = Wrist(tuple(part.finger.joint_names), part.columns, part)
    _check_joints(wrist, fingers)
    return wrist


def _check_joints(wrist: Wrist, fingers: tuple[HandPart, ...]) -> None:
    """Refuse fingers that do not begin with the joints of the wrist, or end there."""
    count = len(wrist.joints)
    for k, part in enumerate(fingers, start=1):
        given = part.finger.joint_names
        if tuple(given[:count]) != wrist.joints or len(given) <= count:
            raise Refusal(
                f"fingers[{k}]: the joints of {part.name} are {', '.join(given)}; expected those of the wrist first, "
                f"{', '.join(wrist.joints)}, and then its own"
            )
