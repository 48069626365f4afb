"""Clients of the FMU beside fmpy, in both versions of FMI: programs in C, with the binary and with the sources, and
foreign masters. Each gets the same bits. Those that are not installed are skipped (`cargo install fmi-sim`)."""

from __future__ import annotations

import csv
import html
import json
import math
import re
import shutil
import sys
import zipfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import fmpy
import numpy as np
import pytest

from c_driver import SAMPLES, STEP, arguments, compile_driver, moving, printed, rows, run, write_samples
from fmi2_headers import FMPY_HEADERS, write_headers
from fmu_binary import FINGER, UnpackedFmu, fmi_platform, unpack
from optional_parts import require
from repository_paths import ROOT
from tendonfmu.fmu import build_fmu
from tendonfmu.fmu.packaging import members
from tendonfmu.model import read_finger

sys.path.insert(0, str(ROOT / "fmu_src" / "source_fmu"))

from collect_sources import external_names

needs_compiler = pytest.mark.skipif(
    sys.platform != "linux" or not all(map(shutil.which, ("cc", "nm"))), reason="SKIPPED: needs Linux, cc and nm"
)


@pytest.mark.parametrize(
    ("code", "names"),
    [
        ("int plain(void);", {"plain"}),
        (
            "/* int x(void); */ double* pointer(int a) {\n  if (a) { return 0; }\n}\nint next(void) { }",
            {"pointer", "next"},
        ),
        ("const row table[] = {\n  {1, f(2)},\n};\nint after;", {"table", "after"}),
        ("_Alignas(32) const double aligned[4] = {f(1)};", {"aligned"}),
        ("static int own(void) { return 0; }\nHOT_INLINE int hot(void) { return 0; }", set()),
        ('#define MACRO(x) \\\n  int x(void);\nconst char* text = "int in_text(void);";', {"text"}),
    ],
)
def test_external_names_of_c(code: str, names: set[str]) -> None:
    """Those that a source FMU gives the prefix of its finger."""
    assert external_names(code) == names


# --- a program in C ---------------------------------------------------------------------------------------------------


@needs_compiler
def test_a_program_that_loads_the_library(small: UnpackedFmu, tmp_path: Path) -> None:
    driver = compile_driver(small, tmp_path / "driver")
    samples = write_samples(small, tmp_path / "samples.txt", moving(small))
    lines = run(driver, small.binary, *arguments(small, samples)).splitlines()
    assert [line.strip() for line in lines] == printed(small)
    assert len(set(lines)) == SAMPLES - 1  # it moves; the first step takes the first sample again


@needs_compiler
def test_a_master_in_c_goes_on_after_bad_samples(small: UnpackedFmu, tmp_path: Path) -> None:
    """It repeats a discarded step with the inputs that it had before: the same bits as if these had been sent."""
    driver = compile_driver(small, tmp_path / "driver")
    sent = [(time, list(inputs)) for time, inputs in moving(small)]
    held = [(time, list(inputs)) for time, inputs in sent]
    for k, at, value in ((7, 0, math.nan), (8, 3, math.inf), (30, 2, -1e300)):
        sent[k][1][at] = value
        held[k] = (held[k][0], held[k - 1][1])
    done = [run(driver, small.binary, *arguments(small, write_samples(small, tmp_path / "samples.txt", sent)))]
    assert [line.strip() for line in done[0].splitlines()] == printed(small, held)


@needs_compiler
def test_the_caller_of_the_documentation_compiles(small: UnpackedFmu, tmp_path: Path) -> None:
    """With the prefix on the function that it calls; warnings are errors."""
    page = members(read_finger(FINGER), fmi=small.version)["documentation/index.html"].decode()
    (caller,) = re.findall(r'<pre id="caller">(.*?)</pre>', page, re.DOTALL)
    (tmp_path / "caller.c").write_text(html.unescape(caller))
    headers = write_headers(tmp_path / "headers") if small.version == 2 else FMPY_HEADERS
    options = "-std=c11", "-Wall", "-Wextra", "-Werror", f"-I{headers}"
    run("cc", *options, "-c", tmp_path / "caller.c", "-o", tmp_path / "caller.o")
    called = run("nm", "-u", "--format=just-symbols", tmp_path / "caller.o").split()
    expected = f"small_finger_fmi{small.version}Instantiate" + ("CoSimulation" if small.version == 3 else "")
    assert [name for name in called if "fmi" in name] == [expected]


# --- sources ----------------------------------------------------------------------------------------------------------


