"""Cross-compiles the FMU's shared libraries for Linux, Windows and macOS with the Python package ziglang.

    python tools/portable_binaries.py OUTDIR [--only PLATFORM ...]
    tendonfmu build FINGER.json -o FINGER.fmu --binaries OUTDIR/binaries

OUTDIR/binaries holds one folder per FMI platform (docs/reference/portable_binaries.md). FMI 2.0 and 3.0 have different
names for them; a folder of both has two libraries.
The folder appears whole or not at all.
Exit status: 0 done, 1 a binary is not portable, 2 bad usage, or it cannot be built here.
"""

from __future__ import annotations

import argparse
import importlib.util
import re
import shutil
import struct
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from binary_contents import Contents, broken_promises, read_contents

ROOT = Path(__file__).resolve().parent.parent
STEMS = {2: "tendonfmu", 3: "tendonfmu_fmi3"}  # by the version of FMI
EXPORTS = {2: "exports.map", 3: "fmi3_exports.map"}
SOURCES = {2: "TENDONFMU_FMU_SOURCES", 3: "TENDONFMU_FMI3_FMU_SOURCES"}
FLAGS = ("-std=c11", "-O2", "-DNDEBUG", "-ffp-contract=off", "-fvisibility=hidden", "-Wall", "-Wextra", "-Werror")
GLIBC = (2, 17)  # RHEL 7; of the year 2012
# What a library may need: the C library and libm of its system, nothing of a compiler.
SYSTEM_LIBRARIES = {
    "ELF": re.compile(r"lib[cm]\.so\.6"),
    "PE": re.compile(r"(api-ms-win-crt-[a-z]+-l1-1-0|KERNEL32|ntdll)\.dll"),
    "Mach-O": re.compile(r"/usr/lib/libSystem\.B\.dylib"),
}
# zig's linker for macOS always marks the library's own header so; nothing can be called there.
LINKER_MARKS = frozenset({"_mh_dylib_header", "__dso_handle"})

UNIVERSAL_MAGIC, UNIVERSAL_ALIGNMENT = 0xCAFEBABE, 14  # 2**14: a page of arm64


class BuildError(Exception):
    """One line: what failed, where, what was expected."""


_GLIBC_NAME = ".".join(map(str, GLIBC))


@dataclass(frozen=True)
class Target:
    """triple: zig's name. fmi: version. Targets of one library become one file (macOS: one for both processors)."""

    platform: str
    triple: str
    suffix: str
    fmi: int = 2

    @property
    def library(self) -> str:
        """Path in the folder of all libraries."""
        return f"{self.platform}/{STEMS[self.fmi]}{self.suffix}"

    @property
    def options(self) -> tuple[str, ...]:
        if self.suffix == ".so":
            return ("-fPIC", f"-Wl,--version-script={ROOT / 'fmu_src' / EXPORTS[self.fmi]}", "-Wl,-Bsymbolic")
        return (f"-Wl,-install_name,@rpath/{STEMS[self.fmi]}.dylib",) if self.suffix == ".dylib" else ()


TARGETS = (
    Target("linux64", f"x86_64-linux-gnu.{_GLIBC_NAME}", ".so"),
    Target("aarch64-linux", f"aarch64-linux-gnu.{_GLIBC_NAME}", ".so"),
    Target("win64", "x86_64-windows-gnu", ".dll"),
    Target("darwin64", "x86_64-macos.11.0", ".dylib"),
    Target("darwin64", "aarch64-macos.11.0", ".dylib"),
    Target("x86_64-linux", f"x86_64-linux-gnu.{_GLIBC_NAME}", ".so", 3),
    Target("aarch64-linux", f"aarch64-linux-gnu.{_GLIBC_NAME}", ".so", 3),
    Target("x86_64-windows", "x86_64-windows-gnu", ".dll", 3),
    Target("x86_64-darwin", "x86_64-macos.11.0", ".dylib", 3),
    Target("aarch64-darwin", "aarch64-macos.11.0", ".dylib", 3),
)
PLATFORMS = tuple(dict.fromkeys(target.platform for target in TARGETS))


# --- compiling -------------------------------------------------------------------------------------------------------


def zig_command() -> list[str]:
    if importlib.util.find_spec("ziglang") is None:
        raise BuildError("ziglang: not installed; expected the packages of locks/wheel.lock")
    return [sys.executable, "-m", "ziglang", "cc"]


def cmake_list(path: Path, name: str) -> list[str]:
    """The words of set(NAME ...) in a CMake file, without comments; ${OTHER} is the list of that name."""
    found = re.search(rf"set\({name}\b(.*?)\)", re.sub(r"#.*", "", path.read_text(encoding="utf-8")), re.DOTALL)
    if not found:
        raise BuildError(f"{path}: no list {name}; expected set({name} ...)")
    lists = {word: re.fullmatch(r"\$\{(\w+)\}", word) for word in found[1].split()}
    return [each for word, other in lists.items() for each in (cmake_list(path, other[1]) if other else [word])]


def core_sources() -> list[Path]:
    runtime = ROOT / "runtime"
    names = cmake_list(runtime / "CMakeLists.txt", "TENDONFMU_CORE_SOURCES")
    return [runtime / name for name in names if name.endswith(".c")]


def fmu_sources(fmi: int = 2) -> list[Path]:
    return [ROOT / "fmu_src" / name for name in cmake_list(ROOT / "fmu_src" / "CMakeLists.txt", SOURCES[fmi])]


def version() -> str:
    text = (ROOT / "CMakeLists.txt").read_text(encoding="utf-8")
    found = re.search(r"project\(\s*tendonfmu\s+VERSION\s+([\d.]+)", text)
    if not found:
        raise BuildError("CMakeLists.txt: expected project(tendonfmu VERSION ...)")
    return found[1]


