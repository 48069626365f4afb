"""The C sources in an FMU: complete, all compiled, linked beside those of another finger, and the same bits.

FMI2_FUNCTION_PREFIX is for programs that are linked with several FMUs: no name of one may meet a name of another.
"""

from __future__ import annotations

import html
import json
import re
import shutil
import struct
import subprocess
import sys
import zipfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from xml.etree import ElementTree

import pytest

from fmi2_headers import FMPY_HEADERS, NAMES, write_headers
from fmu_binary import FINGER, OK, Instance, UnpackedFmu, fmi_platform, motion, unpack
from repository_paths import ROOT, TESTS

sys.path.insert(0, str(ROOT / "fmu_src" / "source_fmu"))

from collect_sources import external_names

SAMPLES, STEP = 60, 0.002
LAW = {"static": 0.02, "coulomb": 0.01, "stribeck_velocity": 0.01}
# Another finger than FINGER, with an effect beyond the paper.
OTHER = {
    "format": "tendonfmu-finger-1",
    "name": "other finger",
    "joints": [{"cover": {"stiffness": 0.03}, "friction": LAW}],
    "tendons": [{"stiffness": 3e3, "moment_arms": [0.011], "edge_friction": [LAW]}],
    "contact": {"threshold": [0.02]},
    "extensions": [{"effect": "cover_hardening", "joint": 1, "stiffness": 0.1}],
}

needs_tools = pytest.mark.skipif(
    sys.platform != "linux" or not all(map(shutil.which, ("cc", "nm"))), reason="SKIPPED: needs Linux, cc and nm"
)


def run(*command: str | Path) -> str:
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True, check=False)
    assert done.returncode == 0, f"{' '.join(map(str, command))}\n{done.stdout}\n{done.stderr}"
    return done.stdout


@pytest.fixture(scope="module")
def fingers(tmp_path_factory: pytest.TempPathFactory) -> list[UnpackedFmu]:
    from tendonfmu.fmu.packaging import build_fmu

    folder = tmp_path_factory.mktemp("fingers")
    found = []
    for k, description in enumerate((FINGER, OTHER)):
        (folder / f"{k}.json").write_text(json.dumps(description))
        found.append(unpack(build_fmu(folder / f"{k}.json", folder / f"{k}.fmu"), folder / str(k)))
    return found


# --- what is in -------------------------------------------------------------------------------------------------------


def test_all_files_are_listed_and_none_is_of_fmi(fingers: list[UnpackedFmu]) -> None:
    """FMI 2.0.5, section 2.3: the importer has the headers of FMI; its own may differ."""
    folder = fingers[0].folder
    element = ElementTree.parse(folder / "modelDescription.xml").getroot().find("CoSimulation")
    assert element is not None
    present = {path.name for path in (folder / "sources").iterdir()}
    assert {file.attrib["name"] for file in element.iter("File")} == {n for n in present if n.endswith(".c")}
    assert not present & set(NAMES)
    for name in sorted(present - {"CMakeLists.txt"}):
        text = (folder / "sources" / name).read_text()
        assert set(re.findall(r'#include "([^"]+)"', text)) <= present | set(NAMES), name


@needs_tools
@pytest.mark.parametrize("fmi", [2, 3])
def test_the_caller_of_the_documentation_compiles(tmp_path: Path, fmi: int) -> None:
    """With the prefix on the function that it calls; warnings are errors."""
    from tendonfmu.fmu.packaging import members
    from tendonfmu.model import read_finger

    (tmp_path / "other.json").write_text(json.dumps(OTHER))
    page = members(read_finger(tmp_path / "other.json"), fmi=fmi)["documentation/index.html"].decode()
    (caller,) = re.findall(r'<pre id="caller">(.*?)</pre>', page, re.DOTALL)
    (tmp_path / "caller.c").write_text(html.unescape(caller))
    headers = write_headers(tmp_path / "headers") if fmi == 2 else FMPY_HEADERS
    options = ("-std=c11", "-Wall", "-Wextra", "-Werror", f"-I{headers}")
    run("cc", *options, "-c", tmp_path / "caller.c", "-o", tmp_path / "caller.o")
    called = run("nm", "-u", "--format=just-symbols", tmp_path / "caller.o").split()
    assert [name for name in called if "fmi" in name] == [
        f"other_finger_fmi{fmi}Instantiate" + ("CoSimulation" if fmi == 3 else "")
    ]
    assert defined(tmp_path / "caller.o") == {"create_other_finger"}


