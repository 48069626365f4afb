"""The cross-compiled libraries: what they export and need, and that they compute what the native one computes.

The whole build takes two minutes (zig's first build for Windows several), so it runs with `tools/nightly tests`.
"""

from __future__ import annotations

import os
import re
import struct
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from c_driver import DRIVER, arguments, run, write_samples
from command import run_script
from fmu_binary import UnpackedFmu, fmi_platform, unpack
from optional_parts import require
from repository_paths import ROOT, TESTS
from tendonfmu.fmu import build_fmu, run_fmu
from tendonfmu.recordings import read_recording

sys.path.insert(0, str(ROOT / "tools"))

import binary_contents
import portable_binaries as portable

FINGER = ROOT / "examples" / "fingers" / "index_finger.json"
TRACE = TESTS / "reference" / "index_finger"
RECORDING = TRACE.with_name("index_finger_in.csv")
FUNCTIONS = {2: 44, 3: 75}  # all of the headers of FMI 2.0 and 3.0


@pytest.mark.skipif(sys.platform != "linux", reason="SKIPPED: reads the host's ELF library")
def test_contents_agree_with_readelf(small_fmu: UnpackedFmu) -> None:
    """What this tool reads decides whether a library keeps its promises."""
    require("readelf")
    contents = binary_contents.read_contents(small_fmu.binary.read_bytes())
    rows = [line.split() for line in run("readelf", "-W", "--dyn-syms", small_fmu.binary).splitlines()]
    symbols = [row for row in rows if len(row) > 7 and row[4] in ("GLOBAL", "WEAK")]
    assert contents.exports == {row[7].split("@")[0] for row in symbols if row[6] != "UND"}
    assert contents.imports == {row[7].split("@")[0] for row in symbols if row[6] == "UND"}
    assert list(contents.libraries) == re.findall(r"\(NEEDED\).*\[(.*)\]", run("readelf", "-d", small_fmu.binary))
    assert set(contents.glibc) == set(re.findall(r"GLIBC_([\d.]+)", run("readelf", "-V", small_fmu.binary)))


# --- the whole build --------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def binaries(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of all platforms. TENDONFMU_PORTABLE_BINARIES names one that is built already."""
    if ready := os.environ.get("TENDONFMU_PORTABLE_BINARIES"):
        return Path(ready)
    require("zig")
    folder = tmp_path_factory.mktemp("portable")
    run(sys.executable, ROOT / "tools" / "portable_binaries.py", folder)
    return folder / "binaries"


def parts(path: Path) -> list[bytes]:
    """The libraries in a file: those of a universal one, or the one that it is."""
    data = path.read_bytes()
    magic, count = struct.unpack_from(">II", data)
    if magic != portable.UNIVERSAL_MAGIC:
        return [data]
    places = [struct.unpack_from(">IIIII", data, 8 + 20 * k) for k in range(count)]
    return [data[offset : offset + size] for _, _, offset, size, _ in places]


# for aarch64 Linux, FMI 2.0 has no name
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


# --- the same numbers -------------------------------------------------------------------------------------------------


@pytest.mark.long
@pytest.mark.parametrize("fmi", [2, 3])
def test_a_portable_fmu_of_all_platforms_gives_the_numbers_of_the_native_one(
    binaries: Path, tmp_path: Path, fmi: int
) -> None:
    """By fmpy; that of FMI 2.0 yields the reference trace as well."""
    native, packed = (
        build_fmu(FINGER, tmp_path / f"{name}.fmu", binaries=folder, fmi=fmi)
        for name, folder in (("native", None), ("portable", binaries))
    )
    with zipfile.ZipFile(packed) as archive:
        platforms = {name.split("/")[1] for name in archive.namelist() if name.startswith("binaries/")}
    assert platforms == {target.platform for target in portable.TARGETS if target.fmi == fmi}
    assert fmi_platform(fmi) in platforms
    recording = read_recording(RECORDING)
    expected, found = run_fmu(native, recording), run_fmu(packed, recording)
    assert {name: x.tobytes() for name, x in expected.items()} == {name: x.tobytes() for name, x in found.items()}
    if fmi == 2:
        with pytest.MonkeyPatch.context() as patch:
            patch.syspath_prepend(ROOT / "examples" / "ci_reference_check")
            done = run_script(ROOT / "examples" / "ci_reference_check" / "check_reference.py", packed, TRACE)
        assert done.status == 0, done.out + done.err


@pytest.fixture(scope="module")
def index_finger(tmp_path_factory: pytest.TempPathFactory) -> UnpackedFmu:
    folder = tmp_path_factory.mktemp("fmu")
    return unpack(build_fmu(FINGER, folder / "index_finger.fmu"), folder / "unpacked")


def printed_on(platform: str, fmu: UnpackedFmu, library: Path, folder: Path) -> list[str]:
    """What the driver prints of the reference recording, compiled for a platform and run here or in its emulator."""
    recording = read_recording(RECORDING)
    inputs = [recording.frame[name].to_numpy() if name in recording.frame else None for name in fmu.names("input")]
    samples = [
        (float(time), [0.0 if column is None else float(column[k]) for column in inputs])
        for k, time in enumerate(recording.time)
    ]
    emulator: list[str] = []
    if platform == "aarch64-linux":
        require("qemu")
        emulator = ["qemu-aarch64-static", "-L", str(require("aarch64 library"))]
    if platform == "win64":
        require("wine")
        emulator = ["wine"]
    target = next(target for target in portable.TARGETS if target.platform == platform and target.fmi == 2)
    driver = folder / f"driver-{platform}{'.exe' if platform == 'win64' else ''}"
    flags = ["-std=c11", "-O2", "-Wall", "-Wextra", "-Werror", "-DFMI=2", "-isystem", str(portable.fmi_headers())]
    link = [] if platform == "win64" else ["-ldl"]
    run(*portable.zig_command(), "-target", target.triple, *flags, str(DRIVER), "-o", str(driver), *link)
    environment = dict(os.environ, WINEPREFIX=str(folder / "wine"), WINEDEBUG="-all")
    identifier, resources, file = arguments(fmu, write_samples(fmu, folder / "samples.txt", samples))
    if platform == "win64":
        resources = str(resources).replace("file://", "file:///Z:")  # wine's drive Z: is the host's root
    command = [*emulator, str(driver), str(library), identifier, resources, file]
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True, env=environment, check=False)
    assert done.returncode == 0, done.stderr
    assert len(set(done.stdout.splitlines())) > 0.9 * len(samples)  # it moves
    return done.stdout.split()


@pytest.mark.long
@pytest.mark.skipif(
    sys.platform != "linux" or os.uname().machine != "x86_64", reason="SKIPPED: compared on Linux x86-64 only"
)
@pytest.mark.parametrize("platform", ["linux64", "aarch64-linux", "win64"])
def test_a_portable_library_gives_the_bits_of_the_native_one(
    binaries: Path, index_finger: UnpackedFmu, platform: str, tmp_path: Path
) -> None:
    """One rounding for each operation everywhere, no function of the system's libm but sqrt and floor."""
    require("zig")
    (library,) = (binaries / platform).glob("tendonfmu.*")
    native = printed_on("linux64", index_finger, index_finger.binary, tmp_path)
    assert printed_on(platform, index_finger, library, tmp_path) == native
