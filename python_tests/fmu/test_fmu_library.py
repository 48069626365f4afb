"""The FMU as a file: what its binary exports and needs, where it may lie, how it behaves in a host and in fmpy."""

from __future__ import annotations

import ctypes
import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

from fmi2_headers import FMPY_HEADERS
from fmu_binary import ERROR, FINGER, OK, Instance, UnpackedFmu, unpack
from fmu_kinds import MAKERS
from leak_count import least_growth, needs_count
from optional_parts import require
from plant_rigs import needs_plant
from repository_paths import SUPPORT

linux = pytest.mark.skipif(sys.platform != "linux", reason="SKIPPED: nm, objdump and /proc are those of Linux")


def run(*command: str | Path) -> str:
    return subprocess.run([str(word) for word in command], check=True, capture_output=True, text=True).stdout


# --- the binary -------------------------------------------------------------------------------------------------------


@linux
def test_exports_the_fmi_functions_only(small_fmu: UnpackedFmu) -> None:
    lines = run(require("nm"), "-D", "--defined-only", small_fmu.binary).splitlines()
    names = {line.split()[-1] for line in lines}
    header = (FMPY_HEADERS / "fmi2Functions.h").read_text()
    assert names == set(re.findall(r"fmi2FullName\((fmi2\w+)\)", header))
    assert len(names) == 44


@linux
def test_needs_libc_and_libm_only(small_fmu: UnpackedFmu) -> None:
    headers = run(require("objdump"), "-p", small_fmu.binary)
    needed = set(re.findall(r"NEEDED\s+(\S+)", headers))
    assert needed <= {"libc.so.6", "libm.so.6"} and "libc.so.6" in needed
    assert "SYMBOLIC" in headers
    versions = {tuple(map(int, v.split("."))) for v in re.findall(r"GLIBC_([\d.]+)", headers)}
    print(f"{small_fmu.binary.name}: GLIBC {max(versions)}")
    assert max(versions) <= (2, 17)  # of 2012, whatever the build's own is (fmu_src/glibc_floor)


@linux
def test_no_executable_stack_and_no_text_relocations(small_fmu: UnpackedFmu) -> None:
    headers = run(require("objdump"), "-p", small_fmu.binary)
    assert "TEXTREL" not in headers
    stack = re.search(r"STACK.*\n.*flags (\S+)", headers)
    assert stack and "x" not in stack[1]


# --- where it lies ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["späce and ümlaut", "100% sure", "a%20b", "q?#[x]", "日本"])
def test_any_folder_name(small_fmu_path: Path, tmp_path: Path, name: str) -> None:
    fmu = unpack(small_fmu_path, tmp_path / name)
    with Instance(fmu) as instance:
        assert instance.component, instance.messages
    spellings = [
        fmu.location.replace(b"file:///", b"file:/"),
        fmu.location.replace(b"file:///", b"file://localhost/"),
        fmu.location.replace(b"file:", b"FILE:") + b"/",
        b"file://" + os.fsencode(fmu.folder / "resources"),  # not encoded, as some importers have it
        os.fsencode(fmu.folder / "resources"),
    ]
    for location in spellings:
        with Instance(fmu, location=location) as instance:
            assert instance.component, (location, instance.messages)


# --- in a host --------------------------------------------------------------------------------------------------------


@needs_count
@pytest.mark.parametrize(
    ("fmu", "cycle", "count", "most"),
    [
        ("small_fmu", "bare", 500, 1),
        ("small_fmu", "whole", 1000, 1),
        # half of the smallest block
        pytest.param("plant_fmu", "bare", 120, 16, marks=[needs_plant, pytest.mark.long]),
    ],
)
def test_instances_leave_nothing(request: pytest.FixtureRequest, fmu: str, cycle: str, count: int, most: int) -> None:
    """Created and stepped; or saved, in error and refused as well: no handle, less than `most` bytes each."""
    used, opened = least_growth(request.getfixturevalue(fmu), cycle, count)
    assert used < most * count and opened == 0


