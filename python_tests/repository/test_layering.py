"""The layering of the code: who may know whom, one file for one thing, no file too long to read."""

from __future__ import annotations

import ast
import functools
import re
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from optional_parts import require
from repository_paths import ROOT

PACKAGE = ROOT / "python" / "tendonfmu"
MODULES = sorted(PACKAGE.rglob("*.py"))
LONGEST = 500  # lines; a file that fits in a head
INCLUDE = re.compile(r'^\s*#\s*include\s*([<"])([^>"]+)[>"]', re.MULTILINE)
C_LIBRARY = {
    "assert.h",
    "errno.h",
    "float.h",
    "limits.h",
    "math.h",
    "stddef.h",
    "stdint.h",
    "stdio.h",
    "stdlib.h",
    "string.h",
}
# what a kernel or a platform needs beyond C, and the only files that may
BEYOND_C = {
    "processor.h": {"cpuid.h", "intrin.h"},
    "quad_sse2.h": {"emmintrin.h"},
    "quad_avx2.h": {"immintrin.h"},
    "resource.c": {"windows.h"},
    "of_cpp.c": {"pthread.h", "sched.h"},
}

# --- Python: one module for each thing --------------------------------------------------------------------------------

ONLY = {
    "fmpy": "fmu/fmpy_client.py",
    "mujoco": "mjcf/compiled_model.py",
    "tendonfmu._native": "model/native.py",
    "tendonfmu._plant": "simulate/plant.py",
    "tendonfmu._estimation": "estimate/estimation.py",
    "plotly": "drawing/figures.py",
    "PIL": "drawing/finger_picture.py",
    "rerun": "report/rerun_recording.py",
    "rich": "cli/console.py",
    "dask": "tasks/jobs.py",
    "distributed": "tasks/jobs.py",
}
COMMANDS = {
    "cli/program.py",
    "cli/calibrate.py",
    "cli/check.py",
    "cli/command.py",
    "cli/convert.py",
    "cli/demo.py",
    "cli/detect.py",
    "cli/diagnose.py",
    "cli/excite.py",
    "cli/fit.py",
    "cli/import_mjcf.py",
    "cli/run.py",
}  # what a user may call
DRAWING = {"drawing/png.py"}


def imports_of(tree: ast.AST) -> Iterator[str]:
    """Full names of what a module imports, also inside functions; `from tendonfmu import x` counts as tendonfmu.x.

    A package's exports, its only relative imports, do not count.
    """
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


@functools.cache
def names_by_module() -> dict[str, tuple[str, ...]]:
    """What each module imports."""
    return {
        module.relative_to(PACKAGE).as_posix(): tuple(imports_of(ast.parse(module.read_text(encoding="utf-8"))))
        for module in MODULES
    }


def users_of(library: str) -> set[str]:
    return {
        module
        for module, names in names_by_module().items()
        for name in names
        if name == library or name.startswith(f"{library}.")
    }


def test_the_package_is_imported_by_absolute_names() -> None:
    """The rules look at `from tendonfmu.PACKAGE import NAME`; only exports are relative."""
    escaping = {
        module.relative_to(PACKAGE).as_posix()
        for module in MODULES
        for node in ast.walk(ast.parse(module.read_text(encoding="utf-8")))
        if (isinstance(node, ast.ImportFrom) and node.level > (module.name == "__init__.py"))
        or (isinstance(node, ast.Import) and any(alias.name.startswith("tendonfmu.") for alias in node.names))
    }
    assert escaping == set()


@pytest.mark.parametrize("library", ONLY)
def test_one_module_imports(library: str) -> None:
    assert users_of(library) == {ONLY[library]}


def test_commands_are_in_few_modules() -> None:
    assert users_of("typer") == COMMANDS


def test_few_modules_draw() -> None:
    assert users_of("matplotlib") == DRAWING


def test_few_modules_print() -> None:
    printing = set()
    for module in MODULES:
        for node in ast.walk(ast.parse(module.read_text(encoding="utf-8"))):
            calls_print = isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "print"
            takes_stream = isinstance(node, ast.Attribute) and node.attr in ("stdout", "stderr")
            if calls_print or takes_stream:
                printing.add(module.relative_to(PACKAGE).as_posix())
    assert printing == {"cli/program.py", "cli/console.py"}


