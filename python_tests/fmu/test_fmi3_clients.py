"""Foreign clients of FMI 3.0: each gets the bits that the FMU of FMI 2.0 gives.

- a program in C, compiled against the official headers: with the binary, and linked with the sources
- fmpy, with the binary and with what it compiles
- a container of the FMU Manipulation Toolbox
- ecos and fmi-sim (Rust), which know scalars only

Those that are not installed are skipped. `cargo install fmi-sim`; TENDONFMU_FMI_SIM names the program where it is not
on the path.
"""

from __future__ import annotations

import csv
import importlib.util
import json
import re
import shutil
import struct
import subprocess
import sys
import zipfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest

from fmi3_binary import UnpackedFmu3, fmi3_platform, unpack3
from fmu_binary import FINGER, OK, Instance, UnpackedFmu, motion
from optional_parts import require
from repository_paths import ROOT, TESTS

SAMPLES, STEP = 60, 1 / 512  # a step that is exact in binary: every client then adds up the same times
DRIVER = TESTS / "portable" / "driver_fmi3.c"
needs_compiler = pytest.mark.skipif(
    sys.platform != "linux" or shutil.which("cc") is None, reason="SKIPPED: needs Linux and a C compiler"
)


def headers() -> Path:
    spec = importlib.util.find_spec("fmpy")
    assert spec and spec.submodule_search_locations
    return Path(spec.submodule_search_locations[0]) / "c-code"


def run(*command: str | Path, **options: Any) -> str:
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True, check=False, **options)
    assert done.returncode == 0, f"{' '.join(map(str, command))}\n{done.stdout}\n{done.stderr}"
    return done.stdout


def rows_of_fmi2(fmu: UnpackedFmu) -> list[list[float]]:
    """Outputs after each step over `motion`: the sample at the beginning of the step."""
    rows = []
    with Instance(fmu) as instance:
        instance.initialise(motion(fmu, 0.0))
        rows.append(instance.outputs())
        for k in range(SAMPLES):
            assert instance.set_real(motion(fmu, k * STEP)) == OK
            assert instance.step(k * STEP, STEP) == OK
            rows.append(instance.outputs())
    return rows


@pytest.fixture(scope="module")
def expected(small_fmu: UnpackedFmu) -> list[list[float]]:
    rows = rows_of_fmi2(small_fmu)
    assert len({tuple(row) for row in rows}) == SAMPLES  # it moves; the first step takes the first sample again
    return rows


# --- C ----------------------------------------------------------------------------------------------------------------


def write_samples(fmu: UnpackedFmu3, fmu2: UnpackedFmu, path: Path) -> None:
    """The file that the driver reads. It steps to a sample, then writes it: one step behind `rows_of_fmi2`."""
    lines = []
    for names in (fmu.names("input"), fmu.names("output"), fmu.names("output", "Boolean")):
        variables = [fmu.variables[name] for name in names]
        lines.append(" ".join([f"{len(names):x}", *(f"{v.vr:x} {v.count:x}" for v in variables)]))
    lines.append(f"{SAMPLES:x}")
    for k in range(SAMPLES):
        inputs = motion(fmu2, k * STEP)
        numbers = [k * STEP, *(float(inputs[name]) for name in fmu.element_names(fmu.names("input")))]
        lines.append(" ".join(struct.pack(">d", number).hex() for number in numbers))
    path.write_text("\n".join(lines) + "\n")


def printed(rows: list[list[float]], numbers: int) -> list[str]:
    """The same rows as the driver prints them."""
    return [
        " ".join([*(struct.pack(">d", x).hex() for x in row[:numbers]), *(str(int(flag)) for flag in row[numbers:])])
        for row in rows
    ]


@needs_compiler
def test_a_program_in_c(
    small_fmu: UnpackedFmu, small_fmu3: UnpackedFmu3, expected: list[list[float]], tmp_path: Path
) -> None:
    run("cc", "-Wall", "-Wextra", "-Werror", "-isystem", headers(), DRIVER, "-o", tmp_path / "driver", "-ldl")
    write_samples(small_fmu3, small_fmu, tmp_path / "samples.txt")
    out = run(
        *(tmp_path / "driver", small_fmu3.binary, small_fmu3.token, small_fmu3.resources.decode()),
        tmp_path / "samples.txt",
    )
    numbers = small_fmu3.count(small_fmu3.names("output"))
    assert [line.strip() for line in out.splitlines()] == printed(expected[:1] + expected[1:-1], numbers)


@pytest.mark.long
@needs_compiler
@pytest.mark.slow
def test_a_program_linked_with_the_sources(
    small_fmu: UnpackedFmu, small_fmu3: UnpackedFmu3, expected: list[list[float]], tmp_path: Path
) -> None:
    """FMI3_FUNCTION_PREFIX before all names, as for programs of several FMUs; every C file, no flag of ours."""
    options = "-O0", "-DFMI3_FUNCTION_PREFIX=left_", f"-I{headers()}"
    sources = sorted((small_fmu3.folder / "sources").glob("*.c"))
    objects = [tmp_path / f"{source.stem}.o" for source in sources]
    with ThreadPoolExecutor(2) as pool:
        list(pool.map(lambda s, o: run("cc", *options, "-c", s, "-o", o), sources, objects))
    names = run("nm", "-g", "--defined-only", "--format=just-symbols", *objects).split()
    names = [name for name in names if not name.endswith(":")]
    assert len(names) > 200 and [name for name in names if not name.startswith("left_")] == []
    run("cc", *options, DRIVER, *objects, "-o", tmp_path / "driver", "-lm")
    write_samples(small_fmu3, small_fmu, tmp_path / "samples.txt")
    out = run(tmp_path / "driver", "linked", small_fmu3.token, small_fmu3.resources.decode(), tmp_path / "samples.txt")
    numbers = small_fmu3.count(small_fmu3.names("output"))
    assert [line.strip() for line in out.splitlines()] == printed(expected[:1] + expected[1:-1], numbers)


