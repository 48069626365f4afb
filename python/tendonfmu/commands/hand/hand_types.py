"""The file of a hand as JSON has it, "tendonfmu-hand-1"."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Literal, TypedDict

from tendonfmu.json_types import Schema, Text

if TYPE_CHECKING:
    from typing_extensions import NotRequired

WRIST = "wrist"  # the name of the wrist among the parts
RESERVED = (WRIST, "recordings", "rows")  # folders and columns have these names
NAME = "[A-Za-z][A-Za-z0-9_-]{0,39}"
MOST_FINGERS = 32


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
