"""The installed C library as another project takes it: find_package and pkg-config, after moving the folder."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import warnings
from collections.abc import Mapping
from pathlib import Path

import pandas as pd
import pytest

from fit_finger import made_recording, moved_start, write_recording
from optional_parts import needs, require
from repository_paths import ROOT, TESTS

FINGER = ROOT / "examples" / "fingers" / "index_finger.json"

CONSUMER = TESTS / "model" / "consumer"  # programs of another project
REFUSED = 'format = "tendonfmu-rig-0": expected "tendonfmu-rig-1"'
NO_IMAGE = 'not a model image: it does not begin with "TFMUIMG"'
# Optional parts: their header, their program, and what it prints.
PARTS = {
    "plant": ("tendonfmu_plant.h", "plant.c", REFUSED),
    "estimation": ("tendonfmu_estimation.hpp", "estimation.cpp", f"{NO_IMAGE}\n{NO_IMAGE}"),
}
needs_pkg_config = needs("pkg-config")


def call(*command: str | Path, env: Mapping[str, str] | None = None) -> str:
    result = subprocess.run(
        [str(part) for part in command], capture_output=True, text=True, env={**os.environ, **(env or {})}, check=False
    )
    assert result.returncode == 0, f"{command}\n{result.stdout}\n{result.stderr}"
    return result.stdout.strip()


def project_version() -> str:
    match = re.search(r"project\(tendonfmu VERSION (\S+)", (ROOT / "CMakeLists.txt").read_text(encoding="utf-8"))
    assert match
    return match[1]


@pytest.fixture(scope="module")
def prefix(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Built and installed, then moved: nothing in it may depend on where it was made. The build is that of ./test where
    there is one."""
    folder = tmp_path_factory.mktemp("library")
    build = ROOT / "build" / "tests"
    if not (build / "CMakeCache.txt").exists():
        build = folder / "build"
        options = ("-DCMAKE_INSTALL_LIBDIR=lib", "-DTENDONFMU_BUILD_TESTS=OFF", "-DTENDONFMU_BUILD_FMU=OFF")
        call("cmake", "-G", "Ninja", "-S", ROOT, "-B", build, *options)
    call("cmake", "--build", build, "--parallel", "2")
    call("cmake", "--install", build, "--prefix", folder / "made here")
    shutil.rmtree(folder / "build", ignore_errors=True)
    return (folder / "made here").rename(folder / "moved")


def has(prefix: Path, part: str) -> bool:
    """Whether an optional part was built: headers and library are installed together, or not at all."""
    there = (prefix / "lib" / f"libtendonfmu_{part}.a").exists()
    for file in (prefix / "include" / PARTS[part][0], prefix / "lib" / "pkgconfig" / f"tendonfmu-{part}.pc"):
        assert file.exists() == there
    return there


def configure(prefix: Path, build: Path, version: str) -> subprocess.CompletedProcess[str]:
    options = [f"-DCMAKE_PREFIX_PATH={prefix}", f"-DWANTED_VERSION={version}"]
    command = ["cmake", "-G", "Ninja", "-S", str(CONSUMER), "-B", str(build), *options]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_find_package_gives_the_libraries(prefix: Path, tmp_path: Path) -> None:
    configured = configure(prefix, tmp_path, project_version())
    assert configured.returncode == 0, configured.stderr
    call("cmake", "--build", tmp_path)
    assert call(tmp_path / "version") == project_version()
    assert call(tmp_path / "sizes", FINGER) == call(tmp_path / "cpp_sizes", FINGER) == "4 8"
    for part, (*_, printed) in PARTS.items():
        assert (tmp_path / part).exists() == has(prefix, part)
        assert not has(prefix, part) or call(tmp_path / part) == printed


def flags_of(prefix: Path, *modules: str) -> list[str]:
    search = {"PKG_CONFIG_PATH": str(prefix / "lib" / "pkgconfig")}
    for module in modules:
        assert call("pkg-config", "--modversion", module, env=search) == project_version()
    return call("pkg-config", "--cflags", "--libs", *modules, env=search).split()


@pytest.mark.long
@needs_pkg_config
@pytest.mark.parametrize(
    ("module", "source", "expected"),
    [
        ("tendonfmu", "version.c", project_version()),
        ("tendonfmu-description", "sizes.cpp", "4 8"),
        ("tendonfmu-description", "cpp_sizes.cpp", "4 8"),
        *((f"tendonfmu-{part}", program, printed) for part, (_, program, printed) in PARTS.items()),
    ],
)
def test_pkg_config(prefix: Path, tmp_path: Path, module: str, source: str, expected: str) -> None:
    part = module.removeprefix("tendonfmu-")
    if part in PARTS and not has(prefix, part):
        pytest.skip(f"SKIPPED: built without the {part}")
    compiler = "c++" if source.endswith(".cpp") else "cc"
    call(compiler, CONSUMER / source, "-o", tmp_path / "program", *flags_of(prefix, module))
    assert call(tmp_path / "program", FINGER) == expected


