"""How ROS 2 messages in CDR are decoded, by the package rosbags, which needs no ROS."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from tendonfmu.files import require_extra


class Ros2Types:
    """Types of messages."""

    def __init__(self, file: Path) -> None:
        self._typesys = require_extra("rosbags.typesys", str(file))
        self._own = self._typesys.get_typestore(self._typesys.Stores.EMPTY)
        self._usual: Any = None

    def decoder(self, name: str, definition: str, encoding: str) -> Callable[[bytes], Any] | None:
        """Return a function that decodes messages, or None if the type is not known."""
        if name.count("/") == 1:
            name = name.replace("/", "/msg/")
        store = self._own
        if definition.strip():
            if not self._register(name, definition, encoding):
                return None
        else:
            if self._usual is None:
                self._usual = self._typesys.get_typestore(self._typesys.Stores.LATEST)
            store = self._usual
        if name not in store.fielddefs:
            return None

        def decode(data: bytes) -> Any:
            try:
                return store.deserialize_cdr(data, name)
            except Exception as error:  # generated code fails in any way on a damaged message
                raise ValueError(str(error)) from None

        return decode

    def _register(self, name: str, definition: str, encoding: str) -> bool:
        if name in self._own.fielddefs:
            return True
        try:
            read = self._typesys.get_types_from_idl if encoding == "ros2idl" else None
            found = self._typesys.get_types_from_msg(definition, name) if read is None else read(definition)
            known = self._own.fielddefs
            self._own.register({key: value for key, value in found.items() if key not in known})
        except Exception:  # the parser of rosbags raises errors of its own for a definition that it cannot read
            return False
        return name in self._own.fielddefs
