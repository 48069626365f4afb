"""The cross-compiled libraries: what they export and need, and that they compute what the native one computes.

The whole build takes two minutes (zig's first build for Windows several), so it runs with `tools/nightly tests`.
"""

from __future__ import annotations

import csv
import importlib.util
import os
import re
import struct
import subprocess
import sys
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from numpy.typing import NDArray

from optional_parts import require
from repository_paths import ROOT, TESTS

sys.path.insert(0, str(ROOT / "tools"))

import binary_contents
import portable_binaries as portable

FINGER = ROOT / "examples" / "fingers" / "index_finger.json"
RECORDING = TESTS / "reference" / "index_finger_in.csv"
FUNCTIONS = {2: 44, 3: 75}  # all of the headers of FMI 2.0 and 3.0
Bits = NDArray[np.uint64]


def installed_library() -> Path:
    spec = importlib.util.find_spec("tendonfmu")
    assert spec and spec.submodule_search_locations
    return next(Path(spec.submodule_search_locations[0]).glob("binaries/*64/tendonfmu.*"))


def installed_fmi3_library() -> Path:
    spec = importlib.util.find_spec("tendonfmu")
    assert spec and spec.submodule_search_locations
    return next(Path(spec.submodule_search_locations[0]).glob("binaries/*-*/tendonfmu_fmi3.*"))


def tool(*arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(ROOT / "tools" / "portable_binaries.py"), *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False)


# --- without a cross-compiler ----------------------------------------------------------------------------------------


def test_the_lists_name_every_source() -> None:
    assert sorted(portable.core_sources()) == sorted((ROOT / "runtime" / "core").rglob("*.c"))
    of_both = set(portable.fmu_sources(2)) | set(portable.fmu_sources(3))
    # zig links for an old C library: what lowers the floor of other linkers is not among them
    assert of_both == set((ROOT / "fmu_src").glob("*.c"))
    for fmi, other in ((2, 3), (3, 2)):
        assert not [path for path in portable.fmu_sources(fmi) if path.name.startswith(f"fmi{other}_")]


@pytest.mark.skipif(sys.platform != "linux", reason="reads the host's ELF library")
def test_contents_agree_with_readelf() -> None:
    require("readelf")
    library = installed_library()
    contents = binary_contents.read_contents(library.read_bytes())

    def readelf(option: str) -> str:
        return subprocess.run(["readelf", "-W", option, library], capture_output=True, text=True, check=True).stdout

    rows = [line.split() for line in readelf("--dyn-syms").splitlines()]
    symbols = [row for row in rows if len(row) > 7 and row[4] in ("GLOBAL", "WEAK")]
    assert contents.exports == {row[7].split("@")[0] for row in symbols if row[6] != "UND"}
    assert contents.imports == {row[7].split("@")[0] for row in symbols if row[6] == "UND"}
    assert list(contents.libraries) == re.findall(r"\(NEEDED\).*\[(.*)\]", readelf("-d"))
    assert set(contents.glibc) == set(re.findall(r"GLIBC_([\d.]+)", readelf("-V")))


def test_the_installed_library_exports_and_needs_what_it_may() -> None:
    for library, fmi in ((installed_library(), 2), (installed_fmi3_library(), 3)):
        contents = binary_contents.read_contents(library.read_bytes())
        findings = portable.findings(contents, fmi)
        assert all("GLIBC" in finding for finding in findings)  # an ordinary build asks for the host's
        assert len(contents.exports - portable.LINKER_MARKS) == FUNCTIONS[fmi]


def test_a_finding_for_each_promise_that_is_broken() -> None:
    good = binary_contents.Contents("ELF", "x86_64", frozenset({"fmi2DoStep"}), frozenset(), ("libc.so.6",), ("2.14",))
    assert portable.findings(good) == []

    def changed(**changes: Any) -> list[str]:
        return portable.findings(binary_contents.Contents(**(vars(good) | changes)))

    assert changed(glibc=("2.4", "2.17")) == []
    assert changed(glibc=("2.4", "2.18")) == ["needs GLIBC 2.18; expected at most 2.17"]
    assert changed(libraries=("libc.so.6", "libstdc++.so.6"))[0].startswith("needs libstdc++.so.6; expected")
    assert changed(exports=frozenset({"fmi2DoStep", "malloc"}))[0].startswith("exports malloc; expected fmi2")
    assert changed(exports=frozenset({"fmi2Reset"})) == ["does not export fmi2DoStep"]
    assert [line.split(";")[0] for line in portable.findings(good, 3)] == [
        "exports fmi2DoStep",
        "does not export fmi3DoStep",
    ]


@pytest.mark.parametrize("data", [b"", b"#!/bin/sh\n", b"\x7fELF\x01" + bytes(60)])
def test_other_files_are_no_libraries(data: bytes) -> None:
    with pytest.raises(ValueError, match="expected a 64-bit ELF, PE or Mach-O"):
        binary_contents.read_contents(data)


