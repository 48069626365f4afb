"""The XML of a MuJoCo model: its joints and tendons by name, with included files, and numbers changed in place."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lxml import etree

from tendonfmu.errors import InputError

FIXED, SPATIAL = "fixed", "spatial"
_SEARCHED = {"joint": ("worldbody", ("joint",)), "tendon": ("tendon", (FIXED, SPATIAL))}


@dataclass(frozen=True)
class Inclusion:
    """An <include> whose content stands in its place."""

    element: Any  # the <include>, taken out of the tree
    content: list[Any]  # the elements that stand in its place
    folder: Path  # folder of the file


class XmlSource:
    """The XML of a model and of the files that it includes."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._tree = _parse(path)
        self._inclusions: list[Inclusion] = []
        self._changed: list[Any] = []
        self._include_all()

    def _include_all(self) -> None:
        """Put the content of included files in place of each <include>, as MuJoCo does before it reads a model."""
        root = self._tree.getroot()
        while (include := next(root.iter("include"), None)) is not None:
            file = self._included_file(include)
            content = list(_parse(file).getroot())
            parent = include.getparent()
            place = parent.index(include)
            for k, element in enumerate(content):
                parent.insert(place + k, element)
            if content:
                content[-1].tail = include.tail
                include.tail = None
            self._inclusions.append(Inclusion(include, content, file.parent))
            parent.remove(include)

    def _included_file(self, include: Any) -> Path:
        """Return the file of an <include>: beside the main file or beside the file that includes it, as in MuJoCo."""
        name, main = include.get("file", ""), self.path.parent
        around = {include, *include.iterancestors()}
        folder = next((each.folder for each in reversed(self._inclusions) if around & set(each.content)), main)
        if not (main / name).is_file() and (folder / name).is_file():
            include.set("file", Path(os.path.relpath(folder / name, main)).as_posix())
        return main / str(include.get("file", ""))

    def element(self, kind: str, name: str) -> Any:
        """Return the element of a joint or tendon."""
        section, tags = _SEARCHED[kind]
        for part in self._tree.getroot().iter(section):
            for element in part.iter(*tags):
                if element.get("name") == name:
                    return element
        raise InputError(
            f"{self.path}: {kind} {name}: no element of this name in the file or in those it includes; expected one, "
            "not a copy made by <replicate> or <attach>"
        )

    def set_number(self, kind: str, name: str, attribute: str, value: float) -> None:
        """Write a number of a joint or tendon, which then holds whatever its default class says."""
        element = self.element(kind, name)
        element.set(attribute, repr(float(value)))
        self._changed.append(element)

    def angle_unit(self) -> float:
        """Return the size of the file's unit of angles (rad)."""
        compilers = [element.get("angle") for element in self._tree.getroot().iter("compiler")]
        unit = next((angle for angle in reversed(compilers) if angle), "degree")
        return 1.0 if unit == "radian" else math.pi / 180

    def text(self) -> bytes:
        """Return the XML. Of included files only those with changed numbers stand in the text."""
        for inclusion in reversed(self._inclusions):  # those within others first
            if not self._is_changed(inclusion):
                _take_back(inclusion)
        return bytes(etree.tostring(self._tree, encoding="utf-8")) + b"\n"

    def _is_changed(self, inclusion: Inclusion) -> bool:
        own = set(inclusion.content)
        return any(own & {element, *element.iterancestors()} for element in self._changed)

    def first_file(self) -> str | None:
        """Return the first file that the text refers to, of those that MuJoCo looks for beside the model; or None."""
        for element in self._tree.getroot().iter():
            name = element.get("file") if isinstance(element.tag, str) else None
            if name and not Path(name).is_absolute():
                return str(name)
        return None


def _take_back(inclusion: Inclusion) -> None:
    """Put an <include> back in the place of its content."""
    if not inclusion.content:
        return
    first, last = inclusion.content[0], inclusion.content[-1]
    parent = first.getparent()
    inclusion.element.tail = last.tail
    last.tail = None
    parent.insert(parent.index(first), inclusion.element)
    for element in inclusion.content:
        parent.remove(element)


def _parse(path: Path) -> Any:
    try:
        return etree.parse(str(path), etree.XMLParser(resolve_entities=False, no_network=True))
    except OSError as failed:
        raise InputError(f"{path}: cannot be read ({failed.strerror or 'no such file'}); expected XML") from None
    except etree.XMLSyntaxError as refused:
        raise InputError(f"{path}: not XML: {refused.msg}") from None