def test_all_sources_are_listed_and_none_is_of_fmi(small: UnpackedFmu) -> None:
    """FMI 2.0.5, section 2.3: the importer has the headers of FMI; its own may differ."""
    folder = small.folder / "sources"
    present = {path.name for path in folder.iterdir()}
    xml = small.folder / "modelDescription.xml" if small.version == 2 else folder / "buildDescription.xml"
    files = ElementTree.parse(xml).getroot().iter("File" if small.version == 2 else "SourceFile")
    assert {file.attrib["name"] for file in files} == {name for name in present if name.endswith(".c")}
    headers = ("FunctionTypes", "Functions", "TypesPlatform", "PlatformTypes")
    of_fmi = {f"fmi{small.version}{name}.h" for name in headers}
    assert not present & of_fmi
    for path in folder.glob("*.[ch]"):
        assert set(re.findall(r'#include "([^"]+)"', path.read_text())) <= present | of_fmi, path.name


def defined(*files: Path) -> list[str]:
    """External names of objects and archives."""
    lines = run("nm", "-g", "--defined-only", "--format=just-symbols", *files).split()
    return [line for line in lines if not line.endswith(":")]


def compile_with_prefix(fmu: UnpackedFmu, side: str, folder: Path) -> list[Path]:
    """Objects of all C files, without a flag that the results might need, and of the driver that calls them."""
    headers = write_headers(folder / f"headers_{side}") if fmu.version == 2 else FMPY_HEADERS
    options = "-O0", f"-DFMI{fmu.version}_FUNCTION_PREFIX={side}_", f"-I{headers}"
    (folder / side).mkdir()
    sources = sorted((fmu.folder / "sources").glob("*.c"))
    objects = [folder / side / f"{source.stem}.o" for source in sources]
    with ThreadPoolExecutor(2) as pool:
        list(pool.map(lambda s, o: run("cc", *options, "-c", s, "-o", o), sources, objects))
    names = defined(*objects)
    assert len(names) > 200 and [name for name in names if not name.startswith(f"{side}_")] == []
    driver = folder / f"{side}.o"
    compile_driver(fmu, driver, "-c", f"-Dmain={side}_main", *options[1:])
    return [*objects, driver]


@pytest.mark.long
@needs_compiler
def test_both_versions_linked_into_one_program(small_fmu: UnpackedFmu, small_fmu3: UnpackedFmu, tmp_path: Path) -> None:
    """By FMI's prefix before all names, as for programs of several FMUs."""
    parts: list[Path] = []
    words: list[str | Path] = []
    for side, fmu in (("left", small_fmu), ("right", small_fmu3)):
        parts += compile_with_prefix(fmu, side, tmp_path)
        words += ["linked", *arguments(fmu, write_samples(fmu, tmp_path / f"{side}.txt", moving(fmu)))]
    (tmp_path / "main.c").write_text(
        "int left_main(int, char**); int right_main(int, char**);"
        "int main(int n, char** a) { return n != 9 || left_main(5, a) || right_main(5, a + 4); }"
    )
    run("cc", tmp_path / "main.c", *parts, "-o", tmp_path / "program", "-lm")
    lines = run(tmp_path / "program", *words).splitlines()
    assert [line.strip() for line in lines] == printed(small_fmu) + printed(small_fmu3)


@pytest.mark.long
@needs_compiler
def test_cmake_builds_both_kinds_of_library(small_fmu: UnpackedFmu, tmp_path: Path) -> None:
    headers, libraries = write_headers(tmp_path / "headers"), []
    for name, shared in (("shared", "ON"), ("static", "OFF")):
        shutil.copytree(small_fmu.folder, tmp_path / name)
        build, options = tmp_path / name / "build", (f"-DFMI_HEADERS={headers}", f"-DBUILD_SHARED_LIBS={shared}")
        run("cmake", "-S", tmp_path / name / "sources", "-B", build, *options)
        run("cmake", "--build", build, "--config", "Release")
        libraries += [path for path in build.iterdir() if path.stem == small_fmu.binary.stem]
    shared_one, static_one = libraries
    assert all(name.startswith("small_finger_") for name in defined(static_one)) and len(defined(static_one)) > 200
    shutil.copy(shared_one, tmp_path / "shared" / "binaries" / fmi_platform() / small_fmu.binary.name)
    assert rows(UnpackedFmu(tmp_path / "shared")) == rows(small_fmu)


@pytest.mark.long
def test_fmpy_compiles_the_sources(small: UnpackedFmu, tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "finger.fmu", "w") as archive:
        for path in sorted(small.folder.rglob("*")):
            if path.is_file() and "binaries" not in path.relative_to(small.folder).parts:
                archive.write(path, path.relative_to(small.folder))
    run(sys.executable, "-m", "fmpy", "compile", tmp_path / "finger.fmu")
    compiled = unpack(tmp_path / "finger.fmu", tmp_path / "compiled")
    exported = run("nm", "-D", "--defined-only", "--format=just-symbols", compiled.binary).split()
    assert len(exported) == {2: 44, 3: 75}[small.version]
    assert all(name.startswith(f"fmi{small.version}") for name in exported)
    assert rows(compiled) == rows(small)


