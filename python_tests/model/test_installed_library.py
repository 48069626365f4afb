"""The installed C library as another project takes it: find_package and pkg-config, after moving the folder."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import time
import warnings
from collections.abc import Callable, Mapping
from pathlib import Path

import pandas as pd
import pytest

from fit_finger import made_recording, moved_start, write_recording
from repository_paths import ROOT

pytestmark = pytest.mark.xdist_group("installed library")  # one worker builds for all of them

FINGER = ROOT / "examples" / "fingers" / "index_finger.json"

CONSUMER_CMAKE = """\
cmake_minimum_required(VERSION 3.22)
project(consumer LANGUAGES C CXX)
find_package(tendonfmu {version} REQUIRED)
add_executable(version version.c)
target_link_libraries(version PRIVATE tendonfmu::tendonfmu)
add_executable(sizes sizes.cpp)
target_link_libraries(sizes PRIVATE tendonfmu::description)
add_executable(cpp_sizes cpp_sizes.cpp)
target_link_libraries(cpp_sizes PRIVATE tendonfmu::description)
target_compile_features(cpp_sizes PRIVATE cxx_std_17)
if(TARGET tendonfmu::estimation)
  add_executable(estimation estimation.c)
  target_link_libraries(estimation PRIVATE tendonfmu::estimation)
  set_target_properties(estimation PROPERTIES LINKER_LANGUAGE CXX)
endif()
if(TARGET tendonfmu::plant)
  add_executable(plant plant.c)
  target_link_libraries(plant PRIVATE tendonfmu::plant)
  set_target_properties(plant PROPERTIES LINKER_LANGUAGE CXX)
endif()
"""

VERSION_C = """\
#include <stdio.h>
#include <tendonfmu.h>

int main(void) { return puts(tendonfmu_version()) < 0; }
"""

# Reads the rig, which takes the JSON readers, and would settle it, which takes SUNDIALS.
PLANT_C = """\
#include <stdio.h>
#include <string.h>
#include <tendonfmu_plant.h>

int main(void) {
  const char* rig = "{\\"format\\": \\"tendonfmu-rig-0\\"}";
  char message[512] = "";
  tendonfmu_plant* plant = tendonfmu_plant_create(rig, strlen(rig), message, sizeof message);
  if (plant) tendonfmu_plant_initialise(plant);
  tendonfmu_plant_destroy(plant);
  return puts(message) < 0;
}
"""

REFUSED = 'format = "tendonfmu-rig-0": expected "tendonfmu-rig-1"'

# Would estimate and learn, which takes Eigen and threads, if the image were one.
ESTIMATION_C = """\
#include <stdio.h>
#include <tendonfmu_estimation.h>
#include <tendonfmu_learner.h>

int main(void) {
  char fit[512] = "", learn[512] = "";
  tendonfmu_estimator* estimator = tendonfmu_estimator_create("x", 1, NULL, NULL, fit, sizeof fit);
  tendonfmu_learner* learner = tendonfmu_learner_create("x", 1, NULL, NULL, NULL, learn, sizeof learn);
  if (estimator) tendonfmu_estimator_fit(estimator, NULL, NULL, NULL, NULL, NULL);
  tendonfmu_estimator_destroy(estimator);
  tendonfmu_learner_destroy(learner);
  return puts(fit) < 0 || puts(learn) < 0;
}
"""

NO_IMAGE = 'not a model image: it does not begin with "TFMUIMG"'

SIZES_CPP = """\
#include <tendonfmu_description.h>

#include <fstream>
#include <iostream>
#include <iterator>
#include <string>

int main(int, char** arguments) {
  std::ifstream file(arguments[1]);
  const std::string json{std::istreambuf_iterator<char>(file), {}};
  char message[512] = "";
  void* image = nullptr;
  size_t size = 0;
  if (tendonfmu_image_from_json(json.data(), json.size(), &image, &size, message, sizeof message) != TENDONFMU_OK) {
    std::cerr << message << '\\n';
    return 1;
  }
  tendonfmu_finger* finger = tendonfmu_create(image, size, message, sizeof message);
  tendonfmu_free_image(image);
  if (!finger) return 1;
  std::cout << tendonfmu_joint_count(finger) << ' ' << tendonfmu_tendon_count(finger) << '\\n';
  tendonfmu_destroy(finger);
}
"""

# The C++ interface: no library of its own.
CPP_SIZES = """\
#include <fstream>
#include <iostream>
#include <iterator>
#include <string>
#include <tendonfmu.hpp>

