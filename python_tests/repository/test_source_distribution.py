"""The source distribution: what the wheel is built from and no more; one version number in all that a user sees."""

from __future__ import annotations

import email
import re
import subprocess
import sys
import tarfile
from email.message import Message
from pathlib import Path, PurePosixPath

import pytest

from optional_parts import require
from repository_paths import ROOT

# One worker packs for all of them.
pytestmark = pytest.mark.long

# What CMake reads, as shell patterns of git; `:!` leaves out. tools/setup.sh reads the same for its digest.
NEEDED = (
    *("CMakeLists.txt", "pyproject.toml", "LICENSE", "THIRD_PARTY_LICENSES.txt", "README.md", "CHANGELOG.md"),
    *("cmake", "fmu_src", "modelDescription", "python", "runtime", ":!runtime/tests", ":!runtime/fuzz"),
    *("examples/fingers/*.json", "examples/demo_recording/*.json", "examples/demo_recording/*.parquet"),
)
HIDDEN = re.compile(r"(^|/)\.[^/]+$")  # settings of clang-format and clang-tidy
SIZE = 7_000_000  # bytes; the built-in recordings are 5.2 million of them


def git_files(*patterns: str) -> set[str]:
    require("git")
    listed = subprocess.run(["git", "ls-files", "-z", *patterns], cwd=ROOT, capture_output=True, text=True, check=False)
    return {name for name in listed.stdout.split("\0") if name and (ROOT / name).is_file()}


@pytest.fixture(scope="module")
def archive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("source")
    program = "import sys; from scikit_build_core.build import build_sdist; build_sdist(sys.argv[1])"
    subprocess.run([sys.executable, "-c", program, folder], cwd=ROOT, capture_output=True, check=True)
    (packed,) = folder.glob("*.tar.gz")
    return packed


def names_in(archive: Path) -> set[str]:
    """Files of the archive, without the folder that they are in."""
    with tarfile.open(archive) as tar:
        return {str(PurePosixPath(*PurePosixPath(each.name).parts[1:])) for each in tar.getmembers() if each.isfile()}


def test_it_holds_what_the_build_needs_and_nothing_else(archive: Path) -> None:
    packed = {name for name in names_in(archive) - {"PKG-INFO"} if not HIDDEN.search(name)}
    # A file that git does not know yet is packed, too: it is no fault of the lists.
    unknown = git_files("--others", "--exclude-standard")
    wanted = {name for name in git_files(*NEEDED) if not HIDDEN.search(name)}
    assert packed - unknown == wanted


def test_the_only_recordings_are_those_that_the_package_installs(archive: Path) -> None:
    installed = set(re.findall(r"\b\w+\.parquet\b", (ROOT / "python" / "CMakeLists.txt").read_text(encoding="utf-8")))
    tables = {name for name in names_in(archive) if name.endswith((".parquet", ".csv", ".mat", ".h5", ".mcap", ".npz"))}
    assert {PurePosixPath(name).name for name in tables} == installed
    assert archive.stat().st_size < SIZE


def test_version_of_sources_changelog_and_package_agree(archive: Path) -> None:
    changelog = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    first = re.search(r"^## (\d+\.\d+\.\d+)\b", changelog, re.MULTILINE)
    assert first, "CHANGELOG.md: expected an entry `## MAJOR.MINOR.PATCH, ...`"
    declared = re.search(r"project\(tendonfmu VERSION (\S+)", (ROOT / "CMakeLists.txt").read_text(encoding="utf-8"))
    assert declared
    assert archive.name == f"tendonfmu-{declared[1]}.tar.gz"
    assert first[1] == declared[1] == package_metadata(archive)["Version"]


def package_metadata(archive: Path) -> Message:
    """PKG-INFO, which every wheel that is built from the archive gets as METADATA."""
    with tarfile.open(archive) as tar:
        packed = tar.extractfile(f"{archive.name.removesuffix('.tar.gz')}/PKG-INFO")
        assert packed
        return email.message_from_bytes(packed.read())


def test_every_extra_installs_something_and_nothing_twice(archive: Path) -> None:
    requirements = package_metadata(archive).get_all("Requires-Dist", [])
    always = {re.split(r"[^\w.-]", each)[0] for each in requirements if "extra ==" not in each}
    for extra in ("campaign", "logs", "mujoco", "notebook"):
        names = {re.split(r"[^\w.-]", each)[0] for each in requirements if re.search(rf"extra == ['\"]{extra}", each)}
        assert names and not names & always, extra
