"""Every test asserts something: by itself, or by a function of the tests that it calls."""

from __future__ import annotations

import ast
from collections.abc import Mapping
from pathlib import Path

import pytest

from repository_paths import TESTS

# Of pytest; of hypothesis, whose machines assert; of the oracle's cases.
EXPECTED = {"raises", "warns", "run_state_machine_as_test", "check"}


def calls(function: ast.FunctionDef) -> set[str]:
    """Names of functions and methods, without what they belong to; "assert" for the statement."""
    found = set()
    for node in ast.walk(function):
        if isinstance(node, ast.Assert):
            found.add("assert")
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name | ast.Attribute):
            found.add(node.func.id if isinstance(node.func, ast.Name) else node.func.attr)
    return found


def functions(tree: ast.Module) -> dict[str, set[str]]:
    """What each function and method calls. Methods with the same name count as one."""
    found: dict[str, set[str]] = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef):
            found.setdefault(node.name, set()).update(calls(node))
    return found


def imports(tree: ast.Module) -> set[str]:
    return {alias.name for node in tree.body if isinstance(node, ast.ImportFrom) for alias in node.names}


def asserting(own: Mapping[str, set[str]], imported: set[str]) -> set[str]:
    """Names of those that assert. own: what each calls. imported: names of others that assert."""
    known, before = {"assert", *EXPECTED, *imported}, set[str]()
    while known != before:
        before = set(known)
        known |= {
            name for name, called in own.items() if called & known or any(each.startswith("assert_") for each in called)
        }
    return known


def without_assertion(trees: Mapping[Path, ast.Module]) -> list[str]:
    own = {path: functions(tree) for path, tree in trees.items()}
    is_test = {path: path.name.startswith("test_") for path in trees}
    shared = set().union(*(asserting(own[path], set()) for path in trees if not is_test[path]))
    return [
        f"{path.name}: {name}"
        for path, tree in trees.items()
        if is_test[path]
        for name in sorted(own[path].keys() - asserting(own[path], imports(tree) & shared))
        if name.startswith("test_")
    ]


@pytest.mark.long
def test_every_test_asserts() -> None:
    trees = {path: ast.parse(path.read_text(encoding="utf-8")) for path in sorted(TESTS.rglob("*.py"))}
    assert without_assertion(trees) == []
