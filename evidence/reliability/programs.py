"""Compiles the model's and the FMU's own sources with other compilers and flags, and the programs of this folder."""

from __future__ import annotations

import importlib.util
import itertools
import shutil
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import fmpy

from evidence.reliability.row import Run, Unavailable, called
from evidence.runner import EXAMPLES, ROOT
from tendonfmu.fmu import build_fmu
from tendonfmu.model import read_finger

sys.path.append(str(ROOT / "tools"))

import portable_binaries as portable

HERE = Path(__file__).resolve().parent
CALIBRATED = EXAMPLES / "demo_recording" / "index_finger_calibrated.json"
BASE = ("-std=c11", "-ffp-contract=off")


def compilers() -> dict[str, list[str]]:
    """By name: those that are here."""
    installed = {name: [name] for name in ("gcc", "clang") if shutil.which(name)}
    if importlib.util.find_spec("ziglang"):
        installed["zig"] = [sys.executable, "-m", "ziglang", "cc"]
    return installed


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
    sources = [*portable.core_sources(), *portable.fmu_sources()]
    exports = f"-Wl,--version-script={ROOT / 'fmu_src' / 'exports.map'}"
    shared = ["-shared", "-fPIC", "-fvisibility=hidden", exports]
    out = folder / "tendonfmu.so"
    called(*by, *BASE, *flags, *shared, *includes(folder), *sources, "-lm", "-o", out)
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
    if not is_current(out):
        sources = [HERE / "core_steps.c", *portable.core_sources()]
        called(*by, *BASE, *flags, *includes(run.work), *sources, "-lm", "-o", out)
    return out


def call_program(run: Run, name: str, flags: Sequence[str], by: Sequence[str]) -> Path:
    """fmu_calls.c, which loads a library."""
    run.work.mkdir(parents=True, exist_ok=True)
    out = run.work / f"fmu_calls-{name}"
    sources = [HERE / "fmu_calls.c", ROOT / "runtime" / "core" / "bytes.c"]
    words = ["-std=c11", *flags, "-frounding-math", "-rdynamic", *includes(run.work)]
    called(*by, *words, *sources, "-ldl", "-lm", "-lpthread", "-o", out)
    return out


@dataclass(frozen=True)
class Packed:
    """An FMU unpacked, and the file of references that fmu_calls reads."""

    guid: str
    folder: Path
    table: Path

    @property
    def binary(self) -> Path:
        return next((self.folder / "binaries" / "linux64").glob("*.so"))

    def words(self, library: Path | None = None) -> list[str]:
        """Arguments of fmu_calls."""
        return [str(library or self.binary), self.guid, (self.folder / "resources").as_uri(), str(self.table)]


def packed(run: Run, description: Path) -> Packed:
    folder = run.work / "fmus" / description.stem
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    unpacked = Path(fmpy.extract(str(build_fmu(description, folder / "finger.fmu")), str(folder / "unpacked")))
    model = fmpy.read_model_description(unpacked)
    references = {variable.name: variable.valueReference for variable in model.modelVariables}
    inputs = [variable.name for variable in model.modelVariables if variable.causality == "input"]
    outputs = [v.valueReference for v in model.modelVariables if v.causality == "output" and v.type == "Real"]
    groups = ("tendon_force", "tendon_position", "joint_position", "joint_velocity")
    by_group = [[references[name] for name in inputs if name.startswith(f"{group}[")] for group in groups]
    lines = [[len(by_group[0]), len(by_group[2])], list(itertools.chain(*by_group)), [len(outputs)], outputs]
    table = folder / "references.txt"
    table.write_text("\n".join(" ".join(map(str, line)) for line in lines) + "\n")
    return Packed(model.guid, unpacked, table)


def small(run: Run) -> Packed:
    """Small, with something of everything: an asymmetric law, working points, a cable loop, a pulley."""
    return packed(run, HERE / "small_finger.json")


def calibrated(run: Run) -> Packed:
    """Four joints, eight tendons, all that `calibrate` writes."""
    return packed(run, CALIBRATED)


def image(run: Run, description: Path) -> Path:
    """The model image of a description, as a file."""
    file = run.work / f"{description.stem}.image"
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_bytes(read_finger(description).image)
    return file
