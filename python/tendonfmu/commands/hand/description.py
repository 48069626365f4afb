"""What a hand is: its fingers, which columns of a recording are theirs, and the wrist that they share.

docs/reference/hand.md describes the file; `schema/hand.schema.json`, made from the types here, is for editors.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, TypedDict

from tendonfmu.errors import InputError
from tendonfmu.files import Node, Refusal, counted, path_of, read_json, report_text
from tendonfmu.json_types import Schema, Text
from tendonfmu.model import Finger, read_finger

if TYPE_CHECKING:
    from typing_extensions import NotRequired

FORMAT = "tendonfmu-hand-1"
WRIST = "wrist"  # the name of the wrist among the parts
RESERVED = (WRIST, "recordings", "rows")  # folders and columns have these names
NAME = "[A-Za-z][A-Za-z0-9_-]{0,39}"
MOST_FINGERS = 32
_EXPECTED_NAME = "1 to 40 letters, digits, - and _, a letter first"


class FingerOfHand(TypedDict):
    # Name of the finger: of its folder, its FMU and its columns of results. No two alike.
    name: Annotated[str, Schema({"pattern": f"^{NAME}$", "not": {"enum": RESERVED}})]
    description: Text  # Path of the finger description, relative to this file.
    columns: NotRequired[Text]  # Prefix of its columns in the hand's recording, such as index_ [default: NAME.].


class MeasuredWrist(TypedDict):
    joints: Annotated[list[Text], Schema(minItems=1)]  # Names of the joints, whose angles are measured.
    columns: NotRequired[Text]  # Prefix of its columns [default: wrist.].


class DescribedWrist(TypedDict):
    description: Text  # Path of the description of the wrist, which has tendons of its own.
    columns: NotRequired[Text]  # Prefix of its columns [default: wrist.].


class HandFile(TypedDict):
    """Several fingers that are recorded together. See docs/reference/hand.md."""

    format: Literal["tendonfmu-hand-1"]
    name: Text  # Name of the hand.
    comment: NotRequired[str]  # For readers of the file; ignored.
    # The fingers, as they stand side by side.
    fingers: Annotated[list[FingerOfHand], Schema(minItems=1, maxItems=32)]
    wrist: NotRequired[
        MeasuredWrist | DescribedWrist
    ]  # The wrist that all fingers share. Every finger has its joints first.


@dataclass(frozen=True)
class HandPart:
    """A finger of a hand, or its wrist if that has tendons of its own."""

    name: str
    finger: Finger
    prefix: str  # of its columns in the hand's recording
    shared: int = 0  # how many first joints are the wrist's and not its own

    def kinematics(self, asked: int) -> int:
        """Return the kinematics source. A finger with a shared wrist takes its angle, so at least source 2."""
        return max(asked, 2) if self.shared else asked


@dataclass(frozen=True)
class Wrist:
    """The wrist: joints that every finger has first."""

    joints: tuple[str, ...]  # their names [w]
    prefix: str  # of its columns
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
    def files(self) -> list[Path]:
        """All files that describe the hand, its own first."""
        return [self.path, *(part.finger.path for part in self.parts)]

    def summary(self) -> list[str]:
        """Describe the hand in lines of text."""
        lines = [
            f"{part.name:<18} {part.finger.name}: {counted(part.finger.joints, 'joint')}, "
            f"{counted(part.finger.tendons, 'tendon')}; columns {part.prefix}..."
            for part in self.parts
        ]
        if self.wrist and self.wrist.part is None:
            lines.append(f"{WRIST:<18} {', '.join(self.wrist.joints)}; columns {self.wrist.prefix}...")
        return [f"{self.name}: a valid hand of {counted(len(self.fingers), 'finger')}", *lines]

    def with_descriptions(self, files: Mapping[str, str]) -> str:
        """Return the JSON text of the hand whose parts have other descriptions, by the name of the part."""
        data = json.loads(json.dumps(self.data))
        for entry in data["fingers"]:
            entry["description"] = files.get(entry["name"], entry["description"])
        if WRIST in files:
            data[WRIST]["description"] = files[WRIST]
        return report_text(data)


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
        wrist = _wrist(root.member(WRIST), path.parent)
        fingers = tuple(_fingers(root.member("fingers"), path.parent, wrist))
        return Hand(path, data, fingers, wrist)
    except Refusal as refused:
        raise InputError(f"{path}: {refused}") from None


def _fingers(node: Node, folder: Path, wrist: Wrist | None) -> Iterator[HandPart]:
    if not isinstance(node.value, list) or not 1 <= len(node.value) <= MOST_FINGERS:
        node.refuse(f"a list of 1 to {MOST_FINGERS} fingers")
    taken = set(RESERVED)
    owners = {} if wrist is None else {wrist.prefix: WRIST}
    for element in node.elements():
        name = element.keys(("name", "description", "columns")).member("name")
        text = name.text(_EXPECTED_NAME)
        if not re.fullmatch(NAME, text):
            name.refuse(_EXPECTED_NAME)
        if text.lower() in taken:
            name.refuse(f"a name that no other finger has, and none of {', '.join(RESERVED)}")
        taken.add(text.lower())
        part = _behind(wrist, element, _part(element, text, folder))
        if part.prefix in owners:
            element.member("columns").refuse(f"a prefix of its own, since that of {owners[part.prefix]} is the same")
        owners[part.prefix] = text
        yield part


def _part(node: Node, name: str, folder: Path) -> HandPart:
    file = node.member("description").text("path of a finger description, relative to this file")
    return HandPart(name, read_finger(folder / file), _prefix(node, name))


def _prefix(node: Node, name: str) -> str:
    columns = node.member("columns")
    return f"{name}." if columns.absent else columns.text("the prefix of its columns, such as index_")


def _wrist(node: Node, folder: Path) -> Wrist | None:
    if node.absent:
        return None
    node.keys(("joints", "columns", "description"))
    described, named = node.member("description"), node.member("joints")
    if described.absent == named.absent:
        node.refuse("joints, if its angles are measured, or description, if it has tendons; one of both")
    if not described.absent:
        part = _part(node, WRIST, folder)
        return Wrist(tuple(part.finger.joint_names), part.prefix, part)
    if not isinstance(named.value, list) or not named.value:
        named.refuse("a list of names of joints, which every finger has first")
    joints = tuple(element.text("the name of a joint") for element in named.elements())
    return Wrist(joints, _prefix(node, WRIST), None)


def _behind(wrist: Wrist | None, node: Node, part: HandPart) -> HandPart:
    """Tell a finger how many of its joints are the wrist's. Refuse one that does not begin with them or ends there."""
    if wrist is None:
        return part
    given = tuple(part.finger.joint_names)
    if given[: len(wrist.joints)] != wrist.joints or given == wrist.joints:
        raise Refusal(
            f"{node.path}: the joints of {part.name} are {', '.join(given)}; expected those of the wrist first, "
            f"{', '.join(wrist.joints)}, and then its own"
        )
    return replace(part, shared=len(wrist.joints))