# --- foreign masters of FMI 3.0: one that knows arrays, two that take an array of one element for a scalar ------------


def test_in_a_container(small_fmu3: UnpackedFmu, small_fmu3_path: Path, tmp_path: Path) -> None:
    """Of the FMU Manipulation Toolbox: an FMU in C that loads and steps others."""
    shutil.copy(small_fmu3_path, tmp_path / "small_finger.fmu")
    (tmp_path / "box.csv").write_text("rule;from_fmu;from_port;to_fmu;to_port\nFMU;small_finger.fmu;;;\n")
    program = Path(require("fmutool")).with_name("fmucontainer")
    run(program, "-container", f"box.csv:{STEP!r}", "-fmi", "3", cwd=tmp_path)

    def simulated(path: Path) -> Any:
        signals = np.zeros(SAMPLES, dtype=[("time", float), ("tendon_force", float, (3,))])
        signals["time"] = STEP * np.arange(SAMPLES)
        signals["tendon_force"] = 5.0 + np.sin(9.0 * signals["time"])[:, None]
        names = small_fmu3.whole([*small_fmu3.names("output"), *small_fmu3.names("output", "Boolean")])
        options = {"step_size": STEP, "output_interval": STEP, "stop_time": SAMPLES * STEP}
        return fmpy.simulate_fmu(str(path), validate=False, input=signals, output=names, **options)

    found, expected = simulated(tmp_path / "box.fmu"), simulated(small_fmu3_path)
    assert found.dtype == expected.dtype and found.tobytes() == expected.tobytes()
    assert len(np.unique(found["joint_torque"][:, 0])) > 0.9 * SAMPLES


@pytest.fixture(scope="module")
def one_joint(tmp_path_factory: pytest.TempPathFactory) -> dict[int, Path]:
    """FMUs by version of FMI of a finger with one joint and one tendon: every array has one element."""
    folder = tmp_path_factory.mktemp("one_joint")
    finger = FINGER | {
        "joints": FINGER["joints"][:1],
        "tendons": [{**FINGER["tendons"][1], "moment_arms": [0.008]}],
        "contact": {"threshold": [0.03]},
    }
    (folder / "finger.json").write_text(json.dumps(finger))
    return {fmi: build_fmu(folder / "finger.json", folder / f"{fmi}.fmu", fmi=fmi) for fmi in (2, 3)}


def test_ecos(one_joint: dict[int, Path]) -> None:
    ecospy = require("ecos")
    found = {}
    for fmi, index in ((2, "[1]"), (3, "")):
        structure = ecospy.EcosSimulationStructure()
        structure.add_model("finger", str(one_joint[fmi]))
        with ecospy.EcosSimulation(structure=structure, step_size=STEP) as simulation:
            simulation.init()
            found[fmi] = []
            for k in range(SAMPLES):
                simulation.set_real(f"finger::tendon_force{index}", 5.0 + 0.1 * k)
                simulation.set_real(f"finger::tendon_position{index}", 0.001 * (k % 13))
                simulation.step()
                found[fmi].append(simulation.get_real(f"finger::compensated_torque{index}"))
    assert found[2] == found[3] and len(set(found[2])) > 0.9 * SAMPLES


@pytest.mark.long
def test_fmi_sim(one_joint: dict[int, Path], tmp_path: Path) -> None:
    """fmi-sim 0.7.0: its reader refuses these three attributes of a Float64, so they are left out."""
    program, found = require("fmi-sim"), {}
    for fmi, index in ((2, "[1]"), (3, "")):
        fmu, samples, out = (tmp_path / f"{fmi}.{suffix}" for suffix in ("fmu", "in.csv", "out.csv"))
        with zipfile.ZipFile(one_joint[fmi]) as given, zipfile.ZipFile(fmu, "w") as archive:
            for name in given.namelist():
                data = given.read(name)
                if name == "modelDescription.xml" and fmi == 3:
                    data = re.sub(rb' (unit|displayUnit|nominal)="[^"]*"', b"", data)
                archive.writestr(name, data)
        lines = [f"time,tendon_force{index},tendon_position{index}"]
        lines += [f"{k * STEP},{5.0 + 0.1 * k},{0.001 * (k % 13)}" for k in range(SAMPLES + 1)]
        samples.write_text("\n".join(lines) + "\n")
        options = ("-s", "0", "-f", f"{SAMPLES * STEP}", "--step", f"{STEP}", "--output-interval", f"{STEP}")
        run(program, "--model", fmu, "-i", samples, "-o", out, "co-simulation", *options)
        with out.open(newline="") as file:
            header, *found[fmi] = csv.reader(file)
        assert header[1] == f"compensated_torque{index}"
    assert found[2] == found[3] and len({row[1] for row in found[2]}) > 0.8 * SAMPLES
