"""Where SUNDIALS and Eigen come from: what is refused and why, and that everything else is built without them."""

from __future__ import annotations

import hashlib
import importlib.util
import os
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

MISSING = "The simulated finger is not built: "
NO_ESTIMATION = "The estimation of parameters is not built: "

needs_cmake = pytest.mark.skipif(
    shutil.which("cmake") is None or shutil.which("ninja") is None, reason="SKIPPED: cmake or ninja is not there"
)


def configure(build: Path, *options: str) -> str:
    """Configures the project without tests; returns what CMake said. Only plant and estimation may be missing."""
    command = ["cmake", "-S", str(ROOT), "-B", str(build), "-G", "Ninja", f"-DPython_EXECUTABLE={sys.executable}"]
    command += ["-DTENDONFMU_BUILD_TESTS=OFF", f"-DTENDONFMU_SUNDIALS_FOLDER={build / 'sundials'}", *options]
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stdout + result.stderr
    return re.sub(r"\s+", " ", result.stdout + result.stderr)


def targets(build: Path) -> str:
    return subprocess.run(["ninja", "-C", build, "-t", "targets", "all"], capture_output=True, text=True).stdout


def fake_sundials(folder: Path, version: str) -> Path:
    """Headers and archives as a SUNDIALS installation has them, of a version and with nothing in them."""
    for name in ("cvode/cvode.h", "sundials/sundials_config.h", "nvector/nvector_serial.h"):
        (folder / "usr/include" / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / "usr/include" / name).touch()
    (folder / "usr/include/sundials/sundials_config.h").write_text(f'#define SUNDIALS_VERSION "{version}"\n')
    (folder / "usr/lib").mkdir()
    for part in ("cvode", "nvecserial", "generic"):
        (folder / f"usr/lib/libsundials_{part}.a").write_bytes(b"!<arch>\n")
    return folder


@pytest.mark.long
@needs_cmake
def test_everything_but_the_finger_is_configured_without_sundials(tmp_path: Path) -> None:
    empty = tmp_path / "empty"
    empty.mkdir()
    build = tmp_path / "build"
    said = configure(build, f"-DTENDONFMU_SUNDIALS_ROOT={empty}", "-DTENDONFMU_FETCH_SUNDIALS=OFF")
    assert f"{MISSING}SUNDIALS 6 or 7 not found; no static libraries of CVODE in {empty}" in said
    # What tools/setup.sh tells the user, to whom pip does not show CMake's output.
    assert "SUNDIALS 6 or 7 not found" in (build / "simulated_finger_missing.txt").read_text(encoding="utf-8")
    built = targets(build)
    assert "tendonfmu_plant" not in built
    assert "tendonfmu_description" in built


@pytest.mark.long
@needs_cmake
def test_finger_and_estimation_can_be_switched_off(tmp_path: Path) -> None:
    said = configure(tmp_path, "-DTENDONFMU_PLANT=OFF", "-DTENDONFMU_ESTIMATION=OFF")
    assert f"{MISSING}it is switched off (TENDONFMU_PLANT)" in said
    assert f"{NO_ESTIMATION}it is switched off (TENDONFMU_ESTIMATION)" in said


@needs_cmake
def test_the_model_is_configured_without_eigen(tmp_path: Path) -> None:
    said = configure(tmp_path, "-DCMAKE_DISABLE_FIND_PACKAGE_Eigen3=ON")
    assert f"{MISSING}Eigen >= 3.4 not found" in said
    assert f"{NO_ESTIMATION}Eigen >= 3.4 not found" in said
    assert "Eigen >= 3.4 not found" in (tmp_path / "estimation_missing.txt").read_text(encoding="utf-8")
    built = targets(tmp_path)
    assert "tendonfmu_plant" not in built and "tendonfmu_estimation" not in built
    assert "tendonfmu_description" in built


@needs_cmake
@pytest.mark.parametrize(
    ("version", "reason"),
    repeated(
        [("5.8.0", "is not of version 6 or 7"), ("8.0.0", "is not of version 6 or 7"), ("6.4.1", "cannot be linked")], 1
    ),
)
def test_an_unusable_installation_is_refused_with_its_version(tmp_path: Path, version: str, reason: str) -> None:
    root = fake_sundials(tmp_path / "installation", version)
    said = configure(tmp_path / "build", f"-DTENDONFMU_SUNDIALS_ROOT={root}", "-DTENDONFMU_FETCH_SUNDIALS=OFF")
    assert re.search(rf"{MISSING}.*; SUNDIALS {re.escape(version)} in {re.escape(str(root))}\S* {reason}", said)