SECOND = {**FINGER, "name": "other finger", "tendons": FINGER["tendons"][:2]}

# Rows of each FMU, and what it says of a number that it refuses.
HOST = """
import ctypes, json, locale, sys
from pathlib import Path
sys.path.insert(0, sys.argv[1])
from fmu_binary import ERROR, UnpackedFmu
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
    instance = kind.make(kind.fmu)
    instance.initialise()
    rows = kind.advance(instance, 0, 60)
    assert instance.write({next(iter(kind.tuned)): -1e9 - 0.25}) == ERROR
    found.append([rows, instance.last_message])
assert not language or locale.localeconv()["decimal_point"] == ","
print(json.dumps(found))
"""


def in_host(*fmus: tuple[str, UnpackedFmu], mode: str = "RTLD_LOCAL", language: str = "", **options: Any) -> list[Any]:
    """What FMUs give that run in a process of their own. fmus: name of the kind, and the FMU."""
    arguments = [str(each) for name, fmu in fmus for each in (name, fmu.folder)]
    command = [sys.executable, "-c", HOST, str(SUPPORT), mode, language, *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=False, **options)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert isinstance(found, list)
    return found


@pytest.fixture(scope="session")
def other_fmu(tmp_path_factory: pytest.TempPathFactory) -> UnpackedFmu:
    from tendonfmu.fmu.packaging import build_fmu

    folder = tmp_path_factory.mktemp("other_fmu")
    (folder / "finger.json").write_text(json.dumps(SECOND))
    build_fmu(folder / "finger.json", folder / "other.fmu", illustrated=False)
    return unpack(folder / "other.fmu", folder / "unpacked")


@pytest.mark.long
@pytest.mark.parametrize("second", ["friction", pytest.param("plant", marks=needs_plant)])
def test_two_fmus_in_a_process_that_shares_all_symbols(second: str, request: pytest.FixtureRequest) -> None:
    """They have functions of the same names inside."""
    one = "friction", request.getfixturevalue("small_fmu")
    other = second, request.getfixturevalue({"friction": "other_fmu", "plant": "plant_fmu"}[second])
    assert one[1].binary.name != other[1].binary.name
    alone = in_host(one) + in_host(other)
    assert in_host(one, other, mode="RTLD_GLOBAL") == alone
    assert in_host(other, one, mode="RTLD_GLOBAL") == alone[::-1]


def test_blocks_of_another_fmu_are_neither_read_nor_written(small_fmu: UnpackedFmu, other_fmu: UnpackedFmu) -> None:
    """Its states are of another length."""
    with Instance(small_fmu) as mine, Instance(other_fmu) as other:
        block, size = ctypes.c_void_p(), ctypes.c_size_t()
        assert other.call("GetFMUstate", ctypes.byref(block)) == OK
        assert other.call("SerializedFMUstateSize", block, ctypes.byref(size)) == OK
        before = ctypes.string_at(block, size.value)
        assert before == other.save()
        assert mine.call("SerializedFMUstateSize", block, ctypes.byref(size)) == ERROR
        own = mine.save()
        for name, arguments in {
            "SerializeFMUstate": (block, (ctypes.c_char * len(own))(), len(own)),
            "GetFMUstate": (ctypes.byref(block),),
            "SetFMUstate": (block,),
            "DeSerializeFMUstate": (own, len(own), ctypes.byref(block)),
        }.items():
            assert mine.call(name, *arguments) == ERROR
            assert f"fmi2{name}: state of another FMU" in mine.last_message
            assert ctypes.string_at(block, len(before)) == before


FMUS = [("friction", "small_fmu"), pytest.param("plant", "plant_fmu", marks=needs_plant)]