@needs_pkg_config
def test_the_program_of_the_page_learns_what_the_command_does(prefix: Path, tmp_path: Path) -> None:
    if not has(prefix, "estimation"):
        pytest.skip("SKIPPED: built without the estimation of parameters")
    from tendonfmu.estimate.fitting import FrictionFit

    page = (ROOT / "docs" / "reference" / "commands" / "fit.md").read_text(encoding="utf-8")
    (code,) = re.findall(r"```cpp\n(.*?)```", page, re.DOTALL)
    (tmp_path / "learn.cpp").write_text(code, encoding="utf-8")
    (tmp_path / "finger.json").write_text(json.dumps(moved_start()), encoding="utf-8")
    made = made_recording(duration=10.0)
    made.groups.pop("external_torque", None)  # the program takes none
    recording = write_recording(made, tmp_path / "recording.csv")
    flags = flags_of(prefix, "tendonfmu-estimation", "tendonfmu-description")
    call("c++", "-std=c++17", "-Wall", "-Wextra", "-Werror", tmp_path / "learn.cpp", "-o", tmp_path / "learn", *flags)
    lines = [line.split() for line in call(tmp_path / "learn", tmp_path / "finger.json", recording).splitlines()]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        options = {"passes": 1, "effective_samples": False, "prior": 1.0}
        fit = FrictionFit(tmp_path / "finger.json", method="ekf", **options).fit(recording)
    assert {path for path, *_ in lines} == set(fit.parameters_)
    for path, value, error in lines:
        assert float(value) == pytest.approx(fit.parameters_[path], rel=1e-8)
        assert float(error) == pytest.approx(fit.standard_errors_[path], rel=0.06)  # two digits


def test_kernels_for_one_processor_share_no_function(prefix: Path) -> None:
    """What they define weakly, the linker may give to sources for every processor."""
    archive = prefix / "lib" / "libtendonfmu_estimation.a"
    require("nm")
    assert archive.exists()
    symbols: dict[str, list[tuple[str, str]]] = {}
    for line in call("nm", archive).splitlines():
        if line.endswith(":"):
            member = symbols.setdefault(line[:-1], [])
        elif line:
            member.append((line.split()[-1], line.split()[-2]))
    kernels = [name for name in symbols if "_avx" in name]
    assert kernels
    # exceptions need one that holds an address
    weak = {name for member in kernels for name, kind in symbols[member] if kind in "WVu"}
    weak.discard("DW.ref.__gxx_personality_v0")
    assert weak
    assert [name for name in weak if "eigen_for_avx2" not in name] == []


def test_installed_text_names_no_folder_of_the_build(prefix: Path) -> None:
    texts = [p for p in prefix.rglob("*") if p.is_file() and p.suffix in {".cmake", ".pc", ".h", ".hpp"}]
    assert len(texts) >= 7
    assert [
        p.name for p in texts if str(ROOT) in p.read_text(encoding="utf-8") or "made here" in p.read_text("utf-8")
    ] == []


@pytest.fixture(scope="module")
def control_loop(prefix: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    build = tmp_path_factory.mktemp("loop")
    source = ROOT / "examples" / "cpp_control_loop"
    flags = "-DCMAKE_CXX_FLAGS=-Wall -Wextra -Werror"
    call("cmake", "-G", "Ninja", "-S", source, "-B", build, f"-DCMAKE_PREFIX_PATH={prefix}", flags)
    call("cmake", "--build", build)
    assert not (build / "tendonfmu").exists(), "the repository was taken in place of the installed library"
    return build / "control_loop"


def contacts(lines: str) -> tuple[list[float], list[float]]:
    """Times at which contact begins, and at which it ends."""
    found = [line.split() for line in lines.splitlines()]
    begins = [float(words[0]) for words in found if words[1:3] == ["s", "contact,"]]
    ends = [float(words[0]) for words in found if words[1:3] == ["s", "free"]]
    return begins, ends


def test_control_loop_of_the_examples_feels_the_pushes_of_the_demo_recording(
    control_loop: Path, tmp_path: Path
) -> None:
    folder = ROOT / "examples" / "demo_recording"
    recorded = pd.read_parquet(folder / "index_finger_pushes.parquet")
    pushed = recorded["contact"].to_numpy() > 0
    onsets = recorded["time"].to_numpy()[1:][pushed[1:] & ~pushed[:-1]] - recorded["time"][0]
    recorded.to_csv(tmp_path / "pushes.csv", index=False)
    calibrated = folder / "index_finger_calibrated.json"
    begins, _ = contacts(call(control_loop, calibrated, tmp_path / "pushes.csv", "--no-wait"))
    assert len(begins) == len(onsets) == 11
    # labels begin at 50 mN
    assert all(-0.02 <= begin - onset < 0.5 for begin, onset in zip(begins, onsets, strict=True))
