"""How libraries of the extra `logs` are imported: a missing one is an error that says how to install it."""

from __future__ import annotations

import importlib
from typing import Any

from tendonfmu.errors import InputError


def require_extra(module: str, what: str) -> Any:
    """Import a module of the extra `logs`."""
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as missing:
        name = (missing.name or module).split(".")[0]
        raise InputError(
            f"{what}: needs the Python package {name}, which is not installed; pip install 'tendonfmu[logs]'"
        ) from None