# What draws takes arrays that others made. Of the model it has what an FMU's picture consists of, and numpy is its only
# mathematics. The binding knows the names of signals alone.
FEW_IMPORTS = {
    "drawing/*.py": (
        r"tendonfmu\.(arrays|drawing|errors|files|lazy_exports"
        r"|model\.(DrawnTendon|EDGE_RED|FingerDrawing|TENDON_COLOURS)$)"
    ),
    "report/*_figures.py": (
        r"tendonfmu\.(arrays|detect|diagnosis|drawing|estimate|files|report|statistics"
        r"|model\.part_of$|recordings\.flagged_stretches$)"
    ),
    "model/native.py": r"tendonfmu\.(_native|arrays|errors|model\.output_names)",
}
MATHEMATICS = {"pandas", "pyarrow", "scipy", "sklearn", "statistics"}


@pytest.mark.parametrize("modules", FEW_IMPORTS)
def test_what_draws_computes_nothing_and_the_binding_stands_below_the_model(modules: str) -> None:
    names = {
        (module, name)
        for module, imported in names_by_module().items()
        if Path(module).match(modules)
        for name in imported
    }
    assert names
    wrong = {
        (module, name)
        for module, name in names
        if name.split(".")[0] in MATHEMATICS
        or (name.split(".")[0] == "tendonfmu" and not re.match(FEW_IMPORTS[modules], name))
    }
    assert wrong == set()


# --- C and C++: the source lists are the architecture -----------------------------------------------------------------


def listed_sources(cmake: Path, opening: str) -> list[str]:
    """Files of a CMake list, in order; comments are dropped."""
    text = re.sub(r"#.*", "", cmake.read_text(encoding="utf-8"))
    match = re.search(re.escape(opening) + r"([^)]*)\)", text)
    assert match, opening
    return [word for word in match[1].split() if re.search(r"\.(c|h|cpp)$", word)]


def includes_of(file: Path) -> list[tuple[bool, str]]:
    """(in angle brackets, name) of each include."""
    return [(mark == "<", name) for mark, name in INCLUDE.findall(file.read_text(encoding="utf-8"))]


HEADERS = {file.name for part in ("runtime", "fmu_src") for file in (ROOT / part).rglob("*.h")}


def is_ordered(folder: Path, sources: list[str], known: set[str]) -> list[str]:
    """Includes of headers that belong to files further down the list, or to none. known: headers from outside."""
    wrong: list[str] = []
    allowed = set(known)
    for source in sources:
        path = folder / source
        own = [path] if path.suffix == ".h" else [path.with_suffix(".h"), path]
        allowed |= {each.name for each in own}
        for file in own:
            if file.exists():
                wrong += [
                    f"{file.name}: {name}"
                    for angle, name in includes_of(file)
                    if name not in allowed and (not angle or Path(name).name in HEADERS)
                ]
    return wrong


CORE = listed_sources(ROOT / "runtime" / "CMakeLists.txt", "set(TENDONFMU_CORE_SOURCES")
DESCRIPTION = listed_sources(
    ROOT / "runtime" / "description" / "CMakeLists.txt", "add_library(tendonfmu_description STATIC"
)
ESTIMATION = listed_sources(ROOT / "runtime" / "estimation" / "CMakeLists.txt", "set(TENDONFMU_ESTIMATION_SOURCES")
PLANT = listed_sources(ROOT / "runtime" / "plant" / "CMakeLists.txt", "set(TENDONFMU_PLANT_SOURCES")
# all that the simulated finger may know of the rest
KNOWN_TO_PLANT = {
    "tendonfmu_plant.h",
    "tendonfmu_description.h",
    "json_document.h",
    "json_node.h",
    "description_error.h",
}


# folder -> its list, and the headers that it may include from outside
PARTS = {
    "core": (CORE, {"tendonfmu.h"}),
    "description": (DESCRIPTION, {"tendonfmu.h", "tendonfmu_description.h", "core_inside.h"}),
    "estimation": (
        ESTIMATION,
        {Path(source).with_suffix(".h").name for source in CORE}
        | {"tendonfmu.h", "core_inside.h", "tendonfmu_estimation.h", "tendonfmu_learner.h"},
    ),
    "plant": (PLANT, KNOWN_TO_PLANT),
}