int main(int, char** arguments) {
  std::ifstream file(arguments[1]);
  const std::string json{std::istreambuf_iterator<char>(file), {}};
  const tendonfmu::finger finger = tendonfmu::finger::from_json(json).value();
  std::cout << finger.joint_count() << ' ' << finger.tendon_count() << '\\n';
}
"""


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


def has_plant(prefix: Path) -> bool:
    """Whether the simulated finger was built: header and library are installed together, or not at all."""
    there = (prefix / "lib" / "libtendonfmu_plant.a").exists()
    assert (prefix / "include" / "tendonfmu_plant.h").exists() == there
    assert (prefix / "lib" / "pkgconfig" / "tendonfmu-plant.pc").exists() == there
    return there


def has_estimation(prefix: Path) -> bool:
    """Whether the estimation of parameters was built: headers and library are installed together, or not at all."""
    there = (prefix / "lib" / "libtendonfmu_estimation.a").exists()
    for name in ("tendonfmu_estimation.h", "tendonfmu_learner.h"):
        assert (prefix / "include" / name).exists() == there
    assert (prefix / "lib" / "pkgconfig" / "tendonfmu-estimation.pc").exists() == there
    return there


@pytest.fixture(scope="module")
def consumer(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("consumer")
    (folder / "CMakeLists.txt").write_text(CONSUMER_CMAKE.format(version=project_version()), encoding="utf-8")
    (folder / "version.c").write_text(VERSION_C, encoding="utf-8")
    (folder / "sizes.cpp").write_text(SIZES_CPP, encoding="utf-8")
    (folder / "cpp_sizes.cpp").write_text(CPP_SIZES, encoding="utf-8")
    (folder / "plant.c").write_text(PLANT_C, encoding="utf-8")
    (folder / "estimation.c").write_text(ESTIMATION_C, encoding="utf-8")
    return folder


def test_find_package_gives_the_libraries(prefix: Path, consumer: Path) -> None:
    build = consumer / "build"
    call("cmake", "-G", "Ninja", "-S", consumer, "-B", build, f"-DCMAKE_PREFIX_PATH={prefix}")
    call("cmake", "--build", build)
    assert call(build / "version") == project_version()
    assert call(build / "sizes", FINGER) == call(build / "cpp_sizes", FINGER) == "4 8"
    assert (build / "plant").exists() == has_plant(prefix)
    if has_plant(prefix):
        assert call(build / "plant") == REFUSED
    assert (build / "estimation").exists() == has_estimation(prefix)
    if has_estimation(prefix):
        assert call(build / "estimation").splitlines() == [NO_IMAGE, NO_IMAGE]


def test_find_package_refuses_a_newer_version(prefix: Path, consumer: Path, tmp_path: Path) -> None:
    (tmp_path / "CMakeLists.txt").write_text(CONSUMER_CMAKE.format(version="999.0"), encoding="utf-8")
    command = ["cmake", "-S", str(tmp_path), "-B", str(tmp_path / "build"), f"-DCMAKE_PREFIX_PATH={prefix}"]
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    assert result.returncode != 0
    assert 'requested version "999.0"' in " ".join(result.stderr.split())


@pytest.mark.parametrize(
    ("module", "source", "compiler", "arguments", "expected"),
    [
        ("tendonfmu", "version.c", "cc", [], project_version()),
        ("tendonfmu-description", "sizes.cpp", "c++", [FINGER], "4 8"),
        ("tendonfmu-description", "cpp_sizes.cpp", "c++", [FINGER], "4 8"),
    ],
)
def test_pkg_config(
    prefix: Path,
    consumer: Path,
    tmp_path: Path,
    module: str,
    source: str,
    compiler: str,
    arguments: list[Path],
    expected: str,
) -> None:
    if not shutil.which("pkg-config"):
        pytest.skip("pkg-config is not installed")
    search = {"PKG_CONFIG_PATH": str(prefix / "lib" / "pkgconfig")}
    assert call("pkg-config", "--modversion", module, env=search) == project_version()
    flags = call("pkg-config", "--cflags", "--libs", module, env=search).split()
    call(compiler, consumer / source, "-o", tmp_path / "program", *flags)
    assert call(tmp_path / "program", *arguments) == expected


@pytest.mark.parametrize(
    ("part", "there", "printed"),
    [("plant", has_plant, REFUSED), ("estimation", has_estimation, f"{NO_IMAGE}\n{NO_IMAGE}")],
)
def test_pkg_config_of_optional_parts(
    prefix: Path, consumer: Path, tmp_path: Path, part: str, there: Callable[[Path], bool], printed: str
) -> None:
    if not there(prefix):
        pytest.skip(f"SKIPPED: built without the {part}")
    if not shutil.which("pkg-config"):
        pytest.skip("pkg-config is not installed")
    search = {"PKG_CONFIG_PATH": str(prefix / "lib" / "pkgconfig")}
    flags = call("pkg-config", "--cflags", "--libs", f"tendonfmu-{part}", env=search).split()
    call("cc", consumer / f"{part}.c", "-o", tmp_path / "program", *flags)
    assert call(tmp_path / "program") == printed


def test_the_program_of_the_page_learns_what_the_command_does(prefix: Path, tmp_path: Path) -> None:
    if not has_estimation(prefix) or not shutil.which("pkg-config"):
        pytest.skip("SKIPPED: built without the estimation of parameters, or pkg-config is not installed")
    pytest.importorskip("tendonfmu._estimation", reason="SKIPPED: the package is built without Eigen")
    from tendonfmu.estimate.fitting import FrictionFit

    page = (ROOT / "docs" / "reference" / "commands" / "fit.md").read_text(encoding="utf-8")
    (code,) = re.findall(r"```c\n(.*?)```", page, re.DOTALL)
    (tmp_path / "learn.c").write_text(code, encoding="utf-8")
    (tmp_path / "finger.json").write_text(json.dumps(moved_start()), encoding="utf-8")
    made = made_recording(duration=10.0)
    made.groups.pop("external_torque", None)  # the program takes none
    recording = write_recording(made, tmp_path / "recording.csv")
    search = {"PKG_CONFIG_PATH": str(prefix / "lib" / "pkgconfig")}
    flags = call(
        "pkg-config", "--cflags", "--libs", "tendonfmu-estimation", "tendonfmu-description", env=search
    ).split()
    call("cc", "-std=c11", "-Wall", "-Wextra", "-Werror", tmp_path / "learn.c", "-o", tmp_path / "learn", *flags)
    lines = [line.split() for line in call(tmp_path / "learn", tmp_path / "finger.json", recording).splitlines()]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        fit = FrictionFit(tmp_path / "finger.json", "ekf", max_passes=1).fit(recording)
    assert {path for path, *_ in lines} == set(fit.parameters_)
    for path, value, error in lines:
        assert float(value) == pytest.approx(fit.parameters_[path], rel=1e-8)
        assert float(error) == pytest.approx(fit.standard_errors_[path], rel=0.06)  # two digits


def test_kernels_for_one_processor_share_no_function(prefix: Path) -> None:
    """What they define weakly, the linker may give to sources for every processor."""
    archive = prefix / "lib" / "libtendonfmu_estimation.a"
    if not archive.exists() or shutil.which("nm") is None:
        pytest.skip("SKIPPED: built without the estimation of parameters, or nm is not there")
    symbols: dict[str, list[str]] = {}
    for line in call("nm", archive).splitlines():
        if line.endswith(":"):
            member = symbols.setdefault(line[:-1], [])
        elif line:
            member.append(line.split()[-2])
    kernels = [name for name in symbols if "_avx" in name]
    assert kernels
    assert {kind for name in kernels for kind in symbols[name]} & set("WwVvu") == set()
    # the search finds what it looks for elsewhere
    assert "W" in {kind for kinds in symbols.values() for kind in kinds}


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


@pytest.mark.long
def test_the_ros2_example_is_built_and_tested_without_ros(prefix: Path, tmp_path: Path) -> None:
    """Where ROS 2 is sourced, the node is built as well."""
    source = ROOT / "examples" / "ros2_contact_node"
    flags = "-DCMAKE_CXX_FLAGS=-Wall -Wextra -Werror"
    call("cmake", "-G", "Ninja", "-S", source, "-B", tmp_path, f"-DCMAKE_PREFIX_PATH={prefix}", flags)
    call("cmake", "--build", tmp_path)
    assert "100% tests passed" in call("ctest", "--test-dir", tmp_path, "--no-tests=error")


def contacts(lines: str) -> tuple[list[float], list[float]]:
    """Times at which contact begins, and at which it ends."""
    found = [line.split() for line in lines.splitlines()]
    begins = [float(words[0]) for words in found if words[1:3] == ["s", "contact,"]]
    ends = [float(words[0]) for words in found if words[1:3] == ["s", "free"]]
    return begins, ends


def test_control_loop_of_the_examples_feels_the_pull(control_loop: Path) -> None:
    begins, ends = contacts(call(control_loop, FINGER, "--rate", "3000", "--seconds", "2.2", "--no-wait"))
    # one pull, from 1.5 s to 1.8 s
    assert begins == [pytest.approx(1.5, abs=0.005)]
    assert ends == [pytest.approx(1.8, abs=0.005)]


def test_control_loop_of_the_examples_waits_for_its_samples(control_loop: Path) -> None:
    started = time.monotonic()
    printed = call(control_loop, FINGER, "--seconds", "0.5")
    assert time.monotonic() - started >= 0.499
    assert " 500 samples, 0 refused" in printed and "latest sample" in printed


def test_control_loop_of_the_examples_feels_the_pushes_of_the_demo_recording(
    control_loop: Path, tmp_path: Path
) -> None:
    folder = ROOT / "examples" / "demo_recording"
    recorded = pd.read_parquet(folder / "index_finger_pushes.parquet")
    pushed = recorded["contact"].to_numpy() > 0
    onsets = recorded["time"].to_numpy()[1:][pushed[1:] & ~pushed[:-1]] - recorded["time"][0]
    recorded.to_csv(tmp_path / "pushes.csv", index=False)
    calibrated = folder / "index_finger_calibrated.json"
    begins, _ = contacts(call(control_loop, calibrated, "--recording", tmp_path / "pushes.csv", "--no-wait"))
    assert len(begins) == len(onsets) == 11
    assert all(0.0 <= begin - onset < 0.5 for begin, onset in zip(begins, onsets, strict=True))


@pytest.mark.parametrize(
    ("changed", "status", "said"),
    [
        (("tendon_force[2]", 3, float("nan")), 1, "0.006 s  refused: tendon_force[2]"),
        (("time", 3, 0.001), 1, "0.001 s  refused: time = 0.001 s: expected a finite number"),
        (("tendon_position[8]", 3, "fast"), 2, 'row 4, column 17: "fast": expected a number'),
        (("tendon_force[8]", None, None), 2, "no column tendon_force[8]"),
    ],
)
def test_control_loop_of_the_examples_says_what_it_refuses(
    control_loop: Path, tmp_path: Path, changed: tuple[str, int | None, object], status: int, said: str
) -> None:
    recorded = pd.read_parquet(ROOT / "examples" / "demo_recording" / "index_finger_pushes.parquet").head(10)
    column, row, value = changed
    if row is None:
        recorded = recorded.drop(columns=column)
    else:
        recorded[column] = recorded[column].astype(object)
        recorded.loc[row, column] = value
    recorded.to_csv(tmp_path / "damaged.csv", index=False, na_rep="nan")
    command = [control_loop, FINGER, "--recording", tmp_path / "damaged.csv", "--no-wait"]
    result = subprocess.run([str(part) for part in command], capture_output=True, text=True, check=False)
    assert result.returncode == status
    assert said in result.stdout + result.stderr