@pytest.mark.long
@needs_cmake
@pytest.mark.parametrize(
    ("content", "reason"), repeated([(None, "does not exist"), (b"no archive", "could not be unpacked")], 1)
)
def test_unusable_sources_do_not_end_the_configuration(tmp_path: Path, content: bytes | None, reason: str) -> None:
    archive = tmp_path / "cvode.tar.gz"
    if content is not None:
        archive.write_bytes(content)
    options = (f"-DTENDONFMU_SUNDIALS_ROOT={tmp_path / 'none'}", f"-DTENDONFMU_SUNDIALS_SOURCE={archive}")
    said = configure(tmp_path / "build", *options)
    assert re.search(rf"{MISSING}.*{re.escape(str(archive))} {reason}", said)


def fetched(tmp_path: Path, sha256: str, url: str) -> str:
    """Lets SundialsSource.cmake fetch `url`, of which it expects a hash; returns its complaint."""
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
    sha256 = hashlib.sha256(archive.read_bytes()).hexdigest()

    assert fetched(tmp_path, sha256, archive.as_uri()) == ""
    assert (tmp_path / "out/unpacked/cvode/include/cvode/cvode.h").read_text() == "release"
    wrong = "0" * 64
    assert fetched(tmp_path, wrong, archive.as_uri()) == f"{archive.as_uri()} has SHA-256 {sha256}, expected {wrong}"
    assert not (tmp_path / "out/unpacked").exists()
    absent = (tmp_path / "absent.tar.gz").as_uri()
    assert fetched(tmp_path, sha256, absent).startswith(f"{absent} could not be fetched (")


APT = """#!/bin/sh
echo "$0 $*" >>"$CALLS"
case "$(basename "$0") $*" in
  "apt-cache policy "*) printf 'libsundials-dev:\\n  Installed: (none)\\n  Candidate: %s\\n' "$CANDIDATE" ;;
  *"download libsundials-dev") [ "$DOWNLOAD" = works ] && touch libsundials-dev_1_all.deb ;;
  *"update -qq") [ "$DOWNLOAD" = works ] ;;
  "dpkg-deb --fsys-tarfile "*) cat "$PACKAGE" ;;
esac
"""


def call_set_up(folder: Path, candidate: str, download: str) -> tuple[str, str]:
    """`set_up_sundials` of tools/setup.sh in `folder`, with an apt of ours; returns what it said and what it called."""
    tools = folder / "tools"
    tools.mkdir(exist_ok=True)
    for name in ("apt-get", "apt-cache", "dpkg-deb", "sudo"):
        (tools / name).write_text('#!/bin/sh\nshift\nexec "$@"\n' if name == "sudo" else APT)
        (tools / name).chmod(0o755)
    with tarfile.open(folder / "package.tar", "w") as tar:
        for name in (
            "usr/include/cvode/cvode.h",
            "usr/lib/libsundials_cvode.a",
            "usr/share/doc/libsundials-dev/copyright",
        ):
            tar.add(__file__, f"./{name}")
    calls = folder / "calls"
    calls.write_text("")
    environment = os.environ | {"PATH": f"{tools}{os.pathsep}{os.environ['PATH']}", "CALLS": str(calls)}
    environment |= {"CANDIDATE": candidate, "DOWNLOAD": download, "PACKAGE": str(folder / "package.tar")}
    script = f"set -euo pipefail; . '{ROOT}/tools/setup.sh'; installed_sundials() {{ :; }}; set_up_sundials"
    result = subprocess.run(
        ["bash", "-c", script], cwd=folder, env=environment, capture_output=True, text=True, check=False
    )
    assert result.returncode == 0, result.stderr
    return result.stderr, calls.read_text()


needs_bash = pytest.mark.skipif(
    shutil.which("bash") is None or sys.platform == "win32", reason="SKIPPED: bash is not there"
)


@needs_bash
def test_set_up_unpacks_the_package_once(tmp_path: Path) -> None:
    said, called = call_set_up(tmp_path, "2:6.4.1+dfsg1-3", "works")
    assert "unpacking libsundials-dev 6.4.1+dfsg1-3" in said
    assert "download libsundials-dev" in called and " update" not in called and " install" not in called
    package = tmp_path / "build/sundials/package/usr"
    assert (package / "include/cvode/cvode.h").is_file() and (package / "lib/libsundials_cvode.a").is_file()
    assert call_set_up(tmp_path, "6.4.1", "works") == ("", "")


@needs_bash
def test_set_up_goes_on_without_the_package(tmp_path: Path) -> None:
    said, called = call_set_up(tmp_path, "6.4.1", "fails")
    assert "going on without the package libsundials-dev" in said
    # The lists may be stale: they are refreshed before it gives up, and that only once a day.
    assert " update -qq" in called
    assert call_set_up(tmp_path, "6.4.1", "fails") == ("", "")


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