@pytest.mark.parametrize("part", PARTS)
def test_a_source_includes_only_what_stands_above_it(part: str) -> None:
    sources, known = PARTS[part]
    folder = ROOT / "runtime" if part == "core" else ROOT / "runtime" / part
    assert is_ordered(folder, sources, known) == []
    listed = {(folder / source).with_suffix("") for source in sources}
    files = [file for file in (ROOT / "runtime" / part).rglob("*") if file.suffix in (".c", ".h", ".cpp")]
    assert {file.with_suffix("") for file in files} - {ROOT / "runtime/description/core_inside"} == listed


BEYOND_CORE = r"tendonfmu_(estimation|learner|plant)|runtime/(estimation|plant)"
# Sources and lists of CMake, and what none of them names: neither included nor linked.
STRANGERS = {
    # printf and scanf allocate in small C libraries
    "runtime/core/**/*.[ch]": rf"fmi[23]|fmu_src|printf *\(|scanf *\(|{BEYOND_CORE}",
    "runtime/CMakeLists.txt": rf"fmu_src|{BEYOND_CORE}",
    "runtime/description/*": BEYOND_CORE,
    "runtime/plant/*": r"tendonfmu_(estimation|learner)|tendonfmu_core|runtime/(core|estimation)|\.\./core",
    "runtime/include/tendonfmu.h*": BEYOND_CORE,
    "runtime/include/tendonfmu_[dors]*": BEYOND_CORE,  # description, outputs, result, span
    "runtime/include/tendonfmu_plant.h": r'#include "',
    "fmu_src/*.[ch]": BEYOND_CORE,
    "fmu_src/CMakeLists.txt": r"tendonfmu_(estimation|learner)",
    "fmu_src/plant_fmu/*": r"tendonfmu_(estimation|learner)",
}


@pytest.mark.parametrize("files", STRANGERS)
def test_core_and_fmu_do_without_estimation_and_plant(files: str) -> None:
    texts = {file.name: file.read_text(encoding="utf-8") for file in ROOT.glob(files) if file.is_file()}
    assert texts
    assert {name: match[0] for name, text in texts.items() if (match := re.search(STRANGERS[files], text))} == {}


def test_kernels_for_one_processor_share_no_inline_function() -> None:
    """Of an inline function in two sources the linker keeps one, for all processors: none from another header.

    test_installed_library.py looks at what the compiler made of them.
    """
    folder = ROOT / "runtime" / "estimation"
    kernels = sorted(folder.glob("*_avx*.cpp"))
    own = {file.name for file in folder.glob("symmetric_update*.h")}
    assert len(kernels) >= 1
    for file in kernels:  # portable_lanes.h, with the C library, is for the others
        assert "#define TENDONFMU_OWN_LANES\n" in file.read_text(encoding="utf-8"), file.name
    found = {name for file in (*kernels, *(folder / name for name in own)) for _, name in includes_of(file)}
    assert found <= {"immintrin.h", "cstddef", "portable_lanes.h"} | own


def test_plant_and_model_share_no_header() -> None:
    """The model is judged against the simulated finger; a header of one name in both could be taken for the other."""
    runtime = ROOT / "runtime"
    plant = {file.name for file in (runtime / "plant").glob("*.h")}
    model = {file.name for part in ("core", "description") for file in (runtime / part).rglob("*.h")}
    assert plant & model == set()


@pytest.mark.parametrize("part", ["runtime/core", "fmu_src"])
def test_c_needs_the_c_library_alone(part: str) -> None:
    wrong = [
        f"{file.name}: <{name}>"
        for file in sorted((ROOT / part).rglob("*.[ch]"))
        for angle, name in includes_of(file)
        if angle and name not in C_LIBRARY | BEYOND_C.get(file.name, set())
    ]
    assert wrong == []