# --- fmpy -------------------------------------------------------------------------------------------------------------


def signals(fmu: UnpackedFmu3, fmu2: UnpackedFmu) -> Any:
    """Inputs as fmpy takes them: one column per array. fmpy 0.3.32 wants all of one size, so those of the tendons."""
    names = ("tendon_force", "tendon_position")
    columns = [(name, float, (fmu.variables[name].count,)) for name in names]
    found = np.zeros(SAMPLES + 1, dtype=[("time", float), *columns])
    for k in range(SAMPLES + 1):
        inputs = motion(fmu2, k * STEP)
        found["time"][k] = k * STEP
        for name in names:
            found[name][k] = [inputs[element] for element in fmu.element_names([name])]
    return found


def simulate(path: Path, fmu: UnpackedFmu3, fmu2: UnpackedFmu, validate: bool = True) -> list[list[float]]:
    names = [*fmu.names("output"), *fmu.names("output", "Boolean")]
    found = fmpy.simulate_fmu(
        str(path),
        validate=validate,
        input=signals(fmu, fmu2),
        output=names,
        step_size=STEP,
        output_interval=STEP,
        stop_time=SAMPLES * STEP,
    )
    return [[float(x) for name in names for x in np.ravel(found[name][k])] for k in range(len(found))]


def test_fmpy(
    small_fmu: UnpackedFmu, small_fmu3: UnpackedFmu3, small_fmu3_path: Path, expected: list[list[float]]
) -> None:
    assert simulate(small_fmu3_path, small_fmu3, small_fmu) == expected


def test_the_example_of_the_page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from tendonfmu.fmu import build_fmu

    build_fmu(ROOT / "examples" / "fingers" / "index_finger.json", tmp_path / "index_finger.fmu", fmi=3)
    (code,) = re.findall(r"```python\n(.*?)```", (ROOT / "docs/reference/fmi3.md").read_text(), re.DOTALL)
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {}
    exec(code, names)
    assert names["result"]["compensated_torque"].shape == (1000, 4)
    assert np.abs(names["result"]["joint_torque"]).max() > 0.01


@pytest.mark.long
def test_fmpy_compiles_the_sources(
    small_fmu: UnpackedFmu, small_fmu3_path: Path, expected: list[list[float]], tmp_path: Path
) -> None:
    compiled = tmp_path / "compiled.fmu"
    with zipfile.ZipFile(small_fmu3_path) as given, zipfile.ZipFile(compiled, "w") as archive:
        for name in given.namelist():
            if not name.startswith("binaries/"):
                archive.writestr(name, given.read(name))
    run(sys.executable, "-m", "fmpy", "compile", compiled)
    fmu = unpack3(compiled, tmp_path / "unpacked")
    assert fmu.binary.parent.name == fmi3_platform()
    names = run("nm", "-D", "--defined-only", "--format=just-symbols", fmu.binary).split()
    assert len(names) == 75 and all(name.startswith("fmi3") for name in names)
    assert simulate(compiled, fmu, small_fmu) == expected


# --- FMU Manipulation Toolbox -----------------------------------------------------------------------------------------


def toolbox(name: str) -> str:
    """A command of the Python package fmu-manipulation-toolbox, beside its `fmutool`."""
    return str(Path(require("fmutool")).with_name(name))


def test_fmutool_finds_nothing_to_complain_of(small_fmu3_path: Path) -> None:
    said = run(toolbox("fmutool"), "-input", small_fmu3_path, "-check")
    assert "This FMU seems to be compliant with FMI-3.0." in said
    assert "No semantic error against the FMI-3 standard." in said
    assert "ERROR" not in said and "WARNING" not in said


def test_in_a_container(
    small_fmu: UnpackedFmu,
    small_fmu3: UnpackedFmu3,
    small_fmu3_path: Path,
    expected: list[list[float]],
    tmp_path: Path,
) -> None:
    """The container is an FMU in C that loads and steps others: a client with arrays."""
    shutil.copy(small_fmu3_path, tmp_path / "small_finger.fmu")
    (tmp_path / "box.csv").write_text("rule;from_fmu;from_port;to_fmu;to_port\nFMU;small_finger.fmu;;;\n")
    run(toolbox("fmucontainer"), "-container", f"box.csv:{STEP!r}", "-fmi", "3", cwd=tmp_path)
    assert simulate(tmp_path / "box.fmu", small_fmu3, small_fmu, validate=False) == expected


# --- clients that take an array for a scalar -------------------------------------------------------------------------


@pytest.fixture(scope="module")
def one_joint(tmp_path_factory: pytest.TempPathFactory) -> dict[int, Path]:
    """FMUs by version of FMI of a finger with one joint and one tendon: every array has one element."""
    from tendonfmu.fmu import build_fmu

    folder = tmp_path_factory.mktemp("one_joint")
    finger = {
        **FINGER,
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
    program, rows = require("fmi-sim"), {}
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
            header, *rows[fmi] = csv.reader(file)
        assert header[1] == f"compensated_torque{index}"
    assert rows[2] == rows[3] and len({row[1] for row in rows[2]}) > 0.8 * SAMPLES