@pytest.mark.parametrize(
    ("code", "names"),
    [
        ("int plain(void);", {"plain"}),
        (
            "/* int x(void); */ double* pointer(int a) {\n  if (a) { return 0; }\n}\nint next(void) { }",
            {"pointer", "next"},
        ),
        ('extern "C" {\nextern const row table[3][COUNT];\n}', {"table"}),
        ("const row table[] = {\n  {1, f(2)},\n};\nint after;", {"table", "after"}),
        ("static int own(void) { return 0; }\nHOT_INLINE int hot(void) { return 0; }", set()),
        ("typedef struct a { int b; } a;\nstruct c { int d; };\nenum { E = 1 };\nenum e { F };\nstruct g;", set()),
        ('#define MACRO(x) \\\n  int x(void);\nconst char* text = "int in_text(void);";', {"text"}),
    ],
)
def test_external_names_of_c(code: str, names: set[str]) -> None:
    assert external_names(code) == names


# --- compiled ---------------------------------------------------------------------------------------------------------


def compile_sources(fmu: UnpackedFmu, folder: Path, *options: str) -> list[Path]:
    """Objects of all C files, as a shell's *.c finds them, without a flag that the results might need."""
    folder.mkdir()
    sources = sorted((fmu.folder / "sources").glob("*.c"))
    objects = [folder / f"{source.stem}.o" for source in sources]
    with ThreadPoolExecutor(2) as pool:
        list(pool.map(lambda s, o: run("cc", "-O0", *options, "-c", s, "-o", o), sources, objects))
    return objects


def defined(*files: Path) -> set[str]:
    """External names of objects and archives."""
    lines = run("nm", "-g", "--defined-only", "--format=just-symbols", *files).split()
    return {line for line in lines if not line.endswith(":")}


def exported(library: Path) -> list[str]:
    return run("nm", "-D", "--defined-only", "--format=just-symbols", library).split()


def exports_fmi_alone(library: Path) -> bool:
    return len(exported(library)) == 44 and all(name.startswith("fmi2") for name in exported(library))


def write_samples(fmu: UnpackedFmu, path: Path) -> None:
    """The file that portable/driver.c reads."""
    names = fmu.names("input"), fmu.names("output"), fmu.names("output", "Boolean")
    lines = [f"{len(some):x} {' '.join(f'{fmu.variables[name].vr:x}' for name in some)}" for some in names]
    lines += [f"{SAMPLES:x}"]
    for k in range(SAMPLES):
        sample = motion(fmu, k * STEP)
        numbers = [k * STEP, *(float(sample[name]) for name in names[0])]
        lines.append(" ".join(struct.pack(">d", number).hex() for number in numbers))
    path.write_text("\n".join(lines) + "\n")


def bits_of_binary(fmu: UnpackedFmu) -> list[str]:
    """What the driver prints, from the FMU's binary."""
    rows = []
    with Instance(fmu) as instance:
        for k in range(SAMPLES):
            if k == 0:
                instance.initialise(motion(fmu, 0.0))
            else:
                before = (k - 1) * STEP
                assert instance.step(before, k * STEP - before) == OK
                assert instance.set_real(motion(fmu, k * STEP)) == OK
            numbers = [struct.pack(">d", number).hex() for number in instance.get_real(fmu.names("output"))]
            flags = instance.get_integers(fmu.names("output", "Boolean"), "Boolean")
            rows.append(" ".join([*numbers, *map(str, flags)]))
    return rows


MAIN = "int left_main(int, char**); int right_main(int, char**);" + (
    "int main(int n, char** a) { return n != 9 || left_main(5, a) || right_main(5, a + 4); }"
)


