"""Who may know whom: Python packages by contracts of import-linter (pyproject.toml), C and C++ by lists of sources."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from pathlib import Path

import pytest

from repository_paths import ROOT

PACKAGE = ROOT / "python" / "tendonfmu"
RUNTIME = ROOT / "runtime"
INCLUDE = re.compile(r'^\s*#\s*include\s*([<"])([^>"]+)[>"]', re.MULTILINE)
C_LIBRARY = {
    f"{name}.h"
    for name in ["assert", "errno", "float", "limits", "math", "stddef", "stdint", "stdio", "stdlib", "string"]
}
# what a kernel or a platform needs beyond C, and the only files that may
BEYOND_C = {
    "processor.h": {"cpuid.h", "intrin.h"},
    "message.h": {"stdarg.h"},
    "resource.c": {"windows.h"},
    "of_cpp.c": {"pthread.h", "sched.h"},
}

# --- Python -----------------------------------------------------------------------------------------------------------


def imports_of(module: Path) -> list[tuple[str, str]]:
    """(module, name) of each `from MODULE import NAME`, also inside functions."""
    return [
        (node.module or "", alias.name)
        for node in ast.walk(ast.parse(module.read_text(encoding="utf-8")))
        if isinstance(node, ast.ImportFrom) and node.level == 0
        for alias in node.names
    ]


def test_the_contracts_of_import_linter_hold() -> None:
    program = "import sys; from importlinter.cli import lint_imports_command as lint; sys.exit(lint())"
    done = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout


def test_each_compiled_module_has_one_user() -> None:
    users = {
        (each.group(1), module.relative_to(PACKAGE).as_posix())
        for module in PACKAGE.rglob("*.py")
        for source, name in imports_of(module)
        if (each := re.match(r"tendonfmu\.(_native|_plant|_estimation)\b", f"{source}.{name}"))
    }
    assert users == {
        ("_native", "model/native.py"), ("_plant", "simulate/plant.py"), ("_estimation", "estimate/estimation.py"),
    }  # fmt: skip


def test_nobody_imports_a_package_s_inside() -> None:
    """Others import `from tendonfmu.PACKAGE import NAME`, and the package exports NAME."""
    packages = {path.parent.name for path in PACKAGE.glob("*/__init__.py")} - {"commands"}
    wrong = [
        f"{module.relative_to(PACKAGE)}: {source}"
        for module in PACKAGE.rglob("*.py")
        for source, _ in imports_of(module)
        if (parts := source.split("."))[0] == "tendonfmu" and len(parts) > 2
        if parts[1] in packages and parts[1] != module.relative_to(PACKAGE).parts[0]
    ]
    assert wrong == []


def test_the_oracle_imports_nothing_that_it_judges() -> None:
    oracle = list((ROOT / "python_tests" / "support").glob("oracle*.py"))
    assert oracle
    assert {source.split(".")[0] for file in oracle for source, _ in imports_of(file)} & {
        "tendonfmu",
        "evidence",
    } == set()


# --- C and C++: the source lists are the architecture -----------------------------------------------------------------


def listed_sources(cmake: str, opening: str) -> list[str]:
    """Files of a CMake list, in order; comments are dropped."""
    text = re.sub(r"#.*", "", (RUNTIME / cmake).read_text(encoding="utf-8"))
    match = re.search(re.escape(opening) + r"([^)]*)\)", text)
    assert match, opening
    return [word for word in match[1].split() if re.search(r"\.(c|h|cpp)$", word)]


def includes_of(file: Path) -> list[tuple[bool, str]]:
    """(in angle brackets, name) of each include."""
    return [(mark == "<", name) for mark, name in INCLUDE.findall(file.read_text(encoding="utf-8"))]


CORE = listed_sources("CMakeLists.txt", "set(TENDONFMU_CORE_SOURCES")
CORE_HEADERS = {Path(source).with_suffix(".h").name for source in CORE}
# part -> its list, and the headers that it may include from outside
PARTS = {
    "core": (CORE, {"tendonfmu.h"}),
    "description": (
        listed_sources("description/CMakeLists.txt", "add_library(tendonfmu_description STATIC"),
        {"tendonfmu.h", "tendonfmu_description.h", "core_inside.h"},
    ),
    "estimation": (
        listed_sources("estimation/CMakeLists.txt", "set(TENDONFMU_ESTIMATION_SOURCES"),
        CORE_HEADERS | {"tendonfmu.h", "core_inside.h", "tendonfmu_estimation.hpp"},
    ),
    # The model is judged against the simulated finger: they share the reader of JSON, a hash and nothing else.
    "plant": (
        listed_sources("plant/CMakeLists.txt", "set(TENDONFMU_PLANT_SOURCES"),
        {"tendonfmu_plant.h", "tendonfmu_description.h", "json_node.h", "description_error.h", "bytes.h"},
    ),
}
HEADERS = {file.name for part in ("runtime", "fmu_src") for file in (ROOT / part).rglob("*.h")}


@pytest.mark.parametrize("part", PARTS)
def test_a_source_includes_only_what_stands_above_it(part: str) -> None:
    sources, allowed = PARTS[part]
    folder = RUNTIME if part == "core" else RUNTIME / part
    wrong = []
    for source in sources:
        path = folder / source
        own = [path] if path.suffix == ".h" else [path.with_suffix(".h"), path]
        allowed = allowed | {each.name for each in own}
        for file in filter(Path.exists, own):
            outside = [name for angle, name in includes_of(file) if not angle or Path(name).name in HEADERS]
            wrong += [f"{file.name}: {name}" for name in outside if name not in allowed]
    assert wrong == []
    listed = {(folder / source).with_suffix("") for source in sources}
    files = [file for file in (RUNTIME / part).rglob("*") if file.suffix in (".c", ".h", ".cpp")]
    assert {file.with_suffix("") for file in files} - {RUNTIME / "description/core_inside"} == listed


@pytest.mark.parametrize("part", ["runtime/core", "fmu_src"])
def test_c_needs_the_c_library_alone(part: str) -> None:
    """printf and scanf allocate in small C libraries: the core formats numbers itself."""
    files = sorted((ROOT / part).rglob("*.[ch]"))
    allowed = {file.name: C_LIBRARY | BEYOND_C.get(file.name, set()) for file in files}
    wrong = [
        (file.name, name)
        for file in files
        for angle, name in includes_of(file)
        if angle and name not in allowed[file.name]
    ]
    core = [
        file.name
        for file in files
        if part == "runtime/core" and re.search(r"(printf|scanf) *\(", file.read_text("utf-8"))
    ]
    assert (wrong, core) == ([], [])


def test_the_fmu_knows_fmi_and_the_c_interface_only() -> None:
    """What both versions of FMI do is in files that know neither."""
    folder = ROOT / "fmu_src"
    own = {file.name for file in folder.glob("*.h")}
    for file in folder.glob("*.[ch]"):
        outside = {name for angle, name in includes_of(file) if not angle} - own
        of_fmi = {f"fmi{version}Functions.h" for version in (2, 3) if file.name.startswith(f"fmi{version}_")}
        # the inner headers of the core: numbers in lines, without the heap, and numbers in bytes
        inner = {"log.h": "message.h", "states.c": "bytes.h"}.get(file.name)
        assert outside <= {
            "tendonfmu.h",
            "variable_table.h",
            *of_fmi,
            *([inner] if inner else []),
        }, file


def test_kernels_for_one_processor_share_no_inline_function() -> None:
    """Of an inline function in two sources the linker keeps one, for all processors: none from another header."""
    folder = RUNTIME / "estimation"
    kernels, own = sorted(folder.glob("*_avx*.cpp")), {file.name for file in folder.glob("products*.h")}
    assert kernels
    for file in kernels:
        assert re.search(r"#define Eigen (?!Eigen\b)\w+\n#include", file.read_text(encoding="utf-8")), file.name
    found = {name for file in (*kernels, *(folder / name for name in own)) for _, name in includes_of(file)}
    assert found <= {"cstddef", "Eigen/Core"} | own


QUAD_ACCESS = r"\b(?:quad_load|quad_store)\({name}\b|\bmultiply\([^;()]*\b{name}\b"  # 32 bytes at once


def unaligned(text: str) -> list[str]:
    """Local arrays that quads are loaded from and that are not declared as aligned to 32 bytes."""
    found = []
    for body in re.split(r"^\}", text, flags=re.MULTILINE):
        for declared in re.findall(r"^ +double ([^;]*\[[^;]*);", body, re.MULTILINE):
            names = re.findall(r"(\w+)\[", declared)
            found += [name for name in names if re.search(QUAD_ACCESS.format(name=name), body)]
    return found


def test_quads_are_loaded_from_aligned_arrays() -> None:
    """Compilers align a large array when they optimise; without that, an aligned load of another one is a fault."""
    assert unaligned("void f(void) {\n  double a[8], b[8];\n  quad_store(a + i, quad_load(c));\n}\n") == ["a"]
    files = (RUNTIME / "core").rglob("*.[ch]")
    assert {file.name: names for file in files if (names := unaligned(file.read_text()))} == {}
