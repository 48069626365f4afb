"""Where SUNDIALS and Eigen come from: what is refused and why, and that everything else is built without them."""

from __future__ import annotations

import hashlib
import importlib.util
import re
import shutil
import subprocess
import sys
import tarfile
from pathlib import Path

import pytest

from optional_parts import needs
from repetitions import repeated
from repository_paths import ROOT

needs_cmake = pytest.mark.skipif(
    shutil.which("cmake") is None or shutil.which("ninja") is None, reason="SKIPPED: cmake or ninja is not there"
)
NOT_FOUND = "SUNDIALS 6 or 7 not found; no static libraries of CVODE in EMPTY"
NO_SUNDIALS = "-DTENDONFMU_SUNDIALS_ROOT=EMPTY"
NO_FETCH = "-DTENDONFMU_FETCH_SUNDIALS=OFF"
# options of CMake, why there is no simulated finger, why no estimation
CONFIGURATIONS = [
    (("-DCMAKE_DISABLE_FIND_PACKAGE_Eigen3=ON",), "Eigen >= 3.4 not found", "Eigen >= 3.4 not found"),
    ((NO_SUNDIALS, NO_FETCH), NOT_FOUND, ""),
    ((NO_SUNDIALS, "-DTENDONFMU_SUNDIALS_SOURCE=EMPTY/no.tar.gz"), "EMPTY/no.tar.gz does not exist", ""),
    (
        ("-DTENDONFMU_PLANT=OFF", "-DTENDONFMU_ESTIMATION=OFF"),
        "it is switched off (TENDONFMU_PLANT)",
        "it is switched off (TENDONFMU_ESTIMATION)",
    ),
]


@needs_cmake
@pytest.mark.parametrize(("options", "no_finger", "no_estimation"), repeated(CONFIGURATIONS, 0))
def test_the_rest_is_configured_without_what_is_missing(
    options: tuple[str, ...], no_finger: str, no_estimation: str, tmp_path: Path
) -> None:
    empty, build = tmp_path / "empty", tmp_path / "build"
    empty.mkdir()
    command = ["cmake", "-S", str(ROOT), "-B", str(build), "-G", "Ninja", f"-DPython_EXECUTABLE={sys.executable}"]
    command += ["-DTENDONFMU_BUILD_TESTS=OFF", f"-DTENDONFMU_SUNDIALS_FOLDER={build / 'sundials'}"]
    command += [option.replace("EMPTY", str(empty)) for option in options]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    output = re.sub(r"\s+", " ", done.stdout + done.stderr)
    ninja = ["ninja", "-C", str(build), "-t", "targets", "all"]
    targets = subprocess.run(ninja, capture_output=True, text=True).stdout
    assert "tendonfmu_description" in targets
    for part, file, target, reason in (
        ("simulated finger", "simulated_finger_missing.txt", "tendonfmu_plant", no_finger),
        ("estimation of parameters", "estimation_missing.txt", "tendonfmu_estimation", no_estimation),
    ):
        reason = reason.replace("EMPTY", str(empty))
        assert (target in targets) == (not reason)
        if reason:
            assert re.search(rf"The {part} is not built: .*{re.escape(reason)}", output)
            # what tools/setup.sh tells the user, to whom pip does not show CMake's output
            assert (build / file).read_text(encoding="utf-8")


def fetched(tmp_path: Path, sha256: str, url: str) -> str:
    """Let SundialsSource.cmake fetch `url`, of which it expects a hash; return its complaint."""
    script = tmp_path / "fetch.cmake"
    script.write_text(
        f'include("{(ROOT / "cmake/SundialsSource.cmake").as_posix()}")\n'
        f'set(tendonfmu_sundials_url "{url}")\nset(tendonfmu_sundials_sha256 {sha256})\n'
        f'tendonfmu_unpack_sundials("{(tmp_path / "out").as_posix()}")\nmessage(NOTICE "[${{failure}}]")\n'
    )
    result = subprocess.run(["cmake", "-P", script], capture_output=True, text=True, check=True)
    complaint = re.search(r"\[(.*)\]\s*$", result.stderr, re.DOTALL)
    assert complaint, result.stderr
    return complaint[1]


@needs_cmake
def test_the_release_is_taken_only_with_the_right_hash(tmp_path: Path) -> None:
    (tmp_path / "cvode.h").write_text("release")
    archive = tmp_path / "release.tar.gz"
    with tarfile.open(archive, "w:gz") as tar:
        tar.add(tmp_path / "cvode.h", "cvode/include/cvode/cvode.h")
    sha256, wrong = hashlib.sha256(archive.read_bytes()).hexdigest(), "0" * 64
    assert fetched(tmp_path, sha256, archive.as_uri()) == ""
    assert (tmp_path / "out/unpacked/cvode/include/cvode/cvode.h").read_text() == "release"
    assert fetched(tmp_path, wrong, archive.as_uri()) == f"{archive.as_uri()} has SHA-256 {sha256}, expected {wrong}"
    assert not (tmp_path / "out/unpacked").exists()
    absent = (tmp_path / "absent.tar.gz").as_uri()
    assert fetched(tmp_path, sha256, absent).startswith(f"{absent} could not be fetched (")


@needs("readelf")
def test_sundials_is_inside_the_extension_and_stays_there() -> None:
    module = importlib.util.find_spec("tendonfmu._plant")
    if module is None:
        pytest.skip("SKIPPED: built without the simulated finger")
    assert module.origin
    read = ["readelf", "--wide", "--dynamic", "--dyn-syms", module.origin]
    text = subprocess.run(read, capture_output=True, text=True, check=True).stdout
    assert re.findall(r"NEEDED.*\[(.*(?:sundials|mpi).*)\]", text) == []
    # A symbol that is exported could be bound to another SUNDIALS in the same process.
    assert re.findall(r"\b(?:CVode|SUN|N_V)\w+", text) == []
    assert "PyInit__plant" in text
