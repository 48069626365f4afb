"""The FMU's library as a file and in its host: exports and needs, folders, memory, other FMUs, locales."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from fmi2_headers import FMPY_HEADERS
from fmu_binary import FINGER, Instance, UnpackedFmu, unpack
from fmu_kinds import MAKERS, kinds
from leak_count import ROUNDS, least_growth, needs_count
from optional_parts import require
from plant_rigs import needs_plant
from repository_paths import ROOT, SUPPORT

sys.path.insert(0, str(ROOT / "tools"))
from binary_contents import read_contents

LARGEST = 2_000_000  # bytes, of the simulated finger's; docs/reference/simulated_finger_fmu.md names it
SYSTEM_LIBRARIES = {"libc.so.6", "libm.so.6"}
OF_CPP = {"libgcc_s.so.1", "ld-linux-x86-64.so.2", "ld-linux-aarch64.so.1"}
linux = pytest.mark.skipif(sys.platform != "linux", reason="SKIPPED: objdump is of Linux")


# --- the file ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", kinds())
def test_exports_the_fmi_functions_and_needs_the_system_alone(name: str, request: pytest.FixtureRequest) -> None:
    fmu: UnpackedFmu = request.getfixturevalue(MAKERS[name][0])
    contents = read_contents(fmu.binary.read_bytes())
    header = (FMPY_HEADERS / f"fmi{fmu.version}Functions.h").read_text()
    assert set(contents.exports) == set(re.findall(r"fmi\dFullName\((fmi\d\w+)\)", header))
    assert fmu.binary.stat().st_size < LARGEST
    if contents.format == "ELF":
        assert "libc.so.6" in contents.libraries
        assert set(contents.libraries) <= SYSTEM_LIBRARIES | (OF_CPP if name == "plant" else set())
        assert contents.glibc_floor <= (2, 17)  # of 2012, whatever the build's own is (fmu_src/glibc_floor)


@linux
def test_binds_its_own_names_and_has_no_executable_stack(small: UnpackedFmu) -> None:
    command = [require("objdump"), "-p", str(small.binary)]
    headers = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    assert "SYMBOLIC" in headers and "TEXTREL" not in headers
    stack = re.search(r"STACK.*\n.*flags (\S+)", headers)
    assert stack and "x" not in stack[1]


@pytest.mark.parametrize("name", ["späce and ümlaut", "100% sure", "a%20b", "q?#[x]", "日本"])
def test_any_folder_name(small_fmu_path: Path, small_fmu3_path: Path, tmp_path: Path, name: str) -> None:
    for path in (small_fmu_path, small_fmu3_path):
        fmu = unpack(path, tmp_path / path.stem / name / path.parent.name)
        folder, uri = bytes(fmu.folder / "resources"), fmu.resources
        spellings = [uri, folder]
        if fmu.version == 2:
            spellings += [
                uri.replace(b"file:///", b"file:/"),
                uri.replace(b"file:///", b"file://localhost/"),
                uri.replace(b"file:", b"FILE:") + b"/",
                b"file://" + folder,  # not encoded, as some importers have it
            ]
        for location in spellings:
            with Instance(fmu, resources=location) as instance:
                assert instance.component, (location, instance.messages)


# --- memory -----------------------------------------------------------------------------------------------------------


@needs_count
@pytest.mark.parametrize(
    ("fmu", "cycle", "count", "most"),
    [
        ("small_fmu", "whole", 300, 1),
        ("small_fmu3", "whole", 300, 1),
        pytest.param("plant_fmu", "whole", 120, 16, marks=[needs_plant, pytest.mark.long]),  # half the smallest block
        # libstdc++, which is linked in, would keep 72,704 bytes for exceptions without memory; the allocator itself
        # keeps up to some 2 kB on a busy machine
        pytest.param("plant_fmu", "unloaded", 20, 200, marks=needs_plant),
        pytest.param("small_fmu", "whole", 100_000 // ROUNDS, 1, marks=pytest.mark.long),
        pytest.param("small_fmu", "unloaded", 10_000 // ROUNDS, 1, marks=pytest.mark.long),
    ],
)
def test_instances_leave_nothing(request: pytest.FixtureRequest, fmu: str, cycle: str, count: int, most: int) -> None:
    """Stepped, saved, in error, refused; or the library unloaded as well: no handle, less than `most` bytes each."""
    used, opened = least_growth(request.getfixturevalue(fmu), cycle, count)
    assert used < most * count and opened == 0


@needs_count
@pytest.mark.skipif(shutil.which("cc") is None, reason="SKIPPED: needs a C compiler")
def test_each_allocation_that_fails_is_reported_or_not_needed(small_fmu: UnpackedFmu, tmp_path: Path) -> None:
    """In a host whose memory is used up at any of the FMU's allocations; nothing is left behind."""
    source, program = Path(__file__).with_name("failing_allocations.c"), tmp_path / "failing_allocations"
    flags = "-O1", "-fno-builtin", "-Wall", "-Wextra", "-Werror", "-rdynamic", "-isystem", FMPY_HEADERS
    link = small_fmu.binary, f"-Wl,-rpath,{small_fmu.binary.parent}"
    subprocess.run(["cc", *flags, source, "-o", program, *link], check=True)
    done = subprocess.run([program, small_fmu.identifier, small_fmu.resources], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    allocations, refusals, messages, leaks = map(int, done.stdout.split())
    assert allocations >= refusals >= 5 and messages == refusals and leaks == 0, done.stdout


# --- in a process of its own ------------------------------------------------------------------------------------------

# Rows of each FMU, and what it says of a number that it refuses.
HOST = """
import ctypes, json, locale, sys
from pathlib import Path
sys.path.insert(0, sys.argv[1])
from fmu_binary import DISCARD, ERROR, Instance, UnpackedFmu
from fmu_kinds import MAKERS
mode, language, *fmus = sys.argv[2:]
if language:
    locale.setlocale(locale.LC_ALL, language)
    assert locale.localeconv()["decimal_point"] == ","
kinds = []
for name, folder in zip(fmus[::2], fmus[1::2]):
    kinds.append(MAKERS[name][1](UnpackedFmu(Path(folder), getattr(ctypes, mode))))
found = []
for kind in kinds:
    instance = Instance(kind.fmu)
    instance.initialise()
    rows = kind.advance(instance, 0, 60)
    refused = instance.write({next(iter(kind.tuned)): -1e9 - 0.25}) or instance.step(0.06)  # an input: by the step
    assert refused in (DISCARD, ERROR)
    found.append([rows, instance.last_message])
assert not language or locale.localeconv()["decimal_point"] == ","
print(json.dumps(found))
"""


def in_host(*fmus: tuple[str, UnpackedFmu], mode: str = "RTLD_LOCAL", language: str = "", **options: Any) -> list[Any]:
    """What FMUs give that run in one process. fmus: name of the kind, and the FMU."""
    arguments = [str(each) for name, fmu in fmus for each in (name, fmu.folder)]
    command = [sys.executable, "-c", HOST, str(SUPPORT), mode, language, *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=False, **options)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert isinstance(found, list)
    return found


@pytest.fixture(scope="session")
def other_fmu(tmp_path_factory: pytest.TempPathFactory) -> UnpackedFmu:
    from tendonfmu.fmu import build_fmu

    folder = tmp_path_factory.mktemp("other_fmu")
    description = FINGER | {"name": "other finger", "tendons": FINGER["tendons"][:2]}
    return unpack(build_fmu(description, folder / "other.fmu"), folder / "unpacked")


@pytest.mark.long
@pytest.mark.parametrize(
    ("second", "fixture"),
    [("friction", "other_fmu"), ("friction3", "small_fmu3"), pytest.param("plant", "plant_fmu", marks=needs_plant)],
)
def test_two_fmus_in_a_process_that_shares_all_symbols(
    small_fmu: UnpackedFmu, second: str, fixture: str, request: pytest.FixtureRequest
) -> None:
    """They have functions of the same names inside."""
    one, other = ("friction", small_fmu), (second, request.getfixturevalue(fixture))
    alone = in_host(one) + in_host(other)
    assert in_host(one, other, mode="RTLD_GLOBAL") == alone
    assert in_host(other, one, mode="RTLD_GLOBAL") == alone[::-1]


@pytest.fixture(scope="module")
def comma_locale(tmp_path_factory: pytest.TempPathFactory) -> tuple[str, dict[str, str]]:
    """Name of a locale with a decimal comma, made here, and the environment to find it in."""
    if shutil.which("localedef") and Path("/usr/share/i18n/locales/de_DE").exists():
        folder = tmp_path_factory.mktemp("locale")
        subprocess.run(["localedef", "-i", "de_DE", "-f", "UTF-8", folder / "de_DE.UTF-8"], capture_output=True)
        return "de_DE.UTF-8", {**os.environ, "LOCPATH": str(folder)}
    pytest.skip("SKIPPED: no locale with a decimal comma can be made (Debian: locales)")


def test_decimal_comma(request: pytest.FixtureRequest, comma_locale: tuple[str, dict[str, str]]) -> None:
    from tendonfmu.simulate import plant

    language, environment = comma_locale
    names = ["friction", "friction3", *(["plant"] if plant.HAS_PLANT else [])]
    fmus = [(name, request.getfixturevalue(MAKERS[name][0])) for name in names]
    assert in_host(*fmus, language=language, env=environment) == in_host(*fmus)