def compile_with_prefix(fmu: UnpackedFmu, side: str, folder: Path) -> list[str | Path]:
    """Objects of the sources and of the driver that calls them; every name begins with the prefix."""
    headers = write_headers(folder / f"headers_{side}")
    prefix = f"-DFMI2_FUNCTION_PREFIX={side}_"
    objects = compile_sources(fmu, folder / side, prefix, f"-I{headers}")
    names = defined(*objects)
    assert len(names) > 200 and [name for name in names if not name.startswith(f"{side}_")] == []
    driver = folder / f"{side}.o"
    run("cc", f"-I{headers}", prefix, f"-Dmain={side}_main", "-c", TESTS / "portable" / "driver.c", "-o", driver)
    return [*objects, driver]


def arguments_of(fmu: UnpackedFmu, samples: Path) -> list[str | Path]:
    write_samples(fmu, samples)
    return ["linked", fmu.guid, (fmu.folder / "resources").as_uri(), samples]


@pytest.mark.long
@needs_tools
def test_two_fingers_in_one_program(fingers: list[UnpackedFmu], tmp_path: Path) -> None:
    parts: list[str | Path] = []
    arguments: list[str | Path] = []
    expected: list[str] = []
    for side, fmu in zip(("left", "right"), fingers, strict=True):
        parts += compile_with_prefix(fmu, side, tmp_path)
        arguments += arguments_of(fmu, tmp_path / f"{side}.txt")
        expected += bits_of_binary(fmu)
    (tmp_path / "main.c").write_text(MAIN)
    run("cc", tmp_path / "main.c", *parts, "-o", tmp_path / "program", "-lm")
    printed = run(tmp_path / "program", *arguments).splitlines()
    assert [line.strip() for line in printed] == expected
    assert len(set(expected)) > SAMPLES  # both move


def moves_like(fmu: UnpackedFmu, library: Path, folder: Path) -> bool:
    """Whether another library in the FMU's place gives the same bits."""
    shutil.copytree(fmu.folder, folder, ignore=shutil.ignore_patterns("sources", "binaries"))
    place = folder / "binaries" / fmi_platform()
    place.mkdir(parents=True)
    shutil.copy(library, place)
    return bits_of_binary(UnpackedFmu(folder)) == bits_of_binary(fmu)


def built_by_cmake(fmu: UnpackedFmu, folder: Path, *options: str) -> Path:
    shutil.copytree(fmu.folder, folder)
    run("cmake", "-S", folder / "sources", "-B", folder / "build", *options)
    run("cmake", "--build", folder / "build", "--config", "Release")
    (library,) = [path for path in (folder / "build").iterdir() if path.stem == fmu.binary.stem]
    return library


@needs_tools
@pytest.mark.long
def test_cmake_builds_both_kinds_of_library(fingers: list[UnpackedFmu], tmp_path: Path) -> None:
    fmu = fingers[0]
    headers = write_headers(tmp_path / "headers")
    shared = built_by_cmake(fmu, tmp_path / "shared", f"-DFMI_HEADERS={headers}")
    assert exports_fmi_alone(shared)
    assert moves_like(fmu, shared, tmp_path / "shared_fmu")
    static = built_by_cmake(fmu, tmp_path / "static", f"-DFMI_HEADERS={headers}", "-DBUILD_SHARED_LIBS=OFF")
    names = defined(static)
    assert len(names) > 200 and all(name.startswith("small_finger_") for name in names)


@needs_tools
@pytest.mark.long
def test_fmpy_compiles_them(fingers: list[UnpackedFmu], tmp_path: Path) -> None:
    fmu = fingers[0]
    with zipfile.ZipFile(tmp_path / "finger.fmu", "w") as archive:
        for path in sorted(fmu.folder.rglob("*")):
            if path.is_file() and "binaries" not in path.parts:
                archive.write(path, path.relative_to(fmu.folder))
    run(sys.executable, "-m", "fmpy", "compile", tmp_path / "finger.fmu")
    compiled = unpack(tmp_path / "finger.fmu", tmp_path / "compiled")
    assert exports_fmi_alone(compiled.binary)
    assert bits_of_binary(compiled) == bits_of_binary(fmu)
