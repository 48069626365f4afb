"""What holds for the repository as a whole: locked requirements, one version number, files that pages name, no trace of
a machine."""

from __future__ import annotations

import re
import subprocess
import sys
from importlib import metadata
from pathlib import Path

import pytest

from optional_parts import require
from repository_paths import ROOT
from tendonfmu.model import read_finger

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

LOCKS = sorted((ROOT / "locks").glob("*.lock"))
PYPROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
# A file or folder of the repository in a page, between backticks; `*` stands for any name.
FOLDERS = "cmake|docs|evidence|examples|fmu_src|locks|modelDescription|python|python_tests|runtime|tools"
NAMED = re.compile(rf"`(?:python )?((?:{FOLDERS})/[\w./*-]*)")
# Home and working folders of machines, and hosts of package registries (written apart, to be no match itself).
MACHINE = re.compile(r"(?<![\w.~}>/-])/(?:work|root|home/[a-z]\w*|Users/[a-z]\w*)/")
REGISTRY = re.compile(
    "|".join(("py" + r"pi\.org", "python" + r"hosted\.org", "deb" + r"\.debian\.org", "artifact" + "registry"))
)


def name_of(requirement: str) -> str:
    match = re.match(r"[A-Za-z0-9._-]+", requirement)
    assert match
    return re.sub(r"[-_.]+", "-", match[0]).lower()


def locked(lock: Path) -> dict[str, list[str]]:
    """Package name to its locked entries: one per Python version that needs another release."""
    entries: dict[str, list[str]] = {}
    for entry in re.split(r"\n(?=\S)", lock.read_text(encoding="utf-8").strip()):
        entries.setdefault(name_of(entry), []).append(entry)
    return entries


def tracked_text() -> dict[str, str]:
    require("git")
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=False)
    texts = {}
    for name in filter(None, listed.stdout.split("\0")):
        data = (ROOT / name).read_bytes() if (ROOT / name).is_file() else b""
        if b"\0" not in data:
            texts[name] = data.decode("utf-8")
    return texts


@pytest.mark.parametrize("lock", LOCKS, ids=lambda lock: lock.name)
def test_every_locked_package_is_pinned_and_hashed(lock: Path) -> None:
    for name, entries in locked(lock).items():
        for entry in entries:
            assert re.match(r"[a-z0-9-]+==[\w.]+( ; [^\\]+)? \\\n", entry), name
            assert len(re.findall(r"--hash=sha256:[0-9a-f]{64}", entry)) >= 1, name


@pytest.mark.parametrize("lock", LOCKS, ids=lambda lock: lock.name)
def test_locks_name_no_index(lock: Path) -> None:
    text = lock.read_text(encoding="utf-8")
    assert "://" not in text
    assert not re.search(r"--(extra-)?index|--find-links|--trusted-host", text)


def test_the_lock_holds_what_pyproject_asks_for() -> None:
    groups = PYPROJECT["dependency-groups"]
    wanted = (
        PYPROJECT["project"]["dependencies"] + PYPROJECT["build-system"]["requires"] + groups["build"] + groups["test"]
    )
    assert {name_of(requirement) for requirement in wanted} <= set(locked(ROOT / "locks/test.lock"))
    for group in ("interop", "site", "wheel"):
        assert {name_of(r) for r in groups[group]} <= set(locked(ROOT / f"locks/{group}.lock"))


def test_the_environment_is_the_locked_one() -> None:
    versions = {
        name: {version for entry in entries for version in re.findall(r"==([\w.]+)(?= )", entry.split(";")[0])}
        for name, entries in locked(ROOT / "locks/test.lock").items()
    }
    for requirement in PYPROJECT["project"]["dependencies"]:
        assert metadata.version(name_of(requirement)) in versions[name_of(requirement)]


def test_the_version_stands_in_one_place() -> None:
    match = re.search(r"project\(tendonfmu VERSION (\S+)", (ROOT / "CMakeLists.txt").read_text(encoding="utf-8"))
    assert match
    assert metadata.version("tendonfmu") == match[1]
    declared = re.compile(rf"version[\"']?\s*[=:]\s*[\"']{re.escape(match[1])}", re.IGNORECASE)
    assert [name for name, text in tracked_text().items() if declared.search(text)] == []


def test_every_file_that_a_page_names_exists() -> None:
    missing = [
        f"{page}: {name}"
        for page, text in tracked_text().items()
        if page.endswith(".md") and page != "CHANGELOG.md"
        for name in NAMED.findall(text)
        if not any(ROOT.glob(name.rstrip("/")))
    ]
    assert missing == []


def test_no_file_carries_a_machine_or_a_registry() -> None:
    found = [
        f"{name}: {match[0]}"
        for name, text in tracked_text().items()
        for match in (*MACHINE.finditer(text), *REGISTRY.finditer(text))
    ]
    assert found == []


DESCRIBED = [file for file in sorted((ROOT / "examples").rglob("*.json")) if '"tendonfmu-finger-1"' in file.read_text()]


@pytest.mark.parametrize("file", DESCRIBED, ids=lambda file: str(file.relative_to(ROOT)))
def test_every_description_of_the_examples_is_read(file: Path) -> None:
    assert read_finger(file).joint_names
