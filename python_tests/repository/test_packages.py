"""The packages of `tendonfmu`: dependence goes one way, and nobody reaches into another package's inside."""

from __future__ import annotations

import ast
import graphlib
from functools import cache
from pathlib import Path

import pytest

from repository_paths import ROOT

PACKAGE = ROOT / "python" / "tendonfmu"
MODULES = sorted(PACKAGE.rglob("*.py"))

# Who may know whom: a package knows those before it, itself, and `errors`.
PACKAGES = (
    "files",
    "tasks",
    "statistics",
    "model",
    "drawing",
    "recordings",
    "estimate",
    "excite",
    "fmu",
    "simulate",
    "mjcf",
    "detect",
    "diagnosis",
    "report",
    "calibration",
    "interface",
    "hand",
    "demo",
    "cli",
)


# the package itself, errors, and the compiled modules, each of which test_layering.py leaves to one file
OF_ALL = {"", "arrays", "errors", "fault_report", "lazy_exports", "options", "_native", "_plant", "_estimation"}


def package_of(module: Path) -> str:
    return module.relative_to(PACKAGE).parts[0] if module.parent != PACKAGE else ""


@cache
def imported_modules(module: Path) -> tuple[tuple[str, str], ...]:
    """(module without "tendonfmu.", name) of each import from within the product, also late and type-only ones."""
    return tuple(
        (node.module.partition(".")[2], alias.name)
        for node in ast.walk(ast.parse(module.read_text(encoding="utf-8")))
        if isinstance(node, ast.ImportFrom) and node.module and node.module.split(".")[0] == "tendonfmu"
        for alias in node.names
    )


def exports(package: str) -> dict[str, str]:
    """Name -> module that holds it, of a package's exports; a module itself has the name of its package's part."""
    package_file = ast.parse((PACKAGE / package / "__init__.py").read_text(encoding="utf-8"))
    return {
        alias.name: ".".join(filter(None, (package, node.module or alias.name)))
        for node in ast.walk(package_file)
        if isinstance(node, ast.ImportFrom) and node.level
        for alias in node.names
    }


def test_every_package_has_its_level() -> None:
    folders = {path.parent.name for path in PACKAGE.glob("*/__init__.py")}
    assert folders == set(PACKAGES)


@pytest.mark.parametrize("package", PACKAGES)
def test_a_package_knows_only_those_below_it(package: str) -> None:
    allowed = {*PACKAGES[: PACKAGES.index(package) + 1], *OF_ALL}
    above = {
        f"{module.relative_to(PACKAGE)}: {name}"
        for module in MODULES
        if package_of(module) == package
        for name, _ in imported_modules(module)
        if name.split(".")[0] not in allowed
    }
    assert above == set()


def test_nobody_imports_a_package_s_inside() -> None:
    """Others import `from tendonfmu.PACKAGE import NAME`, and the package exports NAME."""
    wrong = {
        f"{module.relative_to(PACKAGE)}: {source}.{name}"
        for module in MODULES
        for source, name in imported_modules(module)
        if source.split(".")[0] in PACKAGES
        and source.split(".")[0] != package_of(module)
        and ("." in source or (source != "cli" and name not in exports(source)))
    }
    assert wrong == set()


def public_names() -> set[tuple[str, str]]:
    """(package, name) of what `tendonfmu` itself exports."""
    stub = ast.parse((PACKAGE / "__init__.pyi").read_text(encoding="utf-8"))
    return {
        (str(node.module), alias.name)
        for node in ast.walk(stub)
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }


def test_no_public_name_is_that_of_a_package() -> None:
    """The first import of a package would put it in the place of the name."""
    assert {name for _, name in public_names()} & set(PACKAGES) == set()


def test_packages_export_what_others_use_and_nothing_else() -> None:
    public = public_names()
    for package in PACKAGES[:-1]:
        others = {name for source, name in public if source == package} | {
            name
            for module in MODULES
            if package_of(module) != package
            for source, name in imported_modules(module)
            if source == package
        }
        assert set(exports(package)) == others, package


def test_no_circle_of_modules() -> None:
    known: dict[str, set[str]] = {}
    for module in MODULES:
        name = ".".join(module.relative_to(PACKAGE).with_suffix("").parts).removesuffix(".__init__")
        if module.name == "__init__.py":
            continue
        found = known.setdefault(name, set())
        for source, part in imported_modules(module):
            top = source.split(".")[0]
            inside = top == package_of(module)
            part_is_module = (PACKAGE / source.replace(".", "/") / f"{part}.py").exists()
            found.add(f"{source}.{part}" if inside and part_is_module else source)
    in_order = tuple(graphlib.TopologicalSorter(known).static_order())  # raises CycleError
    assert known.keys() <= set(in_order)
