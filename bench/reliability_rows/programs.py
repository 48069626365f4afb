"""Compiles the model's and the FMU's own sources with other compilers and flags, and the programs of this folder."""

from __future__ import annotations

import importlib.util
import json
import shutil
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .row import ROOT, SUPPORT, Run, Unavailable, called

sys.path[:0] = [str(SUPPORT), str(ROOT / "tools")]

import portable_binaries as portable  # noqa: E402

from fmu_binary import FINGER, UnpackedFmu, unpack  # noqa: E402

HERE = Path(__file__).resolve().parent
CALIBRATED = ROOT / "examples" / "demo_recording" / "index_finger_calibrated.json"
BASE = ("-std=c11", "-ffp-contract=off")


def compilers() -> dict[str, list[str]]:
    """By name: those that are here."""
    found = {name: [name] for name in ("gcc", "clang") if shutil.which(name)}
    if importlib.util.find_spec("ziglang"):
        found["zig"] = [sys.executable, "-m", "ziglang", "cc"]
    return found


def compiler(*names: str) -> list[str]:
    here = compilers()
    for name in names:
        if name in here:
            return here[name]
    raise Unavailable(f"none of the compilers {', '.join(names)} is installed")


def includes(table: Path) -> list[str]:
    core = ROOT / "runtime" / "core"
    folders = (table, ROOT / "runtime" / "include", core, core / "effects", core / "kernel", ROOT / "fmu_src", HERE)
    version = portable.version()
    words = [f"-I{folder}" for folder in folders] + ["-isystem", str(portable.fmi_headers())]
    return [*words, f'-DTENDONFMU_VERSION="{version}"']


def library(run: Run, name: str, flags: Sequence[str], by: Sequence[str]) -> Path:
    """The FMU's library, compiled anew."""
    folder = run.work / name
    folder.mkdir(parents=True, exist_ok=True)
    portable.generate_table(folder)
    sources = [str(each) for each in portable.core_sources() + portable.fmu_sources()]
    out = folder / "tendonfmu.so"
    exports = f"-Wl,--version-script={ROOT / 'fmu_src' / 'exports.map'}"
    called(
        *by,
        *BASE,
        *flags,
        "-shared",
        "-fPIC",
        "-fvisibility=hidden",
        exports,
        *includes(folder),
        *sources,
        "-lm",
        "-o",
        out,
    )
    return out


def is_current(program: Path) -> bool:
    """Whether it is younger than all that it is made from: fifteen builds take minutes."""
    folders = (ROOT / "runtime" / "core", ROOT / "runtime" / "include", HERE)
    newest = max(file.stat().st_mtime for folder in folders for file in folder.rglob("*.[ch]"))
    return program.is_file() and program.stat().st_mtime > newest


def core_program(run: Run, name: str, flags: Sequence[str], by: Sequence[str]) -> Path:
    """core_steps.c with the core, compiled and linked in one call."""
    run.work.mkdir(parents=True, exist_ok=True)
    out = run.work / f"core_steps-{name}"
    sources = [str(each) for each in portable.core_sources()]
    if is_current(out):
        return out
    called(*by, *BASE, *flags, *includes(run.work), HERE / "core_steps.c", *sources, "-lm", "-o", out)
    return out


def call_program(run: Run, name: str, flags: Sequence[str], by: Sequence[str]) -> Path:
    """fmu_calls.c, which loads a library."""
    run.work.mkdir(parents=True, exist_ok=True)
    out = run.work / f"fmu_calls-{name}"
    called(
        *by,
        "-std=c11",
        *flags,
        "-frounding-math",
        "-rdynamic",
        *includes(run.work),
        HERE / "fmu_calls.c",
        ROOT / "runtime" / "core" / "bytes.c",
        "-ldl",
        "-lm",
        "-lpthread",
        "-o",
        out,
    )
    return out


@dataclass(frozen=True)
class Packed:
    """An FMU unpacked, and the file of references that fmu_calls reads."""

    fmu: UnpackedFmu
    path: Path
    table: Path

    def words(self, library: Path | None = None) -> list[str]:
        """Arguments of fmu_calls."""
        return [str(library or self.fmu.binary), self.fmu.guid, self.fmu.location.decode(), str(self.table)]


def packed(run: Run, description: dict[str, Any] | Path, name: str) -> Packed:
    from tendonfmu.fmu.packaging import build_fmu

    folder = run.work / "fmus" / name
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    if isinstance(description, Path):
        shutil.copy(description, folder / "finger.json")
    else:
        (folder / "finger.json").write_text(json.dumps(description))
    path = build_fmu(folder / "finger.json", folder / f"{name}.fmu")
    fmu = unpack(path, folder / "unpacked")
    return Packed(fmu, path, table_of(fmu, folder / "references.txt"))


def table_of(fmu: UnpackedFmu, file: Path) -> Path:
    groups = ("tendon_force", "tendon_position", "joint_position", "joint_velocity")
    by_group = [[n for n in fmu.names("input") if n.startswith(f"{group}[")] for group in groups]
    inputs = [fmu.variables[name].vr for names in by_group for name in names]
    outputs = [fmu.variables[name].vr for name in fmu.names("output")]
    lines = [[len(by_group[0]), len(by_group[2])], inputs, [len(outputs)], outputs]
    file.write_text("\n".join(" ".join(map(str, line)) for line in lines) + "\n")
    return file


def small(run: Run) -> Packed:
    return packed(run, FINGER, "small_finger")


def calibrated(run: Run) -> Packed:
    """Four joints, eight tendons, all that `calibrate` writes."""
    return packed(run, CALIBRATED, "calibrated")


def image(run: Run, description: Path | dict[str, Any], name: str) -> Path:
    """The model image of a description, as a file."""
    from tendonfmu.model import read_finger

    file = run.work / f"{name}.image"
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_bytes(read_finger(description).image)
    return file
