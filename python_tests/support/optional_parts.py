"""What tests want beyond what `./run` installs: asked for here alone, and no failure where it is absent.

A test that needs a part is skipped without it. The reason says what is not tested, and where the part comes from:

    mujoco = require("mujoco")              # at the top of a module, or in a test: the imported package, or the path
    @needs("valgrind")                      # of one test
"""

from __future__ import annotations

import functools
import importlib
import os
import shutil
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from repository_paths import ROOT

DATA = Path(os.environ.get("TENDONFMU_DATA") or ROOT.parent / "shared" / "data")
RECORDINGS = "../shared beside the repository, or $TENDONFMU_DATA"
FMI4J = ROOT / "build" / "clients" / "fmi4j"
MAESTRO = ROOT / "build" / "clients" / "maestro-2.3.0-jar-with-dependencies.jar"
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome", "microsoft-edge")


@dataclass(frozen=True)
class Part:
    """Something optional; `find` returns it, or None."""

    untested: str  # what is not tested without it
    source: str  # where it comes from
    find: Callable[[], Any]


def _package(untested: str, name: str, source: str) -> Part:
    def find() -> Any:
        try:
            return importlib.import_module(name)
        except (ImportError, OSError):  # OSError: a library that the package wants is not there
            return None

    return Part(untested, source, find)


def _which(name: str) -> str | None:
    """Return a program that is beside this Python, or on the path."""
    return shutil.which(name, path=str(Path(sys.executable).parent)) or shutil.which(name)


def _program(untested: str, source: str, *names: str) -> Part:
    return Part(untested, source, lambda: next(filter(None, map(_which, names)), None))


def _file(untested: str, path: Path, source: str) -> Part:
    return Part(untested, source, lambda: path if path.exists() else None)


PARTS = {
    "mujoco": _package("fingers of MuJoCo", "mujoco", "locks/interop.lock"),
    "ecos": _package("our FMUs in ecos", "ecospy", "locks/interop.lock and the library libtbb12"),
    "libcosim": _package("our FMUs in libcosim", "libcosimpy", "locks/interop.lock"),
    "pythonfmu": _package("FMUs of pythonfmu", "pythonfmu", "locks/interop.lock"),
    "pythonfmu3": _package("FMUs of pythonfmu3", "pythonfmu3", "locks/interop.lock"),
    "fmutool": _program("our FMUs in the FMU Manipulation Toolbox", "locks/interop.lock", "fmutool"),
    "fmi-sim": _program(
        "our FMUs in fmi-sim", "cargo install fmi-sim", os.environ.get("TENDONFMU_FMI_SIM") or "fmi-sim"
    ),
    "java": _program("our FMUs in programs in Java", "a Java runtime", "java"),
    "fmi4j": _file("our FMUs in FMI4j", FMI4J, "tools/nightly fetches it with Maven"),
    "maestro": _file("our FMUs in Maestro and VDMCheck", MAESTRO, "tools/nightly fetches it with Maven"),
    "zig": _package("portable binaries", "ziglang", "locks/wheel.lock"),
    "davinci data": _file("the da Vinci tools", DATA / "davinci_tool", RECORDINGS),
    "emps data": _file("the carriage EMPS", DATA / "emps", RECORDINGS),
    "psm data": _file("the surgical arm PSM", DATA / "psm", RECORDINGS),
    "wire data": _file("the manipulator pulled by wires", DATA / "wire", RECORDINGS),
    "so101 data": _file("the servo arm SO-101", DATA / "so101", RECORDINGS),
    "foreign data": _file("recordings of foreign fingers", DATA.parent / "foreign", RECORDINGS),
    "cases": _file("logs of public reports", DATA.parent / "cases", RECORDINGS),
    "browser": _program("pages in a browser", "Debian: chromium", *BROWSERS),
    "pkg-config": _program("the libraries as pkg-config offers them", "Debian: pkg-config", "pkg-config"),
    "valgrind": _program("memory as valgrind sees it", "Debian: valgrind", "valgrind"),
    "wine": _program("Windows binaries", "Debian: wine64", "wine64", "wine"),
    "qemu": _program("binaries for aarch64", "Debian: qemu-user-static", "qemu-aarch64-static"),
    "arm gcc": _program(
        "the core on a microcontroller",
        "Debian: gcc-arm-none-eabi, libnewlib-arm-none-eabi",
        "arm-none-eabi-gcc",
    ),
    "qemu-system-arm": _program("the core on a microcontroller", "Debian: qemu-system-arm", "qemu-system-arm"),
    "aarch64 library": _file("binaries for aarch64", Path("/usr/aarch64-linux-gnu"), "Debian: libc6-arm64-cross"),
    "nm": _program("symbols of the binaries", "Debian: binutils", "nm"),
    "objdump": _program("code of the binaries", "Debian: binutils", "objdump"),
    "readelf": _program("what the binaries need", "Debian: binutils", "readelf"),
    "git": Part(
        "what git tracks", "Debian: git, and a checkout", lambda: (ROOT / ".git").exists() and shutil.which("git")
    ),
}


@functools.cache
def _found(name: str) -> Any:
    return PARTS[name].find()


def _reason(name: str) -> str:
    return f"NOT TESTED: {PARTS[name].untested} ({name}; {PARTS[name].source})"


def require(name: str) -> Any:
    """Return a part; the test, or the module that asks for it, is skipped where it is not there."""
    if not is_there(name):
        pytest.skip(_reason(name), allow_module_level=True)
    return _found(name)


def is_there(name: str) -> bool:
    return bool(_found(name))


def needs(*names: str) -> pytest.MarkDecorator:
    missing = [name for name in names if not is_there(name)]
    return pytest.mark.skipif(bool(missing), reason="; ".join(map(_reason, missing)))