@pytest.mark.parametrize(("kind", "fixture"), FMUS)
def test_the_hosts_floating_point_stays(kind: str, fixture: str, request: pytest.FixtureRequest) -> None:
    """Subnormal numbers are still there, and rounding is to nearest."""
    with MAKERS[kind][1](request.getfixturevalue(fixture)).brought_to("s"):
        assert np.float64(5e-324) / 1 > 0 and np.float64(2.3e-308) / 4 > 0
        assert np.float64(1) + np.float64(2) ** -53 == 1 and np.float64(-1) - np.float64(2) ** -53 == -1


@pytest.fixture
def comma_locale(tmp_path: Path) -> Iterator[tuple[str, dict[str, str]]]:
    """Name of a locale with a decimal comma, made here when none is installed, and the environment to find it in."""
    if shutil.which("localedef") and Path("/usr/share/i18n/locales/de_DE").exists():
        subprocess.run(["localedef", "-i", "de_DE", "-f", "UTF-8", tmp_path / "de_DE.UTF-8"], capture_output=True)
        yield "de_DE.UTF-8", {**os.environ, "LOCPATH": str(tmp_path)}
        return
    listed = subprocess.run(["locale", "-a"], capture_output=True, text=True).stdout.split()
    found = [name for name in listed if re.match(r"(de|fr|es|it|nl)_.*utf-?8", name, re.IGNORECASE)]
    if not found:
        pytest.skip("SKIPPED: no locale with a decimal comma is installed (Debian: locales)")
    yield found[0], dict(os.environ)


@pytest.mark.parametrize(("kind", "fixture"), FMUS)
def test_decimal_comma(
    kind: str, fixture: str, request: pytest.FixtureRequest, comma_locale: tuple[str, dict[str, str]]
) -> None:
    language, environment = comma_locale
    fmu = kind, request.getfixturevalue(fixture)
    assert in_host(fmu, language=language, env=environment) == in_host(fmu)


# --- in fmpy ----------------------------------------------------------------------------------------------------------


def attributes_of_co_simulation(fmu: UnpackedFmu) -> dict[str, str]:
    element = ElementTree.parse(fmu.folder / "modelDescription.xml").getroot().find("CoSimulation")
    assert element is not None
    return element.attrib


def test_capabilities_are_declared(small_fmu: UnpackedFmu) -> None:
    declared = attributes_of_co_simulation(small_fmu)
    for name in (
        "canHandleVariableCommunicationStepSize",
        "canGetAndSetFMUstate",
        "canSerializeFMUstate",
        "providesDirectionalDerivative",
        "canNotUseMemoryManagementFunctions",
    ):
        assert declared[name] == "true"
    assert declared["needsExecutionTool"] == declared["canBeInstantiatedOnlyOncePerProcess"] == "false"
    assert "time" not in small_fmu.variables


def simulated(fmu_path: Path) -> np.ndarray:
    import fmpy

    signals = np.zeros(50, dtype=[("time", float), ("tendon_force[1]", float), ("tendon_position[1]", float)])
    signals["time"] = np.arange(50) / 60
    signals["tendon_force[1]"] = 5 + np.sin(signals["time"] * 9)
    signals["tendon_position[1]"] = 0.002 * np.sin(signals["time"] * 7)
    return fmpy.simulate_fmu(
        str(fmu_path),
        input=signals,
        start_time=0.0,
        stop_time=0.8,
        output_interval=1 / 60,
        start_values={"tendon_force[2]": 2.0, "contact.threshold[1]": 0.01},
        output=["compensated_torque[1]", "joint_torque[2]", "friction_torque[1]", "bias_torque[2]", "contact"],
    )


def test_fmpy_row_carries_the_sample_before(small_fmu_path: Path) -> None:
    rows = simulated(small_fmu_path)
    torque = 0.007 * (5 + np.sin(rows["time"] * 9)) - 0.006 * 2.0
    assert rows["joint_torque[2]"][0] == rows["joint_torque[2]"][1]  # the first sample, and the step at its time
    np.testing.assert_allclose(rows["joint_torque[2]"][1:], torque[:-1], atol=1e-12)