# --- the whole build -------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def binaries(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of all platforms. TENDONFMU_PORTABLE_BINARIES names one that is built already."""
    if ready := os.environ.get("TENDONFMU_PORTABLE_BINARIES"):
        return Path(ready)
    require("zig")
    folder = tmp_path_factory.mktemp("portable")
    done = tool(str(folder))
    assert done.returncode == 0, done.stderr
    return folder / "binaries"


def parts(path: Path) -> list[bytes]:
    """The libraries in a file: those of a universal one, or the one that it is."""
    data = path.read_bytes()
    magic, count = struct.unpack_from(">II", data)
    if magic != portable.UNIVERSAL_MAGIC:
        return [data]
    places = [struct.unpack_from(">IIIII", data, 8 + 20 * k) for k in range(count)]
    return [data[offset : offset + size] for _, _, offset, size, _ in places]


def test_folders_are_named_as_the_importers_of_each_version_look_for_them() -> None:
    """For aarch64 Linux, FMI 2.0 has no name."""
    platforms = {fmi: {target.platform for target in portable.TARGETS if target.fmi == fmi} for fmi in (2, 3)}
    assert platforms[2] == {"linux64", "win64", "darwin64", "aarch64-linux"}
    assert all(re.fullmatch(r"(x86_64|aarch64)-(linux|windows|darwin)", platform) for platform in platforms[3])


EXPECTED = {
    "linux64": ["x86_64 ELF"],
    "aarch64-linux": ["aarch64 ELF"],
    "win64": ["x86_64 PE"],
    "darwin64": ["x86_64 Mach-O", "aarch64 Mach-O"],
    "x86_64-linux": ["x86_64 ELF"],
    "x86_64-windows": ["x86_64 PE"],
    "x86_64-darwin": ["x86_64 Mach-O"],
    "aarch64-darwin": ["aarch64 Mach-O"],
}
LIBRARIES = dict.fromkeys((target.library, target.platform, target.fmi) for target in portable.TARGETS)


@pytest.mark.long
@pytest.mark.parametrize(("name", "platform", "fmi"), LIBRARIES)
def test_a_portable_library_keeps_its_promises(binaries: Path, name: str, platform: str, fmi: int) -> None:
    library = binaries / name
    found = [binary_contents.read_contents(part) for part in parts(library)]
    assert [f"{each.machine} {each.format}" for each in found] == EXPECTED[platform]
    for contents in found:
        assert portable.findings(contents, fmi) == []
        assert len(contents.exports - portable.LINKER_MARKS) == FUNCTIONS[fmi]
    # Our own code is 250 to 390 kB of it; a C library or an exception runtime linked in by mistake would double it.
    assert library.stat().st_size < 500_000 * len(found)