def test_the_fmu_knows_fmi_and_the_c_interface_only() -> None:
    folder = ROOT / "fmu_src"
    own = {file.name for file in folder.glob("*.h")}
    outside = {"fmi2Functions.h", "fmi3Functions.h", "tendonfmu.h", "variable_table.h"}
    formatter = {("log.c", "message.h")}  # the one inner header of the core: numbers in lines, without the heap
    sources = sorted(folder.glob("*.[ch]"))
    assert len(sources) > 10
    wrong = [
        f"{file.name}: {name}"
        for file in sources
        for angle, name in includes_of(file)
        if not angle and name not in own | outside and (file.name, name) not in formatter
    ]
    assert wrong == []


def test_only_the_files_of_a_version_of_fmi_know_it() -> None:
    """What both versions do is in files that know neither."""
    folder = ROOT / "fmu_src"
    users = {
        (file.name, name)
        for file in (*folder.glob("*.[ch]"), *folder.glob("plant_fmu/*.[ch]"))
        for _, name in includes_of(file)
        if re.match(r"fmi[23]", name) and not (folder / name).exists()
    }
    assert {name for file, name in users if file.startswith("fmi2_")} == {"fmi2Functions.h"}
    assert {name for file, name in users if file.startswith("fmi3_")} == {"fmi3Functions.h"}
    assert [file for file, _ in users if not re.match(r"fmi[23]_", file)] == []


def test_only_the_description_reader_knows_json() -> None:
    users = {
        file.relative_to(ROOT).parts[:2]
        for folder in ("runtime", "fmu_src")
        for file in (ROOT / folder).rglob("*")
        if file.suffix in (".c", ".h", ".cpp") and any("nlohmann" in name for _, name in includes_of(file))
    }
    assert users - {("runtime", "tests"), ("runtime", "fuzz")} == {("runtime", "description")}


# --- the repository ---------------------------------------------------------------------------------------------------


def tracked() -> list[str]:
    require("git")
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=False)
    return [name for name in listed.stdout.split("\0") if name and (ROOT / name).is_file()]


TESTS = {file.stem for file in (ROOT / "python_tests").rglob("*.py")} - {"__init__"}
SIMULATORS = {file.stem for file in (ROOT / "python_tests" / "support").glob("*.py")}  # and what they are made of


@pytest.mark.parametrize(
    ("files", "strangers"),
    [
        ("python/**/*.py", TESTS | {"evidence", "python_tests"}),
        ("examples/**/*.py", (TESTS - SIMULATORS) | {"python_tests"}),
        ("evidence/**/*.py", (TESTS - SIMULATORS) | {"python_tests"}),
        ("python_tests/support/oracle*.py", {"evidence", "tendonfmu"}),  # the oracle judges them
    ],
)
def test_nothing_imports_tests_and_the_oracle_nothing_that_it_judges(files: str, strangers: set[str]) -> None:
    wrong = [
        f"{file.relative_to(ROOT)}: {name}"
        for file in ROOT.glob(files)
        for name in imports_of(ast.parse(file.read_text(encoding="utf-8")))
        if name.split(".")[0] in strangers
    ]
    assert wrong == []


def lines_of(file: Path) -> int:
    """Lines of a source; of Python without docstrings, whose lists of parameters are read apart from the code."""
    text = file.read_text(encoding="utf-8")
    count = len(text.splitlines())
    if file.suffix != ".py" or count <= LONGEST:
        return count
    with_docstring = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, with_docstring) and ast.get_docstring(node) is not None:
            count -= (node.body[0].end_lineno or 0) - node.body[0].lineno + 1
    return count


def test_no_source_is_too_long() -> None:
    code = [
        name
        for name in tracked()
        if Path(name).suffix in (".c", ".h", ".cpp", ".hpp", ".py", ".pyi", ".sh", ".cmake", ".jinja")
    ]
    lengths = {name: lines_of(ROOT / name) for name in code}
    assert {name: length for name, length in lengths.items() if length > LONGEST} == {}


QUAD_ACCESS = r"\b(?:quad_load|quad_store)\({name}\b|\btendon_sum\([^;()]*\b{name}\b"  # 32 bytes at once


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
    assert unaligned("void f(void) {\n  _Alignas(32) double a[8];\n  quad_store(a + i, x);\n}\n") == []
    kernel = ROOT / "runtime" / "core" / "kernel"
    assert {file.name: names for file in kernel.glob("*.h") if (names := unaligned(file.read_text()))} == {}
