"""The layering of the code: who may know whom, one file for one thing, no file too long to read."""

from __future__ import annotations

import ast
import functools
import re
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

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
    "plotly": "drawing/interactive.py",
    "PIL": "drawing/raster.py",
    "rich": "cli/console.py",
    "dask": "tasks/jobs.py",
    "distributed": "tasks/jobs.py",
}
COMMANDS = {
    "cli/program.py",
    "cli/calibrate.py",
    "cli/campaign.py",
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
# those that draw, and what they share
DRAWING = {
    "drawing/panels.py",
    "drawing/plot_style.py",
    "report/plots.py",
    "report/score_plots.py",
    "report/tune_plots.py",
}


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


def test_only_exports_are_relative_imports() -> None:
    relative = {
        module.name
        for module in MODULES
        for node in ast.walk(ast.parse(module.read_text(encoding="utf-8")))
        if isinstance(node, ast.ImportFrom) and node.level
    }
    assert relative <= {"__init__.py"}


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


@pytest.mark.parametrize("module", sorted(DRAWING))
def test_drawing_computes_nothing(module: str) -> None:
    """It draws arrays that others made: no numpy mathematics, no model, no files of numbers."""
    allowed = {
        "matplotlib",
        "__future__",
        "collections",
        "pathlib",
        "typing",
        "numpy",
        "tendonfmu",
        "io",
        "contextlib",
        "dataclasses",
        "math",
        "textwrap",
        "warnings",
    }
    names = set(imports_of(ast.parse((PACKAGE / module).read_text(encoding="utf-8"))))
    assert {name.split(".")[0] for name in names} <= allowed
    assert not {
        name
        for name in names
        if name.startswith(("tendonfmu.model.native", "tendonfmu.fmu.fmpy_client", "tendonfmu.recordings.recording"))
    }


def test_native_knows_no_other_part() -> None:
    names = set(imports_of(ast.parse((PACKAGE / "model/native.py").read_text(encoding="utf-8"))))
    own = {name for name in names if name.startswith("tendonfmu.")}
    assert all(
        name.startswith(("tendonfmu._native", "tendonfmu.arrays", "tendonfmu.errors", "tendonfmu.model.signals"))
        for name in own
    ), own


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
                    f"{file.name}: {name}" for angle, name in includes_of(file) if not angle and name not in allowed
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


def test_core_includes_only_what_stands_above_it() -> None:
    assert len(CORE) > 20
    assert is_ordered(ROOT / "runtime", CORE, {"tendonfmu.h"}) == []


def test_description_includes_only_what_stands_above_it() -> None:
    known = {"tendonfmu.h", "tendonfmu_description.h", "core_inside.h"}
    assert is_ordered(ROOT / "runtime" / "description", DESCRIPTION, known) == []


def test_estimation_includes_only_what_stands_above_it() -> None:
    """It stands on the core, inside included, and on nothing of the simulated finger."""
    assert len(ESTIMATION) > 10
    core = {Path(source).with_suffix(".h").name for source in CORE}
    known = core | {"tendonfmu.h", "core_inside.h", "tendonfmu_estimation.h", "tendonfmu_learner.h"}
    assert is_ordered(ROOT / "runtime" / "estimation", ESTIMATION, known) == []


def test_every_estimation_file_is_in_the_list() -> None:
    folder = ROOT / "runtime" / "estimation"
    listed = {(folder / source).with_suffix("") for source in ESTIMATION}
    files = {file.with_suffix("") for file in folder.rglob("*") if file.suffix in (".h", ".cpp")}
    assert files == listed


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


def test_core_and_fmu_do_without_the_estimation() -> None:
    runtime = ROOT / "runtime"
    headers = {file.name for file in (runtime / "estimation").glob("*.h")} | {
        "tendonfmu_estimation.h",
        "tendonfmu_learner.h",
    }
    others = [*(runtime / part for part in ("core", "description", "plant")), ROOT / "fmu_src"]
    sources = [file for folder in others for file in folder.rglob("*") if file.suffix in (".c", ".h", ".cpp")]
    sources += [runtime / "include" / name for name in ("tendonfmu.h", "tendonfmu_description.h", "tendonfmu_plant.h")]
    assert len(sources) > 100
    assert [f"{file.name}: {name}" for file in sources for _, name in includes_of(file) if name in headers] == []
    for cmake in (runtime / "CMakeLists.txt", *(folder / "CMakeLists.txt" for folder in others[1:])):
        assert "tendonfmu_estimation" not in cmake.read_text(encoding="utf-8"), cmake


def test_plant_includes_only_what_stands_above_it() -> None:
    assert len(PLANT) > 20
    assert is_ordered(ROOT / "runtime" / "plant", PLANT, KNOWN_TO_PLANT) == []


def test_every_plant_file_is_in_the_list() -> None:
    folder = ROOT / "runtime" / "plant"
    listed = {(folder / source).with_suffix("") for source in PLANT}
    files = {file.with_suffix("") for file in folder.rglob("*") if file.suffix in (".h", ".cpp")}
    assert files == listed


def test_plant_and_model_share_no_header() -> None:
    """The model is judged against the simulated finger: neither sees the other; no header name stands in both."""
    runtime = ROOT / "runtime"
    plant = {file.name for file in (runtime / "plant").glob("*.h")} | {"tendonfmu_plant.h"}
    model = {file.name for part in ("core", "description") for file in (runtime / part).rglob("*.h")} | {"tendonfmu.h"}
    assert len(plant) > 15
    assert len(model) > 30
    assert plant & model == set()
    wrong = [
        f"{file.relative_to(runtime).as_posix()}: {name}"
        for part, others in (("core", plant), ("description", plant), ("plant", model - KNOWN_TO_PLANT))
        for file in sorted((runtime / part).rglob("*"))
        if file.suffix in (".c", ".h", ".cpp")
        for _, name in includes_of(file)
        if Path(name).name in others
    ]
    assert wrong == []


@pytest.mark.parametrize(
    ("library", "users"),
    [
        (r"(cvode|nvector|sundials|sunlinsol|sunmatrix)/", {"cvode_integrator", "newton_solver", "sundials_version"}),
        (r"Eigen/", {"dynamics", "linearisation", "rig_checks"}),
    ],
)
def test_only_these_plant_files_know(library: str, users: set[str]) -> None:
    found = {
        file.stem
        for file in (ROOT / "runtime" / "plant").glob("*")
        if file.suffix in (".h", ".cpp") and any(angle and re.match(library, name) for angle, name in includes_of(file))
    }
    assert found == users


def test_the_order_test_sees_a_wrong_include(tmp_path: Path) -> None:
    (tmp_path / "low.c").write_text('#include "high.h"\n', encoding="utf-8")
    (tmp_path / "high.c").write_text('#include "high.h"\n', encoding="utf-8")
    assert is_ordered(tmp_path, ["low.c", "high.c"], set()) == ["low.c: high.h"]
    (tmp_path / "low.c").write_text('#include "low.h"\n', encoding="utf-8")
    assert is_ordered(tmp_path, ["low.c", "high.c"], set()) == []


def test_every_core_file_is_in_the_list() -> None:
    folder = ROOT / "runtime" / "core"
    listed = {(ROOT / "runtime" / source).with_suffix("") for source in CORE}
    files = {file.with_suffix("") for file in folder.rglob("*") if file.suffix in (".c", ".h")}
    assert files == listed


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
    sources = sorted(folder.glob("*.[ch]"))
    assert len(sources) > 10
    wrong = [
        f"{file.name}: {name}"
        for file in sources
        for angle, name in includes_of(file)
        if not angle and name not in own | outside
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


def test_the_core_knows_nothing_of_fmi() -> None:
    for file in (ROOT / "runtime" / "core").rglob("*.[ch]"):
        assert not re.search(r"fmi[23]|fmu_src", file.read_text(encoding="utf-8")), file.name


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
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=False)
    if listed.returncode != 0:
        pytest.skip("SKIPPED: not a git work tree")
    return [name for name in listed.stdout.split("\0") if name and (ROOT / name).is_file()]


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


def test_names_say_what_they_hold() -> None:
    vague = re.compile(r"(^|_)(utils?|helpers?|manager|misc|common)(\.|_|$)")
    assert [name for name in tracked() if any(vague.search(part) for part in Path(name).parts)] == []


@pytest.mark.parametrize(
    "path",
    [
        "README.md",
        "LICENSE",
        "CMakeLists.txt",
        "run",
        "test",
        "pyproject.toml",
        "requirements.lock",
        "modelDescription",
        "fmu_src",
        "runtime/CMakeLists.txt",
        "runtime/include/tendonfmu.h",
        "runtime/core",
        "runtime/core/kernel/README.md",
        "runtime/description",
        "runtime/tests",
        "bench",
        "python/tendonfmu",
        "python_tests/support/oracle.py",
        "examples/fingers/index_finger.json",
        "docs",
    ],
)
def test_the_layout_is_there(path: str) -> None:
    assert (ROOT / path).exists()


def test_the_oracle_is_for_tests_alone() -> None:
    users = [
        name
        for name in tracked()
        if name.startswith("python/") and "oracle" in (ROOT / name).read_text(encoding="utf-8", errors="replace")
    ]
    assert users == []


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
