"""Exports of a package, whose modules are imported when one of their names is first used."""

from __future__ import annotations

import ast
from collections.abc import Callable
from pathlib import Path
from typing import Any

import lazy_loader


def lazy_exports(package: str, file: str) -> tuple[Callable[[str], Any], Callable[[], list[str]], list[str]]:
    """Return `__getattr__`, `__dir__` and `__all__` for the imports that a file has under `if TYPE_CHECKING`."""
    tree = ast.parse(Path(file).read_text(encoding="utf-8"))
    submodules: list[str] = []
    attributes: dict[str, list[str]] = {}
    for block in (node for node in tree.body if isinstance(node, ast.If)):
        for line in (node for node in block.body if isinstance(node, ast.ImportFrom)):
            names = [alias.name for alias in line.names]
            if line.module is None:
                submodules += names
            else:
                attributes[line.module] = names
    getter, listing, exported = lazy_loader.attach(package, submodules, attributes)
    return getter, listing, exported