# --- the same numbers ------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Emulated:
    """How the driver of a platform is built and run here."""

    platform: str
    before: tuple[str, ...] = ()  # command in front of the driver

    @property
    def is_windows(self) -> bool:
        return self.platform == "win64"

    def uri(self, folder: Path) -> str:
        return f"file:///Z:{folder}" if self.is_windows else folder.as_uri()  # wine's drive Z: is the host's root

    def compile_driver(self, folder: Path) -> Path:
        target = next(target for target in portable.TARGETS if target.platform == self.platform and target.fmi == 2)
        driver = folder / f"driver-{self.platform}{'.exe' if self.is_windows else ''}"
        command = [*portable.zig_command(), "-target", target.triple, "-std=c11", "-O2", "-Wall", "-Wextra", "-Werror"]
        command += ["-isystem", str(portable.fmi_headers()), str(TESTS / "portable" / "driver.c"), "-o", str(driver)]
        done = subprocess.run(command + ["-ldl"] * (not self.is_windows), capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        return driver

    def run(self, driver: Path, library: Path, fmu: Fmu, folder: Path) -> Bits:
        """Bits of all real outputs and the flags, [samples × outputs]."""
        environment = dict(os.environ, WINEPREFIX=str(folder / "wine"), WINEDEBUG="-all")
        arguments = [str(library), fmu.guid, self.uri(fmu.folder / "resources"), str(fmu.samples)]
        command = [*self.before, str(driver), *arguments]
        done = subprocess.run(command, capture_output=True, text=True, env=environment, check=False)
        assert done.returncode == 0, done.stderr
        return np.array([[int(word, 16) for word in row.split()] for row in done.stdout.splitlines()], np.uint64)


@dataclass(frozen=True)
class Fmu:
    folder: Path
    guid: str
    samples: Path  # for the driver
    count: int
    outputs: int  # real ones


@pytest.fixture(scope="module")
def fmu(tmp_path_factory: pytest.TempPathFactory) -> Fmu:
    from tendonfmu.fmu.packaging import build_fmu

    folder = tmp_path_factory.mktemp("fmu")
    with zipfile.ZipFile(build_fmu(FINGER, folder / "index_finger.fmu")) as archive:
        archive.extractall(folder)
    root = ElementTree.parse(folder / "modelDescription.xml").getroot()
    references: dict[tuple[str, str], list[int]] = {}
    names: dict[str, int] = {}
    for variable in root.iter("ScalarVariable"):
        reference = int(variable.attrib["valueReference"])
        references.setdefault((variable.attrib["causality"], variable[0].tag), []).append(reference)
        names[variable.attrib["name"]] = reference
    with RECORDING.open(newline="") as file:
        header, *rows = csv.reader(file)
    real, flags = references["output", "Real"], references["output", "Boolean"]
    lines = [[len(some), *some] for some in ([names[name] for name in header[1:]], real, flags)] + [[len(rows)]]
    text = [" ".join(f"{number:x}" for number in line) for line in lines]
    text += [" ".join(struct.pack(">d", float(cell)).hex() for cell in row) for row in rows]
    (folder / "samples.txt").write_text("\n".join(text) + "\n")
    return Fmu(folder, root.attrib["guid"], folder / "samples.txt", len(rows), len(real))


def emulated(platform: str) -> Emulated:
    if sys.platform != "linux" or os.uname().machine != "x86_64":
        pytest.skip("SKIPPED: compared on Linux x86-64 only")
    require("zig")
    if platform == "aarch64-linux":
        require("qemu")
        return Emulated(platform, ("qemu-aarch64-static", "-L", str(require("aarch64 library"))))
    if platform == "win64":
        require("wine")
        return Emulated(platform, ("wine",))
    return Emulated(platform)


def ulps(a: Bits, b: Bits) -> int:
    """Largest distance of doubles given as bits, counted in representable numbers."""

    def ordered(bits: Bits) -> list[int]:
        # the sign bit cut off and the rest negated: -0.0 and 0.0 are the same number
        return [x if x < 1 << 63 else (1 << 63) - x for x in bits.ravel().tolist()]

    return max(abs(x - y) for x, y in zip(ordered(a), ordered(b), strict=True))


@pytest.mark.long
def test_a_portable_fmu_yields_the_reference_trace(binaries: Path, tmp_path: Path) -> None:
    """Packed by the command with --binaries and run by fmpy: all platforms in one FMU."""
    fmu = tmp_path / "index_finger.fmu"
    program = str(Path(sys.executable).with_name("tendonfmu"))
    command = [program, "build", str(FINGER), "-o", str(fmu), "--binaries", str(binaries)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    with zipfile.ZipFile(fmu) as archive:
        packed = [name for name in archive.namelist() if name.startswith("binaries/")]
    suffixes = {target.platform: target.suffix for target in portable.TARGETS if target.fmi == 2}
    assert sorted(packed) == sorted(f"binaries/{name}/index_finger{suffix}" for name, suffix in suffixes.items())
    script = ROOT / "examples" / "ci_reference_check" / "check_reference.py"
    command = [sys.executable, str(script), str(fmu), str(TESTS / "reference" / "index_finger")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.long
def test_a_portable_fmu_of_fmi3_gives_the_numbers_of_the_native_one(binaries: Path, tmp_path: Path) -> None:
    from tendonfmu.fmu import build_fmu, run_fmu
    from tendonfmu.recordings import read_recording

    platforms = {"linux": "linux", "darwin": "darwin", "win32": "windows"}
    here = f"{os.uname().machine.replace('arm64', 'aarch64')}-{platforms[sys.platform]}"
    for name, folder in (("native", None), ("portable", binaries)):
        build_fmu(FINGER, tmp_path / f"{name}.fmu", binaries=folder, fmi=3)
    with zipfile.ZipFile(tmp_path / "portable.fmu") as archive:
        packed = {name.split("/")[1] for name in archive.namelist() if name.startswith("binaries/")}
    assert packed == {target.platform for target in portable.TARGETS if target.fmi == 3} and here in packed
    recording = read_recording(RECORDING)
    native, found = (run_fmu(tmp_path / f"{name}.fmu", recording) for name in ("native", "portable"))
    assert len(np.unique(native["compensated_torque[1]"])) > 0.9 * len(recording)  # it moves
    assert {name: column.tobytes() for name, column in native.items()} == {
        name: column.tobytes() for name, column in found.items()
    }


@pytest.mark.long
@pytest.mark.parametrize("platform", ["linux64", "aarch64-linux", "win64"])
def test_a_portable_library_gives_the_bits_of_the_native_one(
    binaries: Path, fmu: Fmu, platform: str, tmp_path: Path
) -> None:
    """Zero ulps: one rounding for each operation everywhere, no function of the system's libm but sqrt and floor."""
    here, there = emulated("linux64"), emulated(platform)
    native = here.run(here.compile_driver(tmp_path), installed_library(), fmu, tmp_path)
    (library,) = (binaries / platform).glob("tendonfmu.*")
    found = there.run(there.compile_driver(tmp_path), library, fmu, tmp_path)
    assert native.shape[0] == fmu.count
    assert len(np.unique(native[:, 0])) > 0.9 * fmu.count  # it moves
    assert ulps(native[:, : fmu.outputs], found[:, : fmu.outputs]) == 0
    np.testing.assert_array_equal(native, found)