def fmi_headers() -> Path:
    """The folder of fmi2Functions.h and fmi3Functions.h, which the package fmpy brings along."""
    spec = importlib.util.find_spec("fmpy")
    folder = Path(spec.submodule_search_locations[0]) / "c-code" if spec and spec.submodule_search_locations else None
    if folder is None or not (folder / "fmi2Functions.h").is_file():
        raise BuildError("fmi2Functions.h: not found; expected the Python package fmpy, which brings it along")
    return folder


def generate_table(folder: Path) -> None:
    """variable_table.h, made by the same script as in an ordinary build."""
    description = ROOT / "modelDescription"
    script, table = description / "generate_variables.py", description / "variables.json"
    _run([sys.executable, str(script), str(table), str(folder / "variable_table.h")], "variable_table.h")


def compile_library(target: Target, folder: Path) -> Path:
    """The shared library of one target, in `folder`, which also takes what the linker leaves behind."""
    generate_table(folder)
    core = ROOT / "runtime" / "core"
    include = [folder, ROOT / "runtime" / "include", core, *core.glob("*/"), ROOT / "fmu_src"]
    library = folder / f"{STEMS[target.fmi]}{target.suffix}"
    command = [*zig_command(), "-target", target.triple, *FLAGS, f'-DTENDONFMU_VERSION="{version()}"', "-shared", "-s"]
    command += [f"-I{each}" for each in include] + ["-isystem", str(fmi_headers()), *target.options]
    _run([*command, *map(str, core_sources() + fmu_sources(target.fmi)), "-o", str(library)], target.triple)
    return library


def _run(command: Sequence[str], what: str) -> None:
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise BuildError(f"{what}: exit status {done.returncode}; {(done.stderr or done.stdout).strip()}")


def universal(libraries: Iterable[bytes]) -> bytes:
    """One Mach-O file of several processors: header, then each library on a page of its own."""
    libraries = list(libraries)
    page = 1 << UNIVERSAL_ALIGNMENT
    header, body, at = struct.pack(">II", UNIVERSAL_MAGIC, len(libraries)), b"", page
    for library in libraries:
        processor, subtype = struct.unpack_from("<II", library, 4)
        header += struct.pack(">IIIII", processor, subtype, at, len(library), UNIVERSAL_ALIGNMENT)
        body += library + bytes(-len(library) % page)
        at = page + len(body)
    return header.ljust(page, b"\0") + body


# --- checking --------------------------------------------------------------------------------------------------------


def findings(contents: Contents, fmi: int = 2) -> list[str]:
    """What makes a library less portable than promised; empty for a good one."""
    exports = re.compile(rf"fmi{fmi}\w+|{'|'.join(sorted(LINKER_MARKS))}")
    found = broken_promises(contents, exports, SYSTEM_LIBRARIES[contents.format], GLIBC)
    if f"fmi{fmi}DoStep" not in contents.exports:
        found.append(f"does not export fmi{fmi}DoStep")
    return found


def build_library(library: str, folder: Path) -> tuple[bytes, list[Contents]]:
    """The library of one platform and version, and the contents of each of its parts. Raises BuildError."""
    parts = []
    for target in TARGETS:
        if target.library == library:
            scratch = folder / f"{target.triple}-{target.fmi}"
            scratch.mkdir()
            parts.append(compile_library(target, scratch).read_bytes())
    return parts[0] if len(parts) == 1 else universal(parts), [read_contents(part) for part in parts]


# --- command ---------------------------------------------------------------------------------------------------------


def build_all(platforms: Sequence[str], output: Path) -> int:
    """Builds into output/binaries, replacing it, and prints a line per library. Returns the exit status."""
    output.mkdir(parents=True, exist_ok=True)
    status = 0
    with tempfile.TemporaryDirectory(dir=output, prefix=".building-") as name:
        finished = Path(name) / "binaries"
        libraries = {target.library: target for target in TARGETS if target.platform in platforms}
        for library, target in libraries.items():
            started = time.monotonic()
            if target.platform == "win64":
                print("win64: the first time takes minutes (zig compiles the C library of Windows) ...", flush=True)
            data, contents = build_library(library, Path(name))
            (finished / library).parent.mkdir(parents=True, exist_ok=True)
            (finished / library).write_bytes(data)
            seconds = time.monotonic() - started
            for part in contents:
                glibc = f", GLIBC {part.glibc[-1]}" if part.glibc else ""
                print(f"{library}: {part.machine} {part.format}, {len(part.exports - LINKER_MARKS)} exports{glibc}")
                for finding in findings(part, target.fmi):
                    status = 1
                    print(f"portable_binaries: {library}, {part.machine}: {finding}", file=sys.stderr)
            print(f"{library}: {len(data) / 1024:.0f} KiB, {seconds:.1f} s", flush=True)
        if status == 0:
            shutil.rmtree(output / "binaries", ignore_errors=True)
            finished.replace(output / "binaries")
    return status


def main(arguments: Sequence[str]) -> int:
    parser = argparse.ArgumentParser(description="Cross-compiles the FMU's shared libraries with the package ziglang.")
    parser.add_argument("output", type=Path, metavar="OUTDIR")
    parser.add_argument("--only", nargs="+", choices=PLATFORMS, default=PLATFORMS, metavar="PLATFORM")
    options = parser.parse_args(arguments)
    try:
        return build_all(list(dict.fromkeys(options.only)), options.output)
    except (BuildError, OSError) as failed:
        print(f"portable_binaries: {failed}", file=sys.stderr)
        return 2


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
