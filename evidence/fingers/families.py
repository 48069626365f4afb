"""The families of foreign fingers, and their numbered cases."""

from __future__ import annotations

import importlib
from types import ModuleType

from evidence.runner import say

FAMILIES = {"recorded": "recorded", "mujoco": "mujoco_cases", "numpy": "numpy_cases"}
HALVES = {"odd": (1,), "even": (0,), "all": (0, 1)}  # of a case's number: odd to develop on, even to report


def module_of(family: str) -> ModuleType:
    return importlib.import_module(f"evidence.fingers.{FAMILIES[family]}")


def cases_of(half: str) -> dict[str, tuple[str, int]]:
    """By name, family and number of all cases of a half that can be made here."""
    cases: dict[str, tuple[str, int]] = {}
    for family in FAMILIES:
        try:
            module = module_of(family)
        except ModuleNotFoundError as missing:
            say(f"SKIPPED: the family {family}: {missing.name} is not installed")
            continue
        numbers = module.numbers() if family == "recorded" else module.NUMBERS
        cases |= {f"{family}_{number:02d}": (family, number) for number in numbers if number % 2 in HALVES[half]}
    return cases
