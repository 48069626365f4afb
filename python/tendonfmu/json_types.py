"""Types of the values in reports and other JSON files: a dictionary with these is what the file holds.

`tools/tables/generate.py` makes `schema/*.schema.json` from them. A class is an object; its docstring and the comments
of its keys are the descriptions. `Schema` is what else JSON Schema says of a type; `Any` is for what others define.
"""

from __future__ import annotations

from typing import Annotated, Any


class Schema(dict[str, Any]):
    """Keywords of JSON Schema, such as `minimum`."""

    __hash__ = object.__hash__  # type: ignore[assignment]  # for unions


Number = float | None  # null: not known
Size = Annotated[float, Schema(minimum=0)]
Share = Annotated[float, Schema(minimum=0, maximum=1)]
Count = Annotated[int, Schema(minimum=0)]
Index = Annotated[int, Schema(minimum=1)]  # of a joint or tendon
Text = Annotated[str, Schema(minLength=1)]
Kinematics = Annotated[int, Schema(enum=[1, 2, 3])]
Values = list[Number]
Sizes = list[Size | None]
